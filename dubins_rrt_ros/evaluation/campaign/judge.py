"""The judgement of `dubins_rrt campaign`: is the planner's answer to a problem right? The audit alone decides."""

import math
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np
import shapely

from dubins_rrt_ros.planning import (
    DubinsCurve,
    GridMap,
    Map,
    Path,
    PathError,
    Plan,
    PlanError,
    Pose,
    Problem,
    Status,
    Tree,
    TreeError,
    World,
    audit_path,
    plan,
    prepare,
    values,
)
from dubins_rrt_ros.planning.audit.cost import COST_ERROR, cost_of
from dubins_rrt_ros.planning.audit.edges import audit_curves, clearances, curve_gap
from dubins_rrt_ros.planning.audit.sweep import pose_gaps
from dubins_rrt_ros.planning.curves.dubins import shortest
from dubins_rrt_ros.planning.maps.frame import DoubtfulYaw
from dubins_rrt_ros.planning.plan_file import repeating
from dubins_rrt_ros.planning.world import problem_with_costs

from .problems import AMPLE_TIME, MANY_SAMPLES, Trial, random_trial

#: Clearance beyond the required one with which the planner must accept a pose or a curve [m].
MARGIN = 0.001
#: Largest gap that rounding makes of 0 [m].
ROUNDING = 1e-9
#: Time that a request may take beyond its limit [s], without the time that the machine spends on other work.
LATE = 1.0
#: Share of its limit that a search without a path uses at least: a little is kept for the reasons.
IN_TIME = 0.8
#: Number of random curves for which the planner's verdict is compared with the audit's.
CURVES = 6
#: Number of edges of a tree whose costs are compared with the audit's.
EDGES = 12
#: Of this number of problems one is planned again, which must give the same answer, and one in another way.
OTHERS = 20
#: Number of random paths from an end that no path is said to leave, of turns of each, and of steps of a turn.
RANDOM_PATHS, TURNS, STEPS = 500, 4, 12
#: Number of segments of a quarter circle where polygons are shrunk.
QUARTER = 32
_REFUSALS = {Status.START_OUTSIDE_MAP: "start", Status.START_OCCUPIED: "start", Status.GOAL_OUTSIDE_MAP: "goal",
             Status.GOAL_OCCUPIED: "goal"}
_OUTSIDE = Status.START_OUTSIDE_MAP, Status.GOAL_OUTSIDE_MAP


class TrialNumber(NamedTuple):
    """The seed and the number that determine a problem."""

    seed: int
    number: int


def judge(task: TrialNumber) -> dict[str, Any]:
    """Make a problem, plan it and judge the answer; return figures by name, and `findings`, a sentence for each mistake."""
    line: dict[str, Any] = {"seed": task.seed, "number": task.number, "kind": "", "status": "",
                            "edges": 0, "curves": 0, "paths": 0}
    begin = time.perf_counter()
    warnings.simplefilter("ignore", DoubtfulYaw)  # large yaws are among the problems
    try:
        trial = random_trial(*task)
        world = prepare(trial.problem.map, trial.problem.vehicle, trial.problem.allow_unknown)
        trial = replace(trial, problem=replace(trial.problem, world=world))
        line |= {"kind": trial.kind} | _described(trial)
        begin_of_work = time.process_time()
        answer = plan(trial.problem, trial.settings)
        worked = time.process_time() - begin_of_work
        trial = replace(trial, problem=problem_with_costs(trial.problem, trial.settings))
        line |= {"status": answer.status.name, "message": answer.message, "samples": answer.samples, "length": answer.length}
        findings = list(_check_answer(trial, answer, worked))
        if task.number % OTHERS == 0:
            findings += _check_repetition(trial, answer)
        elif task.number % OTHERS == 1:
            findings += _check_other_planner(trial, answer)
        findings += _check_edge_costs(trial, answer.tree, task)
        curves = list(_random_curves(trial.problem, answer.tree, task))
        findings += [finding for curve in curves for finding in _check_curve(trial.problem, curve)]
        line |= {"edges": len(answer.tree) - 1, "curves": len(curves), "paths": int(answer.path is not None)}
    except Exception as error:  # whatever it is, the campaign has found it
        where = traceback.extract_tb(error.__traceback__)[-1]
        findings = [f"{type(error).__name__} in {where.name}, line {where.lineno}: {error}"]
    return line | {"seconds": time.perf_counter() - begin, "findings": findings}


def _described(trial: Trial) -> dict[str, Any]:
    problem = trial.problem
    return {"fits": trial.fits, "start": list(problem.start), "goal": list(problem.goal), "request": values(problem),
            "vehicle": values(problem.vehicle), "settings": asdict(trial.settings)}


def _check_answer(trial: Trial, answer: Plan, worked: float) -> Iterator[str]:
    """Yield what is wrong with an answer that took `worked` of processor time [s]."""
    problem, settings = trial.problem, trial.settings
    yield from _check_invariants(answer)
    yield from _check_tree(problem, answer.tree, settings.step_size)
    yield from _check_ends(problem, answer)
    if min(answer.planning_time, worked) > settings.planning_time + LATE:
        yield f"it took {answer.planning_time:.3g} s, the limit being {settings.planning_time:g} s"
    if answer.path is not None:
        yield from (f"the path: {finding}" for finding in audit_path(answer.path, problem).findings)
        yield from _check_cost(trial, answer, answer.path)
        if trial.fits is False:
            yield "it found a path where there is none"
    elif answer.status in (Status.NO_VALID_PATH, Status.TIMEOUT):
        yield from _check_failure(trial, answer)
    elif answer.status not in _REFUSALS:
        yield f"{answer.status.name}: {answer.message}"


def _check_cost(trial: Trial, answer: Plan, path: Path) -> Iterator[str]:
    """Yield what is wrong with the cost of the path, which is measured anew; it is the length where nothing else costs."""
    cost = cost_of(path, trial.problem, trial.settings)
    if answer.cost is None or abs(answer.cost - cost) > COST_ERROR * cost:
        yield f"the cost of the path is {answer.cost} m, and by the audit {cost:.6g} m"
    yield from _check_cost_bound(answer, cost)


def _check_cost_bound(answer: Plan, cost: float) -> Iterator[str]:
    """Yield what is wrong with the bound of the cost, given what a path costs."""
    if answer.cost_lower_bound > (1 + COST_ERROR) * cost + ROUNDING:
        yield f"there is a path with a cost of {cost:.6g} m, less than the bound {answer.cost_lower_bound:.6g} m"


def _check_edge_costs(trial: Trial, tree: Tree, task: TrialNumber) -> Iterator[str]:
    """Yield what is wrong with the costs of some edges of a tree."""
    rng = np.random.default_rng((task.seed, task.number, 2))
    for node in rng.permutation(np.arange(1, len(tree)))[:EDGES].tolist():
        curve = tree.curve_to(node)
        cost = cost_of(Path.of_curves(curve.start, curve.end, [curve]), trial.problem, trial.settings)
        if abs(tree.edge_costs[node] - cost) > COST_ERROR * cost:
            yield f"the edge to node {node} costs {tree.edge_costs[node]:.6g} m, and by the audit {cost:.6g} m"


def _check_invariants(answer: Plan) -> Iterator[str]:
    """Yield what the answer's own check() finds."""
    try:
        answer.check()
    except (PlanError, PathError, TreeError) as breach:
        yield f"{type(breach).__name__}: {breach}"


def _check_tree(problem: Problem, tree: Tree, step_size: float) -> Iterator[str]:
    """Yield what is wrong with the edges of a tree; its own check() covers costs and parents."""
    curves = [tree.curve_to(node) for node in range(1, len(tree))]
    for finding in audit_curves(curves, tree.poses[1:].tolist(), problem):
        yield f"the tree's edges: {finding}"
    longest = max((curve.length for curve in curves), default=0.0)
    if step_size and longest > step_size * (1 + ROUNDING) + ROUNDING:
        yield f"an edge is {longest:g} m long, step_size being {step_size:g} m"


def _check_ends(problem: Problem, answer: Plan) -> Iterator[str]:
    """Yield what is wrong with what the status says of the start and the goal: free or not, in the map or not."""
    for name, is_one_pose in (("start", True), ("goal", problem.exact_goal)):
        pose = getattr(problem, name)
        room = float(pose_gaps(np.array([pose]), problem)[0]) if is_one_pose else _room_around(problem, pose)
        if _REFUSALS.get(answer.status) == name:
            yield from _check_refusal(answer.status, room, _outside(problem.map, pose))
            return  # nothing is claimed of the other
        if is_one_pose and (room < -ROUNDING or (room <= 0 and problem.vehicle.footprint)):
            yield f"{answer.status.name}, but at the {name} the vehicle has no room: {room:.6g} m"


def _check_refusal(status: Status, room: float, outside: float) -> Iterator[str]:
    """Yield what is wrong with the refusal of a pose that has `room` to spare and lies `outside` the map by that distance [m]."""
    if room > MARGIN:
        yield f"{status.name}, but the vehicle has {room:.6f} m to spare there"
    if status in _OUTSIDE and outside == 0:
        yield f"{status.name}, but it is in the map"
    if status not in _OUTSIDE and outside > 10 * ROUNDING:
        yield f"{status.name}, but it is {outside:g} m outside the map"


def _room_around(problem: Problem, goal: Pose) -> float:
    """Return the largest gap of the vehicle's inscribed disc at some places within the goal's tolerance [m]."""
    bearing = np.linspace(0, math.tau, 24, endpoint=False)
    ring = np.column_stack([np.cos(bearing), np.sin(bearing)])
    points = np.vstack([[(0.0, 0.0)], ring / 2, ring]) * problem.goal_tolerance_xy + goal[:2]
    return float(clearances(points, problem).max()) - problem.vehicle.inscribed_radius


def _outside(world_map: Map, pose: Pose) -> float:
    """Return the distance of a pose from the rectangle of a map [m]; 0 in it."""
    return float(shapely.distance(shapely.Polygon(world_map.corners()), shapely.Point(pose[:2])))


def _check_failure(trial: Trial, answer: Plan) -> Iterator[str]:
    """Yield what is wrong with the statement that there is no path, or that none was found."""
    problem, settings = trial.problem, trial.settings
    if answer.status == Status.NO_VALID_PATH:
        if trial.fits or _has_a_way(problem, answer.message):
            yield f"a way leads from start to goal, but: {answer.message}"
        return
    is_spent = not settings.informed and answer.samples == settings.samples
    if answer.planning_time < IN_TIME * settings.planning_time and not is_spent:
        yield (f"it gave up after {answer.samples} of {settings.samples} samples and {answer.planning_time:.3g} s, "
               f"the limit being {settings.planning_time:g} s")
    has_budget = settings.planning_time == AMPLE_TIME
    if trial.fits and has_budget and (settings.informed or (settings.goal_bias == 1 and settings.step_size == 0)):
        yield f"the shortest curve leads to the goal, but: {answer.message}"


def _has_a_way(problem: Problem, message: str) -> bool:
    """Return True if what the message says to be closed is open: an end of the path, or the way from start to goal."""
    if "forward arc from the start" in message:
        return _leads_on(problem, problem.start)
    if "forward arc reaches the goal" in message:
        x, y, theta = problem.goal
        return _leads_on(problem, (x, y, theta + math.pi))
    return _is_connected(problem)


def _leads_on(problem: Problem, pose: Pose) -> bool:
    """Return True if one of many random paths of a quarter turn's length from a pose has room to spare."""
    rng, step = np.random.default_rng(0), math.pi / 2 * problem.vehicle.turning_radius / (TURNS * STEPS)
    turns = rng.choice([-1.0, 0.0, 1.0], (RANDOM_PATHS, TURNS)).repeat(STEPS, axis=1) / problem.vehicle.turning_radius
    headings = pose[2] + np.cumsum(turns, axis=1) * step
    points = pose[:2] + np.cumsum(step * np.stack([np.cos(headings), np.sin(headings)], axis=-1), axis=1)
    room = clearances(points.reshape(-1, 2), problem).reshape(headings.shape).min(axis=1)
    return bool(room.max() >= problem.vehicle.inscribed_radius + step)


def _is_connected(problem: Problem) -> bool:
    """Return True if the vehicle's inscribed disc, with a millimetre to spare, can get from start to goal."""
    required = (problem.vehicle.inscribed_radius + MARGIN) / math.cos(math.pi / 4 / QUARTER)
    room = _free_space(problem).buffer(-required, quad_segs=QUARTER)
    start, goal = (shapely.Point(_in_frame(problem.map, pose)) for pose in (problem.start, problem.goal))
    return any(part.distance(start) == 0 and part.distance(goal) <= max(0.0, problem.goal_tolerance_xy - ROUNDING)
               for part in shapely.get_parts(room))


def _free_space(problem: Problem) -> shapely.Geometry:
    """Return the free space as polygons, in the frame of the grid if the map is one."""
    world_map = problem.map
    if not isinstance(world_map, GridMap):
        return world_map.free
    rows, columns = np.nonzero(~world_map.blocked(problem.allow_unknown))
    return shapely.union_all(shapely.box(*(world_map.resolution * np.array([columns, rows, columns + 1, rows + 1]))))


def _in_frame(world_map: Map, pose: Pose) -> tuple[float, float]:
    if not isinstance(world_map, GridMap):
        return pose[0], pose[1]
    x, y = world_map.to_grid_frame(np.array(pose[:2])).tolist()
    return x, y


def _random_curves(problem: Problem, tree: Tree, task: TrialNumber) -> Iterator[DubinsCurve]:
    """Yield the shortest curve from start to goal, and some between nodes of the tree."""
    rng = np.random.default_rng((task.seed, task.number, 1))
    radius = problem.vehicle.turning_radius
    yield shortest(problem.start, problem.goal, radius)
    for pair in rng.integers(len(tree), size=(CURVES - 1, 2)):
        begin, end = map(tuple, tree.poses[pair].tolist())
        yield shortest(begin, end, radius)


def _check_curve(problem: Problem, curve: DubinsCurve) -> Iterator[str]:
    """Yield what is wrong with the planner's verdict on a curve."""
    assert isinstance(problem.world, World)
    free = problem.world.field.curve_is_free(curve, problem.vehicle)
    if free and (findings := audit_curves([curve], [curve.end], problem)):
        yield f"the planner holds {curve} to be free: {'; '.join(findings)}"
    if not free:
        gap, less = curve_gap(curve, problem)
        if gap - less > MARGIN:
            yield f"the planner holds {curve} to touch something, but the gap is {gap - less:.6f} m or more"


def _check_repetition(trial: Trial, answer: Plan) -> Iterator[str]:
    """Yield what differs if the same request is made again, and does the same work, whatever time it takes."""
    if answer.work:
        settings = repeating(trial.settings, answer.work)
    elif trial.settings.planning_time >= AMPLE_TIME and answer.status != Status.TIMEOUT:
        settings = trial.settings
    else:  # its end depends on the time
        return
    again = plan(replace(trial.problem), settings)
    names = "poses", "parents", "costs", "words", "lengths"
    if again.status != answer.status or again.path != answer.path or any(
            getattr(again.tree, name).tobytes() != getattr(answer.tree, name).tobytes() for name in names):
        yield f"planned again it came to {again.status.name}, and to another tree or path"


def _check_other_planner(trial: Trial, answer: Plan) -> Iterator[str]:
    """Yield what another planner's path proves wrong: a bound above it, or the claim that there is none."""
    problem, settings = trial.problem, trial.settings
    planner = "rrt" if settings.planner == "rrt_star" else "rrt_star"
    has_costs = problem.map.costs is not None  # of cells, which are obstacles to one planner and not to the other without them
    others = replace(settings, planner=planner, informed=has_costs or not settings.informed, planning_time=AMPLE_TIME,
                     cost_weight=settings.cost_weight if has_costs else 0.0, samples=min(settings.samples, MANY_SAMPLES))
    other = plan(problem, others)
    if other.path and answer.message.startswith("No path exists"):
        yield f"with {planner} there is a path, but: {answer.message}"
    if other.path and answer.path:
        for bound, length in ((answer.lower_bound, other.path.length), (other.lower_bound, answer.path.length)):
            if bound > length * (1 + ROUNDING) + ROUNDING:
                yield f"{bound:.6f} m is said to be a lower bound, but there is a path of {length:.6f} m"
        yield from _check_cost_bound(answer, cost_of(other.path, problem, settings))
        yield from _check_cost_bound(other, cost_of(answer.path, problem, others))
