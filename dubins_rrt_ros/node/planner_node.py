"""The planner node: wiring. Callbacks convert, call and publish; workers plan."""

import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.srv import GetPlan
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from dubins_rrt_ros.planning import Audit, InvalidPose, OptionError, Plan, Pose, Problem, Status, audit_path, kernels_compiled

from .frames import Frames
from .mailbox import Mailbox
from .maps import MapInUse, Maps
from .outputs import Outputs
from .parameters import Parameters
from .qos import VOLATILE, misfits
from .request import Refusal, Request
from .worker import Worker

#: How long the first goal waits for a start [s].
START_GRACE = 0.5
#: How often it is said what is waited for [s].
WAITING_INTERVAL = 5.0
#: The time that each worker gets to act on its cancellation at shutdown [s].
SHUTDOWN_TIMEOUT = 0.2


class PlannerNode(Node):
    """Plans from the last start to each goal that comes, and between the poses of a service's request.

    Raises:
        OptionError: a parameter cannot be used.
        MapError: the map file cannot be used.
    """

    def __init__(self, **kwargs):
        super().__init__("planner", **kwargs)
        self._configured = Parameters(self)
        frame = self._configured.read().node.global_frame
        for warning in self._configured.unknown():
            self.get_logger().warning(warning)
        if not kernels_compiled:
            self.get_logger().warning("The planner's kernels are not compiled, it will be slow: install a C compiler "
                                      "and Cython, and build the package again")
        self._start: Pose | None = None
        self._refused_start = ""  # why the last one was refused
        self._plan_id = 0  # of the newest request
        self._goal_id = 0  # of the newest goal; what bears an older id is not published
        self._revision = 0
        self._goal: PoseStamped | None = None  # the newest, unless it was cancelled
        self._is_planning = False  # to that goal
        self._waiting_for = ""  # as it was told last
        self._ends: dict[int, Future] = {}  # of the requests under way, by plan_id
        self._mailbox = Mailbox(self)
        self._outputs = Outputs(self, self._configured, frame)
        self._frames = Frames(self, frame)
        # Two, so that neither waits for the other: for goals, of which the newest counts, and for services, all in order.
        self._goal_worker, self._service_worker = Worker("goals"), Worker("services")
        self._check_worker = Worker("checks")  # of shown paths on newer maps
        self._grace = self._steady_timer(START_GRACE, self._plan)
        self._grace.cancel()
        self._maps = Maps(self, self._configured, self._mailbox, self._note_waiting, self._check_shown_path)
        self._steady_timer(WAITING_INTERVAL, self._keep_explaining)
        self._note_waiting()
        self._listen()

    def _listen(self) -> None:
        self.create_subscription(PoseStamped, "start_pose", self._on_start, VOLATILE)
        self.create_subscription(PoseWithCovarianceStamped, "initialpose", self._on_start, VOLATILE)
        self.create_subscription(PoseStamped, "goal_pose", self._on_goal, VOLATILE)
        # In the default group a service that awaits would keep everything else waiting.
        group = ReentrantCallbackGroup()
        self.create_service(GetPlan, "~/get_plan", self._on_get_plan, callback_group=group)
        self.create_service(Trigger, "~/cancel", self._on_cancel, callback_group=group)

    def _steady_timer(self, interval: float, callback: Callable[[], None]) -> Timer:
        return self.create_timer(interval, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters; a refusal says what to do, which that of rclpy, which would look first, does not."""
        verdict = self._configured.check(parameter_list)
        return super().set_parameters_atomically(parameter_list) if verdict.successful else verdict

    def close(self) -> None:
        """End the workers; nothing is published afterwards."""
        self._mailbox.close()
        for worker in (self._maps.worker, self._check_worker):
            worker.close(0.0)  # preparations and checks cannot be cancelled; they end with the process
        for worker in (self._goal_worker, self._service_worker):
            worker.close(SHUTDOWN_TIMEOUT)

    # What is waited for

    def _keep_explaining(self) -> None:
        """Log again what is waited for, if anything is."""
        if not self._note_waiting():
            self._log_waiting()
        if self._maps.current is not None and not self._is_planning and self._grace.is_canceled():
            self._mend_status()

    def _mend_status(self) -> None:
        """Say so where the last status misses a map or a start that has come since. Not at once: a goal mostly comes with it."""
        told = self._outputs
        if told.status is Status.NO_MAP and self._waiting_for:
            told.tell(Status.NO_START, self._waiting_for, last=False, map_id=self._maps.id)
        elif told.tells_of_no_request and not self._waiting_for:
            told.tell(Status.NONE, "Ready for a goal.", last=False, map_id=self._maps.id)

    def _note_waiting(self) -> bool:
        """Log what is waited for where that is another thing than before; where it is a map, the status tells it too."""
        before, self._waiting_for = self._waiting_for, self._missing()
        if self._waiting_for == before:
            return False
        self._log_waiting()
        if self._maps.current is None:
            self._outputs.tell(Status.NO_MAP, self._waiting_for, last=False)
        return True

    def _log_waiting(self) -> None:
        if self._maps.current is None:
            self.get_logger().warning(self._waiting_for)
        elif self._waiting_for:
            self.get_logger().info(self._waiting_for)

    def _missing(self) -> str:
        if self._maps.current is None:
            return self._maps.missing()
        return f"Waiting for a start: {self._no_start()}" if self._start is None else ""

    def _no_start(self) -> str:
        topics = [self.resolve_topic_name(name) for name in ("start_pose", "initialpose")]
        kinds = ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")
        found = [why for topic, kind in zip(topics, kinds, strict=True)
                 for why in misfits(self.get_publishers_info_by_topic(topic), kind)]
        but = f"; but {' and '.join(found)}" if found else ""
        return f"publish the vehicle's pose on {' or '.join(topics)}{but}.{self._refused_start}"

    # What comes in

    def _on_start(self, message: PoseStamped | PoseWithCovarianceStamped) -> None:
        with self._telling_failures(self._refuse_start):
            self._start = self._frames.pose("start", message)
            self._refused_start = ""
            self._note_waiting()
            if not self._grace.is_canceled():
                self._plan()

    def _refuse_start(self, status: Status, message: str) -> None:
        """Forget the start before too: the vehicle is no longer there."""
        self._start = None
        before, self._refused_start = self._refused_start, f" The last one was refused: {message}"
        self._waiting_for = self._missing()
        # A stream of them shall not flood the log.
        self._outputs.tell(status, message, last=self._refused_start != before, map_id=self._maps.id)

    def _on_goal(self, message: PoseStamped) -> None:
        self._begin(message)
        if self._maps.current is not None and self._start is None:
            self._grace.reset()  # a start that was sent just before may still be under way: topics keep no common order
        else:
            self._plan()

    def _begin(self, goal: PoseStamped) -> None:
        """From now on this goal counts alone."""
        self._goal_worker.cancel_all()
        self._is_planning = False
        self._goal = goal
        self._goal_id = self._next_id()
        self._revision = 0

    def _next_id(self) -> int:
        self._plan_id += 1
        return self._plan_id

    def _plan(self) -> None:
        """Plan to the newest goal."""
        self._grace.cancel()
        with self._telling_failures(self._answer):
            if self._maps.current is None:
                raise Refusal(Status.NO_MAP, self._maps.missing())
            if self._start is None:
                raise Refusal(Status.NO_START, f"There is no start to plan from: {self._no_start()}")
            request = self._request(self._goal_id, self._start, self._frames.pose("goal", self._goal))
            if not request.world.done():
                self.get_logger().info("The goal waits until the map is prepared, which takes seconds where it is large")
            self._is_planning = True
            self._submit(self._goal_worker, request, self._end_goal, self._improve_goal)

    def _request(self, plan_id: int, start: Pose, goal: Pose, **wanted: Any) -> Request:
        now, used = self._configured.read(), self._maps.current
        problem = Problem(used.map, now.vehicle, start, goal, **{**now.problem, **wanted})
        preparation = self._maps.prepared()
        preparation.is_wanted = True
        return Request(plan_id, problem, now.settings, preparation.world, now.node.check_invariants)

    def _submit(self, worker: Worker, request: Request, ended: Callable, improved: Callable | None = None) -> Future:
        """Have a request served; the future's result, which `ended` is called with too, says how it ended."""
        self._ends[request.id] = end = Future()
        report = improved and (lambda plan: self._mailbox.post(partial(improved, request.id, plan)))
        worker.submit(partial(request.serve, report),
                      lambda outcome: self._mailbox.post(partial(self._on_end, request.id, ended, outcome)))
        return end

    # How requests are answered

    def _improve_goal(self, plan_id: int, plan: Plan) -> None:
        if plan_id == self._goal_id:
            with self._telling_failures(self._answer):
                self._answer(plan.status, plan.message, plan, last=False)

    def _on_end(self, plan_id: int, ended: Callable, outcome: Plan | Exception) -> None:
        told = self._explained(outcome)
        self._ends.pop(plan_id).set_result(told)
        ended(plan_id, *told)

    def _end_goal(self, plan_id: int, status: Status, message: str, plan: Plan | None) -> None:
        if plan_id == self._goal_id:
            self._is_planning = False
            with self._telling_failures(self._answer):
                self._answer(status, message, plan)
            self._check_shown_path()

    def _end_service(self, plan_id: int, status: Status, message: str, plan: Plan | None) -> None:
        self._outputs.tell(status, message, plan, plan_id=plan_id, revision=1, map_id=self._maps.id)

    def _answer(self, status: Status, message: str, plan: Plan | None = None, last: bool = True) -> None:
        self._revision += 1
        self._outputs.answer(status, message, plan, last=last, plan_id=self._goal_id, revision=self._revision,
                             map_id=self._maps.id)

    def _check_shown_path(self) -> None:
        """See whether the published path is free on a map that came after it, where that is wanted."""
        shown, used = self._outputs.shown, self._maps.current
        if (self._is_planning or shown is None or shown.path is None or used is None or shown.problem.map is used.map
                or not self._maps.is_prepared or not self._configured.read().node.replan_on_map_change):
            return
        problem = replace(shown.problem, map=used.map)
        self._check_worker.submit(lambda cancelled: audit_path(shown.path, problem),
                                 lambda outcome: self._mailbox.post(partial(self._on_checked, shown, used, outcome)))

    def _on_checked(self, shown: Plan, used: MapInUse, outcome: Audit | Exception) -> None:
        if isinstance(outcome, Exception):
            raise outcome
        if shown is not self._outputs.shown or used is not self._maps.current or self._is_planning:
            return
        if outcome.ok:
            self.get_logger().info("The map changed; the published path is free on it too")
            return
        message = f"The map changed, and the published path is not free on it: {'; '.join(outcome.findings)}. It is withdrawn"
        if not self._grace.is_canceled():  # a newer goal waits for a start
            self._outputs.withdraw()
        elif self._goal is None:
            self._answer(Status.NO_VALID_PATH, f"{message}; its goal was cancelled, so that nothing is planned.")
        else:
            self._answer(Status.NO_VALID_PATH, f"{message}, and planned again.")
            self._begin(self._goal)
            self._plan()

    # Services

    async def _on_get_plan(self, request: GetPlan.Request, response: GetPlan.Response) -> GetPlan.Response:
        plan_id = self._next_id()
        try:
            end = self._submit(self._service_worker, self._service_request(plan_id, request), self._end_service)
        except Exception as error:
            status, message, plan = self._explained(error)
            self._end_service(plan_id, status, message, plan)
        else:
            *_, plan = await end
        response.plan = self._outputs.path(plan)
        return response

    def _service_request(self, plan_id: int, request: GetPlan.Request) -> Request:
        if self._maps.current is None:
            raise Refusal(Status.NO_MAP, self._maps.missing())
        start, goal = self._frames.pose("start", request.start), self._frames.pose("goal", request.goal)
        wanted = {} if request.tolerance == 0 else {"goal_tolerance_xy": request.tolerance}
        try:
            return self._request(plan_id, start, goal, **wanted)
        except OptionError as error:
            raise Refusal(Status.INVALID_POSE, f"The tolerance of the request cannot be used: {error}") from None

    async def _on_cancel(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        messages = []
        if not self._grace.is_canceled():
            self._grace.cancel()
            messages.append("Cancelled before a first path: the goal waited for a start.")
            self._answer(Status.CANCELLED, messages[0])
        ends = list(self._ends.values())
        self._goal = None  # a changed map does not bring it back
        self._goal_worker.cancel_all()
        self._service_worker.cancel_all()
        messages += [(await end)[1] for end in ends]
        response.success, response.message = True, " ".join(messages) or "Nothing is being planned."
        return response

    # Failures

    @contextmanager
    def _telling_failures(self, tell: Callable[[Status, str], None]) -> Iterator[None]:
        """Refusals and defects become a status: nothing that comes in ends the node."""
        try:
            yield
        except Exception as error:
            if not self.context.ok():  # a signal shut it down meanwhile: nothing can be told any more
                raise
            tell(*self._explained(error)[:2])

    def _explained(self, outcome: Plan | Exception) -> tuple[Status, str, Plan | None]:
        """How a request ended; the trace of a defect goes to the log."""
        if isinstance(outcome, Plan):
            return outcome.status, outcome.message, outcome
        if isinstance(outcome, Refusal):
            return outcome.status, str(outcome), None
        if isinstance(outcome, InvalidPose):
            return Status.INVALID_POSE, str(outcome), None
        self.get_logger().error("".join(traceback.format_exception(outcome)))
        return Status.UNKNOWN, f"A defect in the planner ({type(outcome).__name__}: {outcome}); its trace is in the log, " \
                               "please report it.", None

    def tell_defect(self, error: Exception) -> None:
        """Say of an exception that belongs to no request that it happened."""
        status, message, _ = self._explained(error)
        self._outputs.tell(status, message, map_id=self._maps.id)
