"""What Nav2 asks of a planner: the interfaces of its planner_server, where nav2_msgs is installed."""

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from .dispatcher import Dispatcher
from .frames import Frames
from .nav2_action import PathAction, PathServer
from .outputs import Outputs
from .parameters import Parameters
from .readiness import Readiness

try:
    from nav2_msgs.action import ComputePathToPose
except ImportError:  # part of an installation of ROS, not of the packages for pip
    ACTIONS: tuple[PathAction, ...] = ()
else:
    ACTIONS = (PathAction(ComputePathToPose, "compute_path_to_pose", 0),)


def serve_nav2(node: Node, parameters: Parameters, dispatcher: Dispatcher, readiness: Readiness, frames: Frames, outputs: Outputs,
               group: CallbackGroup) -> list[PathServer]:
    """Serve the actions of Nav2's planner_server, or log once that they are not there, and why."""
    if not ACTIONS:
        node.get_logger().info("Without nav2_msgs there is no action compute_path_to_pose; for Nav2 install ros-jazzy-nav2-msgs")
    return [PathServer(node, action, parameters, dispatcher, readiness, frames, outputs, group) for action in ACTIONS]
