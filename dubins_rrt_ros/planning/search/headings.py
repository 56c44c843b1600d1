"""Headings of random poses: any, towards the goal, or along the way around obstacles to the goal."""

import math

import numpy as np

from ..curves.angles import wrap
from ..problem import Problem
from ..settings import Settings
from .cost_to_go import CostToGo

#: Share of uniform headings among mixed ones, and standard deviation of the others about the cost-to-go's [rad].
UNIFORM_SHARE = 0.2
DEVIATION = math.radians(20)

#: Kinds of headings that need the cost-to-go.
FOLLOW_COST_TO_GO = ("field", "mixed")


class Headings:
    """Draws headings for random positions, as `heading_sampling` says.

    `uniform` and `mixed` keep RRT* asymptotically optimal, since they draw all poses: a fixed share of `mixed`, UNIFORM_SHARE, is
    uniform. `goal` and `field` do not: they have one heading for a position, and the best path may need another.
    """

    def __init__(self, problem: Problem, settings: Settings, to_goal: CostToGo | None):
        """Prepare the draws; `to_goal` is needed for `field` and `mixed`."""
        self._kind = settings.heading_sampling
        self._goal = np.array(problem.goal[:2])
        self._to_goal = to_goal if self._kind in FOLLOW_COST_TO_GO else None

    def draw(self, positions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return (n,) headings [rad] for (n, 2) positions [m]; uniform ones where the cost-to-go leads nowhere."""
        if self._kind == "goal":
            towards = self._goal - positions
            return np.asarray(np.arctan2(towards[:, 1], towards[:, 0]))
        uniform = rng.uniform(-math.pi, math.pi, len(positions))
        if self._to_goal is None:
            return uniform
        downhill = self._to_goal.headings(positions)
        if self._kind == "mixed":
            downhill += rng.normal(0, DEVIATION, len(positions))
            downhill[rng.random(len(positions)) < UNIFORM_SHARE] = math.nan
        return np.where(np.isnan(downhill), uniform, wrap(downhill))
