"""Random poses: where the tree is to grow next."""

import math

import numpy as np

from .clearance import ClearanceField
from .problem import Problem
from .settings import Settings

#: How many times positions are drawn anew until enough lie in cells that may be free.
ROUNDS = 64


class Sampler:
    """Draws poses from one generator: positions uniform over the free space, headings as set, a share at the goal."""

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField):
        self._problem = problem
        self._settings = settings
        self._field = field
        self._rng = np.random.default_rng(settings.seed)
        corners = problem.map.corners()
        self._corner, self._sides = corners[0], corners[[1, 3]] - corners[0]

    def draw(self, count: int) -> np.ndarray:
        """(count, 3) float64 poses: x [m], y [m], theta [rad]."""
        poses = np.empty((count, 3))
        poses[:, :2] = self._positions(count)
        if self._settings.heading_sampling == "goal":
            towards = np.array(self._problem.goal[:2]) - poses[:, :2]
            poses[:, 2] = np.arctan2(towards[:, 1], towards[:, 0])
        else:
            poses[:, 2] = self._rng.uniform(-math.pi, math.pi, count)
        at_goal = np.flatnonzero(self._rng.random(count) < self._settings.goal_bias)
        poses[at_goal] = self._goals(len(at_goal))
        return poses

    def _positions(self, count: int) -> np.ndarray:
        """(count, 2) positions; those that may be free, as far as the map has any."""
        need = self._problem.vehicle.robot_radius
        kept, missing = [], count
        for _ in range(ROUNDS):
            drawn = self._corner + self._rng.random((count, 2)) @ self._sides
            kept.append(drawn[self._field.may_be_free(drawn, need)][:missing])
            missing -= len(kept[-1])
            if missing == 0:
                break
        return np.concatenate([*kept, drawn[:missing]])

    def _goals(self, count: int) -> np.ndarray:
        """(count, 3) poses that reach the goal: the goal itself, or uniform over its tolerance."""
        problem = self._problem
        if problem.exact_goal:
            return np.tile(problem.goal, (count, 1))
        distance = problem.goal_tolerance_xy * np.sqrt(self._rng.random(count))
        bearing = self._rng.uniform(-math.pi, math.pi, count)
        turn = self._rng.uniform(-1, 1, count) * problem.yaw_tolerance
        return problem.goal + np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), turn])
