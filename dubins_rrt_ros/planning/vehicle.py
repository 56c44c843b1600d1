"""The vehicle: how tightly it turns and how much room it takes."""

import json
import math
import reprlib
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import shapely

from .option import OptionError, convert_options, is_number, option, options

#: The most corners of a footprint.
MAX_CORNERS = 100


@dataclass(frozen=True)
class Vehicle:
    """A Dubins car: it drives forward only and turns no tighter than `turning_radius`; seen from above it is a disc or a polygon.

    `footprint`, where it is set, is the polygon: its corners in the vehicle's frame, which has the reference point as its origin
    and x ahead. It determines `robot_radius`, that of the disc around the reference point that covers it.
    `wheelbase` L and `max_steering_angle` phi, where both are set, determine the turning radius, L / tan(phi) (the
    paper's equation 1).

    Raises:
        OptionError: a field is of the wrong type or out of range, the footprint is no outline around the reference point, or one
            of wheelbase and steering angle is missing.
    """

    turning_radius: float = option(1.0, "the least turning radius", unit="m", low=0.001, high=10_000.0)
    robot_radius: float = option(0.2, "the radius of the disc that covers the vehicle around its reference point",
                                 unit="m", low=0.0, high=1000.0)
    footprint: str = option("", "the vehicle's outline around its reference point, x ahead: [[x, y], ...] in m, in place of "
                                "robot_radius; empty is unset")
    wheelbase: float = option(0.0, "with max_steering_angle in place of turning_radius; 0 is unset", unit="m",
                              low=0.0, high=1000.0)
    max_steering_angle: float = option(0.0, "with wheelbase in place of turning_radius; 0 is unset", unit="rad",
                                       low=0.0, high=1.57)

    def __post_init__(self):
        convert_options(self)
        if (self.wheelbase > 0) != (self.max_steering_angle > 0):
            raise OptionError(f"wheelbase is {self.wheelbase:g} m and max_steering_angle {self.max_steering_angle:g} rad; "
                              "set both at once, or neither and turning_radius")
        if self.wheelbase > 0:
            self._derive("turning_radius", self.wheelbase / math.tan(self.max_steering_angle))
        if self.footprint:
            self._derive("robot_radius", max(math.hypot(x, y) for x, y in self.outline))

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """The corners of the footprint (x, y) in the vehicle's frame, counter-clockwise [m]; none where the vehicle is a disc."""
        return _corners(self.footprint) if self.footprint else ()

    @property
    def inner_radius(self) -> float:
        """The radius of the largest disc around the reference point that the vehicle covers [m]."""
        if not self.footprint:
            return self.robot_radius
        return _distance_to(self.outline)

    def _derive(self, name: str, value: float) -> None:
        derived = next(item for item in options(Vehicle) if item.name == name)
        object.__setattr__(self, name, derived.convert(value))


@lru_cache(maxsize=64)
def _corners(footprint: str) -> tuple[tuple[float, float], ...]:
    """The corners of a footprint, counter-clockwise.

    Raises:
        OptionError: they are not three or more of two finite numbers each, or not those of a polygon around (0, 0).
    """
    try:
        corners = json.loads(footprint)
    except (ValueError, RecursionError):
        corners = None
    if not (isinstance(corners, list) and 3 <= len(corners) <= MAX_CORNERS and all(map(_is_corner, corners))):
        raise _refused(footprint, f"give at least three corners in metres, {MAX_CORNERS} at most")
    corners = [(float(x), float(y)) for x, y in corners]
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid:
        raise _refused(footprint, "its edges cross or touch; give the corners one after the other along the outline")
    if not polygon.contains(shapely.Point(0, 0)):
        raise _refused(footprint, "the reference point (0, 0) is not inside; give the corners as seen from it")
    return tuple(corners if polygon.exterior.is_ccw else corners[::-1])


@lru_cache(maxsize=64)
def _distance_to(outline: tuple[tuple[float, float], ...]) -> float:
    """How far the reference point is from an outline around it [m]."""
    return float(shapely.distance(shapely.LinearRing(outline), shapely.Point(0, 0)))


def _is_corner(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


def _refused(footprint: str, reason: str) -> OptionError:
    return OptionError(f"footprint is {reprlib.repr(footprint)}; {reason}, such as "
                       "[[1.0, 0.4], [-0.5, 0.4], [-0.5, -0.4], [1.0, -0.4]]")
