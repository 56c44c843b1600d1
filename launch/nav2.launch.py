"""Nav2's navigation servers with this planner in the place of planner_server: `ros2 launch dubins_rrt_ros nav2.launch.py`.

As nav2_bringup's navigation_launch.py starts them, without composition, collision_monitor and docking_server: nothing checks the
velocities of velocity_smoother. The map and the robot's pose come from elsewhere, such as
nav2_bringup's localization_launch.py.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

#: Nav2's servers, each in the package of its name.
SERVERS = ["controller_server", "smoother_server", "behavior_server", "bt_navigator", "waypoint_follower", "velocity_smoother"]
PACKAGES = {server: f"nav2_{server.removesuffix('_server')}" for server in SERVERS} | {"behavior_server": "nav2_behaviors"}
#: In the order in which the lifecycle manager brings them up.
MANAGED = ["controller_server", "smoother_server", "planner_server", *SERVERS[2:]]
REMAPPINGS = {"controller_server": [("cmd_vel", "cmd_vel_nav")], "behavior_server": [("cmd_vel", "cmd_vel_nav")],
              "velocity_smoother": [("cmd_vel", "cmd_vel_nav"), ("cmd_vel_smoothed", "cmd_vel")]}
ARGUMENTS = [
    DeclareLaunchArgument("params_file", description="the robot's parameters, with a planner_server as in nav2_params.yaml",
                          default_value=PathJoinSubstitution([FindPackageShare("dubins_rrt_ros"), "config", "nav2_params.yaml"])),
    DeclareLaunchArgument("namespace", default_value="",
                          description="namespace of all nodes; params_file must begin with it: /robot1: {planner_server: ...}"),
    DeclareLaunchArgument("use_sim_time", default_value="false", description="take the time from /clock"),
]


def generate_launch_description():
    """Return Nav2's servers, the planner and the lifecycle manager."""
    parameters = [LaunchConfiguration("params_file"), {"use_sim_time": LaunchConfiguration("use_sim_time")}]

    def started(package, executable, name, **more):
        return Node(package=package, executable=executable, name=name, namespace=LaunchConfiguration("namespace"),
                    output="screen", **{"parameters": parameters, **more})

    nodes = [started(PACKAGES[server], server, server, remappings=REMAPPINGS.get(server, [])) for server in SERVERS]
    planner = started("dubins_rrt_ros", "planner", "planner_server")
    manager = started("nav2_lifecycle_manager", "lifecycle_manager", "lifecycle_manager_navigation",
                      parameters=[*parameters, {"autostart": True, "node_names": MANAGED, "bond_timeout": 0.0}])
    return LaunchDescription([*ARGUMENTS, *nodes, planner, manager])
