"""Runs of hybrid A* for narrow places, as long as there is no path: a tunnel that leaves millimetres.

There turns must begin just where they have to, and arcs of given lengths hardly ever do. So the path of a disc that needs less
clearance is repaired; or arcs have random lengths, and a pose is expanded again and again. All runs cost length alone: there is
no room to be preferred.
"""

import math
from typing import NamedTuple

import numpy as np

from .._kernels import UNLIMITED
from .._kernels.collision import CollisionChecker
from .._kernels.hybrid_astar import HybridAStar
from ..collision.clearance import ClearanceField
from ..collision.raster import CLEARANCE_MARGIN
from ..curves.path import Path
from ..problem import Problem
from ..work import Work
from .arc_search import new_search
from .cost import Objective
from .cost_to_go import CostToGo
from .repair import repaired


class NarrowRun(NamedTuple):
    """What a run tries.

    Attributes:
        arc: length of its arcs in turning radii.
        headings: number of headings of its closed set.
        relaxation: clearance that a disc needs less, in turning radii; the path is repaired.
        factors: range of the random factors of the arcs.
        retry_penalty: penalty of a pose for each time that it was expanded, in arcs; 0 expands each once.
        visit_penalty: penalty of visits of the same place, in arcs.
    """

    arc: float
    headings: int
    relaxation: float = 0.0
    factors: tuple[float, float] | None = None
    retry_penalty: float = 0.0
    visit_penalty: float = 0.5


#: Ranges of the factors of arcs that are short, and longer.
SHORT, MEDIUM = (0.2, 20.0), (0.1, 10.0)
#: The runs, in turn; those that are relaxed are for discs alone. The first ones take some milliseconds and differ in what they
#: find, so that one of them is often enough; of those that are not relaxed the most fruitful are the first.
NARROW_RUNS = (
    *(NarrowRun(*run) for run in ((0.2, 48, 0.1), (0.15, 48, 0.05), (0.08, 80, 0.025), (0.2, 48, 0.2), (0.1, 64, 0.2),
                                  (0.15, 48, 0.1), (0.2, 48, 0.025), (0.1, 64, 0.05), (0.08, 80, 0.1), (0.12, 64, 0.2))),
    NarrowRun(0.1, 64, 0.1, MEDIUM, 1.5), NarrowRun(0.1, 64, 0.2, MEDIUM, 100.0), NarrowRun(0.05, 64, 0.1, SHORT, 3.0, 2.0),
    NarrowRun(0.05, 128, 0.025, SHORT, 100.0), NarrowRun(0.1, 64, 0.05, MEDIUM, 1.5), NarrowRun(0.05, 128, 0.1, SHORT, 3.0),
    NarrowRun(0.1, 64, 0.05, MEDIUM, 100.0), NarrowRun(0.05, 64, 0.2, SHORT, 3.0, 2.0),
    NarrowRun(0.1, 64), NarrowRun(0.05, 128, 0.0, SHORT, 100.0), NarrowRun(0.05, 128, 0.0, SHORT, 3.0),
    NarrowRun(0.05, 64, 0.0, SHORT, 3.0, 2.0), NarrowRun(0.05, 128, 0.0, SHORT, 3.0, 0.0), NarrowRun(0.1, 64, 0.0, MEDIUM, 20.0),
    NarrowRun(0.05, 128), NarrowRun(0.1, 64, 0.0, MEDIUM, 1.5))
#: Factor of the cost-to-go.
WEIGHT = 2.0
#: Cost of a free curve to the goal, relative to the cost-to-go, up to which its path ends a run.
GOOD_ENOUGH = 1.5
#: Number of poses that each of them expands at first, and where it is relaxed; the factor by which it grows each time round, and
#: its maximum.
EXPANSIONS, RELAXED_EXPANSIONS, GROWTH, MOST_EXPANSIONS = 8192, 16_384, 3, 262_144
#: Range of the factors of the lengths of all arcs of a run, drawn from the second time round on, so that it is another one.
OTHER_ARCS = 0.7, 1.3
#: Maximum of the clearance that a disc needs less, as a share of its radius.
MOST_RELAXATION = 0.5
#: Number of random factors of the arcs of such a run; they are used in turn.
FACTORS = 8192
#: Clearance beyond what the checker of the motions demands that a path is repaired to: it is measured at samples [m].
REPAIR_MARGIN = 0.4 * CLEARANCE_MARGIN


class NarrowRuns:
    """The runs, one of which is under way.

    Attributes:
        has_all_lengths: True if arcs of the current run have all lengths, short ones too.
    """

    def __init__(self, problem: Problem, seed: int, field: ClearanceField, checker: CollisionChecker, to_goal: CostToGo,
                 goals: np.ndarray):
        """Prepare the runs.

        Args:
            checker: judges the motions.
            to_goal: the length to the goal.
            goals: (m, 3) poses, any of which will do.
        """
        self._problem, self._field, self._checker, self._to_goal, self._goals = problem, field, checker, to_goal, goals
        self._edge_cost = Objective(problem.vehicle, field).edge_cost()
        self._runs = [run for run in NARROW_RUNS if not (run.relaxation and problem.vehicle.footprint)]
        self._rng = np.random.default_rng((seed, 3))
        self._lacking = 0.0  # clearance that the path of the current run may lack [m]
        self.has_all_lengths = False

    def start(self, number: int) -> HybridAStar:
        """Return the search of run `number`, from 0 on."""
        turn, index = divmod(number, len(self._runs))
        run = self._runs[index]
        self.has_all_lengths = run.factors is not None
        expansions = RELAXED_EXPANSIONS if run.relaxation else EXPANSIONS
        factor = self._rng.uniform(*OTHER_ARCS) if turn else 1.0
        arc, headings = factor * run.arc, math.ceil(run.headings / factor)
        return new_search(
            self._problem, self._relaxed_checker(run.relaxation), self._edge_cost, arc, headings, WEIGHT, run.visit_penalty,
            start=self._problem.start, goals=self._goals, to_goal=self._to_goal.kernel, limit=UNLIMITED,
            max_expanded=min(expansions * GROWTH**turn, MOST_EXPANSIONS), retry_penalty=run.retry_penalty,
            good_enough=GOOD_ENOUGH, arc_factors=self._factors(run))

    def repaired(self, path: Path, work: Work) -> Path | None:
        """Return the path of the current run with the clearance that it lacks; None where it cannot be given that."""
        if self._lacking == 0:
            return path
        required = self._problem.vehicle.required_clearance + CLEARANCE_MARGIN + REPAIR_MARGIN
        at_ends = self._field.at(path.waypoints[[0, -1], :2])  # which stay where they are
        return repaired(path, self._field.kernel, min(required, float(at_ends.min())), self._lacking, self._is_free, work)

    def _relaxed_checker(self, relaxation: float) -> CollisionChecker:
        vehicle = self._problem.vehicle
        self._lacking = min(relaxation * vehicle.turning_radius, MOST_RELAXATION * vehicle.robot_radius)
        if self._lacking == 0:  # of a point too, whose paths are not repaired, and not judged again
            return self._checker
        return CollisionChecker(clearance=self._field.kernel, required_clearance=vehicle.required_clearance - self._lacking)

    def _factors(self, run: NarrowRun) -> np.ndarray | None:
        if not run.factors:
            return None
        least, most = run.factors
        return np.exp(self._rng.uniform(math.log(least), math.log(most), FACTORS))

    def _is_free(self, path: Path) -> bool:
        return all(self._checker.is_motion_free(curve.start, curve.radius, curve.index, curve.lengths) for curve in path.curves)
