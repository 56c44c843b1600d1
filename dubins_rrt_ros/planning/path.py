"""A path: consecutive Dubins curves."""

from dataclasses import dataclass

import numpy as np

from .dubins import DubinsCurve
from .problem import Pose


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
