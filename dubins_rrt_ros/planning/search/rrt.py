"""RRT and RRT*: Algorithms 1 and 2 of A. Khanal, RRT and RRT* Using Vehicle Dynamics, batch by batch.

    all_links = [start]
    while N != n_iter:
        draw a random pose, sometimes the goal               Sampler.draw
        find the closest link                                Grower.steer
        steer along the Dubins curve towards the pose        Grower.steer
        unless it collides, add it                           Grower.extend
        RRT*: by the cheapest of the near links ...          Grower.choose_parent
              ... and reroute those that gain by it          Grower.rewire

The closest link is the one with the shortest Dubins curve to the pose. Near are the e (1 + 1/3) log n links with the shortest
curves to it (the k-nearest RRT* of Karaman and Frazzoli, 2011, for three dimensions), and all within the longest of these
curves' length from it.

What goes beyond the paper, and is left out where the settings say so, happens before the first sample and after each block:

    informed   hybrid A* finds a first path, and others later     HybridAStarRuns.run
               only what can still be on a shorter path is drawn,
               and added; what cannot be any more is forgotten    Grower.beat, Search._aim_below_best
    shortcut   the best path is made shorter by trial             polished
    both       and added to the tree, which goes on from there    Grower.adopt

The lower bounds, and the later runs of hybrid A*, are computed beside the samples. Where their answers are taken is fixed by the
samples alone, so that the path does not depend on the time nor on the number of cores.
"""

import math
import time
from functools import cached_property

import numpy as np

from .._kernels import COMPILED
from .._kernels.rrt import RrtKernel
from .._kernels.tree import SearchTree
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..problem import Problem
from ..settings import Settings
from .background import Beside
from .cost_to_go import DistanceField
from .hybrid_astar import HybridAStarRuns
from .sampling import Sampler
from .smoothing import polished
from .tree import Tree, path_to

NEAR_FACTOR = math.e * (1 + 1 / 3)
MOST_NEAR = 512
#: Samples are drawn in blocks of this size, however many are used: the draws depend neither on the time nor on the budget.
BLOCK = 512
#: About how long a batch takes [s]: so long does a cancellation wait.
BATCH_TIME = 0.005
#: How many poses hybrid A* expands at a time before the first sample: at most so many for a first path, so many for a better one.
EXPANSIONS, MOST_FIRST, MOST_SECOND = (256, 32_768, 4096) if COMPILED else (32, 512, 128)
#: After a block the search waits for so many poses at most that it expanded beside it: for a disc, and for a polygon, which takes
#: several times as long.
EXPANSIONS_BESIDE, EXPANSIONS_BESIDE_OF_POLYGON = 1024, 128
#: How often a new path is polished, and what gain of the last time is reason for another, as a share of its length.
POLISHINGS, WORTH_MORE = 3, 1e-4
#: Nodes are forgotten when the best path became shorter by this share of its length.
LEAST_FALL = 1e-4


class Search:
    """A search under way. Its state after a sample is a function of problem, seed and settings but for budget and time.

    Attributes:
        samples: how many samples were used so far.
        best: the node that reaches the goal at the least cost, or -1.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField, to_goal: DistanceField | None):
        """`to_goal` is needed with `informed`, and with headings along the field."""
        corners = problem.map.corners()
        lowest, extent = corners.min(axis=0), np.ptp(corners, axis=0)
        vehicle = problem.vehicle
        self._tree = SearchTree(problem.start, vehicle.turning_radius, lowest, extent)
        self._grower = RrtKernel(
            tree=self._tree, checker=field.collision_checker(vehicle), step=settings.step_size, near_factor=NEAR_FACTOR,
            max_near=MOST_NEAR, goal=problem.goal, tolerance_xy=problem.goal_tolerance_xy, tolerance_yaw=problem.yaw_tolerance)
        self._grow = self._grower.rrt if settings.planner == "rrt" else self._grower.rrt_star
        self._problem, self._settings, self._field, self._to_goal = problem, settings, field, to_goal
        self._beside = Beside()
        self._runs = self._portion = self._bound_to_goal = self._bound_from_start = None
        if settings.informed:
            self._runs = HybridAStarRuns(problem, settings, field, to_goal)
        self._from_start: DistanceField | None = None
        self._block = np.empty((0, 3))
        self._used = 0
        self._batch = 8
        self._expansions = MOST_FIRST if settings.informed else 0  # due before the first sample
        self._polishings = 0  # due before the next sample
        self._is_polished = False  # whether it seems not to be worth more
        self._is_news = False  # whether the best path changed, as far as that may count for the next sample
        self._seen = self._forgot_above = math.inf
        self.samples = 0
        self.best = -1

    # Neither is needed for the first path of hybrid A*, which need not wait for them.
    @cached_property
    def _sampler(self) -> Sampler:
        return Sampler(self._problem, self._settings, self._field, self._to_goal)

    @cached_property
    def _rng(self) -> np.random.Generator:
        return np.random.default_rng((self._settings.seed, 2))  # apart from that of the samples

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
        return self._tree.costs[self.best] if self.best >= 0 else None

    @property
    def path(self) -> Path | None:
        """The best path so far, or None; the tree is not copied for it."""
        return path_to(self.best, self._tree) if self.best >= 0 else None

    @property
    def done(self) -> bool:
        """Whether the budget is used, or RRT has its path."""
        used = self.samples == self._settings.samples or (self.best >= 0 and self._settings.planner == "rrt")
        return used and self.may_end

    @property
    def may_end(self) -> bool:
        """Whether the same search with the samples so far as its budget would end here."""
        if self.best < 0:
            return True
        return self._polishings == 0 and (self.samples > 0 or self._settings.planner == "rrt")

    def grow(self) -> None:
        """Take one step of a few milliseconds: a portion of hybrid A*, a polishing, or a batch of samples, which ends early with
        the first path."""
        if self._runs and (self.best >= 0 or self._expansions == 0):
            self._begin_bounds()
        if self._polishings == POLISHINGS or (self._polishings > 0 and self._expansions == 0):
            self._polish()
        elif self._expansions > 0:
            self._run_hybrid_astar()
        else:
            self._draw_batch()

    def make_bound(self) -> DistanceField:
        """Make the distances to the goal, which `informed` needs, lower bounds, when nothing beside the search works on them."""
        self._begin_bounds()
        self._bound_to_goal()
        if self._portion:
            self._portion()
        return self._to_goal.make_bound()

    def _run_hybrid_astar(self) -> None:
        """Run it up to a first path, and then once more for a better one."""
        had_none = self.best < 0
        portion = min(EXPANSIONS, self._expansions)
        self._expansions -= portion
        self._take(self._runs.run(portion, self.length))
        if self._runs.exhausted or (self._runs.between_runs and not had_none):
            self._expansions = 0
        if had_none and self.best >= 0:
            self._expansions = MOST_SECOND if self._settings.planner == "rrt_star" else 0

    def _begin_bounds(self) -> None:
        """Begin to compute the lower bounds beside the search, once; not earlier, as that would keep the first path waiting."""
        if self._bound_to_goal:
            return
        if self.best < 0:
            self._to_goal.finish()  # hybrid A* goes on beside the samples
        problem, field = self._problem, self._field
        self._bound_to_goal = self._beside.start(self._to_goal.prepare_bound)
        if self._settings.planner == "rrt_star":
            self._bound_from_start = self._beside.start(lambda: DistanceField.from_start(problem, field).make_bound())

    def _take(self, found: Path | None) -> None:
        """Add a path that hybrid A* found to the tree, if it is the best."""
        if found is not None and (self.best < 0 or found.length < self.length):
            self._adopt(found)

    def _polish(self) -> None:
        fresh = self._polishings == POLISHINGS
        self._polishings -= 1
        before = self.length
        shorter = self._polished(self.path, fresh)
        if shorter.length < before:
            self._adopt(shorter, self.best)
        self._is_polished = before - self.length <= WORTH_MORE * before

    def _draw_batch(self) -> None:
        if self._is_news and self._settings.informed and self.best >= 0:
            self._aim_below_best()
        self._is_news = False
        if self._used == len(self._block):
            self._block = self._sampler.draw(BLOCK, self._from_start, self.path)
            self._used = 0
        left = self._settings.samples - self.samples
        begin, end = self._used, min(self._used + min(self._batch, left), len(self._block))
        self._grower.reserve(end - begin)
        started = time.perf_counter()
        self._used = self._grow(self._block, begin, end)
        took = time.perf_counter() - started
        grown = self._used - begin
        self.samples += grown
        self._batch = min(max(1, int(BATCH_TIME * grown / max(took, 1e-6))), 2 * self._batch, BLOCK)
        if self.best < 0:
            self._look_for_best()
        else:
            self.best = self._grower.best_goal_node()  # that counts for the samples from the next block on
        if self._used == len(self._block):
            self._end_block()

    def _end_block(self) -> None:
        """Take what was computed beside the last block, and begin what is due after it."""
        self._tree.rehash()
        self._look_for_best()
        if self._runs:
            self._take_portion()
        self._is_news = True
        if self._settings.shortcut and self.best >= 0 and not self._is_polished:
            self._polishings = max(self._polishings, 1)

    def _take_portion(self) -> None:
        """Take what hybrid A* found beside the search, and let it go on."""
        if self._portion:
            self._take(self._portion())
            self._portion = None
        if not self._runs.exhausted:
            expansions = EXPANSIONS_BESIDE_OF_POLYGON if self._problem.vehicle.footprint else EXPANSIONS_BESIDE
            self._portion = self._beside.start(self._runs.run, expansions, self.length)

    def _adopt(self, path: Path, end: int = -1) -> None:
        """Add a path to the tree; `end` is the node at its end, if the tree has it."""
        if end < 0 and self.best >= 0 and self._problem.exact_goal:
            end = self.best
        pieces = path.cut(self._settings.step_size)
        self._grower.insert_path(pieces.waypoints, pieces.words, pieces.lengths, end)
        self._look_for_best()

    def _look_for_best(self) -> None:
        """Ask the tree for its best path, and let a first one be polished."""
        had_none = self.best < 0
        self.best = self._grower.best_goal_node()
        if self.best < 0 or self.length >= self._seen:
            return
        self._seen, self._is_news, self._is_polished = self.length, True, False
        if had_none and self._settings.shortcut:
            self._polishings = POLISHINGS

    def _aim_below_best(self) -> None:
        """Draw and add only what can be on a path shorter than the best, and forget the nodes that cannot."""
        if self._from_start is None:
            self._from_start = self._bound_from_start()  # first, as it was begun last and may not have been begun yet
            self.make_bound()
        limit = self.length
        self._grower.set_cost_bound(limit, self._from_start.kernel, self._to_goal.kernel)
        if limit < self._forgot_above * (1 - LEAST_FALL):
            self._forgot_above = limit
            places = np.asarray(self._tree.poses)[:self.size, :2]
            wanted = self._from_start.at(places) + self._to_goal.at(places) < limit
            wanted[[0, self.best]] = True
            self._tree.prune_index(wanted.astype(np.int8))

    def _polished(self, path: Path, fresh: bool) -> Path:
        return polished(path, self._problem.vehicle, self._field, self._rng, fresh)
