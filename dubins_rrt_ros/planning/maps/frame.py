"""A frame in the plane, such as a grid's own."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Largest absolute yaw of a pose [rad]; beyond it, rounding has taken too many digits of the direction.
LARGEST_YAW = 1e6


class DoubtfulYaw(UserWarning):
    """A warning: a yaw beyond a full turn, which is taken, but was likely meant in degrees."""


def doubt_about_yaw(yaw: float) -> str:
    """Return what is doubtful about a yaw [rad], in words; "" where nothing is."""
    return f"the yaw {yaw:g} rad; did you mean {math.radians(yaw):.5g}?" if math.tau < abs(yaw) <= LARGEST_YAW else ""


class Frame(NamedTuple):
    """A frame, by where its origin is in the map's frame and how far it is turned.

    Attributes:
        x, y: position of its origin [m].
        yaw: direction of its x axis [rad].
    """

    x: float
    y: float
    yaw: float

    def to_map(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return (..., 2) points of this frame in the map's frame [m]."""
        points = np.asarray(points, dtype=float)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.stack([self.x + c * points[..., 0] - s * points[..., 1],
                         self.y + s * points[..., 0] + c * points[..., 1]], axis=-1)

    def from_map(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return (..., 2) points of the map's frame in this frame [m]."""
        points = np.asarray(points, dtype=float)
        dx, dy = points[..., 0] - self.x, points[..., 1] - self.y
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.stack([c * dx + s * dy, c * dy - s * dx], axis=-1)
