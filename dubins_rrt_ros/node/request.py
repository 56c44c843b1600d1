"""A request to the planner, as work for a worker. It knows nothing of ROS."""

import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

from dubins_rrt_ros.planning import Path, Plan, Problem, Progress, Settings, Status, World, plan, plan_through
from dubins_rrt_ros.planning.problem import Pose, Waypoint
from dubins_rrt_ros.planning.text import one_line

#: Minimum time between two reports of an improved path [s].
IMPROVEMENT_INTERVAL = 0.1
#: Maximum time until a cancellation is noticed while a map is prepared, and time between two looks for a pose [s].
WAITING_INTERVAL = 0.01


class Refusal(Exception):
    """A request that is not planned: the status and the sentence that say why.

    Attributes:
        status: the status.
        is_final: True if nothing that may come can cure it.
    """

    def __init__(self, status: Status, message: str, is_final: bool = False):
        super().__init__(one_line(message))
        self.status, self.is_final = status, is_final


class NotYet(Exception):
    """A pose that is not known yet.

    Attributes:
        what: a start, or a transform.
        patience: time that it is waited for [s].
        refusal: makes the refusal if it has not come by then.
    """

    def __init__(self, what: str, patience: float, refusal: Callable[[], Refusal]):
        super().__init__(what)
        self.what, self.patience, self.refusal = what, patience, refusal


@dataclass(frozen=True, eq=False)
class RefusedRequest:
    """A request that cannot be planned; it has its turn nevertheless, so that answers come in order.

    Attributes:
        error: why.
    """

    error: Exception

    def serve(self, improved: Callable[[Plan], None] | None, cancelled: Callable[[], bool]) -> Plan:
        """Raise the error."""
        raise self.error


class Route(NamedTuple):
    """The poses of a request, in the frame of the map.

    Attributes:
        start, goal: where its path begins and ends.
        waypoints: what it passes in between.
    """

    start: Pose
    goal: Pose
    waypoints: tuple[Waypoint, ...] = ()


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """A request to plan.

    Attributes:
        locate: called when planning may begin, for the start may move until then; raises NotYet while a pose is not known.
        problem: makes the problem of a start and a goal.
        settings: how to plan.
        world: the problem's map, once it is prepared.
        check_invariants: True if every answer is checked, improvements too.
        seed_path: what the search begins with, as `plan` and `plan_through` take it.
    """

    locate: Callable[[], Route]
    problem: Callable[[Pose, Pose], Problem]
    settings: Settings
    world: Future[World]
    check_invariants: bool = False
    seed_path: Path | None = None

    def serve(self, improved: Callable[[Plan], None] | None, cancelled: Callable[[], bool]) -> Plan:
        """Plan, and return the answer.

        Args:
            improved: called with the first path at once, and with improvements at most every IMPROVEMENT_INTERVAL, unless
                the request is cancelled; None where nobody waits for them.
            cancelled: called about every 10 ms; True ends the request.

        Raises:
            Refusal: it was cancelled before planning began, or a pose has not come.
            OptionError, InvalidPose: by `problem`.
            PlanError, PathError, TreeError: an answer broke an invariant.
        """
        route = self._route(cancelled)
        problem = self.problem(route.start, route.goal)
        world = self.world.result().for_vehicle(problem.vehicle)
        problem = replace(problem, map=world.map, world=world)
        throttle = _Throttle(IMPROVEMENT_INTERVAL)

        def on_progress(progress: Progress) -> None:
            if improved and throttle.lets_pass(progress.improved) and not cancelled():
                snapshot = progress.snapshot()
                if snapshot.path is not None:
                    improved(self._checked(snapshot))

        search = partial(plan_through, problem, route.waypoints) if route.waypoints else partial(plan, problem)
        return self._checked(search(self.settings, cancel=cancelled, on_progress=on_progress, seed_path=self.seed_path))

    def _checked(self, answer: Plan) -> Plan:
        if self.check_invariants:
            answer.check()
        return answer

    def _route(self, cancelled: Callable[[], bool]) -> Route:
        """Wait for poses and world, and return the poses as they are then."""
        route = self._located(cancelled)
        if self.world.done():
            return route
        while not cancelled() and wait([self.world], WAITING_INTERVAL).not_done:
            pass
        return self._located(cancelled)

    def _located(self, cancelled: Callable[[], bool]) -> Route:
        """Wait for the poses, each as long as is worth it."""
        began = time.monotonic()
        why = "the planner had not begun yet."
        while not cancelled():
            try:
                return self.locate()
            except NotYet as missing:
                if time.monotonic() - began >= missing.patience:
                    raise missing.refusal() from None
                why = f"the goal waited for {missing.what}."
            time.sleep(WAITING_INTERVAL)
        raise Refusal(Status.CANCELLED, f"Cancelled before a first path: {why}")


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
