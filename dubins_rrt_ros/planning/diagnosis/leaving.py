"""Room to drive in: the proof that no path leaves a pose, and the room to turn round on the way to the goal."""

import math

import numpy as np
from scipy import ndimage

from ..collision.clearance import ClearanceField
from ..collision.raster import CLEARANCE_MARGIN
from ..problem import Pose, Problem
from ..vehicle import Point

#: Number of cells along a turning radius by which the way ahead of a pose is looked at.
CELLS = 64
#: Turn against the way to the goal from which on the vehicle has to turn round on it [rad].
AGAINST = 2.0


def cannot_leave(problem: Problem, field: ClearanceField, pose: Pose) -> bool:
    """Return True if provably no path leads on from a pose: none comes as far ahead as the turning radius.

    A quarter turn from the pose a path is a turning radius R ahead, or more, whatever it turns; as far as there it runs outside
    of both turning circles, so that at f <= R ahead it is at most R - sqrt(R^2 - f^2) beside. So it crosses that region, in
    which it keeps the required clearance. Here the region is made of squares, of which those count that may hold a point of it
    and may hold a point with that clearance: where these do not lead across, no path does. The way back from the goal is such a
    path too.
    """
    radius = problem.vehicle.turning_radius
    if (problem.start_slack > 0 or math.dist(problem.start[:2], problem.goal[:2])
            <= math.sqrt(2) * radius + problem.goal_tolerance_xy):
        return False
    size = radius / CELLS
    ahead, across = size * (np.arange(CELLS) + 0.5)[:, None], size * (np.arange(-CELLS, CELLS) + 0.5)
    farthest = np.minimum(ahead + size / 2, radius)
    # A difference of squares may be negative by rounding where this is 0.
    beside = radius - np.sqrt((radius - farthest) * (radius + farthest))
    inside = np.abs(across) - size / 2 <= beside + CLEARANCE_MARGIN
    c, s = math.cos(pose[2]), math.sin(pose[2])
    middles = np.stack([pose[0] + c * ahead - s * across, pose[1] + s * ahead + c * across], axis=-1)
    enough = np.zeros(inside.shape, bool)
    enough[inside] = field.at(middles[inside]) + size / math.sqrt(2) >= problem.vehicle.required_clearance
    parts, _ = ndimage.label(inside & enough, structure=np.ones((3, 3)))
    last = parts[-1]
    return not np.isin(parts[0], last[last > 0]).any()


def room_to_turn(problem: Problem, field: ClearanceField, points: np.ndarray) -> tuple[float, Point] | None:
    """Return the width of the widest place that can be reached [m], and where it is, if that is too narrow to turn round.

    Args:
        problem, field: what was searched.
        points: (n, 2) along a passage from start to goal [m].

    Returns:
        None where there is room enough, and where neither start nor goal heads against the passage.
    """
    if not _heads_against(problem, points):
        return None
    parts = field.components(problem.vehicle.required_clearance)
    row, column = field.cells(np.array(problem.start[:2]))
    clearance = np.where(parts == parts[row, column], np.asarray(field.kernel.field), 0.0)
    widest = np.array(np.unravel_index(int(np.argmax(clearance)), clearance.shape))
    x, y = field.frame.to_map((widest[::-1] + 0.5) * field.kernel.resolution).tolist()
    width = 2 * float(field.at(np.array([x, y])))
    enough = 2 * (problem.vehicle.turning_radius + problem.vehicle.inscribed_radius)
    return (width, (x, y)) if width + 2 * math.sqrt(2) * field.kernel.resolution < enough else None


def _heads_against(problem: Problem, points: np.ndarray) -> bool:
    """Return True if the start, or an exact goal, heads against a passage, as far as it leads within a turning radius."""
    ends = [(problem.start, points, 0.0)] + [(problem.goal, points[::-1], math.pi)] * problem.exact_goal
    for pose, way, back in ends:
        away = np.hypot(*(way - way[0]).T)
        dx, dy = (way[int(np.argmax(away >= min(problem.vehicle.turning_radius, away.max())))] - way[0]).tolist()
        if abs(math.remainder(math.atan2(dy, dx) + back - pose[2], math.tau)) > AGAINST:
            return True
    return False
