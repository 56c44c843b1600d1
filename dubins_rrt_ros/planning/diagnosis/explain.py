"""The reason why there is no path: a sentence for a person, with figures and a remedy, and the point that shows it."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from ..collision.clearance import ClearanceField
from ..collision.raster import CLEARANCE_MARGIN
from ..deadline import OutOfTime, unlimited
from ..maps.cells import OCCUPIED, UNKNOWN
from ..maps.model import GridMap
from ..problem import Pose, Problem
from ..result import Status
from ..search.tree import Tree
from ..text import at, distinct, metres, rounded_down, rounded_up
from ..vehicle import Point, Vehicle
from .components import are_separated, are_walled_off
from .leaving import cannot_leave, room_to_turn
from .nearest_pose import nearest_free_pose
from .obstacles import (
    MAP_EDGE,
    OBSTACLE,
    ROUNDING,
    UNKNOWN_SPACE,
    Obstacle,
    avoids_unknown,
    has_no_room,
    nearest_in_map,
    nearest_obstacle,
)
from .widest_passage import Passage, sample_spacing, widest_passage, widest_passage_through_unknown

#: Curvatures of the arcs that are tried to leave the start, as shares of the greatest.
CURVATURES = np.linspace(-1, 1, 33)
#: Maximum number of steps along these arcs.
MAX_STEPS = 2000
#: Why bounds and proofs that rest on the clearance of the reference point are left out.
NO_DISC = "no disc around the reference point lies inside the footprint"
#: Number of points across a footprint, and along each of its edges, that are looked at to tell where it touches something.
POINTS = 33


@dataclass(frozen=True)
class Diagnosis:
    """The reason why there is no path.

    Attributes:
        status: that of the plan without a path.
        message: one sentence.
        location: (x, y) of the obstacle or place that shows it [m], or None.
    """

    status: Status
    message: str
    location: Point | None = None


def before_search(problem: Problem, field: ClearanceField, check_time: Callable[[], None] = unlimited) -> Diagnosis | None:
    """Return why there provably is no path, if that can be known without a search.

    `check_time` is called every few milliseconds; where it raises OutOfTime, the sentence has no figures.
    """
    required = problem.vehicle.required_clearance + CLEARANCE_MARGIN
    for name, pose, tolerance, outside, occupied in (
            ("Start", problem.start, 0.0, Status.START_OUTSIDE_MAP, Status.START_OCCUPIED),
            ("Goal", problem.goal, problem.goal_tolerance_xy, Status.GOAL_OUTSIDE_MAP, Status.GOAL_OCCUPIED)):
        nearest = nearest_in_map(problem.map, pose[:2])
        away = math.dist(pose[:2], nearest)
        if away > tolerance + ROUNDING or has_no_room(field, required, pose[:2], tolerance):
            if away > ROUNDING:
                return Diagnosis(outside, _outside_message(problem, name, pose, tolerance, nearest), nearest)
            return _diagnosis(occupied, *_occupied(problem, field, name, pose[:2], tolerance), problem, field)
        is_one_pose = pose is problem.start or problem.exact_goal
        if problem.vehicle.footprint and is_one_pose and not field.pose_is_free(pose, problem.vehicle):
            return _diagnosis(occupied, *_overlapping(problem, field, name, pose), problem, field)
    if are_separated(problem, field):
        return Diagnosis(Status.NO_VALID_PATH, *_separated(problem, field, check_time))
    return _refused_by_test(problem, field)


def _refused_by_test(problem: Problem, field: ClearanceField) -> Diagnosis | None:
    """Return that a test of the user's refuses the start, or an exact goal, if so."""
    ends = [("Start", problem.start, Status.START_OCCUPIED)] + [("Goal", problem.goal, Status.GOAL_OCCUPIED)] * problem.exact_goal
    for name, pose, occupied in ends:
        if field.own_test and not field.own_test.pose_is_free(*pose):
            x, y, theta = pose
            message = f"{name} is occupied: is_free refuses {at((x, y, theta), 3)}; move it, or check is_free."
            return _diagnosis(occupied, message, (x, y), problem, field)
    return None


def _diagnosis(status: Status, message: str, location: Point, problem: Problem, field: ClearanceField) -> Diagnosis:
    """Return the diagnosis of an occupied pose; that of a goal names the nearest pose that is free."""
    if status == Status.GOAL_OCCUPIED and (free := nearest_free_pose(problem, field, problem.goal)):
        away = rounded_up(math.dist(free[:2], problem.goal[:2]))
        message = f"{message[:-1]}; {at(free, 3)} is free, {away} m away."
    return Diagnosis(status, message, location)


def _separated(problem: Problem, field: ClearanceField, check_time: Callable[[], None]) -> tuple[str, Point | None]:
    """Return the sentence on what separates start and goal, and where that is."""
    try:
        between, location = (_unknown_between(problem, field, check_time)
                             or _narrow_between(problem, field, widest_passage(problem, field, check_time), check_time))
    except OutOfTime:
        between, location = (f"walls or narrow places separate start and goal for {_size(problem.vehicle)}; "
                             "allow more time to be told where"), None
    return f"No path exists: {between}.", location


def trapped(problem: Problem, field: ClearanceField, check_time: Callable[[], None] = unlimited) -> Diagnosis | None:
    """Return that there is no path, where provably no arc leaves the start or none reaches the goal.

    `check_time` is called every few milliseconds; what it raises ends the work.
    """
    if problem.vehicle.required_clearance < 0:
        return None  # its reference point may leave even the map
    x, y, theta = problem.goal
    check = f"or check turning_radius ({problem.vehicle.turning_radius:g} m)."
    if cannot_leave(problem, field, problem.start):
        until, location = _until_hit(problem, field, problem.start, "within", check_time)
        return Diagnosis(Status.NO_VALID_PATH, f"No path exists: every forward arc from the start hits an obstacle{until}; "
                                               f"move or turn the start, {check}", location)
    if problem.exact_goal and cannot_leave(problem, field, (x, y, theta + math.pi)):
        until, location = _until_hit(problem, field, (x, y, theta + math.pi), "within the last", check_time)
        return Diagnosis(Status.NO_VALID_PATH, "No path exists: no forward arc reaches the goal: every one that ends there comes "
                                               f"through an obstacle{until}; move or turn the goal, {check}", location)
    return None


def _until_hit(problem: Problem, field: ClearanceField, pose: Pose, within: str, check_time: Callable[[], None]
               ) -> tuple[str, Point | None]:
    """Return how far the longest arc from a pose leads, in words, and where it ends."""
    stuck = _all_arcs_hit(problem, field, pose, check_time)
    return (f" {within} {rounded_up(stuck[0])} m, the longest at {at(stuck[1])}", stuck[1]) if stuck else ("", None)


def after_search(problem: Problem, field: ClearanceField, tree: Tree, more: str, check_time: Callable[[], None]
                 ) -> tuple[str, Point | None]:
    """Return what kept a search from finding a path, as the end of a sentence, and the location that shows it.

    Args:
        problem, field: what was searched.
        tree: the tree of the search.
        more: what could be allowed: "samples" or "time".
        check_time: called between the slices of the work; what it raises ends it.
    """
    radius = problem.vehicle.turning_radius
    if math.dist(problem.start[:2], problem.goal[:2]) < radius / 10:
        return ("the goal is so close to the start that a vehicle that cannot turn on the spot has to drive a full loop to it; "
                f"set goal_tolerance_xy and goal_tolerance_yaw if it is close enough, or allow more {more}"), None
    if problem.vehicle.required_clearance < 0:
        return f"{NO_DISC}, so that nothing is proved; {_nearest_to_goal(problem, tree, more)}", None
    stuck = _all_arcs_hit(problem, field, problem.start, check_time)
    if stuck and _distances(tree, problem.start).max() <= 2 * stuck[0]:
        return (f"every forward arc from the start hits an obstacle within {rounded_up(stuck[0])} m, the longest at "
                f"{at(stuck[1])}; move or turn the start, or check turning_radius ({radius:g} m)"), stuck[1]
    x, y, theta = problem.goal
    stuck = _all_arcs_hit(problem, field, (x, y, theta + math.pi), check_time) if problem.exact_goal else None
    if stuck:
        return ("no forward arc reaches the goal: every one that ends there comes through an obstacle within the last "
                f"{rounded_up(stuck[0])} m, the longest at {at(stuck[1])}; move or turn the goal, or check turning_radius "
                f"({radius:g} m)"), stuck[1]
    passage = widest_passage(problem, field, check_time)
    if passage is None or passage.radius < problem.vehicle.inscribed_radius:
        return _unknown_between(problem, field, check_time) or _narrow_between(problem, field, passage, check_time)
    if len(tree) == 1:
        return f"no curve of the turning radius {radius:g} m left the start; set step_size, or allow more {more}", None
    return _no_room_to_turn(problem, field, passage, more) or (_nearest_to_goal(problem, tree, more), None)


def _no_room_to_turn(problem: Problem, field: ClearanceField, passage: Passage, more: str) -> tuple[str, Point] | None:
    """Return a clause that says that there most likely is too little room to turn round, if so, and where there is most."""
    turn = room_to_turn(problem, field, passage.points)
    if turn is None:
        return None
    (width, place), radius = turn, problem.vehicle.turning_radius
    needed = 2 * (radius + problem.vehicle.inscribed_radius)
    return (f"most likely there is no room to turn round: radius {radius:g} m needs {metres(needed)} m, the widest place that "
            f"can be reached has {metres(width)} m, at {at(place)}; turn the start or the goal, check turning_radius, or "
            f"allow more {more}"), place


def _nearest_to_goal(problem: Problem, tree: Tree, more: str) -> str:
    """Return a clause that says how near to the goal a tree came."""
    near = float(_distances(tree, problem.goal).min())
    return f"the tree came within {rounded_up(near)} m of the goal; allow more {more}, or loosen the goal's tolerance"


def _outside_message(problem: Problem, name: str, pose: Pose, tolerance: float, nearest: Point) -> str:
    corners = problem.map.corners()
    low, high = corners.min(axis=0), corners.max(axis=0)
    if isinstance(problem.map, GridMap) and problem.map.origin[2] != 0:
        (width, height), yaw = problem.map.size, problem.map.origin[2]
        spans = f"spans {width:.2f} m x {height:.2f} m from its corner {at(corners[0])} on, turned by {yaw:.3g} rad"
    else:
        spans = f"spans x {low[0]:.2f} to {high[0]:.2f} m and y {low[1]:.2f} to {high[1]:.2f} m"
    reach = f", and goal_tolerance_xy {tolerance:g} m reaches no place with room enough in it" if tolerance else ""
    return (f"{name} ({pose[0]:.6g}, {pose[1]:.6g}) is {metres(math.dist(pose[:2], nearest))} m outside the map, which {spans}"
            f"{reach}; check the pose and its frame.")


def _occupied(problem: Problem, field: ClearanceField, name: str, point: Point, tolerance: float) -> tuple[str, Point]:
    """Return the sentence on a pose without room, and the nearest obstacle."""
    required = problem.vehicle.inscribed_radius + CLEARANCE_MARGIN
    clearance = float(field.at(np.array(point)))
    obstacle = nearest_obstacle(problem.map, problem.allow_unknown, point, clearance)
    nearest, what, _ = obstacle
    found, needed = distinct(clearance, required)
    message = f"{name} is occupied: clearance {found} m, needed {needed} m"
    if tolerance:
        message += f", which no place within goal_tolerance_xy {tolerance:g} m has"
    if isinstance(problem.map, GridMap) and what == UNKNOWN_SPACE:
        opened = ClearanceField(problem.map.window(point, 2 * (tolerance + required)), allow_unknown=True)
        if not has_no_room(opened, required, point, tolerance):
            unknown = _in_words(problem, obstacle)
            where = f"only {unknown} is that near, at {at(nearest)}" if clearance > 0 else f"{at(point)} lies in {unknown}"
            return f"{message}; {where}: {_remedy_for_unknown(obstacle)}.", nearest
    if clearance == 0 and what != MAP_EDGE:
        return f"{message}; {at(point)} lies in {_in_words(problem, obstacle)}; move it.", nearest
    where = f"nearest obstacle {'' if what == OBSTACLE else f'is {_in_words(problem, obstacle)} '}at {at(nearest)}"
    return f"{message}; {where}; {_remedy_for_pose(problem, name, 'move it')}.", nearest


def _overlapping(problem: Problem, field: ClearanceField, name: str, pose: Pose) -> tuple[str, Point]:
    """Return the sentence on a pose at which the footprint touches something, and where."""
    points = _points_of(problem.vehicle, pose)
    clearance = field.at(points)
    worst = tuple(points[np.argmin(clearance)].tolist())
    obstacle = Obstacle(nearest_in_map(problem.map, worst), MAP_EDGE)
    if math.dist(obstacle.nearest, worst) <= ROUNDING:
        obstacle = nearest_obstacle(problem.map, problem.allow_unknown, worst, float(clearance.min()))
    nearest, what, _ = obstacle
    message = f"{name} is occupied: the footprint touches {_in_words(problem, obstacle)} at {at(nearest)}"
    if isinstance(problem.map, GridMap) and what == UNKNOWN_SPACE:
        around = problem.map.window(pose[:2], 2 * problem.vehicle.robot_radius)
        if ClearanceField(around, allow_unknown=True).pose_is_free(pose, problem.vehicle):
            return f"{message}: {_remedy_for_unknown(obstacle)}.", nearest
    return f"{message}; {_remedy_for_pose(problem, name, 'move or turn it')}.", nearest


def _in_words(problem: Problem, obstacle: Obstacle) -> str:
    """Return what an obstacle is; of a cell that is neither free nor occupied for sure, with its value."""
    if not isinstance(problem.map, GridMap) or obstacle.value in (None, UNKNOWN, OCCUPIED):
        return "an obstacle" if obstacle.kind == OBSTACLE else obstacle.kind
    if obstacle.kind == OBSTACLE:
        return f"an obstacle, a cell of {obstacle.value} %"
    limits = problem.map.thresholds
    return (f"{UNKNOWN_SPACE}, a cell of {obstacle.value} % (free is up to {limits.free_up_to} %, occupied from "
            f"{limits.occupied_from} % on)")


def _remedy_for_pose(problem: Problem, name: str, move: str) -> str:
    """Return what to do about an end of the path that is too near to an obstacle; a vehicle may stand at such a start."""
    slack = ", or set start_slack if it can leave" if name == "Start" and not problem.start_slack else ""
    return f"{move}, or {_smaller(problem.vehicle)}{slack}"


def _remedy_for_unknown(obstacle: Obstacle) -> str:
    """Return what to do about unknown space."""
    if obstacle.value in (None, UNKNOWN):
        return "drive there to map it, or set allow_unknown"
    return f"if that is free, set free_thresh to {obstacle.value / 100:g} or above, or allow_unknown"


def _points_of(vehicle: Vehicle, pose: Pose) -> np.ndarray:
    """Return (n, 2) points all over the footprint at a pose, its corners among them; for a disc, its centre."""
    if not vehicle.footprint:
        return np.array([pose[:2]])
    corners = np.array(vehicle.footprint)
    axes = [np.linspace(low, high, POINTS) for low, high in zip(corners.min(axis=0), corners.max(axis=0), strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    inside = grid[shapely.contains_xy(shapely.Polygon(corners), grid)]
    edges = corners + np.linspace(0, 1, POINTS)[:, None, None] * (np.roll(corners, -1, axis=0) - corners)
    x, y = np.concatenate([inside, edges.reshape(-1, 2)]).T
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.column_stack([pose[0] + c * x - s * y, pose[1] + s * x + c * y])


def _smaller(vehicle: Vehicle) -> str:
    """Return what may help where there is too little room."""
    return f"make {_parameter(vehicle)} smaller if the robot is"


def _parameter(vehicle: Vehicle) -> str:
    """Return the parameter that says how much room the vehicle takes."""
    return "footprint" if vehicle.footprint else "robot_radius"


def _size(vehicle: Vehicle) -> str:
    """Return what takes room all around the reference point."""
    if vehicle.footprint:
        return f"a footprint that is {2 * vehicle.inscribed_radius:.3g} m wide or more everywhere around its reference point"
    return f"robot_radius {vehicle.robot_radius:g} m"


def _unknown_between(problem: Problem, field: ClearanceField, check_time: Callable[[], None]) -> tuple[str, Point] | None:
    """Return a clause that says that start and goal are separated by unknown space, if they are, and where it begins."""
    passage = widest_passage_through_unknown(problem, check_time)
    if passage is None:
        return None
    clearance = field.at(passage.points)
    first = int(np.argmax(clearance < problem.vehicle.inscribed_radius + CLEARANCE_MARGIN))
    begins = nearest_obstacle(problem.map, False, tuple(passage.points[first].tolist()), float(clearance[first]))
    value = "" if begins.value in (None, UNKNOWN) else f" with a cell of {begins.value} %"
    return (f"unknown space separates start and goal for {_size(problem.vehicle)}; on the way between them "
            f"it begins at {at(begins.nearest)}{value}; {_remedy_for_unknown(begins)}"), begins.nearest


def _narrow_between(problem: Problem, field: ClearanceField, passage: Passage | None, check_time: Callable[[], None]
                    ) -> tuple[str, Point | None]:
    """Return a clause that says that start and goal are separated by walls, or joined by too narrow a place, and where that is.

    Args:
        passage: the widest one between them, if there is one.
    """
    vehicle, smaller = problem.vehicle, f"or {_smaller(problem.vehicle)}"
    if passage and passage.radius > CLEARANCE_MARGIN:
        radius = rounded_down(passage.radius - CLEARANCE_MARGIN)
        lack = (f"{_size(vehicle)} does not fit" if vehicle.footprint
                else f"with radius {radius} m instead of {vehicle.robot_radius:g} m they are connected")
        return (f"the widest way found between start and goal is {metres(passage.width)} m wide at {at(passage.narrowest)}; "
                f"{lack}; check the map there, {smaller}"), passage.narrowest
    if are_walled_off(problem, field, check_time):
        walls = "walls or unknown space separate" if avoids_unknown(problem, check_time) else "walls separate"
        return f"{walls} start and goal, so that no {_parameter(vehicle)} is small enough; check the map", None
    width = rounded_up(4 * sample_spacing(problem.map, field))
    lack = f"{_size(vehicle)} does not fit" if vehicle.footprint else f"robot_radius is {vehicle.robot_radius:g} m"
    return f"no way between start and goal is wider than {width} m, and {lack}; check the map, {smaller}", None


def _distances(tree: Tree, pose: Pose) -> np.ndarray:
    """Return the (n,) distances of the nodes from a pose [m]."""
    return np.hypot(tree.poses[:, 0] - pose[0], tree.poses[:, 1] - pose[1])


def _all_arcs_hit(problem: Problem, field: ClearanceField, pose: Pose, check_time: Callable[[], None]
                  ) -> tuple[float, Point] | None:
    """Return the length of the longest arc from a pose [m] and where it hits, if all hit within a quarter of the tightest turn.

    So it is with a vehicle that faces a wall closer than its turning radius. Each step along an arc is as long as the clearance.
    """
    required = problem.vehicle.inscribed_radius + CLEARANCE_MARGIN
    curvature = CURVATURES / problem.vehicle.turning_radius
    driven = np.zeros(len(curvature))
    for _ in range(MAX_STEPS):
        check_time()
        half = curvature * driven / 2
        chord = driven * np.sinc(half / math.pi)
        points = pose[:2] + chord[:, None] * np.column_stack([np.cos(pose[2] + half), np.sin(pose[2] + half)])
        clearance = field.at(points)
        if (driven[clearance >= required] > math.pi / 2 * problem.vehicle.turning_radius).any():
            return None
        if (clearance < required).all():
            longest = int(np.argmax(driven))
            there = nearest_in_map(problem.map, tuple(points[longest].tolist()))
            hit = nearest_obstacle(problem.map, problem.allow_unknown, there, float(clearance[longest]))
            return float(driven[longest]), hit.nearest
        driven += np.where(clearance >= required, clearance - required + CLEARANCE_MARGIN, 0)
    return None
