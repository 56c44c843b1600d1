"""plan_through(): one path over waypoints, whose free headings are chosen so that the whole is shortest.

The headings are chosen among HEADINGS of them at each waypoint, as `waypoint_headings.py` says, and then turned more finely. That
gives the first path. If there is time, paths are sought between other headings that promise a shorter whole, each leg is planned
with its share of the samples, and the headings are turned once more.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from .answer import defect_message, effort, end_clause, not_audited
from .arguments import check_call
from .audit.verdict import Audit, audit_path, passing_findings
from .curves import dubins
from .curves.angles import SAME, wrap
from .curves.path import Path
from .deadline import Deadline, OutOfTime, never
from .departure import AUDIT_SHARE, MOST_FOR_AUDIT, WholePlans, find_departure
from .diagnosis.components import are_separated
from .planner import AUDIT_RESERVE, plan
from .problem import Pose, Problem, Waypoint, checked_waypoints, demand_problem
from .result import Plan, Progress, Status
from .search.cost import Objective
from .search.goal_poses import goal_poses
from .search.known_path import KnownPath
from .search.legs import Leg
from .search.smoothing import smooth
from .search.tree import Tree
from .settings import MIN_PLANNING_TIME, Settings, demand_settings
from .stops import HEADINGS, Stop, last_place, least_length, legs_along, passing_indices, stops_of
from .text import at
from .waypoint_headings import HeadingChoice
from .work import Work
from .world import problem_with_costs, world_of

#: Share of the time left for the legs in which other headings are tried.
OTHERS_SHARE = 0.4
#: Angles to both sides by which headings are turned, one after the other [rad], and number of headings that are tried each time.
TURNS, TRIES = (math.tau / HEADINGS, math.tau / HEADINGS / 8, math.tau / HEADINGS / 64), 33


def plan_through(problem: Problem, poses: Sequence[Sequence[float | None]], settings: Settings | None = None, *,
                 cancel: Callable[[], bool] | None = None, on_progress: Callable[[Progress], None] | None = None,
                 seed_path: Path | None = None) -> Plan:
    """Plan a path from start to goal over waypoints, in their order.

    Args:
        problem: what to plan.
        poses: the waypoints between start and goal: (x, y, theta); or (x, y, None) or (x, y), to be passed with any heading. One
            that equals the one before, or the start, is passed there.
        settings: as for `plan`; the legs share the samples.
        cancel, on_progress: as for `plan`.
        seed_path: a path that passes the waypoints, with other obstacles or from another start; what is free of it between two
            of them is what their leg begins with.

    Returns:
        A Plan with one audited path, whose `waypoint_indices` tell where it passes the waypoints; or with a message that names
        the waypoint which is not reached.

    Raises:
        HookError, InvalidPose, TypeError: a function of the user's is wrong, as `plan` says; a waypoint is none; an argument is
            of another kind.
    """
    check_call(cancel, on_progress, seed_path)
    waypoints = checked_waypoints(poses)
    settings = demand_settings(settings).with_seed()
    call = _Call(demand_problem(problem), waypoints, settings, cancel or never, on_progress, seed_path)
    answer = call.answer()
    call.world.field.raise_test_error()
    return replace(answer, waypoints=waypoints)


class _Call:
    """One call of plan_through(), with its clock."""

    def __init__(self, problem: Problem, waypoints: tuple[Waypoint, ...], settings: Settings, cancel: Callable[[], bool],
                 on_progress: Callable[[Progress], None] | None, seed_path: Path | None):
        self._waypoints, self._settings, self._cancel, self._on_progress = waypoints, settings, cancel, on_progress
        self._clock = Deadline(settings.planning_time, cancel)
        problem = problem_with_costs(problem, settings)
        world = world_of(problem)
        self._problem, self.world = replace(problem, world=world), world.with_test_of(problem)
        self._objective = Objective.of(self._problem, settings, self.world.field)
        self._map_time = self._clock.elapsed
        self._clock.restart()
        self._clock.reserve = min(AUDIT_SHARE * settings.planning_time, MOST_FOR_AUDIT)
        self._samples = 0
        self._seed_path = seed_path
        self._rng = np.random.default_rng((settings.seed, 4))  # the numbers that Smoother.simplify draws too, no others
        self._proved: dict[tuple[Waypoint, Waypoint], float] = {}  # lower bounds of legs between poses [m]
        self._time_to_first: float | None = None
        self._aim = self._free_goal()

    def _free_goal(self) -> Pose:
        """Return the goal; if that is not free, the nearest free pose within its tolerances, where there is one."""
        checker = self.world.field.collision_checker(self._problem.vehicle)
        poses = goal_poses(self._problem, self.world.field).tolist()
        x, y, theta = next(filter(checker.is_pose_free, poses), self._problem.goal)
        return x, y, theta

    def answer(self) -> Plan:
        """Choose the headings, plan the legs, and join them."""
        try:
            waypoints = (waypoint for waypoint in self._waypoints if self._in_time())
            stops = list(stops_of(replace(self._problem, goal=self._aim), waypoints))
            return self._answer_over(stops)
        except OutOfTime:
            return self._out_of_time()

    def _in_time(self) -> bool:
        """Return True; raises OutOfTime where there is no more time."""
        self._clock.check()
        return True

    def _answer_over(self, stops: list[Stop]) -> Plan:
        if len(stops) < 3:
            return self._single_leg(stops)
        if not self.world.field.pose_is_free(self._problem.start, self._problem.vehicle) and self._problem.start_slack > 0:
            return self._leave_start(stops)
        if unreachable := self._without_room(stops):
            return unreachable
        choice = self._heading_choice(stops)
        if not choice.choose():
            return self._first_leg_without_path(stops, choice)
        paths = self._turned(stops, choice.paths())
        first = self._joined(stops, paths, choice.found_by)
        if self._on_progress and first.path:
            self._on_progress(Progress(first.samples, first.planning_time, first.length, True, lambda: first, lambda: first.tree,
                                       first.cost))
        if self._settings.planner == "rrt" or self._clock.is_over:
            return self._ended(first)
        if choice.try_others(self._clock.elapsed + self._time(OTHERS_SHARE)):
            paths = min(paths, self._turned(stops, choice.paths()), key=self._cost)
        return self._joined(stops, self._turned(stops, self._planned(paths)), choice.found_by, first)

    def _single_leg(self, stops: list[Stop]) -> Plan:
        """Return the plan where all waypoints are at the start or at the goal."""
        answer = plan(self._problem, self._settings, cancel=self._cancel, on_progress=self._on_progress)
        ends = (0, len(answer.poses()) - 1)
        indices = [end for stop, end in zip(stops, ends, strict=False) for _ in stop.waypoints]
        return replace(answer, map_time=self._map_time, waypoint_indices=tuple(indices) if answer.path else ())

    def _leave_start(self, stops: list[Stop]) -> Plan:
        """Return the plan from a start that is too near to an obstacle, or why there is none."""
        occupied = self._leg_plan(self._leg(*stops[:2]))
        if occupied.status != Status.START_OCCUPIED:
            return self._not_reached(stops[1], occupied)
        departure = find_departure(self._problem, self.world, occupied.message, self._clock.check)
        if departure.path is None:
            return self._not_reached(stops[1], replace(occupied, message=departure.message, location=departure.location))
        passed = len(stops[0].waypoints)
        whole = WholePlans(self._problem, self._settings, departure, self.world, self._clock)
        rest = plan_through(whole.rest, self._waypoints[passed:], whole.settings_of_rest, cancel=self._cancel,
                            seed_path=self._seed_path)
        answer = whole.joined(rest)
        later = len(answer.poses()) - len(rest.poses())
        indices = (*[0] * passed, *(later + index for index in rest.waypoint_indices)) if answer.path else ()
        return replace(answer, waypoint_indices=indices, map_time=self._map_time)

    def _without_room(self, stops: list[Stop]) -> Plan | None:
        """Leave out the poses at which the vehicle touches an obstacle; return the plan without a path where none is left."""
        for n, stop in enumerate(stops):
            self._clock.check()
            room = [pose for pose in stop.poses if self.world.field.pose_is_free(pose, self._problem.vehicle)]
            if not room:
                before, after = stops[max(n, 1) - 1:max(n, 1) + 1]
                return self._not_reached(after, self._leg_plan(self._leg(before, after)))
            stops[n] = stop._replace(poses=room)
        return None

    def _heading_choice(self, stops: list[Stop]) -> HeadingChoice:
        """Return the choice of headings at the stops; legs have their parts of the seed path where these are free."""
        seed, vehicle = self._seed_path, self._problem.vehicle
        parts = legs_along(seed, stops) if seed and seed.radius == vehicle.turning_radius else None
        if parts is not None:
            stops[1:-1] = [stop.with_pose(part.end) for stop, part in zip(stops[1:-1], parts, strict=False)]
        legs = [self._leg(here, there) for here, there in pairwise(stops) if self._in_time()]
        choice = HeadingChoice(legs, self.world, self._problem, self._settings, self._objective, self._rng, self._clock,
                               self._leg_plan)
        for number, part in enumerate(parts or ()):
            if KnownPath(part, self.world.field, vehicle).is_free:
                choice.know(number, part)
        return choice

    def _leg(self, here: Stop, there: Stop) -> Leg:
        return Leg(here.poses, there.poses, self.world.field, self._problem.vehicle)

    def _leg_plan(self, leg: Leg) -> Plan:
        """Plan a leg from its first start to its end."""
        samples = 1 if self._settings.informed else max(1, self._settings.samples // (len(self._waypoints) + 1))
        settings = replace(self._settings, samples=samples, planner="rrt", planning_time=self._time(0.5))
        problem = Problem(self.world, start=leg.starts[0], goal=leg.ends[0], any_goal_heading=len(leg.ends) > 1)
        return plan(problem, settings, cancel=self._cancel)

    def _time(self, share: float) -> float:
        """Return a share of the time that is left for the legs, as a limit [s]."""
        return max(MIN_PLANNING_TIME, share * (self._clock.left - self._clock.reserve))

    # Legs

    def _turned(self, stops: list[Stop], paths: list[Path]) -> list[Path]:
        """Turn the headings that can be chosen, each where that makes its two legs cheaper, and smooth the legs."""
        for most in TURNS:
            for n, stop in enumerate(stops[1:-1], 1):
                if len(stop.poses) > 1 and not self._clock.poll():
                    paths[n - 1:n + 1] = self._with_best_heading(paths[n - 1], paths[n], most)
            if self._settings.shortcut:
                paths = [self._smoothed(path) for path in paths]
        return paths

    def _smoothed(self, path: Path) -> Path:
        if _is_shortest(path) or self._clock.is_over:
            return path
        return smooth(path, self._problem.vehicle, self.world.field, self._rng, False, Work(self._clock.poll), self._objective)

    def _with_best_heading(self, before: Path, after: Path, most: float) -> list[Path]:
        """Return two legs with the heading between them that makes them cheapest, of those up to `most` [rad] off the present."""
        arriving, leaving = (KnownPath(path, self.world.field, self._problem.vehicle) for path in (before, after))
        x, y, theta = after.start
        poses = [(x, y, heading) for heading in wrap(theta + np.linspace(-most, most, TRIES)).tolist()]
        off, onto = arriving.off(poses), leaving.onto(poses)
        best = int(np.argmin(off.costs + onto.costs))
        if not off.costs[best] + onto.costs[best] < arriving.cost + leaving.cost - SAME:
            return [before, after]
        turned = [arriving.from_start(poses[best], off.indices[best]), leaving.to_end(poses[best], onto.indices[best])]
        if not self._objective.is_length and self._cost(turned) >= self._cost([before, after]):
            return [before, after]
        return turned

    def _cost(self, paths: list[Path]) -> float:
        return sum(map(self._objective.path_cost, paths))

    def _planned(self, paths: list[Path]) -> list[Path]:
        """Plan the legs that may become shorter, with equal shares of the samples, from the paths that are known."""
        last = len(paths) - 1
        some = [n for n, path in enumerate(paths) if not _is_shortest(path) or (n == last and not self._problem.exact_goal)]
        for left, n in zip(range(len(some), 0, -1), some, strict=True):
            if self._clock.poll():
                break
            problem = (replace(self._problem, start=paths[n].start) if n == last
                       else Problem(self.world, start=paths[n].start, goal=paths[n].end))
            settings = replace(self._settings, samples=max(1, self._settings.samples // len(some)),
                               planning_time=self._time(0.9 / left))
            found = plan(problem, settings, cancel=self._cancel, seed_path=paths[n])
            self._samples += found.samples
            self._proved[problem.start, last_place(problem)] = found.lower_bound if found.path else 0.0
            if found.path and self._cost([found.path]) < self._cost([paths[n]]):
                paths[n] = found.path
        return paths

    # Answers

    def _joined(self, stops: list[Stop], paths: list[Path], found_by: str, before: Plan | None = None) -> Plan:
        """Return the plan with the path of all legs, audited as a whole; without time for that, the path before, if any."""
        path = Path.of_curves(self._problem.start, paths[-1].end, [curve for leg in paths for curve in leg.curves])
        tree = Tree.of_path(path, self._objective.curve_costs(path))
        try:
            audit = self._audit(path)
        except OutOfTime:
            if before and before.path:
                return self._ended(before)
            cancelled = self._clock.cancelled
            return self._plan(*not_audited(path, cancelled), tree, samples=self._samples, cancelled=cancelled)
        if not audit.ok:
            return self._plan(Status.UNKNOWN, defect_message(audit), tree, audit=audit)
        if self._time_to_first is None:
            self._time_to_first = self._clock.elapsed
        bound = min(least_length(self._problem, self._waypoints, self._proved), path.length)
        answer = self._plan(Status.NONE, self._success(path, self._samples), tree, path=path, audit=audit,
                            samples=self._samples, lower_bound=bound, cost=float(tree.costs[-1]), cost_lower_bound=bound,
                            roomy_share=self._objective.roomy_share(path), found_by=found_by,
                            cancelled=self._clock.cancelled)
        return replace(answer, waypoint_indices=tuple(passing_indices(stops, paths, answer.poses())))

    def _success(self, path: Path, samples: int) -> str:
        """Return what was found, in a sentence."""
        count = len(self._waypoints)
        return (f"Path of {path.length:.2f} m over {count} waypoint{'' if count == 1 else 's'}, "
                f"{effort(samples, self._clock.elapsed, self._clock.cancelled)}{end_clause(self._problem, path)}.")

    def _ended(self, answer: Plan) -> Plan:
        """Return an earlier plan as the answer of a request that ends now."""
        if answer.path is None:
            return answer
        return replace(answer, message=self._success(answer.path, answer.samples), cancelled=self._clock.cancelled,
                       planning_time=self._clock.elapsed)

    def _audit(self, path: Path) -> Audit:
        """Audit the path of all legs, and keep as much time for the next audit."""
        began = self._clock.elapsed
        audit = audit_path(path, self._problem, self.world.obstacles, self._clock.check)
        self._clock.reserve = AUDIT_RESERVE * (self._clock.elapsed - began)
        return Audit((*audit.findings, *passing_findings(path, self._waypoints)), audit.min_clearance, audit.max_curvature)

    def _out_of_time(self) -> Plan:
        """Return the plan without a path where the time was up before there were headings to choose from."""
        if self._clock.cancelled:
            return self._cancelled_plan()
        return self._plan(Status.TIMEOUT, f"{self._time_limit()}; allow more time.", self._root())

    def _cancelled_plan(self) -> Plan:
        return self._plan(Status.CANCELLED, "Cancelled before a first path.", self._root(), cancelled=True)

    def _root(self) -> Tree:
        return Tree.of_root(self._problem.start, self._problem.vehicle.turning_radius)

    def _first_leg_without_path(self, stops: list[Stop], choice: HeadingChoice) -> Plan:
        """Return the plan without a path, with what is known of the first leg that has none."""
        number, found = choice.failure()
        return self._not_reached(stops[number + 1], found)

    def _not_reached(self, stop: Stop, found: Plan) -> Plan:
        """Return the plan without a path that says which stop is not reached, and what was found instead of a path to it."""
        if self._clock.poll() and self._clock.cancelled:
            return self._cancelled_plan()
        x, y, _ = stop.poses[0]
        name = f"waypoint {stop.waypoints[0] + 1}" if stop.waypoints else "the goal"
        status, place = found.status, f"{name} at {at((x, y), 3)}"
        why = f"On the way to {place}: {found.message}"
        if found.status == Status.TIMEOUT or (found.status == Status.NO_VALID_PATH and not self._is_of_all_ends(found.problem)):
            # What is found out about one heading at a waypoint need not hold for all; and a leg has but a part of the time.
            status = Status.TIMEOUT
            reason = found.message.partition("; ")[2] if self._has_all_headings(found.problem) else ""
            what, more = self._limit(found)
            why = f"On the way to {place}: {what}; {reason or f'allow more {more}.'}"
        elif found.path:
            status = Status.TIMEOUT
            why = f"No path reaches {place} with a heading that leads on; allow more planning_time, waypoints take more of it."
        elif found.message.startswith("Start "):
            why = found.message
        elif found.message.startswith("Goal "):
            why = found.message.replace("Goal", name[0].upper() + name[1:], 1)
        return self._plan(status, why, self._root(), location=found.location)

    def _limit(self, found: Plan) -> tuple[str, str]:
        """Return what ended the search for a path of a leg, and what there has to be more of."""
        if found.status != Status.TIMEOUT:
            return "No path found with the headings that were tried at its ends", "time"
        if not self._settings.informed and found.samples >= found.settings.samples:
            return f"No path found within {found.samples} samples, the leg's share", "samples"
        return self._time_limit(), "time"

    def _time_limit(self) -> str:
        limit = f"planning_time {self._settings.planning_time:g} s"
        most = ", those without a heading most" if any(theta is None for _, _, theta in self._waypoints) else ""
        return f"No path within {limit}, and waypoints take more of it than a goal alone{most}"

    def _has_all_headings(self, leg: Problem) -> bool:
        """Return True if a leg was planned with all headings that its ends may have."""
        given = [self._problem.start, *self._waypoints] + [self._problem.goal] * self._problem.exact_goal
        return leg.start in given and (leg.any_goal_heading or leg.goal in given)

    def _is_of_all_ends(self, leg: Problem) -> bool:
        """Return True if there is no path between any poses that the ends of a leg may be, as there is none between its own."""
        is_last = leg.goal[:2] == self._aim[:2]
        tolerance = self._problem.goal_tolerance_xy if is_last else 0.0
        return (tolerance == 0 and self._has_all_headings(leg)) or are_separated(replace(leg, goal_tolerance_xy=tolerance),
                                                                                 self.world.field)

    def _plan(self, status: Status, message: str, tree: Tree, **more: Any) -> Plan:
        return Plan(status, message, self._problem, self._settings, tree, time_to_first=self._time_to_first,
                    time_to_found=self._time_to_first, planning_time=self._clock.elapsed, map_time=self._map_time, **more)


def _is_shortest(path: Path) -> bool:
    """Return True if no path between its ends is shorter."""
    return len(path.curves) == 1 and path.length <= dubins.shortest(path.start, path.end, path.radius).length + SAME
