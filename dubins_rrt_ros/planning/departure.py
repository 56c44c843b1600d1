"""Departures: ways out of a start that is too near to an obstacle, which the search goes on from.

Straight on, and in turns to either side, the vehicle drives until it is free. On the way it may come no nearer to an obstacle
than it is at the start: the footprint, made smaller by as much as it overlaps there, has to be free all along. Once it was clear
it may touch nothing any more. The audit, which measures that to a millionth of a metre, decides which ways will do.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import shapely

from ._kernels.collision import CollisionChecker
from .answer import defect_message, not_audited
from .audit.departure import judge_clearance
from .audit.sweep import CONTACT
from .audit.verdict import Audit, audit_path, driven_arcs, in_order
from .collision.clearance import ClearanceField
from .collision.raster import CLEARANCE_MARGIN
from .curves import dubins
from .curves.dubins import DubinsCurve
from .curves.path import Path
from .deadline import Deadline, OutOfTime
from .maps.model import GridMap
from .problem import Pose, Problem
from .result import Plan, Progress, Status
from .search.cost import Objective
from .search.cost_to_go import CostToGo
from .search.lower_bound import lower_bound
from .settings import MIN_PLANNING_TIME, Settings
from .text import at, metres
from .vehicle import Point, Vehicle
from .world import World

#: Lengths driven straight on before a turn, in sizes of the vehicle, and angles turned before going straight on [rad].
STRAIGHTS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2)
ANGLES = np.geomspace(0.02, math.pi, 16).tolist()
#: The same where none of these will do: where there is room for the tail to swing a little, only slight turns will.
MORE_STRAIGHTS, MORE_ANGLES = np.arange(0.1, 4.0, 0.1).tolist(), np.geomspace(0.005, 1.5, 120).tolist()
#: Length of the straight part after a turn, in sizes of the vehicle.
AFTER_TURN = 4.0
#: Lengths for which the vehicle should be able to go on from where it is free, in sizes of the vehicle.
LEADS = (0.5, 1.0, 2.0)
#: Distance between the poses that are tried as the end, in sizes of the vehicle.
STEP = 0.02
#: Number of times that the interval is halved in which the depth at the start lies; and number of swings into obstacles that are
#: tried where no way leads out, and times that the interval between two of them is halved.
HALVINGS, SWINGS, SWING_HALVINGS = 30, 8, 5
#: Share of the time that is left, and maximum time [s], that is kept for the audit of the whole path.
AUDIT_SHARE, MOST_FOR_AUDIT = 0.1, 0.1
#: Depths below this are due to rounding [m].
ROUNDING = 1e-6


class Departure(NamedTuple):
    """The way out of a start that is too near to an obstacle, or why there is none.

    Attributes:
        path: from the start to a pose that is free, or None.
        message: what is to be said of it, as a clause, or as a sentence where there is no path.
        location: of the obstacle that shows it [m], or None.
    """

    path: Path | None
    message: str
    location: Point | None = None


class WholePlans:
    """Plans of a problem that are put together of a departure and plans of its rest; the whole paths are audited.

    Attributes:
        rest: the problem from the end of the departure on.
        settings_of_rest: how to plan it, within the time that is left for it.
    """

    def __init__(self, problem: Problem, settings: Settings, departure: Departure, world: World, deadline: Deadline):
        """Begin, as the search for the rest does.

        Args:
            deadline: of the request; what is left of it is for the rest, but for the time of the last audit.
        """
        assert departure.path is not None
        self._problem, self._settings, self._world, self._deadline = problem, settings, world, deadline
        self._path, self._message = departure.path, departure.message
        self.rest = replace(problem, start=self._path.end, start_slack=0.0, world=world)
        objective = Objective.of(problem, settings, world.field)
        self._objective = objective
        self._cost, self._curve_costs = objective.path_cost(self._path), objective.curve_costs(self._path)
        self._audited: tuple[Path, Audit] | None = None
        self._before = deadline.elapsed
        time = max(MIN_PLANNING_TIME, deadline.left - min(AUDIT_SHARE * deadline.left, MOST_FOR_AUDIT))
        self.settings_of_rest = replace(settings, planning_time=time)

    def joined(self, plan: Plan) -> Plan:
        """Return the plan of the problem, given that of its rest."""
        tree, bound = plan.tree.after(self._path, self._curve_costs), lower_bound(self._problem)
        answer = replace(plan, problem=self._problem, settings=self._settings, tree=tree, lower_bound=bound,
                         cost_lower_bound=bound, time_to_first=self._since_request(plan.time_to_first),
                         time_to_found=self._since_request(plan.time_to_found))
        if plan.path is None:
            message = f"{plan.message[:-1]}; from where it leaves the start, {at(self._path.end[:2])}, on."
            return replace(answer, message=message, planning_time=self._deadline.elapsed)
        path = Path.of_curves(self._problem.start, plan.path.end, [*self._path.curves, *plan.path.curves])
        try:
            audit = self._audit(path)
        except OutOfTime:
            cancelled = self._deadline.cancelled
            return self._without_path(answer, *not_audited(path, cancelled), time_to_first=None, cancelled=cancelled)
        if not audit.ok:
            return self._without_path(answer, Status.UNKNOWN, defect_message(audit), audit=audit)
        node = np.flatnonzero((plan.tree.poses == plan.path.end).all(axis=1) & (plan.tree.costs == plan.cost))[0]
        message = f"Path of {path.length:.2f} m; {self._message}; from there on: {plan.message}"
        bound = min(bound, path.length)
        return replace(answer, message=message, path=path, audit=audit, start_too_near=True, lower_bound=bound,
                       cost=float(tree.costs[node + len(self._path.curves)]), cost_lower_bound=bound,
                       roomy_share=self._objective.roomy_share(path), planning_time=self._deadline.elapsed)

    def progress(self, report: Progress) -> Progress:
        """Return the report on the problem, given one on its rest."""
        return replace(report, elapsed=self._before + report.elapsed,
                       length=None if report.length is None else report.length + self._path.length,
                       cost=None if report.cost is None else report.cost + self._cost,
                       snapshot=lambda: self.joined(report.snapshot()),
                       tree=lambda: report.tree().after(self._path, self._curve_costs))

    def _since_request(self, time: float | None) -> float | None:
        """Return a time since the search for the rest began as one since the request [s]."""
        return None if time is None else self._before + time

    def _audit(self, path: Path) -> Audit:
        """Audit a path, unless that was done last."""
        if self._audited is None or self._audited[0] != path:
            self._audited = path, audit_path(path, self._problem, self._world.obstacles, self._deadline.check)
        return self._audited[1]

    def _without_path(self, answer: Plan, status: Status, message: str, **more: Any) -> Plan:
        return replace(answer, **{"audit": None} | more, status=status, message=message, path=None, cost=None,
                       roomy_share=None, found_by="", waypoint_indices=(), planning_time=self._deadline.elapsed)


def find_departure(problem: Problem, world: World, occupied: str, check_time: Callable[[], None]) -> Departure:
    """Find a way out of an occupied start, as far as there is time.

    Args:
        problem: with a `start_slack`.
        world: its map, prepared.
        occupied: the sentence on the start that is said without slack.
        check_time: called between the steps of the work; it raises OutOfTime where that has to end.
    """
    try:
        return _found(problem, world, occupied, check_time)
    except OutOfTime:
        return Departure(None, f"{occupied[:-1]}; there was no time left to look for a way out of it.")


def _found(problem: Problem, world: World, occupied: str, check_time: Callable[[], None]) -> Departure:
    field = world.field
    depth = _depth(problem, field)
    depth = depth if depth > ROUNDING else 0.0
    if depth > problem.start_slack + ROUNDING:
        return Departure(None, *_too_deep(problem, occupied, depth))
    smaller = _smaller(problem.vehicle, depth + CLEARANCE_MARGIN + CONTACT + ROUNDING)
    if smaller is not None:
        for path in _candidates(problem, field, smaller, check_time):
            arcs = in_order(driven_arcs(path.curves, path.start)[2], len(path.curves))
            if not judge_clearance(arcs, problem, world.obstacles, check_time)[0]:
                near = f"{metres(depth)} m too near to" if depth > 0 else "within a millimetre of"
                return Departure(path, f"the start is {near} an obstacle, which is left within {path.length:.2f} m")
    return Departure(None, _no_way_out(problem, field, occupied, depth, check_time))


def _candidates(problem: Problem, field: ClearanceField, smaller: Vehicle, check_time: Callable[[], None]) -> Iterator[Path]:
    """Yield paths to a pose that is free, the most promising first, and those along more curves where these will not do."""
    to_goal = CostToGo.to_goal(problem, field)
    whole = field.collision_checker(problem.vehicle)

    def promise(path: Path) -> tuple[int, float]:
        return -_leads_on(path.end, problem.vehicle, whole), _promise(path, problem, to_goal)

    for curves in (_curves(problem, STRAIGHTS, ANGLES), _curves(problem, MORE_STRAIGHTS, MORE_ANGLES)):
        yield from sorted(_ways_out(problem, field, smaller, curves, check_time), key=promise)


def _leads_on(pose: Pose, vehicle: Vehicle, checker: CollisionChecker) -> int:
    """Return how many of LEADS the vehicle can drive on from a pose, straight on or in a turn."""
    def is_free(word: str, lengths: tuple[float, float, float]) -> bool:
        curve = DubinsCurve(pose, vehicle.turning_radius, word, lengths)
        return checker.is_motion_free(pose, curve.radius, curve.index, curve.lengths)

    leads = (lead * _size(vehicle) for lead in LEADS)
    return sum(is_free("LSL", (0.0, lead, 0.0)) or is_free("LSL", (lead, 0.0, 0.0)) or is_free("RSR", (lead, 0.0, 0.0))
               for lead in leads)


def _ways_out(problem: Problem, field: ClearanceField, smaller: Vehicle, curves: Iterable[DubinsCurve],
              check_time: Callable[[], None]) -> Iterator[Path]:
    """Yield paths along curves to a pose that is free, along which the smaller vehicle is free."""
    checker, vehicle = field.collision_checker(smaller), problem.vehicle
    whole = field.collision_checker(vehicle)
    for curve in curves:
        check_time()
        lengths = np.array(curve.lengths)
        for length in np.arange(1, math.floor(curve.length / _step(vehicle))) * _step(vehicle):
            pose = curve.pose_at(length)
            if not checker.is_pose_free(pose):
                break
            if whole.is_pose_free(pose) and field.at(np.array(pose[:2])) > 0:
                part = np.clip(length - np.cumsum(lengths) + lengths, 0, lengths)
                if checker.is_motion_free(curve.start, curve.radius, curve.index, part):
                    first, second, third = part.tolist()
                    yield Path.of_curves(problem.start, pose, [replace(curve, lengths=(first, second, third))])
                break


def _curves(problem: Problem, straights: Iterable[float], angles: Iterable[float]) -> Iterator[DubinsCurve]:
    """Yield the curves from the start that may lead out of it: straight on and then a turn, and the other way round."""
    radius, size = problem.vehicle.turning_radius, _size(problem.vehicle)
    for word in ("LSL", "RSR"):
        for straight in straights:
            yield DubinsCurve(problem.start, radius, word, (0.0, straight * size, math.pi * radius))
        for angle in angles:
            yield DubinsCurve(problem.start, radius, word, (angle * radius, AFTER_TURN * size, 0.0))
    yield DubinsCurve(problem.start, radius, "LSL", (0.0, 2 * AFTER_TURN * size, 0.0))


def _promise(path: Path, problem: Problem, to_goal: CostToGo) -> float:
    """Return about how long a path to the goal is that begins with a departure [m]."""
    end = path.end
    rest = dubins.shortest(end, problem.goal, path.radius).length
    return path.length + max(rest, float(to_goal.at(np.array([end[:2]]))[0]))


def _size(vehicle: Vehicle) -> float:
    return max(vehicle.circumscribed_radius, vehicle.maneuver_scale / 4)


def _step(vehicle: Vehicle) -> float:
    return STEP * _size(vehicle)


def _smaller(vehicle: Vehicle, depth: float) -> Vehicle | None:
    """Return a vehicle that is smaller by a depth all around, or None where nothing is left of it."""
    if not vehicle.footprint:
        return replace(vehicle, robot_radius=max(0.0, vehicle.robot_radius - depth))
    outline = shapely.buffer(shapely.Polygon(vehicle.footprint), -depth, join_style="mitre")
    if outline.geom_type != "Polygon" or outline.is_empty:
        return None
    return Vehicle.from_footprint([(x, y) for x, y in outline.exterior.coords[:-1]], turning_radius=vehicle.turning_radius)


def _depth(problem: Problem, field: ClearanceField) -> float:
    """Return to what depth obstacles reach into the vehicle at its start [m]; not above 0 where they do not."""
    vehicle = problem.vehicle
    if not vehicle.footprint:
        return vehicle.robot_radius - float(field.at(np.array(problem.start[:2])))
    overlap = _overlap(problem)
    low, high = 0.0, vehicle.circumscribed_radius
    for _ in range(HALVINGS):
        depth = (low + high) / 2
        touches = _outline(problem, -depth).intersects(overlap)
        low, high = (depth, high) if touches else (low, depth)
    return high if overlap.area > 0 else 0.0


def _outline(problem: Problem, wider: float = 0.0) -> shapely.Geometry:
    """Return the vehicle at its start, in the map's frame, made wider all around."""
    x, y, theta = problem.start
    turn = np.array([[math.cos(theta), math.sin(theta)], [-math.sin(theta), math.cos(theta)]])
    corners = np.array(problem.vehicle.footprint) @ turn + np.array([x, y])
    return shapely.buffer(shapely.Polygon(corners), wider, join_style="mitre")


def _overlap(problem: Problem) -> shapely.Geometry:
    """Return what obstacles cover of the vehicle at its start."""
    outline, world_map = _outline(problem), problem.map
    if not isinstance(world_map, GridMap):
        return shapely.difference(outline, world_map.free)
    outside = shapely.difference(outline, shapely.Polygon(world_map.corners()))
    return shapely.union_all([shapely.intersection(outline, shapely.union_all(_cells(problem))), outside])


def _cells(problem: Problem) -> np.ndarray:
    """Return the squares of the blocked cells around the vehicle at its start."""
    assert isinstance(problem.map, GridMap)
    grid = problem.map.window(problem.start[:2], problem.vehicle.circumscribed_radius)
    rows, columns = np.nonzero(grid.blocked(problem.allow_unknown))
    corners = np.stack([columns, rows], axis=-1)[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    return np.asarray(shapely.polygons(grid.to_map_frame(corners * grid.resolution)))


def _too_deep(problem: Problem, occupied: str, depth: float) -> tuple[str, Point | None]:
    """Return the sentence on a start in which obstacles reach deeper than the slack, and the place of the deepest."""
    allowed = f"start_slack is {problem.start_slack:g} m"
    if not problem.vehicle.footprint:
        return f"{occupied[:-1]}; it is {metres(depth)} m too near, and {allowed}.", None
    place = _overlap(problem).intersection(_outline(problem, -0.999 * depth)).representative_point()
    where = (place.x, place.y) if not place.is_empty else problem.start[:2]
    count = "obstacles reach"
    if isinstance(problem.map, GridMap):
        deep = int(np.count_nonzero(shapely.intersects(_cells(problem), _outline(problem, -problem.start_slack))))
        count = "1 cell reaches" if deep == 1 else f"{deep} cells reach"
    return (f"Start is occupied: {count} farther into the footprint than {allowed}, the deepest by {metres(depth)} m at "
            f"{at(where)}; move it, clear the map there, or allow more."), where


def _no_way_out(problem: Problem, field: ClearanceField, occupied: str, depth: float, check_time: Callable[[], None]) -> str:
    """Return the sentence on a start that nothing leads out of: how far the vehicle would swing into obstacles on the way."""
    near = f"the start is {metres(depth)} m too near, within start_slack {problem.start_slack:g} m, but"

    def leads_out(deeper: float) -> bool:
        smaller, curves = _smaller(problem.vehicle, depth + deeper), _curves(problem, STRAIGHTS, ANGLES)
        return smaller is not None and next(_ways_out(problem, field, smaller, curves, check_time), None) is not None

    swings = np.linspace(0, problem.vehicle.circumscribed_radius - depth, SWINGS + 1).tolist()
    enough = next((n for n, swing in enumerate(swings) if n and leads_out(swing)), None)
    if enough is None:
        return f"{occupied[:-1]}; {near} no way leads out of it."
    low, high = swings[enough - 1:enough + 1]
    for _ in range(SWING_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if leads_out(middle) else (middle, high)
    what = "its tail swings" if problem.vehicle.footprint else "it comes"
    return (f"{occupied[:-1]}; {near} the vehicle cannot leave it: as it turns away {what} {metres(high)} m farther in, and it "
            "may come no nearer than it is.")
