"""The room that boxes leave the vehicle: without it no path crosses them, and less of them has to be looked at.

A path through a pose is, after an arc length s, in a small region ahead of it, whichever way it turns, since it turns no tighter
than the turning radius R. With R the unit of length and s < pi / 2 the heading is within s of the pose's, so that the path is at
least sin s ahead of the pose and at most 1 - cos s aside. In a direction of b <= s off the heading the farthest that it comes is
where a turn of b and a straight line end. A few discs cover the region that is left. Where none of them holds a place with enough
clearance the path is not free. Driven backwards, the same holds for what comes before the pose.
"""

import math
from typing import NamedTuple

import numpy as np

from ..collision.clearance import ClearanceField

#: Allowance for rounding of clearances [m].
ROUNDING = 1e-9
#: Allowance for rounding by which boxes that are trimmed stay longer [m].
TRIM_ROUNDING = 1e-12
#: Maximum number of steps in which an end of a box is moved to where there is enough clearance.
TRIM_STEPS = 6
#: Maximum half range of headings of boxes for which it is looked ahead [rad]: with more of them there nearly always is room.
MAX_HALF_HEADING = 0.5
#: Arc lengths ahead at which there must be room, in turning radii, and the number of discs that cover where a path is then.
LOOKS = (0.25, 1), (0.5, 3), (0.8, 5), (1.1, 7), (1.4, 9)


class Look(NamedTuple):
    """Discs that cover where a path is after an arc length, from a pose at the origin with heading 0, in turning radii.

    Attributes:
        arc_length: that length.
        x, y: (k,) middles of the discs.
        radii: (k,) their radii.
    """

    arc_length: float
    x: np.ndarray
    y: np.ndarray
    radii: np.ndarray


def look_ahead(arc_length: float, count: int) -> Look:
    """Return discs that cover where paths are after an arc length below pi / 2, in turning radii."""
    half = (1 - math.cos(arc_length)) / count
    y = half * np.arange(1 - count, count, 2)
    inner = np.maximum(np.abs(y) - half, 0.0)
    turns = np.linspace(0, arc_length, 200)
    # Half-planes that the region is in; each bounds x where |y| is `inner`.
    ahead = np.sin(turns) + (arc_length - turns) * np.cos(turns)
    aside = 1 - np.cos(turns) + (arc_length - turns) * np.sin(turns)
    farthest = (ahead + np.tan(turns) * (aside - inner[:, None])).min(axis=1)
    nearest = math.sin(arc_length)
    return Look(arc_length, (nearest + farthest) / 2, y, np.hypot((farthest - nearest) / 2, half) * (1 + 1e-9))


class BoxRoom:
    """Room that a vehicle has in boxes, and before and after them."""

    def __init__(self, field: ClearanceField, required_clearance: float, radius: float):
        """Take the map's clearance [m], what the vehicle needs of it [m], and its turning radius [m]."""
        self._field, self._required, self._radius = field, required_clearance - ROUNDING, radius

    def trim(self, boxes: np.ndarray) -> np.ndarray:
        """Move both ends of (n, 8) boxes to where there may be enough clearance; nothing is left of some: half a length below 0.

        Clearances change by no more than a metre per metre.
        """
        boxes = boxes.copy()
        room = self._field.at(np.ascontiguousarray(boxes[:, :2]))
        boxes[room + boxes[:, 4] < self._required, 4] = -1.0
        near = np.flatnonzero((room - boxes[:, 4] < self._required) & (boxes[:, 4] >= 0))
        for sign in (-1, 1):
            due = near[boxes[near, 4] >= 0]
            for _ in range(TRIM_STEPS):
                ends = boxes[due, :2] + sign * boxes[due, 4:5] * boxes[due, 2:4]
                missing = self._required - self._field.at(ends) - TRIM_ROUNDING
                due, missing = due[missing > 0], missing[missing > 0]
                boxes[due, :2] -= sign * missing[:, None] / 2 * boxes[due, 2:4]
                boxes[due, 4] -= missing / 2
                due = due[boxes[due, 4] >= 0]
                if not len(due):
                    break
        return boxes

    def may_be_crossed(self, boxes: np.ndarray, before: float, after: np.ndarray) -> np.ndarray:
        """Return (n,) bool: False for (n, 8) boxes through which no free path leads.

        Args:
            before: length that paths to a box have at least [m].
            after: (n,) lengths that they have at least from there on [m].
        """
        room = self._field.at(np.ascontiguousarray(boxes[:, :2]))
        may = np.ones(len(boxes), bool)
        is_narrow = boxes[:, 7] < MAX_HALF_HEADING
        for look in _LOOKS:
            length = look.arc_length * self._radius
            for least, turn in ((after, 0.0), (before, math.pi)):
                due = np.flatnonzero(may & is_narrow & (least >= length) & (room < self._required + length))
                may[due] = self._is_free_after(boxes[due], turn, look)
        return np.asarray(may)

    def _is_free_after(self, boxes: np.ndarray, turn: float, look: Look) -> np.ndarray:
        """Return (n,) bool: False where no disc ahead, with the headings turned, holds a place with enough clearance."""
        cos, sin = np.cos(boxes[:, 6] + turn)[:, None] * self._radius, np.sin(boxes[:, 6] + turn)[:, None] * self._radius
        middles = boxes[:, None, :2] + np.stack([cos * look.x - sin * look.y, sin * look.x + cos * look.y], axis=2)
        reach = (boxes[:, 4] + boxes[:, 7] * look.arc_length * self._radius)[:, None] + look.radii * self._radius
        return np.asarray((self._field.at(middles) + reach >= self._required).any(axis=1))


_LOOKS = tuple(look_ahead(*each) for each in LOOKS)
