# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Hybrid A*: a search over short arcs that keeps one pose per cell of a lattice of positions and headings.

D. Dolgov, S. Thrun, M. Montemerlo and J. Diebel, Practical search techniques in path planning for autonomous driving (2008).
The next pose is the one whose cost and weighted cost-to-go together are least; the cost-to-go is the longer one of the way around
the obstacles and of the Dubins curve without them. From each pose the Dubins curve to the goal is tried, unless it is so much
shorter than the way around the obstacles that it must hit one.

The cost-to-go can lead into a passage that the vehicle cannot turn into. Before another way is tried, all poses in front of it
would be expanded, with every heading. So a pose may count for more the more of them were expanded around it.
"""

import cython
import numpy as np

from .arrays import resized

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.closed_set import UNSEEN, ClosedSet
    from cython.cimports.dubins_rrt_ros.planning._kernels.collision import CollisionChecker
    from cython.cimports.dubins_rrt_ros.planning._kernels.cost_to_go import CostToGoKernel
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import NO_CURVE, TWO_PI, drive_from, rounding_at, shortest_within
    from cython.cimports.dubins_rrt_ros.planning._kernels.heap import Heap
    from cython.cimports.libc.math import cos, remainder, sin
else:
    from math import cos, remainder, sin

    from .closed_set import UNSEEN, ClosedSet
    from .collision import CollisionChecker
    from .cost_to_go import CostToGoKernel
    from .dubins import NO_CURVE, TWO_PI, drive_from, rounding_at, shortest_within
    from .heap import Heap

#: What the lattice has as the cost of a cell whose pose was expanded.
EXPANDED = cython.declare(cython.float, -1)
#: A curve to the goal that is shorter than this share of the way around the obstacles is not tried; that can come out too long by
#: some hundredths.
LEAST_SHARE = cython.declare(cython.double, 0.95)
#: An expansion reaches so many poses at most.
TURNS = cython.declare(cython.int, 3)


@cython.cclass
class HybridAStar:
    """A search under way.

    Attributes:
        size: how many poses were reached; expanded: how many of them were expanded.
        ended: whether a path was found, or nothing is left to expand.
    """

    body: CollisionChecker
    radius: cython.double
    to_goal: CostToGoKernel
    goals: cython.double[:, ::1]
    goal_headings: cython.double[:, ::1]
    rounding: cython.double
    arc: cython.double
    weight: cython.double
    visit_penalty: cython.double
    limit: cython.double
    most: cython.int
    size = cython.declare(cython.int, visibility="readonly")
    expanded = cython.declare(cython.int, visibility="readonly")
    ended = cython.declare(cython.bint, visibility="readonly")
    poses: cython.double[:, ::1]
    costs: cython.double[::1]
    parents: cython.int[::1]
    turns: cython.schar[::1]
    curve_may_be_free: cython.schar[::1]
    lattice: ClosedSet
    visits_near: ClosedSet
    open: Heap
    last: cython.int
    last_goal: cython.int
    last_word: cython.int
    last_lengths: cython.double[::1]

    def __init__(self, body: CollisionChecker, radius, start, goals, to_goal: CostToGoKernel, corner, extent, arc, sectors,
                 weight, visit_penalty, limit, most):
        """
        Args:
            body: what must be free along all arcs.
            start: (x, y, theta); goals: (m, 3) poses any of which will do.
            to_goal: the distances to the goal.
            corner, extent: lowest (x, y) of the map, and its size [m].
            arc: the length of an arc [m]; the lattice has cells of about 0.7 of that, and `sectors` headings.
            weight: of the cost-to-go: 1 seeks the shortest path, more a quick one.
            crowding: by how many arcs' lengths a pose counts for more for each that was expanded in its block of four cells.
            limit: paths that are not shorter are not sought [m].
            most: no more poses are expanded.
        """
        self.body, self.radius = body, radius
        self.to_goal, self.goals = to_goal, goals
        self.goal_headings = np.column_stack([np.sin(goals[:, 2]), np.cos(goals[:, 2])])
        self.rounding = max(rounding_at(corner[0], corner[1]), rounding_at(corner[0] + extent[0], corner[1] + extent[1]))
        self.arc, self.weight, self.visit_penalty, self.limit, self.most = arc, weight, visit_penalty, limit, most
        self.lattice = ClosedSet(corner, extent, 0.7 * arc, sectors)
        self.visits_near = ClosedSet(corner, extent, 1.4 * arc, 1)  # whose costs are counts
        self.poses, self.costs = np.empty((0, 3)), np.empty(0)
        self.parents, self.turns, self.curve_may_be_free = np.empty(0, np.int32), np.empty(0, np.int8), np.empty(0, np.int8)
        self.open = Heap(0)
        self.last_lengths = np.zeros(3)
        self.last = -1
        self.size = self.expanded = 0
        self.ended = False
        self.reserve(1)
        self.add(start[0], start[1], start[2], 0, -1, 0, 0, True)

    def run(self, expansions: cython.int):
        """Expand up to so many poses more, fewer where the search ends."""
        _: cython.int
        expansions = min(expansions, self.most - self.expanded)
        self.reserve(TURNS * expansions)
        with cython.nogil:
            for _ in range(expansions):
                if self.open.count == 0 or self.last >= 0:
                    break
                self.expand(self.open.pop())
        self.ended = self.last >= 0 or self.open.count == 0 or self.expanded == self.most

    def reserve(self, more: cython.int):
        """Make room for `more` poses, so that adding them allocates nothing."""
        self.lattice.reserve(more)
        if self.visit_penalty > 0:
            self.visits_near.reserve(more)
        self.open.reserve(more)
        if self.size + more > self.parents.shape[0]:
            capacity = self.size + max(more, self.size)
            self.poses, self.costs = resized(self.poses, capacity), resized(self.costs, capacity)
            self.parents, self.turns = resized(self.parents, capacity), resized(self.turns, capacity)
            self.curve_may_be_free = resized(self.curve_may_be_free, capacity)

    def path(self):
        """The path that was found: (n, 3) poses from the start on, and (n,) words and (n, 3) lengths [m] of the curves to them
        from those before, the first of which mean nothing; None where there is none."""
        if self.last < 0:
            return None
        nodes = []
        node: cython.int = self.last
        while node >= 0:
            nodes.append(node)
            node = self.parents[node]
        nodes.reverse()
        poses = np.concatenate([np.asarray(self.poses)[nodes], np.asarray(self.goals)[self.last_goal:self.last_goal + 1]])
        turns = np.asarray(self.turns)[nodes]
        words = np.append(np.where(turns < 0, 1, 0), self.last_word).astype(np.int8)
        lengths = np.where(np.column_stack([turns != 0, turns == 0, np.zeros(len(nodes), bool)]), self.arc, 0.0)
        lengths[:1] = 0
        return poses, words, np.concatenate([lengths, [self.last_lengths]])

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def expand(self, node: cython.int) -> cython.void:
        """Try the curve to the goal, then the three arcs from a pose, unless a better one of its cell was expanded before."""
        entry: cython.int = self.lattice.entry_at(self.poses[node, 0], self.poses[node, 1], self.poses[node, 2])
        if self.lattice.costs[entry] == EXPANDED:
            return
        self.lattice.costs[entry] = EXPANDED
        self.expanded += 1
        if self.visit_penalty > 0:
            self.visits_near.costs[self.visits_near.entry_at(self.poses[node, 0], self.poses[node, 1], 0)] += 1
        if self.curve_may_be_free[node] and self.reaches_goal(node):
            self.last = node
            return
        sine: cython.double = sin(self.poses[node, 2])
        cosine: cython.double = cos(self.poses[node, 2])
        self.extend(node, sine, cosine, 0)
        self.extend(node, sine, cosine, 1)
        self.extend(node, sine, cosine, -1)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def reaches_goal(self, node: cython.int) -> cython.bint:
        """Whether a free curve leads to the goal that is nearest by its curve; if so, it is noted."""
        goal: cython.int
        word: cython.int
        first: cython.double
        second: cython.double
        third: cython.double
        limit: cython.double = self.limit - self.costs[node]
        self.last_goal = -1
        for goal in range(self.goals.shape[0]):
            word, first, second, third = self.curve_to_goal(self.poses[node, 0], self.poses[node, 1], self.poses[node, 2],
                                                            goal, limit)
            if first < NO_CURVE:
                limit = first + second + third
                self.last_goal, self.last_word = goal, word
                self.last_lengths[0], self.last_lengths[1], self.last_lengths[2] = first, second, third
        return self.last_goal >= 0 and self.body.curve_is_free(
            self.poses[node, 0], self.poses[node, 1], self.poses[node, 2], self.radius, self.last_word,
            self.last_lengths[0], self.last_lengths[1], self.last_lengths[2])

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def extend(self, node: cython.int, sine: cython.double, cosine: cython.double, turn: cython.int) -> cython.void:
        """Drive an arc from a pose, whose heading has that sine and cosine; keep where it ends if that can still lead to the goal
        and is the best of its cell so far."""
        x: cython.double
        y: cython.double
        theta: cython.double
        x, y, theta = drive_from(self.poses[node, 0], self.poses[node, 1], self.poses[node, 2], sine, cosine, self.radius, turn,
                                 self.arc)
        theta = remainder(theta, TWO_PI)
        if not self.body.free(x, y, theta):
            return
        cost: cython.double = self.costs[node] + self.arc
        entry: cython.int = self.lattice.entry_at(x, y, theta)
        seen: cython.float = self.lattice.costs[entry]
        if seen != UNSEEN and seen <= cost * (1 + 1e-6):
            return
        more: cython.double
        curve_may_be_free: cython.bint
        more, curve_may_be_free = self.cost_to_go(x, y, theta, self.limit - cost)
        if cost + more >= self.limit:
            return
        if not self.body.curve_is_free(self.poses[node, 0], self.poses[node, 1], self.poses[node, 2], self.radius,
                                       1 if turn < 0 else 0, self.arc if turn != 0 else 0, self.arc if turn == 0 else 0, 0):
            return
        self.lattice.costs[entry] = cython.cast(cython.float, cost)
        key: cython.double = cost + self.weight * more
        if self.visit_penalty > 0:
            key += self.visit_penalty * self.arc * self.visits_near.costs[self.visits_near.entry_at(x, y, 0)]
        self.add(x, y, theta, cost, node, turn, key, curve_may_be_free)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def cost_to_go(self, x: cython.double, y: cython.double, theta: cython.double, limit: cython.double
                   ) -> tuple[cython.double, cython.bint]:
        """A length that no path to the goal falls below, if less than `limit`; and whether the curve to the goal may be free."""
        around: cython.double = self.to_goal.at(x, y)
        if around >= limit or self.goals.shape[0] > 1:
            return around, True
        word: cython.int
        first: cython.double
        second: cython.double
        third: cython.double
        word, first, second, third = self.curve_to_goal(x, y, theta, 0, limit)
        length: cython.double = first + second + third
        return max(around, length), length >= LEAST_SHARE * around

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def curve_to_goal(self, x: cython.double, y: cython.double, theta: cython.double, goal: cython.int, limit: cython.double
                      ) -> tuple[cython.int, cython.double, cython.double, cython.double]:
        """The shortest curve to one of the goals, or none shorter than `limit`."""
        return shortest_within(self.goals[goal, 0] - x, self.goals[goal, 1] - y, theta, sin(theta), cos(theta),
                               self.goals[goal, 2], self.goal_headings[goal, 0], self.goal_headings[goal, 1], self.radius,
                               self.rounding, limit)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def add(self, x: cython.double, y: cython.double, theta: cython.double, cost: cython.double, parent: cython.int,
            turn: cython.int, key: cython.double, curve_may_be_free: cython.bint) -> cython.void:
        """Note a pose that was reached, to be expanded."""
        node: cython.int = self.size
        self.size += 1
        self.poses[node, 0], self.poses[node, 1], self.poses[node, 2] = x, y, theta
        self.costs[node], self.parents[node], self.turns[node] = cost, parent, turn
        self.curve_may_be_free[node] = curve_may_be_free
        self.open.push(node, key)
