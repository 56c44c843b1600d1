"""The legs of a path over waypoints: the costs between all headings at their ends, and the cheapest chain of them.

The cost of a leg between two headings is that of the shortest curve where that is free, and elsewhere that of the cheapest way
onto a path of the leg that is known already, along it, and off it again. A curve that has not been checked counts as free, so
that costs are lower bounds until they are decided; only those that a cheapest chain needs are, as in the lazy search of C. Dellin
and S. Srinivasa, A unifying formalism for shortest path problems with expensive edge evaluations (2016).
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .._kernels.junctions import check_curves
from ..collision.clearance import ClearanceField
from ..curves import dubins
from ..curves.path import Path
from ..deadline import never
from ..problem import Pose
from ..vehicle import Vehicle
from .known_path import Junctions, KnownPath

#: Maximum number of curves that are found blocked one by one before all of a leg that matter are checked.
FEW = 16
#: Number of parts in which these are checked; the time is looked at between them.
SLICES = 16


class _Known(NamedTuple):
    """A known path of a leg, and what of it is driven between each two headings at its ends.

    Attributes:
        path: the path.
        costs: (starts, ends) float64, with the curves onto it and off it [m]; infinite where none is free.
        first, last: (starts, ends) int32, the indices of its poses where these end and begin.
    """

    path: KnownPath
    costs: np.ndarray
    first: np.ndarray
    last: np.ndarray

    @classmethod
    def of(cls, path: KnownPath, starts: Sequence[Pose], ends: Sequence[Pose]) -> "_Known":
        """Find how to get onto a path from each of some poses, and off it to each of some others."""
        onto, off = path.onto(starts), path.off(ends)
        own = Junctions(np.where([pose == path.start for pose in starts], path.cost, math.inf), np.zeros(len(starts), np.int32))
        end = Junctions(np.where([pose == path.end for pose in ends], path.cost, math.inf),
                        np.full(len(ends), path.last, np.int32))
        known = cls(path, *_pairs(onto, off, path.cost))
        # On a short path what is cheapest at either end may cross; then its own ends will do.
        for begin, finish in ((onto, end), (own, off), (own, end)):
            others = cls(path, *_pairs(begin, finish, path.cost))
            better = np.isinf(known.costs) & np.isfinite(others.costs)
            for mine, theirs in zip(known[1:], others[1:], strict=True):
                mine[better] = theirs[better]
        return known


def _pairs(onto: Junctions, off: Junctions, cost: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return costs and indices for each two junctions, where the first is not behind the second."""
    costs = onto.costs[:, None] + off.costs - cost
    first, last = (np.array(indices) for indices in np.broadcast_arrays(onto.indices[:, None], off.indices))
    costs[first > last] = math.inf
    return costs, first, last


class Leg:
    """The way between two places, each with one heading or with several.

    Attributes:
        starts, ends: the poses there, one for each heading.
        costs: (starts, ends) float64: the cheapest known costs [m], or lower bounds; infinite where no path is known.
    """

    def __init__(self, starts: Sequence[Pose], ends: Sequence[Pose], field: ClearanceField, vehicle: Vehicle):
        self.starts, self.ends = starts, ends
        self._field, self._vehicle = field, vehicle
        self._checker = field.collision_checker(vehicle)
        self._curves = dubins.lengths(np.array(starts)[:, None], np.array(ends)[None], vehicle.turning_radius)
        self._is_free = np.zeros(self._curves.shape, bool)
        self._over_known = np.full(self._curves.shape, math.inf)
        self._known: list[_Known] = []
        self._blocked = 0
        self.costs = self._curves.copy()
        self._bounds = self._curves.copy()
        self._is_closed = np.zeros(self._curves.shape, bool)

    @property
    def has_obstacles(self) -> bool:
        """True if a curve was found blocked."""
        return self._blocked > 0

    def is_curve(self, i: int, j: int) -> bool:
        """Return True if the cheapest path between two headings is a single curve."""
        return bool(self._curves[i, j] <= self._over_known[i, j])

    def decide(self, i: int, j: int, interrupted: Callable[[], bool] = never) -> bool:
        """Return True if the cost between two headings is certain; else it has become so now, and may have risen."""
        if self._is_free[i, j] or not self.is_curve(i, j) or self.costs[i, j] == math.inf:
            return True
        self._check(np.array([[i, j]]))
        if self._blocked > FEW:
            for some in np.array_split(np.argwhere((self._curves < self._over_known) & ~self._is_free), SLICES):
                self._check(some, may_be_free=not interrupted())
        self.costs = np.minimum(self._curves, self._over_known)
        return bool(self._is_free[i, j])

    def add(self, path: Path) -> None:
        """Take another path of this leg into account, between any headings."""
        self._known.append(_Known.of(KnownPath(path, self._field, self._vehicle), self.starts, self.ends))
        self._over_known = np.minimum(self._over_known, self._known[-1].costs)
        self.costs = np.minimum(self._curves, self._over_known)

    def raise_bounds(self, distance: float) -> None:
        """Take into account that no path of this leg is shorter [m]."""
        self._bounds = np.maximum(self._bounds, distance)

    def close(self, i: int | slice = slice(None), j: int | slice = slice(None)) -> None:
        """Take the costs between two headings, or between all, as the least there are: no more paths are sought there."""
        self._is_closed[i, j] = True

    def is_closed(self, i: int, j: int) -> bool:
        """Return True if no more paths are sought between two headings: they are closed, or a curve is free there."""
        return bool(self._is_closed[i, j] or self._is_free[i, j])

    def promises(self) -> np.ndarray:
        """Return (starts, ends) float64: the costs, or lower bounds where more paths may be sought [m]."""
        return np.where(self._is_closed | self._is_free, self.costs, np.minimum(self.costs, self._bounds))

    def path(self, i: int, j: int) -> Path:
        """Return the cheapest path between two headings, whose cost is decided and finite."""
        start, end = self.starts[i], self.ends[j]
        if self.is_curve(i, j):
            return Path.of_curves(start, end, [dubins.shortest(start, end, self._vehicle.turning_radius)])
        known = min(self._known, key=lambda known: known.costs[i, j])
        return known.path.between(start, int(known.first[i, j]), end, int(known.last[i, j]))

    def _check(self, pairs: np.ndarray, may_be_free: bool = True) -> None:
        """Check the curves between (n, 2) pairs of indices; they count as blocked where there is no time for that."""
        free = np.zeros(len(pairs), np.uint8)
        if may_be_free:
            starts, ends = (np.array(poses)[pairs[:, k]] for k, poses in enumerate((self.starts, self.ends)))
            check_curves(self._checker, starts, ends, self._vehicle.turning_radius, free)
        is_free = free.astype(bool)
        rows, columns = pairs.T
        self._is_free[rows, columns] = is_free
        self._curves[rows[~is_free], columns[~is_free]] = math.inf
        self._blocked += int(np.count_nonzero(~is_free))


def cheapest_chain(costs: Sequence[np.ndarray]) -> list[int]:
    """Return the index of the heading at each place with which the legs are cheapest together, by dynamic programming.

    Args:
        costs: (headings at its start, headings at its end) of each leg; infinite where there is no path.
    """
    cost_to_come = np.zeros(len(costs[0]))
    before = []
    for leg in costs:
        total = cost_to_come[:, None] + leg
        before.append(np.argmin(total, axis=0))
        cost_to_come = total.min(axis=0)
    chain = [int(np.argmin(cost_to_come))]
    for best in reversed(before):
        chain.append(int(best[chain[-1]]))
    return chain[::-1]


def first_impassable(costs: Sequence[np.ndarray]) -> int | None:
    """Return the first leg up to whose end no chain of finite cost leads, or None where one leads to the last end."""
    cost_to_come = np.zeros(len(costs[0]))
    for number, leg in enumerate(costs):
        cost_to_come = (cost_to_come[:, None] + leg).min(axis=0)
        if not np.isfinite(cost_to_come).any():
            return number
    return None
