"""A path: waypoints, each reached from the one before by a curve."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._kernels import dubins as _kernel
from ..errors import PlanningError
from ..problem import Pose
from .angles import heading_error, position_error
from .dubins import CurveError, DubinsCurve, poses_on

#: Maximum distance between the end of a curve and the start of the next [m, rad].
JOINT = 1e-6
#: Relative rounding of a length that is a whole number of pieces.
ROUNDING = 1e-12


class PathError(PlanningError, ValueError):
    """A path that breaks one of its invariants; the message says which, with its figures."""


@dataclass(frozen=True, eq=False)
class Path:
    """Waypoints from start to end, each reached from the one before by a curve; `Path.of_curves` makes one of curves.

    Attributes:
        waypoints: (n, 3) float64: x [m], y [m], theta [rad]; the first and the last are exactly as asked for.
        words: (n,) int8: indices into WORDS, of the curves that lead to the waypoints; the first means nothing.
        lengths: (n, 3) float64: lengths of the arcs of these curves [m]; those of the first mean nothing.
        radius: turning radius of all curves [m].
    """

    waypoints: np.ndarray
    words: np.ndarray
    lengths: np.ndarray
    radius: float

    @classmethod
    def of_curves(cls, start: Pose, end: Pose, curves: Sequence[DubinsCurve]) -> "Path":
        """Join curves.

        Args:
            start, end: (x [m], y [m], theta [rad]).
            curves: those from start to end; none where the two are the same.

        Raises:
            PathError: the first curve does not begin at the start, one has another radius, or there is none between two poses.
        """
        if not curves:
            if start != end:
                raise PathError(f"no curve leads from {start} to {end}")
            return cls.of_pose(start)
        if curves[0].start != start:
            raise PathError(f"the first curve starts at {curves[0].start}, not at {start}")
        radius = curves[0].radius
        if other := next((curve for curve in curves if curve.radius != radius), None):
            raise PathError(f"one curve of the path has a turning radius of {radius} m, and another one of {other.radius} m")
        return cls(np.array([*(curve.start for curve in curves), end], dtype=float),
                   np.array([0, *(curve.index for curve in curves)], np.int8),
                   np.array([(0.0, 0.0, 0.0), *(curve.lengths for curve in curves)]), radius)

    @classmethod
    def of_pose(cls, pose: Pose, radius: float = math.inf) -> "Path":
        """Return the path that stays at a pose."""
        return cls(np.array([pose], dtype=float), np.zeros(1, np.int8), np.zeros((1, 3)), radius)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Path):
            return NotImplemented
        return bool(np.array_equal(self.waypoints, other.waypoints) and np.array_equal(self.words[1:], other.words[1:])
                    and np.array_equal(self.lengths[1:], other.lengths[1:])
                    and (self.radius == other.radius or len(self.waypoints) == 1))

    def __hash__(self) -> int:
        return hash((self.start, self.end, len(self.waypoints)))

    @property
    def start(self) -> Pose:
        """The first waypoint."""
        return _pose(self.waypoints[0])

    @property
    def end(self) -> Pose:
        """The last waypoint."""
        return _pose(self.waypoints[-1])

    @cached_property
    def curves(self) -> tuple[DubinsCurve, ...]:
        """The curves from start to end; none where the two are the same."""
        rows = zip(self.waypoints[:-1], self.words[1:].tolist(), self.lengths[1:], strict=True)
        return tuple(DubinsCurve.of_row(start, self.radius, word, lengths) for start, word, lengths in rows)

    @cached_property
    def length(self) -> float:
        """The length [m]."""
        first, second, third = self.lengths.T
        lengths = first + second + third
        lengths[0] = 0.0
        return float(np.cumsum(lengths)[-1])  # which adds in the order of the tree's costs, as sum() does not

    def poses(self, spacing: float) -> np.ndarray:
        """Return (n, 3) float64 poses at most `spacing` [m] apart; with start, end and every joint between two arcs."""
        if not self.curves:
            return self.waypoints.copy()
        parts = [curve.poses(spacing) for curve in self.curves]
        for part, end in zip(parts, self.waypoints[1:], strict=True):
            part[-1] = end
        return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])

    def at(self, shares: np.ndarray) -> np.ndarray:
        """Return (n, 3) poses at (n,) shares of the length, each in [0, 1]; headings in [-pi, pi]."""
        arc_lengths = shares * self._total
        curves = np.minimum(self._arc_lengths[1:].searchsorted(arc_lengths), len(self._arc_lengths) - 2)
        return poses_on(self.waypoints, self.words, self.lengths, self.radius, curves, curves + 1,
                        arc_lengths - self._arc_lengths[curves])

    def after(self, arc_length: float) -> "Path":
        """Return what is left of the path behind an arc length [m]; its first waypoint is a pose of the path."""
        ends = self._arc_lengths[1:]
        if len(ends) == 0 or arc_length >= ends[-1]:
            return Path.of_pose(self.end)
        if arc_length <= 0:
            return self
        i = 1 + int(np.searchsorted(ends, arc_length, side="right"))
        driven = arc_length - (ends[i - 2] if i > 1 else 0.0)
        arcs = np.cumsum(self.lengths[i])
        start = np.empty((1, 3))
        _kernel.poses_along(self.waypoints[i - 1], self.radius, self.words[i], self.lengths[i], np.array([driven]), start)
        start[0, 2] = math.remainder(start[0, 2], math.tau)
        lengths = self.lengths[i - 1:].copy()
        lengths[1] = np.clip(arcs - driven, 0.0, self.lengths[i])
        return Path(np.concatenate([start, self.waypoints[i:]]), self.words[i - 1:], lengths, self.radius)

    def arc_lengths(self) -> np.ndarray:
        """Return the (n,) arc lengths at which the waypoints lie [m]; read-only."""
        return self._arc_lengths

    @cached_property
    def _arc_lengths(self) -> np.ndarray:
        arc_lengths = np.append(0.0, np.cumsum(self.lengths[1:].sum(axis=1)))
        arc_lengths.flags.writeable = False
        return arc_lengths

    @cached_property
    def _total(self) -> np.float64:
        """The length, added up in the order that `at` takes shares of [m]."""
        return np.float64(self.lengths[1:].sum())

    def part(self, first: int, last: int) -> "Path":
        """Return the path from one waypoint to another."""
        return Path(self.waypoints[first:last + 1], self.words[first:last + 1], self.lengths[first:last + 1], self.radius)

    @classmethod
    def joined(cls, first: "Path", *others: "Path") -> "Path":
        """Join paths, each of which ends where the next begins."""
        return cls(np.concatenate([first.waypoints, *(path.waypoints[1:] for path in others)]),
                   np.concatenate([first.words, *(path.words[1:] for path in others)]),
                   np.concatenate([first.lengths, *(path.lengths[1:] for path in others)]), first.radius)

    def cut(self, longest: float) -> "Path":
        """Return the same path with its curves cut into pieces no longer than `longest` [m]; 0 is unlimited.

        Shorter curves stay as they are, to the last bit, so that a path that was cut is not changed by cutting it again.
        """
        if longest == 0 or len(self.words) < 2:
            return self
        pieces = [self._pieces(i, longest) for i in range(1, len(self.words))]
        return Path(np.concatenate([self.waypoints[:1], *(ends for ends, _ in pieces)]),
                    np.concatenate([self.words[:1], *(np.full(len(ends), word, np.int8)
                                                      for word, (ends, _) in zip(self.words[1:], pieces, strict=True))]),
                    np.concatenate([self.lengths[:1], *(lengths for _, lengths in pieces)]), self.radius)

    def _pieces(self, i: int, longest: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the pieces of the curve to waypoint `i`, and the lengths of their arcs."""
        lengths = self.lengths[i]
        count = max(1, math.ceil(lengths.sum() / longest * (1 - ROUNDING)))
        if count == 1:
            return self.waypoints[i:i + 1], lengths[None]
        bounds = lengths.sum() * np.arange(count + 1) / count
        ends = np.empty((count + 1, 3))
        _kernel.poses_along(self.waypoints[i - 1], self.radius, self.words[i], lengths, bounds, ends)
        ends[-1] = self.waypoints[i]
        before = np.concatenate([[0.0], np.cumsum(lengths)])
        within = np.clip(bounds[:, None], before[:-1], before[1:]) - before[:-1]
        return ends[1:], np.diff(within, axis=0)

    def check(self) -> None:
        """Check the invariants: those of each curve, and that they lead from the start to the end without a jump.

        Raises:
            PathError: one does not hold.
        """
        for name, pose in (("start", self.start), ("end", self.end)):
            if not all(map(math.isfinite, pose)):
                raise PathError(f"the {name} of the path is {pose}, where not all numbers are finite")
        for i, curve in enumerate(self.curves):
            try:
                curve.check()
            except CurveError as error:
                raise PathError(f"of curve {i} of the path: {error}") from None
        for i, curve in enumerate(self.curves):
            self._check_joint(i, curve.end)

    def _check_joint(self, i: int, driven: Pose) -> None:
        end = _pose(self.waypoints[i + 1])
        off, turned = position_error(driven, end), heading_error(driven, end)
        if not (off <= JOINT and turned <= JOINT):
            raise PathError(f"before curve {i + 1} the path jumps by {off:.3g} m and {turned:.3g} rad to {end}")


def _pose(row: np.ndarray) -> Pose:
    x, y, theta = row.tolist()
    return x, y, theta
