"""Squares with costs at their nodes, cut into triangles on which the costs are linear, and gates on levels of these costs."""

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

#: The nodes (column, row) of the two triangles of a square, by either diagonal; the one in the middle is at the right angle.
CUTS = np.array([[[(0, 0), (1, 0), (1, 1)], [(0, 0), (0, 1), (1, 1)]], [[(1, 0), (0, 0), (0, 1)], [(1, 0), (1, 1), (0, 1)]]])
#: Half the range of headings in which a path crosses a level [rad], a right angle but for rounding.
HALF_CIRCLE = np.pi / 2 + 1e-9
#: The costs of a node.
FROM_START, TO_GOAL = 0, 1


class Squares:
    """The squares of a certificate by row and column, and its corridor, in which paths are that are shorter than its limit.

    Attributes:
        corner, side: x, y of the first node, and the side of a square [m].
        costs: (2, rows + 1, columns + 1) from the start and to the goal at the nodes [m]; not a number where there are none.
        corners: (2, rows, columns, 2, 2) the same at the corners of the squares.
        domain, corridor: (rows, columns) masks of the squares that have costs, and of the corridor.
        levels: (k,) costs from the start, none of them a node's; slab i is where the costs are from level i - 1 to level i.
        parts: (k + 1, rows, columns) mask of the corridor's squares that have a part in each slab.
    """

    def __init__(self, document: dict[str, Any]):
        squares, self.levels = document["squares"], np.array(document["levels"], dtype=float)
        self.corner, self.side = np.array(squares["corner"], dtype=float), float(squares["side"])
        self.costs = np.array([document["from_start"], document["to_goal"]], dtype=float)
        self.corners = sliding_window_view(self.costs, (2, 2), axis=(1, 2))
        least, self._left = self.corners.min(axis=(3, 4))
        self.domain = (np.array([list(row) for row in squares["free"]]) == "1") & ~np.isnan(least + self._left)
        self.corridor = self.domain & (least + self._left < document["limit"])
        slab = np.arange(len(self.levels) + 1)[:, None, None]
        highest = self.slabs(self.corners[FROM_START].max(axis=(2, 3)))
        self.parts = self.corridor & (self.slabs(least) <= slab) & (slab <= highest)

    def slabs(self, costs: np.ndarray | float) -> np.ndarray:
        """Return the slabs of costs."""
        return np.asarray(np.searchsorted(self.levels, costs))

    def triangles(self, which: int, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return the (n, 2, 3, 3) corners (column, row, cost) of the triangles of squares, cut so that they are less steep."""
        columns, rows = (CUTS[..., axis] + index[:, None, None, None] for axis, index in enumerate((column, row)))
        both = np.stack([columns, rows, self.costs[which, rows, columns]], axis=-1)
        return both[np.arange(len(both)), np.linalg.norm(gradients(both), axis=-1).max(axis=2).argmin(axis=1)]

    def at(self, which: int, x: float, y: float) -> tuple[tuple[int, int], float]:
        """Return row and column of the square that holds a place, and the cost there [m]."""
        place = (np.array([x, y]) - self.corner) / self.side
        column, row = np.floor(place).astype(int)
        if min(column, row) < 0:
            raise IndexError("a place is outside of all squares")
        triangles = self.triangles(which, np.array([row]), np.array([column]))[0]
        off = place - triangles[:, 1, :2]
        nearer = np.hypot(*off.T).argmin()  # of the corners at right angles, between which the square is cut
        return (int(row), int(column)), float(triangles[nearer, 1, 2] + off[nearer] @ gradients(triangles[nearer]))

    def near(self, x: float, y: float, reach: float) -> np.ndarray:
        """Return the (rows, columns) mask of the squares within a distance [m] of a place."""
        middles = self.corner + self.side * (np.moveaxis(np.indices(self.domain.shape)[::-1], 0, -1) + 0.5)
        return np.asarray(np.linalg.norm(np.maximum(np.abs(middles - (x, y)) - self.side / 2, 0), axis=-1) <= reach)

    def gates(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the gates: all straight pieces of levels in the corridor, once for each way to cross them.

        Returns:
            (n, 11) boxes, as `bounds.py` has them, of all poses in which a gate is crossed; and (n, 3) slab, row and column of
            the parts before and after it.
        """
        triangles = self.triangles(FROM_START, *np.nonzero(self.corridor))
        is_below = triangles[..., 2] < self.levels[:, None, None, None]
        level, square, half = np.nonzero(is_below.any(axis=3) & ~is_below.all(axis=3))
        corners, is_below, cost = triangles[square, half], is_below[level, square, half], self.levels[level]
        lone = (is_below == (is_below.sum(axis=1, keepdims=True) == 1)).argmax(axis=1)  # the corner on a side of its own
        first, *others = (corners[np.arange(len(corners)), (lone + i) % 3] for i in (0, 1, 2))
        ends = [first + ((cost - first[:, 2]) / (other - first)[:, 2])[:, None] * (other - first) for other in others]
        one, other = (self.corner + self.side * end[:, :2] for end in ends)
        rising, place = np.arctan2(*gradients(corners).T[::-1]), np.argwhere(self.corridor)[square]
        up = np.column_stack(np.broadcast_arrays(
            *((one + other) / 2).T, -np.sin(rising), np.cos(rising), np.hypot(*(other - one).T) / 2, 0, rising, HALF_CIRCLE, 0,
            cost, self._left[*place.T]))
        below = np.column_stack([level, place])
        down, above = up.copy(), below.copy()
        down[:, 6] += np.pi
        above[:, 0] += 1
        return np.concatenate([up, down]), np.concatenate([below, above]), np.concatenate([above, below])


def gradients(triangles: np.ndarray) -> np.ndarray:
    """Return the (..., 2) gradients of the costs on triangles, for squares of side 1."""
    legs = np.diff(triangles, axis=-2)
    return np.asarray((legs[..., 2:] * legs[..., :2]).sum(axis=-2))
