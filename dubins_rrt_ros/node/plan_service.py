"""The service get_plan: a plan between the two poses of each request, beside the goals."""

from functools import partial

from nav_msgs.srv import GetPlan
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from dubins_rrt_ros.planning import OptionError, Plan, Status

from .dispatcher import Dispatcher
from .frames import Frames
from .outcome import Outcome
from .outputs import Outputs
from .parameters import OPTIONS
from .qos import SERVICE
from .readiness import Readiness
from .request import PlanRequest, Refusal, RefusedRequest, Route


class PlanService:
    """Answers ~/get_plan, each request in its turn; the node does not wait for it."""

    def __init__(self, node: Node, dispatcher: Dispatcher, readiness: Readiness, frames: Frames, outputs: Outputs,
                 group: CallbackGroup):
        self._dispatcher, self._readiness, self._frames, self._outputs = dispatcher, readiness, frames, outputs
        node.create_service(GetPlan, "~/get_plan", self._on_request, qos_profile=SERVICE, callback_group=group)

    async def _on_request(self, request: GetPlan.Request, response: GetPlan.Response) -> GetPlan.Response:
        plan_id = self._dispatcher.new_id()
        response.plan = self._outputs.path(None)
        try:
            planned: PlanRequest | RefusedRequest = self._plan_request(request)
        except Exception as error:
            planned = RefusedRequest(error)

        def fill(plan: Plan) -> None:
            response.plan = self._outputs.path(plan)

        end = partial(self._end, response, plan_id)
        await self._dispatcher.submit(self._dispatcher.services, planned, end, finish=fill).outcome
        return response

    def _plan_request(self, request: GetPlan.Request) -> PlanRequest:
        options = {} if request.tolerance == 0 else {"goal_tolerance_xy": _checked_tolerance(request.tolerance)}
        locate = partial(self._locate, request, self._dispatcher.any_goal_heading)
        return self._dispatcher.request(self._readiness.require_map(), locate, **options)

    def _locate(self, request: GetPlan.Request, any_heading: bool) -> Route:
        # In a worker's thread.
        return Route(self._frames.pose("start", request.start), self._frames.pose("goal", request.goal, any_heading))

    def _end(self, response: GetPlan.Response, plan_id: int, outcome: Outcome) -> None:
        self._outputs.report(outcome, request="get_plan", plan_id=plan_id, revision=1, map_id=self._readiness.map_id,
                             stamp=response.plan.header.stamp)


def _checked_tolerance(tolerance: float) -> float:
    """Return the tolerance of a request [m].

    Raises:
        Refusal: it is out of range.
    """
    try:
        return OPTIONS["goal_tolerance_xy"].convert(tolerance)
    except OptionError as error:
        raise Refusal(Status.INVALID_POSE, f"The tolerance of the request cannot be used: {error}") from None
