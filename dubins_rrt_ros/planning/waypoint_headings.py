"""The headings at waypoints: those with which the whole is shortest, as far as paths of the legs are known.

They are chosen by dynamic programming over HEADINGS of them at each waypoint; `search/legs.py` says what a leg costs between two.
Where obstacles are in the way of a leg, paths of it are sought in several headings, then between the headings that were chosen,
and the headings are chosen again until they stay. What costs least so is a local optimum: where two headings have to change at
once, no path between the new ones is known. So at last paths are sought between those headings, of FIRST_HEADINGS at each
waypoint, with which the whole may be shorter by its lower bounds, the most promising first.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from ._kernels import COMPILED
from .curves.angles import SAME
from .curves.path import Path
from .deadline import Deadline, OutOfTime
from .problem import Pose, Problem
from .result import Plan
from .search.cost import Objective
from .search.cost_to_go import CostToGo
from .search.hybrid_astar import HybridAStarRuns
from .search.legs import Leg, cheapest_chain, first_impassable
from .search.smoothing import smooth
from .settings import Settings
from .work import Work
from .world import World

#: Number of headings at either end with which a leg between obstacles is planned first, and among which others are tried.
FIRST_HEADINGS = 12
#: Maximum number of times that legs are planned between the headings that were chosen, and the headings chosen again; and number
#: of chains of other headings that are tried.
ROUNDS, OTHERS = 4, 100 if COMPILED else 2
#: Maximum number of poses that hybrid A* expands for such a path, and number in one step.
DRAFT_EXPANSIONS, STEP = (8192, 512) if COMPILED else (512, 32)


class HeadingChoice:
    """The headings at the stops of one call of plan_through(), and the paths of its legs that were found meanwhile.

    Attributes:
        legs: from each stop to the next.
        found_by: what found the last path.
    """

    def __init__(self, legs: Sequence[Leg], world: World, problem: Problem, settings: Settings, objective: Objective,
                 rng: np.random.Generator, clock: Deadline, plan_leg: Callable[[Leg], Plan]):
        self.legs, self.found_by = legs, ""
        self._world, self._vehicle, self._settings, self._objective = world, problem.vehicle, settings, objective
        self._rng, self._clock, self._plan_leg = rng, clock, plan_leg
        self._headings: list[int] | None = None  # indices of the poses at the stops
        self._known: set[int] = set()  # numbers of the legs whose paths came from outside
        self._explored: set[int] = set()
        self._failures: dict[int, Plan] = {}  # by the number of the leg

    def know(self, number: int, path: Path) -> None:
        """Take a free path of a leg as what it is planned with: none is sought in its place."""
        self.legs[number].add(path)
        self._known.add(number)
        self._explored.add(number)
        self.found_by = "seed_path"

    def choose(self) -> bool:
        """Choose the headings; return False where no path is found over all stops."""
        headings = self._cheapest()
        for _ in range(ROUNDS):
            if headings is None or self._clock.poll():
                break
            for n, (leg, (i, j)) in enumerate(zip(self.legs, pairwise(headings), strict=True)):
                if not leg.is_curve(i, j) and n not in self._known:
                    self._draft(leg, leg.starts[i], [leg.ends[j]])
            before, headings = headings, self._cheapest() or headings
            if headings == before:
                break
        self._headings = headings
        return headings is not None

    def paths(self) -> list[Path]:
        """Return the paths of the legs between the headings that were chosen."""
        return [leg.path(i, j) for leg, (i, j) in self._chosen()]

    def failure(self) -> tuple[int, Plan]:
        """Return the number of the first leg over which no path is known, and what was found instead."""
        number = first_impassable([leg.costs for leg in self.legs]) or 0
        return number, self._failures.get(number) or self._plan_leg(self.legs[number])

    def try_others(self, until: float) -> bool:
        """Seek paths between other headings, with which the whole may be shorter, and choose again.

        Args:
            until: when to end it, by the clock [s].

        Returns:
            True if the whole became shorter.
        """
        before = self._cost()
        for n in self._known:
            self.legs[n].close()
        for _ in range(OTHERS):
            tried = self._most_promising()
            if not tried or self._clock.elapsed > until or self._clock.poll():
                break
            for leg, i, j in tried:
                if not (leg.is_curve(i, j) and leg.decide(i, j, self._clock.poll)):
                    self._draft(leg, leg.starts[i], [leg.ends[j]])
                leg.close(i, j)
            self._headings = self._cheapest() or self._headings
        return self._cost() < before - SAME

    def _chosen(self) -> list[tuple[Leg, tuple[int, int]]]:
        assert self._headings is not None
        return list(zip(self.legs, pairwise(self._headings), strict=True))

    def _cost(self) -> float:
        return math.fsum(leg.costs[ends] for leg, ends in self._chosen())

    def _most_promising(self) -> list[tuple[Leg, int, int]]:
        """Return where paths are to be sought: between the headings with which the whole may be shortest, if not known."""
        assert self._headings is not None
        sizes = [len(self.legs[0].starts), *(len(leg.ends) for leg in self.legs)]
        some = [sorted({*_spread(size), chosen}) for size, chosen in zip(sizes, self._headings, strict=True)]
        chain = cheapest_chain([leg.promises()[np.ix_(*ends)] for leg, ends in zip(self.legs, pairwise(some), strict=True)])
        headings = [indices[n] for indices, n in zip(some, chain, strict=True)]
        legs = list(zip(self.legs, pairwise(headings), strict=True))
        if math.fsum(leg.promises()[ends] for leg, ends in legs) >= self._cost() - SAME:
            return []
        return [(leg, i, j) for leg, (i, j) in legs if not leg.is_closed(i, j)]

    def _cheapest(self) -> list[int] | None:
        """Return the headings with which the legs are cheapest, as far as paths of them are known.

        None where there is none, or no time to find out.
        """
        try:
            while unsure := self._undecided(headings := cheapest_chain([leg.costs for leg in self.legs])):
                for n in unsure:
                    if self.legs[n].has_obstacles and n not in self._explored:
                        self._clock.check()
                        self._explored.add(n)
                        self._explore(n)
        except OutOfTime:
            return None
        return headings if first_impassable([leg.costs for leg in self.legs]) is None else None

    def _undecided(self, headings: list[int]) -> list[int]:
        """Decide what the legs cost between headings, and return the numbers of those that may have become dearer.

        Raises:
            OutOfTime: there is no more time.
        """
        unsure = []
        for n, (leg, (i, j)) in enumerate(zip(self.legs, pairwise(headings), strict=True)):
            self._clock.check()
            if not leg.decide(i, j, self._clock.poll):
                unsure.append(n)
        return unsure

    def _explore(self, number: int) -> None:
        """Look for paths of a leg between several headings at its ends; where none is found so, plan it."""
        leg = self.legs[number]
        to_end = CostToGo(self._world.field, self._vehicle.inscribed_radius, leg.ends[0][:2])
        leg.raise_bounds(float(to_end.at(np.array([leg.starts[0][:2]]))[0]))
        starts, ends = ([poses[n] for n in _spread(len(poses))] for poses in (leg.starts, leg.ends))
        pairs = [(start, leg.ends) for start in starts] + [(starts[0], [end]) for end in ends if len(ends) > 1]
        drafts = [self._draft(leg, start, some, to_end) for start, some in pairs]
        if not any(drafts) and not self._clock.poll():
            found = self._plan_leg(leg)
            if found.path:
                leg.add(found.path)
                self.found_by = found.found_by
            self._failures[number] = found

    def _draft(self, leg: Leg, start: Pose, ends: Sequence[Pose], to_end: CostToGo | None = None) -> bool:
        """Add the path to the leg that hybrid A* finds with little work, from a start to one end or to any; return True if so."""
        problem = Problem(self._world, start=start, goal=ends[0], any_goal_heading=len(ends) > 1)
        field, vehicle = self._world.field, self._vehicle
        runs = HybridAStarRuns(problem, self._settings, field, to_end or CostToGo.to_goal(problem, field))
        path, left = None, DRAFT_EXPANSIONS
        while path is None and left > 0 and not runs.exhausted and not self._clock.poll():
            path, left = runs.run(STEP, math.inf, Work(self._clock.poll)), left - STEP
        if path is None:
            return False
        for first_round in (True, False):
            path = smooth(path, vehicle, field, self._rng, first_round, Work(self._clock.poll), self._objective)
        self.found_by = "hybrid_astar"
        leg.add(path)
        return True


def _spread(size: int) -> range:
    """Return FIRST_HEADINGS indices of so many headings, or all."""
    return range(0, size, max(1, size // FIRST_HEADINGS))
