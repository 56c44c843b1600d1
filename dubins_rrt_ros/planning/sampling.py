"""Random poses: where the tree is to grow next."""

import math

import numpy as np

from .clearance import ClearanceField
from .headings import Headings
from .problem import Pose, Problem
from .settings import Settings

#: How many times positions are drawn anew until enough lie in cells that may be free.
ROUNDS = 64


class Sampler:
    """Draws poses from one generator: positions uniform over the free space, headings as set, a share at the goal."""

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField):
        self._problem = problem
        self._settings = settings
        self._field = field
        self._headings = Headings(problem, settings, field)
        self._rng = np.random.default_rng(settings.seed)
        corners = problem.map.corners()
        self._corner, self._sides = corners[0], corners[[1, 3]] - corners[0]
        self._area = float(np.prod(np.hypot(*self._sides.T)))

    def draw(self, count: int, best: float = math.inf) -> np.ndarray:
        """(count, 3) float64 poses: x [m], y [m], theta [rad].

        With `informed` their positions are such that a path over them can be shorter than `best` [m].
        """
        poses = np.empty((count, 3))
        poses[:, :2] = self._positions(count, best if self._settings.informed else math.inf)
        poses[:, 2] = self._headings.draw(poses[:, :2], self._rng)
        at_goal = np.flatnonzero(self._rng.random(count) < self._settings.goal_bias)
        poses[at_goal] = self._goals(len(at_goal))
        return poses

    def _positions(self, count: int, best: float) -> np.ndarray:
        """(count, 2) positions that may be free, and over which a path can be shorter than `best`; as far as there are such."""
        problem = self._problem
        ellipse = _Ellipse(problem.start, problem.goal, best + problem.goal_tolerance_xy)
        kept, missing = [], count
        for _ in range(ROUNDS):
            if ellipse.area < self._area:
                drawn = ellipse.draw(self._rng, count)
                serves = self._in_map(drawn)
            else:
                drawn = self._corner + self._rng.random((count, 2)) @ self._sides
                serves = ellipse.contains(drawn)
            kept.append(drawn[serves & self._field.may_be_free(drawn, problem.vehicle.robot_radius)][:missing])
            missing -= len(kept[-1])
            if missing == 0:
                break
        return np.concatenate([*kept, drawn[:missing]])

    def _in_map(self, points: np.ndarray) -> np.ndarray:
        """(n,) bool: whether (n, 2) points lie in the map's rectangle."""
        share = (points - self._corner) @ self._sides.T / (self._sides**2).sum(axis=1)
        return ((share >= 0) & (share < 1)).all(axis=1)

    def _goals(self, count: int) -> np.ndarray:
        """(count, 3) poses that reach the goal: the goal itself, or uniform over its tolerance."""
        problem = self._problem
        if problem.exact_goal:
            return np.tile(problem.goal, (count, 1))
        distance = problem.goal_tolerance_xy * np.sqrt(self._rng.random(count))
        bearing = self._rng.uniform(-math.pi, math.pi, count)
        turn = self._rng.uniform(-1, 1, count) * problem.yaw_tolerance
        return problem.goal + np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), turn])


class _Ellipse:
    """The points whose distances from start and goal together are at most `total` [m]; all the plane where that is infinite.

    J. D. Gammell, S. S. Srinivasa and T. D. Barfoot, Informed RRT* (2014): no other point lies on a path that is shorter, since
    a Dubins curve is no shorter than the straight line.
    """

    def __init__(self, start: Pose, goal: Pose, total: float):
        self._start, self._goal, self._total = np.array(start[:2]), np.array(goal[:2]), total
        apart = min(math.dist(start[:2], goal[:2]), total)
        self._half_axes = total / 2, math.sqrt((total - apart) * (total + apart)) / 2
        self.area = math.pi * self._half_axes[0] * self._half_axes[1]

    def contains(self, points: np.ndarray) -> np.ndarray:
        """(n,) bool, of (n, 2) points."""
        return np.hypot(*(points - self._start).T) + np.hypot(*(points - self._goal).T) <= self._total

    def draw(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """(count, 2) points, uniform over it."""
        distance, bearing = np.sqrt(rng.random(count)), rng.uniform(-math.pi, math.pi, count)
        along, across = np.array([distance * np.cos(bearing), distance * np.sin(bearing)]) * np.array(self._half_axes)[:, None]
        dx, dy = self._goal - self._start
        c, s = math.cos(math.atan2(dy, dx)), math.sin(math.atan2(dy, dx))
        return (self._start + self._goal) / 2 + np.column_stack([c * along - s * across, s * along + c * across])
