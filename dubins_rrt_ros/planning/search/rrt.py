"""RRT and RRT*: Algorithms 1 and 2 of A. Khanal, RRT and RRT* Using Vehicle Dynamics, batch by batch.

    all_links = [start]
    while N != n_iter:
        draw a random pose, sometimes the goal               Sampler.draw
        find the closest link                                RrtKernel.steer
        steer along the Dubins curve towards the pose        RrtKernel.steer
        unless it collides, add it                           RrtKernel.extend
        RRT*: by the cheapest of the near links ...          RrtKernel.choose_parent
              ... and reroute those that gain by it          RrtKernel.rewire

The closest link is the one with the shortest Dubins curve to the pose. Near are the e (1 + 1/3) log n links with the shortest
curves to it (the k-nearest RRT* of Karaman and Frazzoli, 2011, for three dimensions), and all within the longest of these
curves' length from it.

What goes beyond the paper, and is left out where the settings say so, happens before the first sample and after each block:

    informed   hybrid A* finds a first path, and others later     HybridAStarRuns.run
               only what can still be on a cheaper path is        RrtKernel.set_cost_bound
               drawn, and added; other nodes are forgotten        SearchTree.prune_index
               other corridors are tried, one by one              Corridors.next_path
    shortcut   the best path is smoothed                          Smoother.smooth
    both       and added to the tree, which goes on from there    RrtKernel.insert_path

The lower bounds, and the later runs of hybrid A*, are computed in the background of the samples. Where their results are taken is
fixed by the samples alone, so that the path depends neither on the time nor on the number of cores.
"""

import math
import time
from collections.abc import Generator, Iterator
from typing import NamedTuple

import numpy as np

from .._kernels import COMPILED
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..deadline import Deadline, never
from ..problem import Problem
from ..settings import Settings
from ..work import Work
from .corridors import Corridors
from .cost import Objective
from .cost_bounds import TIME_FOR_BOUND, CostBounds, LengthBounds
from .cost_to_go import CostToGo
from .growing_tree import GrowingTree
from .hybrid_astar import HybridAStarRuns
from .lower_bound import lower_bound
from .sampling import Sampler
from .short_arcs import merge_short_arcs
from .smoothing import Smoother
from .tree import Tree

#: Number of samples in a block. Blocks are drawn whole, so that the draws depend neither on the time nor on the budget.
BLOCK = 512
#: Number of samples in the first batch, and time that a batch is to take [s]: a cancellation waits for its end.
FIRST_BATCH, BATCH_TIME = 8, 0.005
#: Number of poses that hybrid A* expands in one step before the first sample, and their maximum numbers for a first path and
#: for a better one.
EXPANSIONS, MOST_FIRST, MOST_SECOND = (256, 32_768, 4096) if COMPILED else (32, 512, 128)
#: Number of poses that hybrid A* expands in the background of a block: for a disc, and for a polygon, which takes several times
#: as long. The search waits for them at the end of the block.
BACKGROUND_EXPANSIONS, BACKGROUND_EXPANSIONS_OF_POLYGON = 1024, 128
#: The factor of these numbers as long as there is no path.
WITHOUT_PATH = 16
#: Number of rounds of smoothing for the first path.
ROUNDS = 3
#: Maximum length of a path that is ready after the first round, relative to the way around the obstacles; maximum cost where that
#: is another, of which the way around tells less; and maximum number of its curves. A longer one may lead the wrong way round,
#: and one with more curves gains by the next rounds.
EARLY_LENGTH, EARLY_COST, EARLY_CURVES = 1.15, 1.3, 12
#: Time for which results from the background are waited for before the time is looked at [s].
WAIT = 0.002


class Informed(NamedTuple):
    """The means of an informed search.

    Attributes:
        runs: hybrid A*, for a first path and for others.
        bounds: lower bounds of the costs from the start and to the goal.
    """

    runs: HybridAStarRuns
    bounds: CostBounds


class Search:
    """A search under way. Its state after a sample is a function of problem, seed and settings but for budget and time.

    Attributes:
        growing: the tree, with the best path.
        ready: True if there is a path whose smoothing has been done; better ones that are still to be smoothed do not matter.
    """

    def __init__(self, problem: Problem, settings: Settings, field: ClearanceField, to_goal: CostToGo | None,
                 deadline: Deadline | None = None, report_samples: int = 0):
        """Prepare a search.

        Args:
            to_goal: needed with `informed`, and with headings along the cost-to-go.
            deadline: when it is over what is under way is cut short; the steps of `run` that follow it are unspecified.
            report_samples: number of samples after each of which a step of `run` ends; 0 for any.
        """
        runs = HybridAStarRuns(problem, settings, field, to_goal) if settings.informed and to_goal else None
        self.growing = GrowingTree(problem, settings, field, nearest=runs.goals[0, :2] if runs else None)
        self.ready = False
        self._problem, self._settings, self._report_samples = problem, settings, report_samples
        self._is_rrt = settings.planner == "rrt"
        self._deadline = deadline or Deadline(math.inf, never)
        self.work = Work(self._deadline.poll, settings.work_limits.search)
        self._informed: Informed | None = None
        if runs and to_goal:
            self._informed = Informed(runs, CostBounds(problem, field, to_goal, self.objective))
        self._corridors: Corridors | None = None
        self._sampler = Sampler(problem, settings, field, to_goal)
        self._smoother = Smoother(self.objective, settings.seed, self.work)

    @property
    def samples(self) -> int:
        """The number of samples used so far."""
        return self.growing.samples

    @property
    def best(self) -> int:
        """The node that reaches the goal at the least cost, or -1."""
        return self.growing.best

    @property
    def objective(self) -> Objective:
        """The cost that is minimised."""
        return self.growing.objective

    @property
    def bound(self) -> CostToGo | None:
        """The cost-to-go as a lower bound, once the search needed it, or None."""
        bounds = self._informed.bounds if self._informed else None
        return bounds.to_goal if bounds and bounds.from_start else None

    @property
    def length_bounds(self) -> LengthBounds | None:
        """The lengths from the start and to the goal as lower bounds, once the search has both, or None."""
        bounds = self._informed.bounds if self._informed and self.objective.is_length else None
        return LengthBounds(bounds.from_start, bounds.to_goal) if bounds and bounds.from_start else None

    @property
    def tree(self) -> Tree:
        """A copy of the tree."""
        return self.growing.copy()

    @property
    def path(self) -> Path | None:
        """The best path so far, or None; the tree is not copied for it."""
        return self.growing.path

    @property
    def cost(self) -> float:
        """The cost of the best path so far [m]; infinite where there is none."""
        return self.growing.cost

    def simplified(self, path: Path, work: Work) -> Path:
        """Return a path with fewer curves, at hardly more cost; the same where the cost is the length."""
        return self._accepted(self._smoother.simplify(path, work), path)

    def without_short_arcs(self, path: Path, work: Work) -> Path:
        """Return a path with its short arcs merged, as far as there is time; the same where paths are not smoothed."""
        if not self._settings.shortcut:
            return path
        return self._accepted(merge_short_arcs(path, self.objective, self._settings.seed, work), path)

    def _accepted(self, simple: Path, path: Path) -> Path:
        """Return the simpler form of a path, cut as the settings ask for, unless a test of the user's refuses it."""
        pieces = simple.cut(self._settings.step_size)
        return pieces if self.objective.field.test_accepts(pieces) else path

    def tree_with(self, path: Path) -> Tree:
        """Return a copy of the tree, with a path that is not the best as a branch of its own."""
        if path == self.path:
            return self.tree
        return self.tree.with_path(path, self.objective.curve_costs(path))

    @property
    def length(self) -> float | None:
        """The length of the best path so far [m], or None."""
        return self.path.length if self.path else None

    @property
    def done(self) -> bool:
        """True if RRT has its path, or the budget is used: informed, a search without a path goes on beyond it."""
        used = self.samples >= self._settings.samples and (self.best >= 0 or not self._settings.informed)
        return used or (self.best >= 0 and self._is_rrt)

    def run(self, seed_path: Path | None = None) -> Iterator[bool]:
        """Search, in steps of a few milliseconds each.

        Args:
            seed_path: a free path of the problem, in place of the first one of hybrid A*.

        Yields:
            True if the search may be ended here: with the samples so far as its budget it would have come to the same end.
        """
        if seed_path:
            yield from self._begin_with(seed_path)
            self._start_bounds()
        elif self._informed:
            yield from self._find_first_path(self._informed.runs)
            if self.best >= 0:
                yield from self._improve_first_path(self._informed.runs)
            self._start_bounds()
        batch = FIRST_BATCH
        while not self.done:
            batch = yield from self._take_block(batch)

    def wait(self, seconds: float = math.inf) -> bool:
        """Wait for so long until nothing of the search runs in the background; return True if so."""
        return self._informed is None or self._informed.runs.wait(seconds)

    def close(self) -> None:
        """Leave out what has not begun in the background, where it would wait in vain behind that of other requests."""
        if self._informed:
            self._informed.runs.cancel()
            self._informed.bounds.cancel()

    def make_bound(self, seconds: float = math.inf) -> CostToGo | None:
        """Make the cost-to-go a lower bound, and return it; None unless informed, and where that takes longer than `seconds`."""
        if not self._informed or not self.wait(seconds) or not self._informed.bounds.are_ready(seconds):
            return None
        return self._informed.bounds.make_to_goal()

    def make_length_bound(self) -> CostToGo | None:
        """Make the length to the goal a lower bound, and return it; None unless informed. To be called after `make_bound`."""
        return self._informed.bounds.make_length_to_goal() if self._informed else None

    def _may_end(self, smoothing_is_due: bool = False) -> bool:
        return self.best < 0 or (not smoothing_is_due and (self.samples > 0 or self._is_rrt))

    def _begin_with(self, seed_path: Path) -> Iterator[bool]:
        """Take a known path for the first one; it was smoothed before, so that one round is enough."""
        self.growing.insert_if_better(seed_path, "seed_path")
        yield from self._smooth(range(ROUNDS - 1, ROUNDS if self._settings.shortcut else ROUNDS - 1))
        self.ready = True
        yield self._may_end()

    def _find_first_path(self, runs: HybridAStarRuns) -> Iterator[bool]:
        """Run hybrid A* up to a first path, as far as that is found soon."""
        left = MOST_FIRST
        while left > 0 and self.best < 0 and not runs.exhausted:
            expansions = min(EXPANSIONS, left)
            left -= expansions
            self.growing.insert_if_better(runs.run(expansions, math.inf, self.work), "hybrid_astar")
            yield self._may_end(smoothing_is_due=self._settings.shortcut)

    def _improve_first_path(self, runs: HybridAStarRuns) -> Iterator[bool]:
        """Smooth the first path, look once for a better one where RRT* goes on, and smooth the best."""
        rounds = range(ROUNDS if self._settings.shortcut else 0)
        yield from self._smooth(rounds[:1])
        self.ready = self._is_nearly_best()
        yield self._may_end(smoothing_is_due=True)
        self._start_bounds()
        if not self._is_rrt:
            yield from self._find_better_path(runs)
        yield from self._smooth(rounds[1:])
        self.ready = True
        yield self._may_end()

    def _is_nearly_best(self) -> bool:
        """Return True if the best path is most likely so near to the shortest that it need not wait for what is found next."""
        path, to_goal = self.path, self._informed.bounds.to_goal if self._informed else None
        factor = EARLY_LENGTH if self.objective.is_length else EARLY_COST
        return (path is not None and len(path.words) <= EARLY_CURVES + 1
                and self.cost <= factor * lower_bound(self._problem, to_goal))

    def _find_better_path(self, runs: HybridAStarRuns) -> Iterator[bool]:
        """Run hybrid A* once more, as far as its run ends soon."""
        left = MOST_SECOND
        while left > 0:
            expansions = min(EXPANSIONS, left)
            left = 0 if self._run_ended(runs, expansions) else left - expansions
            yield self._may_end()

    def _run_ended(self, runs: HybridAStarRuns, expansions: int) -> bool:
        self.growing.insert_if_better(runs.run(expansions, self.cost, self.work), "hybrid_astar")
        return runs.between_runs or runs.exhausted

    def _start_bounds(self) -> None:
        """Start to compute lower bounds in the background; not earlier, as the first path would have to wait for them."""
        if self._informed:
            bounds = self._informed.bounds
            if self.best < 0:
                bounds.to_goal.finish()  # hybrid A* goes on in the background of the samples, and asks for it too
            bounds.start(from_start=not self._is_rrt)

    def _take_block(self, batch: int) -> Generator[bool, None, int]:
        """Draw a block of samples and take it, batch by batch; return the size of the next batch."""
        yield from self._wait_for_bounds()
        is_limited = self._limit_to_best()
        from_start = self._informed.bounds.from_start if self._informed else None
        block = self._sampler.draw(BLOCK, from_start, self.path, self.growing.problem)
        used = 0
        while used < BLOCK and not self.done:
            if not is_limited:
                yield from self._wait_for_bounds()
                is_limited = self._limit_to_best()
            had_path = self.best >= 0
            used, batch = self._take_batch(block, used, batch)
            if not had_path:
                self.growing.approach_nearest()
            if used == BLOCK:
                yield from self._wait_for_runs()
                if self.work.begins():
                    self._end_block()
            rounds = self._rounds_due(had_path, used == BLOCK)
            corridor_is_due = self._corridors is not None and self._corridors.is_due(self.samples)
            yield self._may_end(smoothing_is_due=bool(rounds) or corridor_is_due)
            yield from self._smooth(rounds)
            if corridor_is_due:
                self._try_corridor()
                yield self._may_end()
            if self.best >= 0 and not self.ready:
                self.ready = True
                yield self._may_end()
        return batch

    def _wait_for_bounds(self) -> Iterator[bool]:
        """Wait for the bounds that `_limit_to_best` needs, unless there is time to compute one of them here."""
        if self._informed and self.best >= 0 and self._informed.bounds.from_start is None:
            while self._deadline.left < TIME_FOR_BOUND and not self._informed.bounds.wait(WAIT):
                yield self._may_end()

    def _wait_for_runs(self) -> Iterator[bool]:
        """Wait for hybrid A* in the background."""
        while not self.wait(WAIT):
            yield self.best < 0

    def _take_batch(self, block: np.ndarray, begin: int, size: int) -> tuple[int, int]:
        """Add samples of a block to the tree, up to the first path; return the next sample's index and the next batch's size."""
        left = self._settings.samples - self.samples
        end = min(begin + self.work.portion(min(size, left if left > 0 else size, self._until_report())), BLOCK)
        if self._corridors and not self._corridors.exhausted:
            end = min(end, begin + self._corridors.next_at - self.samples)
        started = time.perf_counter()
        # Where hybrid A* has failed, Algorithm 1 is the quicker one to a first path.
        next_one = self.growing.take(block, begin, end, self._is_rrt or (self._informed is not None and self.best < 0))
        took, taken = time.perf_counter() - started, next_one - begin
        self.work.done += taken
        return next_one, min(max(1, int(BATCH_TIME * taken / max(took, 1e-6))), 2 * size, BLOCK)

    def _until_report(self) -> int:
        """Return the maximum number of samples up to the next report."""
        return self._report_samples - self.samples % self._report_samples if self._report_samples else BLOCK

    def _end_block(self) -> None:
        """Take what hybrid A* found in the background, and let it go on."""
        self.growing.rehash()
        if not self._informed:
            return
        runs = self._informed.runs
        self.growing.insert_if_better(runs.collect(), "hybrid_astar")
        if not runs.exhausted:
            expansions = BACKGROUND_EXPANSIONS_OF_POLYGON if self._problem.vehicle.footprint else BACKGROUND_EXPANSIONS
            interrupted = self.work.interrupting(lambda: self._deadline.is_over)
            runs.start(expansions if self.best >= 0 else WITHOUT_PATH * expansions, self.cost, interrupted)

    def _limit_to_best(self) -> bool:
        """Draw and add only what can be on a cheaper path than the best, and forget other nodes; False where nothing limits."""
        if not self._informed or self.best < 0:
            return False
        bounds = self._informed.bounds
        from_start = bounds.from_start
        if from_start is None:
            from_start = bounds.make_from_start()  # first, as it was started last and may not be under way yet
            self.make_bound()
            if self._settings.shortcut and not self._is_rrt:
                self._corridors = Corridors(self._problem, self.objective, from_start, bounds.to_goal, self.cost,
                                            self._settings.seed, self.work, self.samples)
        self.growing.limit_to_best(bounds, from_start)
        return True

    def _try_corridor(self) -> None:
        """Try one more corridor that may be shorter than the best path."""
        if self._corridors and (path := self.path) and self.work.begins():
            self.growing.insert_if_better(self._corridors.next_path(path, self.samples), "hybrid_astar")

    def _rounds_due(self, had_path: bool, block_ended: bool) -> range:
        """Return the rounds of smoothing that are due: all for a first path, and the last after a block, if worthwhile."""
        if not self._settings.shortcut or self.best < 0:
            return range(0)
        if not had_path:
            return range(ROUNDS)
        return range(ROUNDS - 1, ROUNDS if block_ended and self._smoother.is_worthwhile(self.cost) else ROUNDS - 1)

    def _smooth(self, rounds: range) -> Iterator[bool]:
        """Smooth the best path; round 0 is that of a path with large loops."""
        for number in rounds:
            before = self.cost
            if path := self.path:
                self.growing.insert_smoothed(self._smoother.smooth(path, first_round=number == 0))
            self._smoother.record(before, self.cost)
            yield self._may_end(smoothing_is_due=number + 1 < ROUNDS)
