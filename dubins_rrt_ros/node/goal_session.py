"""The goal that came by topic, alone or after waypoints, which stands until it is reached, cancelled or replaced."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from functools import partial

from geometry_msgs.msg import PoseArray, PoseStamped
from rclpy.node import Node
from rclpy.timer import Timer

from dubins_rrt_ros.planning import Audit, Path, Plan, Pose, Status, World
from dubins_rrt_ros.planning.curves.angles import heading_error, position_error
from dubins_rrt_ros.planning.curves.progress import PathProgress
from dubins_rrt_ros.planning.result import waypoint_arc_lengths
from dubins_rrt_ros.planning.search.cost import Objective

from .conversions import are_equal, has_rotation
from .dispatcher import Dispatcher
from .executor_queue import steady_timer
from .frames import Frames
from .outcome import Outcome, failures_reported
from .outputs import Outputs
from .parameters import Parameters
from .path_check import PathCheck
from .readiness import Readiness
from .request import Route
from .worker import Job

#: Time between two attempts where what is waited for comes by transforms [s]: nothing tells that one has come.
TRANSFORM_INTERVAL = 0.5
#: Distance to the path's end within which a waypoint need not be passed before the goal is reached [m].
AT_THE_END = 1e-6


#: Waypoints in their order, the last of which is the goal.
Goal = tuple[PoseStamped, ...]


class _Purpose(Enum):
    """The reason for a request: what of it is told depends on it."""

    GOAL = auto()  # a goal that came, or one whose path is broken: all is told
    RETRY = auto()  # a failure that may be cured: all but the same failure again
    REPLAN = auto()  # a path is on display: only one that replaces it


@dataclass(eq=False)
class _Request:
    """A request to the goal.

    Attributes:
        purpose: why it was made.
        passed: number of waypoints that had been passed then, which its paths leave out.
        job: cancels it.
        has_path: True once a path of it was published.
        came: the inputs that came meanwhile, of those that can cure a failure.
    """

    purpose: _Purpose
    passed: int
    job: Job | None = None
    has_path: bool = False
    came: set[str] = field(default_factory=set)


class GoalSession:
    """Plans to the newest goal and publishes the answers; those to older goals are dropped.

    A newer goal waits until the request under way has a first path or none, and of the waiting ones only the newest is kept:
    goals that come faster than paths are found would else cancel each other for ever.
    """

    def __init__(self, node: Node, parameters: Parameters, dispatcher: Dispatcher, readiness: Readiness, frames: Frames,
                 outputs: Outputs, path_check: PathCheck):
        self._node, self._parameters, self._dispatcher, self._readiness = node, parameters, dispatcher, readiness
        self._frames, self._outputs, self._path_check = frames, outputs, path_check
        self._goal: Goal | None = None  # None again once it is cancelled
        self._passed = 0  # number of its waypoints that the vehicle has passed
        self._request: _Request | None = None  # that is under way
        self._plan_id = self._revision = 0  # of the newest answer
        self._waiting: tuple[Goal, int] | None = None  # a newer goal, and its plan_id
        self._patience = self._timer(self._begin_waiting)  # runs meanwhile
        self._failure: Outcome | None = None  # of the last request, where something can cure it
        self._retry_timer = self._timer(self._on_retry_timer)  # runs while a transform can
        self._progress: PathProgress | None = None  # along the path on display
        self._to_pass: list[float] = []  # arc lengths of its waypoints on that path [m]
        self._is_reached = False
        self._map_changed = False  # while it was planned again
        self._replan_timer = self._timer(self._replan)  # runs while the goal is pursued, where it is planned again at a rate

    def _timer(self, callback: Callable[[], None]) -> Timer:
        timer = steady_timer(self._node, TRANSFORM_INTERVAL, callback)
        timer.cancel()
        return timer

    @property
    def is_planning(self) -> bool:
        """True while a worker plans to the goal, or it waits for a start that may be under way."""
        return self._request is not None

    # What comes

    def take(self, goal: PoseStamped) -> None:
        """Plan to this goal, which replaces the one before, once that has a first path or none."""
        self._take((goal,))

    def take_poses(self, goals: PoseArray) -> None:
        """Plan over these poses to the last of them, likewise."""
        if goals.poses:
            self._take(tuple(PoseStamped(header=goals.header, pose=pose) for pose in goals.poses))
        else:
            message = "There are no poses in goal_poses; give at least the goal."
            self._report(Outcome(Status.INVALID_POSE, message), plan_id=self._dispatcher.new_id(), revision=1)

    def _take(self, goal: Goal) -> None:
        awaited = self._awaited_request
        if awaited is not None and self._goal is not None and self._are_equal(goal, self._goal):
            self._drop_waiting()
        elif awaited is not None and not awaited.has_path:
            if self._waiting is None:
                _restart(self._patience, self._parameters.read().settings.planning_time)
            self._waiting = goal, self._dispatcher.new_id()
        else:
            self._begin(goal, self._dispatcher.new_id())

    def start_came(self, start: Pose) -> None:
        """Follow the vehicle along the path on display, and try again what another start can cure."""
        self._follow_to(start)
        self._retry("start")

    def map_came(self) -> None:
        """Try again what a map that is prepared can cure; else check the published path against it."""
        self._retry("map")
        self._check_path()

    def cancel(self) -> str:
        """Give up the goal, so that nothing brings it back. A request under way is cancelled by the dispatcher.

        Returns:
            A sentence where the goal waited for what can cure its failure, which is answered then; else "".
        """
        failure, self._goal = self._failure, None
        self._forget_failure()
        if self._waiting is not None:
            message = "Cancelled before a first path: it waited for that of the goal before."
            self._report(Outcome(Status.CANCELLED, message), plan_id=self._waiting[1], revision=1)
        self._drop_waiting()
        self._replan_timer.cancel()
        if self._request is not None and self._request.purpose is _Purpose.REPLAN and not self._request.has_path:
            self._request = None  # nothing of it was told
        if failure is None or self.is_planning:
            return ""
        message = f"Cancelled before a first path: the goal waited for a {failure.cure}."
        self._answer(Outcome(Status.CANCELLED, message))
        return message

    # Requests

    @property
    def _awaited_request(self) -> _Request | None:
        """The request under way, if all of it is told: whoever sends a goal has an answer, and others may end without one."""
        return self._request if self._request is not None and self._request.purpose is _Purpose.GOAL else None

    def _are_equal(self, goal: Goal, other: Goal) -> bool:
        """Return True if two goals are the same places; in a frame that may move they are only at the same time."""
        def moved(one: PoseStamped, two: PoseStamped) -> bool:
            return not self._frames.is_global(one.header.frame_id) and one.header.stamp != two.header.stamp

        return len(goal) == len(other) and all(
            are_equal(one, two) and not moved(one, two) for one, two in zip(goal, other, strict=True))

    def _begin_waiting(self) -> None:
        """Plan to the goal that waits, if there is one."""
        if self._waiting is not None:
            self._begin(*self._waiting)

    def _drop_waiting(self) -> None:
        self._waiting = None
        self._patience.cancel()

    def _begin(self, goal: Goal, plan_id: int) -> None:
        """Make this the goal that counts."""
        self._goal, self._passed, self._is_reached, self._map_changed = goal, 0, False, False
        self._progress, self._to_pass = None, []  # along the path on display, which leads to another goal
        self._forget_failure()
        self._drop_waiting()
        self._plan(_Purpose.GOAL, plan_id)

    def _plan(self, purpose: _Purpose, plan_id: int = 0) -> None:
        """Plan to the goal, with a new plan_id if one is given; nothing of a request under way is told any more."""
        goal = self._goal
        if goal is None:
            return
        if self._request is not None and self._request.job is not None:
            self._request.job.cancel()
        self._request = None
        if plan_id:
            self._plan_id, self._revision = plan_id, 0
        request = _Request(purpose, self._passed)
        with failures_reported(self._node, partial(self._conclude, request)):
            any_heading = self._dispatcher.any_goal_heading or (len(goal) > 1 and not has_rotation(goal[-1].pose))
            locate = partial(self._locate, goal[self._passed:], any_heading)
            planned = self._dispatcher.request(self._readiness.require_map(), locate, any_goal_heading=any_heading)
            if purpose is _Purpose.REPLAN and self._progress is not None:
                planned = replace(planned, seed_path=self._progress.ahead)
            if purpose is _Purpose.GOAL and not planned.world.done():
                self._node.get_logger().info("The goal waits until the map is prepared, which takes seconds where it is large")
            improve = None if self._parameters.read().node.publish == "final" else partial(self._improve, request)
            request.job = self._dispatcher.submit(self._dispatcher.goals, planned, partial(self._end, request), improve).job
            self._request = request

    def _locate(self, goal: Goal, any_heading: bool) -> Route:
        # In a worker's thread.
        start, end = self._readiness.require_start(), self._frames.pose("goal", goal[-1], any_heading)
        return Route(start, end, tuple(self._frames.waypoint(f"waypoint {n}", pose) for n, pose in enumerate(goal[:-1], 1)))

    def _improve(self, request: _Request, plan: Plan) -> None:
        if request is self._request and self._is_wanted(request, plan):
            with failures_reported(self._node, self._answer):
                self._publish(request, Outcome(plan.status, plan.message, plan), last=False)
            self._begin_waiting()

    def _end(self, request: _Request, outcome: Outcome) -> None:
        if request is self._request:
            self._request = None
            with failures_reported(self._node, partial(self._conclude, request)):
                self._conclude(request, outcome)
            self._begin_waiting()
            for cure in () if self.is_planning else request.came:
                self._retry(cure)
            self._check_path()
            if self._map_changed:
                self._replan()

    def _conclude(self, request: _Request, outcome: Outcome) -> None:
        """Publish the end of a request; a failure that something can cure waits for that, and is told once."""
        if self._is_wanted(request, outcome.plan) and not self._is_known(request, outcome):
            self._publish(request, outcome)
            self._wait_for_cure(outcome)
        if self._goal is not None and (rate := self._parameters.read().node.replan_rate) and self._replan_timer.is_canceled():
            _restart(self._replan_timer, 1 / rate)

    def _is_known(self, request: _Request, outcome: Outcome) -> bool:
        return request.purpose is _Purpose.RETRY and self._failure is not None and outcome.status is self._failure.status

    def _publish(self, request: _Request, outcome: Outcome, last: bool = True) -> None:
        if request.purpose is _Purpose.REPLAN and not request.has_path:
            self._plan_id, self._revision = self._dispatcher.new_id(), 0
        request.has_path = True
        if outcome.plan is not None and outcome.plan.path is not None:
            self._passed = request.passed  # those since are passed once more, on this path
        self._answer(outcome, last)

    def _answer(self, outcome: Outcome, last: bool = True) -> None:
        self._revision += 1
        self._outputs.answer(outcome, last=last, plan_id=self._plan_id, revision=self._revision, map_id=self._readiness.map_id)
        self._progress, self._to_pass = None, []
        if (plan := outcome.plan) is not None and (path := plan.path) is not None:
            self._progress = PathProgress(path)
            self._to_pass = [passed for passed in waypoint_arc_lengths(plan) if passed < path.length - AT_THE_END]
        self._follow()

    def _warn(self, status: Status, message: str) -> None:
        self._revision += 1
        self._report(Outcome(status, message, is_warning=True), self._plan_id, self._revision)

    def _report(self, outcome: Outcome, plan_id: int, revision: int) -> None:
        """Publish an event that changes no path."""
        self._outputs.report(outcome, request="goal", plan_id=plan_id, revision=revision, map_id=self._readiness.map_id)

    # Failures, and what can cure them

    def _wait_for_cure(self, outcome: Outcome) -> None:
        self._forget_failure()
        if self._goal is not None and outcome.cure:
            self._failure = outcome
            self._warn(outcome.status, outcome.waiting_message)
            if "transform" in outcome.cure or (self._frames.follows_vehicle and "start" in outcome.cure):
                _restart(self._retry_timer, TRANSFORM_INTERVAL)

    def _forget_failure(self) -> None:
        self._failure = None
        self._retry_timer.cancel()

    def _retry(self, cure: str) -> None:
        """Plan again where this can cure the failure; if a request is under way, once that has failed."""
        if self._request is not None:
            self._request.came.add(cure)
        elif self._failure is not None and cure in self._failure.cure:
            self._plan(_Purpose.RETRY)

    def _on_retry_timer(self) -> None:
        if not self.is_planning:
            self._retry("")

    # The path on display

    def _follow(self) -> None:
        if self._progress is not None and (start := self._readiness.known_start()) is not None:
            self._follow_to(start)

    def _follow_frame(self) -> None:
        """Follow the vehicle where its pose does not come by topic."""
        if self._frames.follows_vehicle:
            self._follow()

    def _follow_to(self, start: Pose) -> None:
        if self._progress is None or self._outputs.shown is None:
            return
        self._progress.advance(start)
        while self._to_pass and self._to_pass[0] <= self._progress.arc_length:
            self._passed += 1
            del self._to_pass[0]
        limits, problem = self._parameters.read().node, self._outputs.shown.problem
        self._is_reached |= (not self._to_pass and position_error(start, problem.goal) <= limits.goal_reached_xy
                             and heading_error(start, problem.goal) <= max(limits.goal_reached_yaw, problem.yaw_tolerance))

    def _is_wanted(self, request: _Request, plan: Plan | None) -> bool:
        """Return True if the answer to a request is to be told.

        A path that nobody asked for is, until the goal is reached, where it is better than the rest of the one on display, or the
        vehicle has left that.
        """
        if request.purpose is not _Purpose.REPLAN or request.has_path or self._progress is None:
            return True
        if plan is None or plan.cost is None or self._is_reached:
            return False
        gain = self._parameters.read().node.replan_gain
        return (plan.cost < (1 - gain) * _cost_of_rest(self._progress, plan)
                or self._progress.distance > plan.problem.vehicle.turning_radius)

    def _check_path(self) -> None:
        """See whether what is left of the published path is free on a newer map; it is planned again, whether or not."""
        self._path_check.begin(self._ahead, lambda: self._awaited_request is None, self._on_checked)

    def _ahead(self) -> Path | None:
        """Return what is left of the published path, None where there is none or the goal is reached."""
        self._follow_frame()
        return None if self._progress is None or self._is_reached else self._progress.ahead

    def _on_checked(self, verdict: Audit) -> None:
        message = f"The map changed, and the published path is not free on it: {'; '.join(verdict.findings)}. It is"
        if verdict.ok:
            self._map_changed = self.is_planning
            self._replan()
        elif self._goal is None:
            message += " withdrawn; its goal was cancelled, so that nothing is planned."
            self._answer(Outcome(Status.NO_VALID_PATH, message))
        else:
            self._warn(Status.NO_VALID_PATH, f"{message} planned again, and stays until then.")
            self._plan(_Purpose.GOAL, self._dispatcher.new_id())

    def _replan(self) -> None:
        """Plan again, from the newest start, where the goal is still pursued and nothing is under way."""
        self._follow_frame()
        rate = self._parameters.read().node.replan_rate
        if self._goal is None or self._is_reached or not rate:
            self._replan_timer.cancel()
        elif self._replan_timer.timer_period_ns != round(1e9 / rate):
            _restart(self._replan_timer, 1 / rate)
        if self._goal is not None and not self._is_reached and not self.is_planning:
            self._map_changed = False
            if self._progress is not None:
                self._plan(_Purpose.REPLAN)
            else:
                self._retry("")


def _restart(timer, interval: float) -> None:
    """Have a timer call back after this time [s], and again and again."""
    timer.timer_period_ns = round(interval * 1e9)
    timer.reset()


def _cost_of_rest(progress: PathProgress, plan: Plan) -> float:
    """Return what the rest of a path costs on the map, and by the settings, of a plan [m]: the length where that is minimised."""
    assert isinstance(plan.problem.world, World)
    objective = Objective.of(plan.problem, plan.settings, plan.problem.world.field)
    return progress.left if objective.is_length else objective.path_cost(progress.ahead)
