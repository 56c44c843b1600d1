"""The planner alone: `ros2 launch dubins_rrt_ros planner.launch.py map:=maze rviz:=true`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

CONFIG = PathJoinSubstitution([FindPackageShare("dubins_rrt_ros"), "config"])
ARGUMENTS = [
    DeclareLaunchArgument("map", default_value="",
                          description="map file or installed map, in place of that of params_file; empty: by topic"),
    DeclareLaunchArgument("params_file", default_value=PathJoinSubstitution([CONFIG, "planner.yaml"]),
                          description="the planner's parameters"),
    DeclareLaunchArgument("namespace", default_value="", description="namespace of the planner and of RViz"),
    DeclareLaunchArgument("use_sim_time", default_value="false", description="take the time from /clock"),
    DeclareLaunchArgument("rviz", default_value="false", description="start RViz too"),
]


def generate_launch_description():
    """Return the planner's node, and RViz where it is asked for."""
    namespace, use_sim_time = LaunchConfiguration("namespace"), LaunchConfiguration("use_sim_time")
    planner = Node(package="dubins_rrt_ros", executable="planner", name="planner", namespace=namespace, output="screen",
                   parameters=[LaunchConfiguration("params_file"),
                               {"map_file": LaunchConfiguration("map"), "use_sim_time": use_sim_time}])
    rviz = Node(package="rviz2", executable="rviz2", namespace=namespace, condition=IfCondition(LaunchConfiguration("rviz")),
                arguments=["-d", PathJoinSubstitution([CONFIG, "planner.rviz"])], parameters=[{"use_sim_time": use_sim_time}])
    return LaunchDescription([*ARGUMENTS, planner, rviz])
