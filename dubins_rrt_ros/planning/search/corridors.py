"""Other corridors: ways round obstacles that may be shorter than the best path, each planned by itself.

Smoothing keeps a path between the obstacles where it is, and a random sample hardly ever leads it round another one. So detours
are sought on purpose, from two sources by turns:

- over saddles of the lengths of the shortest ways, where the costs say that a shorter way may lead;
- around a place of the path that is closed: the costs are those of a disc, and say little of a vehicle that turns widely.

Each is planned by hybrid A* between two poses of the path, smoothed, put into the path, and smoothed with it.
"""

import math
from collections.abc import Callable

import numpy as np

from .._kernels import COMPILED
from ..curves.path import Path
from ..problem import Problem
from .cost import Objective
from .cost_to_go import CostToGo
from .detours import ClosedPlaces, Detour, Detours, SaddleDetours, Searches, Squares
from .hybrid_astar import FIRST_SLICE, LARGEST_SLICE, expand, new_search
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
#: Minimum gain that counts, relative to the cost of the path.
WORTHWHILE_GAIN = 2e-4
#: Way around the obstacles, relative to what it is to replace, from which on it cannot be shorter: as computed, it can be some
#: hundredths too long.
TOO_LONG = 1.04
#: Number of tries that one counts as which has no shorter way, even for a disc.
NO_WAY = 8
#: Number of samples between two tries, and number of tries in vain after which it grows by as many. A divisor of BLOCK.
INTERVAL, PATIENCE = 32 if COMPILED else 512, 8


class Corridors:
    """The corridors that may be shorter than the best path; `next_path` tries one of them.

    Attributes:
        next_at: number of samples after which the next try is due.
    """

    def __init__(self, problem: Problem, objective: Objective, from_start: CostToGo, to_goal: CostToGo, limit: float, seed: int,
                 interrupted: Callable[[], bool], samples: int):
        """Find them.

        Args:
            from_start, to_goal: the costs, both of them bounds.
            limit: length below which a way over a saddle matters [m].
            interrupted: called every few milliseconds; True ends a try early.
            samples: number of samples used so far.
        """
        self._problem, self._objective, self._interrupted = problem, objective, interrupted
        self._checker, self._edge_cost = objective.field.collision_checker(problem.vehicle), objective.edge_cost()
        self._rng = np.random.default_rng((seed, 5))  # the numbers that merge_short_arcs draws too, no others
        self._squares = Squares(problem, objective.field)
        self._sources: list[Detours] = [SaddleDetours(problem, self._squares, objective, from_start, to_goal, limit),
                                        ClosedPlaces(self._squares, self._rng)]  # the next one to ask is the first
        self._in_vain = dict.fromkeys(self._sources, 0)
        self.next_at = samples + self._interval

    @property
    def exhausted(self) -> bool:
        """True if no detour is left, or too many were in vain."""
        return not self._sources

    def is_due(self, samples: int) -> bool:
        """Return True if a try is due after so many samples."""
        return not self.exhausted and samples >= self.next_at

    @property
    def _interval(self) -> int:
        """The number of samples until the next try is due: the more were in vain, the more."""
        return INTERVAL * (1 + min(self._in_vain.values()) // PATIENCE)

    def next_path(self, path: Path, samples: int) -> Path | None:
        """Try one more corridor, after so many samples; return the path with it, if that is shorter."""
        shorter = self._shorter_path(path)
        self.next_at = samples + self._interval
        return shorter

    def _shorter_path(self, path: Path) -> Path | None:
        source = self._sources.pop(0)
        pieces = path.cut(PIECE * self._problem.vehicle.maneuver_scale)
        detour = source.next(pieces)
        if detour is None:
            return None
        other, tries = self._path_with(detour, pieces, source.searches)
        gain = self._objective.path_cost(path) - self._objective.path_cost(other) if other else 0.0
        self._in_vain[source] = 0 if gain > WORTHWHILE_GAIN * self._objective.path_cost(path) else self._in_vain[source] + tries
        if self._in_vain[source] < source.most_in_vain:
            self._sources.append(source)
        return other if gain > 0 else None

    def _path_with(self, detour: Detour, path: Path, searches: Searches) -> tuple[Path | None, int]:
        """Return the path with a detour, or None, and how many tries it counts as."""
        replaced = path.part(detour.first, detour.last)
        limit = SLACK * self._objective.path_cost(replaced) + SLACK_LENGTH * self._problem.vehicle.maneuver_scale
        objective, required_clearance = self._objective, self._problem.vehicle.required_clearance
        to_goal = CostToGo(objective.field, required_clearance, replaced.end[:2], target=replaced.start[:2], objective=objective,
                           free=detour.free)
        length_to_goal = to_goal if objective.is_length else CostToGo(
            objective.field, required_clearance, replaced.end[:2], target=replaced.start[:2], free=detour.free)
        if to_goal.at(replaced.waypoints[:1, :2])[0] >= TOO_LONG * self._objective.path_cost(replaced):
            return None, NO_WAY
        found = self._found(replaced, to_goal, length_to_goal, limit, searches)
        if found is None:
            return None, 1
        for number, promising in enumerate(PROMISING):
            found = self._smoothed(found, 1, is_fresh=number == 0)
            if self._objective.path_cost(found) > promising * self._objective.path_cost(replaced):
                return None, 1
        joint = Path.joined(path.part(0, detour.first), found, path.part(detour.last, len(path.words) - 1))
        return self._smoothed(joint, JOINT_ROUNDS), 1

    def _found(self, replaced: Path, to_goal: CostToGo, length_to_goal: CostToGo, limit: float, searches: Searches
               ) -> Path | None:
        """Return what hybrid A* finds in place of a part of the path."""
        vehicle = self._problem.vehicle
        for weight, visit_penalty in searches:
            arc = self._rng.uniform(*ARCS)
            most = MOST_EXPANDED + int(MOST_EXPANDED_PER_ARC * limit / (arc * vehicle.maneuver_scale))
            search = new_search(self._problem, self._checker, self._edge_cost, arc, math.ceil(HEADINGS / arc), weight,
                                visit_penalty, start=replaced.start, goals=replaced.waypoints[-1:], to_goal=to_goal.kernel,
                                length_to_goal=length_to_goal.kernel, limit=limit, max_expanded=most)
            expand(search, Pace(FIRST_SLICE, LARGEST_SLICE), most, self._interrupted)
            if arrays := search.path():
                waypoints, words, lengths = arrays
                return Path(waypoints, words, lengths, vehicle.turning_radius)
        return None

    def _smoothed(self, path: Path, rounds: int, is_fresh: bool = False) -> Path:
        for number in range(rounds):
            path = smooth(path, self._problem.vehicle, self._objective.field, self._rng, is_fresh and number == 0,
                          self._interrupted, self._objective)
        return path
