"""The audit of poses alone, such as those of another planner: of what a car does that drives from each to the next.

Between two poses it drives the arc of constant curvature that turns from the one's yaw to the other's. A car's poses lie on such
arcs; what a pose is off, to the side or behind, no car can drive. As much as few digits account for is granted, but it must not
add up: so every stretch of the path is judged, from one step to all of it.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..problem import Problem
from .sweep import Arcs, clearance_findings
from .verdict import TOLERANCE, Audit, apart, goal_findings

#: A step shorter than this is a turn on the spot [m].
STEP = 1e-9


def audit_poses(poses: np.ndarray, problem: Problem, tolerance_xy: float = 1e-3, tolerance_yaw: float = 1e-3) -> Audit:
    """Judge poses that a vehicle shall drive through: their ends, whether a car can drive so, and the clearance in between.

    Over a stretch of any length they may turn by `tolerance_yaw` more than the turning radius allows, run to the side by
    `tolerance_xy` and a share of `tolerance_yaw` of the length, and back by `tolerance_xy`. The most that a pose is off its
    arc is added to the clearance needed.

    Args:
        poses: (n, 3) x [m], y [m], yaw [rad], finite; at least one.
        problem: with the map, the vehicle and the ends.
        tolerance_xy, tolerance_yaw: how far poses may be off [m, rad].

    Returns:
        The findings, of each kind the worst. The greatest curvature is that of single steps, where few digits show most.
    """
    steps = _Steps.between(poses)
    findings = [*_end_findings(poses, problem, tolerance_xy, tolerance_yaw),
                *_motion_findings(poses, steps, problem.vehicle.turning_radius, tolerance_xy, tolerance_yaw)]
    # Of poses that no car drives through the clearance is that of the arcs alone.
    slack = 0.0 if findings else steps.slack(problem.vehicle.robot_radius)
    too_near, least = clearance_findings(steps.arcs(poses), problem, slack)
    return Audit((*findings, *too_near), least, float(np.abs(steps.curvature).max(initial=0.0)))


def driven_length(poses: np.ndarray) -> float:
    """Of the arcs through poses (n, 3) [m]."""
    return float(_Steps.between(poses).length.sum())


@dataclass(frozen=True)
class _Steps:
    """From each pose to the next: by how much it turns [rad], and the arc's length, what it is off to the left and ahead [m]."""

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
        """Of the arcs [1/m]; 0 on the spot."""
        return np.asarray(np.divide(self.turn, self.length, out=np.zeros(len(self.turn)), where=self.length > STEP))

    def slack(self, reach: float) -> float:
        """How far a vehicle that reaches so far around its reference point may be from where the arcs have it [m]."""
        on_the_spot = np.where(self.length > STEP, 0.0, np.abs(self.turn))
        return float((np.hypot(self.left, self.ahead) + reach * on_the_spot).max(initial=0.0))

    def arcs(self, poses: np.ndarray) -> Arcs:
        """What is driven, and the last pose."""
        x, y, theta = poses.T
        return Arcs(x, y, theta, np.append(self.curvature, 0.0), np.append(self.length, 0.0))


def _end_findings(poses: np.ndarray, problem: Problem, tolerance_xy: float, tolerance_yaw: float) -> list[str]:
    findings = []
    off, turned = apart(poses[0], problem.start)
    if off > tolerance_xy or turned > tolerance_yaw:
        findings.append(f"the path starts {off:.6f} m and {turned:.6f} rad from the start")
    return findings + goal_findings(poses[-1], problem, tolerance_xy, tolerance_yaw)


def _motion_findings(poses: np.ndarray, steps: _Steps, radius: float, tolerance_xy: float, tolerance_yaw: float) -> list[str]:
    """What no car of the turning radius does."""
    if not len(steps.turn):
        return []
    allowed, row_gap = steps.length / radius * (1 + TOLERANCE), tolerance_yaw * steps.length
    findings = []
    for excess, tolerance, does in (
            (steps.turn - allowed, tolerance_yaw, f"turns left {{:.6f}} rad more than a radius of {radius:g} m allows"),
            (-steps.turn - allowed, tolerance_yaw, f"turns right {{:.6f}} rad more than a radius of {radius:g} m allows"),
            (steps.left - row_gap, tolerance_xy, "runs {:.6f} m more to the left than its yaw allows"),
            (-steps.left - row_gap, tolerance_xy, "runs {:.6f} m more to the right than its yaw allows"),
            (-steps.ahead, tolerance_xy, "runs {:.6f} m backward, which the vehicle cannot")):
        amount, first, last = _worst_stretch(excess)
        if amount > tolerance:
            x, y, _ = poses[first]
            findings.append(f"from pose {first} at ({x:.3f}, {y:.3f}) to pose {last}, {steps.length[first:last].sum():.3f} m on, "
                            f"the path {does.format(amount)}")
    return findings


def _worst_stretch(excess: np.ndarray) -> tuple[float, int, int]:
    """The largest sum of successive values, the index of the first of them and that after the last."""
    total = np.append(0.0, np.cumsum(excess))
    last = int(np.argmax(total[1:] - np.minimum.accumulate(total[:-1]))) + 1
    first = int(np.argmin(total[:last]))
    return float(total[last] - total[first]), first, last
