"""A request to the planner, as work for a worker. It knows nothing of ROS."""

import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from functools import partial

from dubins_rrt_ros.planning import Plan, Problem, Progress, Settings, Status, World, plan, plan_through
from dubins_rrt_ros.planning.problem import Waypoint
from dubins_rrt_ros.planning.text import one_line

#: Minimum time between two reports of an improved path [s].
IMPROVEMENT_INTERVAL = 0.1
#: Maximum time until a cancellation is noticed while a map is prepared [s].
PREPARING_INTERVAL = 0.01


class Refusal(Exception):
    """A request that is not planned: the status and the sentence that say why."""

    def __init__(self, status: Status, message: str):
        super().__init__(one_line(message))
        self.status = status


@dataclass(frozen=True, eq=False)
class RefusedRequest:
    """A request that cannot be planned; it has its turn nevertheless, so that answers come in order.

    Attributes:
        id: the plan_id of its answer.
        error: why.
    """

    id: int
    error: Exception

    def serve(self, improved: Callable[[Plan], None] | None, cancelled: Callable[[], bool]) -> Plan:
        """Raise the error."""
        raise self.error


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """A request to plan.

    Attributes:
        id: the plan_id of its answers.
        problem, settings: the arguments of plan().
        world: the problem's map, once it is prepared.
        check_invariants: True if every answer is checked, improvements too.
        waypoints: what the path passes between the problem's start and goal.
    """

    id: int
    problem: Problem
    settings: Settings
    world: Future[World]
    check_invariants: bool = False
    waypoints: tuple[Waypoint, ...] = ()

    def serve(self, improved: Callable[[Plan], None] | None, cancelled: Callable[[], bool]) -> Plan:
        """Plan, and return the answer.

        Args:
            improved: called with the first path at once, and with improvements at most every IMPROVEMENT_INTERVAL, unless
                the request is cancelled; None where nobody waits for them.
            cancelled: called about every 10 ms; True ends the request.

        Raises:
            Refusal: it was cancelled before planning began.
            PlanError, PathError, TreeError: an answer broke an invariant.
        """
        problem = self._prepared_problem(cancelled)
        throttle = _Throttle(IMPROVEMENT_INTERVAL)

        def on_progress(progress: Progress) -> None:
            if improved and throttle.lets_pass(progress.improved) and not cancelled():
                snapshot = progress.snapshot()
                if snapshot.path is not None:
                    improved(self._checked(snapshot))

        search = partial(plan_through, problem, self.waypoints) if self.waypoints else partial(plan, problem)
        return self._checked(search(self.settings, cancel=cancelled, on_progress=on_progress))

    def _checked(self, answer: Plan) -> Plan:
        if self.check_invariants:
            answer.check()
        return answer

    def _prepared_problem(self, cancelled: Callable[[], bool]) -> Problem:
        """Wait for the world, and return the problem in it."""
        while not cancelled() and wait([self.world], PREPARING_INTERVAL).not_done:
            pass
        if cancelled():
            raise Refusal(Status.CANCELLED, "Cancelled before a first path: the planner had not begun yet.")
        return replace(self.problem, world=self.world.result().for_vehicle(self.problem.vehicle))


class _Throttle:
    """Passes the first improvement at once, and later ones when the interval is over, even if they came long before."""

    def __init__(self, interval: float):
        self._interval = interval
        self._due = -float("inf")
        self._pending = False

    def lets_pass(self, improved: bool) -> bool:
        """Return True if the best path is to be reported now.

        Args:
            improved: True if it became better since the last call.
        """
        self._pending |= improved
        now = time.monotonic()
        if not self._pending or now < self._due:
            return False
        self._pending, self._due = False, now + self._interval
        return True
