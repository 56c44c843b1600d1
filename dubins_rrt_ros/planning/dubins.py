"""Dubins curves: the shortest paths of a car that drives forward and turns no tighter than its turning radius.

L. E. Dubins, On curves of minimal length with a constraint on average curvature, American Journal of Mathematics 79 (1957):
one of six words of left (L), right (R) and straight (S) is shortest. The formulas are those of section III of A. Khanal,
RRT and RRT* Using Vehicle Dynamics, with its misprints corrected; `_kernels/dubins.py` cites each.
"""

import math
from dataclasses import dataclass

import numpy as np

from ._kernels import dubins as _kernel
from .problem import Pose

WORDS: tuple[str, ...] = _kernel.WORDS


@dataclass(frozen=True)
class DubinsCurve:
    """Three arcs driven from a pose.

    Attributes:
        start: (x [m], y [m], theta [rad]).
        radius: the turning radius [m].
        word: the turns of the arcs, one of WORDS.
        lengths: the lengths of the arcs [m].
    """

    start: Pose
    radius: float
    word: str
    lengths: tuple[float, float, float]

    @property
    def length(self) -> float:
        """Its length [m]."""
        first, second, third = self.lengths
        return first + second + third

    @property
    def end(self) -> Pose:
        """The pose at its end, as driven."""
        return self.pose_at(self.length)

    def pose_at(self, s: float) -> Pose:
        """The pose at arc length `s` [m] in [0, length].

        Raises:
            ValueError: `s` is outside the curve.
        """
        if not 0 <= s <= self.length:
            raise ValueError(f"s is {s} m; the curve is {self.length} m long, so give 0 to {self.length}")
        return _kernel.pose_along(*self.start, self.radius, WORDS.index(self.word), *self.lengths, s)

    def poses(self, spacing: float) -> np.ndarray:
        """(n, 3) float64 poses at most `spacing` [m] apart, both ends and the joints between the arcs included.

        Raises:
            ValueError: `spacing` is not positive.
        """
        if not spacing > 0:
            raise ValueError(f"spacing is {spacing} m; it must be positive")
        stations = [np.zeros(1)]
        begin = 0.0
        for length in self.lengths:
            if length > 0:
                steps = math.ceil(length / spacing)
                stations.append(begin + length * (np.arange(1, steps + 1) / steps))
                begin += length
        stations = np.concatenate(stations)
        out = np.empty((len(stations), 3))
        _kernel.poses_along(*self.start, self.radius, WORDS.index(self.word), *self.lengths, stations, out)
        return out


def shortest(start: Pose, goal: Pose, radius: float) -> DubinsCurve:
    """The shortest Dubins curve from `start` to `goal`; equal poses have length 0.

    Args:
        start, goal: (x [m], y [m], theta [rad]).
        radius: the turning radius [m].
    """
    word, *lengths = _kernel.shortest_curve(*start, *goal, radius)
    return DubinsCurve(tuple(start), radius, WORDS[word], tuple(lengths))


def candidates(start: Pose, goal: Pose, radius: float) -> dict[str, DubinsCurve]:
    """Of each word the curve from `start` to `goal`, where there is one."""
    return {WORDS[word]: DubinsCurve(tuple(start), radius, WORDS[word], tuple(lengths))
            for word, *lengths in _kernel.all_curves(*start, *goal, radius)}


def lengths(starts: np.ndarray, goals: np.ndarray, radius: float) -> np.ndarray:
    """The lengths [m] of the shortest curves between (..., 3) arrays of poses, which are broadcast against each other."""
    shape = np.broadcast_shapes(np.shape(starts), np.shape(goals))
    both = (np.broadcast_to(np.asarray(poses, dtype=float), shape).reshape(-1, 3) for poses in (starts, goals))
    out = np.empty(shape[:-1])
    _kernel.shortest_lengths(*(np.require(poses, requirements="CW") for poses in both), radius, out.reshape(-1))
    return out
