"""Angles, and differences between poses."""

import math
from typing import overload

import numpy as np

#: Poses this close are the same [m, rad]: what lies between them is rounding, of quaternions and the like.
SAME = 1e-9


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: np.ndarray) -> np.ndarray: ...


def wrap(angle: float | np.ndarray) -> float | np.ndarray:
    """Return angles [rad] as those in [-pi, pi) that point the same way."""
    wrapped: float | np.ndarray = np.remainder(angle + math.pi, math.tau) - math.pi
    return wrapped


def position_error(pose: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    """Return the distance between the positions of two poses [m]."""
    return math.dist(pose[:2], other[:2])


def heading_error(pose: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    """Return the angle between the headings of two poses, in [0, pi] [rad]."""
    return abs(math.remainder(pose[2] - other[2], math.tau))
