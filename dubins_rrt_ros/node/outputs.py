"""What the node says: path, status, tree, diagnostics and log."""

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Path as PathMessage
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from dubins_rrt_ros.planning import Plan, Status

from .conversions import path_message, poses_of, serialized_path, status_message
from .markers import tree_markers
from .parameters import Parameters
from .qos import LATCHED

#: How often the last status is repeated on /diagnostics [s].
DIAGNOSTICS_INTERVAL = 1.0
#: The tree of a path that is still improved is shown at most once in this time [s], and with so many lines at most; while
#: they are built and sent, which takes 10 ms a thousand, the node answers nobody.
TREE_INTERVAL, GROWING_TREE = 1.0, 2_000
#: The most lines of a tree whose request has ended.
FINAL_TREE = 10_000


class Outputs:
    """The node's publishers, but for the map's. Only the executor's thread may use them.

    Attributes:
        shown: the plan whose path and tree are on display, if there is one.
        status: what was told last, if anything was.
        tells_of_no_request: whether that was about a map or a start that is missing or was refused.
    """

    def __init__(self, node: Node, parameters: Parameters, frame: str):
        self._node = node
        self._parameters = parameters
        self._frame = frame
        self._name = node.get_fully_qualified_name()
        self._path = node.create_publisher(PathMessage, "plan", LATCHED)
        self._status = node.create_publisher(DiagnosticStatus, "~/status", LATCHED)
        self._tree = node.create_publisher(MarkerArray, "~/tree", LATCHED,
                                           event_callbacks=PublisherEventCallbacks(matched=self._on_tree_matched))
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", QoSProfile(depth=10))
        self._told: DiagnosticStatus | None = None
        self._timer = node.create_timer(DIAGNOSTICS_INTERVAL, self._diagnose, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.shown: Plan | None = None
        self.status: Status | None = None
        self.tells_of_no_request = False
        self._tree_due = 0.0
        self._tree_is_clear = True

    def answer(self, status: Status, message: str, plan: Plan | None, *, last: bool, **ids) -> None:
        """Say how a goal stands: with its path, or an empty one in place of what was published before, status and tree."""
        is_new = plan is None or self.shown is None or plan.problem is not self.shown.problem
        self._show_path(plan)
        self.tell(status, message, plan, last=last, **ids)
        if last or is_new or time.monotonic() >= self._tree_due:
            self._show_tree(FINAL_TREE if last else GROWING_TREE)

    def withdraw(self) -> None:
        """Publish an empty path in place of the one that is shown, and clear its tree."""
        self._show_path(None)
        self._show_tree(FINAL_TREE)

    def _show_path(self, plan: Plan | None) -> None:
        self.shown = plan
        self._path.publish(serialized_path(poses_of(plan), self._frame, self._now()))

    def path(self, plan: Plan | None) -> PathMessage:
        """The path of a plan as a message, empty where there is none."""
        return path_message(poses_of(plan), self._frame, self._now())

    def tell(self, status: Status, message: str, plan: Plan | None = None, *, last: bool = True, plan_id: int = 0,
             revision: int = 0, map_id: str = "") -> None:
        """Publish an event as status; the `last` of a request is logged too."""
        self.status = status
        self.tells_of_no_request = status is Status.NO_MAP or (plan_id == 0 and status is not Status.NONE)
        self._told = status_message(self._name, status, message, plan=plan, plan_id=plan_id, revision=revision,
                                    map_id=map_id if plan is None else plan.problem.map.id)
        self._status.publish(self._told)
        if last:
            self._log(self._told)

    def _log(self, told: DiagnosticStatus) -> None:
        # Three calls: rclpy binds a severity to the line that logs.
        if told.level == DiagnosticStatus.OK:
            self._node.get_logger().info(told.message)
        elif told.level == DiagnosticStatus.ERROR:
            self._node.get_logger().error(told.message)
        else:
            self._node.get_logger().warning(told.message)

    def _diagnose(self) -> None:
        told = [] if self._told is None else [self._told]
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=self._now()), status=told))

    def _show_tree(self, most: int) -> None:
        """Show the tree to those who look; clear it where there is none or it is not wanted any more."""
        self._tree_due = time.monotonic() + TREE_INTERVAL
        plan = self.shown if self._parameters.read().node.publish_tree else None
        if self._tree.get_subscription_count() and not (plan is None and self._tree_is_clear):
            self._tree.publish(tree_markers(plan, self._frame, self._now(), most))
            self._tree_is_clear = plan is None

    def _on_tree_matched(self, matched) -> None:
        """Show the last tree to a subscriber that came after it: nobody built it then."""
        if matched.current_count_change > 0:
            self._show_tree(FINAL_TREE)

    def _now(self):
        return self._node.get_clock().now().to_msg()
