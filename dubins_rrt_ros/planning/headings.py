"""The headings of random poses: any, towards the goal, or along the way around obstacles to the goal."""

import math

import numpy as np

from ._kernels import COMPILED
from ._kernels.field import Eikonal
from .clearance import ClearanceField
from .problem import Problem
from .settings import Settings

#: A cell of the goal field is at most as wide as this share of the turning radius and as the radius of the vehicle's disc ...
CELL = 1 / 8
#: ... unless that makes more cells than about this many.
MOST_CELLS = 70_000 if COMPILED else 4_000
#: Mixed headings: the share of uniform ones, and the standard deviation of the others about the field [rad].
UNIFORM_SHARE = 0.2
SPREAD = math.radians(20)
#: The four cells between whose centres a point lies: columns and rows from the lowest on.
AROUND = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])


class Headings:
    """Draws headings for random positions, as `heading_sampling` says.

    `uniform` and `mixed` keep RRT* asymptotically optimal, since they draw all poses: a fixed share of `mixed`, UNIFORM_SHARE, is
    uniform. `goal` and `field` do not: they have one heading for a position, and the best path may need another.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField):
        self._kind = settings.heading_sampling
        self._goal = np.array(problem.goal[:2])
        self._field = GoalField(problem, field) if self._kind in ("field", "mixed") else None

    def draw(self, positions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """(n,) headings [rad] for (n, 2) positions [m]; uniform ones where the field has none."""
        if self._kind == "goal":
            towards = self._goal - positions
            return np.arctan2(towards[:, 1], towards[:, 0])
        uniform = rng.uniform(-math.pi, math.pi, len(positions))
        if self._field is None:
            return uniform
        led = self._field.directions(positions)
        if self._kind == "mixed":
            led += rng.normal(0, SPREAD, len(positions))
            led[rng.random(len(positions)) < UNIFORM_SHARE] = math.nan
        return np.where(np.isnan(led), uniform, np.remainder(led + math.pi, math.tau) - math.pi)


class GoalField:
    """How far the goal is around obstacles for the vehicle's disc, as if it could turn on the spot.

    It is advice and proves nothing. Cells are passable where a point of them may be free, so that the field may lead through a
    gap a little too narrow, and on maps so large that a cell is wider than the vehicle through thin walls.

    Attributes:
        cell: the side of a cell [m].
        cost: (rows, columns) float64, the distance from the centres of cells to where the goal is reached [m]; infinite where
            no way is known, and all around the edge, beyond the map.
    """

    def __init__(self, problem: Problem, field: ClearanceField):
        kernel, need = field.kernel, problem.vehicle.robot_radius
        corners = problem.map.corners()
        sides = corners[[1, 3]] - corners[0]
        self._corner, self._axes = corners[0], sides / np.hypot(*sides.T)[:, None]
        block = _block(kernel.field.shape, kernel.resolution, min(CELL * problem.vehicle.turning_radius, need))
        self.cell = block * kernel.resolution
        equation = Eikonal(kernel, block, need)
        self.cost = equation.solve(*self._around(problem.goal[:2], problem.goal_tolerance_xy, equation.shape)) * self.cell

    def directions(self, points: np.ndarray) -> np.ndarray:
        """(n,) the headings [rad] in which the cost falls at (n, 2) points, interpolated between the centres of cells; NaN where
        it does not fall: where no way is known, and where the goal is reached."""
        rows, columns = self.cost.shape
        at = np.clip(self._indices(points), 0, (columns - 1, rows - 1))
        low = np.minimum(at.astype(int), (columns - 2, rows - 2))
        share = (at - low)[:, None]
        weights = np.where(AROUND, share, 1 - share).prod(axis=2, keepdims=True)
        fall = (weights * self._fall((low[:, None] + AROUND) @ (1, columns))).sum(axis=1)
        x, y = (fall @ self._axes).T
        return np.where(fall.any(axis=1), np.arctan2(y, x), math.nan)

    def _fall(self, cells: np.ndarray) -> np.ndarray:
        """(..., 2) by how much the cost falls from cells to their neighbours along the row and across; 0 where it is infinite."""
        cost = self.cost.ravel()
        known = np.isfinite(cost[cells])
        here = cells[known]
        fall = np.zeros((*cells.shape, 2))
        for axis, step in enumerate((1, self.cost.shape[1])):
            behind, ahead = cost[here - step], cost[here + step]
            fall[known, axis] = np.maximum(cost[here] - np.minimum(behind, ahead), 0) * np.where(ahead < behind, 1, -1)
        return fall

    def _around(self, goal: tuple[float, float], tolerance: float, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """The cells whose centres are within a cell of where the goal is reached, and how far they are in sides of a cell."""
        column, row = self._indices(np.array([goal]))[0]
        distance = np.hypot(np.arange(shape[0])[:, None] - row, np.arange(shape[1]) - column) - tolerance / self.cell
        cells = np.flatnonzero(distance <= 1).astype(np.int32)
        return cells, np.maximum(distance.ravel()[cells], 0)

    def _indices(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) column and row of (n, 2) points among the cells with their border, whole numbers at their centres."""
        return (points - self._corner) @ self._axes.T / self.cell + 0.5


def _block(shape: tuple[int, int], resolution: float, wish: float) -> int:
    """How many cells of the raster make a side of the field's cells."""
    return max(1, math.floor(wish / resolution + 1e-6), math.ceil(math.sqrt(shape[0] * shape[1] / MOST_CELLS)))
