"""The planner node: wiring. Callbacks convert, call and publish; a worker plans."""

import argparse
import queue
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import NameValidationException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import remove_ros_args
from visualization_msgs.msg import MarkerArray

from dubins_rrt_ros.planning import (
    InvalidPose,
    MapError,
    OptionError,
    Plan,
    Problem,
    Status,
    kernels_compiled,
    load_map,
)
from dubins_rrt_ros.planning.problem import Pose
from dubins_rrt_ros.share import find_map

from .conversions import as_grid, grid_from, grid_message, path_message, pose_from, status_message
from .markers import tree_markers
from .parameters import OPTIONS, Parameters
from .worker import Report, Request, Worker

VOLATILE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: The tree of a path that is still improved is shown at most once in this time [s]: a large one takes 100 ms.
TREE_INTERVAL = 1.0
#: How long the first goal waits for a start [s].
START_GRACE = 0.5
#: How long a signal may go unnoticed [s].
SIGNAL_INTERVAL = 0.25
#: The time that a planning worker gets to heed its cancellation at shutdown [s].
SHUTDOWN_TIMEOUT = 0.5


class Refusal(Exception):
    """A request that cannot be planned: the status and the sentence that say why."""

    def __init__(self, status: Status, message: str):
        super().__init__(message)
        self.status = status


class PlannerNode(Node):
    """Plans from the last start to each goal that comes.

    Raises:
        OptionError: a parameter cannot be used.
        MapError: the map file cannot be used.
    """

    def __init__(self, **kwargs):
        super().__init__("planner", **kwargs)
        self._configured = Parameters(self)
        self._options = self._configured.read().node
        self._frame = self._options.global_frame
        self._map = None
        self._start: Pose | None = None
        self._refused_map = self._refused_start = ""  # why the last one was refused
        self._plan_id = 0  # of the newest request; what bears another id is old and is not published
        self._revision = 0
        self._goal: PoseStamped | None = None  # waits for a start
        self._grace = self.create_timer(START_GRACE, self._plan, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._grace.cancel()
        self._shown: Plan | None = None
        self._tree_due = 0.0
        self._reports: queue.SimpleQueue[Report] = queue.SimpleQueue()
        self._reported = self.create_guard_condition(self._publish_reports)
        self._create_publishers()
        self._provide_map()
        self._create_subscriptions()
        self._worker = Worker(self._deliver)
        if not kernels_compiled:
            self.get_logger().warning("The planner's kernels are not compiled, it will be slow: install a C compiler "
                                      "and Cython, and build the package again")

    def close(self) -> None:
        """End the worker; nothing is published afterwards."""
        if not self._worker.close(SHUTDOWN_TIMEOUT):
            self.get_logger().warning(f"The planner did not stop within {SHUTDOWN_TIMEOUT} s of its cancellation")

    def _create_publishers(self) -> None:
        self._plan_publisher = self.create_publisher(PathMessage, "plan", LATCHED)
        self._status_publisher = self.create_publisher(DiagnosticStatus, "~/status", LATCHED)
        self._tree_publisher = self.create_publisher(
            MarkerArray, "~/tree", LATCHED, event_callbacks=PublisherEventCallbacks(matched=self._on_tree_matched))

    def _provide_map(self) -> None:
        """Load and publish the map file, or wait for a map on the topic."""
        if self._options.map_file:
            self._map = load_map(find_map(self._options.map_file), max_map_cells=self._options.max_map_cells)
            self._map_publisher = self.create_publisher(OccupancyGrid, "map", LATCHED)
            self._map_publisher.publish(grid_message(as_grid(self._map), self._frame, self._now()))
            self.get_logger().info(f"Loaded the map {self._options.map_file}, id {self._map.id}")
        else:
            qos = LATCHED if self._options.map_transient_local else VOLATILE
            self.create_subscription(OccupancyGrid, "map", self._on_map, qos)
            self._tell(Status.NO_MAP, self._no_map())

    def _create_subscriptions(self) -> None:
        self.create_subscription(PoseStamped, "start_pose", self._on_start, VOLATILE)
        self.create_subscription(PoseWithCovarianceStamped, "initialpose", self._on_start, VOLATILE)
        self.create_subscription(PoseStamped, "goal_pose", self._on_goal, VOLATILE)

    # What comes in

    def _on_map(self, message: OccupancyGrid) -> None:
        with self._telling_failures(self._tell):
            try:
                self._map = grid_from(message, self._frame, self._options.max_map_cells)
            except MapError as error:
                self._refused_map = f" The last one was refused: {error}."
                self.get_logger().error(f"A map was refused: {error}")
                if self._map is None:
                    self._tell(Status.NO_MAP, self._no_map())
            else:
                size = f"{message.info.width} x {message.info.height} cells"
                self.get_logger().info(f"Took a map of {size}, id {self._map.id}")

    def _on_start(self, message: PoseStamped | PoseWithCovarianceStamped) -> None:
        with self._telling_failures(self._refuse_start):
            self._start = self._pose("start", message)
            self._plan()

    def _refuse_start(self, status: Status, message: str) -> None:
        """Forget the start before too: the vehicle is no longer there."""
        self._start = None
        self._refused_start = f" The last one was refused: {message}"
        self._tell(status, message)

    def _on_goal(self, message: PoseStamped) -> None:
        self._plan_id += 1
        self._revision = 0
        self._tree_due = 0.0
        self._worker.cancel()  # the newest goal wins, one that is refused too
        self._goal = message
        if self._map is not None and self._start is None:
            self._grace.reset()  # a start that was sent just before may still be under way: topics keep no common order
        else:
            self._plan()

    def _plan(self) -> None:
        """Plan to the goal that came last, unless that was begun."""
        self._grace.cancel()
        message, self._goal = self._goal, None
        if message is not None:
            with self._telling_failures(self._answer):
                self._worker.submit(self._request(message))

    @contextmanager
    def _telling_failures(self, tell: Callable[[Status, str], None]) -> Iterator[None]:
        """Refusals and defects become a status: nothing that comes in ends the node."""
        try:
            yield
        except Refusal as refusal:
            tell(refusal.status, str(refusal))
        except Exception as error:  # of any kind: the trace goes to the log
            if not self.context.ok():  # a signal shut it down meanwhile: nothing can be told any more
                raise
            self.get_logger().error("".join(traceback.format_exception(error)))
            tell(Status.UNKNOWN, f"A defect in the planner ({type(error).__name__}: {error}); "
                                 "its trace is in the log, please report it.")

    def _request(self, message: PoseStamped) -> Request:
        if self._map is None:
            raise Refusal(Status.NO_MAP, self._no_map())
        if self._start is None:
            topics = " or ".join(map(self.resolve_topic_name, ("start_pose", "initialpose")))
            raise Refusal(Status.NO_START, "A goal came before any start: publish the vehicle's pose on "
                                           f"{topics}.{self._refused_start}")
        goal = self._pose("goal", message)
        now = self._configured.read()
        return Request(self._plan_id, Problem(self._map, now.vehicle, self._start, goal, **now.problem), now.settings)

    def _pose(self, name: str, message: PoseStamped | PoseWithCovarianceStamped) -> Pose:
        frame = message.header.frame_id
        if not frame:
            self.get_logger().warning(f"A {name} pose without frame_id is taken to be in '{self._frame}'", once=True)
        elif frame != self._frame:
            raise Refusal(Status.TF_ERROR, f"The {name} pose is in frame '{frame}' and cannot be transformed to "
                                           f"'{self._frame}': publish it in '{self._frame}'.")
        try:
            return pose_from(name, message)
        except InvalidPose as error:
            raise Refusal(Status.INVALID_POSE, str(error)) from None

    def _no_map(self) -> str:
        return (f"There is no map yet, waiting for one on {self.resolve_topic_name('map')}: publish it or set map_file."
                f"{self._refused_map}")

    # What the worker has to say

    def _deliver(self, report: Report) -> None:
        """Hand a report to the executor's thread; called from the worker's."""
        self._reports.put(report)
        self._reported.trigger()

    def _publish_reports(self) -> None:
        while not self._reports.empty():
            report = self._reports.get()
            if report.request_id == self._plan_id:
                self._publish_report(report)

    def _publish_report(self, report: Report) -> None:
        with self._telling_failures(self._answer):
            if report.error is not None:
                raise report.error
            self._answer(report.plan.status, report.plan.message, report.plan, report.last)

    # What goes out

    def _answer(self, status: Status, message: str, plan: Plan | None = None, last: bool = True) -> None:
        """One planning event of the newest request: its path, empty where there is none, its status and its tree."""
        self._revision += 1
        poses = plan.path.poses(plan.settings.path_spacing) if plan is not None and plan.path is not None else ()
        self._plan_publisher.publish(path_message(poses, self._frame, self._now()))
        self._tell(status, message, plan, last, plan_id=self._plan_id, revision=self._revision)
        self._shown = plan
        if last or time.monotonic() >= self._tree_due:
            self._show_tree()

    def _tell(self, status: Status, message: str, plan: Plan | None = None, last: bool = True, **ids: int) -> None:
        """One planning event, as status; the last of a request as log too."""
        told_map = self._map if plan is None else plan.problem.map
        told = status_message(self.get_fully_qualified_name(), status, message, plan=plan,
                              map_id="" if told_map is None else told_map.id, **ids)
        self._status_publisher.publish(told)
        if last:
            self._log(told)

    def _log(self, told: DiagnosticStatus) -> None:
        # Three calls: rclpy binds a severity to the line that logs.
        if told.level == DiagnosticStatus.OK:
            self.get_logger().info(told.message)
        elif told.level == DiagnosticStatus.ERROR:
            self.get_logger().error(told.message)
        else:
            self.get_logger().warning(told.message)

    def _show_tree(self) -> None:
        self._tree_due = time.monotonic() + TREE_INTERVAL
        if self._tree_publisher.get_subscription_count() and self._configured.read().node.publish_tree:
            self._tree_publisher.publish(tree_markers(self._shown, self._frame, self._now()))

    def _on_tree_matched(self, matched) -> None:
        """Show the last tree to a subscriber that came after it: nobody built it then."""
        if matched.current_count_change > 0 and self._shown is not None:
            self._show_tree()

    def _now(self):
        return self.get_clock().now().to_msg()


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit status is 1 where its configuration cannot be used."""
    arguments = sys.argv if args is None else args
    node = executor = None
    try:
        _show_help(arguments)
        node = _configured_node(arguments)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        _spin(executor)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # SIGINT and SIGTERM are how it ends
    except ConfigurationError as error:
        print(f"planner: {error}", file=sys.stderr)
        return 1
    except Exception:
        if rclpy.ok():  # else a signal came while something was published, which then fails
            raise
    finally:
        # A second signal must not break off the end.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if node is not None:
            node.close()
        if executor is not None:
            executor.shutdown()  # left to the garbage collector, it may come after what it refers to, with a traceback
        rclpy.try_shutdown()
    return 0


def _spin(executor: SingleThreadedExecutor) -> None:
    # Not spin(): a signal can come between its look at the context and its wait, which then lasts for ever.
    while rclpy.ok():
        executor.spin_once(timeout_sec=SIGNAL_INTERVAL)


class ConfigurationError(Exception):
    """The node cannot start as it is configured; the message, of one line, names what to change."""


def _configured_node(arguments: list[str]) -> PlannerNode:
    try:
        rclpy.init(args=arguments)
    except RuntimeError as error:  # a ROS argument or a parameter file that cannot be read
        raise ConfigurationError(" ".join(str(error).split())) from error
    try:
        return PlannerNode()
    except (OptionError, MapError, NameValidationException) as error:
        raise ConfigurationError(" ".join(str(error).split())) from error


def _show_help(arguments: list[str]) -> None:
    """Print the help and exit where it is asked for; refuse what is no ROS argument."""
    lines = [f"  {item.name} (default {item.default!r}): {item.describe()}" for item in OPTIONS.values()]
    parser = argparse.ArgumentParser(
        prog="planner", description="Plan Dubins paths from start_pose to each goal_pose on a map, with RRT or RRT*.",
        usage="%(prog)s [--help] [--ros-args -p NAME:=VALUE ... --params-file FILE]",
        epilog="\n".join(["parameters:", *lines]), formatter_class=argparse.RawDescriptionHelpFormatter)
    try:
        own = remove_ros_args(arguments)[1:]
    except RuntimeError as error:
        raise ConfigurationError(" ".join(str(error).split())) from error
    parser.parse_args(own)
