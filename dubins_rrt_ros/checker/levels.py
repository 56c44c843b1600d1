"""Squares with costs at their corners, cut into triangles on which the costs are linear, and the levels of these costs."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

#: The corners (row, column) of the two triangles of a square, by its upward diagonal and by the other one.
UPWARD = (((0, 0), (0, 1), (1, 1)), ((0, 0), (1, 0), (1, 1)))
DOWNWARD = (((0, 0), (0, 1), (1, 0)), ((1, 1), (0, 1), (1, 0)))

#: Half the range of headings in which a path crosses a level [rad], a right angle but for rounding.
HALF_CIRCLE = np.pi / 2 + 1e-9


class Pieces(NamedTuple):
    """Straight pieces of levels, one for each triangle that a level crosses.

    Attributes:
        square, triangle, level: (n,) indices.
        ends: (n, 4) x and y of both ends [m].
        rising: (n,) direction in which the costs rise there [rad].
    """

    square: np.ndarray
    triangle: np.ndarray
    level: np.ndarray
    ends: np.ndarray
    rising: np.ndarray

    def boxes(self, index: np.ndarray, way: np.ndarray, shares: np.ndarray, widen: float) -> np.ndarray:
        """Return (n, 8) boxes on pieces, as `bounds.py` has them, a little larger than they are.

        Args:
            index: (n,) of the pieces.
            way: (n,) 1 where the costs rise along a path, -1 where they fall.
            shares: (n, 4) ranges of the place, from 0 to 1 along a piece, and of the heading, from -1 to 1 for the headings
                within a right angle of the direction in which the costs rise, or fall.
            widen: lengths that are added for rounding [m].
        """
        ends = self.ends[index]
        along = ends[:, 2:] - ends[:, :2]
        length = np.hypot(*along.T)
        unit = np.where(length[:, None] > widen, along / np.maximum(length, widen)[:, None], (1.0, 0.0))
        middle = ends[:, :2] + shares[:, :2].mean(axis=1)[:, None] * along
        heading = self.rising[index] + np.where(way > 0, 0, np.pi) + shares[:, 2:].mean(axis=1) * HALF_CIRCLE
        half, turn = (shares[:, 1] - shares[:, 0]) / 2 * length + widen, (shares[:, 3] - shares[:, 2]) / 2 * HALF_CIRCLE
        return np.column_stack([middle, unit, half, np.full(len(half), widen), heading, turn])


class Squares(NamedTuple):
    """Squares in rows and columns; all arrays of squares are flat, row by row.

    Attributes:
        corner: x, y of the first node [m].
        side: that of a square [m].
        costs: (rows + 1, columns + 1) at the nodes [m]; not a number where there are none.
        levels: (k,) ascending costs, none of them that of a node. Slab i is where the costs are from level i - 1 to level i.
    """

    corner: tuple[float, float]
    side: float
    costs: np.ndarray
    levels: np.ndarray

    @property
    def columns(self) -> int:
        """Number of squares in a row."""
        return self.costs.shape[1] - 1

    def corners(self, some: np.ndarray) -> np.ndarray:
        """Return the (n, 2, 2) costs at the corners of squares, by row and column."""
        row, column = np.divmod(some, self.columns)
        return np.stack([np.stack([self.costs[row + i, column + j] for j in (0, 1)], axis=-1) for i in (0, 1)], axis=-2)

    def is_upward(self, corners: np.ndarray) -> np.ndarray:
        """Return the diagonal by which squares are cut: that with the less steep triangles."""
        return np.asarray(squared_slopes(corners, UPWARD) <= squared_slopes(corners, DOWNWARD))

    def slabs(self, costs: np.ndarray | float) -> np.ndarray:
        """Return the slabs of costs."""
        return np.asarray(np.searchsorted(self.levels, costs))

    def at(self, x: float, y: float) -> tuple[int, float]:
        """Return the square that holds a place, and the cost there [m]."""
        across, up = (x - self.corner[0]) / self.side, (y - self.corner[1]) / self.side
        column, row = int(across), int(up)
        across, up, square = across - column, up - row, np.array([row * self.columns + column])
        c = self.corners(square)
        if self.is_upward(c)[0]:
            middle = c[0, 0, 1] if across > up else c[0, 1, 0]
            first, second = (across, up) if across > up else (up, across)
            return int(square[0]), float(c[0, 0, 0] + first * (middle - c[0, 0, 0]) + second * (c[0, 1, 1] - middle))
        one, other = float(c[0, 0, 1]), float(c[0, 1, 0])
        if across + up < 1:
            return int(square[0]), float(c[0, 0, 0] * (1 - across - up) + across * one + up * other)
        return int(square[0]), float(c[0, 1, 1] * (across + up - 1) + (1 - up) * one + (1 - across) * other)

    def within(self, some: np.ndarray, x: float, y: float, reach: float) -> np.ndarray:
        """Return those of some squares that are within a distance [m] of a place."""
        row, column = np.divmod(some, self.columns)
        off_x = np.abs(self.corner[0] + self.side * (column + 0.5) - x) - self.side / 2
        off_y = np.abs(self.corner[1] + self.side * (row + 0.5) - y) - self.side / 2
        return some[np.hypot(np.maximum(off_x, 0), np.maximum(off_y, 0)) <= reach]

    def pieces(self, some: np.ndarray) -> Pieces:
        """Return the pieces of all levels in some squares."""
        corners = self.corners(some)
        low, high = self.slabs(corners.min(axis=(1, 2))), self.slabs(corners.max(axis=(1, 2)))
        index = np.repeat(np.arange(len(some)), high - low)
        level = np.arange(len(index)) - np.repeat(np.cumsum(high - low) - high, high - low)
        upward = self.is_upward(corners)[index]
        found = [self._in_triangle(some[index[mask]], level[mask], number, triangle)
                 for mask, triangles in ((upward, UPWARD), (~upward, DOWNWARD)) for number, triangle in enumerate(triangles)]
        return Pieces(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def _in_triangle(self, squares: np.ndarray, level: np.ndarray, number: int, triangle: tuple[tuple[int, int], ...]) -> Pieces:
        corners = self.corners(squares)
        values, value = np.stack([corners[:, i, j] for i, j in triangle]), self.levels[level]
        below = values < value
        crossed = (below.sum(axis=0) > 0) & (below.sum(axis=0) < 3)
        values, value, below, squares = values[:, crossed], value[crossed], below[:, crossed], squares[crossed]
        rows, columns = np.divmod(squares, self.columns)
        lone = np.where(below.sum(axis=0) == 1, below.argmax(axis=0), below.argmin(axis=0))  # the corner on a side of its own
        ups, acrosses = np.array(triangle, dtype=float).T
        each, ends = np.arange(len(lone)), []
        for other in ((lone + 1) % 3, (lone + 2) % 3):
            share = (value - values[lone, each]) / (values[other, each] - values[lone, each])
            ends += [self.corner[0] + self.side * (columns + acrosses[lone] + share * (acrosses[other] - acrosses[lone])),
                     self.corner[1] + self.side * (rows + ups[lone] + share * (ups[other] - ups[lone]))]
        legs = np.array([[acrosses[1] - acrosses[0], ups[1] - ups[0]], [acrosses[2] - acrosses[0], ups[2] - ups[0]]])
        slope = np.linalg.solve(legs, values[1:] - values[0])
        return Pieces(squares, np.full(len(squares), number), level[crossed], np.stack(ends, axis=1),
                      np.arctan2(slope[1], slope[0]))

    def neighbours(self, some: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Yield pairs of squares that share an edge or a node, with the lowest and the highest slab there."""
        is_some = np.zeros(self.costs.size, bool)
        is_some[some] = True
        column = some % self.columns
        for down, right, nodes in ((0, 1, ((0, 1), (1, 1))), (1, 0, ((1, 0), (1, 1))), (1, 1, ((1, 1),)), (1, -1, ((1, 0),))):
            inside = (column + right >= 0) & (column + right < self.columns)
            one = some[inside][is_some[some[inside] + down * self.columns + right]]
            values = np.stack([self.corners(one)[:, i, j] for i, j in nodes])
            yield one, one + down * self.columns + right, self.slabs(values.min(axis=0)), self.slabs(values.max(axis=0))


def squared_slopes(corners: np.ndarray, triangles: tuple[tuple[tuple[int, int], ...], ...]) -> np.ndarray:
    """Return the squared slope of the steeper triangle of each square, for squares of side 1."""
    steepest = np.zeros(len(corners))
    for (i, j), (k, m), (n, o) in triangles:
        # Two of the three edges are sides of the square, at a right angle.
        first, second, third = corners[:, i, j], corners[:, k, m], corners[:, n, o]
        one = second - first
        two = third - (second if abs(k - n) + abs(m - o) == 1 else first)
        steepest = np.maximum(steepest, one**2 + two**2)
    return steepest
