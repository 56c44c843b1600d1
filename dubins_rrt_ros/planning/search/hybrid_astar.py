"""Runs of hybrid A*: a first path at once, and later paths that lead another way."""

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .._kernels import UNLIMITED
from .._kernels.collision import CollisionChecker
from .._kernels.edge_cost import EdgeCost
from .._kernels.hybrid_astar import HybridAStar
from ..collision.clearance import ClearanceField
from ..collision.raster import CLEARANCE_MARGIN
from ..curves.path import Path
from ..deadline import never
from ..problem import Problem
from ..settings import Settings
from ..work import Work
from .background import BACKGROUND, BackgroundJob
from .cost import Objective
from .cost_to_go import CostToGo
from .goal_poses import goal_poses
from .pace import Pace
from .repair import repaired
from .smoothing import smooth

#: Runs up to the first path: length of their arcs in turning radii, and number of headings of their closed set. The finer runs
#: are for what the coarser ones do not get through. All weigh the cost-to-go by FIRST_WEIGHT, and visits of the same place by
#: FIRST_VISIT_PENALTY.
FIRST_RUNS = ((0.5, 16), (0.3, 24), (0.15, 32))
FIRST_WEIGHT, FIRST_VISIT_PENALTY = 2.0, 0.5
#: Cost of a free curve to the goal, relative to the cost-to-go, up to which its path ends a run that weighs the
#: cost-to-go by more than 1.
GOOD_ENOUGH = 1.5


class NarrowRun(NamedTuple):
    """A run for narrow places: a tunnel that leaves millimetres, in which turns must begin just where they have to.

    So arcs have random lengths, and a pose is expanded again and again; or the path of a disc that needs less clearance is
    repaired.

    Attributes:
        arc: length of its arcs in turning radii.
        factors: range of their random factor.
        headings: number of headings of its closed set.
        retry_penalty: penalty of a pose for each time that it was expanded, in arcs.
        visit_penalty: penalty of visits of the same place, in arcs.
        relaxation: clearance that a disc needs less, in turning radii.
    """

    arc: float
    factors: tuple[float, float]
    headings: int
    retry_penalty: float
    visit_penalty: float
    relaxation: float = 0.0


#: Runs that follow by turns as long as there is no path; those that are relaxed are for discs alone.
NARROW_RUNS = (
    *(NarrowRun(0.05, (0.2, 20.0), 128, 3.0, 0.5, relaxation) for relaxation in (0.05, 0.1, 0.025)),
    *(NarrowRun(0.1, (0.1, 10.0), 64, 1.5, 0.5, relaxation) for relaxation in (0.05, 0.1, 0.025)),
    *(NarrowRun(0.05, (0.2, 20.0), 64, 3.0, 2.0, relaxation) for relaxation in (0.05, 0.1, 0.025)),
    NarrowRun(0.05, (0.2, 20.0), 128, 3.0, 0.5), NarrowRun(0.05, (0.2, 20.0), 128, 3.0, 0.0),
    NarrowRun(0.05, (0.2, 20.0), 64, 3.0, 2.0), NarrowRun(0.1, (0.1, 10.0), 64, 1.5, 0.5),
    NarrowRun(0.02, (0.2, 50.0), 320, 3.0, 0.5))
#: Number of poses that the first of these runs expand, and that those that are relaxed do; the factor by which it grows each time
#: round, and its maximum.
NARROW_EXPANSIONS, RELAXED_EXPANSIONS, NARROW_GROWTH, MOST_NARROW_EXPANSIONS = 8192, 4096, 3, 262_144
#: Maximum of the clearance that a disc needs less, as a share of its radius.
MOST_RELAXATION = 0.5
#: Number of random factors of the arcs of such a run; they are used in turn.
FACTORS = 8192
#: Clearance beyond what the checker of the motions demands that a path is repaired to: it is measured at samples [m].
REPAIR_MARGIN = 0.4 * CLEARANCE_MARGIN
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
#: Maximum number of poses that a run expands.
MOST_EXPANDED = 200_000
#: Number of poses that are expanded at first before the time is looked at, and their maximum number later.
FIRST_SLICE, LARGEST_SLICE = 16, 1024


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
        self._lacking = 0.0  # clearance that the path of the current run may lack [m]
        self.exhausted = False

    @cached_property
    def _rng(self) -> np.random.Generator:
        return np.random.default_rng((self._settings.seed, 1))  # apart from that of the samples

    @cached_property
    def _narrow_rng(self) -> np.random.Generator:
        return np.random.default_rng((self._settings.seed, 3))

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
        """Expand that many poses.

        Args:
            best_cost: cost of the best path so far [m]; infinite where there is none.
            work: counts what is done; once it is over the portion ends early.

        Returns:
            A path if the run came to one. Those that cost much more than `best_cost` are not sought; others are smoothed before
            they are compared with it, where the settings allow that.
        """
        work = work or Work()
        if not work.begins():
            return None
        run = self._current = self._current or self._next_run(best_cost)
        expand(run, self._pace, expansions, work)
        if not run.ended:
            return None
        self._current = None
        path = None
        if arrays := run.path():
            waypoints, words, lengths = arrays
            path = Path(waypoints, words, lengths, self._problem.vehicle.turning_radius)
            if self._lacking > 0:
                path = self._repaired(path, work)
        is_first = best_cost == math.inf
        if path and not is_first and self._settings.shortcut:
            for first_round in (True, False):
                path = smooth(path, self._problem.vehicle, self._field, self._rng, first_round, work, self._objective)
        worthwhile = best_cost if self._objective.is_length else (1 - WORTHWHILE_GAIN_OF_COST) * best_cost
        self._count(path is not None and self._objective.path_cost(path) < worthwhile, is_first)
        # Not even arcs of all lengths lead anywhere from the start.
        self.exhausted = self.exhausted or (is_first and self._in_vain > len(FIRST_RUNS) and run.size == 1)
        return path

    def _count(self, improved: bool, is_first: bool) -> None:
        """Count the runs in a row that were in vain."""
        self._in_vain = 0 if improved else self._in_vain + 1
        self.exhausted = not is_first and self._in_vain == MOST_IN_VAIN

    def _next_run(self, best_cost: float) -> HybridAStar:
        is_first, self._lacking = best_cost == math.inf, 0.0
        if is_first and self._in_vain >= len(FIRST_RUNS):
            return self._narrow_run(self._in_vain - len(FIRST_RUNS))
        arc, headings, weight = self._measures(is_first)
        return self._new_run(arc, headings, weight, FIRST_VISIT_PENALTY if is_first else 0.0,
                             limit=UNLIMITED if is_first else SLACK * best_cost, max_expanded=MOST_EXPANDED,
                             good_enough=GOOD_ENOUGH if weight > 1 else 0.0)

    def _narrow_run(self, number: int) -> HybridAStar:
        """Return the run of this number for narrow places, whose arcs cost their length: there is no room to be preferred."""
        vehicle = self._problem.vehicle
        runs = [run for run in NARROW_RUNS if not (run.relaxation and vehicle.footprint)]
        turn, index = divmod(number, len(runs))
        run, checker, expansions = runs[index], self._checker, NARROW_EXPANSIONS
        if run.relaxation:
            expansions = RELAXED_EXPANSIONS
            self._lacking = min(run.relaxation * vehicle.turning_radius, MOST_RELAXATION * vehicle.robot_radius)
            required = vehicle.required_clearance - self._lacking
            checker = CollisionChecker(clearance=self._field.kernel, required_clearance=required)
        least, most = run.factors
        return new_search(
            self._problem, checker, Objective(vehicle, self._field).edge_cost(), run.arc, run.headings, FIRST_WEIGHT,
            run.visit_penalty, start=self._problem.start, goals=self.goals, to_goal=self._length_to_goal.kernel, limit=UNLIMITED,
            max_expanded=min(expansions * NARROW_GROWTH**turn, MOST_NARROW_EXPANSIONS), retry_penalty=run.retry_penalty,
            good_enough=GOOD_ENOUGH, arc_factors=np.exp(self._narrow_rng.uniform(math.log(least), math.log(most), FACTORS)))

    @cached_property
    def _length_to_goal(self) -> CostToGo:
        return self._to_goal if self._objective.is_length else CostToGo.to_goal(self._problem, self._field)

    def _repaired(self, path: Path, work: Work) -> Path | None:
        """Return the path of a relaxed run with the clearance that it lacks, where it can be given that."""
        required = self._problem.vehicle.required_clearance + CLEARANCE_MARGIN + REPAIR_MARGIN
        return repaired(path, self._field.kernel, required, self._lacking, self._is_free, work)

    def _is_free(self, path: Path) -> bool:
        return all(self._checker.is_motion_free(curve.start, curve.radius, curve.index, curve.lengths) for curve in path.curves)

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


def new_search(problem: Problem, checker: CollisionChecker, edge_cost: EdgeCost, arc: float, headings: int, weight: float,
               visit_penalty: float, **options: Any) -> HybridAStar:
    """Return a search of hybrid A* on the problem's map.

    Args:
        checker, edge_cost: judge every arc, and say what it costs.
        arc: length of the arcs in lengths of manoeuvres.
        headings: number of headings in the closed set.
        options: as of `HybridAStar`, between which poses above all.
    """
    radius, scale = problem.vehicle.turning_radius, problem.vehicle.maneuver_scale
    turning_arc = min(arc * scale, max(arc, math.tau / headings) * radius)
    corners = problem.map.corners()
    return HybridAStar(
        checker=checker, edge_cost=edge_cost, radius=radius, corner=corners.min(axis=0), extent=np.ptp(corners, axis=0),
        arc=arc * scale, turning_arc=turning_arc, sectors=headings, weight=weight, visit_penalty=visit_penalty, **options)


def expand(search: HybridAStar, pace: Pace, expansions: int, work: Work) -> None:
    """Expand that many poses, in slices after each of which the work may be over."""
    while expansions > 0 and not search.ended and not work.is_over:
        size, before = min(work.portion(pace.size), expansions), search.expanded
        with pace.measured(size):
            search.run(size)
        work.done += int(search.expanded - before + search.ended)  # interpreted, it is one of NumPy's
        expansions -= size
