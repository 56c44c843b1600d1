"""Lower bounds of the costs from the start and to the goal, computed in the background."""

import math
from typing import Any, NamedTuple

import numpy as np

from ..collision.clearance import ClearanceField
from ..problem import Problem
from .background import BACKGROUND, BackgroundJob
from .cost import Objective
from .cost_to_go import CostToGo

#: Time that must be left for a bound to be computed by who asks for it [s].
TIME_FOR_BOUND = 0.25
#: Minimum relative fall of the best cost for which nodes are pruned again.
LEAST_FALL = 1e-4


class LengthBounds(NamedTuple):
    """The lengths of the ways from the start and to the goal, as lower bounds."""

    from_start: CostToGo
    to_goal: CostToGo


class CostBounds:
    """The costs that no path over a place falls below.

    Attributes:
        to_goal: the cost to the goal, a lower bound once `make_to_goal` has been called.
        from_start: the cost from the start, a lower bound; None until `make_from_start` has been called.
    """

    def __init__(self, problem: Problem, field: ClearanceField, to_goal: CostToGo, objective: Objective):
        self.to_goal, self._objective = to_goal, objective
        self.from_start: CostToGo | None = None
        self._of_request = problem, field
        self._jobs: tuple[BackgroundJob[None], BackgroundJob[CostToGo] | None] | None = None
        self._length_job: BackgroundJob[CostToGo] | None = None
        self._pruned_at = math.inf

    def start(self, from_start: bool = False) -> None:
        """Start to compute the bound to the goal in the background, and that from the start where it is needed; only once."""
        if self._jobs is None:
            # No job refers to this object, which refers to it: freed at once, large arrays do not wait for the garbage collector.
            self._jobs = (BACKGROUND.start(self.to_goal.prepare_bound),
                          BACKGROUND.start(_bound_from_start, *self._of_request, self._objective) if from_start else None)
            if not self._objective.is_length:
                self._length_job = BACKGROUND.start(_length_bound_to_goal, *self._of_request)

    def wait(self, seconds: float) -> bool:
        """Wait for so long; return True if the bounds that were started are there, or are left to who asks for them."""
        return self._jobs is None or all(job.wait(seconds) for job in self._started)

    def are_ready(self, seconds: float) -> bool:
        """Wait for so long; return True if the bounds are there, or if that time suffices to compute what is left to who asks."""
        return seconds == math.inf or (self.wait(seconds) and (seconds >= TIME_FOR_BOUND or self._are_done))

    @property
    def _are_done(self) -> bool:
        return self._jobs is not None and all(job.is_done for job in self._started)

    @property
    def _started(self) -> list[BackgroundJob[Any]]:
        """The jobs that were started."""
        return [job for job in (*(self._jobs or ()), self._length_job) if job]

    def cancel(self) -> None:
        """Leave out what has not begun."""
        for job in self._started:
            job.cancel()

    def make_to_goal(self) -> CostToGo:
        """Make the cost to the goal a lower bound; nothing else may use it meanwhile."""
        self.start()
        if self._jobs:
            self._jobs[0]()
        return self.to_goal.make_bound()

    def make_length_to_goal(self) -> CostToGo:
        """Make the lengths to the goal, as lower bounds, or wait for them; nothing else may use `to_goal` meanwhile."""
        if self._objective.is_length:
            return self.make_to_goal()
        return self._length_job() if self._length_job else _length_bound_to_goal(*self._of_request)

    def make_from_start(self) -> CostToGo:
        """Make the bound from the start, or wait for it."""
        job = self._jobs[1] if self._jobs else None
        self.from_start = job() if job else _bound_from_start(*self._of_request, self._objective)
        return self.from_start

    def nodes_to_keep(self, points: np.ndarray, limit: float) -> np.ndarray | None:
        """Return (n,) truth values, False where every path over a point costs `limit` or more; None where few would be new."""
        if self.from_start is None or limit >= self._pruned_at * (1 - LEAST_FALL):
            return None
        self._pruned_at = limit
        return np.asarray(self.from_start.at(points) + self.to_goal.at(points) < limit)


def _length_bound_to_goal(problem: Problem, field: ClearanceField) -> CostToGo:
    return CostToGo.to_goal(problem, field).make_bound()


def _bound_from_start(problem: Problem, field: ClearanceField, objective: Objective) -> CostToGo:
    return CostToGo.from_start(problem, field, objective).make_bound()
