"""Short arcs: where smoothing left a turn of a few millimetres, a vehicle would turn its wheels to the stop and back.

Once the search is over they are merged with what is beside them: a section of the path around a short arc is replaced by the
Dubins curve between its ends, or by two that meet in a pose beside the path.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..curves import dubins
from ..curves.angles import wrap
from ..curves.dubins import SIDES, WORDS, DubinsCurve
from ..curves.path import Path
from ..problem import Pose
from ..work import Work
from .cost import Objective

#: An arc is short below this length [m] ...
SHORT = 0.02
#: ... and this share of the turning radius.
SHORT_SHARE = 0.05
#: Minimum turning radius of a path whose arcs are merged [m]; on a smaller one all arcs are short.
LEAST_RADIUS = 0.05
#: Maximum length by which a path may become longer [m].
MOST_LONGER = 1e-3
#: Maximum number of turns before and after a short arc in which sections begin and end.
MOST_TURNS = 3
#: Number of sections that are tried for each short arc.
TRIES = 200
#: Least and greatest standard deviation by which that pose is moved to the side, and that by which it is turned, in lengths of a
#: short arc; and share of the tries without such a pose.
LEAST_OFFSET, MOST_OFFSET, TURN, DIRECT_SHARE = 0.1, 3.0, 0.6, 0.1
#: Rounding of poses and of lengths along a path [m, rad].
SAME = 1e-11

_SIDES = np.array([[SIDES[letter] for letter in word] for word in WORDS])


def merge_short_arcs(path: Path, objective: Objective, seed: int, work: Work | None = None) -> Path:
    """Return a path with the same ends, without empty curves, and without short arcs where there is room to merge them.

    Args:
        path: free for the vehicle, and so is what is returned, which is at most MOST_LONGER longer, and as much dearer.
        objective: the vehicle, the clearance of the map, and the cost.
        seed: of the sections that are tried.
        work: counts the sections that are tried; once it is over the path stays as it is by then.
    """
    work = work or Work()
    if not LEAST_RADIUS <= path.radius < math.inf or not work.begins():
        return path
    rng = np.random.default_rng((seed, 5))  # the numbers that Corridors draws too, no others
    return _Merger(path, objective, rng, work).merge(_without_empty_curves(path))


def short_arcs(path: Path) -> list[tuple[float, float]]:
    """Return where short arcs between two others begin and end [m along the path]."""
    limit = min(SHORT, SHORT_SHARE * path.radius)
    return [(begin, end) for begin, end in pairwise(_arc_bounds(path)[1:-1]) if end - begin < limit]


def _arc_bounds(path: Path) -> list[float]:
    """Return where arcs begin, and where the last one ends [m]; what is driven with one steering angle is one arc."""
    return _bounds_of(_SIDES[path.words[1:]].ravel().tolist(), path.lengths[1:].ravel().tolist())


def _has_short_arc(curves: list[DubinsCurve]) -> bool:
    """Return True if an arc of curves that join is short, other than the first and the last."""
    bounds = _bounds_of([SIDES[letter] for curve in curves for letter in curve.word],
                        [length for curve in curves for length in curve.lengths])
    return any(end - begin < min(SHORT, SHORT_SHARE * curves[0].radius) for begin, end in pairwise(bounds[1:-1]))


def _bounds_of(sides: Sequence[int], lengths: Sequence[float]) -> list[float]:
    """Return where arcs begin, and where the last one ends, given the sides and lengths of pieces of them."""
    bounds, before, driven = [0.0], None, 0.0
    for side, length in zip(sides, lengths, strict=True):
        if length == 0:
            continue
        if before is not None and side != before:
            bounds.append(driven)
        before, driven = side, driven + length
    return [*bounds, driven]


def _turns(path: Path) -> list[tuple[float, float]]:
    """Return where arcs that turn begin and end [m]."""
    driven = np.cumsum(path.lengths[1:].ravel())
    turns = _SIDES[path.words[1:]].ravel() != 0
    return [(begin, end) for begin, end in pairwise(_arc_bounds(path)) if turns[np.searchsorted(driven, (begin + end) / 2)]]


class _Merger:
    """Tries other sections around the short arcs of a path."""

    def __init__(self, path: Path, objective: Objective, rng: np.random.Generator, work: Work):
        self._checker = objective.field.collision_checker(objective.vehicle)
        self._objective, self._rng, self._work = objective, rng, work
        self._longest, self._dearest = path.length + MOST_LONGER, objective.path_cost(path) + MOST_LONGER

    def merge(self, path: Path) -> Path:
        """Merge the short arcs of a path one after the other, as far as that succeeds."""
        kept = 0
        while kept < len(found := short_arcs(path)):
            merged = self._merged(path, found[kept], len(found))
            kept, path = (kept + 1, path) if merged is None else (kept, merged)
            if self._work.is_over:
                break
        return path

    def _merged(self, path: Path, arc: tuple[float, float], count: int) -> Path | None:
        """Return the path with fewer than `count` short arcs, or None where no try succeeds."""
        turns = _turns(path)
        for _ in range(TRIES):
            if not self._work.begins():
                break
            begin, middle, end = self._section(turns, arc, path.length)
            curves = self._curves(path, begin, middle, end)
            if (path.length - (end - begin) + sum(curve.length for curve in curves) > self._longest or _has_short_arc(curves)
                    or not all(map(self._is_free, curves))):
                continue
            spliced = _spliced(path, begin, end, curves)
            if len(short_arcs(spliced)) < count and self._objective.path_cost(spliced) <= self._dearest:
                return spliced
        return None

    def _section(self, turns: list[tuple[float, float]], arc: tuple[float, float], length: float) -> tuple[float, float, float]:
        """Draw where a section begins, where a pose in it is moved, and where it ends [m along the path].

        It begins and ends in turns, which go on in the first and the last turn of the curves: in a straight these would be more
        short arcs. The pose is in the short arc, or in another turn between, which is moved to where there is room.
        """
        before = [(low, high) for low, high in turns if high <= arc[0]][-MOST_TURNS:]
        after = [(low, high) for low, high in turns if low >= arc[1]][:MOST_TURNS]
        begin = self._rng.uniform(*before[self._rng.integers(len(before))]) if before else 0.0
        end = self._rng.uniform(*after[self._rng.integers(len(after))]) if after else length
        between = [arc, *((low, high) for low, high in turns if begin < low and high < end and low != arc[0])]
        which = 0 if self._rng.random() < 0.5 else self._rng.integers(len(between))
        return begin, sum(between[which]) / 2, end

    def _curves(self, path: Path, begin: float, middle: float, end: float) -> list[DubinsCurve]:
        """Draw the curves of a section."""
        first, last = _pose_at(path, begin), _pose_at(path, end)
        if self._rng.random() < DIRECT_SHARE:
            return [dubins.shortest(first, last, path.radius)]
        x, y, theta = _pose_at(path, middle)
        short = min(SHORT, SHORT_SHARE * path.radius)
        size = math.exp(self._rng.uniform(math.log(LEAST_OFFSET), math.log(MOST_OFFSET)))
        offset, turn = short * self._rng.normal(size=2) * (size, TURN)
        through = x - offset * math.sin(theta), y + offset * math.cos(theta), wrap(theta + turn / path.radius)
        return [dubins.shortest(first, through, path.radius), dubins.shortest(through, last, path.radius)]

    def _is_free(self, curve: DubinsCurve) -> bool:
        return self._checker.is_motion_free(curve.start, curve.radius, curve.index, curve.lengths)


def _spliced(path: Path, begin: float, end: float, curves: list[DubinsCurve]) -> Path:
    """Return the path with other curves from `begin` to `end` [m along it]."""
    driven = np.concatenate([[0.0], np.cumsum(path.lengths[1:].sum(axis=1))])
    first, last = (min(int(np.searchsorted(driven[1:], at)) + 1, len(driven) - 1) for at in (begin, end))
    head, tail = _cut(path.lengths[first], begin - driven[first - 1])[0], _cut(path.lengths[last], end - driven[last - 1])[1]
    inner = np.array([*(curve.start for curve in curves), _pose_at(path, end)])
    inner_words = np.array([curve.index for curve in curves], np.int8)
    inner_lengths = np.array([head, *(curve.lengths for curve in curves), tail])
    return _without_empty_curves(Path(np.vstack([path.waypoints[:first], inner, path.waypoints[last:]]),
                                      np.concatenate([path.words[:first + 1], inner_words, path.words[last:]]),
                                      np.vstack([path.lengths[:first], inner_lengths, path.lengths[last + 1:]]), path.radius))


def _cut(lengths: np.ndarray, at: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of the arcs of both parts of a curve that is cut at an arc length."""
    before = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    first = np.clip(at - before, 0.0, lengths)
    first = np.where(lengths - first <= SAME, lengths, np.where(first <= SAME, 0.0, first))
    return first, lengths - first


def _without_empty_curves(path: Path) -> Path:
    """Leave out curves without length; the ends stay."""
    apart = np.diff(path.waypoints, axis=0)
    jumps = np.hypot(apart[:, 0], apart[:, 1]) + np.abs(wrap(apart[:, 2])) > SAME
    keep = np.append(True, path.lengths[1:].any(axis=1) | jumps)
    if keep.all() or keep.sum() == 1:
        return path
    waypoints = path.waypoints[keep]
    waypoints[-1] = path.waypoints[-1]
    return Path(waypoints, path.words[keep], path.lengths[keep], path.radius)


def _pose_at(path: Path, at: float) -> Pose:
    """Return the pose at a length along a path [m], at its ends just as it has them."""
    if at == 0 or at >= path.length:
        return path.start if at == 0 else path.end
    x, y, theta = path.at(np.array([at / path.length]))[0].tolist()
    return x, y, theta
