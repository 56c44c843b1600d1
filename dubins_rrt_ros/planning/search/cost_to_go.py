"""The cost-to-go: the cheapest ways around obstacles to the goal, or from the start; no path of the vehicle costs less."""

import math

import numpy as np

from .._kernels import UNLIMITED
from .._kernels.cost_to_go import CostToGoKernel
from ..collision.clearance import ClearanceField
from ..problem import Problem
from .cost import Objective


class CostToGo:
    """Costs of the cheapest ways around obstacles to a source, for the vehicle's disc, as if it could turn on the spot.

    After `make_bound` they are lower bounds, as `_kernels/cost_to_go.py` proves; before, they can be too high by a few percent.

    Lengths are 0.5 to 6 percent below the shortest ways, the more the more often these bend, since a square is taken as free
    where a point of it may be. On maps so large that a square is wider than the vehicle, thin walls may have holes.

    Attributes:
        kernel: the compiled field, for the inner loops of the searches.
    """

    def __init__(self, field: ClearanceField, required_clearance: float, source: tuple[float, float], tolerance: float = 0.0,
                 target: tuple[float, float] | None = None, objective: Objective | None = None, free: np.ndarray | None = None):
        """Prepare the costs, which are computed as far as they are asked for until `make_bound`.

        Args:
            field: the clearance of the map.
            required_clearance: minimum clearance of a way [m].
            source, tolerance: the ways end within `tolerance` [m] of `source`.
            target: the costs on the way to here are computed first.
            objective: what a metre costs; None makes the costs lengths.
            free: the squares that ways may lead over, as `ClearanceField.free_squares` has them; None is all that are free.
        """
        cells, squares = field.free_squares(required_clearance)
        squares = squares if free is None else free
        self._field, self._free, self._objective = field, squares, objective
        self.kernel = CostToGoKernel(clearance=field.kernel, block=cells, free=squares, source=source, tolerance=tolerance,
                                     target=target, slowness=objective.slowness(is_bound=False) if objective else None)

    @classmethod
    def to_goal(cls, problem: Problem, field: ClearanceField, objective: Objective | None = None) -> "CostToGo":
        """Return the costs to where the goal is reached."""
        return cls(field, problem.vehicle.required_clearance, problem.goal[:2], problem.goal_tolerance_xy, problem.start[:2],
                   objective)

    @classmethod
    def from_start(cls, problem: Problem, field: ClearanceField, objective: Objective | None = None) -> "CostToGo":
        """Return the costs from the start."""
        return cls(field, problem.vehicle.required_clearance, problem.start[:2], objective=objective)

    def finish(self) -> None:
        """Compute all costs now, so that several threads may ask for them."""
        self.kernel.finish()

    def prepare_bound(self) -> None:
        """Do most of the work of `make_bound`; the costs stay as they are, so that another thread may use them meanwhile."""
        self.kernel.prepare_bound(self._objective.slowness(is_bound=True) if self._objective else None)

    def make_bound(self) -> "CostToGo":
        """Make the costs lower bounds, which takes several times as long as to compute them at first."""
        self.prepare_bound()
        self.kernel.make_bound()
        return self

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return (n,) costs [m] of (n, 2) points; infinite where there is no way or no room."""
        points = np.require(points, float, ["C", "W"])
        out = np.empty(len(points))
        self.kernel.values(points, out)
        out[out >= UNLIMITED] = math.inf
        return out

    def squares_between(self, other: "CostToGo") -> tuple[np.ndarray, np.ndarray]:
        """Return (n,) squares that both sources reach, and (n,) lower bounds of paths over them [m], where both are bounds."""
        total = _least_of_corners(self.kernel.nodes()) + _least_of_corners(other.kernel.nodes())
        squares = np.flatnonzero((total < UNLIMITED) & (self._free[:-1, :-1] != 0))
        return squares, total.ravel()[squares]

    def points_in(self, squares: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Return (n, 2) points [m] in (n,) squares of `squares_between`, at (n, 2) shares of their sides along and across."""
        row, column = np.divmod(squares, self._free.shape[1] - 1)
        return self._field.frame.to_map((np.column_stack([column, row]) - 1 + shares) * self.kernel.side)

    def headings(self, points: np.ndarray) -> np.ndarray:
        """Return (n,) headings [rad] in which the costs of (n, 2) points fall; NaN where no way is known, and at the source."""
        points = np.require(points, float, ["C", "W"])
        out = np.empty(len(points))
        self.kernel.descent(points, out)
        return out


def _least_of_corners(nodes: np.ndarray) -> np.ndarray:
    """Return the (rows - 1, columns - 1) least costs at the corners of squares between (rows, columns) nodes."""
    lower = np.minimum(nodes[:, :-1], nodes[:, 1:])
    return np.asarray(np.minimum(lower[:-1], lower[1:]))
