"""A lower bound of the lengths of all paths that rises towards the length of the one that was found.

Every path crosses the levels of the cost from the start in order (`level_sets.py`). So it is at least as long as the cheapest
chain of boxes, one on each level, whose costs are lower bounds of the Dubins curves from box to box without any obstacles
(`_kernels/interval_curves.py`). Branch and bound: boxes on chains that are cheap are halved, and where the cheapest chain leads
through an obstacle a level is added. Chains that cost at least the length that is being proved are left out, so that the bound
holds for all paths, whichever way round they lead. A chain may leave a box from another pose than it came to, and over many near
levels that adds up; so it costs at least what one without some of the levels does, too. To split boxes of places and headings is
the idea of G* (docs/bounds.md).
"""

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise, takewhile

import numpy as np

from .._kernels import UNLIMITED
from .._kernels.interval_curves import relax
from ..collision.clearance import ClearanceField
from ..curves import dubins
from ..curves.path import Path
from ..deadline import OutOfTime, never
from ..problem import Problem
from ..search.cost_bounds import LengthBounds
from .boxes import Layer
from .level_sets import LevelSets

#: Shares of the length of the path by which the lengths that are proved one after the other are below it.
GAPS = (0.5, 0.2, 0.15, 0.12, 0.1, 0.08, 0.065, 0.05, 0.04, 0.03, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0005)
#: Minimum distance of the first levels, and of those that are added, from others, in turning radii.
SPACING, LEAST_SPACING = 0.6, 0.35
#: Clearance up to which the path is taken to touch an obstacle, as a share of the required one, where a first level is put.
CONTACT = 1.3
#: Spacing of the poses along the path between which contacts are sought, as a share of its length and at least [m].
POSES, LEAST_POSE_SPACING = 1 / 4000, 0.02
#: Size of the boxes from which a chain is held against the obstacles: length in turning radii, and range of headings [rad].
SMALL, SMALL_TURN = 0.075, 0.6
#: Depth by which a chain must lead into an obstacle for a level to be added, in turning radii.
DEPTH = 0.03
#: Share of the way from the bound to the length that is being proved up to which boxes of chains are halved in a round.
SPLIT_SHARE = 0.6
#: Maximum number of times that levels are added at first, where the shortest string over the levels leads into obstacles; their
#: least distance from others in turning radii; and depth in shares of the required clearance.
STRING_ROUNDS, STRING_SPACING, STRING_DEPTH = 20, 1.0, 1.0
#: Numbers of layers back, or to the first one, from where chains are bounded without the boxes between.
STEPS = 2, 4, 1_000_000
#: Number of pairs of boxes after which `interrupted` is asked.
PAIRS = 4096
#: Maximum number of boxes.
MAX_BOXES = 60_000


class LengthProof:
    """The proof that no path is much shorter than one.

    Attributes:
        bound: length that no path falls below [m]; it rises while `run` is under way.
        length: length of the best path that is known [m]; to be lowered when a shorter one is found.
    """

    def __init__(self, problem: Problem, field: ClearanceField, path: Path, bounds: LengthBounds | None = None,
                 limit: float = math.inf, interrupted: Callable[[], bool] = never):
        """Prepare the proof, in milliseconds to tenths of a second.

        Args:
            path: a path of the problem, by whose contacts the first levels are chosen.
            bounds: as `LevelSets` takes them.
            limit: `length` will be at most this; by default the length of the path [m].
            interrupted: asked before each level; True leaves the other levels out, with which the bound would rise further.
        """
        self.length = path.length
        self._problem, self._field = problem, field
        self._radius = problem.vehicle.turning_radius
        self._sets = LevelSets(problem, field, bounds)
        self.bound = min(self._sets.bound, self.length)
        self._limit_of_sets = limit if limit < math.inf else self.length
        self._interrupted = interrupted
        self._layers = [Layer.of_pose(problem.start, 0.0, 0.0), *self._layers_at(self._contacts(path)),
                        Layer.of_pose(problem.goal, problem.goal_tolerance_xy, min(problem.yaw_tolerance, math.pi))]
        self._is_stale = True
        for _ in range(STRING_ROUNDS):
            if interrupted() or not self._add_levels_along_string():
                break

    @property
    def levels(self) -> np.ndarray:
        """Levels whose crossings the proof looks at, ascending [m]."""
        return np.array([layer.level for layer in self._layers[1:-1]])

    @property
    def sets(self) -> LevelSets:
        """The costs whose levels they are."""
        return self._sets

    def run(self, interrupted: Callable[[], bool], gap: float = 0.0) -> None:
        """Raise the bound, until the path is at most `gap` above it, or there is no more to gain.

        Args:
            interrupted: asked every few milliseconds; True ends it.
        """
        self._interrupted = interrupted
        try:
            while (limit := self._next_limit(gap)) is not None:
                self._reopen(limit)
                while self.bound < limit:
                    if not self._round(limit):
                        return
        except OutOfTime:
            return

    def _next_limit(self, gap: float) -> float | None:
        """Return the length that is to be proved next [m], or None where all is proved."""
        limits = [self.length / (1 + share) for share in (*GAPS, gap) if share >= gap and share > 0]
        return min((limit for limit in limits if limit > self.bound), default=None)

    def _layer_at(self, level: float) -> Layer:
        return Layer(self._sets, level, self._limit_of_sets)

    def _layers_at(self, levels: Iterable[float]) -> Iterator[Layer]:
        """Return the layers at levels, one after the other, as far as there is time for them."""
        return map(self._layer_at, takewhile(lambda _: not self._interrupted(), levels))

    def _contacts(self, path: Path) -> list[float]:
        """Return the levels where the path touches obstacles, those where it has least room first, so far as they are apart."""
        required = self._problem.vehicle.required_clearance
        points = path.poses(max(LEAST_POSE_SPACING, POSES * path.length))[:, :2]
        room, costs = self._field.at(points), self._sets.costs(points)
        tight = np.flatnonzero((room[1:-1] <= room[:-2]) & (room[1:-1] < room[2:]) & (room[1:-1] < CONTACT * required)) + 1
        levels: list[float] = []
        for level in costs[tight[np.argsort(room[tight], kind="stable")]].tolist():
            if all(abs(level - other) > SPACING * self._radius for other in (0.0, self._sets.end, *levels)):
                levels.append(level)
        return sorted(level for level in levels if 0 < level < self._sets.end)

    def _add_levels_along_string(self) -> bool:
        """Add a level to each leg of the shortest string over the levels that leads deep into an obstacle; False if none does."""
        required = self._problem.vehicle.required_clearance
        levels = [0.0, *(layer.level for layer in self._layers[1:-1]), self._sets.end]
        added = []
        for (point, other), (level, following) in zip(pairwise(self._shortest_string()), pairwise(levels), strict=True):
            rise = following - level
            if rise < 2 * STRING_SPACING * self._radius:
                continue
            shares = np.linspace(0, 1, max(8, int(2 * math.dist(point, other) / required) + 2))
            room = self._field.at(point + shares[:, None] * (other - point))
            if (room < 0.5 * required).mean() * math.dist(point, other) > STRING_DEPTH * self._radius:
                margin = STRING_SPACING * self._radius
                added.append(level + min(max(shares[room.argmin()] * rise, margin), rise - margin))
        self._layers[1:-1] = sorted([*self._layers[1:-1], *self._layers_at(added)], key=lambda layer: layer.level)
        return bool(added)

    def _shortest_string(self) -> list[np.ndarray]:
        """Return a point for each layer: those of the shortest string over the centres of the boxes."""
        points = [layer.boxes[:, :2] for layer in self._layers]
        if not all(map(len, points)):
            return [points[0][0]] * len(points)  # no path is shorter than the one that is known
        costs, links = np.zeros(1), []
        for source, following in pairwise(points):
            lengths = costs[:, None] + np.hypot(*(source[:, None] - following[None]).transpose(2, 0, 1))
            links.append(lengths.argmin(axis=0))
            costs = lengths.min(axis=0)
        index, string = 0, [points[-1][0]]
        for link, source in zip(reversed(links), reversed(points[:-1]), strict=True):
            index = int(link[index])
            string.append(source[index])
        return string[::-1]

    def _reopen(self, limit: float) -> None:
        for layer in self._layers[1:-1]:
            layer.reopen(limit)
        self._is_stale = True

    def _round(self, limit: float) -> bool:
        """Bound all chains below a limit, and halve boxes of the cheapest ones; False where there is nothing more to gain."""
        self._sweep(limit, backwards=False)
        self.bound = max(self.bound, min(limit, float(self._layers[-1].up_to[0])))
        if self.bound >= limit:
            for layer in self._layers[1:-1]:
                layer.total = np.maximum(layer.total, limit)
            return True
        self._sweep(limit, backwards=True)
        self._is_stale = False
        added = self._place_for_level()
        split = self._split(self.bound + SPLIT_SHARE * (limit - self.bound), limit)
        if added is not None:
            self._add_level(*added)
        return (split or added is not None) and sum(map(len, self._layers)) <= MAX_BOXES

    def _sweep(self, limit: float, backwards: bool) -> None:
        """Compute the costs of chains up to each open box, or from there on, where they are not those of the last round."""
        layers = self._layers[::-1] if backwards else self._layers
        changed = np.zeros(1, bool)
        for index, layer in enumerate(layers[1:], start=1):
            source = layers[index - 1]
            links = layer.after if backwards else layer.before
            due = layer.is_open & (self._is_stale | (links < 0) | changed[links] | ~source.is_open[links])
            earlier = [layers[other] for other in sorted({max(0, index - step) for step in STEPS}) if other < index - 1]
            changed = self._relax(source, earlier, layer, np.flatnonzero(due), limit, backwards)

    def _relax(self, source: Layer, earlier: list[Layer], layer: Layer, due: np.ndarray, limit: float, backwards: bool
               ) -> np.ndarray:
        """Compute the costs of chains to the boxes `due` of a layer; return (n,) bool, True where they changed.

        They cost at least what they do without the boxes between an `earlier` layer and this one: the most of these counts.
        """
        changed = np.zeros(len(layer), bool)
        costs, links = (layer.on, layer.after) if backwards else (layer.up_to, layer.before)
        found, best = self._least_costs(source, layer, due, limit, backwards)
        for other in earlier:
            below = np.flatnonzero(found < UNLIMITED)
            found[below] = np.maximum(found[below], self._least_costs(other, layer, due[below], limit, backwards)[0])
        changed[due] = found != costs[due]
        costs[due] = found
        links[due] = best
        return changed

    def _least_costs(self, source: Layer, layer: Layer, due: np.ndarray, limit: float, backwards: bool
                     ) -> tuple[np.ndarray, np.ndarray]:
        """Return the least costs of chains from boxes of a layer to the boxes `due` of another one, and these boxes or -1."""
        known, left = (source.on, layer.up_to) if backwards else (source.up_to, layer.on)
        usable = np.flatnonzero(source.is_open & (known < UNLIMITED))
        usable = usable[np.argsort(known[usable], kind="stable")]
        found, best = np.full(len(due), UNLIMITED), np.full(len(due), -1, np.int32)
        size = max(1, PAIRS // max(1, len(usable)))
        for begin in range(0, len(due) if len(usable) else 0, size):
            if self._interrupted():
                raise OutOfTime
            some = slice(begin, begin + size)
            relax(known[usable], source.boxes[usable], layer.boxes[due[some]], left[due[some]], self._radius, limit, backwards,
                  found[some], best[some])
        return found, np.where(best >= 0, usable[best] if len(usable) else -1, -1)

    def _split(self, up_to: float, limit: float) -> bool:
        """Halve the open boxes on chains that cost less than `up_to`; False if there are none."""
        found = False
        for index, layer in enumerate(self._layers[1:-1], start=1):
            layer.close(limit)
            chosen = layer.is_open & (layer.total < up_to)
            found = found or bool(chosen.any())
            new = layer.split(chosen, self._radius)
            after, before = self._layers[index + 1], self._layers[index - 1]
            after.before = np.where(after.before >= 0, new[after.before], -1) if len(new) else np.full(len(after), -1)
            before.after = np.where(before.after >= 0, new[before.after], -1) if len(new) else np.full(len(before), -1)
        return found

    def _cheapest_chain(self) -> list[np.ndarray]:
        """Return the boxes of the cheapest chain, from the start to the goal."""
        index, boxes = 0, []
        for layer in reversed(self._layers):
            boxes.append(layer.boxes[index])
            index = int(layer.before[index])
        return boxes[::-1]

    def _place_for_level(self) -> tuple[int, float] | None:
        """Return after which layer, and where, to add a level: where the cheapest chain leads farthest into an obstacle."""
        levels = [0.0, *(layer.level for layer in self._layers[1:-1]), self._sets.end]
        deepest, place = self._problem.vehicle.required_clearance - DEPTH * self._radius, None
        for index, (box, following) in enumerate(pairwise(self._cheapest_chain())):
            if levels[index + 1] - levels[index] < 2 * LEAST_SPACING * self._radius or not self._are_small(box, following):
                continue
            room = self._least_room(box, following)
            if room < deepest:
                deepest, place = room, (index, (levels[index] + levels[index + 1]) / 2)
        return place

    def _are_small(self, box: np.ndarray, other: np.ndarray) -> bool:
        return bool(box[4] + other[4] <= 2 * SMALL * self._radius and box[7] + other[7] <= 2 * SMALL_TURN)

    def _least_room(self, box: np.ndarray, other: np.ndarray) -> float:
        """Return the least clearance along the curve between the centres of two boxes [m]."""
        curve = dubins.shortest((box[0], box[1], box[6]), (other[0], other[1], other[6]), self._radius)
        poses = curve.poses(max(LEAST_POSE_SPACING, curve.length / 40))
        return float(self._field.at(np.ascontiguousarray(poses[:, :2])).min())

    def _add_level(self, index: int, level: float) -> None:
        """Add a level after layer `index`."""
        self._layers.insert(index + 1, self._layer_at(level))
        self._layers[index].after[:] = -1
        self._layers[index + 2].before[:] = -1
