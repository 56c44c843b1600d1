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
from .qos import SERVICE
from .readiness import Readiness
from .request import PlanRequest, Refusal, RefusedRequest


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
            planned: PlanRequest | RefusedRequest = self._plan_request(plan_id, request)
        except Exception as error:
            planned = RefusedRequest(plan_id, error)

        def fill(plan: Plan) -> None:
            response.plan = self._outputs.path(plan)

        await self._dispatcher.submit(self._dispatcher.services, planned, partial(self._end, response), finish=fill).outcome
        return response

    def _plan_request(self, plan_id: int, request: GetPlan.Request) -> PlanRequest:
        world_map = self._readiness.require_map()
        start = self._frames.pose("start", request.start)
        goal = self._frames.pose("goal", request.goal, self._dispatcher.any_goal_heading)
        options = {} if request.tolerance == 0 else {"goal_tolerance_xy": request.tolerance}
        try:
            return self._dispatcher.request(plan_id, world_map, start, goal, **options)
        except OptionError as error:
            raise Refusal(Status.INVALID_POSE, f"The tolerance of the request cannot be used: {error}") from None

    def _end(self, response: GetPlan.Response, plan_id: int, outcome: Outcome) -> None:
        self._outputs.report(outcome, request="get_plan", plan_id=plan_id, revision=1, map_id=self._readiness.map_id,
                             stamp=response.plan.header.stamp)
