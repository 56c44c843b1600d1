"""Boxes that cover the levels: pieces of a level times intervals of headings, halved where a bound is not good enough."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...checker.levels import Pieces

#: The cells before and after a crossing of a level.
Key = tuple[int, int]


class Ends(NamedTuple):
    """The boxes where paths begin and end.

    Attributes:
        start, goals: (1, 11) and (n, 11) boxes, as the checker has them.
        start_cell, goal_cells: the cells that hold them.
        excess: length by which the costs to the goal are too high at most, where it is reached [m].
    """

    start: np.ndarray
    goals: np.ndarray
    start_cell: int
    goal_cells: set[int]
    excess: float


class Cover:
    """Boxes on the pieces of the levels between cells; those of a portal, a pair of cells, are crossed in one direction.

    Attributes:
        index, way, shares: of the boxes, as `Pieces.boxes` takes them.
        potentials: (n,) lower bounds of the costs of chains to the boxes [m].
        is_free: (n,) False where a box holds no free place.
        before, after: for each portal those that may be crossed before it, and after it.
        ends: where paths begin and end.
        margin: length that boxes are larger than they need be [m].
    """

    def __init__(self, pieces: Pieces, keys: tuple[list[Key], list[Key]], used: set[Key], ends: Ends, limits: np.ndarray,
                 is_blocked: Callable[[np.ndarray], np.ndarray], margin: float):
        """Cover each piece with one box for each way in which it is crossed.

        Args:
            keys: the cells before and after each piece, where costs rise, and where they fall.
            used: the pairs of cells between which paths cross levels.
            limits: (n, 2) costs at each piece, and lower bounds of the costs from there to the goal [m].
            is_blocked: says of (n, 11) boxes which hold no free place.
            margin: see above.
        """
        self.pieces, self.ends, self.margin, self._limits, self._is_blocked = pieces, ends, margin, limits, is_blocked
        self._used = sorted(used)
        self.before = [[j for j, (before, after) in enumerate(self._used) if after == key[0] and before != key[1]]
                       for key in self._used]
        self.after = [[j for j, before in enumerate(self.before) if i in before] for i in range(len(self._used))]
        number = {key: i for i, key in enumerate(self._used)}
        found = [(piece, way, number[key]) for way, of_pieces in zip((1, -1), keys, strict=True)
                 for piece, key in enumerate(of_pieces) if key in used]
        self.index, self.way, self._portal = np.array(found, int).reshape(-1, 3).T
        self.shares = np.tile((0.0, 1.0, -1.0, 1.0), (len(found), 1))
        self.potentials = np.zeros(len(found))
        self.is_free = ~self._is_blocked(self.boxes())

    def __len__(self) -> int:
        return len(self.index)

    def boxes(self) -> np.ndarray:
        """Return the (n, 11) boxes, as the checker has them."""
        boxes = self.pieces.boxes(self.index, self.way, self.shares, self.margin)
        return np.column_stack([boxes, self.potentials, self._limits[self.index]])

    def document(self, potentials: np.ndarray) -> list[list[float | None]]:
        """Return the boxes as a certificate has them, with (n,) potentials [m]."""
        names = np.column_stack([part[self.index] for part in self.pieces[:3]]).tolist()
        values = [value if is_free else None for value, is_free in zip(potentials.tolist(), self.is_free, strict=True)]
        return [[*name, way, *shares, value] for name, way, shares, value
                in zip(names, self.way.tolist(), self.shares.tolist(), values, strict=True)]

    def rows(self) -> list[np.ndarray]:
        """Return the indices of the boxes of each portal that may be free."""
        order = np.argsort(self._portal, kind="stable")
        order = order[self.is_free[order]]
        return np.split(order, np.searchsorted(self._portal[order], np.arange(1, len(self._used))))[:len(self._used)]

    def order(self) -> list[int]:
        """Return the portals that have boxes, in the order of their costs."""
        first = {portal: row for row, portal in reversed(list(enumerate(self._portal.tolist()))) if self.is_free[row]}
        return sorted(first, key=lambda portal: (self._limits[self.index[first[portal]], 0], portal))

    def is_first(self, portal: int) -> bool:
        """Return whether a path can cross a portal before all others."""
        return self._used[portal][0] == self.ends.start_cell

    def is_last(self, portal: int) -> bool:
        """Return whether a path can end after a portal."""
        return self._used[portal][1] in self.ends.goal_cells

    def halve(self, chosen: np.ndarray, radius: float) -> None:
        """Halve boxes, in length or in heading: what turns the curves more, for a turning radius [m]."""
        boxes = self.boxes()[chosen]
        by_length = 2 * boxes[:, 4] > radius * boxes[:, 7]
        low, high = self.shares[chosen].copy(), self.shares[chosen].copy()
        first, last = np.where(by_length, 0, 2), np.where(by_length, 1, 3)
        each = np.arange(len(low))
        low[each, last] = high[each, first] = (low[each, first] + low[each, last]) / 2
        for name in ("index", "way", "_portal", "potentials", "is_free"):
            old = getattr(self, name)
            setattr(self, name, np.concatenate([old[~chosen], old[chosen], old[chosen]]))
        self.shares = np.concatenate([self.shares[~chosen], low, high])
        new = slice(len(self) - 2 * len(low), None)
        self.is_free[new] = ~self._is_blocked(self.boxes()[new])
