"""Squares with costs at their nodes, cut into triangles on which the costs are linear, and the gates on levels of these costs."""

from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

#: The nodes (column, row) of the two triangles of a square, by either diagonal; the one in the middle is at the right angle.
CUTS = np.array([[[(0, 0), (1, 0), (1, 1)], [(0, 0), (0, 1), (1, 1)]], [[(1, 0), (0, 0), (0, 1)], [(1, 0), (1, 1), (0, 1)]]])
#: Half the range of headings in which a path crosses a level [rad], a right angle but for rounding.
HALF_CIRCLE = np.pi / 2 + 1e-9


class Squares(NamedTuple):
    """Squares with costs at their nodes, by row and column.

    Attributes:
        corner: x, y of the first node [m].
        side: that of a square [m].
        costs: (rows + 1, columns + 1) at the nodes [m]; not a number where there are none.
    """

    corner: np.ndarray
    side: float
    costs: np.ndarray

    def corners(self) -> np.ndarray:
        """Return the (rows, columns, 2, 2) costs at the corners of the squares."""
        return sliding_window_view(self.costs, (2, 2))

    def triangles(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return the (n, 2, 3, 3) corners (column, row, cost) of the triangles of squares, cut so that they are less steep."""
        columns, rows = (CUTS[..., axis] + index[:, None, None, None] for axis, index in enumerate((column, row)))
        both = np.stack([columns, rows, self.costs[rows, columns]], axis=-1)
        return both[np.arange(len(both)), np.hypot(*np.moveaxis(gradients(both), -1, 0)).max(axis=2).argmin(axis=1)]

    def at(self, x: float, y: float) -> tuple[tuple[int, int], float]:
        """Return row and column of the square that holds a place, and the cost there [m]."""
        place = (np.array([x, y]) - self.corner) / self.side
        column, row = np.floor(place).astype(int)
        if min(column, row) < 0:
            raise IndexError("a place is outside of all squares")
        triangles = self.triangles(np.array([row]), np.array([column]))[0]
        off = place - triangles[:, 1, :2]
        nearer = np.hypot(*off.T).argmin()  # of the corners at right angles, between which the square is cut
        return (int(row), int(column)), float(triangles[nearer, 1, 2] + off[nearer] @ gradients(triangles[nearer]))

    def near(self, x: float, y: float, reach: float) -> np.ndarray:
        """Return the (rows, columns) mask of the squares within a distance [m] of a place."""
        middles = [low + self.side * (np.arange(count - 1) + 0.5)
                   for low, count in zip(self.corner, self.costs.shape[::-1], strict=True)]
        across, up = (np.maximum(np.abs(middle - at) - self.side / 2, 0) for middle, at in zip(middles, (x, y), strict=True))
        return np.asarray(np.hypot(across, up[:, None]) <= reach)


def gradients(triangles: np.ndarray) -> np.ndarray:
    """Return the (..., 2) gradients of the costs on triangles, for squares of side 1."""
    legs = np.diff(triangles, axis=-2)
    return np.asarray((legs[..., 2:] * legs[..., :2]).sum(axis=-2))


class Gates(NamedTuple):
    """Straight pieces of levels, one for each triangle that a level crosses and each way to cross it.

    Attributes:
        row, column: (n,) of the squares.
        before, after: (n,) slabs from which and to which they are crossed.
        cost, left: (n,) cost from the start, and lower bound of that to the goal [m].
        ends: (n, 2, 2) x, y of both ends [m].
        heading: (n,) direction in which the cost rises, or falls where they are crossed downwards [rad].
    """

    row: np.ndarray
    column: np.ndarray
    before: np.ndarray
    after: np.ndarray
    cost: np.ndarray
    left: np.ndarray
    ends: np.ndarray
    heading: np.ndarray

    def boxes(self, index: np.ndarray, rows: np.ndarray, widen: float) -> np.ndarray:
        """Return (n, 11) boxes on gates, as `bounds.py` has them, a little larger than they are.

        Args:
            index: (n,) of the gates.
            rows: (n, 5) ranges of the place, from 0 to 1 along a gate, and of the heading, from -1 to 1 for the headings within a
                right angle of the gate's; potentials [m].
            widen: lengths that are added for rounding [m].
        """
        first, along = self.ends[index, 0], self.ends[index, 1] - self.ends[index, 0]
        length = np.hypot(*along.T)
        unit = np.where(length[:, None] > widen, along / np.maximum(length, widen)[:, None], (1.0, 0.0))
        (place, off), (half, turn) = ((rows[:, 1:4:2] + sign * rows[:, 0:4:2]).T / 2 for sign in (1, -1))
        return np.column_stack([
            first + place[:, None] * along, unit, half * length + widen, np.full(len(rows), widen),
            self.heading[index] + off * HALF_CIRCLE, turn * HALF_CIRCLE, rows[:, 4], self.cost[index], self.left[index]])


class Corridor:
    """The squares that a path may come through and be shorter than the limit of a certificate.

    Attributes:
        from_start, to_goal: the costs.
        domain: (rows, columns) mask of the squares that have costs.
        mask: the same of the corridor.
        levels: (k,) costs from the start, none of them a node's; slab i is where the costs are from level i - 1 to level i.
        parts: (k + 1, rows, columns) mask of the corridor's squares that have a part in each slab.
    """

    def __init__(self, document: dict[str, Any]):
        grid = document["squares"]
        self.from_start, self.to_goal = (
            Squares(np.array(grid["corner"], dtype=float), float(grid["side"]), np.array(document[name], dtype=float))
            for name in ("from_start", "to_goal"))
        self.levels = np.array(document["levels"], dtype=float)
        least, self._left = (squares.corners().min(axis=(2, 3)) for squares in (self.from_start, self.to_goal))
        self.domain = (np.array([list(row) for row in grid["free"]]) == "1") & ~np.isnan(least + self._left)
        self.mask = self.domain & (least + self._left < document["limit"])
        slab = np.arange(len(self.levels) + 1)[:, None, None]
        self.parts = self.mask & (self.slabs(least) <= slab) & (slab <= self.slabs(self.from_start.corners().max(axis=(2, 3))))

    def slabs(self, costs: np.ndarray | float) -> np.ndarray:
        """Return the slabs of costs."""
        return np.asarray(np.searchsorted(self.levels, costs))

    def gates(self) -> Gates:
        """Return all gates in the corridor."""
        row, column = np.nonzero(self.mask)
        triangles, found = self.from_start.triangles(row, column), []
        for level, cost in enumerate(self.levels):
            is_below = triangles[..., 2] < cost
            square, half = np.nonzero(is_below.any(axis=2) & ~is_below.all(axis=2))
            corners, is_below, each = triangles[square, half], is_below[square, half], np.arange(len(square))
            lone = (is_below == (is_below.sum(axis=1, keepdims=True) == 1)).argmax(axis=1)  # the corner on a side of its own
            first, others = corners[each, lone, None], np.stack([corners[each, (lone + i) % 3] for i in (1, 2)], axis=1)
            share = (cost - first[..., 2:]) / (others - first)[..., 2:]
            ends = self.from_start.corner + self.from_start.side * (first + share * (others - first))[..., :2]
            rising = np.arctan2(*gradients(corners).T[::-1])
            place = row[square], column[square]
            for before, after, heading in ((level, level + 1, rising), (level + 1, level, rising + np.pi)):
                same = (np.full(len(each), value) for value in (before, after, cost))
                found.append((*place, *same, self._left[place], ends, heading))
        return Gates(*(np.concatenate(field) for field in zip(*found, strict=True)))
