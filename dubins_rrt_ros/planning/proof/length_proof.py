"""A lower bound of the lengths of all paths that rises towards the length of the one that was found.

Every path crosses the levels of the cost from the start in order, each in one of its portals (`level_sets.py`, `portals.py`).
So it is at least as long as the cheapest chain of boxes, one in each portal on its way, whose costs are lower bounds of the
Dubins curves from box to box without any obstacles (`_kernels/interval_curves.py`). Branch and bound: the largest boxes on
chains that are cheap are halved, and where the cheapest chain leads through an obstacle a level is added. Chains that cost at
least the length that is being proved are left out, so that the bound holds for all paths, whichever way round they lead. A
chain may leave a box from another pose than it came to, and over many near levels that adds up; so it costs at least what one
without some of the levels does, too. To split boxes of places and headings is the idea of G* (docs/bounds.md).
"""

import math
from collections.abc import Callable
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
from .boxes import Links, Portal
from .level_sets import LevelSets
from .portals import Edge, PortalGraph

#: Shares of the length of the path by which the lengths that are proved one after the other are below it.
GAPS = (0.5, 0.2, 0.15, 0.12, 0.1, 0.08, 0.065, 0.05, 0.04, 0.03, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0005)
#: Minimum distance of the first levels from others, and of those that are added, and of all from the goal, in turning radii.
SPACING, LEAST_SPACING = 0.6, 0.35
#: Clearance up to which the path is taken to touch an obstacle, as a share of the required one, where a first level is put.
CONTACT = 1.3
#: Spacing of the poses along the path between which contacts are sought, as a share of its length and at least [m].
POSES, LEAST_POSE_SPACING = 1 / 4000, 0.02
#: Size of the boxes from which a chain is held against the obstacles: length in turning radii, and range of headings [rad].
SMALL, SMALL_TURN = 0.15, 0.4
#: Depth by which a chain must lead into an obstacle for a level to be added, in turning radii.
DEPTH = 0.15
#: Share of the way from the bound to the length that is being proved up to which boxes of chains are halved in a round.
SPLIT_SHARE = 0.4
#: Share of the size of the largest of these boxes down to which they are halved: smaller ones are not what lowers the bound.
SIZE_SHARE = 0.4
#: Maximum number of times that levels are added at first, where the shortest string over the levels leads into obstacles; their
#: least distance from others in turning radii; and depth in shares of the required clearance.
STRING_ROUNDS, STRING_SPACING, STRING_DEPTH = 20, 1.0, 1.0
#: Numbers of portals back from where chains are bounded without the boxes between.
STEPS = (2,)
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
        self._graph = PortalGraph(self._sets, self._limit_of_sets, Portal.of_pose(problem.start, 0.0, 0.0, 0.0), self._goal())
        self._is_stale = True
        self._cover_contacts(path)
        for _ in range(STRING_ROUNDS):
            if interrupted() or not self._add_levels_along_string():
                break

    @property
    def levels(self) -> np.ndarray:
        """Levels whose crossings the proof looks at, ascending [m]."""
        return self._graph.levels

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
            length = self.length
            self._reopen(length)
            self._raise_bound(length)  # at once, without a round for each of the lengths below
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

    def _goal(self) -> Portal:
        problem = self._problem
        exact = problem.goal_tolerance_xy == 0
        return Portal.of_pose(problem.goal, problem.goal_tolerance_xy, min(problem.yaw_tolerance, math.pi), self._sets.end,
                              self._sets.square_at(problem.goal[:2]) if exact else -1)

    def _cover_contacts(self, path: Path) -> None:
        """Cover the levels where the path touches obstacles, those where it has least room first, so far as they are apart."""
        required = self._problem.vehicle.required_clearance
        points = path.poses(max(LEAST_POSE_SPACING, POSES * path.length))[:, :2]
        room, costs = self._field.at(points), self._sets.costs(points)
        tight = np.flatnonzero((room[1:-1] <= room[:-2]) & (room[1:-1] < room[2:]) & (room[1:-1] < CONTACT * required)) + 1
        levels: list[float] = []
        for level in costs[tight[np.argsort(room[tight], kind="stable")]].tolist():
            is_apart = all(abs(level - other) > SPACING * self._radius for other in (0.0, *levels))
            if is_apart and self._sets.end - level > LEAST_SPACING * self._radius:
                levels.append(level)
        for level in takewhile(lambda _: not self._interrupted(), sorted(levels)):
            if 0 < level < self._sets.end:
                for portal in self._graph.portals_at(level):
                    portal.cover()
        self._graph.link()

    def _add_levels_along_string(self) -> bool:
        """Add a level to each leg of the shortest string that leads deep into an obstacle; False if none does."""
        required, margin = self._problem.vehicle.required_clearance, STRING_SPACING * self._radius
        string, length = self._shortest_string()
        if length >= self.length:
            return False
        added = False
        for (portal, point), (following, other) in pairwise(string):
            if following.level - portal.level < 2 * margin:
                continue
            shares = np.linspace(0, 1, max(8, int(2 * math.dist(point, other) / required) + 2))
            room = self._field.at(point + shares[:, None] * (other - point))
            if (room < 0.5 * required).mean() * math.dist(point, other) > STRING_DEPTH * self._radius:
                level = _level_between(portal, following, float(shares[np.argmin(room)]), margin)
                added = self._graph.cover_between(portal, following, level) or added
        self._graph.link()
        return added

    def _shortest_string(self) -> tuple[list[tuple[Portal, np.ndarray]], float]:
        """Return a point for each portal on the shortest string over the centres of boxes, and the string's length."""
        start, goal = self._graph.portals[0], self._graph.portals[-1]
        costs = {id(start): np.zeros(1)}
        links: dict[int, tuple[list[Edge], np.ndarray, np.ndarray]] = {}  # edges; for each box one of them, and a box there
        for portal in self._graph.portals[1:]:
            points = portal.boxes[:, :2]
            edges = [edge for edge in self._graph.edges(portal) if len(edge.portal) and len(points)]
            known, number, before = np.full(len(points), math.inf), *np.zeros((2, len(points)), int)
            for index, (source, least) in enumerate(edges):
                if np.min(costs[id(source)]) + least < known.max():
                    lengths = np.hypot(*(source.boxes[:, None, :2] - points[None]).transpose(2, 0, 1))
                    lengths = costs[id(source)][:, None] + np.maximum(lengths, least)
                    box = lengths.argmin(axis=0)
                    lengths = lengths[box, np.arange(len(points))]
                    better = lengths < known
                    known[better], number[better], before[better] = lengths[better], index, box[better]
            costs[id(portal)], links[id(portal)] = known, (edges, number, before)
        string, portal, box_index = [(goal, goal.boxes[0, :2])], goal, 0
        while portal is not start:
            edges, number, before = links[id(portal)]
            if not edges:
                return [(start, start.boxes[0, :2])], math.inf
            portal, box_index = edges[number[box_index]].portal, int(before[box_index])
            string.append((portal, portal.boxes[box_index, :2]))
        return string[::-1], float(costs[id(goal)][0])

    def _reopen(self, limit: float) -> None:
        """Begin to prove a length: all boxes that chains below it may lead through are open."""
        for portal in self._graph.portals[1:-1]:
            portal.reopen(limit)
        self._is_stale = True

    def _raise_bound(self, limit: float) -> None:
        """Raise the bound to the cheapest chain, or to a limit where that costs more."""
        self._sweep(limit, backwards=False)
        self.bound = max(self.bound, min(limit, float(self._graph.portals[-1].up_to[0])))

    def _round(self, limit: float) -> bool:
        """Bound all chains below a limit, and halve boxes of the cheapest ones; False where there is nothing more to gain."""
        self._raise_bound(limit)
        if self.bound >= limit:
            for portal in self._graph.portals[1:-1]:
                portal.total = np.maximum(portal.total, limit)
            return True
        self._sweep(limit, backwards=True)
        self._is_stale = False
        place = self._place_for_level()
        split = self._split(self.bound + SPLIT_SHARE * (limit - self.bound), limit)
        if added := place is not None and self._graph.cover_between(*place):
            self._graph.link()
        return (split or added) and sum(map(len, self._graph.portals)) <= MAX_BOXES

    def _sweep(self, limit: float, backwards: bool) -> None:
        """Compute the costs of chains up to each open box, or from there on, where they are not those of the last round."""
        portals = self._graph.portals[::-1] if backwards else self._graph.portals
        changed = {id(portals[0]): np.zeros(1, bool)}
        for portal in portals[1:]:
            links = portal.after if backwards else portal.before
            due = links.portals == 0
            for edge in self._graph.edges(portal, backwards):
                concerned = np.flatnonzero(links.portals == id(edge.portal))
                boxes = links.boxes[concerned]
                due[concerned] = changed[id(edge.portal)][boxes] | ~edge.portal.is_open[boxes]
            changed[id(portal)] = self._relax(portal, np.flatnonzero(portal.is_open & (due | self._is_stale)), limit, backwards)

    def _relax(self, portal: Portal, due: np.ndarray, limit: float, backwards: bool) -> np.ndarray:
        """Compute the costs of chains to the boxes `due` of a portal; return (n,) bool, True where they changed.

        They cost at least what they do without the portals between some before them and this one: the most of these counts.
        """
        changed = np.zeros(len(portal), bool)
        costs, links = (portal.on, portal.after) if backwards else (portal.up_to, portal.before)
        found, best = self._least_costs(self._graph.edges(portal, backwards), portal, due, limit, backwards)
        for steps in STEPS:
            below = np.flatnonzero(found < UNLIMITED)
            cut = self._graph.cut(portal, steps, backwards)
            found[below] = np.maximum(found[below], self._least_costs(cut, portal, due[below], limit, backwards)[0])
        changed[due] = found != costs[due]
        costs[due] = found
        links.portals[due], links.boxes[due] = best.portals, best.boxes
        return changed

    def _least_costs(self, cut: list[Edge], portal: Portal, due: np.ndarray, limit: float, backwards: bool
                     ) -> tuple[np.ndarray, Links]:
        """Return the least costs of chains from boxes of a cut to the boxes `due` of a portal, and links to these boxes."""
        left = (portal.up_to if backwards else portal.on)[due]
        found, links = np.full(len(due), UNLIMITED), Links(len(due))
        for source, least_edge in cut:
            known = source.on if backwards else source.up_to
            usable = np.flatnonzero(source.is_open & (known < UNLIMITED))
            if not len(usable) or not len(due):
                continue
            usable = usable[np.argsort(known[usable], kind="stable")]
            best = np.full(len(due), -1, np.int32)
            size = max(1, PAIRS // len(usable))
            for begin in range(0, len(due), size):
                if self._interrupted():
                    raise OutOfTime
                some = slice(begin, begin + size)
                relax(known[usable], source.boxes[usable], portal.boxes[due[some]], left[some], least_edge, self._radius, limit,
                      backwards, found[some], best[some])
            better = best >= 0
            links.portals[better], links.boxes[better] = id(source), usable[best[better]]
        return found, links

    def _split(self, up_to: float, limit: float) -> bool:
        """Halve the open boxes on chains that cost less than `up_to`; False if there are none."""
        found, largest = False, 0.0
        for portal in self._graph.portals[1:-1]:
            portal.close(limit)
            chosen = portal.is_open & (portal.total < up_to)
            largest = max(largest, portal.sizes(self._radius)[chosen].max(initial=0.0))
        for portal in self._graph.portals[1:-1]:
            chosen = portal.is_open & (portal.total < up_to) & (portal.sizes(self._radius) >= SIZE_SHARE * largest)
            found = found or bool(chosen.any())
            new = portal.split(chosen, self._radius)
            for edge in self._graph.edges(portal, backwards=True):
                edge.portal.before.renumber(portal, new)
            for edge in self._graph.edges(portal):
                edge.portal.after.renumber(portal, new)
        return found

    def _cheapest_chain(self) -> list[tuple[Portal, np.ndarray]]:
        """Return the portals and boxes of the cheapest chain, from the start to the goal."""
        portals = {id(portal): portal for portal in self._graph.portals}
        portal, index = self._graph.portals[-1], 0
        chain = [(portal, portal.boxes[0])]
        while portal is not self._graph.portals[0]:
            portal, index = portals[int(portal.before.portals[index])], int(portal.before.boxes[index])
            chain.append((portal, portal.boxes[index]))
        return chain[::-1]

    def _place_for_level(self) -> tuple[Portal, Portal, float] | None:
        """Return between which portals to add which level: where the cheapest chain leads farthest into an obstacle."""
        deepest, place = self._problem.vehicle.required_clearance - DEPTH * self._radius, None
        margin = LEAST_SPACING * self._radius
        for (portal, box), (following, other) in pairwise(self._cheapest_chain()):
            if following.level - portal.level >= 2 * margin and self._are_small(box, other):
                room, share = self._least_room(box, other)
                if room < deepest:
                    deepest, place = room, (portal, following, _level_between(portal, following, share, margin))
        return place

    def _are_small(self, box: np.ndarray, other: np.ndarray) -> bool:
        return bool(box[4] + other[4] <= 2 * SMALL * self._radius and box[7] + other[7] <= 2 * SMALL_TURN)

    def _least_room(self, box: np.ndarray, other: np.ndarray) -> tuple[float, float]:
        """Return the least clearance along the curve between the centres of two boxes [m], and at which share of it."""
        curve = dubins.shortest((box[0], box[1], box[6]), (other[0], other[1], other[6]), self._radius)
        poses = curve.poses(max(LEAST_POSE_SPACING, curve.length / 40))
        room = self._field.at(np.ascontiguousarray(poses[:, :2]))
        return float(room.min()), float(np.argmin(room)) / max(1, len(room) - 1)


def _level_between(portal: Portal, following: Portal, share: float, margin: float) -> float:
    """Return the level at a share of the rise from a portal to a following one, at least `margin` from both [m]."""
    rise = following.level - portal.level
    return portal.level + min(max(share * rise, margin), rise - margin)
