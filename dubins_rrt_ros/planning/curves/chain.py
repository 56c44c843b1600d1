"""A path as arrays: a chain of poses, each reached by a curve from the one before."""

import math
from typing import NamedTuple

import numpy as np

from .._kernels import dubins as _dubins


class Chain(NamedTuple):
    """A path whose curves are those that the tree's edges would be.

    Attributes:
        poses: (n, 3) float64: x [m], y [m], theta [rad], from its start to its end.
        words: (n,) int8: the words of the curves to the poses; that to the first means nothing.
        lengths: (n, 3) float64: the lengths of these curves' arcs [m].
    """

    poses: np.ndarray
    words: np.ndarray
    lengths: np.ndarray

    @property
    def length(self) -> float:
        """Its length [m]."""
        return float(self.lengths[1:].sum())

    def cut(self, radius: float, longest: float) -> "Chain":
        """The same path, its curves cut into pieces no longer than `longest` [m]; 0 is unlimited."""
        if longest == 0 or len(self.words) < 2:
            return self
        curves = [_cut(self.poses[i - 1], self.poses[i], self.words[i], self.lengths[i], radius, longest)
                  for i in range(1, len(self.words))]
        return Chain(np.concatenate([self.poses[:1], *(poses for poses, _ in curves)]),
                     np.concatenate([self.words[:1], *(np.full(len(poses), word, np.int8)
                                                       for word, (poses, _) in zip(self.words[1:], curves, strict=True))]),
                     np.concatenate([self.lengths[:1], *(lengths for _, lengths in curves)]))

    def at(self, stations: np.ndarray, radius: float) -> np.ndarray:
        """(n, 3) poses at (n,) arc lengths along the path [m]."""
        ends = np.cumsum(self.lengths[1:].sum(axis=1))
        curves = np.minimum(np.searchsorted(ends, stations), len(ends) - 1)
        out = np.empty((len(stations), 3))
        _dubins.chain_poses(self.poses, self.words, self.lengths, radius, curves, stations - np.append(0.0, ends)[curves], out)
        return out


def _cut(start: np.ndarray, end: np.ndarray, word: int, lengths: np.ndarray, radius: float, longest: float
         ) -> tuple[np.ndarray, np.ndarray]:
    """The ends of the pieces of a curve, and the lengths of their arcs."""
    pieces = max(1, math.ceil(lengths.sum() / longest * (1 - 1e-12)))
    bounds = lengths.sum() * np.arange(pieces + 1) / pieces
    poses = _poses_on(start, word, lengths, radius, bounds[1:])
    poses[-1] = end
    before = np.concatenate([[0.0], np.cumsum(lengths)])
    within = np.clip(bounds[:, None], before[:-1], before[1:]) - before[:-1]
    return poses, np.diff(within, axis=0)


def _poses_on(start: np.ndarray, word: int, lengths: np.ndarray, radius: float, stations: np.ndarray) -> np.ndarray:
    """(n, 3) poses at arc lengths of a curve, headings in [-pi, pi]."""
    out = np.empty((len(stations) + 1, 3))
    _dubins.poses_along(*start, radius, word, *lengths, np.concatenate([[0.0], stations]), out)
    return out[1:]
