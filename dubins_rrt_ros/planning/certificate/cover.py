"""Boxes that cover the levels: pieces of a level times intervals of headings, halved where a bound is not good enough."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...checker.check import boxes_on

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
    """Boxes on the gates between cells; those of a portal, a pair of cells, are crossed in one direction.

    Attributes:
        index, shares: the gates of the boxes, and the ranges of places and headings, as `boxes_on` takes them.
        potentials: (n,) lower bounds of the costs of chains to the boxes [m].
        is_free: (n,) False where a box holds no free place.
        before, after: for each portal those that may be crossed before it, and after it.
        ends: where paths begin and end.
        margin: length that boxes are larger than they need be [m].
    """

    def __init__(self, gates: np.ndarray, keys: list[Key], used: list[Key], ends: Ends,
                 is_blocked: Callable[[np.ndarray], np.ndarray], margin: float):
        """Cover each gate with one box.

        Args:
            gates: (n, 11) boxes of all poses in which they are crossed.
            keys: the cells before and after each gate.
            used: the pairs of cells between which paths cross levels, in ascending order.
            is_blocked: says of (n, 11) boxes which hold no free place.
            margin: see above.
        """
        self.gates, self.ends, self.margin, self._is_blocked = gates, ends, margin, is_blocked
        self._used = used
        self.before = [[j for j, (before, after) in enumerate(self._used) if after == key[0] and before != key[1]]
                       for key in self._used]
        self.after = [[j for j, before in enumerate(self.before) if i in before] for i in range(len(self._used))]
        number = {key: i for i, key in enumerate(self._used)}
        self.index = np.array([gate for gate, key in enumerate(keys) if key in number], int)
        self._portal = np.array([number[keys[gate]] for gate in self.index], int)
        self.shares = np.tile((-1.0, 1.0, -1.0, 1.0), (len(self.index), 1))
        self.potentials = np.zeros(len(self.index))
        self.is_free = ~self._is_blocked(self.boxes())

    def __len__(self) -> int:
        return len(self.index)

    def boxes(self) -> np.ndarray:
        """Return the (n, 11) boxes, as the checker has them."""
        return boxes_on(self.gates[self.index], np.column_stack([self.shares, self.potentials]), self.margin)

    def document(self, potentials: np.ndarray) -> list[list[list[float | None]]]:
        """Return the boxes of each gate as a certificate has them, with (n,) potentials [m]."""
        rows: list[list[list[float | None]]] = [[] for _ in self.gates]
        for gate, shares, value, is_free in zip(self.index.tolist(), self.shares.tolist(), potentials.tolist(), self.is_free,
                                                strict=True):
            rows[gate].append([*shares, value if is_free else None])
        return rows

    def rows(self) -> list[np.ndarray]:
        """Return the indices of the boxes of each portal that may be free."""
        order = np.argsort(self._portal, kind="stable")
        order = order[self.is_free[order]]
        return np.split(order, np.searchsorted(self._portal[order], np.arange(1, len(self._used))))[:len(self._used)]

    def order(self) -> list[int]:
        """Return the portals that have boxes, in the order of their costs."""
        first = {portal: row for row, portal in reversed(list(enumerate(self._portal.tolist()))) if self.is_free[row]}
        return sorted(first, key=lambda portal: (self.gates[self.index[first[portal]], 9], portal))

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
        for name in ("index", "_portal", "potentials", "is_free"):
            old = getattr(self, name)
            setattr(self, name, np.concatenate([old[~chosen], old[chosen], old[chosen]]))
        self.shares = np.concatenate([self.shares[~chosen], low, high])
        new = slice(len(self) - 2 * len(low), None)
        self.is_free[new] = ~self._is_blocked(self.boxes()[new])
