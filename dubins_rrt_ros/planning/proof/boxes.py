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


class Links:
    """For each box of a portal the box before it, or after it, on the cheapest chain.

    Attributes:
        portals: (n,) the portals that these are of, by their `id`; 0 where they are not known.
        boxes: (n,) their indices there.
    """

    def __init__(self, count: int):
        self.portals, self.boxes = np.zeros(count, np.int64), np.full(count, -1)

    def with_more(self, count: int) -> "Links":
        """Return the links of more boxes, which are not known."""
        links = Links(0)
        links.portals = np.concatenate([self.portals, np.zeros(count, np.int64)])
        links.boxes = np.concatenate([self.boxes, np.full(count, -1)])
        return links

    def those(self, chosen: np.ndarray) -> "Links":
        """Return the links of boxes that are chosen."""
        links = Links(0)
        links.portals, links.boxes = self.portals[chosen], self.boxes[chosen]
        return links

    def forget(self) -> None:
        """Take none of the links for known."""
        self.portals[:] = 0

    def renumber(self, portal: "Portal", new: np.ndarray) -> None:
        """Take the new indices of the boxes of a portal, -1 for those that are gone."""
        concerned = self.portals == id(portal)
        self.boxes[concerned] = new[self.boxes[concerned]]
        self.portals[self.boxes < 0] = 0


class Portal:
    """The boxes on a connected part of a level set, or the one pose where paths begin or end.

    A chain has one box of each portal that it leads through. All arrays have a row for each box.

    Attributes:
        level: the cost of the level set [m].
        squares: (m,) indices of the squares that it is in.
        left: lower bound of the way from it to the goal [m].
        boxes: (n, 8) as `_kernels/interval_curves.py` has them.
        up_to, on: lower bounds of the costs of chains from the start to a box, and from there to the goal [m].
        before, after: `Link`s to the boxes before and after it on the cheapest of these chains.
        total: lower bound of the costs of chains through a box [m].
        is_open: True for boxes that may be on a chain below the length that is being proved.
    """

    def __init__(self, sets: LevelSets, level: float, pieces: Pieces, limit: float):
        """Take the part of a level set that is made of some pieces, as far as paths shorter than `limit` may cross it."""
        self.level, self._sets, self._limit = level, sets, limit
        self.squares, self.left = pieces.squares, sets.least_left_in(pieces.squares)
        self._pieces: Pieces | None = pieces
        self._clear()

    def cover(self) -> "Portal":
        """Cover it with boxes, unless that was done; return it."""
        if self._pieces:
            pieces, self._pieces = self._pieces, None
            self._add(_boxes_of(pieces), pieces.gradients)
        return self

    @property
    def is_covered(self) -> bool:
        """True if chains that come by have to lead over its boxes."""
        return self._pieces is None

    def _clear(self) -> None:
        self.boxes = np.empty((0, 8))
        self._gradients, self._left, self.up_to, self.on, self.total = np.empty((5, 0))
        self.before, self.after = Links(0), Links(0)
        self.is_open = np.empty(0, bool)

    @classmethod
    def of_pose(cls, pose: Pose, reach: float, turn: float, level: float, square: int = -1) -> "Portal":
        """Return a portal of one box: the poses within `reach` [m] and `turn` [rad] of a pose."""
        portal = cls.__new__(cls)
        portal.level, portal.squares, portal.left, portal._pieces = level, np.array([square]), 0.0, None
        portal._clear()
        portal.boxes = np.array([[pose[0], pose[1], 1.0, 0.0, reach, reach, pose[2], turn]])
        portal.up_to, portal.on, portal.total = np.zeros((3, 1))
        portal.before, portal.after, portal.is_open = Links(1), Links(1), np.ones(1, bool)
        return portal

    def __len__(self) -> int:
        return len(self.boxes)

    def _add(self, boxes: np.ndarray, gradients: np.ndarray) -> None:
        """Add boxes, but for those that no path of the vehicle shorter than the limit can cross."""
        left = self._sets.least_left(np.ascontiguousarray(boxes[:, :2]), boxes[:, 4])
        needed = (np.abs(wrap(gradients - boxes[:, 6])) <= boxes[:, 7] + RIGHT_ANGLE) & (self.level + left < self._limit)
        boxes, gradients, left = self._sets.box_room.trim(boxes[needed]), gradients[needed], left[needed]
        needed = boxes[:, 4] >= 0
        needed[needed] = self._sets.box_room.may_be_crossed(boxes[needed], self.level, left[needed])
        count = int(needed.sum())
        self.boxes = np.concatenate([self.boxes, boxes[needed]])
        self._gradients = np.concatenate([self._gradients, gradients[needed]])
        self._left = np.concatenate([self._left, left[needed]])
        self.up_to = np.concatenate([self.up_to, np.full(count, self.level)])
        self.on = np.concatenate([self.on, left[needed]])
        self.total = np.concatenate([self.total, self.level + left[needed]])
        self.before, self.after = self.before.with_more(count), self.after.with_more(count)
        self.is_open = np.concatenate([self.is_open, np.ones(count, bool)])

    def sizes(self, radius: float) -> np.ndarray:
        """Return (n,) sizes of the boxes: by how much they turn the curves [rad]."""
        return np.asarray(np.maximum(2 * self.boxes[:, 4] / radius, self.boxes[:, 7]))

    def split(self, chosen: np.ndarray, radius: float) -> np.ndarray:
        """Halve the boxes that are chosen, in length or in heading; return the new index of each old box, -1 for those."""
        halves, gradients = _halves(self.boxes[chosen], radius), np.tile(self._gradients[chosen], 2)
        kept = ~chosen
        for name in ("boxes", "_gradients", "_left", "up_to", "on", "total", "is_open"):
            setattr(self, name, getattr(self, name)[kept])
        self.before, self.after = self.before.those(kept), self.after.those(kept)
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
