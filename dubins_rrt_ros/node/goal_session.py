"""The goal that came by topic: from its arrival to its last path."""

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from dubins_rrt_ros.planning import Audit, Plan, Status

from .dispatcher import Dispatcher, Submission
from .executor_queue import steady_timer
from .frames import Frames
from .outcome import Outcome, failures_reported
from .outputs import Outputs
from .path_check import PathCheck
from .readiness import Readiness

#: Time that a goal waits for a start [s]: one that was sent just before may still be under way, as topics keep no common order.
START_GRACE = 0.5


class GoalSession:
    """Plans to the newest goal and publishes the answers; those to older goals are dropped."""

    def __init__(self, node: Node, dispatcher: Dispatcher, readiness: Readiness, frames: Frames, outputs: Outputs,
                 path_check: PathCheck):
        self._node, self._dispatcher, self._readiness = node, dispatcher, readiness
        self._frames, self._outputs, self._path_check = frames, outputs, path_check
        self._goal: PoseStamped | None = None  # None again once it is cancelled
        self._plan_id = 0  # of the newest request to it
        self._revision = 0  # of the newest answer to that
        self._submission: Submission | None = None  # while it is planned
        self._grace = steady_timer(node, START_GRACE, self._plan)  # runs while it waits for a start
        self._grace.cancel()

    @property
    def is_planning(self) -> bool:
        """True while a worker plans to the goal."""
        return self._submission is not None

    @property
    def waits_for_start(self) -> bool:
        """True while the goal waits for a start that may be under way."""
        return not self._grace.is_canceled()

    def take(self, goal: PoseStamped) -> None:
        """Plan to this goal, which replaces the one before."""
        self._begin(goal)
        if self._readiness.lacks_start_alone:
            self._grace.reset()
        else:
            self._plan()

    def start_came(self) -> None:
        """Plan, if the goal waited for a start."""
        if self.waits_for_start:
            self._plan()

    def cancel(self) -> str:
        """Give up the goal, so that a changed map does not bring it back. A request under way is cancelled by the dispatcher.

        Returns:
            A sentence where the goal waited for a start, which is answered then; else "".
        """
        self._goal = None
        if not self.waits_for_start:
            return ""
        self._grace.cancel()
        message = "Cancelled before a first path: the goal waited for a start."
        self._answer(Outcome(Status.CANCELLED, message))
        return message

    def check_path(self) -> None:
        """See whether the published path is free on the newest map; it is withdrawn, and planned again, where it is not."""
        self._path_check.begin(lambda: not self.is_planning, self._replace_path)

    def _begin(self, goal: PoseStamped) -> None:
        """Make a request to this goal the only one that counts."""
        if self._submission is not None:
            self._submission.job.cancel()
            self._submission = None
        self._goal, self._plan_id, self._revision = goal, self._dispatcher.new_id(), 0

    def _plan(self) -> None:
        self._grace.cancel()
        with failures_reported(self._node, self._answer):
            world_map, start = self._readiness.require_map(), self._readiness.require_start()
            goal = self._frames.pose("goal", self._goal, self._dispatcher.any_goal_heading)
            request = self._dispatcher.request(self._plan_id, world_map, start, goal)
            if not request.world.done():
                self._node.get_logger().info("The goal waits until the map is prepared, which takes seconds where it is large")
            self._submission = self._dispatcher.submit(self._dispatcher.goals, request, self._end, self._improve)

    def _improve(self, plan_id: int, plan: Plan) -> None:
        if plan_id == self._plan_id:
            with failures_reported(self._node, self._answer):
                self._answer(Outcome(plan.status, plan.message, plan), last=False)

    def _end(self, plan_id: int, outcome: Outcome) -> None:
        if plan_id == self._plan_id:
            self._submission = None
            with failures_reported(self._node, self._answer):
                self._answer(outcome)
            self.check_path()

    def _answer(self, outcome: Outcome, last: bool = True) -> None:
        self._revision += 1
        self._outputs.answer(outcome, last=last, plan_id=self._plan_id, revision=self._revision, map_id=self._readiness.map_id)

    def _replace_path(self, verdict: Audit) -> None:
        message = f"The map changed, and the published path is not free on it: {'; '.join(verdict.findings)}. It is withdrawn"
        if self.waits_for_start:  # a newer goal
            self._outputs.withdraw()
        elif self._goal is None:
            self._answer(Outcome(Status.NO_VALID_PATH, f"{message}; its goal was cancelled, so that nothing is planned."))
        else:
            self._answer(Outcome(Status.NO_VALID_PATH, f"{message}, and planned again."))
            self._begin(self._goal)
            self._plan()
