"""A path that is known already, parts of which may be parts of others: from another start, or to another goal."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._kernels import UNLIMITED
from .._kernels.junctions import cheapest_junctions
from ..collision.clearance import ClearanceField
from ..curves import dubins
from ..curves.dubins import DubinsCurve
from ..curves.path import Path
from ..problem import Pose
from ..vehicle import Vehicle
from .cost import lengths_of

#: Maximum distance between two poses of the path at which others join or leave it, in turning radii.
SPACING = 0.5
#: Maximum number of curves that are checked for one pose.
MAX_CHECKED = 48


class Junctions(NamedTuple):
    """The cheapest free curves between poses and a known path.

    Attributes:
        costs: (n,) float64, of each curve and of the part of the path that is driven with it [m]; infinite where none is free.
        indices: (n,) int32, of the path's poses where the curves begin or end.
    """

    costs: np.ndarray
    indices: np.ndarray


class KnownPath:
    """A path, cut into pieces, with curves onto it and off it. That the pieces are free is left to `joined`."""

    def __init__(self, path: Path, field: ClearanceField, vehicle: Vehicle):
        pieces = path.cut(SPACING * vehicle.turning_radius)
        self._path = pieces if field.test_accepts(pieces) else path
        self._radius = vehicle.turning_radius
        self._along = np.append(0.0, np.cumsum(lengths_of(self._path.lengths[1:])))
        self._checker = field.collision_checker(vehicle)

    @property
    def start(self) -> Pose:
        """The first pose of the path."""
        return self._path.start

    @property
    def end(self) -> Pose:
        """The last pose of the path."""
        return self._path.end

    @property
    def last(self) -> int:
        """The index of the last pose of the path."""
        return len(self._along) - 1

    @property
    def cost(self) -> float:
        """The cost of the whole path [m]."""
        return float(self._along[-1])

    def onto(self, poses: Sequence[Pose]) -> Junctions:
        """Find the cheapest ways from poses to the end of the path."""
        return self._cheapest(poses, self.cost - self._along, True)

    def off(self, poses: Sequence[Pose]) -> Junctions:
        """Find the cheapest ways from the start of the path to poses."""
        return self._cheapest(poses, self._along, False)

    def joined(self, start: Pose, goal: Pose) -> Path | None:
        """Return the cheapest path from start to goal over this one, all of it free, or None."""
        (_, (first,)), (_, (last,)) = self.onto([start]), self.off([goal])
        if min(first, last) < 0:
            return None
        if first > last:  # the cheapest ways onto the path and off it cross
            if start != self.start:
                direct = dubins.shortest(start, goal, self._radius)
                return Path.of_curves(start, goal, [direct]) if self._are_free([direct]) else None
            first = 0
        return self.between(start, first, goal, last) if self._are_free(self._path.curves[first:last]) else None

    @property
    def is_free(self) -> bool:
        """True if the whole path is free."""
        return self._are_free(self._path.curves)

    def _are_free(self, curves: Sequence[DubinsCurve]) -> bool:
        return all(self._checker.is_motion_free(curve.start, curve.radius, curve.index, curve.lengths) for curve in curves)

    def between(self, start: Pose, first: int, goal: Pose, last: int) -> Path:
        """Return the path from start to goal over the path's poses from `first` to `last`."""
        begin, end = self._pose(first), self._pose(last)
        onto = [] if start == begin else [dubins.shortest(start, begin, self._radius)]
        off = [] if goal == end else [dubins.shortest(end, goal, self._radius)]
        return Path.of_curves(start, goal, [*onto, *self._path.curves[first:last], *off])

    def from_start(self, goal: Pose, last: int) -> Path:
        """Return the path to a goal that leaves this one at its pose `last`."""
        return self.between(self._pose(0), 0, goal, last)

    def to_end(self, start: Pose, first: int) -> Path:
        """Return the path from a start that joins this one at its pose `first`."""
        return self.between(start, first, self.end, self.last)

    def _cheapest(self, poses: Sequence[Pose], rest: np.ndarray, onto_path: bool) -> Junctions:
        costs, indices = np.empty(len(poses)), np.empty(len(poses), np.int32)
        cheapest_junctions(self._checker, np.array(poses), self._path.waypoints, rest, onto_path, self._radius, MAX_CHECKED,
                           indices, costs)
        costs[costs >= UNLIMITED] = np.inf
        return Junctions(costs, indices)

    def _pose(self, index: int) -> Pose:
        x, y, theta = self._path.waypoints[index].tolist()
        return x, y, theta
