"""RRT and RRT*: Algorithms 1 and 2 of A. Khanal, RRT and RRT* Using Vehicle Dynamics, batch by batch.

    all_links = [start]
    while N != n_iter:
        draw a random pose, sometimes the goal               Sampler.draw
        find the closest link                                Grower.steer
        steer along the Dubins curve towards the pose        Grower.steer
        unless it collides, add it                           Grower.extend
        RRT*: by the cheapest of the near links ...          Grower.choose_parent
              ... and reroute those that gain by it          Grower.rewire
    shorten the best path                                    Search.shorten

The closest link is the one with the shortest Dubins curve to the pose. Near are the e (1 + 1/3) log n links with the shortest
curves to it (the k-nearest RRT* of Karaman and Frazzoli, 2011, for three dimensions), and all within the longest of these
curves' length from it.
"""

import math
import time

import numpy as np

from ._kernels.grow import Grower
from ._kernels.tree import SearchTree
from .clearance import ClearanceField
from .path import Path
from .problem import Problem
from .sampling import Sampler
from .settings import Settings
from .shortcut import shortened
from .tree import Tree

NEAR_FACTOR = math.e * (1 + 1 / 3)
MOST_NEAR = 512
#: Samples are drawn in blocks of this size, however many are used: the draws depend neither on the time nor on the budget.
BLOCK = 256
#: About how long a batch takes [s]: so long does a cancellation wait.
BATCH_TIME = 0.005


class Search:
    """A search under way.

    Attributes:
        samples: how many samples were used so far.
        best: the node that reaches the goal at the least cost, or -1.

    Whoever grows it calls `shorten` after each batch.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField):
        corners = problem.map.corners()
        lowest, extent = corners.min(axis=0), corners.max(axis=0) - corners.min(axis=0)
        vehicle = problem.vehicle
        self._tree = SearchTree(problem.start, vehicle.turning_radius, lowest, extent)
        self._grower = Grower(self._tree, field.kernel, vehicle.robot_radius, settings.step_size, NEAR_FACTOR, MOST_NEAR,
                              problem.goal, problem.goal_tolerance_xy, problem.yaw_tolerance)
        self._grow = self._grower.rrt if settings.planner == "rrt" else self._grower.rrt_star
        self._sampler = Sampler(problem, settings, field)
        self._problem = problem
        self._settings = settings
        self._field = field
        self._shortest: Path | None = None
        self._cost_shortened = math.inf
        self._block = self._sampler.draw(0)
        self._used = 0
        self._batch = 8
        self.samples = 0
        self.best = -1

    @property
    def size(self) -> int:
        """How many nodes the tree has."""
        return self._tree.size

    @property
    def tree(self) -> Tree:
        """A copy of the tree."""
        return Tree.copy_of(self._tree)

    @property
    def length(self) -> float | None:
        """Of the best path so far [m], or None."""
        if self.best < 0:
            return None
        cost = self._tree.costs[self.best]
        return min(cost, self._shortest.length) if self._shortest else cost

    @property
    def path(self) -> Path | None:
        """The best path so far: the tree's, or a shorter one that shortcuts made of it or of an earlier one; or None."""
        if self._shortest and self._shortest.length <= self._tree.costs[self.best]:
            return self._shortest
        return self._path_in_tree() if self.best >= 0 else None

    @property
    def done(self) -> bool:
        """Whether the budget is used, or RRT has its path."""
        return self.samples == self._settings.samples or (self.best >= 0 and self._settings.planner == "rrt")

    def grow(self) -> None:
        """Grow by a batch of samples, which ends early with the first path."""
        if self._used == len(self._block):
            self._block = self._sampler.draw(BLOCK, math.inf if self.length is None else self.length)
            self._used = 0
        left = self._settings.samples - self.samples
        begin, end = self._used, min(self._used + min(self._batch, left), len(self._block))
        self._grower.reserve(end - begin)
        started = time.perf_counter()
        self._used = self._grow(self._block, begin, end)
        took = time.perf_counter() - started
        grown = self._used - begin
        self.samples += grown
        self.best = self._grower.best_goal_node()
        self._batch = min(max(1, int(BATCH_TIME * grown / max(took, 1e-6))), 2 * self._batch, BLOCK)

    def shorten(self, ended: bool) -> None:
        """Try shortcuts of the tree's best path, where it is a new one and the moment is right. The tree stays as it is.

        The moments depend on the samples alone: at the first path, at the end of a block, and when the search has `ended`. So a
        budget of whole blocks never gives a longer path than a smaller one of whole blocks. Of other budgets only the trees'
        paths are so ordered: the shortcuts of a longer path can be the better ones.
        """
        right = ended or self._shortest is None or self._used == len(self._block)
        if not (right and self._settings.shortcut and self.best >= 0 and self._tree.costs[self.best] < self._cost_shortened):
            return
        self._cost_shortened = self._tree.costs[self.best]
        path = shortened(self._path_in_tree(), self._field, self._problem.vehicle.robot_radius)
        if self._shortest is None or path.length < self._shortest.length:
            self._shortest = path

    def _path_in_tree(self) -> Path:
        """The path to `best`; the tree is not copied for it."""
        grown = self._tree
        arrays = (np.asarray(view) for view in (grown.poses, grown.parents, grown.costs, grown.words, grown.lengths))
        return Tree(grown.radius, *arrays).path_to(self.best)
