"""The ROS side of the page: what the planner publishes as documents, and what the page asks of it as messages."""

import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseArray, PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

from dubins_rrt_ros.node.conversions import grid_from, path_poses, pose_from, pose_message
from dubins_rrt_ros.node.qos import LATCHED, VOLATILE
from dubins_rrt_ros.planning import Problem, Settings, Vehicle, options
from dubins_rrt_ros.planning.maps.opening import MAX_MAP_CELLS
from dubins_rrt_ros.planning.vehicle import Point

from ..play import messages

#: Maximum number of poses of a path, and of pieces of a tree, that are shown.
MOST_POSES = 3000
#: Time after which parameters are read again [s]: someone else may have changed them.
PARAMETER_PERIOD = 2.0
#: The planner's parameters that the page shows.
NAMES = tuple(item.name for cls in (Vehicle, Problem, Settings) for item in options(cls))
#: The figures of the status that the page shows, by their names there.
FIGURES = {"length": "path_length", "lower_bound": "lower_bound", "gap": "gap", "time_to_first": "time_to_first",
           "planning_time": "planning_time", "min_clearance": "min_clearance"}
Document = dict[str, Any]


class Listener:
    """A node, in a thread of its own, that keeps the newest of all that a planner publishes.

    Attributes:
        latest: the newest document of each type, for pages that come later; the tree as bytes.
        pages: functions that are called with every new document, from the thread of this node.
        lock: held while a document becomes the newest and is shown; a page that comes takes it until it is among `pages`, so that
            it misses none and gets none after a newer one.
    """

    def __init__(self, planner: str):
        """Listen to a planner, by the name of its node; its topics are in its namespace."""
        self.latest: dict[str, Document | bytes] = {}
        self.pages: set[Callable[[Document | bytes], None]] = set()
        self.lock = threading.Lock()
        self._frame = "map"
        self._poses: np.ndarray = np.empty((0, 3))
        self._status: Mapping[str, str] = {}
        self._ends: dict[str, tuple[float, float, float]] = {}
        self._waypoints: list[Point] = []
        self._message = "Waiting for the planner."
        self._location: Point | None = None
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context)
        namespace, _, name = planner.rpartition("/")
        self._node = rclpy.create_node("dubins_rrt_watch", namespace=namespace, context=self._context)
        self._parameters = AsyncParameterClient(self._node, planner)
        self._cancel = self._node.create_client(Trigger, f"{name}/cancel")
        self._publishers = {topic: self._node.create_publisher(kind, topic, VOLATILE) for topic, kind in (
            ("start_pose", PoseStamped), ("goal_pose", PoseStamped), ("goal_poses", PoseArray))}
        for kind, topic, take, qos in (
                (OccupancyGrid, "map", self._take_map, LATCHED), (PathMessage, "plan", self._take_path, LATCHED),
                (DiagnosticStatus, f"{name}/status", self._take_status, LATCHED),
                (MarkerArray, f"{name}/tree", self._take_tree, LATCHED),
                (PoseStamped, "start_pose", lambda message: self._take_pose("start", message), VOLATILE),
                (PoseWithCovarianceStamped, "initialpose", lambda message: self._take_pose("start", message), VOLATILE),
                (PoseStamped, "goal_pose", self._take_goal, VOLATILE), (PoseArray, "goal_poses", self._take_goals, VOLATILE)):
            self._node.create_subscription(kind, topic, take, qos)
        self._node.create_timer(PARAMETER_PERIOD, self._read_parameters)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="watch")
        self._thread.start()

    def close(self) -> None:
        """End the node and its thread."""
        rclpy.try_shutdown(context=self._context)
        self._thread.join()

    def _spin(self) -> None:
        """Serve until the end; a message that cannot be shown is logged, and the next one is served."""
        while self._context.ok():
            try:
                self._executor.spin_once()
            except ExternalShutdownException:
                break
            except Exception as error:
                self._node.get_logger().error(f"A message cannot be shown: {str(error) or type(error).__name__}")
        self._node.destroy_node()

    # From the planner.

    def _send(self, document: Document | bytes) -> None:
        with self.lock:
            self.latest["tree" if isinstance(document, bytes) else document["type"]] = document
            for show in tuple(self.pages):
                show(document)

    def _take_map(self, message: OccupancyGrid) -> None:
        grid = grid_from(message, message.header.frame_id, MAX_MAP_CELLS)
        self._frame = message.header.frame_id
        self._send(messages.map_document(grid, "map", is_new="map" not in self.latest))

    def _take_path(self, message: PathMessage) -> None:
        poses = path_poses(message)
        self._poses = poses[np.linspace(0, len(poses) - 1, min(len(poses), MOST_POSES)).astype(int)] if len(poses) else poses
        self._send_answer()

    def _take_status(self, message: DiagnosticStatus) -> None:
        self._status, self._message = {item.key: item.value for item in message.values}, message.message
        self._send_answer()

    def _send_answer(self) -> None:
        values = self._status
        figures = {name: _number(values.get(key)) for name, key in FIGURES.items()}
        self._send({"type": "answer", "id": 0, "quick": False, "final": True, "status": values.get("error_name", ""),
                    "message": self._message, "path": np.round(self._poses, 4).ravel().tolist(), "first_length": None,
                    "samples": int(_number(values.get("samples")) or 0), "location": self._location,
                    "tree_nodes": int(_number(values.get("tree_nodes")) or 0), **figures})

    def _take_tree(self, message: MarkerArray) -> None:
        points = [(point.x, point.y) for marker in message.markers if marker.type == Marker.LINE_LIST for point in marker.points]
        self._send(np.array([0.0, *np.ravel(points)], "<f4").tobytes())
        places: Iterable[Point] = ((marker.pose.position.x, marker.pose.position.y) for marker in message.markers
                                   if marker.type == Marker.CYLINDER)
        location = next(iter(places), None)
        if location != self._location:
            self._location = location
            self._send_answer()
        for marker in message.markers:
            if marker.type == Marker.ARROW and marker.ns in ("start", "goal"):
                self._send_pose(marker.ns, pose_from(marker.ns, marker.pose))

    def _take_pose(self, name: str, message: PoseStamped | PoseWithCovarianceStamped) -> None:
        try:
            self._send_pose(name, pose_from(name, message))
        except ValueError:
            return  # which the planner tells in its status

    def _take_goal(self, message: PoseStamped) -> None:
        self._waypoints = []
        self._take_pose("goal", message)

    def _take_goals(self, message: PoseArray) -> None:
        """Show waypoints, and the goal after them, whose heading stays as it was where any will do."""
        places = [(pose.position.x, pose.position.y) for pose in message.poses]
        if not places or not np.isfinite(places).all():
            return  # which the planner tells in its status
        *self._waypoints, (x, y) = places
        try:
            self._send_pose("goal", pose_from("goal", message.poses[-1]))
        except ValueError:
            self._send_pose("goal", (x, y, self._ends.get("goal", (x, y, 0.0))[2]))

    def _send_pose(self, name: str, pose: tuple[float, float, float]) -> None:
        self._ends[name] = pose
        self._send({"type": "poses", **self._ends, "via": self._waypoints})

    def _read_parameters(self) -> None:
        if self._parameters.services_are_ready():
            self._parameters.get_parameters(list(NAMES), callback=self._take_parameters)

    def _take_parameters(self, future: Any) -> None:
        found = future.result().values
        values = {name: parameter_value_to_python(value) for name, value in zip(NAMES, found, strict=False)}
        document = {"type": "parameters", "values": {name: value for name, value in values.items() if value is not None}}
        if document != self.latest.get("parameters"):
            self._send(document)

    # From the page.

    def send_pose(self, name: str, pose: tuple[float, float, float]) -> None:
        """Publish a start or a goal."""
        message = PoseStamped(pose=pose_message(pose))
        message.header.frame_id = self._frame
        self._publishers[f"{name}_pose"].publish(message)

    def send_waypoints(self, waypoints: Iterable[Point], goal: tuple[float, float, float]) -> None:
        """Publish waypoints, passed with any heading, and the goal."""
        message = PoseArray()
        message.header.frame_id = self._frame
        for x, y in waypoints:
            message.poses.append(PoseMessage())
            message.poses[-1].position.x, message.poses[-1].position.y = x, y
            message.poses[-1].orientation.w = 0.0
        message.poses.append(pose_message(goal))
        self._publishers["goal_poses"].publish(message)

    def cancel(self) -> None:
        """End all planning."""
        self._cancel.call_async(Trigger.Request())

    def set_parameter(self, name: str, value: Any, refuse: Callable[[str], None]) -> None:
        """Set a parameter of the planner; where it refuses, its reason is told."""
        def answered(future: Any) -> None:
            result = future.result().results[0]
            if not result.successful:
                refuse(result.reason)
            self._read_parameters()

        self._parameters.set_parameters([Parameter(name, value=value)], callback=answered)


def _number(text: str | None) -> float | None:
    try:
        number = float(text or "")
    except ValueError:
        return None
    return number if np.isfinite(number) else None
