"""Boxes: pieces of a level set times intervals of headings, halved where a bound is not good enough."""

import math

import numpy as np

from .._kernels import UNLIMITED
from ..curves.angles import wrap
from ..problem import Pose
from .level_sets import LevelSets, Pieces

#: Allowances for rounding of a half, so that two halves cover the whole: of lengths [m] and of headings [rad].
ROUNDING = 1e-12
#: Half the range of headings in which a path first reaches a level [rad], a right angle but for rounding.
RIGHT_ANGLE = math.pi / 2 + 1e-6


class Layer:
    """The boxes on one level, or the one pose where paths begin or end.

    A chain has one box of each layer. All arrays have a row for each box.

    Attributes:
        level: the cost of the level set [m].
        boxes: (n, 8) as `_kernels/interval_curves.py` has them.
        up_to, on: lower bounds of the costs of chains from the start to a box, and from there to the goal [m].
        before, after: the boxes before and after it on the cheapest of these chains; -1 where they are not known.
        total: lower bound of the costs of chains through a box [m].
        is_open: True for boxes that may be on a chain below the length that is being proved.
    """

    def __init__(self, sets: LevelSets, level: float, limit: float):
        """Cover a level set, as far as paths shorter than `limit` may cross it."""
        self.level, self._sets, self._limit = level, sets, limit
        self._clear()
        pieces = sets.pieces(level, limit)
        self._add(_boxes_of(pieces), pieces.gradients)

    def _clear(self) -> None:
        self.boxes = np.empty((0, 8))
        self._gradients, self._left, self.up_to, self.on, self.total = np.empty((5, 0))
        self.before = self.after = np.empty(0, int)
        self.is_open = np.empty(0, bool)

    @classmethod
    def of_pose(cls, pose: Pose, reach: float, turn: float) -> "Layer":
        """Return a layer of one box: the poses within `reach` [m] and `turn` [rad] of a pose."""
        layer = cls.__new__(cls)
        layer.level = math.nan
        layer._clear()
        layer.boxes = np.array([[pose[0], pose[1], 1.0, 0.0, reach, reach, pose[2], turn]])
        layer.up_to, layer.on, layer.total = np.zeros((3, 1))
        layer.before, layer.after, layer.is_open = np.full(1, -1), np.full(1, -1), np.ones(1, bool)
        return layer

    def __len__(self) -> int:
        return len(self.boxes)

    def _add(self, boxes: np.ndarray, gradients: np.ndarray) -> None:
        """Add boxes, but for those that no path of the vehicle shorter than the limit can cross."""
        middles, reach = np.ascontiguousarray(boxes[:, :2]), boxes[:, 4]
        left = self._sets.least_left(middles, reach)
        needed = ((np.abs(wrap(gradients - boxes[:, 6])) <= boxes[:, 7] + RIGHT_ANGLE) & (self.level + left < self._limit)
                  & self._sets.may_be_free(middles, reach))
        count = int(needed.sum())
        self.boxes = np.concatenate([self.boxes, boxes[needed]])
        self._gradients = np.concatenate([self._gradients, gradients[needed]])
        self._left = np.concatenate([self._left, left[needed]])
        self.up_to = np.concatenate([self.up_to, np.full(count, self.level)])
        self.on = np.concatenate([self.on, left[needed]])
        self.total = np.concatenate([self.total, self.level + left[needed]])
        self.before, self.after = (np.concatenate([old, np.full(count, -1)]) for old in (self.before, self.after))
        self.is_open = np.concatenate([self.is_open, np.ones(count, bool)])

    def split(self, chosen: np.ndarray, radius: float) -> np.ndarray:
        """Halve the boxes that are chosen, in length or in heading; return the new index of each old box, -1 for those."""
        halves, gradients = _halves(self.boxes[chosen], radius), np.tile(self._gradients[chosen], 2)
        kept = ~chosen
        for name in ("boxes", "_gradients", "_left", "up_to", "on", "total", "before", "after", "is_open"):
            setattr(self, name, getattr(self, name)[kept])
        self._add(halves, gradients)
        return np.where(chosen, -1, np.cumsum(kept) - 1)

    def close(self, limit: float) -> None:
        """Note the bounds of chains through the open boxes, and leave those open that have some below `limit`."""
        total = np.minimum(self.up_to, UNLIMITED) + np.minimum(self.on, UNLIMITED)
        self.total[self.is_open] = np.minimum(np.maximum(total, self.total), limit)[self.is_open]
        self.is_open &= self.total < limit

    def reopen(self, limit: float) -> None:
        """Open the boxes that may be on a chain below a higher limit, where costs beyond the old one are not known."""
        self.is_open = self.total < limit
        self.up_to, self.on = np.full(len(self), self.level), self._left.copy()


def _boxes_of(pieces: Pieces) -> np.ndarray:
    """Return a box for each piece, with all headings in which a path can first reach the level there."""
    along = pieces.ends[:, 2:] - pieces.ends[:, :2]
    length = np.hypot(*along.T)
    direction = np.where(length[:, None] > 0, along / np.where(length > 0, length, 1)[:, None], (1.0, 0.0))
    return np.column_stack([(pieces.ends[:, :2] + pieces.ends[:, 2:]) / 2, direction, length / 2 + ROUNDING,
                            np.zeros(len(length)), pieces.gradients, np.full(len(length), RIGHT_ANGLE)])


def _halves(boxes: np.ndarray, radius: float) -> np.ndarray:
    """Return both halves of boxes, all first halves before the second ones: what turns the curves more is halved."""
    by_length = 2 * boxes[:, 4] > radius * boxes[:, 7]
    both = []
    for sign in (-1, 1):
        half = boxes.copy()
        half[:, :2] += sign * np.where(by_length, boxes[:, 4] / 2, 0)[:, None] * boxes[:, 2:4]
        half[:, 4] = np.where(by_length, boxes[:, 4] / 2 + ROUNDING, boxes[:, 4])
        half[:, 6] += sign * np.where(by_length, 0, boxes[:, 7] / 2)
        half[:, 7] = np.where(by_length, boxes[:, 7], boxes[:, 7] / 2 + ROUNDING)
        both.append(half)
    return np.concatenate(both)
