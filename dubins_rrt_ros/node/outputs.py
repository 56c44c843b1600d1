"""The node's output: path, status, tree, diagnostics and log."""

import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Path as PathMessage
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from dubins_rrt_ros.planning import Plan, Status

from .cdr import serialized_path
from .conversions import path_message, poses_of, status_message
from .executor_queue import steady_timer
from .markers import tree_markers
from .outcome import Outcome
from .parameters import Parameters
from .qos import LATCHED

#: Time between two messages on /diagnostics, which repeat the last status [s].
DIAGNOSTICS_INTERVAL = 1.0
#: Minimum time between two trees of a request under way [s].
TREE_INTERVAL = 1.0
#: Maximum number of lines of such a tree: a thousand take 10 ms to build and send, in which the node answers nobody.
GROWING_TREE = 2_000
#: Maximum number of lines of a tree whose request has ended.
FINAL_TREE = 10_000


class Outputs:
    """The node's publishers, but for the map's, and its log of events.

    Only the executor's thread may use them, but for `path` and `serialized`.

    Attributes:
        shown: the plan whose path and tree are on display, if there is one.
        status: of the last event; None before the first.
        plan_id: of the request that it was about, 0 for none.
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
        self._event: DiagnosticStatus | None = None
        self._timer = steady_timer(node, DIAGNOSTICS_INTERVAL, self._diagnose)
        self.shown: Plan | None = None
        self.status: Status | None = None
        self.plan_id = 0
        self._tree_due = 0.0
        self._tree_is_clear = True

    def answer(self, outcome: Outcome, *, last: bool, plan_id: int, revision: int, map_id: str) -> None:
        """Publish how a goal stands: its path, or an empty one in place of what was published before, status and tree.

        Args:
            outcome: the path, or why there is none.
            last: True if the request has ended; that is logged too.
            plan_id, revision, map_id: as in `report`.
        """
        is_new = outcome.plan is None or self.shown is None or outcome.plan.problem is not self.shown.problem
        stamp = self._show_path(outcome.plan)
        self.report(outcome, log=last, request="goal", plan_id=plan_id, revision=revision, map_id=map_id, stamp=stamp)
        if last or is_new or time.monotonic() >= self._tree_due:
            self._show_tree(FINAL_TREE if last else GROWING_TREE)

    def path(self, plan: Plan | None) -> PathMessage:
        """Return the path of a plan as a message, empty where there is none; any thread may ask for it."""
        return path_message(poses_of(plan), self._frame, self._now())

    def serialized(self, plan: Plan | None, stamp: Time) -> bytes:
        """Return the path of a plan as it is published; any thread may ask for it."""
        return serialized_path(poses_of(plan), self._frame, stamp)

    def publish_path(self, path: bytes) -> None:
        """Publish the path of a request that is not the goal's, of which nothing else is on display."""
        self._path.publish(path)

    def report(self, outcome: Outcome, *, log: bool = True, request: str = "", plan_id: int = 0, revision: int = 0,
               map_id: str = "", stamp: Time | None = None) -> None:
        """Publish an event as status.

        Args:
            outcome: what happened.
            log: True if it goes to the log too.
            request, plan_id, revision, stamp: as in `status_message`.
            map_id: the newest map's; the plan's own takes precedence.
        """
        status, plan = outcome.status, outcome.plan
        self.status, self.plan_id = status, plan_id
        self._event = status_message(self._name, status, outcome.message, plan=plan, request=request, plan_id=plan_id,
                                     revision=revision, map_id=map_id if plan is None else plan.problem.map.id, stamp=stamp,
                                     is_warning=outcome.is_warning)
        self._status.publish(self._event)
        if log:
            self._log(self._event)

    def _show_path(self, plan: Plan | None) -> Time:
        self.shown, stamp = plan, self._now()
        self._path.publish(self.serialized(plan, stamp))
        return stamp

    def _log(self, event: DiagnosticStatus) -> None:
        # Three calls: rclpy binds a severity to the line that logs.
        if event.level == DiagnosticStatus.OK:
            self._node.get_logger().info(event.message)
        elif event.level == DiagnosticStatus.ERROR:
            self._node.get_logger().error(event.message)
        else:
            self._node.get_logger().warning(event.message)

    def _diagnose(self) -> None:
        events = [] if self._event is None else [self._event]
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=self._now()), status=events))

    def _show_tree(self, max_lines: int) -> None:
        """Publish the tree where somebody subscribes; clear it where there is none or it is not wanted any more."""
        self._tree_due = time.monotonic() + TREE_INTERVAL
        plan = self.shown if self._parameters.read().node.publish_tree else None
        if self._tree.get_subscription_count() and not (plan is None and self._tree_is_clear):
            self._tree.publish(tree_markers(plan, self._frame, self._now(), max_lines))
            self._tree_is_clear = plan is None

    def _on_tree_matched(self, matched: Any) -> None:
        """Show the last tree to a late subscriber: it is not built while nobody subscribes."""
        if matched.current_count_change > 0:
            self._show_tree(FINAL_TREE)

    def _now(self) -> Time:
        return self._node.get_clock().now().to_msg()
