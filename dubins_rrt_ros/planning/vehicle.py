"""The vehicle: how tightly it turns and how much room it takes."""

import math
from dataclasses import dataclass

from .options import OptionError, convert_options, option, options


@dataclass(frozen=True)
class Vehicle:
    """A Dubins car: it drives forward only and turns no tighter than `turning_radius`; seen from above it is a disc.

    `wheelbase` L and `max_steering_angle` phi, where both are set, determine the turning radius, L / tan(phi) (the
    paper's equation 1).

    Raises:
        OptionError: a field is of the wrong type or out of range, or one of wheelbase and steering angle is missing.
    """

    turning_radius: float = option(1.0, "the least turning radius", unit="m", low=0.001, high=10_000.0)
    robot_radius: float = option(0.2, "the radius of the disc that covers the vehicle around its reference point",
                                 unit="m", low=0.0, high=1000.0)
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
            derived = next(item for item in options(Vehicle) if item.name == "turning_radius")
            object.__setattr__(self, "turning_radius", derived.convert(self.wheelbase / math.tan(self.max_steering_angle)))
