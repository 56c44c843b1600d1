"""The planner node: wiring. Messages go to the objects below, and workers plan."""

from typing import Any, TypeVar

from geometry_msgs.msg import PoseArray, PoseStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from dubins_rrt_ros.planning import kernels_compiled

from .dispatcher import Dispatcher
from .executor_queue import ExecutorQueue, steady_timer
from .frames import Frames
from .goal_session import GoalSession
from .managed_node import ManagedNode
from .map_services import MapServices
from .maps import Maps
from .nav2 import Nav2
from .outcome import outcome_of
from .outputs import Outputs
from .parameters import Parameters
from .path_check import PathCheck
from .plan_service import PlanService
from .qos import SERVICE, VOLATILE
from .readiness import Readiness
from .start_topics import StartTopics

#: A part of the node that is to be closed.
Part = TypeVar("Part", ExecutorQueue, Frames, Maps, PathCheck, Dispatcher, Nav2)

#: Time between two log lines on what is missing [s].
REMINDER_INTERVAL = 5.0
#: Rounds of the executor after which whoever waited for the outcome of a request has answered: an action's goal goes on, ends,
#: and has its result sent, each in a round of its own.
ANSWERING_ROUNDS = 6


class PlannerNode(ManagedNode):
    """Plans from the last start to each goal that comes, and between the poses of a service's request.

    Raises:
        OptionError: a parameter cannot be used.
        MapError: the map file cannot be used.
    """

    def __init__(self, **kwargs: Any):
        super().__init__("planner", **kwargs)
        self._parameters_in_use = Parameters(self)
        self._parts: list[ExecutorQueue | Frames | Maps | PathCheck | Dispatcher | Nav2] = []
        self._warn()
        self.begin(self._parameters_in_use.read().node.managed)

    def set_up(self) -> None:
        """Make all that publishes, listens and plans."""
        parameters, frame = self._parameters_in_use, self._parameters_in_use.read().node.global_frame
        self._queue = self._to_be_closed(ExecutorQueue(self))
        self._outputs = Outputs(self, parameters, frame)
        self._frames = self._to_be_closed(Frames(self, parameters, frame))
        self._maps = self._to_be_closed(Maps(self, parameters, self._queue, self._on_map_news, self._on_map_prepared))
        self._readiness = Readiness(self, parameters, self._maps, self._outputs, self._frames)
        self._dispatcher = self._to_be_closed(Dispatcher(self, parameters, self._maps, self._queue))
        self._path_check = self._to_be_closed(PathCheck(self, parameters, self._maps, self._outputs, self._queue))
        self._session = GoalSession(self, parameters, self._dispatcher, self._readiness, self._frames, self._outputs,
                                    self._path_check)
        self._readiness.update()
        self._listen()

    def _to_be_closed(self, part: Part) -> Part:
        self._parts.append(part)
        return part

    def _warn(self) -> None:
        for warning in (*self._parameters_in_use.unknown(), *self._parameters_in_use.overridden()):
            self.get_logger().warning(warning)
        self._log_derived_radius()
        if not kernels_compiled:
            self.get_logger().warning("The planner's kernels are not compiled, it will be slow: install a C compiler "
                                      "and Cython, and build the package again")

    def _log_derived_radius(self) -> None:
        vehicle = self._parameters_in_use.read().vehicle
        if vehicle.wheelbase:
            self.get_logger().info(f"Turning radius {vehicle.turning_radius:.4g} m, by wheelbase and max_steering_angle")

    def _listen(self) -> None:
        self._start_topics = StartTopics(self, self._readiness, self._frames, self._session.start_came)
        self.create_subscription(PoseStamped, "goal_pose", self._session.take, VOLATILE)
        self.create_subscription(PoseArray, "goal_poses", self._session.take_poses, VOLATILE)
        # In the default group a service that awaits would keep everything else waiting.
        group = ReentrantCallbackGroup()
        self._plan_service = PlanService(self, self._dispatcher, self._readiness, self._frames, self._outputs, group)
        self._to_be_closed(Nav2(self, self._parameters_in_use, self._maps, self._readiness, self._frames, self._dispatcher,
                                self._outputs, self._queue, group))
        self._map_services = MapServices(self, self._parameters_in_use, self._maps, self._readiness, self.report_defect, group)
        self.create_service(Trigger, "~/cancel", self._on_cancel, qos_profile=SERVICE, callback_group=group)
        steady_timer(self, REMINDER_INTERVAL, self._on_reminder)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters; a refusal says what to do, which that of rclpy, which would look first, does not."""
        if refusal := self._parameters_in_use.undeclared(parameter_list):
            return refusal
        pending = self._parameters_in_use.pending(parameter_list)
        verdict = self._parameters_in_use.check(pending)
        if not verdict.successful or not pending:
            return verdict
        warnings = self._parameters_in_use.without_effect(pending)
        result = super().set_parameters_atomically(pending)
        for warning in warnings:
            self.get_logger().warning(warning)
        if any(change.name in ("wheelbase", "max_steering_angle") for change in pending):
            self._log_derived_radius()
        return result

    def close(self) -> None:
        """End the workers; nothing is published afterwards."""
        for part in self._parts:
            part.close()
        self._parts.clear()

    async def end_requests(self) -> None:
        """End all requests, as the service does, and let them be answered."""
        if self._parts:
            self._session.cancel()
            await self._dispatcher.end_all()
            await self._queue.rounds(ANSWERING_ROUNDS)

    def report_defect(self, error: Exception) -> None:
        """Report an exception that belongs to no request."""
        outcome = outcome_of(error, self)
        if self._parts:
            self._outputs.report(outcome, map_id=self._readiness.map_id)

    def _on_map_news(self) -> None:
        self._readiness.update()

    def _on_map_prepared(self) -> None:
        self._session.map_came()

    def _on_reminder(self) -> None:
        self._readiness.remind(is_idle=not self._session.is_planning)

    async def _on_cancel(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        messages = [message] if (message := self._session.cancel()) else []
        messages += [(await submission.outcome).message for submission in self._dispatcher.cancel_all()]
        response.success, response.message = True, " ".join(messages) or "Nothing is being planned."
        return response
