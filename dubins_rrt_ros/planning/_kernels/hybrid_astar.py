# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Hybrid A*: a search over short arcs that keeps one pose for each cell of position and heading, its closed set.

D. Dolgov, S. Thrun, M. Montemerlo and J. Diebel, Practical search techniques in path planning for autonomous driving (2008).
The pose with the least sum of cost and weighted cost-to-go is expanded next. The cost-to-go is the greater of two lower bounds:
the way around the obstacles for a disc that turns on the spot, and the Dubins curve without obstacles. From each pose the Dubins
curve to the goal is tried, unless it is so much shorter than the way around the obstacles that it must hit one.

The cost-to-go can lead into a passage that the vehicle cannot turn into. The search would then expand all poses in front of it,
with every heading, before it tries another way. A visit penalty therefore raises the key of a pose with each pose that was
expanded nearby.

Where the cost is the length, the curve to the goal costs what the key says, so the first one that is free is the best. Where the
cost is another, it may cost more than the way around crowded places; the path is then kept, and the search goes on for cheaper
ones. The curve is tried from each pose then, since of a cost-to-go it is not known how much of it is length.
"""

import cython
import numpy as np

from .arrays import resized

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.closed_set import UNSEEN, ClosedSet
    from cython.cimports.dubins_rrt_ros.planning._kernels.collision import CollisionChecker
    from cython.cimports.dubins_rrt_ros.planning._kernels.cost_to_go import CostToGoKernel
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import (
        TWO_PI,
        UNLIMITED,
        Curve,
        Pose,
        drive_from,
        length_of,
        rounding_at,
        shortest_within,
        single_arc,
    )
    from cython.cimports.dubins_rrt_ros.planning._kernels.edge_cost import EdgeCost
    from cython.cimports.dubins_rrt_ros.planning._kernels.heap import Heap
    from cython.cimports.libc.math import cos, remainder, sin
else:
    from math import cos, remainder, sin

    from .closed_set import UNSEEN, ClosedSet
    from .collision import CollisionChecker
    from .cost_to_go import CostToGoKernel
    from .dubins import TWO_PI, UNLIMITED, Curve, Pose, drive_from, length_of, rounding_at, shortest_within, single_arc
    from .edge_cost import EdgeCost
    from .heap import Heap

#: Cost in the closed set of a cell whose pose was expanded.
EXPANDED = cython.declare(cython.float, -1)
#: Share of the way around the obstacles below which a curve to the goal is not tried. It is below 1 since the computed way can be
#: some hundredths too long.
LEAST_SHARE = cython.declare(cython.double, 0.95)
#: Number of expansions after which a path that is kept is taken, though it is not good enough.
EXPANSIONS_FOR_BETTER = cython.declare(cython.int, 8)
#: Number of arcs from a pose: straight on, left and right.
TURNS = cython.declare(cython.int, 3)


@cython.cclass
class HybridAStar:
    """A search, which `run` takes further a portion at a time.

    Attributes:
        size: number of poses reached.
        expanded: number of poses expanded.
        ended: whether a path was found, or nothing is left to expand.
    """

    def __init__(self, checker: CollisionChecker, edge_cost: EdgeCost, radius, start, goals, to_goal: CostToGoKernel,
                 corner, extent, arc, sectors, weight, visit_penalty, limit, max_expanded,
                 turning_arc=None, arc_factors=None, retry_penalty=0.0, good_enough=0.0):
        """Start a search.

        Args:
            checker: judges every arc.
            edge_cost: the cost of arcs and curves.
            radius: the turning radius [m].
            start: (x, y, theta).
            goals: (m, 3) poses, any of which will do.
            to_goal: the cost-to-go around obstacles.
            corner, extent: lowest (x, y) of the map, and its size [m].
            arc: length of an arc [m]; the cells of the closed set have sides of 0.7 of that.
            sectors: number of headings that the closed set tells apart.
            weight: factor of the cost-to-go: 1 seeks the shortest path; greater values find one sooner.
            visit_penalty: added to a pose's key for each pose expanded in its block of four cells [lengths of arcs].
            limit: cost that paths must be below [m].
            max_expanded: maximum number of poses to expand.
            turning_arc: length of an arc that turns [m]; None is `arc`.
            arc_factors: (n,) random factors of the lengths of arcs, used in turn; None is 1.
            retry_penalty: added to a pose's key each time it was expanded, to expand it again with other arcs [lengths of arcs];
                0 expands each pose once.
            good_enough: cost of a free curve to the goal, relative to the cost-to-go, up to which its path ends the search.
        """
        self.checker, self.edge_cost, self.radius = checker, edge_cost, radius
        self.to_goal, self.goals, self.good_enough = to_goal, goals, good_enough
        self.goal_headings = np.column_stack([np.sin(goals[:, 2]), np.cos(goals[:, 2])])
        self.rounding = max(rounding_at(corner[0], corner[1]), rounding_at(corner[0] + extent[0], corner[1] + extent[1]))
        self.arc, self.weight, self.visit_penalty, self.limit, self.max_expanded = arc, weight, visit_penalty, limit, max_expanded
        self.closed_set = ClosedSet(corner, extent, 0.7 * arc, sectors)
        self.visits_near = ClosedSet(corner, extent, 1.4 * arc, 1)  # its costs are counts of expanded poses
        self.poses, self.costs = np.empty((0, 3)), np.empty(0)
        self.parents, self.turns, self.curve_may_be_free = np.empty(0, np.int32), np.empty(0, np.int8), np.empty(0, np.int8)
        self.arcs, self.keys, self.tried = np.empty(0), np.empty(0), np.empty(0, np.int8)
        self.arc_factors = np.ones(1) if arc_factors is None else arc_factors
        self.next_factor, self.retry_penalty = 0, retry_penalty
        self.turning_arc = arc if turning_arc is None else turning_arc
        self.open = Heap(0)
        self.last = -1
        self.size = self.expanded = 0
        self.ended = self.done = False
        self.reserve(1)
        self.add(Pose(start[0], start[1], start[2]), 0, -1, 0, 0, 0, True)

    def run(self, expansions: cython.int):
        """Expand up to `expansions` more poses, fewer where the search ends."""
        _: cython.int
        expansions = min(expansions, self.max_expanded - self.expanded)
        self.reserve((TURNS + 1) * expansions)
        with cython.nogil:
            for _ in range(expansions):
                if self.open.count == 0 or self.done:
                    break
                self.expand(self.open.pop())
        self.ended = self.done or self.open.count == 0 or self.expanded == self.max_expanded

    def reserve(self, more: cython.int):
        """Make room for `more` poses, so that adding them allocates nothing."""
        self.closed_set.reserve(more)
        if self.visit_penalty > 0:
            self.visits_near.reserve(more)
        self.open.reserve(more)
        if self.size + more > self.parents.shape[0]:
            capacity = self.size + max(more, self.size)
            self.poses, self.costs = resized(self.poses, capacity), resized(self.costs, capacity)
            self.parents, self.turns = resized(self.parents, capacity), resized(self.turns, capacity)
            self.curve_may_be_free = resized(self.curve_may_be_free, capacity)
            self.arcs, self.keys = resized(self.arcs, capacity), resized(self.keys, capacity)
            self.tried = resized(self.tried, capacity)

    def path(self):
        """Return the path that was found, or None.

        Returns:
            (n, 3) poses from the start to a goal, and (n,) words and (n, 3) lengths [m] of the curves to them from the poses
            before; the first of these mean nothing.
        """
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
        words = np.append(np.where(turns < 0, 1, 0), self.last_curve.word).astype(np.int8)
        arcs = np.asarray(self.arcs)[nodes][:, None]
        lengths = np.where(np.column_stack([turns != 0, turns == 0, np.zeros(len(nodes), bool)]), arcs, 0.0)
        lengths[:1] = 0
        last = [self.last_curve.first, self.last_curve.second, self.last_curve.third]
        return poses, words, np.concatenate([lengths, [last]])

    def pose_of(self, node):
        """Return a pose that was reached."""
        return Pose(self.poses[node, 0], self.poses[node, 1], self.poses[node, 2])

    def expand(self, node):
        """Try the curve to the goal, then the three arcs from a pose, unless another pose of its cell was expanded."""
        if self.last >= 0 and (self.keys[node] >= self.weight * self.limit
                               or (self.good_enough > 0 and self.expanded % EXPANSIONS_FOR_BETTER == 0)):
            self.done = True
            return
        pose: Pose = self.pose_of(node)
        entry: cython.int = self.closed_set.entry_at(pose.x, pose.y, pose.theta)
        if not self.tried[node] and self.closed_set.costs[entry] == EXPANDED:
            return
        self.closed_set.costs[entry] = EXPANDED
        self.expanded += 1
        if self.visit_penalty > 0:
            self.visits_near.costs[self.visits_near.entry_at(pose.x, pose.y, 0)] += 1
        if not self.tried[node] and self.curve_may_be_free[node]:
            self.try_curve_to_goal(node)
            if self.done:
                return
        sine: cython.double = sin(pose.theta)
        cosine: cython.double = cos(pose.theta)
        self.extend(node, sine, cosine, 0)
        self.extend(node, sine, cosine, 1)
        self.extend(node, sine, cosine, -1)
        if self.retry_penalty > 0:
            self.tried[node] = 1
            self.keys[node] += self.retry_penalty * self.arc
            self.open.push(node, self.keys[node])

    def try_curve_to_goal(self, node):
        """Try the shortest curve to a goal: if it is free and makes a cheaper path than before, it is the last one of that."""
        goal: cython.int
        nearest: cython.int = -1
        pose: Pose = self.pose_of(node)
        curve: Curve
        last_curve: Curve = Curve(0, 0, 0, 0)
        limit: cython.double = self.limit - self.costs[node]
        for goal in range(self.goals.shape[0]):
            curve = self.curve_to_goal(pose, goal, limit)
            if curve.first < UNLIMITED:
                limit = length_of(curve)
                nearest, last_curve = goal, curve
        if nearest < 0 or not self.checker.motion_is_free(pose, self.radius, last_curve):
            return
        limit = self.limit - self.costs[node]
        cost: cython.double = self.edge_cost.of(pose, self.radius, last_curve, limit)
        if self.edge_cost.is_length or cost < limit:
            self.limit = self.costs[node] + cost
            self.last, self.last_goal, self.last_curve = node, nearest, last_curve
            self.done = self.edge_cost.is_length or cost <= self.good_enough * self.to_goal.at(pose.x, pose.y)

    def extend(self, node, sine, cosine, turn):
        """Drive an arc from a pose, given the sine and cosine of its heading.

        Keep the pose at its end, if that is free, the cheapest of its cell so far and may lead to the goal below the limit.
        """
        pose: Pose = self.pose_of(node)
        arc: cython.double = self.next_arc(turn)
        curve: Curve = single_arc(turn, arc)
        end: Pose = drive_from(pose, sine, cosine, self.radius, turn, arc)
        end = Pose(end.x, end.y, remainder(end.theta, TWO_PI))
        if not self.checker.pose_is_free(end):
            return
        cost: cython.double = self.costs[node] + length_of(curve)
        entry: cython.int = self.closed_set.entry_at(end.x, end.y, end.theta)
        seen: cython.float = self.closed_set.costs[entry]
        if seen != UNSEEN and seen <= cost * (1 + 1e-6):
            return
        more: cython.double
        curve_may_be_free: cython.bint
        more, curve_may_be_free = self.cost_to_go(end, self.limit - cost)
        if cost + more >= self.limit:
            return
        if not self.checker.motion_is_free(pose, self.radius, curve):
            return
        if not self.edge_cost.is_length:
            cost = self.costs[node] + self.edge_cost.of(pose, self.radius, curve, self.limit - more - self.costs[node])
            if cost + more >= self.limit or (seen != UNSEEN and seen <= cost * (1 + 1e-6)):
                return
        self.closed_set.costs[entry] = cython.cast(cython.float, cost)
        key: cython.double = cost + self.weight * more
        if self.visit_penalty > 0:
            key += self.visit_penalty * self.arc * self.visits_near.costs[self.visits_near.entry_at(end.x, end.y, 0)]
        self.add(end, cost, node, turn, arc, key, curve_may_be_free)

    def next_arc(self, turn):
        """Return the length of the next arc [m]."""
        arc: cython.double = (self.arc if turn == 0 else self.turning_arc) * self.arc_factors[self.next_factor]
        self.next_factor = self.next_factor + 1 if self.next_factor + 1 < self.arc_factors.shape[0] else 0
        return arc

    def cost_to_go(self, pose, limit):
        """Return a lower bound of the cost to the goal, and whether the curve to it may be free; valid below `limit`."""
        around: cython.double = self.to_goal.at(pose.x, pose.y)
        if around >= limit or self.goals.shape[0] > 1:
            return around, True
        direct: cython.double = length_of(self.curve_to_goal(pose, 0, limit))
        return max(around, direct), direct >= LEAST_SHARE * around or not self.edge_cost.is_length

    def curve_to_goal(self, pose, goal, limit):
        """Return the shortest curve to a goal; its first arc is UNLIMITED where it is not shorter than `limit`."""
        return shortest_within(self.goals[goal, 0] - pose.x, self.goals[goal, 1] - pose.y, pose.theta, sin(pose.theta),
                               cos(pose.theta), self.goals[goal, 2], self.goal_headings[goal, 0], self.goal_headings[goal, 1],
                               self.radius, self.rounding, limit)

    def add(self, pose, cost, parent, turn, arc, key, curve_may_be_free):
        """Add a pose that was reached to the open set."""
        node: cython.int = self.size
        self.size += 1
        self.poses[node, 0], self.poses[node, 1], self.poses[node, 2] = pose.x, pose.y, pose.theta
        self.costs[node], self.parents[node], self.turns[node] = cost, parent, turn
        self.curve_may_be_free[node] = curve_may_be_free
        self.arcs[node], self.keys[node], self.tried[node] = arc, key, 0
        self.open.push(node, key)
