"""An action of Nav2's planner_server: a path over the poses of each goal."""

import time
from dataclasses import dataclass
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path as PathMessage
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import CallbackGroup

from dubins_rrt_ros.planning import Plan, Status
from dubins_rrt_ros.planning.text import quoted_name

from .conversions import duration_message, filled
from .dispatcher import Dispatcher
from .frames import Frames
from .managed_node import ManagedNode
from .nav2_goals import Goal, Goals
from .outcome import Outcome
from .outputs import Outputs
from .parameters import Parameters
from .qos import SERVICE
from .readiness import Readiness
from .request import PlanRequest, RefusedRequest, Route

#: Time for which the result of a goal is kept for its client, as Nav2's servers do [s].
RESULT_TIMEOUT = 10
#: Error codes that Nav2 alone has: the planner's id is unknown; there are no goals.
INVALID_PLANNER, NO_VIAPOINTS_GIVEN = 201, 209


@dataclass(frozen=True)
class PathAction:
    """An action that computes a path.

    Attributes:
        kind: its type.
        name: its name.
        offset: what its error codes are above those of ComputePathToPose.
    """

    kind: Any
    name: str
    offset: int

    def goals(self, request: Any) -> list[PoseStamped]:
        """Return the poses over which a goal's path leads, the last of which it reaches."""
        if hasattr(request, "goal"):
            return [*getattr(request, "viapoints", ()), request.goal]
        return list(getattr(request.goals, "goals", request.goals))  # later releases have a message for the list

    def error(self, status: Status, message: str) -> dict[str, Any]:
        """Return the error fields of a result; states that Nav2 has no code for are UNKNOWN, and named in the message."""
        if status is Status.NONE:
            return {"error_code": 0, "error_msg": message}
        if Status.UNKNOWN <= status <= Status.NO_VALID_PATH:
            return {"error_code": self.offset + status, "error_msg": message}
        return {"error_code": self.offset + Status.UNKNOWN, "error_msg": f"{status.name} ({int(status)}): {message}"}


class PathServer:
    """Serves such an action, in a worker of its own, so that its goals disturb no other request."""

    def __init__(self, node: ManagedNode, action: PathAction, parameters: Parameters, dispatcher: Dispatcher,
                 readiness: Readiness, frames: Frames, outputs: Outputs, group: CallbackGroup):
        self._node, self._action, self._parameters, self._dispatcher = node, action, parameters, dispatcher
        self._readiness, self._frames, self._outputs = readiness, frames, outputs
        self._worker = dispatcher.new_worker(action.name)
        self._goals = Goals()
        self._by_id: dict[bytes, Goal] = {}
        self._server = ActionServer(
            node, action.kind, action.name, self._execute, callback_group=group, goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted, cancel_callback=self._on_cancel, goal_service_qos_profile=SERVICE,
            result_service_qos_profile=SERVICE, cancel_service_qos_profile=SERVICE, result_timeout=RESULT_TIMEOUT)

    def close(self) -> None:
        """Take no more goals."""
        self._server.destroy()

    def _on_goal(self, request: Any) -> GoalResponse:
        return GoalResponse.ACCEPT if self._node.is_active else GoalResponse.REJECT

    def _on_accepted(self, handle: Any) -> None:
        goal = self._by_id[_id(handle)] = Goal(handle)
        self._goals.add(goal)
        handle.execute()

    def _on_cancel(self, handle: Any) -> CancelResponse:
        if (goal := self._by_id.get(_id(handle))) is not None:
            goal.end()
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        goal, began = self._by_id[_id(handle)], time.monotonic()
        await goal.turn
        try:
            fields = await self._planned(goal)
        finally:
            self._goals.remove(goal)
            del self._by_id[_id(handle)]
        if goal.is_replaced and not handle.is_cancel_requested:
            handle.abort()
            return self._action.kind.Result()
        if handle.is_cancel_requested:
            handle.canceled()
        elif fields["error_code"]:
            handle.abort()
        else:
            handle.succeed()
        return filled(self._action.kind.Result(), planning_time=duration_message(time.monotonic() - began), **fields)

    async def _planned(self, goal: Goal) -> dict[str, Any]:
        """Return the fields of the result."""
        path = self._outputs.path(None)
        if goal.is_to_end:
            return {"path": path, **self._action.error(Status.CANCELLED, "Cancelled before a first path: it had not begun yet.")}
        request, planner_id = goal.handle.request, goal.handle.request.planner_id
        goals, planner_ids = self._action.goals(request), self._parameters.read().node.planner_ids
        if planner_id not in ("", *planner_ids):
            names = ", ".join(map(quoted_name, filter(None, planner_ids)))
            remedy = f"give one of planner_ids: {names}, or leave it empty" if names else "leave it empty: planner_ids names none"
            return self._refused(path, INVALID_PLANNER, f"planner_id is {quoted_name(planner_id)}; {remedy}.")
        if not goals:
            return self._refused(path, NO_VIAPOINTS_GIVEN, "There are no goals; give at least one.")
        answer = _Answer(self._outputs)
        submission = self._dispatcher.submit(self._worker, self._request(request, goals),
                                             partial(self._end, answer, self._dispatcher.new_id()), finish=answer.fill)
        goal.run(submission)
        outcome = await submission.outcome
        if answer.path.poses and not goal.is_to_end:
            self._outputs.publish_path(answer.serialized)
        return {"path": answer.path, **self._action.error(outcome.status, outcome.message)}

    def _request(self, request: Any, goals: list[PoseStamped]) -> PlanRequest | RefusedRequest:
        try:
            locate = partial(self._locate, request, goals, self._dispatcher.any_goal_heading)
            return self._dispatcher.request(self._readiness.require_map(), locate)
        except Exception as error:
            return RefusedRequest(error)

    def _locate(self, request: Any, goals: list[PoseStamped], any_heading: bool) -> Route:
        # In a worker's thread.
        start = self._frames.pose("start", request.start) if request.use_start else self._readiness.require_start()
        waypoints = tuple(self._frames.pose(f"waypoint {n}", pose) for n, pose in enumerate(goals[:-1], 1))
        return Route(start, self._frames.pose("goal", goals[-1], any_heading), waypoints)

    def _end(self, answer: "_Answer", plan_id: int, outcome: Outcome) -> None:
        self._outputs.report(outcome, request="action", plan_id=plan_id, revision=1, map_id=self._readiness.map_id,
                             stamp=answer.path.header.stamp)

    def _refused(self, path: PathMessage, code: int, message: str) -> dict[str, Any]:
        self._node.get_logger().error(f"{self._action.name}: {message}")
        return {"path": path, "error_code": self._action.offset + code, "error_msg": message}


class _Answer:
    """The path of a plan as it is answered and published; empty until `fill` is called, in the worker's thread."""

    def __init__(self, outputs: Outputs):
        self._outputs = outputs
        self.path, self.serialized = outputs.path(None), b""

    def fill(self, plan: Plan) -> None:
        """Take the path of a plan."""
        self.path = self._outputs.path(plan)
        self.serialized = self._outputs.serialized(plan, self.path.header.stamp)


def _id(handle: Any) -> bytes:
    return bytes(handle.goal_id.uuid)
