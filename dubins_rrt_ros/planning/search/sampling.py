"""Random poses, towards which the tree grows."""

import math
from functools import cached_property

import numpy as np

from ..collision.clearance import ClearanceField
from ..curves.angles import wrap
from ..curves.path import Path
from ..hooks import draw_poses
from ..problem import Problem
from ..settings import Settings
from .cost import Objective
from .cost_to_go import CostToGo
from .headings import Headings

#: Maximum number of times that positions are drawn until enough lie in cells that may be free.
TRIALS = 64
#: Share of samples near the best path; standard deviation of their distance from it in turning radii, and of their angle [rad].
#: Both are scaled by a random factor, down to e to the power of -NEAR_FINENESS.
NEAR_SHARE = 0.1
NEAR_DISTANCE, NEAR_ANGLE, NEAR_FINENESS = 1.0, 0.5, 4.0


class Sampler:
    """Draws poses from one generator: positions uniform over the free space, headings as set, a share at the goal.

    Once there is a path, `informed` leaves out positions over which no cheaper one can lead, and draws a share near the path. All
    others stay uniform, so that RRT* stays asymptotically optimal: every place that matters is drawn again and again.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField, to_goal: CostToGo | None):
        """Prepare the draws; `to_goal` is needed where `from_start` will be given, and for headings along the cost-to-go."""
        self._problem, self._settings = problem, settings
        self._field, self._to_goal = field, to_goal
        self._objective = Objective.of(problem, settings, field)
        self._headings = Headings(problem, settings, to_goal)
        self._informed_set: tuple[np.ndarray, np.ndarray] | None = None  # squares, and lower bounds of the costs over them
        self._limit = math.inf  # of the costs over the informed set
        corners = problem.map.corners()
        self._corner, self._sides = corners[0], corners[[1, 3]] - corners[0]

    @cached_property
    def _rng(self) -> np.random.Generator:
        return np.random.default_rng(self._settings.seed)

    def draw(self, count: int, from_start: CostToGo | None = None, best: Path | None = None, goals: Problem | None = None
             ) -> np.ndarray:
        """Draw (count, 3) float64 poses: x [m], y [m], theta [rad].

        Args:
            from_start, best: bounds of the costs from the start, and the best path so far; the samples are informed by both.
            goals: the problem with the goals to draw, if these are not all that the problem allows.
        """
        sampler = self._settings.sampler
        poses = draw_poses(sampler, self._rng, count) if sampler else self._own_draw(count, from_start, best)
        at_goal = np.flatnonzero(self._rng.random(count) < self._settings.goal_bias)
        poses[at_goal] = self._goals(len(at_goal), goals or self._problem)
        return poses

    def _own_draw(self, count: int, from_start: CostToGo | None, best: Path | None) -> np.ndarray:
        """Draw (count, 3) poses as the settings say, none of them at the goal on purpose."""
        poses = np.empty((count, 3))
        if from_start and best:
            poses[:, :2] = self._where_cheaper(count, from_start, self._objective.path_cost(best))
        else:
            poses[:, :2] = self._anywhere(count)
        poses[:, 2] = self._headings.draw(poses[:, :2], self._rng)
        if from_start and best:
            near = np.flatnonzero(self._rng.random(count) < NEAR_SHARE)
            poses[near] = self._near(best, len(near))
        return poses

    def _anywhere(self, count: int) -> np.ndarray:
        """Draw (count, 2) positions that may be reached, as far as such are found."""
        kept: list[np.ndarray] = []
        missing = count
        for _ in range(TRIALS):
            drawn = self._corner + self._rng.random((count, 2)) @ self._sides
            kept.append(drawn[self._may_be_reached(drawn)][:missing])
            missing -= len(kept[-1])
            if missing == 0:
                break
        return np.concatenate([*kept, drawn[:missing]])

    def _may_be_reached(self, points: np.ndarray) -> np.ndarray:
        """Return (n,) bool: True where (n, 2) points may be free and, unless the sampling is plain, connected with the start."""
        required_clearance = self._problem.vehicle.required_clearance
        if self._settings.informed:
            components = self._field.components(required_clearance)
            if of_start := components[self._field.cells(np.array(self._problem.start[:2]))]:
                return np.asarray(components[self._field.cells(points)] == of_start)
        return self._field.may_be_free(points, required_clearance)

    def _where_cheaper(self, count: int, from_start: CostToGo, cost: float) -> np.ndarray:
        """Draw (count, 2) positions over which a path may cost less than `cost`; anywhere, where there are none."""
        assert self._to_goal is not None
        squares, bounds = self._informed_set or self._to_goal.squares_between(from_start)
        if cost < self._limit:
            self._limit = cost
            squares, bounds = squares[bounds < cost], bounds[bounds < cost]
        self._informed_set = squares, bounds
        if len(squares) == 0:
            return self._anywhere(count)
        drawn = squares[self._rng.integers(len(squares), size=count)]
        return self._to_goal.points_in(drawn, self._rng.random((count, 2)))

    def _near(self, best: Path, count: int) -> np.ndarray:
        """Draw (count, 3) poses near a path."""
        poses = best.at(self._rng.random(count))
        size = np.exp(-NEAR_FINENESS * self._rng.random(count))
        poses[:, :2] += (NEAR_DISTANCE * self._problem.vehicle.maneuver_scale * size)[:, None] * self._rng.normal(size=(count, 2))
        poses[:, 2] = wrap(poses[:, 2] + NEAR_ANGLE * size * self._rng.normal(size=count))
        return poses

    def _goals(self, count: int, problem: Problem) -> np.ndarray:
        """Draw (count, 3) poses that reach the goal: the goal itself, or uniform over its tolerance."""
        if problem.exact_goal:
            return np.tile(problem.goal, (count, 1))
        distance = problem.goal_tolerance_xy * np.sqrt(self._rng.random(count))
        bearing = self._rng.uniform(-math.pi, math.pi, count)
        turn = self._rng.uniform(-1, 1, count) * problem.yaw_tolerance
        return problem.goal + np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), turn])
