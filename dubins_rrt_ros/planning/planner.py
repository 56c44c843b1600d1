"""plan(): from a problem to an audited path, or to the reason why there is none."""

import math
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from typing import Any

from .answer import LEAST_IMPROVEMENT, AuditedPath, defect_message, not_audited, success_message
from .arguments import check_call
from .audit.obstacles import Obstacles
from .audit.verdict import Audit, audit_path
from .collision.clearance import ClearanceField
from .collision.own_test import OwnTest
from .curves.angles import SAME
from .curves.path import Path
from .deadline import Deadline, OutOfTime, never
from .departure import WholePlans, find_departure
from .diagnosis import explain
from .memory import keep_freed_memory
from .problem import Problem, demand_problem
from .proof.background_proof import BackgroundProof
from .result import Plan, Progress, Status, gap_above, reaches_goal
from .search.cost import Objective
from .search.cost_to_go import CostToGo
from .search.headings import FOLLOW_COST_TO_GO
from .search.known_path import KnownPath
from .search.lower_bound import lower_bound
from .search.rrt import Search
from .search.smoothing import price_of_curve
from .search.tree import Tree
from .settings import Settings, demand_settings
from .work import Work, WorkDone
from .world import World, problem_with_costs, world_of

#: Maximum time between two reports of progress [s].
REPORT_INTERVAL = 0.05
#: Minimum time between two audits of improvements, in times that the last one took: the search has the rest; and where nobody
#: is told of them and nothing waits for their proof, so that they only matter if the time does not suffice for the last audit.
AUDIT_INTERVAL, UNHEARD_AUDIT_INTERVAL = 5, 50
#: Minimum improvement of a cost that is not the length that is simplified and audited before the end, relative to the cost.
WORTH_SIMPLIFYING = 1e-3
#: Time that is kept to simplify and audit the answer, in times that it took last; before the first one, share of what is left.
AUDIT_RESERVE, FIRST_AUDIT_SHARE = 1.5, 0.5
#: Share of the time, and maximum time [s], that is kept to tell why there is no path.
REASONS_SHARE, MOST_FOR_REASONS = 0.1, 0.1
#: Number of steps of a search without a path after which a proof is sought that there is none.
STEPS_TO_PROOF = 4


def plan(problem: Problem, settings: Settings | None = None, *, cancel: Callable[[], bool] | None = None,
         on_progress: Callable[[Progress], None] | None = None, report_samples: int = 0, seed_path: Path | None = None) -> Plan:
    """Plan a path from start to goal.

    The same seed and sample budget give the same path; the time limit and a cancellation only cut the search short. The answer
    is then the best path so far that passed its audit.

    Args:
        problem: what to plan; where it has no world, its map is prepared first.
        settings: how to plan; the defaults where it is left out.
        cancel: called at once, when the world is ready, and about every 5 ms; True ends the search with the best path so far.
        on_progress: called with every better path, and every 50 ms.
        report_samples: number of samples after which it is called too, each time that so many are drawn; 0 for the time alone.
        seed_path: a path of a similar problem, such as the last one; what of it is free and leads from here to the goal is the
            first path, which the search goes on from. The path that is planned depends on it.

    Returns:
        A Plan with an audited path, or with a status and a message that say why there is none.

    Raises:
        HookError: `is_free` of the problem or `sampler` of the settings raised an exception, or gave what it should not.
        TypeError: an argument is of another kind.
    """
    check_call(cancel, on_progress, seed_path)
    return _Call(demand_problem(problem), demand_settings(settings).with_seed(), cancel or never, on_progress or _ignore,
                 report_samples, seed_path).answer()


def _ignore(progress: Progress) -> None:
    pass


class _Call:
    """One call of plan(), with its clock."""

    def __init__(self, problem: Problem, settings: Settings, cancel: Callable[[], bool], on_progress: Callable[[Progress], None],
                 report_samples: int = 0, seed_path: Path | None = None):
        self._report_samples, self._samples_reported = report_samples, 0
        self._problem, self._settings, self._on_progress, self._seed_path = problem, settings, on_progress, seed_path
        self._deadline = Deadline(settings.planning_time, cancel)
        self._limit, self._before = settings.planning_time, 0.0  # of the request, and its time before this call [s]
        self._root = Tree.of_root(problem.start, problem.vehicle.turning_radius)
        self._bound = self._cost_bound = lower_bound(problem)
        self._obstacles: Obstacles | None = None  # until the world is ready
        self._own_test: OwnTest | None = None
        self._best: AuditedPath | None = None
        self._map_time = self._audit_took = self._simplifying_took = 0.0
        self._found_cost = math.inf  # of the best path of the search that was audited last
        self._last_audit, self._last_report = -math.inf, 0.0  # when they ended [s]
        self._time_to_first: float | None = None
        self._time_to_found: float | None = None
        self._objective: Objective | None = None  # until the search begins
        self._proof: BackgroundProof | None = None

    @property
    def _elapsed(self) -> float:
        return self._deadline.elapsed

    def answer(self) -> Plan:
        """Return the plan; raise what a test of the user's raised."""
        answer = self._answer()
        if self._own_test:
            self._own_test.raise_error()
        return answer

    def _answer(self) -> Plan:
        """Prepare the world, look for reasons against a path, and search."""
        if self._is_cancelled():
            return self._cancelled(self._root, 0)
        world = self._prepared_world()
        field = world.field
        if self._is_cancelled():
            return self._cancelled(self._root, 0)
        if diagnosis := explain.before_search(self._problem, field, self._deadline.check):
            if diagnosis.status == Status.START_OCCUPIED and self._problem.start_slack > 0:
                return self._leave_start(world, diagnosis.message)
            return self._plan(diagnosis.status, diagnosis.message, self._root, location=diagnosis.location)
        if reaches_goal(self._problem.start, self._problem, rounding=SAME):
            self._time_to_found = self._elapsed
            return self._answer_with(Path.of_pose(self._problem.start), self._root, 0)
        return self._search(field)

    def _leave_start(self, world: World, occupied: str) -> Plan:
        """Return the plan from a start that is too near to an obstacle, or why there is none."""
        departure = find_departure(self._problem, world, occupied, self._deadline.check)
        if self._deadline.cancelled:
            return self._cancelled(self._root, 0)
        if departure.path is None:
            return self._plan(Status.START_OCCUPIED, departure.message, self._root, location=departure.location)
        whole = WholePlans(self._problem, self._settings, departure, world, self._deadline)
        rest = _Call(whole.rest, whole.settings_of_rest, self._deadline.cancel,
                     lambda report: self._on_progress(whole.progress(report)), self._report_samples, self._seed_path)
        rest._limit, rest._before = self._settings.planning_time, self._elapsed
        return replace(whole.joined(rest.answer()), map_time=self._map_time)

    def _is_cancelled(self) -> bool:
        self._deadline.poll()
        return self._deadline.cancelled

    def _prepared_world(self) -> World:
        """Return the problem's world, or prepare one; the request's own time begins when it is ready."""
        keep_freed_memory()
        self._problem = problem_with_costs(self._problem, self._settings)
        world = world_of(self._problem).with_test_of(self._problem)
        if own_test := world.field.own_test:
            self._own_test, self._deadline.cancel = own_test, own_test.cancel(self._deadline.cancel)
        self._obstacles = world.obstacles
        self._map_time = self._elapsed
        self._deadline.restart()
        return world

    def _search(self, field: ClearanceField) -> Plan:
        """Search until the budget or the time is used up, the path found (RRT), or the request cancelled."""
        self._deadline.reserve = min(REASONS_SHARE * self._settings.planning_time, MOST_FOR_REASONS)
        to_goal = self._cost_to_go_if_needed(field)
        with closing(Search(self._problem, self._settings, field, to_goal, self._deadline, self._report_samples)) as search:
            return self._run(search, field)

    def _run(self, search: Search, field: ClearanceField) -> Plan:
        deadline = self._deadline
        self._objective = search.objective
        self._proof = BackgroundProof(self._problem, field, self._settings, lambda: deadline.is_over, self._bound,
                                      search.objective.is_length)
        for step, may_end in enumerate(() if deadline.is_due else search.run(self._usable_seed(field, search.growing.nearest))):
            if step == STEPS_TO_PROOF and search.best < 0 and (trapped := self._trapped(search, field)):
                return trapped
            if search.best >= 0 and self._time_to_found is None:
                self._time_to_found = self._elapsed
                deadline.reserve = FIRST_AUDIT_SHARE * max(0.0, deadline.left)
            self._report(search)
            if self._proof and self._best:
                self._proof.follow(self._best.path, search.length_bounds, bool(search.bound) or not self._settings.informed)
            if search.work.is_over or (may_end and (deadline.is_due or self._is_proved(search))):
                break
        return self._end_of(search, field)

    def _is_proved(self, search: Search) -> bool:
        """Return True if the best path is proved to be as near to the shortest, or the cheapest, possible as asked for."""
        gap = self._settings.stop_gap
        if self._best is None or gap == 0:
            return False
        if search.objective.is_length:
            return self._proof is not None and self._proof.holds
        return search.bound is not None and self._best.cost <= (1 + gap) * lower_bound(self._problem, search.bound)

    def _take_proved(self, bound: float) -> None:
        """Take over a length that no path falls below; none costs less than its length."""
        self._bound, self._cost_bound = max(self._bound, bound), max(self._cost_bound, bound)

    def _usable_seed(self, field: ClearanceField, nearest: tuple[float, float] | None) -> Path | None:
        """Return the path that the seed path gives for this problem, if it does; to the nearest position if there is one."""
        seed, problem = self._seed_path, self._problem
        if seed is None or len(seed.waypoints) < 2 or seed.radius != problem.vehicle.turning_radius:
            return None
        goal = seed.end if reaches_goal(seed.end, problem, rounding=0.0) else problem.goal
        known = KnownPath(seed, field, problem.vehicle)
        to_nearest = known.joined(problem.start, (*nearest, goal[2])) if nearest and nearest != goal[:2] else None
        return to_nearest or known.joined(problem.start, goal)

    def _report(self, search: Search) -> None:
        """Report a better path, once it is shortened and audited, and the state of the search from time to time."""
        improved = search.ready and self._is_audit_due(search) and self._is_right(search.path, search)
        if improved or self._is_report_due(search.samples):
            self._report_progress(search.samples, improved, lambda: self._snapshot(search), lambda: search.tree)

    def _is_report_due(self, samples: int) -> bool:
        return (0 < self._report_samples <= samples - self._samples_reported
                or self._elapsed - self._last_report >= REPORT_INTERVAL)

    def _report_progress(self, samples: int, improved: bool, snapshot: Callable[[], Plan], tree: Callable[[], Tree]) -> None:
        self._last_report = self._elapsed
        if self._report_samples:
            self._samples_reported = samples - samples % self._report_samples
        length, cost = (self._best.path.length, self._best.cost) if self._best else (None, None)
        self._on_progress(Progress(samples, self._last_report, length, improved, snapshot, tree, cost))

    def _is_audit_due(self, search: Search) -> bool:
        """Return True if the best path is better than the one that was audited last, and the last audit is long enough ago."""
        if self._best is None:
            return True
        least = LEAST_IMPROVEMENT if search.objective.is_length else WORTH_SIMPLIFYING * self._found_cost
        is_heard = self._on_progress is not _ignore or self._settings.stop_gap > 0
        interval = (AUDIT_INTERVAL if is_heard else UNHEARD_AUDIT_INTERVAL) * (self._audit_took + self._simplifying_took)
        return search.cost < self._found_cost - least and self._elapsed - self._last_audit >= interval

    def _is_right(self, path: Path | None, search: Search) -> bool:
        """Audit the best path of a search, and keep it where it is right; False too where the time does not suffice."""
        if path is None:
            return False
        try:
            audited = self._audited(path, search, simplify=self._best is not None)
        except OutOfTime:
            return False
        if is_better := audited.audit.ok and audited.improves(self._best):
            self._keep(audited)
        return is_better

    def _audited(self, path: Path, search: Search, simplify: bool = True, is_last: bool = False) -> AuditedPath:
        """Simplify and audit a path once: an improvement that was reported is often the answer too."""
        is_length, merging = search.objective.is_length, Work(self._deadline.poll, self._settings.work_limits.merging)
        simple, simplified, is_simple = self._simplified(path, search) if simplify and not is_length else (path, 0, is_length)
        if is_last:
            simple = search.without_short_arcs(simple, merging)
        self._found_cost, began = search.cost, self._elapsed
        tree, cost = search.tree_with(simple), search.objective.path_cost(simple)
        return AuditedPath(simple, self._audit(simple, began), tree, search.samples, search.growing.found_by, cost, path,
                           is_simple, WorkDone(search.work.done, simplified, merging.done))

    def _simplified(self, path: Path, search: Search) -> tuple[Path, int, bool]:
        """Return a simpler form of a path, the work of it, and whether there was the time for all of that."""
        if (best := self._best) and best.is_simple and best.found == path:
            return best.path, best.work.simplification, True
        work = Work(self._deadline.poll, self._settings.work_limits.simplification)
        self._deadline.reserve = AUDIT_RESERVE * self._audit_took
        began = self._elapsed
        simple = search.simplified(path, work)
        self._simplifying_took = self._elapsed - began
        return simple, work.done, not work.is_interrupted

    def _audit(self, path: Path, began: float) -> Audit:
        """Audit a path, unless that was done last; it took the time since it `began` [s] to do what goes with that, too."""
        if self._best and self._best.path == path:
            return self._best.audit
        audit = audit_path(path, self._problem, self._obstacles, self._deadline.check)
        self._last_audit, self._audit_took = self._elapsed, self._elapsed - began
        if self._objective and not self._objective.is_length and self._simplifying_took == 0:
            self._simplifying_took = self._audit_took  # an estimate: it takes about as long
        self._deadline.reserve = AUDIT_RESERVE * (self._audit_took + self._simplifying_took)
        return audit

    def _keep(self, audited: AuditedPath) -> None:
        self._best = audited
        if self._time_to_first is None:
            self._time_to_first = self._elapsed

    def _cost_to_go_if_needed(self, field: ClearanceField) -> CostToGo | None:
        needed = self._settings.informed or self._settings.heading_sampling in FOLLOW_COST_TO_GO
        return CostToGo.to_goal(self._problem, field, Objective.of(self._problem, self._settings, field)) if needed else None

    def _snapshot(self, search: Search) -> Plan:
        """Return the plan of a search that goes on."""
        if search.bound:
            self._cost_bound = lower_bound(self._problem, search.bound)
            if search.objective.is_length:
                self._bound = self._cost_bound
        if self._proof:
            self._take_proved(self._proof.bound)
        if self._best:
            return self._with_path(self._best, running=True)
        message = f"No path so far: {self._drawn(search.samples, search.growing.size)}."
        return self._plan(Status.TIMEOUT, message, search.tree, samples=search.samples)

    def _end_of(self, search: Search, field: ClearanceField) -> Plan:
        """Return the plan of a search that has ended."""
        path, cancelled = search.path, self._deadline.cancelled
        if path is None:
            return self._cancelled(search.tree, search.samples) if cancelled else self._failed(search, field)
        before = self._best
        answer = self._answer_with(path, search.tree, search.samples, cancelled=cancelled and not search.done, search=search)
        if self._best and self._best.improves(before):
            self._on_progress(Progress(answer.samples, answer.planning_time, answer.length, True, lambda: answer,
                                       lambda: answer.tree, answer.cost))
        return answer

    def _answer_with(self, path: Path, tree: Tree, samples: int, cancelled: bool = False, search: Search | None = None) -> Plan:
        """Return the plan with the best path; without it where it fails its audit, with the one before where the time is up."""
        try:
            if search and self._best is None and (found := self._audited(path, search, simplify=False)).audit.ok:
                self._keep(found)  # before time is spent on a better form of it
            audited = (self._audited(path, search, is_last=True) if search
                       else AuditedPath(path, self._audit(path, self._elapsed), tree, samples))
        except OutOfTime:
            cancelled = cancelled or self._deadline.cancelled
            if self._best:
                return self._with_path(self._best, cancelled)
            return self._plan(*not_audited(path, cancelled), tree, samples=samples, cancelled=cancelled)
        if not audited.audit.ok:
            return self._plan(Status.UNKNOWN, defect_message(audited.audit), tree, samples=samples, audit=audited.audit)
        if not (self._best and self._best.outlasts(audited, price_of_curve(self._problem.vehicle))):
            self._keep(audited)
        if search and (bound := search.make_bound(self._time_for_bound())):
            self._cost_bound = lower_bound(self._problem, bound)
            self._bound = lower_bound(self._problem, search.make_length_bound())
        if self._proof:
            self._proof.follow(path, None, not self._settings.informed)
            self._take_proved(self._proof.finish(0.0 if cancelled else self._deadline.left))
        return self._with_path(self._best or audited, cancelled)

    def _time_for_bound(self) -> float:
        """Return how long the lower bound is waited for [s]: an answer of RRT, which ends with its first path, does not wait."""
        return 0.0 if self._settings.planner == "rrt" or self._deadline.cancelled else max(0.0, self._deadline.left)

    def _cancelled(self, tree: Tree, samples: int) -> Plan:
        message = f"Cancelled before a first path: {self._drawn(samples, len(tree))}."
        return self._plan(Status.CANCELLED, message, tree, samples=samples, cancelled=True)

    def _failed(self, search: Search, field: ClearanceField) -> Plan:
        """Return the plan of a search that ended without a path."""
        search.wait()
        if trapped := self._trapped(search, field):
            return trapped
        tree, drawn = search.tree, self._drawn(search.samples, search.growing.size)
        too_late = f"No path within planning_time {self._limit:g} s", "time"
        what, more = ("No path found", "samples") if search.done else too_late
        try:
            why, location = explain.after_search(self._problem, field, tree, more, self._deadline.check)
        except OutOfTime:
            why, location = f"allow more {more}", None
        if search.samples == 0 and location is None:
            why = f"allow more {more}"
        elif self._settings.goal_bias == 0 and self._problem.exact_goal and not self._settings.informed:
            why, location = "with goal_bias 0 the goal itself is never drawn, so set it above 0, or the goal's tolerances", None
        if self._own_test:
            why += f"; is_free was asked {self._own_test.asked} times and refused {self._own_test.refused}"
        return self._plan(Status.TIMEOUT, f"{what}: {drawn}; {why}.", tree, samples=search.samples, location=location,
                          work=WorkDone(search.work.done))

    def _trapped(self, search: Search, field: ClearanceField) -> Plan | None:
        """Return the plan without a path where no arc leaves the start or none reaches the goal, if that can be proved."""
        try:
            diagnosis = explain.trapped(self._problem, field, self._deadline.check)
        except OutOfTime:
            return None
        if diagnosis is None:
            return None
        return self._plan(diagnosis.status, diagnosis.message, search.tree, samples=search.samples, location=diagnosis.location)

    def _drawn(self, samples: int, nodes: int) -> str:
        tree = f"{nodes} tree node{'' if nodes == 1 else 's'}"
        of_budget = f" of {self._settings.samples}" if samples <= self._settings.samples else ""
        return f"{samples}{of_budget} samples drawn, {tree}, {self._before + self._elapsed:.3g} s"

    def _with_path(self, best: AuditedPath, cancelled: bool = False, running: bool = False) -> Plan:
        """Return the plan with a path that passed its audit."""
        # A path ends within rounding of the goal, and the shortest curve to there can be shorter by a full turn.
        bound, cost_bound, elapsed = min(self._bound, best.path.length), min(self._cost_bound, best.cost), self._elapsed
        proved = self._proof is not None and 0 < self._settings.stop_gap >= gap_above(cost_bound, best.cost) - SAME
        message = success_message(self._problem, self._settings, best, (bound, cost_bound), elapsed, cancelled=cancelled,
                                  running=running, proved=proved)
        return self._plan(Status.NONE, message, best.tree, path=best.path, samples=best.samples, cancelled=cancelled,
                          audit=best.audit, found_by=best.found_by, work=best.work, lower_bound=bound, cost=best.cost,
                          cost_lower_bound=cost_bound, planning_time=elapsed,
                          roomy_share=self._objective.roomy_share(best.path) if self._objective else None)

    def _plan(self, status: Status, message: str, tree: Tree, **more: Any) -> Plan:
        figures = {"lower_bound": self._bound, "cost_lower_bound": self._cost_bound, "planning_time": self._elapsed} | more
        return Plan(status, message, self._problem, self._settings, tree, time_to_first=self._time_to_first,
                    time_to_found=self._time_to_found, map_time=self._map_time, **figures)
