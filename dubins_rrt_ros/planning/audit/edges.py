"""The audit of curves that do not form a path, such as the edges of a tree, and of poses: many at once, each on its own."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..problem import Pose, Problem
from .obstacles import obstacles_of
from .sweep import PRECISION, SHARE, Arcs, clearance_findings
from .verdict import TOLERANCE, apart, broken_curves, driven_arcs, turn_findings

if TYPE_CHECKING:
    from ..curves.dubins import DubinsCurve


def audit_curves(curves: Sequence["DubinsCurve"], ends: Sequence[Pose], problem: Problem) -> tuple[str, ...]:
    """Judge curves that the problem's vehicle is to drive, each from its start to its end.

    Returns:
        What is wrong, one sentence each, which names the curve by its index.
    """
    if not curves:
        return ()
    if broken := broken_curves(curves):
        return broken
    _, driven, arcs = driven_arcs(curves, problem.start)
    findings = list(turn_findings(curves, problem))
    for i, (end, there) in enumerate(zip(driven, ends, strict=True)):
        off, turned = apart(end, there)
        if not (off <= TOLERANCE and turned <= TOLERANCE):
            findings.append(f"curve {i} ends {off:.6g} m and {turned:.6g} rad from where it shall, {tuple(there)}")
    too_near, _ = clearance_findings(arcs, problem)
    if too_near:  # names one place of all curves
        found = ((i, clearance_findings(_only(curve, problem), problem)[0]) for i, curve in enumerate(curves))
        findings += [f"along curve {i}, {curve_finding}" for i, some in found for curve_finding in some] or too_near
    return tuple(findings)


def curve_gap(curve: "DubinsCurve", problem: Problem) -> tuple[float, float]:
    """Return the least gap measured between vehicle and obstacles along a curve, and how much less it can be [m].

    Where there is contact, the gap is that of the first contact found: 0, or for a disc minus how deep it is.
    """
    _, least = clearance_findings(_only(curve, problem), problem)
    return least - _own_radius(problem), max(PRECISION, SHARE * least)


def clearances(points: np.ndarray, problem: Problem) -> np.ndarray:
    """Return the distances of (n, 2) points from the obstacles [m]; 0 in one."""
    return obstacles_of(problem.map, problem.allow_unknown).distance(*np.asarray(points, dtype=float).T)


def _only(curve: "DubinsCurve", problem: Problem) -> Arcs:
    return driven_arcs([curve], curve.start)[2]


def _own_radius(problem: Problem) -> float:
    return 0.0 if problem.vehicle.footprint else problem.vehicle.robot_radius
