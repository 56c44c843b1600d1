"""The tree of a search under way, and the best path in it."""

import math
from dataclasses import replace

import numpy as np

from .._kernels.rrt import RrtKernel
from .._kernels.tree import SearchTree
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..problem import Problem
from ..settings import Settings
from .cost import Objective
from .cost_bounds import CostBounds
from .cost_to_go import CostToGo
from .known_path import KnownPath
from .tree import Tree, path_to

#: The factor of log n in the number of near nodes, and their maximum number.
NEAR_FACTOR = math.e * (1 + 1 / 3)
MOST_NEAR = 512


class GrowingTree:
    """The tree, which grows by samples and by whole paths.

    Attributes:
        samples: number of samples used so far.
        best: the node that reaches the goal at the least cost, or -1.
        found_by: what found the path there, before it was smoothed: hybrid_astar, rrt, rrt_star or seed_path; "" without one.
        objective: what is minimised.
        nearest: position that the goal allows and that is preferred to all others, as long as no path leads there, or None.
        problem: the problem with the goals that count: once a path leads to `nearest`, these are the poses there.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField, nearest: np.ndarray | None = None):
        """Begin with the start alone.

        Args:
            nearest: (2,) position of those that the goal allows that is preferred to all others, or None.
        """
        self.problem = problem
        self.nearest = None if nearest is None or problem.goal_tolerance_xy == 0 else tuple(nearest.tolist())
        self.objective = Objective.of(problem, settings, field)
        self.samples = 0
        self.best = -1
        self.found_by = ""
        corners = problem.map.corners()
        self._tree = SearchTree(root=problem.start, radius=problem.vehicle.turning_radius, corner=corners.min(axis=0),
                                extent=np.ptp(corners, axis=0))
        self._kernel = RrtKernel(
            tree=self._tree, checker=field.collision_checker(problem.vehicle), edge_cost=self.objective.edge_cost(),
            step=settings.step_size, near_factor=NEAR_FACTOR, max_near=MOST_NEAR, goal=problem.goal,
            tolerance_xy=problem.goal_tolerance_xy, tolerance_yaw=problem.yaw_tolerance)
        self._step = settings.step_size

    @property
    def size(self) -> int:
        """The number of nodes."""
        return int(self._tree.size)

    @property
    def path(self) -> Path | None:
        """The best path so far, or None; the tree is not copied for it."""
        return path_to(self.best, self._tree) if self.best >= 0 else None

    @property
    def cost(self) -> float:
        """The cost of the best path so far [m]; infinite where there is none."""
        return float(self._tree.costs[self.best]) if self.best >= 0 else math.inf

    def copy(self) -> Tree:
        """Return a copy of the tree as it is."""
        return Tree.copy_of(self._tree)

    def take(self, samples: np.ndarray, begin: int, end: int, is_rrt: bool) -> int:
        """Add samples `begin` to `end` of (n, 3) to the tree, up to the first path; return the next one's index.

        Args:
            is_rrt: True for Algorithm 1, False for Algorithm 2.
        """
        self._kernel.reserve(end - begin)
        before = self.cost
        next_one = int((self._kernel.rrt if is_rrt else self._kernel.rrt_star)(samples, begin, end))
        self.samples += next_one - begin
        self.best = self._kernel.best_goal_node()
        if self.cost < before:
            self.found_by = "rrt" if is_rrt else "rrt_star"
        return next_one

    def insert_if_better(self, path: Path | None, found_by: str) -> None:
        """Add a path to the goal to the tree, if it is the best."""
        if path is not None and self.objective.path_cost(path) < self.cost:
            self._insert_found(path, found_by)

    def approach_nearest(self) -> None:
        """Lead the best path on to the nearest position, where it ends elsewhere and can be led there."""
        if self.nearest and (path := self.path):
            known = KnownPath(path, self.objective.field, self.problem.vehicle)
            if led_on := known.joined(path.start, (*self.nearest, path.end[2])):
                self._insert_found(led_on, self.found_by)

    def _insert_found(self, path: Path, found_by: str) -> None:
        if self._insert(path, self.best if self.problem.exact_goal else -1, narrow=path.end[:2] == self.nearest):
            self.found_by = found_by

    def insert_smoothed(self, path: Path) -> None:
        """Add the smoothed best path to the tree, if it is better."""
        if self.objective.path_cost(path) < self.cost:
            self._insert(path, self.best)

    def _insert(self, path: Path, end: int, narrow: bool = False) -> bool:
        """Add a path to the tree, unless a test of the user's refuses it.

        Args:
            end: the node at the end of the path, or -1 for none.
            narrow: True if nothing but the position of its end is to count as the goal from now on.
        """
        pieces = path.cut(self._step)
        if not self.objective.field.test_accepts(pieces):
            return False
        if narrow:
            self._kernel.narrow_goal(*path.end[:2])
            self.problem = replace(self.problem, goal=(*path.end[:2], self.problem.goal[2]), goal_tolerance_xy=0.0)
            self.nearest = None
        self._kernel.insert_path(pieces.waypoints, pieces.words, pieces.lengths, end)
        self.best = self._kernel.best_goal_node()
        return True

    def limit_to_best(self, bounds: CostBounds, from_start: CostToGo) -> None:
        """Add only what can be on a cheaper path than the best from now on, and forget other nodes."""
        self._kernel.set_cost_bound(self.cost, from_start.kernel, bounds.to_goal.kernel)
        wanted = bounds.nodes_to_keep(np.asarray(self._tree.poses)[:self.size, :2], self.cost)
        if wanted is not None:
            wanted[[0, self.best]] = True
            self._tree.prune_index(wanted.astype(np.int8))

    def rehash(self) -> None:
        """Keep the search for near nodes fast."""
        self._tree.rehash()
