"""The interfaces of Nav2's planner_server, where nav2_msgs is installed."""

from typing import Any

from rclpy.callback_groups import CallbackGroup

from .conversions import filled
from .dispatcher import Dispatcher
from .executor_queue import ExecutorQueue
from .frames import Frames
from .managed_node import ManagedNode
from .maps import Maps
from .nav2_action import PathAction, PathServer
from .nav2_validity import PathValidity
from .outputs import Outputs
from .parameters import Parameters
from .readiness import Readiness

try:
    from nav2_msgs.action import ComputePathThroughPoses, ComputePathToPose
    from nav2_msgs.srv import ClearEntireCostmap, IsPathValid
except ImportError:  # part of an installation of ROS, not of the packages for pip
    IsPathValid = None
    ACTIONS: tuple[PathAction, ...] = ()
else:
    ACTIONS = (PathAction(ComputePathToPose, "compute_path_to_pose", 0),
               PathAction(ComputePathThroughPoses, "compute_path_through_poses", 100))


class Nav2:
    """Serves actions and service as Nav2's planner_server does, or logs once that they are not there, and why."""

    def __init__(self, node: ManagedNode, parameters: Parameters, maps: Maps, readiness: Readiness, frames: Frames,
                 dispatcher: Dispatcher, outputs: Outputs, queue: ExecutorQueue, group: CallbackGroup):
        self._actions = [PathServer(node, action, parameters, dispatcher, readiness, frames, outputs, group)
                         for action in ACTIONS]
        if IsPathValid is None:
            node.get_logger().info("Without nav2_msgs there are no actions for Nav2; to have them install ros-jazzy-nav2-msgs")
        else:
            self._validity = PathValidity(node, IsPathValid, parameters, maps, readiness, dispatcher, queue, group)
            if parameters.read().node.clear_costmap_service:
                node.create_service(ClearEntireCostmap, "global_costmap/clear_entirely_global_costmap", _clear_nothing)

    def close(self) -> None:
        """End the actions."""
        for action in self._actions:
            action.close()


def _clear_nothing(request: Any, response: Any) -> Any:
    """Answer Nav2's default behaviour trees, which clear the costmap before they plan again: there is none."""
    return filled(response, success=True)
