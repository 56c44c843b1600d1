"""Why there is no path: a sentence for a person, with the measured figures, what to change, and the point that shows it."""

import math
from dataclasses import dataclass

import numpy as np
import shapely

from ..collision.clearance import MARGIN, ClearanceField
from ..maps.model import GridMap, Map
from ..problem import Pose, Problem
from ..result import Status
from ..search.tree import Tree
from ..vehicle import Vehicle
from .bounds import (
    ROUNDING,
    Point,
    Way,
    are_separated,
    are_walled_off,
    avoids_unknown,
    has_no_room,
    lattice_spacing,
    nearest_in_map,
    widest_way,
    widest_way_through_unknown,
)

#: The arcs that are tried to leave the start: their curvatures in the least turning radius.
CURVATURES = np.linspace(-1, 1, 33)
#: So many steps at most are taken along them.
MOST_STEPS = 2000
#: So many points across a footprint, and along each of its edges, tell where it touches something.
POINTS = 33
#: What an obstacle can be.
OBSTACLE, UNKNOWN_SPACE, MAP_EDGE = "obstacle", "unknown space", "the map's edge"


@dataclass(frozen=True)
class Diagnosis:
    """Why there is no path.

    Attributes:
        status: what a plan without a path says.
        message: one sentence.
        location: (x, y) of what shows it [m], or None.
    """

    status: Status
    message: str
    location: Point | None = None


def before_search(problem: Problem, field: ClearanceField) -> Diagnosis | None:
    """Why there provably is no path, where no search is needed to know it."""
    for name, pose, tolerance, outside, occupied in (
            ("Start", problem.start, 0.0, Status.START_OUTSIDE_MAP, Status.START_OCCUPIED),
            ("Goal", problem.goal, problem.goal_tolerance_xy, Status.GOAL_OUTSIDE_MAP, Status.GOAL_OCCUPIED)):
        nearest = nearest_in_map(problem.map, pose[:2])
        away = math.dist(pose[:2], nearest)
        if away > tolerance + ROUNDING or has_no_room(field, problem.vehicle.inscribed_radius + MARGIN, pose[:2], tolerance):
            if away > ROUNDING:
                return Diagnosis(outside, _outside_message(problem, name, pose, tolerance, nearest), nearest)
            return Diagnosis(occupied, *_occupied(problem, field, name, pose[:2], tolerance))
        is_one_pose = pose is problem.start or problem.exact_goal
        if problem.vehicle.footprint and is_one_pose and not field.pose_is_free(pose, problem.vehicle):
            return Diagnosis(occupied, *_overlapping(problem, field, name, pose))
    if are_separated(problem, field):
        between, location = _unknown_between(problem, field) or _narrow_between(problem, field, widest_way(problem, field))
        return Diagnosis(Status.NO_VALID_PATH, f"No path exists: {between}.", location)
    return None


def after_search(problem: Problem, field: ClearanceField, tree: Tree, more: str) -> tuple[str, Point | None]:
    """What kept a search from finding a path, as the end of a sentence, and the location.

    Args:
        tree: what was grown.
        more: what could be allowed: "samples" or "time".
    """
    radius = problem.vehicle.turning_radius
    if math.dist(problem.start[:2], problem.goal[:2]) < radius / 10:
        return ("the goal is so close to the start that a vehicle that cannot turn on the spot has to drive a full loop to it; "
                f"set goal_tolerance_xy and goal_tolerance_yaw if it is close enough, or allow more {more}"), None
    stuck = _all_arcs_hit(problem, field, problem.start)
    if stuck and _distances(tree, problem.start).max() <= 2 * stuck[0]:
        return (f"every forward arc from the start hits an obstacle within {_rounded_up(stuck[0])} m, the longest at "
                f"{_at(stuck[1])}; move or turn the start, or check turning_radius ({radius:g} m)"), stuck[1]
    x, y, theta = problem.goal
    stuck = _all_arcs_hit(problem, field, (x, y, theta + math.pi)) if problem.exact_goal else None
    if stuck:
        return ("no forward arc reaches the goal: every one that ends there comes through an obstacle within the last "
                f"{_rounded_up(stuck[0])} m, the longest at {_at(stuck[1])}; move or turn the goal, or check turning_radius "
                f"({radius:g} m)"), stuck[1]
    way = widest_way(problem, field)
    if way is None or way.radius < problem.vehicle.inscribed_radius:
        return _unknown_between(problem, field) or _narrow_between(problem, field, way)
    if len(tree) == 1:
        return f"no curve of the turning radius {radius:g} m left the start; set step_size, or allow more {more}", None
    near = float(_distances(tree, problem.goal).min())
    return f"the tree came within {_rounded_up(near)} m of the goal; allow more {more}, or loosen the goal's tolerance", None


def nearest_obstacle(map: Map, allow_unknown: bool, point: Point, clearance: float) -> tuple[Point, str]:
    """The nearest point of the obstacles around a point of the map, and what it belongs to.

    Args:
        clearance: the distance to it [m].

    Returns:
        (x, y), and OBSTACLE, UNKNOWN_SPACE or MAP_EDGE.
    """
    on_edge = _nearest_on(shapely.LinearRing(map.corners()), point)
    if isinstance(map, GridMap):
        found, what = _nearest_cell(map.window(point, clearance), allow_unknown, point)
    else:
        found, what = _nearest_on(shapely.boundary(map.free), point) if clearance > 0 else point, OBSTACLE
    if found is None or math.dist(on_edge, point) <= math.dist(found, point) + ROUNDING:
        return on_edge, MAP_EDGE
    return found, what


def _nearest_cell(grid: GridMap, allow_unknown: bool, point: Point) -> tuple[Point | None, str]:
    """The nearest point of the squares of the blocked cells, if there are any, and what that one is."""
    rows, columns = np.nonzero(grid.blocked(allow_unknown))
    if len(rows) == 0:
        return None, ""
    here = grid.to_grid_frame(np.array(point))
    lowest = np.column_stack([columns, rows]) * grid.resolution
    nearest = np.clip(here, lowest, lowest + grid.resolution)
    away = np.hypot(*(nearest - here).T)
    first = np.argmin(away)
    is_obstacle = grid.blocked(True)[rows, columns] & (away <= away[first] + ROUNDING)
    first = np.argmax(is_obstacle) if is_obstacle.any() else first
    return tuple(grid.to_map_frame(nearest[first]).tolist()), OBSTACLE if is_obstacle.any() else UNKNOWN_SPACE


def _nearest_on(line: shapely.Geometry, point: Point) -> Point:
    x, y = shapely.get_coordinates(shapely.shortest_line(line, shapely.Point(point)))[0]
    return float(x), float(y)


def _outside_message(problem: Problem, name: str, pose: Pose, tolerance: float, nearest: Point) -> str:
    corners = problem.map.corners()
    low, high = corners.min(axis=0), corners.max(axis=0)
    yaw = problem.map.origin[2] if isinstance(problem.map, GridMap) else 0.0
    if yaw == 0:
        spans = f"spans x {low[0]:.2f} to {high[0]:.2f} m and y {low[1]:.2f} to {high[1]:.2f} m"
    else:
        width, height = problem.map.size
        spans = f"spans {width:.2f} m x {height:.2f} m from its corner {_at(corners[0])} on, turned by {yaw:.3g} rad"
    reach = f", and goal_tolerance_xy {tolerance:g} m reaches no place with room enough in it" if tolerance else ""
    return (f"{name} ({pose[0]:.6g}, {pose[1]:.6g}) is {_metres(math.dist(pose[:2], nearest))} m outside the map, which {spans}"
            f"{reach}; check the pose and its frame.")


def _occupied(problem: Problem, field: ClearanceField, name: str, point: Point, tolerance: float) -> tuple[str, Point]:
    """The sentence on a pose without room, and the nearest obstacle."""
    need = problem.vehicle.inscribed_radius + MARGIN
    clearance = float(field.at(np.array(point)))
    nearest, what = nearest_obstacle(problem.map, problem.allow_unknown, point, clearance)
    found, needed = _told_apart(clearance, need)
    message = f"{name} is occupied: clearance {found} m, needed {needed} m"
    if tolerance:
        message += f", which no place within goal_tolerance_xy {tolerance:g} m has"
    if what == UNKNOWN_SPACE:
        opened = ClearanceField(problem.map.window(point, 2 * (tolerance + need)), allow_unknown=True)
        if not has_no_room(opened, need, point, tolerance):
            where = f"only unknown space is that near, at {_at(nearest)}" if clearance > 0 else f"{_at(point)} lies in {what}"
            return f"{message}; {where}: drive there to map it, or set allow_unknown.", nearest
    if clearance == 0 and what != MAP_EDGE:
        return f"{message}; {_at(point)} lies in {'an obstacle' if what == OBSTACLE else what}; move it.", nearest
    where = f"nearest obstacle {'' if what == OBSTACLE else f'is {what} '}at {_at(nearest)}"
    return f"{message}; {where}; move it, or {_smaller(problem.vehicle)}.", nearest


def _overlapping(problem: Problem, field: ClearanceField, name: str, pose: Pose) -> tuple[str, Point]:
    """The sentence on a pose at which the footprint touches something, and where."""
    points = _points_of(problem.vehicle, pose)
    clearance = field.at(points)
    worst = tuple(points[np.argmin(clearance)].tolist())
    nearest, what = nearest_in_map(problem.map, worst), MAP_EDGE
    if math.dist(nearest, worst) <= ROUNDING:
        nearest, what = nearest_obstacle(problem.map, problem.allow_unknown, worst, float(clearance.min()))
    message = f"{name} is occupied: the footprint touches {'an ' if what == OBSTACLE else ''}{what} at {_at(nearest)}"
    if what == UNKNOWN_SPACE:
        around = problem.map.window(pose[:2], 2 * problem.vehicle.robot_radius)
        if ClearanceField(around, allow_unknown=True).pose_is_free(pose, problem.vehicle):
            return f"{message}: drive there to map it, or set allow_unknown.", nearest
    return f"{message}; move or turn it, or {_smaller(problem.vehicle)}.", nearest


def _points_of(vehicle: Vehicle, pose: Pose) -> np.ndarray:
    """(n, 2) points all over the footprint at a pose, its corners among them; for a disc, its centre."""
    if not vehicle.footprint:
        return np.array([pose[:2]])
    corners = np.array(vehicle.footprint)
    axes = [np.linspace(low, high, POINTS) for low, high in zip(corners.min(axis=0), corners.max(axis=0), strict=True)]
    lattice = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    inside = lattice[shapely.contains_xy(shapely.Polygon(corners), lattice)]
    edges = corners + np.linspace(0, 1, POINTS)[:, None, None] * (np.roll(corners, -1, axis=0) - corners)
    x, y = np.concatenate([inside, edges.reshape(-1, 2)]).T
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.column_stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y])


def _smaller(vehicle: Vehicle) -> str:
    """What may help where there is too little room."""
    return f"make {_parameter(vehicle)} smaller if the robot is"


def _parameter(vehicle: Vehicle) -> str:
    """What says how much room the vehicle takes."""
    return "footprint" if vehicle.footprint else "robot_radius"


def _size(vehicle: Vehicle) -> str:
    """What takes room all around the reference point."""
    if vehicle.footprint:
        return f"a footprint that is {2 * vehicle.inscribed_radius:.3g} m wide or more everywhere around its reference point"
    return f"robot_radius {vehicle.robot_radius:g} m"


def _unknown_between(problem: Problem, field: ClearanceField) -> tuple[str, Point] | None:
    """A clause that says that start and goal are separated by unknown space, if they are, and where it begins."""
    way = widest_way_through_unknown(problem)
    if way is None:
        return None
    clearance = field.at(way.points)
    first = int(np.argmax(clearance < problem.vehicle.inscribed_radius + MARGIN))
    begins, _ = nearest_obstacle(problem.map, False, tuple(way.points[first].tolist()), float(clearance[first]))
    return (f"unknown space separates start and goal for {_size(problem.vehicle)}; on the way between them "
            f"it begins at {_at(begins)}; drive there to map it, or set allow_unknown"), begins


def _narrow_between(problem: Problem, field: ClearanceField, way: Way | None) -> tuple[str, Point | None]:
    """A clause that says that start and goal are separated by walls, or joined by too narrow a place, and where that is.

    Args:
        way: the widest one between them, if there is one.
    """
    vehicle, smaller = problem.vehicle, f"or {_smaller(problem.vehicle)}"
    if way and way.radius > MARGIN:
        radius = _rounded_down(way.radius - MARGIN)
        lack = (f"{_size(vehicle)} does not fit" if vehicle.footprint
                else f"with radius {radius} m instead of {vehicle.robot_radius:g} m they are connected")
        return (f"the widest way found between start and goal is {_metres(way.width)} m wide at {_at(way.narrowest)}; {lack}; "
                f"check the map there, {smaller}"), way.narrowest
    if are_walled_off(problem, field):
        walls = "walls or unknown space separate" if avoids_unknown(problem) else "walls separate"
        return f"{walls} start and goal, so that no {_parameter(vehicle)} is small enough; check the map", None
    width = _rounded_up(4 * lattice_spacing(problem.map, field))
    need = f"{_size(vehicle)} does not fit" if vehicle.footprint else f"robot_radius is {vehicle.robot_radius:g} m"
    return f"no way between start and goal is wider than {width} m, and {need}; check the map, {smaller}", None


def _distances(tree: Tree, pose: Pose) -> np.ndarray:
    """(n,): how far the nodes are from a pose [m]."""
    return np.hypot(tree.poses[:, 0] - pose[0], tree.poses[:, 1] - pose[1])


def _all_arcs_hit(problem: Problem, field: ClearanceField, pose: Pose) -> tuple[float, Point] | None:
    """If every arc from a pose hits before a quarter of the tightest turn is driven: the length of the longest [m], and where.

    A vehicle that faces a wall closer than its turning radius is told by this. Arcs are walked by the clearance found.
    """
    need = problem.vehicle.inscribed_radius + MARGIN
    curvature = CURVATURES / problem.vehicle.turning_radius
    driven = np.zeros(len(curvature))
    for _ in range(MOST_STEPS):
        half = curvature * driven / 2
        chord = driven * np.sinc(half / math.pi)
        points = pose[:2] + chord[:, None] * np.column_stack([np.cos(pose[2] + half), np.sin(pose[2] + half)])
        clearance = field.at(points)
        if (driven[clearance >= need] > math.pi / 2 * problem.vehicle.turning_radius).any():
            return None
        if (clearance < need).all():
            longest = int(np.argmax(driven))
            there = nearest_in_map(problem.map, tuple(points[longest].tolist()))
            hit, _ = nearest_obstacle(problem.map, problem.allow_unknown, there, float(clearance[longest]))
            return float(driven[longest]), hit
        driven += np.where(clearance >= need, clearance - need + MARGIN, 0)
    return None


def _at(point: Point) -> str:
    x, y = (round(coordinate, 2) + 0.0 for coordinate in point)  # no -0.00
    return f"({x:.2f}, {y:.2f})"


def _metres(value: float) -> str:
    """Two decimals, or two significant digits where that is more; of what is too far to imagine three."""
    if value >= 1e7:
        return f"{value:.3g}"
    return f"{value:.2f}" if value >= 0.1 or value == 0 else f"{value:.2g}"


def _rounded_down(value: float) -> str:
    """`value`, as `_metres`, by a number that is not above it."""
    digits = _decimals(value)
    return f"{math.floor(value * 10**digits) / 10**digits:.{digits}f}"


def _rounded_up(value: float) -> str:
    """`value`, as `_metres`, by a number that is not below it."""
    digits = _decimals(value)
    return f"{math.ceil(value * 10**digits) / 10**digits:.{digits}f}"


def _decimals(value: float) -> int:
    """The decimals that show two significant digits; two at least."""
    return max(2, 1 - math.floor(math.log10(value))) if value > 0 else 2


def _told_apart(*values: float) -> tuple[str, ...]:
    """Figures with two decimals, or as many as tell them apart."""
    digits = next(n for n in range(2, 17) if len({f"{value:.{n}f}" for value in values}) == len(values) or n == 16)
    return tuple(f"{value:.{digits}f}" for value in values)
