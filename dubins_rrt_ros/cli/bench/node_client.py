"""The ROS side of `dubins_rrt bench --node`: what is sent to the planner node, and when the answer is on the wire."""

import math
import struct
import time
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from nav_msgs.srv import GetPlan
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from std_srvs.srv import Trigger

from dubins_rrt_ros.node.conversions import grid_message, pose_message
from dubins_rrt_ros.planning import GridMap, Pose

from ..demo.process import DemoError, PlannerProcess

FRAME, ROBOT_FRAME = "map", "base"
#: Time limit for anything expected to arrive [s].
TIMEOUT = 30.0
#: Maximum number of bytes of a path without poses.
EMPTY_PATH = 100

T = TypeVar("T")


class Answer(NamedTuple):
    """The time until an answer was here, and what the node says of it.

    Attributes:
        wall: time from before the question was sent [s].
        cpu: CPU time that the node used meanwhile [s].
        figures: the values of its status.
        poses: number of poses; 0 where the path was not unpacked.
    """

    wall: float
    cpu: float
    figures: dict[str, str]
    poses: int = 0


class NodeClient:
    """A context manager that runs a node beside the planner's process."""

    def __init__(self, planner: PlannerProcess):
        self._planner = planner
        self._arrivals: dict[str, tuple[float, float]] = {}  # time, and the planner's CPU time, at each path, by its stamp
        self._statuses: list[dict[str, str]] = []
        self._publishers: dict[str, Any] = {}

    def __enter__(self) -> "NodeClient":
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context)
        self._node = rclpy.create_node("dubins_rrt_bench", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        every = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        # As bytes: unpacking a path of a thousand poses takes this process 20 ms.
        self._node.create_subscription(PathMessage, "plan", self._on_path, every, raw=True)
        self._node.create_subscription(DiagnosticStatus, "planner/status", self._on_status, every)
        self._get_plan = self._node.create_client(GetPlan, "planner/get_plan")
        self._cancel = self._node.create_client(Trigger, "planner/cancel")
        self._wait(lambda: self._get_plan.service_is_ready() and self._cancel.service_is_ready(), "no service")
        self._wait(lambda: bool(self._statuses), "no status")
        return self

    def __exit__(self, *exception: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _on_path(self, message: bytes) -> None:
        seconds, nanoseconds = struct.unpack_from("<iI", message, 4)  # of the header, after the four bytes of the encoding
        if len(message) > EMPTY_PATH:
            self._arrivals[f"{seconds}.{nanoseconds:09}"] = time.perf_counter(), self._planner.cpu_time

    def _on_status(self, message: DiagnosticStatus) -> None:
        self._statuses.append({item.key: item.value for item in message.values} | {"message": message.message})

    def _wait(self, condition: Callable[[], T], missing: str) -> T:
        """Serve the topics until the condition holds, and return its value."""
        deadline = time.monotonic() + TIMEOUT
        while not (value := condition()):
            self._planner.check()
            if time.monotonic() > deadline:
                raise DemoError(f"{missing} arrived within {TIMEOUT:g} s; the planner said last: "
                                f"{self._statuses[-1]['message'] if self._statuses else 'nothing'}")
            self._executor.spin_once(timeout_sec=0.1)
        return value

    def _response(self, future: Future, missing: str) -> Any:
        self._wait(future.done, missing)
        return future.result()

    def _send(self, kind: type, topic: str, message: Any, quality: QoSProfile | int = 1) -> None:
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(kind, topic, quality)
            self._wait(lambda: self._publishers[topic].get_subscription_count() > 0, f"no listener on {topic}")
        self._publishers[topic].publish(message)

    # What is asked

    def send_start(self, pose: Pose) -> None:
        """Send a start, which the next goal finds."""
        self._send(PoseStamped, "start_pose", _stamped(pose))
        self._publishers["start_pose"].wait_for_all_acked()

    def send_map(self, grid: GridMap) -> None:
        """Send a map."""
        now = self._node.get_clock().now().to_msg()
        self._send(OccupancyGrid, "map", grid_message(grid, FRAME, now), self._latched)

    def send_transform(self, pose: Pose) -> None:
        """Send where the vehicle's frame is. tf2_msgs must be here."""
        from geometry_msgs.msg import TransformStamped
        from tf2_msgs.msg import TFMessage
        transform = TransformStamped(child_frame_id=ROBOT_FRAME)
        transform.header.frame_id, transform.header.stamp = FRAME, self._node.get_clock().now().to_msg()
        transform.transform.translation.x, transform.transform.translation.y = pose[:2]
        transform.transform.rotation = pose_message(pose).orientation
        self._send(TFMessage, "/tf", TFMessage(transforms=[transform]), 100)

    def first_path(self, goal: Pose) -> Answer:
        """Return the time from a goal to its first path on the wire; the goal stands then."""
        return self._timed(lambda: self._send(PoseStamped, "goal_pose", _stamped(goal)))

    def path_on(self, grid: GridMap) -> Answer:
        """Return the time from a map on which the standing goal has another path to that path on the wire."""
        return self._timed(lambda: self.send_map(grid), map_id=grid.id)

    def _timed(self, send: Callable[[], None], **wanted: str) -> Answer:
        heard = len(self._statuses)
        begin, used = time.perf_counter(), self._planner.cpu_time
        send()
        figures = self._status_since(heard, request="goal", **wanted)
        # The node keeps one path for a slow listener: where a better one took its place, that one counts.
        stamp = self._wait(lambda: min((stamp for stamp in self._arrivals if stamp >= figures["stamp"]), default=""), "no path")
        arrived, cpu = self._arrivals[stamp]
        return Answer(arrived - begin, cpu - used, figures)

    def plan(self, start: Pose, goal: Pose) -> Answer:
        """Return the time from a request to get_plan to the response, unpacked."""
        heard = len(self._statuses)
        request = GetPlan.Request(start=_stamped(start), goal=_stamped(goal))
        begin, used = time.perf_counter(), self._planner.cpu_time
        response = self._response(self._get_plan.call_async(request), "no plan")
        wall, cpu = time.perf_counter() - begin, self._planner.cpu_time - used
        return Answer(wall, cpu, self._status_since(heard, request="get_plan"), len(response.plan.poses))

    def _status_since(self, heard: int, **wanted: str) -> dict[str, str]:
        """Return the first status since then that is of a path and has these values."""
        def found() -> dict[str, str] | None:
            return next((values for values in self._statuses[heard:]
                         if values["path_length"] and wanted.items() <= values.items()), None)
        return self._wait(found, f"no status with {wanted}") or {}

    def cancel(self) -> None:
        """End everything that is planned, so that the next goal begins at once."""
        self._response(self._cancel.call_async(Trigger.Request()), "no answer to cancel")

    def cpu_of(self, action: Callable[[], None], seconds: float) -> tuple[float, float]:
        """Do something, and return the time from then, at least that long, and the CPU time that the node uses in it [s]."""
        begin, used = time.perf_counter(), self._planner.cpu_time
        action()
        self.spin(begin + seconds - time.perf_counter())
        return time.perf_counter() - begin, self._planner.cpu_time - used

    def spin(self, seconds: float) -> None:
        """Serve the topics for that time [s]."""
        end = time.perf_counter() + seconds
        while (left := end - time.perf_counter()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def wait_until_ready(self) -> None:
        """Wait until the node has a map, by a plan from a pose to itself."""
        def planned() -> bool:
            request = GetPlan.Request(start=_stamped((math.nan, 0.0, 0.0)), goal=_stamped((0.0, 0.0, 0.0)))
            heard = len(self._statuses)
            self._response(self._get_plan.call_async(request), "no plan")
            self._wait(lambda: len(self._statuses) > heard, "no status")
            return self._statuses[-1]["error_name"] != "NO_MAP"
        self._wait(planned, "no map")


def _stamped(pose: Pose) -> PoseStamped:
    message = PoseStamped(pose=pose_message(pose))
    message.header.frame_id = FRAME
    return message
