"""The audit of poses alone, such as those of another planner, as if a car drove from each to the next.

Between two poses the car drives the arc of constant curvature that turns from one yaw to the other. A car's poses lie on such
arcs; no car can drive to a pose that lies beside or behind the end of its arc. Rounding of the poses is tolerated, but must not
add up: every stretch of the path is judged, from a single step to the whole.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..problem import Problem
from ..text import at, fixed
from .sweep import Arcs, clearance_findings
from .verdict import TOLERANCE, Audit, apart, goal_findings

#: Length below which a step counts as a turn on the spot [m].
STEP = 1e-9


def audit_poses(poses: np.ndarray, problem: Problem, tolerance_xy: float = 1e-3, tolerance_yaw: float = 1e-3) -> Audit:
    """Judge poses that a vehicle is to drive through: their ends, their turns, and the clearance in between.

    Over a stretch of any length they may turn by `tolerance_yaw` more than the turning radius allows, run to the side by
    `tolerance_xy` and a share of `tolerance_yaw` of the length, and back by `tolerance_xy`. The greatest
    distance of a pose from its arc is added to the required clearance.

    Args:
        poses: (n, 3) x [m], y [m], yaw [rad], finite; at least one.
        problem: with the map, the vehicle and the ends.
        tolerance_xy, tolerance_yaw: maximum errors of the poses [m, rad].

    Returns:
        The findings, of each kind the worst. The greatest curvature is that of a single step, where rounding shows most.
    """
    steps = _Steps.between(poses)
    findings = [*_end_findings(poses, problem, tolerance_xy, tolerance_yaw),
                *_motion_findings(poses, steps, problem.vehicle.turning_radius, tolerance_xy, tolerance_yaw)]
    # Of poses that no car drives through the clearance is that of the arcs alone.
    slack = 0.0 if findings else steps.slack(problem.vehicle.robot_radius)
    too_near, least = clearance_findings(steps.arcs(poses), problem, slack)
    return Audit((*findings, *too_near), least, float(np.abs(steps.curvature).max(initial=0.0)))


def driven_length(poses: np.ndarray) -> float:
    """Return the length of the arcs through (n, 3) poses [m]."""
    return float(_Steps.between(poses).length.sum())


@dataclass(frozen=True)
class _Steps:
    """The steps from each pose to the next: the turn [rad], the arc's length, and the offset of the pose from its end [m]."""

    turn: np.ndarray
    length: np.ndarray
    left: np.ndarray
    ahead: np.ndarray

    @classmethod
    def between(cls, poses: np.ndarray) -> "_Steps":
        x, y, yaw = poses.T
        turn = np.diff(yaw)
        turn -= math.tau * np.round(turn / math.tau)
        # As seen along the chord of the arc, which halves the turn.
        step = np.diff(x + 1j * y) * np.exp(-1j * (yaw[:-1] + turn / 2))
        chord = np.maximum(step.real, 0.0)
        return cls(turn, chord / np.sinc(turn / math.tau), step.imag, step.real - chord)

    @property
    def curvature(self) -> np.ndarray:
        """The curvatures of the arcs [1/m]; 0 for turns on the spot."""
        return np.asarray(np.divide(self.turn, self.length, out=np.zeros(len(self.turn)), where=self.length > STEP))

    def slack(self, reach: float) -> float:
        """Return the largest distance of a vehicle's point, within `reach` of its middle, from where the arcs put it [m]."""
        on_the_spot = np.where(self.length > STEP, 0.0, np.abs(self.turn))
        return float((np.hypot(self.left, self.ahead) + reach * on_the_spot).max(initial=0.0))

    def arcs(self, poses: np.ndarray) -> Arcs:
        """Return the arcs from each pose to the next, and one of no length at the last."""
        x, y, theta = poses.T
        return Arcs(x, y, theta, np.append(self.curvature, 0.0), np.append(self.length, 0.0))


def _end_findings(poses: np.ndarray, problem: Problem, tolerance_xy: float, tolerance_yaw: float) -> list[str]:
    findings = []
    off, turned = apart(poses[0], problem.start)
    if off > tolerance_xy or turned > tolerance_yaw:
        findings.append(f"the path starts {fixed(off, 6)} m and {turned:.6f} rad from the start")
    return findings + goal_findings(poses[-1], problem, tolerance_xy, tolerance_yaw)


def _motion_findings(poses: np.ndarray, steps: _Steps, radius: float, tolerance_xy: float, tolerance_yaw: float) -> list[str]:
    """Return what no car with the turning radius can drive: the worst stretch of each kind."""
    if not len(steps.turn):
        return []
    allowed, sideways = steps.length / radius * (1 + TOLERANCE), tolerance_yaw * steps.length
    findings = []
    for excess, tolerance, does in (
            (steps.turn - allowed, tolerance_yaw, f"turns left {{}} rad more than a radius of {radius:g} m allows"),
            (-steps.turn - allowed, tolerance_yaw, f"turns right {{}} rad more than a radius of {radius:g} m allows"),
            (steps.left - sideways, tolerance_xy, "runs {} m more to the left than its yaw allows"),
            (-steps.left - sideways, tolerance_xy, "runs {} m more to the right than its yaw allows"),
            (-steps.ahead, tolerance_xy, "runs {} m backward, which the vehicle cannot")):
        amount, first, last = _worst_stretch(excess)
        if amount > tolerance:
            x, y, _ = poses[first]
            on = fixed(float(steps.length[first:last].sum()), 3)
            findings.append(f"from pose {first} at {at((x, y), 3)} to pose {last}, {on} m on, "
                            f"the path {does.format(fixed(amount, 6))}")
    return findings


def _worst_stretch(excess: np.ndarray) -> tuple[float, int, int]:
    """Return the largest sum of successive values, the index of the first of them and that after the last."""
    total = np.append(0.0, np.cumsum(excess))
    last = int(np.argmax(total[1:] - np.minimum.accumulate(total[:-1]))) + 1
    first = int(np.argmin(total[:last]))
    return float(total[last] - total[first]), first, last
