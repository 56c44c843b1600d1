"""The answer of plan(): status, path, tree and figures."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from .audit.verdict import Audit
from .collision.clearance import ClearanceField
from .curves.angles import heading_error, position_error
from .curves.dubins import ROUNDING
from .curves.path import JOINT, Path
from .errors import PlanningError
from .pictures import Plottable, check_matplotlib
from .problem import Pose, Problem, Waypoint
from .search.tree import Tree
from .settings import Settings
from .vehicle import Point
from .work import WorkDone
from .world import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Status(IntEnum):
    """The end of a request; 0 and 200 to 208 are Nav2's numbers for ComputePathToPose."""

    NONE = 0
    UNKNOWN = 200
    TF_ERROR = 202
    START_OUTSIDE_MAP = 203
    GOAL_OUTSIDE_MAP = 204
    START_OCCUPIED = 205
    GOAL_OCCUPIED = 206
    TIMEOUT = 207
    NO_VALID_PATH = 208
    NO_MAP = 210
    NO_START = 211
    INVALID_POSE = 212
    CANCELLED = 213


class PlanError(PlanningError, ValueError):
    """An answer that breaks one of its invariants; the message says which, with its figures."""


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Plottable):
    """The answer to a request; the tree is part of it, also on failure.

    Attributes:
        status: how it ended; NONE is success.
        message: one sentence for a person: what happened, the measured figures, what to change.
        problem, settings: the request, with the seed that was used.
        path: the audited path, or None.
        tree: the search tree; it holds the start alone where nothing was searched.
        samples: number of samples drawn.
        location: (x, y) of what shows why there is no path [m]: the nearest obstacle, narrowest place or first hit; or None.
        cancelled: True if it was cancelled; a path is then the best so far.
        time_to_first: time until the first path was shortened, audited and ready [s], or None.
        time_to_found: time until the search had found a path, which was neither shortened nor audited yet [s], or None.
        planning_time: time from request to answer, the preparation of the map not counted [s].
        map_time: time for the preparation of the map, and for loading it where the caller added that [s].
        lower_bound: no path of the problem is shorter [m].
        cost: what was minimised, of the path [m]: its length where preferred_clearance is 0; None without a path.
        cost_lower_bound: no path of the problem costs less [m].
        roomy_share: share of the path's length where the room is at least 0.8 times the preferred clearance; None without a
            path, and where no clearance is preferred or nothing driven.
        found_by: what found the path, before it was smoothed: hybrid_astar, rrt, rrt_star or seed_path; "" without one, and
            where nothing had to be searched.
        audit: the audit of the path, or of one that was found and failed it; None where there was nothing to audit.
        work: where the work ended, so that it can be done again; None where nothing was searched, and over waypoints.
        start_too_near: True if the path leaves a start that is nearer to an obstacle than allowed, as `start_slack` says.
        waypoints: the waypoints that the path was to pass, as they were asked for.
        waypoint_indices: index among `poses` of each waypoint; empty without a path.
    """

    status: Status
    message: str
    problem: Problem
    settings: Settings
    tree: Tree
    path: Path | None = None
    samples: int = 0
    location: Point | None = None
    cancelled: bool = False
    time_to_first: float | None = None
    time_to_found: float | None = None
    planning_time: float = 0.0
    map_time: float = 0.0
    lower_bound: float = 0.0
    cost: float | None = None
    cost_lower_bound: float = 0.0
    roomy_share: float | None = None
    found_by: str = ""
    audit: Audit | None = None
    work: WorkDone | None = None
    start_too_near: bool = False
    waypoints: tuple[Waypoint, ...] = ()
    waypoint_indices: tuple[int, ...] = ()

    def __repr__(self) -> str:
        return f"Plan({self.status.name}: {self.message})"

    @property
    def solved(self) -> bool:
        """True if there is a path."""
        return self.path is not None

    @property
    def length(self) -> float | None:
        """The length of the path [m], or None."""
        return self.path.length if self.path is not None else None

    def poses(self) -> np.ndarray:
        """Return the path as (n, 3) poses at most `path_spacing` apart, with every joint between two arcs; (0, 3) without one."""
        return np.empty((0, 3)) if self.path is None else self.path.poses(self.path_spacing)

    @property
    def path_spacing(self) -> float:
        """The maximum distance between two of the poses [m]: that of the settings, or a fine one where that is 0."""
        return pose_spacing(self.problem, self.settings)

    @property
    def min_clearance(self) -> float | None:
        """The least distance to an obstacle [m], or None without a path.

        From the path, on which the vehicle's reference point runs, where the vehicle is a disc; from all that it sweeps where it
        is a polygon.
        """
        return self.audit.min_clearance if self.audit is not None and self.path is not None else None

    @property
    def max_curvature(self) -> float | None:
        """The greatest curvature of the path [1/m], or None."""
        return self.audit.max_curvature if self.audit is not None and self.path is not None else None

    @property
    def gap(self) -> float | None:
        """The ratio length / lower_bound - 1: 0 for a path of length 0, infinite for a bound of 0, None without a path."""
        return None if self.path is None else gap_above(self.lower_bound, self.path.length)

    @property
    def cost_gap(self) -> float | None:
        """The ratio cost / cost_lower_bound - 1, as `gap` is that of the length."""
        return None if self.cost is None else gap_above(self.cost_lower_bound, self.cost)

    def clearances(self) -> np.ndarray:
        """Return the (n,) clearances at `poses` [m]: of a disc's middle, or of the footprint."""
        problem = self.problem
        field = (problem.world.field if isinstance(problem.world, World)
                 else ClearanceField(problem.map, problem.allow_unknown))
        return field.clearances(self.poses(), problem.vehicle)

    def rooms(self) -> np.ndarray | None:
        """Return the (n,) distances of the vehicle's outline from obstacles at `poses`, in preferred clearances, or None."""
        preferred = self.settings.preferred_clearance_of(self.problem.vehicle)
        if preferred == 0:
            return None
        inset = 0.0 if self.problem.vehicle.footprint else self.problem.vehicle.robot_radius
        return (self.clearances() - inset) / preferred

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw map, tree, path and vehicle, or why there is no path, on axes or in a new pyplot figure, and return the axes.

        Raises:
            PictureError: matplotlib is not installed.
        """
        check_matplotlib()
        from .pictures.plots import plot_plan
        return plot_plan(self, ax)

    def check(self) -> None:
        """Check the invariants: those of the tree and of the path, and that all parts of the answer fit each other.

        Raises:
            PlanError, PathError, TreeError: one does not hold.
        """
        self.tree.check()
        if self.path is not None:
            self.path.check()
        if breach := next(self._breaches(), None):
            raise PlanError(breach)

    def _breaches(self) -> Iterator[str]:
        """Yield a sentence for each invariant that does not hold, with a path or without."""
        problem, settings = self.problem, self.settings
        if not self.message or "\n" in self.message:
            yield f"the message is {self.message!r}, not one line"
        if (self.status == Status.NONE) != (self.path is not None):
            yield f"the status is {self.status.name} {'without' if self.path is None else 'with'} a path"
        # Informed, a search goes on beyond its budget up to a first path.
        if self.samples < 0 or (self.samples > settings.samples and not settings.informed):
            yield f"{self.samples} samples were drawn of {settings.samples}"
        if settings.seed < 0:
            yield f"the seed that was used is {settings.seed}"
        if not (self.planning_time >= 0 and self.map_time >= 0):
            yield f"the planning took {self.planning_time} s and the map {self.map_time} s"
        if not self.lower_bound >= 0:
            yield f"the lower bound is {self.lower_bound} m"
        if tuple(self.tree.poses[0].tolist()) != problem.start:
            yield f"the tree begins at {self.tree.poses[0].tolist()}, not at {problem.start}"
        if self.tree.radius != problem.vehicle.turning_radius:
            yield f"the tree turns with a radius of {self.tree.radius} m, not {problem.vehicle.turning_radius} m"
        yield from self._breaches_without_path() if self.path is None else self._breaches_with_path(self.path)

    def _breaches_with_path(self, path: Path) -> Iterator[str]:
        problem = self.problem
        if path.start != problem.start:
            yield f"the path starts at {path.start}, not at {problem.start}"
        if not reaches_goal(path.end, problem, rounding=JOINT):
            off, turned = position_error(path.end, problem.goal), heading_error(path.end, problem.goal)
            yield f"the path ends {off:.3g} m and {turned:.3g} rad from the goal, whose tolerance is " \
                  f"{problem.goal_tolerance_xy:g} m and {problem.yaw_tolerance:g} rad"
        audit, radius = self.audit, problem.vehicle.turning_radius
        if audit is None or not audit.ok:
            yield f"there is a path, but its audit is {audit}"
        elif not (audit.max_curvature * radius <= 1 + JOINT and audit.min_clearance >= 0):
            yield f"the path bends by {audit.max_curvature}/m, the vehicle by {1 / radius}/m at most, " \
                  f"and the least clearance is {audit.min_clearance} m"
        if self.lower_bound > path.length * (1 + ROUNDING):
            yield f"the path is {path.length} m long, less than the lower bound {self.lower_bound} m"
        if self.cost is None or not path.length <= self.cost * (1 + ROUNDING):
            yield f"the path is {path.length} m long, and its cost is {self.cost} m"
        elif self.cost_lower_bound > self.cost * (1 + ROUNDING):
            yield f"the cost of the path is {self.cost} m, less than the lower bound {self.cost_lower_bound} m"
        if self.time_to_first is None or not 0 <= self.time_to_first <= self.planning_time:
            yield f"the first path came after {self.time_to_first} s of {self.planning_time} s"
        elif self.time_to_found is None or not 0 <= self.time_to_found <= self.time_to_first:
            yield f"the first path was found after {self.time_to_found} s, and ready after {self.time_to_first} s"
        if len(self.waypoint_indices) != len(self.waypoints):
            yield f"of {len(self.waypoints)} waypoints {len(self.waypoint_indices)} are on the path"
        if not self._is_in_tree(path):
            yield f"the path of {path.length} m to {path.end} is not in the tree of {len(self.tree)} nodes"

    def _breaches_without_path(self) -> Iterator[str]:
        if self.cancelled != (self.status == Status.CANCELLED):
            yield f"the status is {self.status.name}, and cancelled is {self.cancelled}"
        if self.audit is not None and self.audit.ok:
            yield "there is no path, but its audit is ok"

    def _is_in_tree(self, path: Path) -> bool:
        """Return True if a node of the tree is reached by just this path."""
        ends = (self.tree.poses == path.end).all(axis=1) & (self.tree.costs == self.cost)
        return any(self.tree.path_to(node) == path for node in ends.nonzero()[0])


def waypoint_arc_lengths(plan: Plan) -> list[float]:
    """Return how far along its path a plan passes each of its waypoints [m], to within a pose's spacing."""
    if plan.path is None or not plan.waypoint_indices:
        return []
    chords = np.hypot(*np.diff(plan.poses()[:, :2], axis=0).T)
    driven = np.append(0.0, np.cumsum(chords))
    scale = plan.path.length / driven[-1] if driven[-1] else 1.0
    return [float(driven[index]) * scale for index in plan.waypoint_indices]


def pose_spacing(problem: Problem, settings: Settings) -> float:
    """Return the maximum distance between two poses of a path [m]: that of the settings, or a fine one where that is 0."""
    return settings.path_spacing or problem.fine_spacing


def reaches_goal(pose: Pose, problem: Problem, rounding: float) -> bool:
    """Return True if a pose is within the goal's tolerances, enlarged by `rounding` [m, rad], of the goal."""
    return (position_error(pose, problem.goal) <= problem.goal_tolerance_xy + rounding
            and heading_error(pose, problem.goal) <= problem.yaw_tolerance + rounding)


def gap_above(lower_bound: float, length: float) -> float:
    """Return length / lower_bound - 1, 0 for a path of length 0, infinite where the bound says nothing."""
    if lower_bound == 0:
        return math.inf if length > 0 else 0.0
    return length / lower_bound - 1


@dataclass(frozen=True)
class Progress:
    """The state of a request under way.

    Attributes:
        samples: number of samples drawn so far.
        elapsed: time since the request [s].
        length, cost: length and cost of the best path so far that is shortened and audited [m], or None.
        improved: True if this report was made because that path is new.
        snapshot: a function that returns the Plan so far: with that path, and the tree of the moment when it was audited; call it
            only before the callback returns.
        tree: a function that returns the tree as it is now; likewise.
    """

    samples: int
    elapsed: float
    length: float | None
    improved: bool
    snapshot: Callable[[], Plan]
    tree: Callable[[], Tree]
    cost: float | None = None
