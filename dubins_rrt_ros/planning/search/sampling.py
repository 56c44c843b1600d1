"""Random poses: where the tree is to grow next."""

import math

import numpy as np

from ..collision.clearance import ClearanceField
from ..curves.angles import wrap
from ..curves.path import Path
from ..problem import Problem
from ..settings import Settings
from .cost_to_go import DistanceField
from .headings import Headings

#: How many times positions are drawn anew until enough lie in cells that may be free.
ROUNDS = 64
#: The share of samples near the best path, and how far they are from it at most: the standard deviation of the distance in
#: turning radii, and that of the angle [rad]. Both are made smaller by a random factor, down to e to the power of -NEAR_FINENESS.
NEAR_SHARE = 0.1
NEAR_DISTANCE, NEAR_ANGLE, NEAR_FINENESS = 1.0, 0.5, 4.0


class Sampler:
    """Draws poses from one generator: positions uniform over the free space, headings as set, a share at the goal.

    Once there is a path, `informed` leaves out positions over which no shorter one can lead, and draws a share near the path. All
    others stay uniform, so that RRT* stays asymptotically optimal: every place that matters is drawn again and again.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField, to_goal: DistanceField | None):
        self._problem = problem
        self._settings = settings
        self._field = field
        self._to_goal = to_goal
        self._headings = Headings(problem, settings, to_goal)
        self._rng = np.random.default_rng(settings.seed)
        self._squares: np.ndarray | None = None  # over which paths shorter than the next may lead, and how short they may be
        self._shortest_over: np.ndarray | None = None
        self._squares_for = math.inf
        corners = problem.map.corners()
        self._corner, self._sides = corners[0], corners[[1, 3]] - corners[0]

    def draw(self, count: int, from_start: DistanceField | None = None, best: Path | None = None) -> np.ndarray:
        """(count, 3) float64 poses: x [m], y [m], theta [rad].

        Args:
            from_start, best: the distances from the start and the best path so far, where the samples are to be informed by them.
        """
        poses = np.empty((count, 3))
        if from_start and best:
            poses[:, :2] = self._where_shorter(count, from_start, best.length)
        else:
            poses[:, :2] = self._anywhere(count)
        poses[:, 2] = self._headings.draw(poses[:, :2], self._rng)
        if from_start and best:
            near = np.flatnonzero(self._rng.random(count) < NEAR_SHARE)
            poses[near] = self._near(best, len(near))
        at_goal = np.flatnonzero(self._rng.random(count) < self._settings.goal_bias)
        poses[at_goal] = self._goals(len(at_goal))
        return poses

    def _anywhere(self, count: int) -> np.ndarray:
        """(count, 2) positions that may be free, as far as such are found."""
        kept, missing = [], count
        for _ in range(ROUNDS):
            drawn = self._corner + self._rng.random((count, 2)) @ self._sides
            kept.append(drawn[self._field.may_be_free(drawn, self._problem.vehicle.inscribed_radius)][:missing])
            missing -= len(kept[-1])
            if missing == 0:
                break
        return np.concatenate([*kept, drawn[:missing]])

    def _where_shorter(self, count: int, from_start: DistanceField, best: float) -> np.ndarray:
        """(count, 2) positions over which a path shorter than `best` may lead; anywhere, where there are none."""
        if self._squares is None:
            self._squares, self._shortest_over = self._to_goal.squares_between(from_start)
        if best < self._squares_for:
            self._squares_for = best
            serve = self._shortest_over < best
            self._squares, self._shortest_over = self._squares[serve], self._shortest_over[serve]
        if len(self._squares) == 0:
            return self._anywhere(count)
        drawn = self._squares[self._rng.integers(len(self._squares), size=count)]
        return self._to_goal.points_in(drawn, self._rng.random((count, 2)))

    def _near(self, best: Path, count: int) -> np.ndarray:
        """(count, 3) poses near a path."""
        radius = self._problem.vehicle.turning_radius
        poses = best.at(self._rng.random(count))
        size = np.exp(-NEAR_FINENESS * self._rng.random(count))
        poses[:, :2] += (NEAR_DISTANCE * radius * size)[:, None] * self._rng.normal(size=(count, 2))
        poses[:, 2] = wrap(poses[:, 2] + NEAR_ANGLE * size * self._rng.normal(size=count))
        return poses

    def _goals(self, count: int) -> np.ndarray:
        """(count, 3) poses that reach the goal: the goal itself, or uniform over its tolerance."""
        problem = self._problem
        if problem.exact_goal:
            return np.tile(problem.goal, (count, 1))
        distance = problem.goal_tolerance_xy * np.sqrt(self._rng.random(count))
        bearing = self._rng.uniform(-math.pi, math.pi, count)
        turn = self._rng.uniform(-1, 1, count) * problem.yaw_tolerance
        return problem.goal + np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), turn])
