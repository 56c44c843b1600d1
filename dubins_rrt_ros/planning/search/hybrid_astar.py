"""Runs of hybrid A*: a first path at once, and later paths that lead another way."""

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from .._kernels import UNLIMITED
from .._kernels.hybrid_astar import HybridAStar
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..deadline import never
from ..problem import Problem
from ..settings import Settings
from ..work import Work
from .arc_search import FIRST_SLICE, LARGEST_SLICE, expand, new_search
from .background import BACKGROUND, BackgroundJob
from .cost import Objective
from .cost_to_go import CostToGo
from .goal_poses import goal_poses
from .narrow_runs import NarrowRuns
from .pace import Pace
from .smoothing import smooth

#: Runs up to the first path: length of their arcs in turning radii, and number of headings of their closed set. The finer runs
#: are for what the coarser ones do not get through. All weigh the cost-to-go by FIRST_WEIGHT, and visits of the same place by
#: FIRST_VISIT_PENALTY.
FIRST_RUNS = ((0.5, 16), (0.3, 24), (0.15, 32))
FIRST_WEIGHT, FIRST_VISIT_PENALTY = 2.0, 0.5
#: Cost of a free curve to the goal, relative to the cost-to-go, up to which its path ends a run that weighs the
#: cost-to-go by more than 1.
GOOD_ENOUGH = 1.5
#: Next runs, which come closer and closer to the shortest path: length of arcs, number of headings, weight of the cost-to-go.
NEXT_RUNS = ((0.4, 16, 1.1), (0.6, 16, 1.0), (0.4, 16, 1.0), (0.3, 24, 1.0))
#: Range of the random length of arcs of all later runs, so that their closed sets differ; they weigh the cost-to-go as it is.
LATER_ARCS = 0.25, 0.6
#: Maximum number of later runs in a row that find nothing better.
MOST_IN_VAIN = 12
#: Minimum gain of a run that is not in vain, relative to the best cost, where that is not the length: smoothing lowers it a
#: little each time.
WORTHWHILE_GAIN_OF_COST = 1e-3
#: Maximum cost of a path that is sought, relative to the best: arcs of one length make it longer than it will be when smoothed.
SLACK = 1.05
#: Maximum number of poses that a run expands; minimum number that it counts for, as it takes time to set up.
MOST_EXPANDED, LEAST_EXPANSIONS = 200_000, 64


class HybridAStarRuns:
    """Runs of hybrid A*, one after the other, in portions; `run` returns the path of a run that found one.

    Attributes:
        goals: (m, 3) poses that the paths lead to, all at one position.
        exhausted: True if no run is left, as too many in a row were in vain.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField, to_goal: CostToGo):
        """Prepare the runs.

        Args:
            to_goal: the cost to the goal.
        """
        self._problem, self._field, self._to_goal = problem, field, to_goal
        self._objective = Objective.of(problem, settings, field)
        self._edge_cost = self._objective.edge_cost()
        self._checker = field.collision_checker(problem.vehicle)
        self._settings = settings
        self.goals = goal_poses(problem, field)
        self._current: HybridAStar | None = None
        self._in_background: BackgroundJob[Path | None] | None = None
        self._pace = Pace(FIRST_SLICE, LARGEST_SLICE)
        self._started = self._in_vain = 0
        self._is_narrow = False  # is the current run, or the last one
        self.exhausted = False

    @cached_property
    def _rng(self) -> np.random.Generator:
        return np.random.default_rng((self._settings.seed, 1))  # apart from that of the samples

    @cached_property
    def _narrow(self) -> NarrowRuns:
        to_goal = self._to_goal if self._objective.is_length else CostToGo.to_goal(self._problem, self._field)
        return NarrowRuns(self._problem, self._settings.seed, self._field, self._checker, to_goal, self.goals)

    @property
    def between_runs(self) -> bool:
        """True if the last run has ended."""
        return self._current is None

    def start(self, expansions: int, best_cost: float, interrupted: Callable[[], bool] = never) -> None:
        """Call `run` in the background; `collect` returns what it found."""
        work = Work(interrupted)
        if self._field.own_test:  # whose function need not bear two threads
            self._in_background = BackgroundJob(lambda: self.run(expansions, best_cost, work), None)
        else:
            self._in_background = BACKGROUND.start(self.run, expansions, best_cost, work)

    def wait(self, seconds: float = math.inf) -> bool:
        """Wait for so long until nothing runs in the background; return True if so."""
        job = self._in_background
        if not job or (seconds < math.inf and not job.wait(seconds)):
            return not job
        job()
        return True

    def cancel(self) -> None:
        """Leave out what has not begun in the background."""
        if self._in_background:
            self._in_background.cancel()

    def collect(self) -> Path | None:
        """Return the path that was found in the background, or None, once."""
        found = self._in_background() if self._in_background else None
        self._in_background = None
        return found

    def run(self, expansions: int, best_cost: float, work: Work | None = None) -> Path | None:
        """Expand that many poses, up to the end of a run; or in one run after the other as long as there is no path.

        Args:
            best_cost: cost of the best path so far [m]; infinite where there is none.
            work: counts what is done; once it is over the portion ends early.

        Returns:
            A path if the run came to one. Those that cost much more than `best_cost` are not sought; others are smoothed before
            they are compared with it, where the settings allow that.
        """
        work = work or Work()
        is_first, path = best_cost == math.inf, None
        while expansions > 0 and not path and not self.exhausted and work.begins():
            run = self._current = self._current or self._next_run(best_cost)
            expansions -= max(expand(run, self._pace, expansions, work), LEAST_EXPANSIONS)
            if not run.ended:
                break
            self._current = None
            path = self._path_of(run, is_first, work)
            self._count(path, best_cost)
            # Not even arcs of all lengths lead anywhere from the start.
            self.exhausted = self.exhausted or (is_first and self._is_narrow and self._narrow.has_all_lengths and run.size == 1)
            if not is_first:
                break
        return path

    def _path_of(self, run: HybridAStar, is_first: bool, work: Work) -> Path | None:
        """Return the path that a run came to, repaired or smoothed where that is due."""
        path = None
        if arrays := run.path():
            waypoints, words, lengths = arrays
            path = Path(waypoints, words, lengths, self._problem.vehicle.turning_radius)
            if self._is_narrow:
                path = self._narrow.repaired(path, work)
        if path and not is_first and self._settings.shortcut:
            for first_round in (True, False):
                path = smooth(path, self._problem.vehicle, self._field, self._rng, first_round, work, self._objective)
        return path

    def _count(self, path: Path | None, best_cost: float) -> None:
        """Count the runs in a row that were in vain."""
        worthwhile = best_cost if self._objective.is_length else (1 - WORTHWHILE_GAIN_OF_COST) * best_cost
        improved = path is not None and self._objective.path_cost(path) < worthwhile
        self._in_vain = 0 if improved else self._in_vain + 1
        self.exhausted = best_cost < math.inf and self._in_vain == MOST_IN_VAIN

    def _next_run(self, best_cost: float) -> HybridAStar:
        is_first = best_cost == math.inf
        self._is_narrow = is_first and self._in_vain >= len(FIRST_RUNS)
        if self._is_narrow:
            return self._narrow.start(self._in_vain - len(FIRST_RUNS))
        arc, headings, weight = self._measures(is_first)
        return self._new_run(arc, headings, weight, FIRST_VISIT_PENALTY if is_first else 0.0,
                             limit=UNLIMITED if is_first else SLACK * best_cost, max_expanded=MOST_EXPANDED,
                             good_enough=GOOD_ENOUGH if weight > 1 else 0.0)

    def _new_run(self, arc: float, headings: int, weight: float, visit_penalty: float, **options: Any) -> HybridAStar:
        return new_search(self._problem, self._checker, self._edge_cost, arc, headings, weight, visit_penalty,
                          start=self._problem.start, goals=self.goals, to_goal=self._to_goal.kernel, **options)

    def _measures(self, is_first: bool) -> tuple[float, int, float]:
        """Return the length of the next run's arcs in turning radii, its number of headings, its weight of the cost-to-go."""
        if is_first:
            return *FIRST_RUNS[self._in_vain], FIRST_WEIGHT
        self._started += 1
        if self._started <= len(NEXT_RUNS):
            return NEXT_RUNS[self._started - 1]
        arc = self._rng.uniform(*LATER_ARCS)
        return arc, math.ceil(8 / arc), 1.0
