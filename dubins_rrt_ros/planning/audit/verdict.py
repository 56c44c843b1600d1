"""The independent judge of paths: shapely and plain numpy, no algorithm in common with the search.

It drives the curves by its own solution of the car's equations, and measures distances to the obstacles' true shapes. Its verdict
on clearance holds between samples too: `sweep.py` says how.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from ..hooks import are_free
from ..problem import Pose, Problem, Waypoint
from ..text import at, fixed, quoted
from .departure import judge_clearance
from .obstacles import Obstacles
from .sweep import Arcs, any_time, clearance_findings

if TYPE_CHECKING:
    from ..curves.dubins import DubinsCurve
    from ..curves.path import Path

#: Maximum error of a joint between two curves [m, rad], and of a turning radius, relatively.
TOLERANCE = 1e-6
#: Largest sum of what curves end from where the next ones begin [m, rad].
CREEP = 10 * TOLERANCE


@dataclass(frozen=True)
class Audit:
    """The verdict of an audit.

    Attributes:
        findings: what is wrong with the path, one sentence each; none where it is right.
        min_clearance: the least distance to the obstacles, to within a millimetre or 2 %, or where there is contact the first
            that was found: for a disc from the path, on which its middle runs, for a polygon from all that it sweeps [m].
        max_curvature: the greatest curvature of the path [1/m].
    """

    findings: tuple[str, ...]
    min_clearance: float
    max_curvature: float

    @property
    def ok(self) -> bool:
        """True if nothing was found."""
        return not self.findings

    def __str__(self) -> str:
        return "; ".join(self.findings) or "ok"


def audit_path(path: "Path", problem: Problem, obstacles: Obstacles | None = None,
               check_time: Callable[[], None] = any_time) -> Audit:
    """Judge a path of a problem: its ends, its joints, its turns and its clearance.

    Args:
        path: what is to be driven.
        problem: with the map, the vehicle and the ends.
        obstacles: those of the problem's map, where they are at hand, such as a World's.
        check_time: called every few milliseconds; what it raises ends the audit.

    Raises:
        TypeError: `path` is no Path.
    """
    if not hasattr(path, "curves"):
        raise TypeError(f"the path is {quoted(path)}; give a Path, such as that of a Plan")
    check_time()
    if broken := (*_broken_ends(path), *broken_curves(path.curves)):
        return Audit(broken, 0.0, math.inf)
    check_time()
    starts, ends, arcs = driven_arcs(path.curves, path.start)
    if problem.start_slack > 0:
        too_near, least = judge_clearance(in_order(arcs, len(path.curves)), problem, obstacles, check_time)
    else:
        too_near, least = clearance_findings(arcs, problem, obstacles=obstacles, check_time=check_time)
    findings = (*_start_findings(path, problem), *goal_findings(path.end, problem), *_joint_findings(path, starts, ends),
                *turn_findings(path.curves, problem), *too_near, *_test_findings(path, problem))
    bends = (abs(arc.curvature) for curve in path.curves for arc in curve.arcs if arc.length > 0)
    return Audit(findings, least, max(bends, default=0.0))


def _broken_ends(path: "Path") -> tuple[str, ...]:
    """Return a sentence for each end that is no pose."""
    return tuple(f"the path's {name} is {pose}" for name, pose in (("start", path.start), ("end", path.end))
                 if not all(map(math.isfinite, pose)))


def broken_curves(curves: Sequence["DubinsCurve"]) -> tuple[str, ...]:
    """Return a sentence for each curve that cannot be driven."""
    return tuple(f"curve {i} cannot be driven: start {curve.start}, radius {curve.radius}, lengths {curve.lengths}"
                 for i, curve in enumerate(curves)
                 if not (all(map(math.isfinite, (*curve.start, curve.radius, *curve.lengths)))
                         and curve.radius > 0 and min(curve.lengths) >= 0))


def driven_arcs(curves: Sequence["DubinsCurve"], start: Pose) -> tuple[np.ndarray, np.ndarray, Arcs]:
    """Return (n, 3) starts and (n, 3) driven ends of curves, and all arcs: one of length 0 at `start` where there is no curve."""
    if not curves:
        return np.empty((0, 3)), np.empty((0, 3)), Arcs(*(np.array([value]) for value in (*start, 0.0, 0.0)))
    starts = np.array([curve.start for curve in curves])
    curvature, length = np.array([curve.arcs for curve in curves]).transpose(2, 1, 0)
    poses = [starts]
    for bend, along in zip(curvature, length, strict=True):
        x, y, theta = poses[-1].T
        arc = Arcs(x, y, theta, bend, along)
        poses.append(np.column_stack(arc.at(np.arange(len(starts)), along)))
    x, y, theta = np.concatenate(poses[:-1]).T
    return starts, poses[-1], Arcs(x, y, theta, curvature.ravel(), length.ravel())


def in_order(arcs: Arcs, curves: int) -> Arcs:
    """Return the arcs of curves as they are driven; they come as all first ones, all second ones and all third ones."""
    order = np.arange(len(arcs.x)).reshape(-1, max(curves, 1)).T.ravel()
    return Arcs(arcs.x[order], arcs.y[order], arcs.theta[order], arcs.curvature[order], arcs.length[order])


def _start_findings(path: "Path", problem: Problem) -> list[str]:
    return [] if path.start == problem.start else [f"the path starts at {path.start}, not at {problem.start}"]


def goal_findings(end: Pose, problem: Problem, tolerance_xy: float = TOLERANCE, tolerance_yaw: float = TOLERANCE) -> list[str]:
    """Return what is wrong with a path's end; the tolerances [m, rad] are added to those of the goal."""
    off, turned = apart(end, problem.goal)
    if off <= problem.goal_tolerance_xy + tolerance_xy and turned <= problem.yaw_tolerance + tolerance_yaw:
        return []
    return [f"the path ends {fixed(off, 6)} m and {turned:.6f} rad from the goal, whose tolerance is "
            f"{problem.goal_tolerance_xy:g} m and {problem.yaw_tolerance:g} rad"]


def _joint_findings(path: "Path", starts: np.ndarray, ends: np.ndarray) -> list[str]:
    before = np.vstack([[path.start], ends])
    after = np.vstack([starts, [path.end]])
    findings, total_off, total_turned = [], 0.0, 0.0
    for i, (a, b) in enumerate(zip(before, after, strict=True)):
        off, turned = apart(a, b)
        total_off, total_turned = total_off + off, total_turned + turned
        if not (off <= TOLERANCE and turned <= TOLERANCE):
            findings.append(f"before curve {i} the path jumps by {off:.6g} m and {turned:.6g} rad at {at(a[:2], 3)}")
    rounding = 8 * np.finfo(float).eps * len(after) * float(np.abs(after[:, :2]).max())
    if not findings and not (total_off <= CREEP + rounding and total_turned <= CREEP):
        findings.append(f"at its joints the path jumps by {total_off:.6g} m and {total_turned:.6g} rad in all")
    return findings


def _test_findings(path: "Path", problem: Problem) -> Iterator[str]:
    """Yield a sentence for the first pose of the path that a test of the user's refuses, where it is asked in the search too."""
    if problem.is_free is None:
        return
    poses = path.poses(problem.fine_spacing)
    refused = np.flatnonzero(~are_free(problem.is_free, poses))
    if len(refused):
        x, y, theta = poses[refused[0]]
        yield f"is_free refuses the path at {at((x, y, theta), 3)}"


def passing_findings(path: "Path", waypoints: Sequence[Waypoint]) -> Iterator[str]:
    """Yield a sentence for the first waypoint that the path does not pass at a joint between two curves, in their order."""
    joints = iter(path.waypoints.tolist())
    for number, (x, y, theta) in enumerate(waypoints, 1):
        for joint in joints:
            off, turned = apart(joint, (x, y, joint[2] if theta is None else theta))
            if off <= TOLERANCE and turned <= TOLERANCE:
                joints = chain([joint], joints)  # where the next one may be, too
                break
        else:
            yield f"the path does not pass waypoint {number} at {at((x, y), 3)} after those before it"
            return


def turn_findings(curves: Sequence["DubinsCurve"], problem: Problem) -> list[str]:
    """Return a sentence for each curve that turns tighter than the vehicle can."""
    least = problem.vehicle.turning_radius
    findings = []
    for i, curve in enumerate(curves):
        if curve.radius < least * (1 - TOLERANCE):
            findings.append(f"curve {i} turns with a radius of {curve.radius:g} m, tighter than {least:g} m")
    return findings


def apart(a: Sequence[float] | np.ndarray, b: Sequence[float] | np.ndarray) -> tuple[float, float]:
    """Return distance [m] and angle [rad] between two poses; infinite where a path is driven beyond what numbers hold."""
    turned = a[2] - b[2]
    return math.hypot(a[0] - b[0], a[1] - b[1]), abs(math.remainder(turned, math.tau)) if math.isfinite(turned) else math.inf
