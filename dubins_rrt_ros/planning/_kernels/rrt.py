# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The inner loops of Algorithm 1 (RRT) and Algorithm 2 (RRT*) of A. Khanal, RRT and RRT* Using Vehicle Dynamics.

Algorithm 2 there only rewires the near nodes of a new one. Here its parent is chosen among them too, as in S. Karaman and
E. Frazzoli, Sampling-based algorithms for optimal motion planning (2011).
"""

import cython
import numpy as np

from .arrays import resized

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.collision import CollisionChecker
    from cython.cimports.dubins_rrt_ros.planning._kernels.cost_to_go import CostToGoKernel
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import (
        TWO_PI,
        UNLIMITED,
        Curve,
        Pose,
        end_of,
        first_part,
        length_of,
        shortest,
    )
    from cython.cimports.dubins_rrt_ros.planning._kernels.edge_cost import EdgeCost
    from cython.cimports.dubins_rrt_ros.planning._kernels.near import BackwardNeighbors, ForwardNeighbors
    from cython.cimports.dubins_rrt_ros.planning._kernels.tree import SearchTree
    from cython.cimports.libc.math import ceil, fabs, log, remainder
else:
    from math import ceil, fabs, log, remainder

    from .collision import CollisionChecker
    from .cost_to_go import CostToGoKernel
    from .dubins import TWO_PI, UNLIMITED, Curve, Pose, end_of, first_part, length_of, shortest
    from .edge_cost import EdgeCost
    from .near import BackwardNeighbors, ForwardNeighbors
    from .tree import SearchTree

#: Least gain for which a node is rewired [m]; a smaller one is rounding.
LEAST_GAIN = cython.declare(cython.double, 1e-9)
#: Number of samples, where there is a cost bound, of which one goes through RRT* in full: enough for asymptotic optimality.
#: All others search only the nodes within the typical radius whose cost could still improve the solution, which is much faster.
SAMPLES_PER_FULL = cython.declare(cython.int, 64)
#: Relative rounding error of the sum of a step's arcs.
ROUNDING = cython.declare(cython.double, 1e-9)


@cython.cclass
class RrtKernel:
    """RRT and RRT* over blocks of samples, which are added to a tree.

    Attributes:
        goal_nodes: the nodes that reach the goal: its first `goal_count` entries.
    """

    def __init__(self, tree: SearchTree, checker: CollisionChecker, edge_cost: EdgeCost, step, near_factor, max_near, goal,
                 tolerance_xy, tolerance_yaw):
        """Search with a tree, and without a cost bound at first.

        Args:
            checker: judges every edge.
            edge_cost: the cost of edges, which is minimised.
            step: maximum length of a new edge [m]; 0 is unlimited.
            near_factor, max_near: near sets have near_factor * log(size) nodes, at most `max_near`.
            goal: (x, y, theta); tolerance_xy [m] and tolerance_yaw [rad] say what counts as reaching it.
        """
        self.tree = tree
        self.checker, self.edge_cost, self.step, self.near_factor = checker, edge_cost, step, near_factor
        self.max_edge = step * (1 + ROUNDING) if step > 0 else UNLIMITED
        self.goal = Pose(goal[0], goal[1], goal[2])
        self.tolerance_xy, self.tolerance_yaw = tolerance_xy, tolerance_yaw
        self.closest = BackwardNeighbors(tree, 1)
        self.backward = BackwardNeighbors(tree, max_near)
        self.forward = ForwardNeighbors(tree, max_near)
        self.goal_nodes = np.empty(0, np.int32)
        self.goal_count = 0
        self.bounded = False
        self.tried = 0
        self.cost_bound = UNLIMITED

    def set_cost_bound(self, cost_bound: cython.double, from_start: CostToGoKernel, to_goal: CostToGoKernel):
        """Add and rewire from now on only nodes that can be on a path that costs less than `cost_bound` [m].

        Args:
            from_start, to_goal: lower bounds of the costs from the start and to the goal, around the obstacles.
        """
        self.bounded = True
        self.cost_bound, self.from_start, self.to_goal = cost_bound, from_start, to_goal

    def narrow_goal(self, x: cython.double, y: cython.double):
        """Count only nodes at a position, which the goal's tolerance allows, as reaching the goal from now on."""
        kept: cython.int = 0
        i: cython.int
        self.goal, self.tolerance_xy = Pose(x, y, self.goal.theta), 0
        for i in range(self.goal_count):
            if self.tree.poses[self.goal_nodes[i], 0] == x and self.tree.poses[self.goal_nodes[i], 1] == y:
                self.goal_nodes[kept] = self.goal_nodes[i]
                kept += 1
        self.goal_count = kept

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
        pose: Pose
        curve: Curve
        cost: cython.double
        has_others: cython.bint = self.tree.size > 1  # nodes of the path itself gain nothing
        self.reserve(last)
        with cython.nogil:
            for i in range(1, last + 1):
                pose = Pose(poses[i, 0], poses[i, 1], poses[i, 2])
                curve = Curve(words[i], lengths[i, 0], lengths[i, 1], lengths[i, 2])
                cost = self.edge_cost.of(self.tree.pose_of(node), self.tree.radius, curve, UNLIMITED)
                if i < last or end < 0:
                    node = self.add(pose, node, curve, cost)
                    if has_others:
                        self.backward.collect_nearest(pose, self.near_count(), self.max_edge)
                        self.rewire(node, self.backward.neighbor_radius)
                elif self.tree.costs[node] + cost < self.tree.costs[end]:
                    self.tree.reparent(end, node, curve, cost)

    def reserve(self, more: cython.int):
        """Make room for `more` nodes, so that adding them allocates nothing."""
        self.tree.reserve(more)
        if self.goal_count + more > self.goal_nodes.shape[0]:
            self.goal_nodes = resized(self.goal_nodes, 2 * (self.goal_count + more))

    def best_goal_node(self) -> int:
        """Return the cheapest node that reaches the goal, or -1."""
        best: cython.int = -1
        i: cython.int
        for i in range(self.goal_count):
            if best < 0 or self.tree.costs[self.goal_nodes[i]] < self.tree.costs[best]:
                best = self.goal_nodes[i]
        return best

    def rrt(self, samples: cython.double[:, ::1], begin: cython.int, end: cython.int) -> int:
        """Run Algorithm 1 over rows of (n, 3) samples, up to the first path; return the row after the last one used."""
        i: cython.int = begin
        with cython.nogil:
            while i < end and self.goal_count == 0:
                self.extend(Pose(samples[i, 0], samples[i, 1], samples[i, 2]))
                i += 1
        return i

    def rrt_star(self, samples: cython.double[:, ::1], begin: cython.int, end: cython.int) -> int:
        """Run Algorithm 2 over rows of (n, 3) samples, pausing at the first path; return the row after the last one used."""
        i: cython.int = begin
        had_path: cython.bint = self.goal_count > 0
        with cython.nogil:
            while i < end and (had_path or self.goal_count == 0):
                self.extend_and_rewire(Pose(samples[i, 0], samples[i, 1], samples[i, 2]))
                i += 1
        return i

    def extend(self, sample):
        """Run one round of Algorithm 1: find the closest node, steer towards the sample, add the new pose if the edge is free."""
        if self.step == 0 and not self.checker.pose_is_free(sample):
            return
        if not self.steer(sample) or length_of(self.steered) == 0:
            return
        begin: Pose = self.tree.pose_of(self.closest.nodes[0])
        if self.checker.motion_is_free(begin, self.tree.radius, self.steered):
            self.add(self.new_pose, self.closest.nodes[0], self.steered,
                     self.edge_cost.of(begin, self.tree.radius, self.steered, UNLIMITED))

    def extend_and_rewire(self, pose):
        """Run one round of Algorithm 2: steer, choose the parent among the near nodes, add, rewire the near nodes through it."""
        if self.step > 0:
            if not self.steer(pose):
                return
            pose = self.new_pose
        if not self.checker.pose_is_free(pose):
            return
        limit: cython.double = self.cost_bound
        if self.bounded:
            limit -= self.cost_to_go(pose)
            if self.cost_to_come(pose) >= limit:
                return
        self.tried += 1
        if self.bounded and self.tried % SAMPLES_PER_FULL != 0:
            self.backward.collect_useful(pose, self.near_count(), limit, self.max_edge)
        else:
            self.backward.collect_nearest(pose, self.near_count(), self.max_edge)
        if self.step > 0 and (self.backward.count == 0
                              or self.backward.keys[self.backward.count - 1] > length_of(self.steered)):
            # Insert the edge as it was steered: solved again, the rounded pose can make it longer by a full circle.
            self.backward.insert(self.closest.nodes[0], self.steered)
        if self.backward.count == 0:
            return
        node: cython.int
        if self.backward.keys[0] == 0:
            # The pose is a node already, as the goal is when it is drawn again: try to find it a better parent.
            node = self.backward.nodes[0]
            self.choose_parent(pose, node, self.tree.costs[node] - LEAST_GAIN)
            return
        radius: cython.double = self.backward.neighbor_radius
        node = self.choose_parent(pose, -1, limit)
        if node >= 0:
            self.rewire(node, radius)

    def near_count(self):
        """Return the number of near nodes by the size of the tree."""
        return cython.cast(cython.int, ceil(self.near_factor * log(self.tree.indexed + 1)))

    def cost_to_go(self, pose):
        """Return a lower bound of the cost from a pose to the goal."""
        around: cython.double = self.to_goal.at(pose.x, pose.y)
        if around >= self.cost_bound or self.tolerance_xy > 0 or self.tolerance_yaw > 0:
            return around
        return max(around, length_of(shortest(pose, self.goal, self.tree.radius)))

    def cost_to_come(self, pose):
        """Return a lower bound of the cost from the start to a pose."""
        direct: cython.double = length_of(shortest(self.tree.pose_of(0), pose, self.tree.radius))
        return max(self.from_start.at(pose.x, pose.y), direct)

    def steer(self, sample):
        """Steer from the closest node towards the sample, at most a step far: to `new_pose`, by the curve `steered`.

        Returns:
            False where there is no node to steer from.
        """
        self.closest.collect_nearest(sample, 1, UNLIMITED)
        if self.closest.count == 0:
            return False
        self.new_pose, self.steered = sample, self.closest.curve_at(0)
        if self.step == 0 or length_of(self.steered) <= self.step:
            return True
        self.steered = first_part(self.steered, self.step)
        end: Pose = end_of(self.tree.pose_of(self.closest.nodes[0]), self.tree.radius, self.steered)
        self.new_pose = Pose(end.x, end.y, remainder(end.theta, TWO_PI))
        return True

    def choose_parent(self, pose, node, limit):
        """Connect the pose by the free edge from its near nodes that makes it cheapest, if it then costs less than `limit`.

        `node` is the pose's node, or -1 to add one. Return the node, or -1 where no edge will do.
        """
        least: cython.double
        bound: cython.double
        cost: cython.double
        edge: cython.double = 0
        i: cython.int
        next_one: cython.int
        parent: cython.int
        best: cython.int = -1
        begin: Pose
        while True:
            least, next_one = limit, -1
            for i in range(self.backward.count):
                if self.backward.keys[i] == UNLIMITED:  # its edge was looked at
                    continue
                bound = self.tree.costs[self.backward.nodes[i]] + self.backward.keys[i]
                if bound < least:
                    least, next_one = bound, i
            if next_one < 0:
                break
            parent = self.backward.nodes[next_one]
            begin = self.tree.pose_of(parent)
            self.backward.keys[next_one] = UNLIMITED
            cost = self.cost_if_free(begin, self.backward.curve_at(next_one), limit - self.tree.costs[parent])
            if cost < UNLIMITED:
                limit, best, edge = self.tree.costs[parent] + cost, next_one, cost
                if self.edge_cost.is_length:  # which orders the edges by their costs
                    break
        if best < 0:
            return -1
        if node < 0:
            return self.add(pose, self.backward.nodes[best], self.backward.curve_at(best), edge)
        self.tree.reparent(node, self.backward.nodes[best], self.backward.curve_at(best), edge)
        return node

    def rewire(self, node, radius):
        """Make `node` the parent of each near node that becomes cheaper by a free edge; its ancestors never do."""
        i: cython.int
        near: cython.int
        cost: cython.double
        budget: cython.double
        pose: Pose = self.tree.pose_of(node)
        self.forward.collect_cheaper(node, radius, LEAST_GAIN)
        for i in range(self.forward.count):
            near = self.forward.nodes[i]
            if self.tree.costs[node] + self.forward.keys[i] < self.tree.costs[near] - LEAST_GAIN:
                budget = self.tree.costs[near] - LEAST_GAIN - self.tree.costs[node]
                cost = self.cost_if_free(pose, self.forward.curve_at(i), budget)
                if cost < UNLIMITED:
                    self.tree.reparent(near, node, self.forward.curve_at(i), cost)

    def cost_if_free(self, pose, curve, limit):
        """Return the cost of a curve from a pose; UNLIMITED where it is not free, or where its integral is not below a limit."""
        if self.edge_cost.is_length:  # which was compared with the limit before
            return length_of(curve) if self.checker.motion_is_free(pose, self.tree.radius, curve) else UNLIMITED
        # In this order, as the integral ends soon where the limit is tight.
        cost: cython.double = self.edge_cost.of(pose, self.tree.radius, curve, limit)
        if cost >= limit or not self.checker.motion_is_free(pose, self.tree.radius, curve):
            return UNLIMITED
        return cost

    def add(self, pose, parent, curve, cost):
        """Add a node, to the goal nodes too if it reaches the goal."""
        node: cython.int = self.tree.add(pose, parent, curve, cost)
        dx: cython.double = pose.x - self.goal.x
        dy: cython.double = pose.y - self.goal.y
        if (dx * dx + dy * dy <= self.tolerance_xy * self.tolerance_xy
                and fabs(remainder(pose.theta - self.goal.theta, TWO_PI)) <= self.tolerance_yaw):
            self.goal_nodes[self.goal_count] = node
            self.goal_count += 1
        return node
