"""The nearest pose at which the vehicle is free, for a goal that is too near to an obstacle."""

import math

import numpy as np

from ..collision.clearance import ClearanceField
from ..problem import Pose, Problem

#: Range of the distances at which free poses are sought, in circumscribed radii and at least [m], and numbers of distances and of
#: directions.
NEAREST, FARTHEST, DISTANCES, DIRECTIONS = 0.01, 4.0, 48, 48
LEAST_RADIUS = 0.1
#: Number of times that the last interval of distances is halved.
HALVINGS = 6


def nearest_free_pose(problem: Problem, field: ClearanceField, pose: Pose) -> Pose | None:
    """Return about the nearest pose with the same heading at which the vehicle is free, or None where none is near."""
    x, y, theta = pose
    size = max(problem.vehicle.circumscribed_radius, LEAST_RADIUS)
    directions = [(math.cos(math.tau * n / DIRECTIONS), math.sin(math.tau * n / DIRECTIONS)) for n in range(DIRECTIONS)]

    checker = field.collision_checker(problem.vehicle)

    def first_free(distance: float) -> Pose | None:
        poses = ((x + distance * c, y + distance * s, theta) for c, s in directions)
        return next((pose for pose in poses if checker.is_pose_free(pose) and field.at(np.array(pose[:2])) > 0), None)

    before = 0.0
    for n in range(DISTANCES):
        distance = NEAREST * size * (FARTHEST / NEAREST) ** (n / (DISTANCES - 1))
        if found := first_free(distance):
            for _ in range(HALVINGS):
                middle = (before + distance) / 2
                nearer = first_free(middle)
                before, distance, found = (before, middle, nearer) if nearer else (middle, distance, found)
            return found
        before = distance
    return None
