"""plan(): from a problem to an audited path, or to the reason why there is none."""

import math
import secrets
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from .audit.obstacles import Obstacles
from .audit.verdict import Audit, audit_path
from .collision.clearance import ClearanceField
from .curves.angles import heading_error, position_error
from .curves.path import Path
from .diagnosis import explain
from .problem import Problem
from .result import Plan, Progress, Status, gap_above, reaches_goal
from .search.cost_to_go import CostToGo
from .search.headings import FOLLOW_COST_TO_GO
from .search.lower_bound import lower_bound
from .search.rrt import Search
from .search.tree import Tree
from .settings import Settings
from .world import World, prepare

#: Maximum time between two reports of progress [s].
REPORT_INTERVAL = 0.05
#: Poses this close are the same [m, rad]: what lies between them is rounding, of quaternions and the like.
SAME = 1e-9
#: A path shorter by less than this is no improvement [m].
LEAST_IMPROVEMENT = 1e-6
#: What may find a path, by the values of `Plan.found_by`.
ALGORITHMS = {"hybrid_astar": "hybrid A*", "rrt": "RRT", "rrt_star": "RRT*"}
#: A block of memory that is larger than any array of most requests [bytes].
LARGE_BLOCK = 1 << 24


@cache
def _keep_freed_memory() -> None:
    """Have glibc keep what a request frees for the next one, up to 32 MB.

    By itself it gives much of it back, and fetching that again, page by page, takes up to a quarter of the time to a first path.
    It keeps twice the largest block that it saw freed; this one costs nothing, as it is not touched. Other C libraries, and
    limits that were set with mallopt(), are left as they are.
    """
    np.empty(LARGE_BLOCK, np.uint8)


def plan(problem: Problem, settings: Settings | None = None, *, cancel: Callable[[], bool] | None = None,
         on_progress: Callable[[Progress], None] | None = None) -> Plan:
    """Plan a path from start to goal.

    The same seed and sample budget give the same path; the time limit and a cancellation only cut the search short. A path that
    the search has found is shortened in a few milliseconds more, when it is cut short too.

    Args:
        problem: what to plan; where it has no world, its map is prepared first.
        settings: how to plan; the defaults where it is left out.
        cancel: called at once, when the world is ready, and about every 5 ms; True ends the search with the best path so far.
        on_progress: called with every better path, and every 50 ms.

    Returns:
        A Plan with an audited path, or with a status and a message that say why there is none.
    """
    return _Call(problem, _with_seed(settings or Settings()), cancel or _never, on_progress or _ignore).answer()


def _with_seed(settings: Settings) -> Settings:
    """Return the settings with a fresh seed in place of -1."""
    if settings.seed >= 0:
        return settings
    return replace(settings, seed=secrets.randbits(31))


def _never() -> bool:
    return False


def _ignore(progress: Progress) -> None:
    pass


class _Call:
    """One call of plan(), with its clock."""

    def __init__(self, problem: Problem, settings: Settings, cancel: Callable[[], bool], on_progress: Callable[[Progress], None]):
        self._problem, self._settings, self._cancel, self._on_progress = problem, settings, cancel, on_progress
        self._root = Tree.of_root(problem.start, problem.vehicle.turning_radius)
        self._bound = lower_bound(problem)
        self._obstacles: Obstacles | None = None  # until the world is ready
        self._last_audit: tuple[Path, Audit] | None = None
        self._time_to_first: float | None = None
        self._map_time = 0.0
        self._started = time.perf_counter()

    @property
    def _elapsed(self) -> float:
        return time.perf_counter() - self._started

    @property
    def _out_of_time(self) -> bool:
        return self._elapsed >= self._settings.planning_time

    def answer(self) -> Plan:
        """Prepare the world, look for reasons against a path, and search."""
        if self._cancel():
            return self._cancelled(self._root, 0)
        field = self._prepared_world().field
        if self._cancel():
            return self._cancelled(self._root, 0)
        if diagnosis := explain.before_search(self._problem, field):
            return self._plan(diagnosis.status, diagnosis.message, self._root, location=diagnosis.location)
        if reaches_goal(self._problem.start, self._problem, rounding=SAME):
            self._time_to_first = self._elapsed
            return self._with_path(Path.of_pose(self._problem.start), self._root, 0)
        return self._search(field)

    def _prepared_world(self) -> World:
        """Return the problem's world, or prepare one; the request's own time begins when it is ready."""
        _keep_freed_memory()
        problem = self._problem
        world = problem.world
        if not isinstance(world, World):
            world = prepare(problem.map, problem.vehicle, problem.allow_unknown)
        self._obstacles = world.obstacles
        self._map_time, self._started = self._elapsed, time.perf_counter()
        return world

    def _search(self, field: ClearanceField) -> Plan:
        """Search until the budget or the time is used up, the path found (RRT), or the request cancelled."""
        search = Search(self._problem, self._settings, field, self._cost_to_go_if_needed(field))
        best, reported = math.inf, 0.0
        cancelled = False
        for may_end in () if self._out_of_time else search.run():
            cancelled = cancelled or self._cancel()
            if search.best >= 0 and self._time_to_first is None:
                self._time_to_first = self._elapsed
            improved = search.cost < best - LEAST_IMPROVEMENT
            if improved or self._elapsed - reported >= REPORT_INTERVAL:
                best, reported = search.cost, self._elapsed
                self._on_progress(Progress(search.samples, reported, search.length, improved, lambda: self._snapshot(search)))
            if may_end and (cancelled or self._out_of_time):
                break
        return self._end_of(search, field, cancelled)

    def _cost_to_go_if_needed(self, field: ClearanceField) -> CostToGo | None:
        needed = self._settings.informed or self._settings.heading_sampling in FOLLOW_COST_TO_GO
        return CostToGo.to_goal(self._problem, field) if needed else None

    def _snapshot(self, search: Search) -> Plan:
        """Return the plan of a search that goes on."""
        path = search.path
        if path is not None:
            return self._with_path(path, search.tree, search.samples, search.found_by, running=True)
        message = f"No path so far: {self._drawn(search.samples, search.size)}."
        return self._plan(Status.TIMEOUT, message, search.tree, samples=search.samples)

    def _end_of(self, search: Search, field: ClearanceField, cancelled: bool) -> Plan:
        """Return the plan of a search that has ended."""
        path = search.path
        if path is not None:
            self._bound = lower_bound(self._problem, search.make_bound())
            return self._with_path(path, search.tree, search.samples, search.found_by, cancelled=cancelled and not search.done)
        return self._cancelled(search.tree, search.samples) if cancelled else self._failed(search, field)

    def _cancelled(self, tree: Tree, samples: int) -> Plan:
        message = f"Cancelled before a first path: {self._drawn(samples, len(tree))}."
        return self._plan(Status.CANCELLED, message, tree, samples=samples, cancelled=True)

    def _failed(self, search: Search, field: ClearanceField) -> Plan:
        """Return the plan of a search that ended without a path."""
        search.wait()
        tree, drawn = search.tree, self._drawn(search.samples, search.size)
        if search.done:
            what, more = "No path found", "samples"
        else:
            what, more = f"No path within planning_time {self._settings.planning_time:g} s", "time"
        why, location = explain.after_search(self._problem, field, tree, more)
        if search.samples == 0 and location is None:
            why = f"allow more {more}"
        elif self._settings.goal_bias == 0 and self._problem.exact_goal and not self._settings.informed:
            why, location = "with goal_bias 0 the goal itself is never drawn, so set it above 0, or the goal's tolerances", None
        return self._plan(Status.TIMEOUT, f"{what}: {drawn}; {why}.", tree, samples=search.samples, location=location)

    def _drawn(self, samples: int, nodes: int) -> str:
        tree = f"{nodes} tree node{'' if nodes == 1 else 's'}"
        of_budget = f" of {self._settings.samples}" if samples <= self._settings.samples else ""
        return f"{samples}{of_budget} samples drawn, {tree}, {self._elapsed:.3g} s"

    def _with_path(self, path: Path, tree: Tree, samples: int, found_by: str = "", *, cancelled: bool = False,
                   running: bool = False) -> Plan:
        """Return the plan with a path, if the path passes the audit."""
        audit = self._audit(path)
        if not audit.ok:
            message = f"A defect in the planner: its path failed the audit: {audit}. Please report it."
            return self._plan(Status.UNKNOWN, message, tree, samples=samples, audit=audit)
        # A path ends within rounding of the goal, and the shortest curve to there can be shorter by a full turn.
        bound, elapsed = min(self._bound, path.length), self._elapsed
        message = self._success_message(path, found_by, bound, samples, elapsed, cancelled, running)
        return self._plan(Status.NONE, message, tree, path=path, samples=samples, cancelled=cancelled, audit=audit,
                          found_by=found_by, lower_bound=bound, planning_time=elapsed)

    def _audit(self, path: Path) -> Audit:
        """Audit a path once: an improvement that was reported is often the answer too."""
        if self._last_audit is None or self._last_audit[0] != path:
            self._last_audit = path, audit_path(path, self._problem, self._obstacles)
        return self._last_audit[1]

    def _success_message(self, path: Path, found_by: str, bound: float, samples: int, elapsed: float, cancelled: bool,
                         running: bool) -> str:
        """Return what was found, in a sentence."""
        so_far = " so far" if running else ""
        gap = gap_above(bound, path.length)
        above = f", at most {100 * gap:.1f} % above the shortest possible" if math.isfinite(gap) else ""
        end = "cancelled after " if cancelled else "after "
        drawn = f"{end}{samples} sample{'' if samples == 1 else 's'}" if samples else "before the first sample"
        found = f", found by {ALGORITHMS[found_by]}" if found_by else ""
        message = f"Path of {path.length:.2f} m{so_far}{above}{found}, {drawn} in {elapsed:.3g} s"
        if self._problem.exact_goal:
            return message + "."
        off, turned = position_error(path.end, self._problem.goal), heading_error(path.end, self._problem.goal)
        if self._problem.any_goal_heading:
            return f"{message}; it ends {off:.3f} m from the goal, with the heading {path.end[2]:.3f} rad."
        return f"{message}; it ends {off:.3f} m and {turned:.3f} rad from the goal."

    def _plan(self, status: Status, message: str, tree: Tree, **more: Any) -> Plan:
        figures = {"lower_bound": self._bound, "planning_time": self._elapsed} | more
        return Plan(status, message, self._problem, self._settings, tree, time_to_first=self._time_to_first,
                    map_time=self._map_time, **figures)
