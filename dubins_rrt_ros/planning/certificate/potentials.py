"""Potentials of boxes that are no higher than the checker shows."""

import numpy as np

from ...checker.bounds import too_high
from .cover import Cover

#: Margin that potentials keep, in margins of the checker.
MARGINS = 10


class Potentials:
    """The potentials of a cover, lowered where the checker's own bounds of curves from box to box are too low for them.

    Attributes:
        bound: length that no chain of boxes from start to goal falls below [m].
    """

    def __init__(self, cover: Cover, radius: float, bound: float):
        """Lower the potentials until all hold.

        Args:
            radius: turning radius [m].
            bound: where a potential with the cost of what is left is at least this [m], nothing after it matters.
        """
        self._cover, self._radius, self._bound, self._margin = cover, radius, bound, MARGINS * cover.margin
        cover.potentials = cover.potentials - self._margin
        self._boxes, self._rows = cover.boxes(), cover.rows()
        order = cover.order()
        due = set(order)
        while due:
            i = next(i for i in order if i in due)
            due.discard(i)
            if self._lower(i):
                due.update(set(cover.after[i]).intersection(order))
        cover.potentials = self._boxes[:, 8].copy()
        self.bound = self._bound_at_goal()

    def _lower(self, portal: int) -> bool:
        """Lower the potentials of a portal's boxes to what those before allow; return whether some changed."""
        mine, changed = self._boxes[self._rows[portal]], False
        before = [self._open(j) for j in self._cover.before[portal]]
        for some in [*before, self._cover.ends.start] if self._cover.is_first(portal) else before:
            excess = too_high(some, mine, self._radius, self._margin)
            mine[:, 8] -= np.where(excess > 0, excess + self._margin, 0)
            changed = changed or bool((excess > 0).any())
        self._boxes[self._rows[portal]] = mine
        return changed

    def _open(self, portal: int) -> np.ndarray:
        """Return the boxes of a portal after which a path may still be short enough."""
        boxes = self._boxes[self._rows[portal]]
        return np.asarray(boxes[boxes[:, 8] + boxes[:, 10] < self._bound + self._cover.ends.excess + self._margin])

    def _bound_at_goal(self) -> float:
        """Return the greatest bound that the potentials before the goal allow [m]."""
        cover, goal = self._cover, self._cover.ends.goals.copy()
        goal[:, 8] = self._bound
        last = [self._open(i) for i in range(len(self._rows)) if cover.is_last(i)]
        if cover.ends.start_cell in cover.ends.goal_cells:
            last.append(cover.ends.start)
        excess = max((float(too_high(some, goal, self._radius, self._margin).max()) for some in last if len(some)), default=0.0)
        return self._bound - max(0.0, excess) - self._margin
