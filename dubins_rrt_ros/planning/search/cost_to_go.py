"""How far places are around obstacles from where the goal is reached, or from the start: no path of the vehicle is shorter."""

import math

import numpy as np

from .._kernels.cost_to_go import CostToGoKernel
from ..collision.clearance import ClearanceField
from ..problem import Problem

#: What the kernel gives where no way is.
FAR = 1e300


class DistanceField:
    """The distances from a source around obstacles, for the vehicle's disc, as if it could turn on the spot.

    After `make_bound` they are lower bounds, as `_kernels/cost_to_go.py` proves; before, they can be too high by some hundredths.

    They are about a hundredth below the shortest ways, and a little more where ways bend, since a square is taken as free where a
    point of it may be. On maps so large that a square is wider than the vehicle, thin walls may have holes.

    Attributes:
        kernel: the compiled field, for the planner's inner loop.
    """

    def __init__(self, field: ClearanceField, need: float, source: tuple[float, float], tolerance: float = 0.0,
                 target: tuple[float, float] | None = None):
        """The distances to all within `tolerance` [m] of `source`, where the clearance is at least `need` [m]. Until `make_bound`
        they are found as far as asked, and those on the way to `target` first, if there is one."""
        cells, squares = field.free_squares(need)
        self._field, self._free = field, squares
        self.kernel = CostToGoKernel(field.kernel, cells, squares, source, tolerance, target)

    @classmethod
    def to_goal(cls, problem: Problem, field: ClearanceField) -> "DistanceField":
        """The distances to where the goal is reached."""
        return cls(field, problem.vehicle.inscribed_radius, problem.goal[:2], problem.goal_tolerance_xy, problem.start[:2])

    @classmethod
    def from_start(cls, problem: Problem, field: ClearanceField) -> "DistanceField":
        """The distances from the start."""
        return cls(field, problem.vehicle.inscribed_radius, problem.start[:2])

    def finish(self) -> None:
        """Find all distances now, so that several threads may ask for them."""
        self.kernel.finish()

    def prepare_bound(self) -> None:
        """Do most of the work of `make_bound` while the distances are still as they are: another thread may go on to use them."""
        self.kernel.prepare_bound()

    def make_bound(self) -> "DistanceField":
        """Make the distances lower bounds, which takes several times as long as to find them at first."""
        self.kernel.make_bound()
        return self

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n,) distances [m] of (n, 2) points, at least; infinite where no way is or no room."""
        points = np.require(points, float, "CW")
        out = np.empty(len(points))
        self.kernel.values(points, out)
        out[out >= FAR] = math.inf
        return out

    def squares_between(self, other: "DistanceField") -> tuple[np.ndarray, np.ndarray]:
        """(n,) the squares that can be reached from this source and the other's, and (n,) lengths that no path over them falls
        below [m], if both fields are bounds."""
        total = _least_of_corners(self.kernel.nodes()) + _least_of_corners(other.kernel.nodes())
        squares = np.flatnonzero((total < FAR) & (self._free[:-1, :-1] != 0))
        return squares, total.ravel()[squares]

    def points_in(self, squares: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """(n, 2) points [m] in (n,) squares as `squares_between` gives them, at (n, 2) shares of the sides along and across."""
        row, column = np.divmod(squares, self._free.shape[1] - 1)
        return self._field.frame.to_map((np.column_stack([column, row]) - 1 + shares) * self.kernel.side)

    def headings(self, points: np.ndarray) -> np.ndarray:
        """(n,) headings [rad] in which the distances of (n, 2) points fall; NaN where no way is known, and at the source."""
        points = np.require(points, float, "CW")
        out = np.empty(len(points))
        self.kernel.descent(points, out)
        return out


def _least_of_corners(nodes: np.ndarray) -> np.ndarray:
    """(rows - 1, columns - 1): the least of the costs of (rows, columns) nodes at the corners of each square."""
    lower = np.minimum(nodes[:, :-1], nodes[:, 1:])
    return np.minimum(lower[:-1], lower[1:])
