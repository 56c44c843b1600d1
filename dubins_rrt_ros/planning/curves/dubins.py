"""Dubins curves: the shortest paths of a car that drives forward and turns no tighter than its turning radius.

L. E. Dubins, On curves of minimal length with a constraint on average curvature, American Journal of Mathematics 79 (1957):
one of six words of left (L), right (R) and straight (S) is shortest. The formulas are those of section III of A. Khanal,
RRT and RRT* Using Vehicle Dynamics, with its misprints corrected; `_kernels/dubins.py` cites each.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._kernels import dubins as _kernel
from ..errors import PlanningError
from ..problem import Pose

WORDS: tuple[str, ...] = _kernel.WORDS

#: Sides to which the letters of a word turn: left, straight on, right.
SIDES = {"L": 1, "S": 0, "R": -1}
#: (words, 3): True where an arc of a word turns.
TURNS = np.array([[SIDES[letter] != 0 for letter in word] for word in WORDS])
#: Relative rounding of a length.
ROUNDING = 1e-9


class CurveError(PlanningError, ValueError):
    """A curve that breaks one of its invariants; the message says which, with its figures."""


class Arc(NamedTuple):
    """A part of a curve that is driven with one steering angle.

    Attributes:
        curvature: positive to the left, 0 straight on [1/m].
        length: its length [m].
    """

    curvature: float
    length: float


@dataclass(frozen=True)
class DubinsCurve:
    """Three arcs driven from a pose.

    Attributes:
        start: (x [m], y [m], theta [rad]).
        radius: turning radius [m].
        word: turns of the arcs, one of WORDS.
        lengths: lengths of the arcs [m].
    """

    start: Pose
    radius: float
    word: str
    lengths: tuple[float, float, float]

    @classmethod
    def of_row(cls, start: np.ndarray, radius: float, word: int, lengths: np.ndarray) -> "DubinsCurve":
        """Return the curve that a row of arrays holds, as those of a path or a tree; `word` is an index into WORDS."""
        x, y, theta = start.tolist()
        first, second, third = lengths.tolist()
        return cls((x, y, theta), radius, WORDS[word], (first, second, third))

    @property
    def index(self) -> int:
        """The index of the word in WORDS."""
        return WORDS.index(self.word)

    @property
    def length(self) -> float:
        """The length [m]."""
        first, second, third = self.lengths
        return first + second + third

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """The arcs in the order in which they are driven; some may have no length."""
        return tuple(Arc(SIDES[letter] / self.radius, length) for letter, length in zip(self.word, self.lengths, strict=True))

    @property
    def end(self) -> Pose:
        """The pose at the end, as driven."""
        return self.pose_at(self.length)

    def pose_at(self, s: float) -> Pose:
        """Return the pose at arc length `s` [m] in [0, length].

        Raises:
            ValueError: `s` is outside the curve.
        """
        if not 0 <= s <= self.length:
            raise ValueError(f"s is {s} m; the curve is {self.length} m long, so give 0 to {self.length}")
        pose: Pose = _kernel.pose_along(self.start, self.radius, self.index, self.lengths, s)
        return pose

    def poses(self, spacing: float) -> np.ndarray:
        """Return (n, 3) float64 poses at most `spacing` [m] apart, with both ends and the joints between the arcs.

        Raises:
            ValueError: `spacing` is not positive.
        """
        if not spacing > 0:
            raise ValueError(f"spacing is {spacing} m; it must be positive")
        parts = [np.zeros(1)]
        begin = 0.0
        for length in self.lengths:
            if length > 0:
                steps = math.ceil(length / spacing)
                parts.append(begin + length * (np.arange(1, steps + 1) / steps))
                begin += length
        arc_lengths = np.concatenate(parts)
        out = np.empty((len(arc_lengths), 3))
        _kernel.poses_along(self.start, self.radius, self.index, self.lengths, arc_lengths, out)
        return out

    def check(self) -> None:
        """Check the invariants: a car can drive it, and its turns are those of a shortest curve or of a piece of one.

        Raises:
            CurveError: one does not hold.
        """
        if self.word not in WORDS:
            raise CurveError(f"{self.word!r} is none of the words {', '.join(WORDS)}")
        if not all(map(math.isfinite, self.start)):
            raise CurveError(f"it starts at {self.start}, where not all numbers are finite")
        if not 0 < self.radius < math.inf:
            raise CurveError(f"its turning radius is {self.radius} m, not positive and finite")
        if not all(0 <= length < math.inf for length in self.lengths):
            raise CurveError(f"its arcs are {self.lengths} m long, not all of them finite and at least 0")
        self._check_turns()

    def _check_turns(self) -> None:
        turns = [length / self.radius for turns, length in zip(TURNS[self.index], self.lengths, strict=True) if turns]
        if max(turns) > math.tau * (1 + ROUNDING):
            raise CurveError(f"an arc of {self.word} turns by {max(turns):.9g} rad, more than a full circle")
        # All three are there: it is no piece of a longer curve that was cut within the second.
        if len(turns) == 3 and min(turns) > 0 and turns[1] < math.pi * (1 - ROUNDING):
            raise CurveError(f"the second arc of {self.word} turns by {turns[1]:.9g} rad, less than pi, as on no shortest curve")


def shortest(start: Pose, goal: Pose, radius: float) -> DubinsCurve:
    """Return the shortest Dubins curve from `start` to `goal`; equal poses have length 0.

    Args:
        start, goal: (x [m], y [m], theta [rad]).
        radius: turning radius [m].
    """
    return _curve(start, radius, *_kernel.shortest_curve(start, goal, radius))


def candidates(start: Pose, goal: Pose, radius: float) -> dict[str, DubinsCurve]:
    """Return the curve of each word from `start` to `goal`, where there is one."""
    curves = (_curve(start, radius, *found) for found in _kernel.all_curves(start, goal, radius))
    return {curve.word: curve for curve in curves}


def _curve(start: Pose, radius: float, word: int, first: float, second: float, third: float) -> DubinsCurve:
    x, y, theta = start
    return DubinsCurve((x, y, theta), radius, WORDS[word], (first, second, third))


def lengths(starts: np.ndarray, goals: np.ndarray, radius: float) -> np.ndarray:
    """Return the lengths [m] of the shortest curves between (..., 3) arrays of poses, broadcast against each other."""
    shape = np.broadcast_shapes(np.shape(starts), np.shape(goals))
    rows = [np.require(np.broadcast_to(np.asarray(poses, dtype=float), shape).reshape(-1, 3), requirements=["C", "W"])
            for poses in (starts, goals)]
    out = np.empty(shape[:-1])
    _kernel.shortest_lengths(rows[0], rows[1], radius, out.reshape(-1))
    return out


def poses_on(waypoints: np.ndarray, words: np.ndarray, lengths: np.ndarray, radius: float, starts: np.ndarray, ends: np.ndarray,
             arc_lengths: np.ndarray) -> np.ndarray:
    """Return (m, 3) poses along curves of a path or a tree, headings in [-pi, pi].

    Args:
        waypoints: (n, 3) poses.
        words, lengths: (n,) words and (n, 3) lengths of arcs [m], of the curves that lead to the waypoints.
        radius: turning radius [m].
        starts, ends: (m,) waypoints between which the curves lead; the words and lengths are those of the ends.
        arc_lengths: (m,) lengths along these curves [m].
    """
    out = np.empty((len(arc_lengths), 3))
    starts, ends = (np.asarray(indices, np.int64) for indices in (starts, ends))
    _kernel.path_poses(waypoints, words, lengths, radius, starts, ends, arc_lengths, out)
    return out
