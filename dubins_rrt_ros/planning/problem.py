"""The request to the planner: map, vehicle, start, goal and what counts as reaching the goal."""

import math
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from .errors import PlanningError
from .hooks import IsFree, check_function
from .maps.frame import LARGEST_YAW, DoubtfulYaw, doubt_about_yaw
from .maps.model import GridMap, Map, PolygonMap
from .option import OptionError, convert_options, documented, option, own_floats
from .text import quoted
from .vehicle import Vehicle

#: Minimum spacing of poses that show a path in detail [m].
MIN_FINE_SPACING = 0.01

Pose = tuple[float, float, float]
#: A pose to be passed, or a place, with None for the heading, that is passed with any.
Waypoint = tuple[float, float, float | None]


class InvalidPose(PlanningError, ValueError):
    """A pose that is none; the message says which and why."""


class PreparedMap(Protocol):
    """The part of a `World` that a problem needs."""

    @property
    def map(self) -> Map:
        """The map."""

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle that the map is prepared for."""

    @property
    def allow_unknown(self) -> bool:
        """True if unknown space counts as free."""


@documented
@dataclass(frozen=True, eq=False, init=False)
class Problem:
    """One request to the planner: `Problem(map, vehicle, start, goal)`, or `Problem(world, start=..., goal=...)`.

    Attributes:
        map: free and occupied space.
        vehicle: turning radius and size.
        start, goal: (x [m], y [m], theta [rad]) in the map's frame.
        world: the map as `prepare` made it ready for the vehicle, or None: then plan() does that first.
        is_free: a test of yours for obstacles that the map does not have, or None: `is_free(poses)` gives a bool for each of
            (n, 3) poses. It is asked at poses at most `fine_spacing` apart, holds there along the path, and is slow.

    Raises:
        HookError: is_free is no function.
        InvalidPose: a pose has not three finite numbers.
        OptionError: a tolerance is of the wrong type or out of range, or the world is prepared for something else.
    """

    map: Map
    vehicle: Vehicle
    start: Pose
    goal: Pose
    goal_tolerance_xy: float = option(0.0, "maximum distance from the goal at the end of the path, which leads to the free pose "
                                      "nearest to the goal; 0 requires the exact position", unit="m", low=0.0, high=1e6)
    goal_tolerance_yaw: float = option(0.0, "maximum heading error at the end of the path; 0 requires the exact heading",
                                       unit="rad", low=0.0, high=math.pi)
    any_goal_heading: bool = option(False, "accept any heading at the goal")
    allow_unknown: bool = option(False, "treat unknown space as free")
    start_slack: float = option(0.0, "how much nearer than allowed to an obstacle the vehicle may stand at its start, if it can "
                                "leave without coming any nearer", unit="m", low=0.0, high=1000.0)
    world: PreparedMap | None = field(default=None, repr=False)
    is_free: IsFree | None = None

    def __init__(self, map: Map | PreparedMap, vehicle: Vehicle | None = None,  # noqa: A002 - a public name
                 start: Sequence[float] = (), goal: Sequence[float] = (), goal_tolerance_xy: float = 0.0,
                 goal_tolerance_yaw: float = 0.0, any_goal_heading: bool = False, allow_unknown: bool = False,
                 start_slack: float = 0.0, world: PreparedMap | None = None, is_free: IsFree | None = None):
        """Take `map` and `vehicle`, or a World in their place; a `world` that is not of just these is left out."""
        if not isinstance(map, GridMap | PolygonMap):
            if not hasattr(map, "vehicle") or not hasattr(map, "map"):
                raise TypeError(f"the map is {quoted(map)}; give a GridMap, a PolygonMap or a World; load_map reads files")
            _check_fit(map, vehicle, allow_unknown)
            world = map
            map, vehicle, allow_unknown = world.map, world.vehicle, world.allow_unknown  # noqa: A001
        if not isinstance(vehicle, Vehicle):
            raise TypeError(f"the vehicle is {quoted(vehicle)}; give a Vehicle, or a World in place of map and vehicle")
        if world is not None and (world.map, world.vehicle, world.allow_unknown) != (map, vehicle, allow_unknown):
            world = None
        given = {"map": map, "vehicle": vehicle, "start": checked_pose("start", start), "goal": checked_pose("goal", goal),
                 "goal_tolerance_xy": goal_tolerance_xy, "goal_tolerance_yaw": goal_tolerance_yaw,
                 "any_goal_heading": any_goal_heading, "allow_unknown": allow_unknown,
                 "start_slack": start_slack, "world": world, "is_free": is_free}
        check_function("is_free", is_free)
        for name, value in given.items():
            object.__setattr__(self, name, value)
        convert_options(self)
        for name, pose in (("start", self.start), ("goal", self.goal)):
            if doubt := doubt_about_yaw(pose[2]):
                warnings.warn(f"the {name} pose has {doubt}", DoubtfulYaw, stacklevel=2)

    @property
    def yaw_tolerance(self) -> float:
        """The maximum heading error at the goal [rad]: pi where any heading will do."""
        return math.pi if self.any_goal_heading else self.goal_tolerance_yaw

    @property
    def exact_goal(self) -> bool:
        """True if one pose alone is the goal."""
        return self.goal_tolerance_xy == 0 and self.yaw_tolerance == 0

    @property
    def fine_spacing(self) -> float:
        """The spacing of poses that show a path in detail [m].

        The smaller of a cell, or of a polygon map a quarter of the inscribed radius, and a tenth of the turning radius; at least
        0.01 m.
        """
        detail = self.map.resolution if isinstance(self.map, GridMap) else self.vehicle.inscribed_radius / 4
        return max(MIN_FINE_SPACING, min(detail, self.vehicle.turning_radius / 10))


def _check_fit(world: PreparedMap, vehicle: Vehicle | None, allow_unknown: bool) -> None:
    if vehicle is not None and vehicle != world.vehicle:
        raise OptionError("the world is prepared for another vehicle; leave the vehicle out, or give world.for_vehicle(vehicle)")
    if allow_unknown and not world.allow_unknown:
        raise OptionError("allow_unknown is true, but the world is prepared without it; prepare one with allow_unknown=True")


def checked_pose(name: str, pose: Sequence[float]) -> Pose:
    """Return a pose as three floats.

    Raises:
        InvalidPose: it has not three finite numbers, or too large a yaw; `name` is in the message.
    """
    try:
        numbers = own_floats(pose)
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise InvalidPose(f"The {name} pose is {quoted(pose)}; give three finite numbers: x [m], y [m], yaw [rad].")
    if abs(numbers[2]) > LARGEST_YAW:
        raise InvalidPose(f"The {name} pose has the yaw {numbers[2]:g} rad; give one within {LARGEST_YAW:g} rad of 0, "
                          "where rounding leaves its direction exact.")
    return numbers


def checked_waypoint(name: str, waypoint: Any) -> Waypoint:
    """Return a waypoint, (x, y, theta), or (x, y, None) or (x, y) where any heading will do.

    Raises:
        InvalidPose: as `checked_pose` does.
    """
    numbers = tuple(waypoint) if isinstance(waypoint, Iterable) else ()
    if len(numbers) == 2 or (len(numbers) == 3 and numbers[2] is None):
        x, y, _ = checked_pose(name, (*numbers[:2], 0.0))
        return x, y, None
    return checked_pose(name, waypoint)


def checked_waypoints(waypoints: Any) -> tuple[Waypoint, ...]:
    """Return waypoints, each named by its number from 1 on where it is none.

    Raises:
        InvalidPose: as `checked_pose` does.
        TypeError: they are no list.
    """
    if not isinstance(waypoints, Iterable):
        raise TypeError(f"the waypoints are {quoted(waypoints)}; give a list of poses")
    return tuple(checked_waypoint(f"waypoint {number}", waypoint) for number, waypoint in enumerate(waypoints, 1))


def demand_problem(problem: object) -> Problem:
    """Return a problem.

    Raises:
        TypeError: it is none.
    """
    if not isinstance(problem, Problem):
        raise TypeError(f"the problem is {quoted(problem)}; give a Problem")
    return problem
