"""Other corridors: ways round obstacles that may be shorter than the best path, each planned by itself.

Smoothing keeps a path between the obstacles where it is, and a random sample hardly ever leads it round another one. So detours
are sought on purpose, from two sources by turns:

- over saddles of the lengths of the shortest ways, where the costs say that a shorter way may lead;
- around a place of the path that is closed: the costs are those of a disc, and say little of a vehicle that turns widely.

Each is planned by hybrid A* between two poses of the path, smoothed, put into the path, and smoothed with it.
"""

import math

import numpy as np

from .._kernels import COMPILED
from ..curves.path import Path
from ..problem import Problem
from ..work import Work
from .arc_search import FIRST_SLICE, LARGEST_SLICE, expand, new_search
from .cost import Objective
from .cost_to_go import CostToGo
from .detours import ClosedPlaces, Detour, Detours, Landscape, SaddleDetours, Searches
from .pace import Pace
from .smoothing import smooth

#: Length of the pieces into which the path is cut; a detour begins and ends where pieces meet [lengths of manoeuvres].
PIECE = 0.5
#: Range of the random length of the arcs of a search [lengths of manoeuvres], and number of headings per turn and such length.
ARCS, HEADINGS = (0.25, 0.6), 8
#: Maximum number of poses that such a search expands, and what is added for each arc of the path that is to be replaced.
MOST_EXPANDED, MOST_EXPANDED_PER_ARC = 512, 6
#: Maximum cost of what a search finds, relative to what it is to replace, and what is added, in lengths of manoeuvres.
SLACK, SLACK_LENGTH = 1.08, 0.5
#: Maximum costs of a detour after its rounds of smoothing, relative to what it is to replace, for which it goes on.
PROMISING = (1.06, 1.03, 1.02)
#: Number of rounds of smoothing of the path with a detour.
JOINT_ROUNDS = 2
#: Minimum gain that counts, relative to the cost of the path: where that is its length, and where it is another, which smoothing
#: lowers a little each time.
WORTHWHILE_GAIN, WORTHWHILE_GAIN_OF_COST = 2e-4, 2e-3
#: Way around the obstacles, relative to what it is to replace, from which on it cannot be shorter: as computed, it can be some
#: hundredths too long.
TOO_LONG = 1.04
#: Number of tries that one counts as which has no shorter way, even for a disc.
NO_WAY = 8
#: Number of tries that one counts as where the cost is not the length, which takes twice as long, so that half as many are made.
TRIES_OF_COST = 2
#: Number of samples between two tries of a source, and number of tries in vain after which it grows by as many. A divisor of
#: BLOCK.
INTERVAL, PATIENCE = 32 if COMPILED else 512, 8
#: Excess of the path over the shortest way around the obstacles from which on closed places are tried as often as saddles; where
#: it is less there is less to gain, and they are tried less often in proportion.
WIDE_GAP = 0.5


class _Turns:
    """The schedule of a source of detours.

    Attributes:
        source: the source.
        next_at: number of samples after which it is asked next.
        in_vain: number of its tries in a row without a shorter path.
    """

    def __init__(self, source: Detours, samples: int):
        self.source, self.in_vain = source, 0
        self.next_at = samples + INTERVAL

    def record(self, improved: bool, tries: int, samples: int, rarity: float) -> None:
        """Take what came of a try, and set the next: the later the more were in vain, `rarity` times as late."""
        self.in_vain = 0 if improved else self.in_vain + tries
        self.next_at = samples + INTERVAL * int(rarity * (1 + self.in_vain // PATIENCE))


class Corridors:
    """The corridors that may be shorter than the best path; `next_path` tries one of them."""

    def __init__(self, problem: Problem, objective: Objective, from_start: CostToGo, to_goal: CostToGo, limit: float, seed: int,
                 work: Work, samples: int):
        """Find them.

        Args:
            from_start, to_goal: the costs, both of them bounds.
            limit: length below which a way over a saddle matters [m].
            work: counts what is done; once it is over a try ends early.
            samples: number of samples used so far.
        """
        self._problem, self._objective, self._work = problem, objective, work
        self._checker, self._edge_cost = objective.field.collision_checker(problem.vehicle), objective.edge_cost()
        self._rng = np.random.default_rng((seed, 5))  # the numbers that merge_short_arcs draws too, no others
        self._landscape = Landscape(problem, objective.field, from_start, to_goal)
        self._turns = [_Turns(SaddleDetours(problem, self._landscape, objective, limit), samples),
                       _Turns(ClosedPlaces(self._landscape, objective, self._rng), samples)]

    @property
    def exhausted(self) -> bool:
        """True if no detour is left, or too many were in vain."""
        return not self._turns

    @property
    def next_at(self) -> int:
        """The number of samples after which the next try is due."""
        return min(turns.next_at for turns in self._turns)

    def is_due(self, samples: int) -> bool:
        """Return True if a try is due after so many samples."""
        return not self.exhausted and samples >= self.next_at

    def next_path(self, path: Path, samples: int) -> Path | None:
        """Try one more corridor, after so many samples; return the path with it, if that is shorter."""
        turns = min(self._turns, key=lambda turns: turns.next_at)
        cost = self._objective.path_cost(path)
        pieces = path.cut(PIECE * self._problem.vehicle.maneuver_scale)
        detour = turns.source.next(pieces)
        other, tries = self._path_with(detour, pieces, turns.source.searches) if detour else (None, NO_WAY)
        gain = cost - self._objective.path_cost(other) if other else 0.0
        worthwhile = WORTHWHILE_GAIN if self._objective.is_length else WORTHWHILE_GAIN_OF_COST
        turns.record(gain > worthwhile * cost, self._tries_of_one * tries, samples,
                     self._tries_of_one * self._rarity(turns.source, cost))
        if detour is None or turns.in_vain >= turns.source.most_in_vain:
            self._turns.remove(turns)
        return other if gain > 0 else None

    @property
    def _tries_of_one(self) -> int:
        return 1 if self._objective.is_length else TRIES_OF_COST

    def _rarity(self, source: Detours, cost: float) -> float:
        """Return how many times the interval between two tries is as long as usual."""
        return 1.0 if source.is_finite else max(1.0, WIDE_GAP * self._landscape.least / max(cost - self._landscape.least, 1e-9))

    def _path_with(self, detour: Detour, path: Path, searches: Searches) -> tuple[Path | None, int]:
        """Return the path with a detour, or None, and how many tries it counts as."""
        replaced = path.part(detour.first, detour.last)
        cost = self._objective.path_cost(replaced)
        limit = SLACK * cost + SLACK_LENGTH * self._problem.vehicle.maneuver_scale
        objective, required_clearance = self._objective, self._problem.vehicle.required_clearance
        to_goal = CostToGo(objective.field, required_clearance, replaced.end[:2], target=replaced.start[:2], objective=objective,
                           free=detour.free)
        if to_goal.at(replaced.waypoints[:1, :2])[0] >= TOO_LONG * cost:
            return None, NO_WAY
        found = self._found(replaced, to_goal, limit, searches)
        if found is None:
            return None, 1
        for number, promising in enumerate(PROMISING):
            found = self._smoothed(found, 1, is_fresh=number == 0)
            if self._objective.path_cost(found) > promising * cost:
                return None, 1
        joint = Path.joined(path.part(0, detour.first), found, path.part(detour.last, len(path.words) - 1))
        return self._smoothed(joint, JOINT_ROUNDS), 1

    def _found(self, replaced: Path, to_goal: CostToGo, limit: float, searches: Searches) -> Path | None:
        """Return what hybrid A* finds in place of a part of the path."""
        vehicle = self._problem.vehicle
        for weight, visit_penalty in searches:
            arc = self._rng.uniform(*ARCS)
            most = MOST_EXPANDED + int(MOST_EXPANDED_PER_ARC * limit / (arc * vehicle.maneuver_scale))
            search = new_search(self._problem, self._checker, self._edge_cost, arc, math.ceil(HEADINGS / arc), weight,
                                visit_penalty, start=replaced.start, goals=replaced.waypoints[-1:], to_goal=to_goal.kernel,
                                limit=limit, max_expanded=most)
            expand(search, Pace(FIRST_SLICE, LARGEST_SLICE), most, self._work)
            if arrays := search.path():
                waypoints, words, lengths = arrays
                return Path(waypoints, words, lengths, vehicle.turning_radius)
        return None

    def _smoothed(self, path: Path, rounds: int, is_fresh: bool = False) -> Path:
        for number in range(rounds):
            path = smooth(path, self._problem.vehicle, self._objective.field, self._rng, is_fresh and number == 0,
                          self._work, self._objective)
        return path
