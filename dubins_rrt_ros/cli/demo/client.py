"""The ROS side of the demonstration: a node of its own that asks the planner for a path over topics."""

import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import Marker, MarkerArray

from dubins_rrt_ros.node.conversions import grid_from, pose_from, pose_message
from dubins_rrt_ros.planning import GridMap
from dubins_rrt_ros.planning.maps.opening import MAX_MAP_CELLS
from dubins_rrt_ros.planning.problem import Pose

from .process import DemoError

FRAME = "map"
#: Time limit for anything expected to arrive [s].
TIMEOUT = 30.0
FIGURES = ("path_length", "lower_bound", "gap", "time_to_first", "planning_time", "samples", "tree_nodes")


class Answer(NamedTuple):
    """The messages of the planner.

    Attributes:
        figures: the figures of the final status, by name.
        map: the map.
        path: (n, 3) poses.
        tree: (m, 2, 2) line segments.
    """

    figures: Mapping[str, float]
    map: GridMap
    path: np.ndarray
    tree: np.ndarray


class DemoClient:
    """A context manager that runs a node.

    Args:
        check: called while waiting; raises where waiting is in vain.
    """

    def __init__(self, check: Callable[[], None]):
        self._check = check
        self._latest: dict[str, Any] = {}

    def __enter__(self) -> "DemoClient":
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context)
        self._node = rclpy.create_node("dubins_rrt_demo", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._failure = ""  # the first one's sentence; a warning may follow that says what the goal waits for
        for kind, topic in ((OccupancyGrid, "map"), (PathMessage, "plan")):
            self._subscribe(kind, topic)
        self._subscribe(DiagnosticStatus, "planner/status", depth=10)
        self._start, self._goal = (self._node.create_publisher(PoseStamped, topic, 1)
                                   for topic in ("start_pose", "goal_pose"))
        return self

    def __exit__(self, *exception: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def ask(self, start: Pose, goal: Pose, parameters: Mapping[str, Any]) -> Answer:
        """Ask for a path, and return the planner's answer when it has used its budget.

        Raises:
            DemoError: it found no path, or something did not arrive in time.
        """
        self._wait(lambda: "map" in self._latest, "no map")
        self._publish(self._start, start)
        self._publish(self._goal, goal)
        self._wait(lambda: _is_final(self._values(), parameters), "no final status")
        self._check_path()
        self._wait(self._has_path, "no path")
        # Only now: the node builds the markers of the tree while somebody subscribes, and that takes time from planning.
        self._subscribe(MarkerArray, "planner/tree")
        self._wait(lambda: "planner/tree" in self._latest, "no tree")
        figures = {name: float(self._values()[name]) for name in FIGURES}
        return Answer(figures, grid_from(self._latest["map"], FRAME, MAX_MAP_CELLS), self._path(),
                      _segments(self._latest["planner/tree"]))

    def _subscribe(self, kind: type, topic: str, depth: int = 1) -> None:
        """Keep the latest message of a topic, from before the subscription too."""
        def keep(message: Any) -> None:
            self._latest[topic] = message
            if isinstance(message, DiagnosticStatus) and message.level == DiagnosticStatus.ERROR:
                self._failure = self._failure or message.message

        self._node.create_subscription(kind, topic, keep, QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL))

    def _wait(self, condition: Callable[[], bool], missing: str) -> None:
        """Serve the topics until the condition holds."""
        deadline = time.monotonic() + TIMEOUT
        while not condition():
            self._check()
            if time.monotonic() > deadline:
                raise DemoError(f"{missing} arrived within {TIMEOUT:g} s; see whether a firewall "
                                "blocks UDP multicast on this machine")
            self._executor.spin_once(timeout_sec=0.1)

    def _publish(self, publisher: Publisher, pose: Pose) -> None:
        """Publish and wait for the acknowledgement: the goal must not overtake the start."""
        self._wait(lambda: publisher.get_subscription_count() > 0, f"no listener on {publisher.topic_name}")
        message = PoseStamped(pose=pose_message(pose))
        message.header.frame_id = FRAME
        message.header.stamp = self._node.get_clock().now().to_msg()
        publisher.publish(message)
        publisher.wait_for_all_acked()

    def _values(self) -> dict[str, str]:
        status = self._latest.get("planner/status")
        return {item.key: item.value for item in status.values} if status else {}

    def _check_path(self) -> None:
        if self._values()["error_code"] != "0":
            raise DemoError(f"no path: {self._failure or self._latest['planner/status'].message}")

    def _path(self) -> np.ndarray:
        return np.array([pose_from("plan", pose) for pose in self._latest["plan"].poses]).reshape(-1, 3)

    def _has_path(self) -> bool:
        """Return True if the path is that of the final status, which may arrive before it."""
        path = self._path() if "plan" in self._latest else np.empty((0, 3))
        length = np.hypot(*np.diff(path[:, :2], axis=0).T).sum()
        return abs(length / float(self._values()["path_length"]) - 1) < 1e-3


def _is_final(values: Mapping[str, str], parameters: Mapping[str, Any]) -> bool:
    """Return True if a status reports a failure or a spent budget: RRT* publishes every improvement before."""
    if values.get("plan_id", "0") == "0":
        return False
    return (values["error_code"] != "0" or int(values["samples"]) >= parameters["samples"]
            or float(values["planning_time"]) >= parameters["planning_time"])


def _segments(message: MarkerArray) -> np.ndarray:
    points = [(p.x, p.y) for marker in message.markers if marker.type == Marker.LINE_LIST for p in marker.points]
    return np.array(points, dtype=float).reshape(-1, 2, 2)
