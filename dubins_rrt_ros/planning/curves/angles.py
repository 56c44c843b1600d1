"""Angles, and differences between poses."""

import math
from typing import TypeVar

import numpy as np

Angles = TypeVar("Angles", float, np.ndarray)


def wrap(angle: Angles) -> Angles:
    """Return angles [rad] as those in [-pi, pi) that point the same way."""
    return np.remainder(angle + math.pi, math.tau) - math.pi


def position_error(pose: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    """Return the distance between the positions of two poses [m]."""
    return math.dist(pose[:2], other[:2])


def heading_error(pose: tuple[float, float, float], other: tuple[float, float, float]) -> float:
    """Return the angle between the headings of two poses, in [0, pi] [rad]."""
    return abs(math.remainder(pose[2] - other[2], math.tau))
