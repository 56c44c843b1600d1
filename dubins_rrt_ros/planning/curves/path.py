"""A path: consecutive Dubins curves."""

import math
from dataclasses import dataclass

import numpy as np

from ..errors import PlanningError
from ..problem import Pose
from .dubins import CurveError, DubinsCurve

#: How far a curve may end from where the next one begins [m, rad].
JOINT = 1e-6


class PathError(PlanningError, ValueError):
    """A path that breaks one of its invariants; the message says which, with its figures."""


@dataclass(frozen=True)
class Path:
    """Dubins curves, each beginning where the one before ends.

    Attributes:
        start, end: (x [m], y [m], theta [rad]), exactly as asked for.
        curves: from start to end; none where the two are the same.
    """

    start: Pose
    end: Pose
    curves: tuple[DubinsCurve, ...]

    @property
    def length(self) -> float:
        """Its length [m]."""
        total = 0.0  # not sum(), which compensates for rounding since Python 3.12 and so differs from the tree's costs
        for curve in self.curves:
            total += curve.length
        return total

    def poses(self, spacing: float) -> np.ndarray:
        """(n, 3) float64 poses at most `spacing` [m] apart; start, end and every joint between two arcs are among them."""
        if not self.curves:
            return np.array([self.start])
        parts = [curve.poses(spacing) for curve in self.curves]
        for part, following in zip(parts, self.curves[1:], strict=False):
            part[-1] = following.start
        parts[-1][-1] = self.end
        return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])

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
        self._check_joints()

    def _check_joints(self) -> None:
        # What is published begins with the first curve's own start.
        if self.curves and self.curves[0].start != self.start:
            raise PathError(f"the first curve starts at {self.curves[0].start}, not at {self.start}")
        before = [self.start, *(curve.end for curve in self.curves)]
        after = [*(curve.start for curve in self.curves), self.end]
        for i, (a, b) in enumerate(zip(before, after, strict=True)):
            off, turned = math.dist(a[:2], b[:2]), abs(math.remainder(a[2] - b[2], math.tau))
            if not (off <= JOINT and turned <= JOINT):
                raise PathError(f"before curve {i} the path jumps by {off:.3g} m and {turned:.3g} rad to {b}")
