"""The places that a path over waypoints passes, and the legs between them of a path that is known."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, pairwise
from typing import NamedTuple, overload

import numpy as np

from .curves import dubins
from .curves.angles import SAME, heading_error, position_error, wrap
from .curves.path import Path
from .problem import Pose, Problem, Waypoint

#: Number of headings that are tried at a waypoint, and these.
HEADINGS = 72
_HEADINGS: list[float] = wrap(np.arange(HEADINGS) * (math.tau / HEADINGS)).tolist()


class AnyHeading(Sequence[Pose]):
    """The poses at one place with all HEADINGS, each made when it is asked for: many waypoints have millions."""

    def __init__(self, x: float, y: float):
        self._x, self._y = x, y

    def __len__(self) -> int:
        return HEADINGS

    @overload
    def __getitem__(self, index: int) -> Pose: ...

    @overload
    def __getitem__(self, index: slice) -> list[Pose]: ...

    def __getitem__(self, index: int | slice) -> Pose | list[Pose]:
        if isinstance(index, slice):
            return [(self._x, self._y, heading) for heading in _HEADINGS[index]]
        return self._x, self._y, _HEADINGS[index]


class Stop(NamedTuple):
    """A place that the path passes.

    Attributes:
        poses: one for each heading with which the vehicle may pass it.
        waypoints: indices of the waypoints that are there; none at the start and at the goal, unless they are waypoints too.
    """

    poses: Sequence[Pose]
    waypoints: tuple[int, ...]

    def is_passed_at(self, pose: Pose) -> bool:
        """Return True if a pose is at this place, with one of its headings where it has few."""
        if position_error(pose, self.poses[0]) > SAME:
            return False
        return len(self.poses) > 1 or heading_error(pose, self.poses[0]) <= SAME

    def with_pose(self, pose: Pose) -> "Stop":
        """Return the place with one more heading, unless it has that or takes but one."""
        return self if len(self.poses) == 1 or pose in self.poses else self._replace(poses=[*self.poses, pose])


def stops_of(problem: Problem, waypoints: Iterable[Waypoint]) -> Iterator[Stop]:
    """Yield start, waypoints and goal; those at one place are one stop if one heading fits all."""
    here: Waypoint = problem.start
    indices: list[int] = []
    goal = (*problem.goal[:2], None if problem.any_goal_heading else problem.goal[2])
    for index, there in chain(enumerate(waypoints), [(None, goal)]):
        both = _common(here, there)
        if both is None:
            yield Stop(_poses(here), tuple(indices))
            indices = []
        here = both or there
        if index is not None:
            indices.append(index)
    yield Stop(_poses(here), tuple(indices))


def _common(here: Waypoint, there: Waypoint) -> Waypoint | None:
    """Return the waypoint that is both at once, or None where they differ."""
    (x, y, theta), (_, _, other) = here, there
    if position_error((x, y, 0.0), (*there[:2], 0.0)) > SAME:
        return None
    if theta is None or other is None:
        return x, y, other if theta is None else theta
    return here if heading_error((x, y, theta), (x, y, other)) <= SAME else None


def _poses(place: Waypoint) -> Sequence[Pose]:
    """Return the poses with which a waypoint may be passed."""
    x, y, theta = place
    return AnyHeading(x, y) if theta is None else [(x, y, theta)]


def least_length(problem: Problem, waypoints: Sequence[Waypoint], proved: Mapping[tuple[Waypoint, Waypoint], float]) -> float:
    """Return a length that no path over the waypoints falls below [m].

    Args:
        proved: lengths that paths between two places, of which the first has a heading, do not fall below [m].
    """
    radius = problem.vehicle.turning_radius
    bounds = [max(proved.get((here, there), 0.0), math.dist(here[:2], there[:2]) if here[2] is None or there[2] is None
                  else dubins.shortest((*here[:2], here[2]), (*there[:2], there[2]), radius).length)
              for here, there in pairwise((problem.start, *waypoints, last_place(problem)))]
    return max(0.0, math.fsum(bounds) * (1 - SAME) - problem.goal_tolerance_xy)


def last_place(problem: Problem) -> Waypoint:
    """Return the goal, without a heading where that has a tolerance."""
    return (*problem.goal[:2], problem.goal[2] if problem.yaw_tolerance == 0 else None)


def legs_along(path: Path, stops: Sequence[Stop]) -> list[Path] | None:
    """Return the parts of a path from each stop to the next; None where it does not pass all in their order."""
    joints = [(x, y, theta) for x, y, theta in path.waypoints.tolist()]
    passed = [0]
    for stop in stops[1:-1]:
        at = next((n for n in range(passed[-1], len(joints)) if stop.is_passed_at(joints[n])), None)
        if at is None:
            return None
        passed.append(at)
    return [path.part(begin, end) for begin, end in pairwise([*passed, len(joints) - 1])]


def passing_indices(stops: Sequence[Stop], paths: Sequence[Path], poses: np.ndarray) -> Iterator[int]:
    """Yield the index among the poses of a path at which it passes each waypoint."""
    at, ends = 0, [paths[0].start, *(path.end for path in paths)]
    for stop, end in zip(stops, ends, strict=True):
        at += int(np.argmax((poses[at:] == end).all(axis=1)))
        yield from [at] * len(stop.waypoints)
