"""plan(): from a problem to an audited path, or to the reason why there is none."""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from .audit.verdict import Audit, audit_path
from .collision.clearance import ClearanceField
from .curves.path import Path
from .diagnosis import explain
from .diagnosis.bounds import lower_bound
from .problem import Problem
from .result import Plan, Progress, Status
from .search.cost_to_go import DistanceField
from .search.headings import FOLLOW_FIELD
from .search.rrt import Search
from .search.tree import Tree
from .settings import Settings
from .world import World, prepare

#: Progress is reported at least this often [s].
REPORT_INTERVAL = 0.05
#: Poses this close are the same [m, rad]: what lies between them is rounding, of quaternions and the like.
SAME = 1e-9
#: A path shorter by less than this is no improvement [m].
LEAST_IMPROVEMENT = 1e-6
#: A block of memory that is larger than any array of most requests [bytes].
LARGE_BLOCK = 1 << 24


@cache
def _keep_freed_memory() -> None:
    """Have glibc keep what a request frees for the next one, up to 32 MB.

    By itself it gives much of it back, and fetching that again, page by page, takes up to a quarter of the time to a first path.
    It keeps twice the largest block that it saw freed; this one costs nothing, as it is not touched. Other C libraries, and
    limits that were set with mallopt(), as the node does, are left as they are.
    """
    np.empty(LARGE_BLOCK, np.uint8)


def plan(problem: Problem, settings: Settings, *, cancel: Callable[[], bool] = lambda: False,
         on_progress: Callable[[Progress], None] = lambda progress: None) -> Plan:
    """Plan a path from start to goal.

    The same seed and sample budget give the same path; the time limit and a cancellation only cut the search short. A path that
    the search has found is shortened in a few milliseconds more, when it is cut short too.

    Args:
        problem: what to plan; where it has no world, its map is prepared first.
        settings: how to plan.
        cancel: asked at once, when the clearance field is ready, and about every 5 ms; True ends the search with the best
            path so far.
        on_progress: called with every better path, and every 50 ms.

    Returns:
        A Plan with an audited path, or with a status and a message that say why there is none.
    """
    return _Request(problem, _with_seed(settings)).answer(cancel, on_progress)


def _with_seed(settings: Settings) -> Settings:
    """The settings with a fresh seed in place of -1."""
    if settings.seed >= 0:
        return settings
    return replace(settings, seed=int(np.random.SeedSequence().entropy % 2**31))


class _Request:
    """One call of plan()."""

    def __init__(self, problem: Problem, settings: Settings):
        self._problem = problem
        self._settings = settings
        self._root = Tree.of_root(problem.start, problem.vehicle.turning_radius)
        self._bound = lower_bound(problem)
        self._time_to_first = None
        self._judged: Path | None = None  # by the audit, with this verdict:
        self._verdict: Audit | None = None
        self._world: World | None = None
        self._map_time = 0.0
        self._started = time.perf_counter()

    @property
    def _elapsed(self) -> float:
        return time.perf_counter() - self._started

    @property
    def _out_of_time(self) -> bool:
        return self._elapsed >= self._settings.planning_time

    def answer(self, cancel: Callable[[], bool], on_progress: Callable[[Progress], None]) -> Plan:
        """What plan() returns."""
        if cancel():
            return self._cancelled(self._root, 0)
        self._prepare()
        field = self._world.field
        if cancel():
            return self._cancelled(self._root, 0)
        if reason := explain.before_search(self._problem, field):
            return self._plan(reason.status, reason.message, self._root, culprit=reason.culprit)
        if self._start_reaches_goal():
            self._time_to_first = self._elapsed
            return self._audited(Path(self._problem.start, self._problem.start, ()), self._root, 0)
        return self._search(field, cancel, on_progress)

    def _prepare(self) -> None:
        """Get the world ready, where the problem has none; the request's own time begins then."""
        _keep_freed_memory()
        problem = self._problem
        self._world = (problem.world if isinstance(problem.world, World)
                       else prepare(problem.map, problem.vehicle, problem.allow_unknown))
        self._map_time, self._started = self._elapsed, time.perf_counter()

    def _search(self, field: ClearanceField, cancel: Callable[[], bool], on_progress: Callable[[Progress], None]) -> Plan:
        """Search until the budget or the time is used up, the path found (RRT), or the request cancelled."""
        search = Search(self._problem, self._settings, field, self._distances_if_needed(field))
        best, reported = math.inf, 0.0
        cancelled = False
        while not (search.done or ((self._out_of_time or cancelled) and search.may_end)):
            search.grow()
            cancelled = cancelled or cancel()
            if search.best >= 0 and self._time_to_first is None:
                self._time_to_first = self._elapsed
            improved = search.best >= 0 and search.length < best - LEAST_IMPROVEMENT
            if improved or self._elapsed - reported >= REPORT_INTERVAL:
                best, reported = search.length or math.inf, self._elapsed
                on_progress(Progress(search.samples, reported, search.length, improved, lambda: self._snapshot(search)))
        if search.best >= 0:
            if self._settings.informed:
                self._bound = lower_bound(self._problem, search.make_bound())
            return self._best_of(search, cancelled=cancelled and not search.done)
        return self._cancelled(search.tree, search.samples) if cancelled else self._failed(search, field)

    def _distances_if_needed(self, field: ClearanceField) -> DistanceField | None:
        needed = self._settings.informed or self._settings.heading_sampling in FOLLOW_FIELD
        return DistanceField.to_goal(self._problem, field) if needed else None

    def _start_reaches_goal(self) -> bool:
        start, goal = self._problem.start, self._problem.goal
        return (math.dist(start[:2], goal[:2]) <= self._problem.goal_tolerance_xy + SAME
                and abs(math.remainder(start[2] - goal[2], math.tau)) <= self._problem.yaw_tolerance + SAME)

    def _snapshot(self, search: Search) -> Plan:
        """The plan of a search that goes on."""
        if plan := self._best_of(search, running=True):
            return plan
        message = f"No path so far: {self._drawn(search.samples, search.size)}."
        return self._plan(Status.TIMEOUT, message, search.tree, samples=search.samples)

    def _best_of(self, search: Search, **more) -> Plan | None:
        """The plan with the best path of a search, if it has one."""
        path = search.path
        return self._audited(path, search.tree, search.samples, **more) if path else None

    def _cancelled(self, tree: Tree, samples: int) -> Plan:
        message = f"Cancelled before a first path: {self._drawn(samples, len(tree))}."
        return self._plan(Status.CANCELLED, message, tree, samples=samples, cancelled=True)

    def _failed(self, search: Search, field: ClearanceField) -> Plan:
        """The plan of a search that ended without a path."""
        tree, drawn = search.tree, self._drawn(search.samples, search.size)
        if search.done:
            status, what, more = Status.NO_VALID_PATH, "No path found", "samples"
        else:
            status, what, more = Status.TIMEOUT, f"No path within planning_time {self._settings.planning_time:g} s", "time"
        why, culprit = explain.after_search(self._problem, field, tree, more)
        if search.samples == 0 and culprit is None:
            why = f"allow more {more}"
        elif self._settings.goal_bias == 0 and self._problem.exact_goal and not self._settings.informed:
            why, culprit = "with goal_bias 0 the goal itself is never drawn, so set it above 0, or the goal's tolerances", None
        return self._plan(status, f"{what}: {drawn}; {why}.", tree, samples=search.samples, culprit=culprit)

    def _drawn(self, samples: int, nodes: int) -> str:
        grown = f"{nodes} tree node{'' if nodes == 1 else 's'}"
        return f"{samples} of {self._settings.samples} samples drawn, {grown}, {self._elapsed:.3g} s"

    def _audited(self, path: Path, tree: Tree, samples: int, *, cancelled: bool = False, running: bool = False) -> Plan:
        """The plan with a path, if the path passes the audit."""
        if self._judged is not path:  # an improvement that was reported is often the answer too
            self._judged, self._verdict = path, audit_path(path, self._problem, self._world.obstacles)
        verdict = self._verdict
        if not verdict.ok:
            message = f"A defect in the planner: its path failed the audit: {'; '.join(verdict.findings)}. Please report it."
            return self._plan(Status.UNKNOWN, message, tree, samples=samples, audit="; ".join(verdict.findings))
        plan = self._plan(Status.NONE, "", tree, path=path, samples=samples, cancelled=cancelled, audit="ok",
                          min_clearance=verdict.min_clearance, max_curvature=verdict.max_curvature)
        return replace(plan, message=_success_message(plan, running))

    def _plan(self, status: Status, message: str, tree: Tree, path: Path | None = None, **more) -> Plan:
        # A path ends within rounding of the goal, and the shortest curve to there can be shorter by a full turn.
        bound = self._bound if path is None else min(self._bound, path.length)
        return Plan(status, message, self._problem, self._settings, tree, path=path, time_to_first=self._time_to_first,
                    planning_time=self._elapsed, map_time=self._map_time, lower_bound=bound, **more)


def _success_message(plan: Plan, running: bool) -> str:
    """What was found, in a sentence."""
    so_far = " so far" if running else ""
    end = "cancelled after " if plan.cancelled else "after "
    above = f", at most {100 * plan.gap:.1f} % above the shortest possible" if math.isfinite(plan.gap) else ""
    drawn = f"{end}{plan.samples} sample{'' if plan.samples == 1 else 's'}" if plan.samples else "before the first sample"
    message = f"Path of {plan.length:.2f} m{so_far}{above}, {drawn} in {plan.planning_time:.3g} s"
    if plan.problem.exact_goal:
        return message + "."
    off = math.dist(plan.path.end[:2], plan.problem.goal[:2])
    turned = abs(math.remainder(plan.path.end[2] - plan.problem.goal[2], math.tau))
    return f"{message}; it ends {off:.3f} m and {turned:.3f} rad from the goal."
