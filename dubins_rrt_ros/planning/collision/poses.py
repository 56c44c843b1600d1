"""Poses of a path on a map: at which of them, and between which, the vehicle touches an obstacle.

Nothing else is judged: vehicles that turn on the spot, drive backward or sideways may have such poses too. Between two poses the
vehicle is taken to drive the arc that turns from one heading to the other, where that leads from one to the other; else to move
and turn evenly, which is checked at samples.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from .._kernels.collision import CollisionChecker
from ..curves.angles import wrap
from ..curves.dubins import WORDS
from ..problem import Pose
from ..vehicle import Vehicle
from .clearance import ClearanceField
from .raster import CLEARANCE_MARGIN

#: Maximum distance of a pose from the arc that leads to it [m].
OFF_ARC = 1e-4
#: Maximum length that a point of the vehicle moves between two samples, where there is no arc [m].
SAMPLE_SPACING = 0.01
#: Minimum radius of an arc, for turns on the spot [m], and the turn up to which an arc is straight [rad].
LEAST_RADIUS, LEAST_TURN = 1e-6, 1e-9
#: Arcs as curves: the word, and which of its three arcs is driven, by the sign of the turn.
STRAIGHT, LEFT, RIGHT = (WORDS.index("LSL"), 1), (WORDS.index("LSL"), 0), (WORDS.index("RSR"), 0)


def blocked_poses(field: ClearanceField, vehicle: Vehicle, poses: np.ndarray) -> list[int]:
    """Return the indices of the poses at which the vehicle touches an obstacle, or after which it does before the next one.

    Contact that is deeper than twice CLEARANCE_MARGIN is always found, and a vehicle that touches nothing always passes.

    Args:
        field: the map's.
        vehicle: its outline counts alone.
        poses: (n, 3) x [m], y [m], yaw [rad], finite.
    """
    steps = _Steps.between(poses)
    clearance = field.at(poses[:, :2])
    reach = vehicle.circumscribed_radius
    checker = field.collision_checker(_slimmer(vehicle))
    free = clearance > 0
    for i in np.flatnonzero(free & (clearance < reach + CLEARANCE_MARGIN)).tolist():
        free[i] = checker.is_pose_free(poses[i].tolist())
    # No point of the vehicle moves farther than this from one pose to the next, and the clearance changes by a metre per metre.
    moved = steps.length + reach * np.abs(steps.turn)
    doubtful = (clearance[:-1] + clearance[1:] - moved) / 2 < reach + CLEARANCE_MARGIN
    blocked = ~free
    for i in np.flatnonzero(doubtful & free[:-1] & free[1:]).tolist():
        blocked[i] = not (_arc_is_free(checker, poses[i], steps, i) if steps.is_arc[i]
                          else _samples_are_free(checker, poses[i], poses[i + 1], float(moved[i])))
    return np.flatnonzero(blocked).tolist()


def nearest_pose(poses: np.ndarray, pose: Pose) -> int:
    """Return the index of the pose whose position is nearest to that of another, of equal ones the first."""
    return int(np.argmin(np.hypot(*(poses[:, :2] - pose[:2]).T)))


class _Steps(NamedTuple):
    """The steps from each pose to the next: the turn [rad], the arc's length [m], and whether it leads to the next pose."""

    turn: np.ndarray
    length: np.ndarray
    is_arc: np.ndarray

    @classmethod
    def between(cls, poses: np.ndarray) -> "_Steps":
        x, y, yaw = poses.T
        turn = wrap(np.diff(yaw))
        turn[np.abs(turn) < LEAST_TURN] = 0
        # As seen along the chord of the arc, which halves the turn.
        step = np.diff(x + 1j * y) * np.exp(-1j * (yaw[:-1] + turn / 2))
        is_arc = (np.abs(step.imag) <= OFF_ARC) & (step.real >= -OFF_ARC)
        return cls(turn, np.abs(step) / np.sinc(turn / math.tau), is_arc)


def _arc_is_free(checker: CollisionChecker, pose: np.ndarray, steps: _Steps, i: int) -> bool:
    turn, length = float(steps.turn[i]), float(steps.length[i])
    radius = max(length / abs(turn), LEAST_RADIUS) if turn else 1.0
    word, nth = STRAIGHT if turn == 0 else LEFT if turn > 0 else RIGHT
    lengths = [0.0, 0.0, 0.0]
    lengths[nth] = length if turn == 0 else radius * abs(turn)
    return bool(checker.is_motion_free(pose.tolist(), radius, word, lengths))


def _samples_are_free(checker: CollisionChecker, begin: np.ndarray, end: np.ndarray, moved: float) -> bool:
    step = end - begin
    step[2] = wrap(float(step[2]))
    shares = np.linspace(0, 1, math.ceil(moved / SAMPLE_SPACING) + 1)[1:-1]
    return all(checker.is_pose_free(pose) for pose in (begin + shares[:, None] * step).tolist())


def _slimmer(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle that passes, with the margin that the checkers ask for, wherever this one touches nothing."""
    if not vehicle.footprint:
        return replace(vehicle, robot_radius=max(0.0, vehicle.robot_radius - CLEARANCE_MARGIN))
    inner = shapely.Polygon(vehicle.footprint).buffer(-math.sqrt(2) * CLEARANCE_MARGIN, join_style="mitre")
    if not isinstance(inner, shapely.Polygon) or inner.is_empty:
        return vehicle  # as thin as that
    return Vehicle.from_footprint(shapely.get_coordinates(inner.exterior)[:-1].tolist(), turning_radius=vehicle.turning_radius)
