"""The poses that a search aims at: the goal, or within its tolerance the nearest to it that are free."""

import math
from itertools import pairwise

import numpy as np

from ..collision.clearance import ClearanceField
from ..curves import dubins
from ..curves.angles import wrap
from ..problem import Problem

#: Number of headings at a goal whose heading has a tolerance, but for its own.
HEADINGS_AT_GOAL = 16
#: Numbers of distances from a goal that is not free, and of directions, in which a free position is sought within its tolerance.
DISTANCES_AT_GOAL, BEARINGS_AT_GOAL = 32, 96
#: Number of times that the step between two distances is halved then.
HALVINGS = 8
#: Length by which curves to all these headings are longer than an arc and a straight, in turning radii, from which on the heading
#: of these is added.
DETOUR = math.pi
#: Maximum share of the tolerances that is used, so that rounding does not lead out of them.
WITHIN = 1 - 1e-9


def goal_poses(problem: Problem, field: ClearanceField) -> np.ndarray:
    """Return (m, 3) poses that reach the goal, all at the free position nearest to it, which is mostly the goal's own.

    They have the goal's heading, and others where that has a tolerance. Where no position is free they are at the goal.
    """
    positions = _FreePositions(problem, field)
    nearest = positions.nearest() if problem.goal_tolerance_xy > 0 else None
    position = problem.goal[:2] if nearest is None else nearest.tolist()
    return positions.poses_at(np.array(position))


class _FreePositions:
    """Positions where a vehicle may stand at the end of a path, as far as they can be told from the map."""

    def __init__(self, problem: Problem, field: ClearanceField):
        self._problem, self._field = problem, field
        self._checker = field.collision_checker(problem.vehicle)
        heading, tolerance = problem.goal[2], WITHIN * problem.yaw_tolerance
        turns = tolerance * np.linspace(-1, 1, HEADINGS_AT_GOAL + 1)[1:] if tolerance > 0 else np.empty(0)
        self._headings = np.append(heading, wrap(heading + turns))

    def poses_at(self, position: np.ndarray) -> np.ndarray:
        """Return (m, 3) poses at (2,) position, with headings that the goal allows."""
        poses = np.column_stack([np.tile(position, (len(self._headings), 1)), self._headings])
        straight = self._at_end_of_straight(position)
        if not len(straight):
            return poses
        start, radius = np.array([self._problem.start]), self._problem.vehicle.turning_radius
        lengths, shorter = (dubins.lengths(start, some, radius) for some in (poses, straight))
        return np.vstack([poses, straight[[np.argmin(shorter)]]]) if shorter.min() < lengths.min() - DETOUR * radius else poses

    def _at_end_of_straight(self, position: np.ndarray) -> np.ndarray:
        """Return (m, 3) poses at (2,) position to which an arc and a straight lead from the start, as far as the goal allows."""
        (x, y, theta), radius = self._problem.start, self._problem.vehicle.turning_radius
        poses = []
        for side in (1, -1):  # the straight is a tangent of the circle of the arc, whose middle is to the left or to the right
            east, north = position - (x - side * radius * math.sin(theta), y + side * radius * math.cos(theta))
            if (distance := math.hypot(east, north)) > radius:
                heading = wrap(math.atan2(north, east) + side * math.asin(radius / distance))
                if abs(wrap(heading - self._headings[0])) <= WITHIN * self._problem.yaw_tolerance:
                    poses.append((*position.tolist(), heading))
        return np.array(poses).reshape(-1, 3)

    def nearest(self) -> np.ndarray | None:
        """Return the (2,) free position nearest to the goal, of those tried; None where none is free."""
        goal = np.array(self._problem.goal[:2])
        if len(self._free(goal, 0.0, np.zeros((1, 2)))):
            return goal
        bearings = np.linspace(0, math.tau, BEARINGS_AT_GOAL, endpoint=False)
        directions = np.column_stack([np.cos(bearings), np.sin(bearings)])
        distances = WITHIN * self._problem.goal_tolerance_xy * np.linspace(0, 1, DISTANCES_AT_GOAL + 1)
        for low, high in pairwise(distances.tolist()):
            if len(free := self._free(goal, high, directions)):
                return self._refined(goal, low, high, free)
        return None

    def _refined(self, goal: np.ndarray, low: float, high: float, directions: np.ndarray) -> np.ndarray:
        """Return the nearest free position found by bisection: at the distance `high` all directions lead to one."""
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            if len(free := self._free(goal, middle, directions)):
                high, directions = middle, free
            else:
                low = middle
        nearest: np.ndarray = goal + high * directions[0]
        return nearest

    def _free(self, goal: np.ndarray, distance: float, directions: np.ndarray) -> np.ndarray:
        """Return those of (n, 2) unit vectors that lead to a free position at a distance from the goal."""
        positions = goal + distance * directions
        free = self._may_be_reached(positions)
        free[free] = [self._is_free(position) for position in positions[free]]
        leading: np.ndarray = directions[free]
        return leading

    def _may_be_reached(self, positions: np.ndarray) -> np.ndarray:
        """Return (n,) bool: False where the reference point has too little room, or is cut off from the start."""
        required_clearance = self._problem.vehicle.required_clearance
        if required_clearance < 0:
            return np.ones(len(positions), bool)
        clearances = self._field.at(positions)
        enough = (clearances > 0) & (clearances >= required_clearance)
        components = self._field.components(required_clearance)
        if of_start := components[self._field.cells(np.array(self._problem.start[:2]))]:
            enough &= components[self._field.cells(positions)] == of_start
        return np.asarray(enough)

    def _is_free(self, position: np.ndarray) -> bool:
        headings = self._headings if self._problem.vehicle.footprint else self._headings[:1]
        return any(self._checker.is_pose_free((*position.tolist(), heading)) for heading in headings.tolist())
