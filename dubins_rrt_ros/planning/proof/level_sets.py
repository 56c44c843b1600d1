"""Level sets of the cost from the start, which every path to the goal crosses one after the other.

The cost from the start is continuous, and linear on triangles (`_kernels/cost_to_go.py`). It is at most 0 at the start, so a path
to where it is above `level` takes that value, and a higher one later: the first crossings of several levels come in the order of
the levels, whichever way round the obstacles the path takes. Where it first reaches a level it comes from lower costs, so its
heading is within a right angle of the gradient there.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import label

from .._kernels import UNLIMITED
from ..collision.clearance import ClearanceField
from ..curves.angles import wrap
from ..problem import Problem
from ..search.cost_bounds import LengthBounds
from ..search.cost_to_go import CostToGo
from .box_room import BoxRoom

#: The corners (column, row) of the triangles of a square that is split along each of its diagonals.
UPWARDS = (((0, 0), (1, 0), (1, 1)), ((0, 0), (0, 1), (1, 1)))
DOWNWARDS = (((0, 0), (1, 0), (0, 1)), ((1, 1), (1, 0), (0, 1)))
#: Squares that touch at a corner are connected.
EIGHT_NEIGHBORS = np.ones((3, 3), bool)


class Pieces(NamedTuple):
    """Straight pieces of a level set.

    Attributes:
        ends: (n, 4) x and y of both ends [m].
        gradients: (n,) directions in which the cost rises there [rad].
        squares: (n,) indices of the squares that they are in.
    """

    ends: np.ndarray
    gradients: np.ndarray
    squares: np.ndarray

    def those(self, chosen: np.ndarray) -> "Pieces":
        """Return the pieces that are chosen."""
        return Pieces(self.ends[chosen], self.gradients[chosen], self.squares[chosen])


class LevelSets:
    """The level sets of the cost from the start, as far as paths below a length can meet them.

    Attributes:
        bound: length that no path falls below [m].
        end: where a path reaches the goal the cost is at least this [m]: it crosses all levels below.
    """

    def __init__(self, problem: Problem, field: ClearanceField, bounds: LengthBounds | None = None):
        """Take the lengths from the start and to the goal, which must be lower bounds, or compute them."""
        self._field = field
        self.box_room = BoxRoom(field, problem.vehicle.required_clearance, problem.vehicle.turning_radius)
        self._from_start, self._to_goal = bounds or LengthBounds(CostToGo.from_start(problem, field).make_bound(),
                                                                 CostToGo.to_goal(problem, field).make_bound())
        self._costs = self._from_start.kernel.nodes()
        self._least, self._most = _least_of_corners(self._costs), -_least_of_corners(-self._costs)
        self._is_free = field.free_squares(problem.vehicle.required_clearance).is_free[:-1, :-1] != 0
        self._least_left = _least_of_corners(self._to_goal.kernel.nodes())
        self._total = self._least + self._least_left
        self.end = self._cost_at_goal(problem)
        self.bound = max(float(self._to_goal.at(np.array([problem.start[:2]]))[0]), self.end)

    def _cost_at_goal(self, problem: Problem) -> float:
        """Return the least cost where the goal is reached [m]."""
        goal, tolerance = np.array([problem.goal[:2]]), problem.goal_tolerance_xy
        if tolerance == 0:
            return float(self._from_start.at(goal)[0])
        side = self._from_start.kernel.side
        column, row = self._field.frame.from_map(goal)[0] / side + 1
        rows, columns = np.nonzero(self._is_free)
        near = np.hypot(columns + 0.5 - column, rows + 0.5 - row) <= tolerance / side + 1
        return max(0.0, float(self._least[rows[near], columns[near]].min(initial=UNLIMITED)))

    @property
    def from_start(self) -> np.ndarray:
        """Costs from the start at the nodes [m], `UNLIMITED` where there is no way."""
        return np.asarray(self._costs)

    @property
    def to_goal(self) -> np.ndarray:
        """Costs to the goal at the nodes [m]."""
        return np.asarray(self._to_goal.kernel.nodes())

    @property
    def is_free(self) -> np.ndarray:
        """The squares between the nodes that may hold a free place; the first node is one square before the raster."""
        return np.asarray(self._is_free)

    @property
    def side(self) -> float:
        """Side of a square [m]."""
        return float(self._from_start.kernel.side)

    def costs(self, points: np.ndarray) -> np.ndarray:
        """Return the (n,) costs from the start at (n, 2) points [m]; infinite where there is no way."""
        return self._from_start.at(points)

    def pieces(self, level: float, limit: float) -> Pieces:
        """Return the pieces of a level set that paths shorter than `limit` may cross; all of them for an infinite limit."""
        while np.any(self._costs == level):  # the level set has no width then
            level = math.nextafter(level, 0)
        is_crossed = (self._least < level) & (self._most >= level) & (self._most < UNLIMITED) & (self._total < limit)
        rows, columns = np.nonzero(is_crossed & self._is_free)
        ends, gradients, squares = self._segments(rows, columns, level)
        frame = self._field.frame
        side = self._from_start.kernel.side
        both = frame.to_map((ends.reshape(-1, 2) - 1) * side).reshape(-1, 4)
        return Pieces(both, wrap(gradients + frame.yaw), squares)

    def components(self, low: float, high: float, limit: float) -> np.ndarray:
        """Return the labels of all squares by connected parts of those with costs from `low` to `high`.

        A path shorter than `limit` keeps to one label while its costs are in this range.
        """
        meets = (self._least <= high) & (self._most >= low) & (self._total < limit) & self._is_free
        labels = np.zeros(meets.shape, np.int32)
        rows, columns = np.flatnonzero(meets.any(axis=1)), np.flatnonzero(meets.any(axis=0))
        if len(rows):
            part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
            label(meets[part], EIGHT_NEIGHBORS, output=labels[part])
        return labels.ravel()

    def square_at(self, point: tuple[float, float]) -> int:
        """Return the index of the square that holds a point."""
        column, row = np.floor(self._field.frame.from_map(np.array([point]))[0] / self._from_start.kernel.side + 1).astype(int)
        return int(row * self._least.shape[1] + column)

    def least_left_in(self, squares: np.ndarray) -> float:
        """Return a lower bound of the way to the goal from all of some squares [m]."""
        return float(self._least_left.ravel()[squares].min())

    def _segments(self, rows: np.ndarray, columns: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the segments in squares, as (n, 4) columns and rows of their ends, the gradients' directions, the squares."""
        corners = {(x, y): self._costs[rows + y, columns + x] for x in (0, 1) for y in (0, 1)}
        upwards, downwards = _squared_slopes(corners)
        squares = rows * self._least.shape[1] + columns
        found = [_in_triangle(rows[mask], columns[mask], squares[mask],
                              [(*corner, corners[corner][mask]) for corner in triangle], level)
                 for mask, triangles in ((upwards <= downwards, UPWARDS), (upwards > downwards, DOWNWARDS))
                 for triangle in triangles]
        ends, gradients, inside = (np.concatenate(each) for each in zip(*found, strict=True))
        return ends, gradients, inside

    def portals(self, level: float, limit: float) -> list[Pieces]:
        """Return the connected parts of a level set, as far as paths shorter than `limit` may cross it."""
        pieces = self.pieces(level, limit)
        columns = self._least.shape[1]
        rows_columns = np.divmod(pieces.squares, columns)
        holds = np.zeros(self._least.shape, bool)
        holds[rows_columns] = True
        labels, count = label(holds, EIGHT_NEIGHBORS)
        of_pieces = labels[rows_columns]
        return [pieces.those(of_pieces == number) for number in range(1, count + 1)]

    def least_left(self, points: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """Return (n,) lower bounds of the way to the goal [m] from within `reach` [m] of (n, 2) points, along level sets."""
        return np.asarray(np.maximum(self._to_goal.at(points) - reach, 0))


def _least_of_corners(nodes: np.ndarray) -> np.ndarray:
    """Return the least value at the corners of each square."""
    lower = np.minimum(nodes[:, :-1], nodes[:, 1:])
    return np.asarray(np.minimum(lower[:-1], lower[1:]))


def _squared_slopes(corners: dict[tuple[int, int], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the squared steeper gradients of squares by an upwards diagonal and by a downwards one, as `Eikonal` has them."""
    here, right, above, beyond = corners[0, 0], corners[1, 0], corners[0, 1], corners[1, 1]
    bottom, top, left, side = (right - here) ** 2, (beyond - above) ** 2, (above - here) ** 2, (beyond - right) ** 2
    return np.maximum(bottom + side, left + top), np.maximum(bottom + left, top + side)


def _in_triangle(rows: np.ndarray, columns: np.ndarray, squares: np.ndarray, corners: list[tuple[int, int, np.ndarray]],
                 level: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where a level crosses a triangle of each square: (n, 4) columns and rows of both ends, gradients, and squares."""
    values = np.stack([value for _, _, value in corners])
    xs, ys = np.array([x for x, _, _ in corners], float), np.array([y for _, y, _ in corners], float)
    below = values < level
    count = below.sum(axis=0)
    crossed = (count > 0) & (count < 3)
    values, below = values[:, crossed], below[:, crossed]
    alone = np.where(count[crossed] == 1, below.argmax(axis=0), below.argmin(axis=0))  # the corner on a side of its own
    index = np.arange(len(alone))
    ends = []
    for other in ((alone + 1) % 3, (alone + 2) % 3):
        share = (level - values[alone, index]) / (values[other, index] - values[alone, index])
        ends += [columns[crossed] + xs[alone] + share * (xs[other] - xs[alone]),
                 rows[crossed] + ys[alone] + share * (ys[other] - ys[alone])]
    rise1, rise2 = values[1] - values[0], values[2] - values[0]
    x1, y1, x2, y2 = xs[1] - xs[0], ys[1] - ys[0], xs[2] - xs[0], ys[2] - ys[0]
    turn = x1 * y2 - x2 * y1
    gradients = np.arctan2((x1 * rise2 - x2 * rise1) / turn, (rise1 * y2 - rise2 * y1) / turn)
    return np.stack(ends, axis=1), gradients, squares[crossed]
