"""The headings of random poses: any, towards the goal, or along the way around obstacles to the goal."""

import math

import numpy as np

from ..curves.angles import wrap
from ..problem import Problem
from ..settings import Settings
from .cost_to_go import DistanceField

#: Mixed headings: the share of uniform ones, and the standard deviation of the others about the field [rad].
UNIFORM_SHARE = 0.2
SPREAD = math.radians(20)

#: The kinds of headings that need the distances to the goal.
FOLLOW_FIELD = ("field", "mixed")


class Headings:
    """Draws headings for random positions, as `heading_sampling` says.

    `uniform` and `mixed` keep RRT* asymptotically optimal, since they draw all poses: a fixed share of `mixed`, UNIFORM_SHARE, is
    uniform. `goal` and `field` do not: they have one heading for a position, and the best path may need another.
    """

    def __init__(self, problem: Problem, settings: Settings, to_goal: DistanceField | None):
        """`to_goal` is needed for `field` and `mixed`."""
        self._kind = settings.heading_sampling
        self._goal = np.array(problem.goal[:2])
        self._field = to_goal if self._kind in FOLLOW_FIELD else None

    def draw(self, positions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """(n,) headings [rad] for (n, 2) positions [m]; uniform ones where the field has none."""
        if self._kind == "goal":
            towards = self._goal - positions
            return np.arctan2(towards[:, 1], towards[:, 0])
        uniform = rng.uniform(-math.pi, math.pi, len(positions))
        if self._field is None:
            return uniform
        led = self._field.headings(positions)
        if self._kind == "mixed":
            led += rng.normal(0, SPREAD, len(positions))
            led[rng.random(len(positions)) < UNIFORM_SHARE] = math.nan
        return np.where(np.isnan(led), uniform, wrap(led))
