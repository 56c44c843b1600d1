"""Potentials of boxes, at most as high as the checker can verify."""

from collections.abc import Callable

import numpy as np

from ...checker.bounds import too_high
from ..deadline import OutOfTime
from .cover import Cover

#: Margin that potentials keep, in margins of the checker.
MARGINS = 10
#: Number of pairs of boxes after which the time is looked at.
PAIRS = 50_000


class Potentials:
    """The potentials of a cover, lowered where the checker's own bounds of curves from box to box are too low for them.

    Attributes:
        values: (n,) potentials of the boxes [m].
        bound: length that no chain of boxes from start to goal falls below [m].
    """

    def __init__(self, cover: Cover, radius: float, bound: float, is_over: Callable[[], bool]):
        """Lower the potentials until all hold.

        Args:
            radius: turning radius [m].
            bound: where a potential with the cost of what is left is at least this [m], nothing after it matters.
            is_over: asked every few tenths of a second.

        Raises:
            OutOfTime: `is_over` was true.
        """
        self._cover, self._radius, self._bound, self._margin = cover, radius, bound, MARGINS * cover.margin
        self._is_over = is_over
        self._boxes, self._rows = cover.boxes(), cover.rows()
        self._boxes[:, 8] -= self._margin
        self._by_start = self._allowed_by_start(self._boxes)
        order = cover.order()
        due = set(order)
        while due:
            i = next(i for i in order if i in due)
            due.discard(i)
            if self._lower(i):
                due.update(set(cover.after[i]).intersection(order))
        self.values = self._boxes[:, 8].copy()
        self.bound = self._bound_at_goal()

    def _allowed_by_start(self, boxes: np.ndarray) -> np.ndarray:
        """Return the potentials of boxes as far as the curves from the start alone allow them [m]."""
        excess = self._too_high(self._cover.ends.start, boxes)
        return np.asarray(boxes[:, 8] - np.where(excess > 0, excess + self._margin, 0))

    def _lower(self, portal: int) -> bool:
        """Lower the potentials of a portal's boxes to what those before, or the start, allow; return whether some changed."""
        rows = self._rows[portal]
        rows = rows[self._boxes[rows, 8] > self._by_start[rows]]
        before = [self._open(j) for j in self._cover.before[portal]]
        lowered = self._by_start[rows]
        if not self._cover.is_first(portal):
            lowered = np.maximum(lowered, self._allowed(before, self._boxes[rows]))
        changed = bool((lowered < self._boxes[rows, 8]).any())
        self._boxes[rows, 8] = lowered
        return changed

    def _allowed(self, before: list[np.ndarray], boxes: np.ndarray) -> np.ndarray:
        """Return the potentials of boxes as far as those before allow them [m]."""
        excess = np.max([self._too_high(some, boxes) for some in before], axis=0, initial=0)
        return np.asarray(boxes[:, 8] - np.where(excess > 0, excess + self._margin, 0))

    def _too_high(self, ahead: np.ndarray, boxes: np.ndarray) -> np.ndarray:
        """Return by how much potentials are too high after those ahead [m], as the checker has it."""
        excess, size = np.zeros(len(boxes)), max(1, PAIRS // max(1, len(ahead)))
        for first in range(0, len(boxes), size):
            if self._is_over():
                raise OutOfTime
            some = slice(first, first + size)
            excess[some] = too_high(ahead, boxes[some], self._radius, self._margin)
        return excess

    def _open(self, portal: int) -> np.ndarray:
        """Return the boxes of a portal after which a path may still be short enough."""
        boxes = self._boxes[self._rows[portal]]
        return np.asarray(boxes[boxes[:, 8] + boxes[:, 10] < self._bound + self._cover.ends.excess + self._margin])

    def _bound_at_goal(self) -> float:
        """Return the greatest bound that the potentials before the goal, or the start, allow [m]."""
        cover, goals = self._cover, self._cover.ends.goals.copy()
        goals[:, 8] = self._bound
        allowed = self._allowed_by_start(goals)
        if cover.ends.start_cell not in cover.ends.goal_cells:
            last = [self._open(i) for i in range(len(self._rows)) if cover.is_last(i)]
            allowed = np.maximum(allowed, self._allowed(last, goals))
        return float(allowed.min()) - self._margin
