"""Bisection of boxes: coarse ones are refined where chains of boxes are cheap, by the planner's bounds of curves between them."""

from collections.abc import Callable

import numpy as np

from .._kernels import UNLIMITED
from .._kernels.interval_curves import relax
from .cover import Cover

#: Share of the way from the bound to the length that is to be proved, up to which boxes of chains are halved in a round.
SPLIT_SHARE = 0.6
#: Number of boxes that the halving ends with.
MAX_BOXES = 6_000


class Bisection:
    """The costs of chains of boxes without potentials, from the start and to the goal.

    Attributes:
        bound: length that no chain falls below, nor one that goes on outside of the boxes [m].
    """

    def __init__(self, cover: Cover, radius: float):
        """Take the boxes of a cover."""
        self._cover, self._radius, self._target, self.bound = cover, radius, 0.0, 0.0

    def run(self, target: float, is_over: Callable[[], bool]) -> None:
        """Halve boxes until no chain is shorter than `target` [m], there are enough of them, or time is over."""
        self._target = target
        while not is_over() and len(self._cover) < MAX_BOXES:
            total = self._totals()
            self.bound = float(max(total.min(initial=target), self._from_start(self._cover.ends.goals, 0.0).min()))
            chosen = self._cover.is_free & (total < self.bound + SPLIT_SHARE * (target - self.bound))
            if not chosen.any():
                return
            self._cover.halve(chosen, self._radius)

    def _totals(self) -> np.ndarray:
        """Return the least costs of chains through each box [m], the target where they are at least that."""
        boxes, cover = self._cover.boxes(), self._cover
        left = boxes[:, 10] - cover.ends.excess
        least = np.maximum(boxes[:, 9], self._from_start(boxes, left))
        up_to = self._sweep(boxes, least, cover.ends.start, left, backwards=False)
        on = self._sweep(boxes, left, cover.ends.goals, up_to, backwards=True)
        cover.potentials = np.minimum(up_to, self._target - left)  # then what is left is too long by itself
        return np.asarray(np.minimum(up_to + on, self._target))

    def _from_start(self, boxes: np.ndarray, left: np.ndarray | float) -> np.ndarray:
        """Return lower bounds of the curves from the start alone [m], or what the target leaves where that is less."""
        left = np.full(len(boxes), left)
        return np.asarray(np.minimum(self._relaxed(self._cover.ends.start, np.zeros(1), boxes, left, False), self._target - left))

    def _sweep(self, boxes: np.ndarray, least: np.ndarray, ends: np.ndarray, others: np.ndarray, backwards: bool) -> np.ndarray:
        """Return the costs of chains from the ends to each box, at least `least`; `others` are those of what is left."""
        cover, rows, costs = self._cover, self._cover.rows(), np.full(len(boxes), UNLIMITED)
        order = cover.order()[::-1] if backwards else cover.order()
        sources, onward = (cover.after, cover.before) if backwards else (cover.before, cover.after)
        due = set(order)
        while due:
            i = next(i for i in order if i in due)
            due.discard(i)
            mine, found = rows[i], costs[rows[i]]
            if cover.is_last(i) if backwards else cover.is_first(i):
                found = np.minimum(found, self._relaxed(ends, np.zeros(len(ends)), boxes[mine], others[mine], backwards))
            for j in sources[i]:
                known = rows[j][costs[rows[j]] < UNLIMITED]
                if len(known):
                    own = np.maximum(costs[known], least[known])
                    found = np.minimum(found, self._relaxed(boxes[known], own, boxes[mine], others[mine], backwards))
            if (found < costs[mine]).any():
                costs[mine] = found
                due.update(set(onward[i]).intersection(order))
        return np.asarray(np.maximum(costs, least))

    def _relaxed(self, sources: np.ndarray, known: np.ndarray, boxes: np.ndarray, left: np.ndarray,
                 backwards: bool) -> np.ndarray:
        """Return the least costs of chains to boxes, over sources whose own costs are known."""
        order = np.argsort(known, kind="stable")
        out, best = np.full(len(boxes), UNLIMITED), np.empty(len(boxes), np.int32)
        relax(known[order], np.ascontiguousarray(sources[order, :8]), np.ascontiguousarray(boxes[:, :8]),
              np.ascontiguousarray(left), 0.0, self._radius, self._target, backwards, out, best)
        return out
