# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The inner loops of Algorithm 1 (RRT) and Algorithm 2 (RRT*) of A. Khanal, RRT and RRT* Using Vehicle Dynamics.

Algorithm 2 is completed by the half that it leaves out and S. Karaman and E. Frazzoli, Sampling-based algorithms for optimal
motion planning (2011), have: the parent of a new node is chosen among its near nodes too, not only theirs rewired.
"""

import cython
import numpy as np

from .arrays import resized

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.collision import CollisionChecker
    from cython.cimports.dubins_rrt_ros.planning._kernels.cost_to_go import CostToGoKernel
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import TWO_PI, drive, shortest, turn_of
    from cython.cimports.dubins_rrt_ros.planning._kernels.near import BackwardNeighbors, ForwardNeighbors
    from cython.cimports.dubins_rrt_ros.planning._kernels.tree import SearchTree
    from cython.cimports.libc.math import ceil, fabs, log, remainder
else:
    from math import ceil, fabs, log, remainder

    from .collision import CollisionChecker
    from .cost_to_go import CostToGoKernel
    from .dubins import TWO_PI, drive, shortest, turn_of
    from .near import BackwardNeighbors, ForwardNeighbors
    from .tree import SearchTree

#: A smaller gain is rounding, and no reason to rewire [m].
LEAST_GAIN = cython.declare(cython.double, 1e-9)
NO_WAY = cython.declare(cython.double, 1e300)
#: Where there is a limit to beat, one sample of so many is taken through RRT* in full, which is enough for asymptotic optimality.
#: The others look for parents that are of use and no farther away than the nearest often are, which is much faster.
SAMPLES_PER_FULL = cython.declare(cython.int, 64)
#: By how much the sum of a step's arcs may exceed it, relatively.
ROUNDING = cython.declare(cython.double, 1e-9)


@cython.cclass
class RrtKernel:
    """Adds samples to a tree.

    Attributes:
        goal_nodes: the nodes that reach the goal are its first `goal_count`.
    """

    tree: SearchTree
    body: CollisionChecker
    step: cython.double
    longest: cython.double
    near_factor: cython.double
    goal_x: cython.double
    goal_y: cython.double
    goal_theta: cython.double
    tolerance_xy: cython.double
    tolerance_yaw: cython.double
    closest: BackwardNeighbors
    to: BackwardNeighbors
    onward: ForwardNeighbors
    bounded: cython.bint
    tried: cython.int
    limit: cython.double
    from_start: CostToGoKernel
    to_goal: CostToGoKernel
    goal_nodes: cython.int[::1]
    goal_count = cython.declare(cython.int, visibility="readonly")

    def __init__(self, tree: SearchTree, body: CollisionChecker, step, near_factor, most_near, goal, tolerance_xy, tolerance_yaw):
        """
        Args:
            body: what must be free along every edge.
            step: the longest new edge [m]; 0 is unlimited.
            near_factor: near sets have near_factor * log(size) nodes, at most `most_near`.
            goal: (x, y, theta); tolerance_xy [m] and tolerance_yaw [rad] say what counts as reaching it.
        """
        self.tree = tree
        self.body, self.step, self.near_factor = body, step, near_factor
        self.longest = step * (1 + ROUNDING) if step > 0 else NO_WAY
        self.goal_x, self.goal_y, self.goal_theta = goal
        self.tolerance_xy, self.tolerance_yaw = tolerance_xy, tolerance_yaw
        self.closest = BackwardNeighbors(tree, 1)
        self.to = BackwardNeighbors(tree, most_near)
        self.onward = ForwardNeighbors(tree, most_near)
        self.goal_nodes = np.empty(0, np.int32)
        self.goal_count = 0
        self.bounded = False
        self.tried = 0
        self.limit = NO_WAY

    def set_cost_bound(self, limit: cython.double, from_start: CostToGoKernel, to_goal: CostToGoKernel):
        """From now on add and attach only what can be on a path shorter than `limit` [m], by distances that none falls below."""
        self.bounded = True
        self.limit, self.from_start, self.to_goal = limit, from_start, to_goal

    def insert_path(self, poses: cython.double[:, ::1], words: cython.schar[::1], lengths: cython.double[:, ::1],
                    end: cython.int):
        """Add a path from the root, and rewire the nodes near it.

        Args:
            poses, words, lengths: of the path, the root's first.
            end: the node at the end of the path, or -1 where it has none yet.
        """
        last: cython.int = cython.cast(cython.int, poses.shape[0]) - 1
        node: cython.int = 0
        i: cython.int
        has_others: cython.bint = self.tree.size > 1  # those on the path itself gain nothing
        self.reserve(last)
        with cython.nogil:
            for i in range(1, last + 1):
                if i < last or end < 0:
                    node = self.add(poses[i, 0], poses[i, 1], poses[i, 2], node, words[i],
                                    lengths[i, 0], lengths[i, 1], lengths[i, 2])
                    if has_others:
                        self.to.collect_nearest(poses[i, 0], poses[i, 1], poses[i, 2], self.near_count(), self.longest)
                        self.rewire(node, self.to.neighbor_radius)
                elif self.tree.costs[node] + (lengths[i, 0] + lengths[i, 1] + lengths[i, 2]) < self.tree.costs[end]:
                    self.tree.reparent(end, node, words[i], lengths[i, 0], lengths[i, 1], lengths[i, 2])

    def reserve(self, more: cython.int):
        """Make room for `more` nodes, so that adding them allocates nothing."""
        self.tree.reserve(more)
        if self.goal_count + more > self.goal_nodes.shape[0]:
            self.goal_nodes = resized(self.goal_nodes, 2 * (self.goal_count + more))

    def best_goal_node(self) -> int:
        """The cheapest node that reaches the goal, or -1."""
        best: cython.int = -1
        i: cython.int
        for i in range(self.goal_count):
            if best < 0 or self.tree.costs[self.goal_nodes[i]] < self.tree.costs[best]:
                best = self.goal_nodes[i]
        return best

    def rrt(self, samples: cython.double[:, ::1], begin: cython.int, end: cython.int) -> int:
        """Algorithm 1 over rows of (n, 3) samples; ends with the first path. Returns the row after the last one used."""
        i: cython.int = begin
        with cython.nogil:
            while i < end and self.goal_count == 0:
                self.extend(samples[i, 0], samples[i, 1], samples[i, 2])
                i += 1
        return i

    def rrt_star(self, samples: cython.double[:, ::1], begin: cython.int, end: cython.int) -> int:
        """Algorithm 2 over rows of (n, 3) samples; pauses at the first path. Returns the row after the last one used."""
        i: cython.int = begin
        had_path: cython.bint = self.goal_count > 0
        with cython.nogil:
            while i < end and (had_path or self.goal_count == 0):
                self.extend_and_rewire(samples[i, 0], samples[i, 1], samples[i, 2])
                i += 1
        return i

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def extend(self, x: cython.double, y: cython.double, theta: cython.double) -> cython.void:
        """One round of Algorithm 1: find the closest link, steer towards the sample, add unless it collides."""
        word: cython.int
        first: cython.double
        second: cython.double
        third: cython.double
        if self.step == 0 and not self.body.free(x, y, theta):
            return
        x, y, theta, word, first, second, third = self.steer(x, y, theta)
        if self.closest.count == 0 or first + second + third == 0:
            return
        if self.edge_is_free(self.closest.nodes[0], word, first, second, third):
            self.add(x, y, theta, self.closest.nodes[0], word, first, second, third)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def extend_and_rewire(self, x: cython.double, y: cython.double, theta: cython.double) -> cython.void:
        """One round of Algorithm 2: steer, choose the parent among the near nodes, add, rewire the near nodes through it."""
        word: cython.int = 0
        first: cython.double = 0
        second: cython.double = 0
        third: cython.double = 0
        if self.step > 0:
            x, y, theta, word, first, second, third = self.steer(x, y, theta)
            if self.closest.count == 0:
                return
        if not self.body.free(x, y, theta):
            return
        limit: cython.double = self.limit
        if self.bounded:
            limit -= self.cost_to_go(x, y, theta)
            if self.cost_to_come(x, y, theta) >= limit:
                return
        self.tried += 1
        if self.bounded and self.tried % SAMPLES_PER_FULL != 0:
            self.to.collect_useful(x, y, theta, self.near_count(), limit, self.longest)
        else:
            self.to.collect_nearest(x, y, theta, self.near_count(), self.longest)
        if self.step > 0 and (self.to.count == 0 or self.to.keys[self.to.count - 1] > first + second + third):
            # The edge as it was steered: solved anew, rounding of the pose can make it longer by a full circle.
            self.to.insert(self.closest.nodes[0], word, first, second, third)
        if self.to.count == 0:
            return
        node: cython.int
        if self.to.keys[0] == 0:
            # The goal is drawn again and again; once it is in the tree, that is another try to reach it from elsewhere.
            node = self.to.nodes[0]
            self.choose_parent(x, y, theta, node, self.tree.costs[node] - LEAST_GAIN)
            return
        neighbor_radius: cython.double = self.to.neighbor_radius
        node = self.choose_parent(x, y, theta, -1, limit)
        if node >= 0:
            self.rewire(node, neighbor_radius)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def near_count(self) -> cython.int:
        """How many nodes are near."""
        return cython.cast(cython.int, ceil(self.near_factor * log(self.tree.indexed + 1)))

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def cost_to_go(self, x: cython.double, y: cython.double, theta: cython.double) -> cython.double:
        """A length that no path from a pose to the goal falls below."""
        around: cython.double = self.to_goal.at(x, y)
        if around >= self.limit or self.tolerance_xy > 0 or self.tolerance_yaw > 0:
            return around
        word: cython.int
        first: cython.double
        second: cython.double
        third: cython.double
        word, first, second, third = shortest(x, y, theta, self.goal_x, self.goal_y, self.goal_theta, self.tree.radius)
        return max(around, first + second + third)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def cost_to_come(self, x: cython.double, y: cython.double, theta: cython.double) -> cython.double:
        """A length that no path from the start to a pose falls below."""
        word: cython.int
        first: cython.double
        second: cython.double
        third: cython.double
        word, first, second, third = shortest(self.tree.poses[0, 0], self.tree.poses[0, 1], self.tree.poses[0, 2], x, y, theta,
                                              self.tree.radius)
        return max(self.from_start.at(x, y), first + second + third)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def steer(self, x: cython.double, y: cython.double, theta: cython.double
              ) -> tuple[cython.double, cython.double, cython.double, cython.int, cython.double, cython.double, cython.double]:
        """The pose, and the edge to it, that lies from the closest node towards the sample, at most a step away."""
        self.closest.collect_nearest(x, y, theta, 1, NO_WAY)
        node: cython.int = self.closest.nodes[0]
        word: cython.int = self.closest.words[0]
        first: cython.double = self.closest.lengths[0, 0]
        second: cython.double = self.closest.lengths[0, 1]
        third: cython.double = self.closest.lengths[0, 2]
        if self.closest.count == 0 or self.step == 0 or first + second + third <= self.step:
            return x, y, theta, word, first, second, third
        first = min(first, self.step)
        second = min(second, self.step - first)
        third = min(third, self.step - first - second)
        x, y, theta = self.tree.poses[node, 0], self.tree.poses[node, 1], self.tree.poses[node, 2]
        x, y, theta = drive(x, y, theta, self.tree.radius, turn_of(word, 0), first)
        x, y, theta = drive(x, y, theta, self.tree.radius, turn_of(word, 1), second)
        x, y, theta = drive(x, y, theta, self.tree.radius, turn_of(word, 2), third)
        return x, y, remainder(theta, TWO_PI), word, first, second, third

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def choose_parent(self, x: cython.double, y: cython.double, theta: cython.double, node: cython.int,
                      limit: cython.double) -> cython.int:
        """Attach the pose by the cheapest free edge from its near nodes, if it then costs less than `limit`.

        `node` is the pose's own, or -1 to add one; what is returned is the node, or -1 where no edge serves.
        """
        cheapest: cython.double
        cost: cython.double
        i: cython.int
        best: cython.int
        parent: cython.int
        while True:
            cheapest, best = limit, -1
            for i in range(self.to.count):
                cost = self.tree.costs[self.to.nodes[i]] + self.to.keys[i]
                if cost < cheapest:
                    cheapest, best = cost, i
            if best < 0:
                return -1
            parent = self.to.nodes[best]
            if self.edge_is_free(parent, self.to.words[best], self.to.lengths[best, 0], self.to.lengths[best, 1],
                                 self.to.lengths[best, 2]):
                break
            self.to.keys[best] = NO_WAY
        if node < 0:
            return self.add(x, y, theta, parent, self.to.words[best], self.to.lengths[best, 0], self.to.lengths[best, 1],
                            self.to.lengths[best, 2])
        self.tree.reparent(node, parent, self.to.words[best], self.to.lengths[best, 0], self.to.lengths[best, 1],
                           self.to.lengths[best, 2])
        return node

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def rewire(self, node: cython.int, neighbor_radius: cython.double) -> cython.void:
        """Reroute through `node` each near node that is cheaper so, and free. Its ancestors cannot be cheaper."""
        i: cython.int
        near: cython.int
        self.onward.collect_cheaper(node, neighbor_radius, LEAST_GAIN)
        for i in range(self.onward.count):
            near = self.onward.nodes[i]
            if (self.tree.costs[node] + self.onward.keys[i] < self.tree.costs[near] - LEAST_GAIN
                    and self.edge_is_free(node, self.onward.words[i], self.onward.lengths[i, 0], self.onward.lengths[i, 1],
                                          self.onward.lengths[i, 2])):
                self.tree.reparent(near, node, self.onward.words[i], self.onward.lengths[i, 0], self.onward.lengths[i, 1],
                                   self.onward.lengths[i, 2])

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def edge_is_free(self, parent: cython.int, word: cython.int, first: cython.double, second: cython.double,
                     third: cython.double) -> cython.bint:
        """Whether the curve from a node is free."""
        return self.body.curve_is_free(self.tree.poses[parent, 0], self.tree.poses[parent, 1], self.tree.poses[parent, 2],
                                       self.tree.radius, word, first, second, third)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def add(self, x: cython.double, y: cython.double, theta: cython.double, parent: cython.int, word: cython.int,
            first: cython.double, second: cython.double, third: cython.double) -> cython.int:
        """Add a node, and note it where it reaches the goal."""
        node: cython.int = self.tree.add(x, y, theta, parent, word, first, second, third)
        dx: cython.double = x - self.goal_x
        dy: cython.double = y - self.goal_y
        if (dx * dx + dy * dy <= self.tolerance_xy * self.tolerance_xy
                and fabs(remainder(theta - self.goal_theta, TWO_PI)) <= self.tolerance_yaw):
            self.goal_nodes[self.goal_count] = node
            self.goal_count += 1
        return node
