"""The audit of a vehicle that leaves a start which is too near to an obstacle, as `start_slack` allows.

The room of a pose is the distance from the vehicle's outline to the nearest obstacle; where obstacles reach into the outline it
is minus the depth to which they do. Until the vehicle is clear for the first time, the room must not fall below that of its
start: the outline, made smaller by as much as it overlaps there, must touch nothing. From there on all is judged as ever.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from ..problem import Problem
from ..text import at
from ..vehicle import Vehicle
from .obstacles import Obstacles, PathsideSquares, PolygonObstacles, obstacles_of
from .sweep import CONTACT, MOST_POINTS, POINT, PRECISION, TOUCH, Arcs, PolygonSweep, clearance_findings, pose_gaps, refine

#: Distance between the poses that are looked at for the first one that is clear [m], and their number in one look.
STEP, AT_ONCE = 0.002, 128
#: Number of times that the interval is halved in which the depth at the start lies.
HALVINGS = 40
#: Number of segments in a quarter of the circles around inner corners of an outline that is made smaller.
QUARTER = 64
#: The corners of a vehicle that is a point, nearly [m].
_DOT = ((1e-9, 0.0), (-1e-9, 1e-9), (-1e-9, -1e-9))


@dataclass(frozen=True)
class Departure:
    """The way of a vehicle out of where it stands too near.

    Attributes:
        findings: what is wrong with it, one sentence each.
        length: length of it [m]; 0 where the start is clear.
        least: the least clearance along it, as in an Audit [m].
    """

    findings: tuple[str, ...]
    length: float
    least: float


def judge_clearance(arcs: Arcs, problem: Problem, obstacles: Obstacles | None, check_time: Callable[[], None]
                    ) -> tuple[list[str], float]:
    """Return what is wrong with the clearance along arcs in the order in which they are driven, and the least clearance [m]."""
    obstacles = obstacles or obstacles_of(problem.map, problem.allow_unknown)
    departure = judge_departure(arcs, problem, obstacles, check_time)
    if departure.findings:
        return list(departure.findings), departure.least
    rest = _parts(arcs, departure.length)[1] if departure.length > 0 else arcs
    findings, least = clearance_findings(rest, problem, obstacles=obstacles, check_time=check_time)
    return findings, min(least, departure.least)


def judge_departure(arcs: Arcs, problem: Problem, obstacles: Obstacles, check_time: Callable[[], None]) -> Departure:
    """Judge the part of arcs up to the first pose at which the vehicle is clear."""
    length = _length_until_clear(arcs, problem, obstacles, check_time)
    if length == 0:
        return Departure((), 0.0, math.inf)
    x, y = float(arcs.x[0]), float(arcs.y[0])
    if length == math.inf:
        return Departure((f"at its start {at((x, y), 3)} the vehicle is too near to an obstacle, and never clear",), 0.0, 0.0)
    leaving, _ = _parts(arcs, length)
    room = start_room(problem, obstacles)
    if room < -problem.start_slack - CONTACT:
        return Departure((f"at {at((x, y), 3)} the start is {-room:.6f} m too near to an obstacle, more than start_slack "
                          f"{problem.start_slack:g} m",), length, 0.0)
    least, place, decided = _least_of_smaller(leaving, problem, obstacles, min(room, 0.0), check_time)
    findings = f"at {at(place, 3)} the vehicle comes nearer to an obstacle than at its start",
    return Departure(() if decided else findings, length, least)


def start_room(problem: Problem, obstacles: Obstacles | None = None) -> float:
    """Return the room at the start [m]."""
    start, vehicle = np.array([problem.start]), problem.vehicle
    obstacles = obstacles or obstacles_of(problem.map, problem.allow_unknown)
    gap = float(pose_gaps(start, problem, obstacles)[0])
    if not vehicle.footprint or gap > 0:
        return gap
    near = _obstacles_near(vehicle, obstacles, start[:, 0] + 1j * start[:, 1], 0.0)
    low, high = 0.0, vehicle.circumscribed_radius  # it is between these
    for _ in range(HALVINGS):
        depth = (low + high) / 2
        corners = _smaller(vehicle.footprint, depth)
        touches = bool(corners) and PolygonSweep(corners, near).clearance(*start.T)[0] <= 0
        low, high = (depth, high) if touches else (low, depth)
    return -high


def _length_until_clear(arcs: Arcs, problem: Problem, obstacles: Obstacles, check_time: Callable[[], None]) -> float:
    """Return the length up to the first pose that is clear [m]; infinite where there is none."""
    vehicle = problem.vehicle
    enough = TOUCH if vehicle.footprint else max(POINT - vehicle.robot_radius, 0.0) - CONTACT
    index, begin, _ = arcs.pieces(STEP)
    along = np.append(0.0, np.cumsum(arcs.length))[index] + begin
    last = len(arcs.length) - 1
    index, begin = np.append(index, last), np.append(begin, arcs.length[last])
    along = np.append(along, arcs.length.sum())
    for first in range(0, len(index), AT_ONCE):
        check_time()
        some = slice(first, first + AT_ONCE)
        gaps = pose_gaps(np.column_stack(arcs.at(index[some], begin[some])), problem, obstacles)
        if (gaps >= enough).any():
            return float(along[some][np.argmax(gaps >= enough)])
    return math.inf


def _least_of_smaller(arcs: Arcs, problem: Problem, obstacles: Obstacles, room: float, check_time: Callable[[], None]
                      ) -> tuple[float, tuple[float, float], bool]:
    """Sweep a vehicle along arcs that is smaller by what it overlaps at the start.

    Returns:
        The least clearance of the vehicle as an audit gives it, where it is, and whether the smaller one touches nothing.
    """
    vehicle = problem.vehicle
    # Smaller by TOUCH too, the clearance that is required of a polygon, of which it may lack CONTACT.
    required = TOUCH if vehicle.footprint else max(vehicle.robot_radius + room, 0.0)
    corners = _smaller(vehicle.footprint, TOUCH - room) if vehicle.footprint else _DOT
    if not corners:  # nothing of it is left
        return 0.0, (float(arcs.x[0]), float(arcs.y[0])), True
    spacing = max(vehicle.circumscribed_radius, PRECISION, float(arcs.length.sum()) / MOST_POINTS)
    x, y, _ = arcs.at(*arcs.pieces(spacing)[:2])
    near = _obstacles_near(vehicle, obstacles, x + 1j * y, spacing)
    least, place, decided = refine(arcs, PolygonSweep(corners, near), required, check_time)
    return 0.0 if vehicle.footprint else least, place, decided and least >= required - CONTACT


def _obstacles_near(vehicle: Vehicle, obstacles: Obstacles, points: np.ndarray, spacing: float
                    ) -> PathsideSquares | PolygonObstacles:
    """Return the obstacles around the vehicle at points along a path, and as far between them."""
    radius = vehicle.circumscribed_radius
    return obstacles.near_path(points, radius + spacing, radius + spacing)


def _smaller(footprint: tuple[tuple[float, float], ...], depth: float) -> tuple[tuple[float, float], ...]:
    """Return the corners of what of a footprint is more than `depth` [m] from its edges; none where that is no polygon."""
    left = shapely.buffer(shapely.Polygon(footprint), -depth, quad_segs=QUARTER)
    if left.geom_type != "Polygon" or left.is_empty:
        return ()
    return tuple((x, y) for x, y in left.exterior.coords[:-1])


def _parts(arcs: Arcs, length: float) -> tuple[Arcs, Arcs]:
    """Cut arcs at an arc length [m]."""
    ends = np.cumsum(arcs.length)
    i = min(int(np.searchsorted(ends, length)), len(ends) - 1)
    s = length - (ends[i] - arcs.length[i])
    x, y, theta = arcs.at(np.array([i]), np.array([s]))
    before = Arcs(*(array[:i + 1].copy() for array in (arcs.x, arcs.y, arcs.theta, arcs.curvature, arcs.length)))
    after = Arcs(*(array[i:].copy() for array in (arcs.x, arcs.y, arcs.theta, arcs.curvature, arcs.length)))
    before.length[-1] = s
    after.x[0], after.y[0], after.theta[0] = x[0], y[0], theta[0]
    after.length[0] -= s
    return before, after
