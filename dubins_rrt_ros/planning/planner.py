"""plan(): from a problem to an audited path, or to the reason why there is none."""

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .audit import audit
from .bounds import are_separated, lower_bound
from .clearance import MARGIN, ClearanceField
from .map import GridMap
from .path import Path
from .problem import Problem
from .result import Plan, Progress, Status
from .rrt import Search
from .settings import Settings
from .tree import Tree

#: Progress is reported at least this often [s].
REPORT_INTERVAL = 0.05
#: Poses this close are the same [m, rad]: what lies between them is rounding, of quaternions and the like.
SAME = 1e-9
#: A path shorter by less than this is no improvement [m].
LEAST_IMPROVEMENT = 1e-6


def plan(problem: Problem, settings: Settings, *, cancel: Callable[[], bool] = lambda: False,
         on_progress: Callable[[Progress], None] = lambda progress: None) -> Plan:
    """Plan a path from start to goal.

    The same seed and sample budget give the same path; the time limit and a cancellation only cut the search short.

    Args:
        problem: what to plan.
        settings: how to plan.
        cancel: asked about every 5 ms; True ends the search with the best path so far.
        on_progress: called with every better path, and every 50 ms.

    Returns:
        A Plan with an audited path, or with a status and a message that say why there is none.
    """
    started = time.perf_counter()
    field = ClearanceField.of(problem.map, problem.allow_unknown)
    field.components(problem.vehicle.robot_radius)  # once per map and vehicle: not the request's time
    request = _Request(problem, _with_seed(settings), field, map_time=time.perf_counter() - started)
    return request.refusal() or request.search(cancel, on_progress)


def _with_seed(settings: Settings) -> Settings:
    """The settings with a fresh seed in place of -1."""
    if settings.seed >= 0:
        return settings
    return replace(settings, seed=int(np.random.SeedSequence().entropy % 2**31))


class _Request:
    """One call of plan()."""

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField, map_time: float):
        self._problem = problem
        self._settings = settings
        self._field = field
        self._map_time = map_time
        self._started = time.perf_counter()
        self._time_to_first = None
        self._bound = lower_bound(problem)

    @property
    def _elapsed(self) -> float:
        return time.perf_counter() - self._started

    def refusal(self) -> Plan | None:
        """The answer where no search is needed to know that there is no path."""
        problem, root = self._problem, Tree.of_root(self._problem.start, self._problem.vehicle.turning_radius)
        for name, pose, tolerance, outside, occupied in (
                ("Start", problem.start, 0.0, Status.START_OUTSIDE_MAP, Status.START_OCCUPIED),
                ("Goal", problem.goal, problem.goal_tolerance_xy, Status.GOAL_OUTSIDE_MAP, Status.GOAL_OCCUPIED)):
            if _is_outside(problem, pose):
                return self._plan(outside, _outside_message(problem, name, pose), root)
            clearance = float(self._field.at(np.array(pose[:2])))
            if clearance + tolerance < problem.vehicle.robot_radius + MARGIN:
                return self._plan(occupied, _occupied_message(problem, name, pose, clearance), root)
        if are_separated(problem, self._field):
            message = (f"No path exists: start and goal lie in different parts of the space that is free for robot_radius "
                       f"{problem.vehicle.robot_radius:g} m; check the map, or make robot_radius smaller if the robot is.")
            return self._plan(Status.NO_VALID_PATH, message, root)
        return None

    def search(self, cancel: Callable[[], bool], on_progress: Callable[[Progress], None]) -> Plan:
        """Search until the budget or the time is used up, the path found (RRT), or the request cancelled."""
        if self._start_reaches_goal():
            path = Path(self._problem.start, self._problem.start, ())
            self._time_to_first = self._elapsed
            return self._audited(path, Tree.of_root(path.start, self._problem.vehicle.turning_radius), 0, False)
        search = Search(self._problem, self._settings, self._field)
        cancelled, best, reported = False, math.inf, 0.0
        while not search.done and self._elapsed < self._settings.planning_time and not (cancelled := bool(cancel())):
            search.grow()
            improved = search.length is not None and search.length < best - LEAST_IMPROVEMENT
            if improved and self._time_to_first is None:
                self._time_to_first = self._elapsed
            if improved or self._elapsed - reported >= REPORT_INTERVAL:
                best, reported = search.length or math.inf, self._elapsed
                on_progress(Progress(search.samples, reported, search.length, improved, lambda: self._answer(search, False)))
        return self._answer(search, cancelled)

    def _start_reaches_goal(self) -> bool:
        start, goal = self._problem.start, self._problem.goal
        return (math.dist(start[:2], goal[:2]) <= self._problem.goal_tolerance_xy + SAME
                and abs(math.remainder(start[2] - goal[2], math.tau)) <= self._problem.yaw_tolerance + SAME)

    def _answer(self, search: Search, cancelled: bool) -> Plan:
        """The plan as the search stands."""
        tree = search.tree
        if search.best >= 0:
            return self._audited(tree.path_to(search.best), tree, search.samples, cancelled)
        drawn = f"{search.samples} of {self._settings.samples} samples drawn, {len(tree)} tree nodes, {self._elapsed:.3g} s"
        if cancelled:
            return self._plan(Status.CANCELLED, f"Cancelled before a first path: {drawn}.", tree, samples=search.samples)
        if not search.done:
            message = f"No path within planning_time {self._settings.planning_time:g} s: {drawn}; allow more time."
            return self._plan(Status.TIMEOUT, message, tree, samples=search.samples)
        message = f"No path found: {drawn}; {_advice(self._problem, tree)}."
        return self._plan(Status.NO_VALID_PATH, message, tree, samples=search.samples)

    def _audited(self, path: Path, tree: Tree, samples: int, cancelled: bool) -> Plan:
        """The plan with a path, if the path passes the audit."""
        verdict = audit(path, self._problem)
        if not verdict.ok:
            message = f"A defect in the planner: its path failed the audit: {'; '.join(verdict.findings)}. Please report it."
            return self._plan(Status.UNKNOWN, message, tree, samples=samples, audit="; ".join(verdict.findings))
        plan = self._plan(Status.NONE, "", tree, path=path, samples=samples, cancelled=cancelled, audit="ok",
                          min_clearance=verdict.min_clearance, max_curvature=verdict.max_curvature)
        return replace(plan, message=_success_message(plan))

    def _plan(self, status: Status, message: str, tree: Tree, **more) -> Plan:
        return Plan(status, message, self._problem, self._settings, tree, time_to_first=self._time_to_first,
                    planning_time=self._elapsed, map_time=self._map_time, lower_bound=self._bound, **more)


def _advice(problem: Problem, tree: Tree) -> str:
    """What may help where the samples are spent."""
    if math.dist(problem.start[:2], problem.goal[:2]) < problem.vehicle.turning_radius / 10:
        return ("the goal is so close to the start that a vehicle that cannot turn on the spot has to drive a full loop to it; "
                "set goal_tolerance_xy and goal_tolerance_yaw if it is close enough")
    if len(tree) == 1:
        return (f"no curve of the turning radius {problem.vehicle.turning_radius:g} m left the start; see whether an obstacle "
                "is ahead of it, set step_size, or allow more samples")
    return "allow more samples, or loosen the goal's tolerance"


def _success_message(plan: Plan) -> str:
    """What was found, in a sentence."""
    end = "cancelled after " if plan.cancelled else "after "
    above = f", at most {100 * plan.gap:.1f} % above the shortest possible" if math.isfinite(plan.gap) else ""
    message = (f"Path of {plan.length:.2f} m{above}, "
               f"{end}{plan.samples} samples in {plan.planning_time:.3g} s")
    if plan.problem.exact_goal:
        return message + "."
    off = math.dist(plan.path.end[:2], plan.problem.goal[:2])
    turned = abs(math.remainder(plan.path.end[2] - plan.problem.goal[2], math.tau))
    return f"{message}; it ends {off:.3f} m and {turned:.3f} rad from the goal."


def _is_outside(problem: Problem, pose) -> bool:
    corners = problem.map.corners()
    sides = corners[[1, 3]] - corners[0]
    share = (np.array(pose[:2]) - corners[0]) @ sides.T / (sides**2).sum(axis=1)
    return bool(((share < 0) | (share > 1)).any())


def _outside_message(problem: Problem, name: str, pose) -> str:
    corners = problem.map.corners()
    low, high = corners.min(axis=0), corners.max(axis=0)
    return (f"{name} ({pose[0]:.6g}, {pose[1]:.6g}) is outside the map, which spans x {low[0]:.2f} to {high[0]:.2f} m "
            f"and y {low[1]:.2f} to {high[1]:.2f} m; check the pose and its frame.")


def _occupied_message(problem: Problem, name: str, pose, clearance: float) -> str:
    need = problem.vehicle.robot_radius + MARGIN
    message = f"{name} is occupied: clearance {round(clearance, 4):g} m at ({pose[0]:.2f}, {pose[1]:.2f}), needed {need:g} m"
    if isinstance(problem.map, GridMap) and not problem.allow_unknown:
        known = ClearanceField(problem.map.window(pose[:2], 2 * need), allow_unknown=True)
        if float(known.at(np.array(pose[:2]))) >= need:
            return message + "; only unknown space is that near: drive there to map it, or set allow_unknown."
    return message + "; move it, or make robot_radius smaller if the robot is."
