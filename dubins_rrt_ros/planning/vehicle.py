"""The vehicle: how tightly it turns and how much room it takes."""

import json
import math
import reprlib
from dataclasses import dataclass

from .options import OptionError, convert_options, option, options


@dataclass(frozen=True)
class Vehicle:
    """A Dubins car: it drives forward only and turns no tighter than `turning_radius`; seen from above it is a disc.

    `footprint`, where it is set, determines the disc: the one around the reference point that covers the outline.
    `wheelbase` L and `max_steering_angle` phi, where both are set, determine the turning radius, L / tan(phi) (the
    paper's equation 1).

    Raises:
        OptionError: a field is of the wrong type or out of range, the footprint is no outline, or one of wheelbase and
            steering angle is missing.
    """

    turning_radius: float = option(1.0, "the least turning radius", unit="m", low=0.001, high=10_000.0)
    robot_radius: float = option(0.2, "the radius of the disc that covers the vehicle around its reference point",
                                 unit="m", low=0.0, high=1000.0)
    footprint: str = option("", "the vehicle's outline around its reference point, [[x, y], ...] in m, in place of robot_radius, "
                                "which becomes that of the disc that covers it; empty is unset")
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
            self._derive("robot_radius", max(math.hypot(x, y) for x, y in _outline(self.footprint)))

    def _derive(self, name: str, value: float) -> None:
        derived = next(item for item in options(Vehicle) if item.name == name)
        object.__setattr__(self, name, derived.convert(value))


def _outline(footprint: str) -> list[tuple[float, float]]:
    """The corners of a footprint.

    Raises:
        OptionError: it has not three corners or more, of two finite numbers each.
    """
    try:
        corners = [(float(x), float(y)) for x, y in json.loads(footprint)]
    except (ValueError, TypeError, RecursionError):
        corners = []
    if len(corners) < 3 or not all(map(math.isfinite, sum(corners, ()))):
        raise OptionError(f"footprint is {reprlib.repr(footprint)}; give at least three corners in metres, such as "
                          "[[1.0, 0.4], [1.0, -0.4], [-0.5, -0.4], [-0.5, 0.4]]")
    return corners
