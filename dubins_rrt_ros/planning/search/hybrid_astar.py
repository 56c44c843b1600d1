"""Runs of hybrid A*: a first path at once, and then paths that lead another way."""

import math
from functools import cached_property

import numpy as np

from .._kernels import UNLIMITED
from .._kernels.hybrid_astar import HybridAStar
from ..collision.clearance import ClearanceField
from ..curves.angles import wrap
from ..curves.path import Path
from ..problem import Problem
from ..settings import Settings
from .cost_to_go import DistanceField
from .smoothing import polished

#: The runs up to the first path: the length of their arcs in turning radii, and the headings of their lattice; the weight of
#: the cost-to-go is FIRST_WEIGHT; crowded poses count for more. The finer ones are for what the coarser ones do not get through.
FIRST_RUNS = ((0.5, 16), (0.3, 24), (0.15, 32))
FIRST_WEIGHT, FIRST_VISIT_PENALTY = 2.0, 0.5
#: The next runs come closer and closer to the shortest path: the length of their arcs, the headings of their lattice, the weight.
#: Later ones have arcs of random length, so that their lattices differ, and weigh the cost-to-go as it is.
NEXT_RUNS = ((0.4, 16, 1.1), (0.6, 16, 1.0), (0.4, 16, 1.0), (0.3, 24, 1.0))
LATER_ARCS = 0.25, 0.6
#: After so many later runs in a row that found nothing better there are no more.
MOST_IN_VAIN = 12
#: Paths by up to this factor longer than the best are sought: as arcs of one length they are longer than they will be.
SLACK = 1.05
#: The most poses that a run expands.
MOST_EXPANDED = 200_000
#: The headings that are tried at a goal where several will do.
HEADINGS_AT_GOAL = 16


class HybridAStarRuns:
    """Runs one after the other, in portions: `run` a portion and ask for what it `found`.

    Attributes:
        exhausted: whether no run is left, since so many in a row were in vain.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField, to_goal: DistanceField):
        self._problem, self._field, self._to_goal = problem, field, to_goal
        self._checker = field.collision_checker(problem.vehicle)
        self._settings = settings
        self._goals = _goals(problem)
        self._current: HybridAStar | None = None
        self._begun = self._in_vain = 0
        self.exhausted = False

    @cached_property
    def _rng(self) -> np.random.Generator:
        return np.random.default_rng((self._settings.seed, 1))  # apart from that of the samples

    @property
    def between_runs(self) -> bool:
        """Whether the run begun last has ended."""
        return self._current is None

    def run(self, expansions: int, best: float | None) -> Path | None:
        """Expand so many poses.

        Args:
            best: the length of the best path so far [m], or None.

        Returns:
            A path if the run under way came to one. Those much longer than `best` are not sought; others are polished before they
            are compared with it, where the settings allow that.
        """
        if self.between_runs:
            self._current = self._next(best)
        self._current.run(expansions)
        if not self._current.ended:
            return None
        arrays = self._current.path()
        self._current = None
        path = Path(*arrays, self._problem.vehicle.turning_radius) if arrays else None
        if path and best is not None and self._settings.shortcut:
            for fresh in (True, False):
                path = polished(path, self._problem.vehicle, self._field, self._rng, fresh)
        self._count(path is not None and (best is None or path.length < best), best is None)
        return path

    def _count(self, improved: bool, first: bool) -> None:
        """Count how many runs in a row were in vain."""
        self._in_vain = 0 if improved else self._in_vain + 1
        self.exhausted = self._in_vain == (len(FIRST_RUNS) if first else MOST_IN_VAIN)

    def _next(self, best: float | None) -> HybridAStar:
        arc, sectors, weight = self._measures(best is None)
        problem, radius = self._problem, self._problem.vehicle.turning_radius
        corners = problem.map.corners()
        first = best is None
        return HybridAStar(
            checker=self._checker, radius=radius, start=problem.start, goals=self._goals, to_goal=self._to_goal.kernel,
            corner=corners.min(axis=0), extent=np.ptp(corners, axis=0), arc=arc * radius, sectors=sectors, weight=weight,
            visit_penalty=FIRST_VISIT_PENALTY if first else 0.0, limit=UNLIMITED if first else SLACK * best,
            max_expanded=MOST_EXPANDED)

    def _measures(self, first: bool) -> tuple[float, int, float]:
        """The length of the next run's arcs in turning radii, its headings, and its weight of the cost-to-go."""
        if first:
            return *FIRST_RUNS[self._in_vain], FIRST_WEIGHT
        self._begun += 1
        if self._begun <= len(NEXT_RUNS):
            return NEXT_RUNS[self._begun - 1]
        arc = self._rng.uniform(*LATER_ARCS)
        return arc, math.ceil(8 / arc), 1.0


def _goals(problem: Problem) -> np.ndarray:
    """(m, 3) poses that reach the goal: the goal itself, and others with its position where its heading has a tolerance."""
    if problem.yaw_tolerance == 0:
        return np.array([problem.goal])
    turns = problem.yaw_tolerance * np.linspace(-1, 1, HEADINGS_AT_GOAL + 1)[1:]
    goals = np.tile(problem.goal, (len(turns) + 1, 1))
    goals[1:, 2] = wrap(goals[1:, 2] + turns)
    return goals
