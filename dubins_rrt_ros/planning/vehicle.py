"""The vehicle: its turning radius, and the space that it covers."""

import json
import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import shapely

from .option import Assumed, OptionError, TextForm, convert_options, documented, is_number, option, options
from .text import quoted

#: A point (x, y) [m].
Point = tuple[float, float]
#: The corners of a polygon in the vehicle's frame, whose origin is the reference point.
Footprint = tuple[Point, ...]

#: Maximum number of corners of a footprint.
MAX_CORNERS = 100
#: The text of a corner, and that of an outline: as in JSON and in Nav2's parameters, with .3, 3. and a comma at the end.
_NUMBER = r"\s*([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*"
_CORNER = re.compile(rf"\[{_NUMBER},{_NUMBER}(?:,\s*)?\]", re.ASCII)
_OUTLINE = re.compile(rf"\s*\[\s*(?:{_CORNER.pattern}\s*,\s*)*(?:{_CORNER.pattern}\s*)?\]\s*", re.ASCII)


class DoubtfulVehicle(UserWarning):
    """A warning: a size of a vehicle that has no effect, as another one takes its place."""


#: Options that others may take the place of, and their defaults [m].
RADII = ("turning_radius", "robot_radius")
TURNING_RADIUS, ROBOT_RADIUS = Assumed(1.0), Assumed(0.2)
#: Options that take the place of others.
OVERRIDING = {"footprint": "robot_radius", "wheelbase": "turning_radius", "any_goal_heading": "goal_tolerance_yaw"}


def overridden(given: Mapping[str, Any]) -> dict[str, str]:
    """Return which of the options that were given have no effect, each with the given one that takes its place."""
    return {name: by for by, name in OVERRIDING.items() if name in given and _is_set(given.get(by))}


def without_overridden(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that were given but for those in whose place another one is used."""
    dropped = overridden(given)
    return {name: value for name, value in given.items() if name not in dropped}


def _is_set(value: Any) -> bool:
    """Return False for a wheelbase of 0, for false, and for the text of a footprint without corners."""
    return bool(value.strip(" \t\r\n[]") if isinstance(value, str) else value)


def _read_footprint(value: Any) -> Footprint:
    """Return the corners of a footprint, counter-clockwise; none for an empty one.

    Raises:
        OptionError: they are not three or more of two finite numbers each, or not those of a polygon.
    """
    if isinstance(value, str):
        return _read_footprint_text(value)
    corners = _as_list(value)
    return _checked_corners([_as_list(corner) for corner in corners] if isinstance(corners, list) else None, value)


def _as_list(value: Any) -> Any:
    """Return a sequence or an array as a list, and anything else as it is."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, list | tuple) else value


@lru_cache(maxsize=64)
def _read_footprint_text(text: str) -> Footprint:
    if not text.strip():
        return ()
    is_outline = text.count("[") <= MAX_CORNERS + 1 and _OUTLINE.fullmatch(text)
    return _checked_corners([list(map(float, corner)) for corner in _CORNER.findall(text)] if is_outline else None, text)


def _checked_corners(given: list[Any] | None, value: Any) -> Footprint:
    """Return corners as a polygon has them, counter-clockwise; `value` is what messages show."""
    if given == []:
        return ()
    if not (given and 3 <= len(given) <= MAX_CORNERS and all(map(_is_corner, given))):
        raise _refused(value, f"give at least three corners in metres, {MAX_CORNERS} at most")
    corners = tuple((float(x), float(y)) for x, y in given)
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid:
        raise _refused(value, "its edges cross or touch; give the corners one after the other along the outline")
    return corners if polygon.exterior.is_ccw else corners[::-1]


def _is_corner(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


def _refused(value: Any, reason: str) -> OptionError:
    return OptionError(f"footprint is {quoted(value)}; {reason}, such as "
                       "[[1.0, 0.4], [-0.5, 0.4], [-0.5, -0.4], [1.0, -0.4]]")


def _footprint_text(footprint: Footprint) -> str:
    return json.dumps(footprint) if footprint else ""


@documented
@dataclass(frozen=True)
class Vehicle:
    """A Dubins car: it drives forward only and turns no tighter than `turning_radius`; seen from above it is a disc or a polygon.

    A `footprint`, where there is one, is the polygon: its corners (x, y) [m] in the vehicle's frame, whose origin is the
    reference point and whose x axis points ahead; `robot_radius` is then derived from it. It may be given as text,
    "[[x, y], ...]", too, and is held counter-clockwise. Where it covers no disc around the reference point, such as a trailer's
    hitch, lower bounds are those without obstacles, and it is not proved that there is no path. A `wheelbase` L and a
    `max_steering_angle` phi, set together, determine the turning radius, L / tan(phi) (the paper's equation 1). `from_footprint`
    and `from_wheelbase` say so by their names. A radius that is given beside what it is derived from has no effect, of which a
    `UserWarning` tells. What `dataclasses.replace` keeps of another vehicle was not given: a radius is derived anew, and stays
    where there is nothing any more that it is derived from.

    Raises:
        OptionError: an option is of the wrong type or out of range, the footprint is no polygon, or one of
            wheelbase and steering angle is missing.
    """

    turning_radius: float = option(TURNING_RADIUS, "minimum turning radius", unit="m", low=0.001, high=10_000.0)
    robot_radius: float = option(ROBOT_RADIUS, "radius of the disc around the reference point that covers the vehicle",
                                 unit="m", low=0.0, high=1000.0)
    footprint: tuple[Point, ...] = option(
        (), "corners of the vehicle's outline as seen from its reference point, x ahead: [[x, y], ...] in m, in place of "
        "robot_radius; empty is unset", text_form=TextForm(_read_footprint, _footprint_text))
    wheelbase: float = option(0.0, "wheelbase, with max_steering_angle in place of turning_radius; 0 is unset", unit="m",
                              low=0.0, high=1000.0)
    max_steering_angle: float = option(0.0, "maximum steering angle, with wheelbase in place of turning_radius; 0 is unset",
                                       unit="rad", low=0.0, high=1.57)
    #: The radii of the vehicle of which `dataclasses.replace` makes this one, and which it hands on as if they were given.
    _before: InitVar[Mapping[str, float] | None] = field(default=None, kw_only=True)

    def __post_init__(self, _before: Mapping[str, float] | None) -> None:
        given = {name for name in RADII if not isinstance(getattr(self, name), Assumed)}
        convert_options(self)
        given -= {name for name, radius in (_before or {}).items() if getattr(self, name) == radius}
        if (self.wheelbase > 0) != (self.max_steering_angle > 0):
            raise OptionError(f"wheelbase is {self.wheelbase:g} m and max_steering_angle {self.max_steering_angle:g} rad; "
                              "set both at once, or neither and turning_radius")
        if self.wheelbase > 0:
            self._derive("wheelbase", self.wheelbase / math.tan(self.max_steering_angle), f"wheelbase {self.wheelbase:g} m "
                         f"and max_steering_angle {self.max_steering_angle:g} rad make a turning radius of", given)
        if self.footprint:
            farthest = max(math.hypot(x, y) for x, y in self.footprint)
            self._derive("footprint", farthest, "footprint has its farthest corner at", given)
        object.__setattr__(self, "_before", {name: getattr(self, name) for name in RADII})

    @classmethod
    def from_wheelbase(cls, wheelbase: float, max_steering_angle: float, *, robot_radius: float = ROBOT_RADIUS,
                       footprint: Sequence[Point] | str = ()) -> "Vehicle":
        """Make a car whose turning radius is wheelbase / tan(max_steering_angle) [m, rad].

        Raises:
            OptionError: as the constructor does; also where the wheelbase or the angle is 0.
        """
        if not (wheelbase and max_steering_angle):
            raise OptionError(f"wheelbase is {wheelbase} m and max_steering_angle {max_steering_angle} rad; give both above 0")
        return cls(robot_radius=robot_radius, footprint=_read_footprint(footprint), wheelbase=wheelbase,
                   max_steering_angle=max_steering_angle)

    @classmethod
    def from_footprint(cls, footprint: Sequence[Point] | str, *, turning_radius: float = TURNING_RADIUS) -> "Vehicle":
        """Make a car whose outline is a polygon with these corners (x, y) [m].

        Raises:
            OptionError: as the constructor does; also where there are no corners.
        """
        corners = _read_footprint(footprint)
        if not corners:
            raise _refused(footprint, f"give at least three corners in metres, {MAX_CORNERS} at most")
        return cls(turning_radius=turning_radius, footprint=corners)

    @property
    def circumscribed_radius(self) -> float:
        """The radius of the smallest disc around the reference point that covers the vehicle [m]."""
        return self.robot_radius

    @cached_property
    def inscribed_radius(self) -> float:
        """The radius of the largest disc around the reference point that the vehicle covers, 0 where there is none [m]."""
        if not self.footprint:
            return self.robot_radius
        outline, reference_point = shapely.Polygon(self.footprint), shapely.Point(0, 0)
        return float(outline.exterior.distance(reference_point)) if outline.contains(reference_point) else 0.0

    @property
    def required_clearance(self) -> float:
        """The clearance that the reference point needs wherever the vehicle is free [m].

        It is the inscribed radius; minus infinity where the reference point is on the edge of the footprint or outside of it.
        """
        return -math.inf if self.footprint and self.inscribed_radius == 0 else self.inscribed_radius

    @property
    def maneuver_scale(self) -> float:
        """The length that manoeuvres are measured in [m].

        It is the turning radius, but twice the inscribed radius for a vehicle that nearly turns on the spot: on a smaller scale
        than its own no obstacle looks different to it.
        """
        inscribed = self.inscribed_radius
        return self.turning_radius if self.turning_radius >= inscribed else 2 * inscribed

    def _derive(self, by: str, value: float, what: str, given: set[str]) -> None:
        """Set the radius in whose place another option is used; warn of another one that was given."""
        derived = next(item for item in options(Vehicle) if item.name == OVERRIDING[by])
        present = getattr(self, derived.name)
        try:
            object.__setattr__(self, derived.name, derived.convert(value))
        except OptionError:
            raise OptionError(f"{what} {value:.6g} m; that may be {derived.allowed()}") from None
        if derived.name in given and not math.isclose(present, value):
            warnings.warn(f"{derived.name} {present:g} m has no effect, as {by} takes its place: it is {value:.6g} m",
                          DoubtfulVehicle, stacklevel=4)  # of the call of the constructor, which a dataclass writes
