"""What to plan: map, vehicle, start, goal and what counts as reaching the goal."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from .maps.model import Map
from .option import convert_options, option
from .text import quoted
from .vehicle import Vehicle

Pose = tuple[float, float, float]


#: A yaw beyond this has lost too many digits of its direction to rounding [rad].
LARGEST_YAW = 1e6


class InvalidPose(ValueError):
    """A pose that is none; the message says which and why."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One request to the planner.

    Attributes:
        map: free and occupied space.
        vehicle: turning radius and size.
        start, goal: (x [m], y [m], theta [rad]) in the map's frame.

    Raises:
        InvalidPose: a pose has not three finite numbers.
        OptionError: a tolerance is of the wrong type or out of range.
    """

    map: Map
    vehicle: Vehicle
    start: Pose
    goal: Pose
    goal_tolerance_xy: float = option(0.0, "how far from the goal the path may end; 0 is exactly there", unit="m",
                                      low=0.0, high=1e6)
    goal_tolerance_yaw: float = option(0.0, "how far from the goal's heading the path may end; 0 is exactly so", unit="rad",
                                       low=0.0, high=math.pi)
    any_goal_heading: bool = option(False, "the path may end with any heading")
    allow_unknown: bool = option(False, "the vehicle may drive through unknown space")

    def __post_init__(self):
        convert_options(self)
        object.__setattr__(self, "start", checked_pose("start", self.start))
        object.__setattr__(self, "goal", checked_pose("goal", self.goal))

    @property
    def yaw_tolerance(self) -> float:
        """How far the last heading may be from the goal's [rad]: pi where any will do."""
        return math.pi if self.any_goal_heading else self.goal_tolerance_yaw

    @property
    def exact_goal(self) -> bool:
        """Whether one pose alone is the goal."""
        return self.goal_tolerance_xy == 0 and self.yaw_tolerance == 0


def checked_pose(name: str, pose: Sequence[float]) -> Pose:
    """`pose` as three floats.

    Raises:
        InvalidPose: it has not three finite numbers, or too large a yaw; `name` is in the message.
    """
    try:
        numbers = tuple(map(float, pose))
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise InvalidPose(f"The {name} pose is {quoted(pose)}; give three finite numbers: x [m], y [m], yaw [rad].")
    if abs(numbers[2]) > LARGEST_YAW:
        raise InvalidPose(f"The {name} pose has the yaw {numbers[2]:g} rad; give one within {LARGEST_YAW:g} rad of 0, "
                          "where rounding leaves its direction exact.")
    return numbers
