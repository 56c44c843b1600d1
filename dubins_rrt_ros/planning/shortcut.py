"""Shortcuts: a path made shorter by Dubins curves between poses along it, which keep the same clearance."""

import math
from dataclasses import dataclass

import numpy as np

from ._kernels import dubins as _dubins
from ._kernels.shortcut import shortest_chain
from .clearance import ClearanceField
from .dubins import WORDS, DubinsCurve
from .path import Path

#: How many stations are spread evenly along a path, and how many of the joints between its curves are stations too, at most:
#: what a round takes is bounded by their number's square, however long the path is.
EVENLY, MOST_JOINTS = 32, 16
#: By what part of their spacing the even stations are shifted: a round for each.
SHIFTS = (1 / 2, 1 / 4, 3 / 4, 1 / 8, 5 / 8)
#: A round that gains less than this is the last one [m].
LEAST_GAIN = 1e-3


def shortened(path: Path, field: ClearanceField, need: float) -> Path:
    """A path with the same ends that is never longer; it is a function of its arguments alone.

    Args:
        path: it keeps the clearance `need` [m]; so does the answer.
    """
    for shift in SHIFTS:
        shorter = _with_shortcuts(path, shift, field, need)
        gain = path.length - shorter.length
        if gain > 0:
            path = shorter
        if gain < LEAST_GAIN:
            break
    return path


@dataclass(frozen=True)
class _Stations:
    """Poses along a path: its start first, its end last.

    Attributes:
        curves, offsets: (n,): on which of the path's curves, and how far along it [m].
        at: (n,): how far along the path [m].
        poses: (n, 3).
    """

    curves: np.ndarray
    offsets: np.ndarray
    at: np.ndarray
    poses: np.ndarray


def _with_shortcuts(path: Path, shift: float, field: ClearanceField, need: float) -> Path:
    """The shortest path over stations along `path`."""
    stations = _stations_along(path, shift)
    count, radius = len(stations.at), path.curves[0].radius
    costs, before = np.empty(count), np.empty(count, np.int32)
    words, lengths = np.empty(count, np.int8), np.empty((count, 3))
    shortest_chain(stations.poses, stations.at, radius, field.kernel, need, costs, before, words, lengths)
    parts, end = [], count - 1
    while end > 0:
        begin = before[end]
        if words[end] < 0:
            while begin > 0 and words[begin] < 0:
                begin = before[begin]
            parts.append(_between(path, stations, begin, end))
        else:
            start = tuple(stations.poses[begin].tolist())
            parts.append([DubinsCurve(start, radius, WORDS[words[end]], tuple(lengths[end].tolist()))])
        end = begin
    return Path(path.start, path.end, tuple(curve for part in reversed(parts) for curve in part))


def _stations_along(path: Path, shift: float) -> _Stations:
    lengths = np.array([curve.length for curve in path.curves])
    ends = np.cumsum(lengths)
    begins = np.concatenate([[0.0], ends[:-1]])
    even = (np.arange(EVENLY) + shift) * (ends[-1] / EVENLY)
    on = np.searchsorted(begins, even, side="right") - 1
    joints = np.arange(0, len(lengths), math.ceil(len(lengths) / MOST_JOINTS))
    curves = np.concatenate([joints, on])
    offsets = np.concatenate([np.zeros(len(joints)), np.minimum(even - begins[on], lengths[on])])
    order = np.lexsort((offsets, curves))
    curves, offsets = np.append(curves[order], len(lengths) - 1), np.append(offsets[order], lengths[-1])
    poses = np.vstack([_poses_on(path.curves[curve], offsets[curves == curve]) for curve in np.unique(curves)])
    poses[0], poses[-1] = path.start, path.end
    return _Stations(curves, offsets, begins[curves] + offsets, poses)


def _poses_on(curve: DubinsCurve, offsets: np.ndarray) -> np.ndarray:
    """(n, 3) poses at arc lengths of a curve, headings in [-pi, pi]."""
    out = np.empty((len(offsets) + 1, 3))
    offsets = np.concatenate([[0.0], offsets])
    _dubins.poses_along(*curve.start, curve.radius, WORDS.index(curve.word), *curve.lengths, offsets, out)
    return out[1:]


def _between(path: Path, stations: _Stations, begin: int, end: int) -> list[DubinsCurve]:
    """The piece of the path between two stations."""
    first, last = int(stations.curves[begin]), int(stations.curves[end])
    pieces = []
    for index in range(first, last + 1):
        curve = path.curves[index]
        low = float(stations.offsets[begin]) if index == first else 0.0
        high = float(stations.offsets[end]) if index == last else curve.length
        if low == 0 and high == curve.length:
            pieces.append(curve)
        elif low < high:
            start = tuple(stations.poses[begin].tolist()) if index == first else curve.start
            pieces.append(_piece(curve, start, low, high))
    return pieces


def _piece(curve: DubinsCurve, start: tuple[float, float, float], low: float, high: float) -> DubinsCurve:
    """A curve from the arc length `low` on, where it has the pose `start`, to `high`."""
    lengths, begin = [], 0.0
    for length in curve.lengths:
        end = begin + length
        lengths.append(max(0.0, min(high, end) - max(low, begin)))
        begin = end
    return DubinsCurve(start, curve.radius, curve.word, tuple(lengths))
