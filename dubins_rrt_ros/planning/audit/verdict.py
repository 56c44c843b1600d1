"""The independent judge of paths: shapely and plain numpy, no code in common with the planner.

It drives the curves by its own solution of the car's equations (1), and measures distances to the obstacles' true shapes. The
verdict on clearance holds between samples too: `sweep.py` says how.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..curves.path import Path
from ..problem import Pose, Problem
from .obstacles import Obstacles
from .sweep import Arcs, clearance_findings

#: How far a curve may end from where the next one begins [m, rad], and relatively how much tighter a turn may be.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class Audit:
    """What the audit found.

    Attributes:
        findings: what is wrong with the path, one sentence each; none where it is right.
        min_clearance: the least distance to the obstacles, to within a millimetre or 2 %, or where there is contact the first
            that was found: for a disc from the path, on which its middle runs, for a polygon from all that it sweeps [m].
        max_curvature: [1/m].
    """

    findings: tuple[str, ...]
    min_clearance: float
    max_curvature: float

    @property
    def ok(self) -> bool:
        """Whether nothing was found."""
        return not self.findings

    def __str__(self) -> str:
        return "; ".join(self.findings) or "ok"


def audit_path(path: Path, problem: Problem, obstacles: Obstacles | None = None) -> Audit:
    """Judge a path of a problem: its ends, its joints, its turns and its clearance.

    Args:
        path: what is to be driven.
        problem: with the map, the vehicle and the ends.
        obstacles: those of the problem's map, where they are at hand, such as a World's.
    """
    if broken := broken_parts(path):
        return Audit(broken, 0.0, math.inf)
    starts, ends, arcs = driven_arcs(path)
    too_near, least = clearance_findings(arcs, problem, obstacles=obstacles)
    findings = (*_start_findings(path, problem), *goal_findings(path.end, problem), *_joint_findings(path, starts, ends),
                *turn_findings(path, problem), *too_near)
    turning = [curve.radius for curve in path.curves if _turns(curve)]
    return Audit(findings, least, 1 / min(turning) if turning else 0.0)


def broken_parts(path: Path) -> tuple[str, ...]:
    """A sentence for each pose that is none and each curve that cannot be driven."""
    poses = [f"the path's {name} is {pose}" for name, pose in (("start", path.start), ("end", path.end))
             if not all(map(math.isfinite, pose))]
    return (*poses, *(f"curve {i} cannot be driven: start {curve.start}, radius {curve.radius}, lengths {curve.lengths}"
                 for i, curve in enumerate(path.curves)
                 if not (all(map(math.isfinite, (*curve.start, curve.radius, *curve.lengths)))
                         and curve.radius > 0 and min(curve.lengths) >= 0)))


def _turns(curve) -> bool:
    return any(length > 0 and turn != "S" for turn, length in zip(curve.word, curve.lengths, strict=True))


def driven_arcs(path: Path) -> tuple[np.ndarray, np.ndarray, Arcs]:
    """Starts and ends of the curves, (n, 3) each, and all their arcs; a path without curves is one arc of length 0."""
    signs = {"L": 1.0, "S": 0.0, "R": -1.0}
    starts = np.array([curve.start for curve in path.curves]).reshape(-1, 3)
    curvature = np.array([[signs[turn] / curve.radius for turn in curve.word] for curve in path.curves]).reshape(-1, 3)
    length = np.array([curve.lengths for curve in path.curves]).reshape(-1, 3)
    poses = [starts]
    for arc in range(3):
        one = Arcs(*poses[-1].T, curvature[:, arc], length[:, arc])
        poses.append(np.column_stack(one.at(np.arange(len(starts)), length[:, arc])))
    if not path.curves:
        x, y, theta = path.start
        return starts, starts, Arcs(*(np.array([value]) for value in (x, y, theta, 0.0, 0.0)))
    begins = np.concatenate(poses[:3])
    return starts, poses[3], Arcs(*begins.T, curvature.T.ravel(), length.T.ravel())


def _start_findings(path: Path, problem: Problem) -> list[str]:
    return [] if path.start == problem.start else [f"the path starts at {path.start}, not at {problem.start}"]


def goal_findings(end: Pose, problem: Problem, tolerance_xy: float = TOLERANCE, tolerance_yaw: float = TOLERANCE) -> list[str]:
    """What is wrong with a path's end; the tolerances [m, rad] are added to those of the goal."""
    off, turned = apart(end, problem.goal)
    if off <= problem.goal_tolerance_xy + tolerance_xy and turned <= problem.yaw_tolerance + tolerance_yaw:
        return []
    return [f"the path ends {off:.6f} m and {turned:.6f} rad from the goal, whose tolerance is "
            f"{problem.goal_tolerance_xy:g} m and {problem.yaw_tolerance:g} rad"]


def _joint_findings(path: Path, starts: np.ndarray, ends: np.ndarray) -> list[str]:
    before = np.vstack([[path.start], ends])
    after = np.vstack([starts, [path.end]])
    findings = []
    for i, (a, b) in enumerate(zip(before, after, strict=True)):
        off, turned = apart(a, b)
        if not (off <= TOLERANCE and turned <= TOLERANCE):
            findings.append(f"before curve {i} the path jumps by {off:.6g} m and {turned:.6g} rad at ({a[0]:.3f}, {a[1]:.3f})")
    return findings


def turn_findings(path: Path, problem: Problem) -> list[str]:
    least = problem.vehicle.turning_radius
    findings = []
    for i, curve in enumerate(path.curves):
        if curve.radius < least * (1 - TOLERANCE):
            findings.append(f"curve {i} turns with a radius of {curve.radius:g} m, tighter than {least:g} m")
    return findings


def apart(a, b) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses; infinite where a path is driven beyond what numbers hold."""
    turned = a[2] - b[2]
    return math.hypot(a[0] - b[0], a[1] - b[1]), abs(math.remainder(turned, math.tau)) if math.isfinite(turned) else math.inf
