# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The search tree: a structure of arrays, hashed by position. A node's edge is the curve from its parent to it."""

import cython
import numpy as np

from .arrays import resized

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import Curve, Pose, rounding_at
    from cython.cimports.libc.math import cos, sin, sqrt
else:
    from math import cos, sin, sqrt

    from .dubins import Curve, Pose, rounding_at

#: Approximate number of buckets at first; not a function of the budget, since the order of nodes in buckets is that of rewiring.
BUCKETS = 1024
#: Mean number of nodes in a bucket above which more buckets are made, and the maximum number of these.
MOST_PER_BUCKET, MOST_BUCKETS = 8, 1 << 22


@cython.cclass
class SearchTree:
    """A tree of poses, hashed by position.

    Attributes:
        size: number of nodes; node 0 is the root. The arrays are longer.
        indexed: number of nodes that can be found as neighbours.
        radius: the turning radius of all edges [m].
        rounding: largest error of the difference between two coordinates [m].
        poses: (n, 3): x [m], y [m], theta [rad].
        headings: (n, 2): sine and cosine of theta.
        parents: (n,), the root's is -1.
        costs, edge_costs: (n,): the costs of the path from the root, and of the edge from the parent [m].
        words, lengths: (n,) and (n, 3): the edges from the parents; lengths in metres.
    """

    def __init__(self, root, radius: cython.double, corner, extent):
        """Make a tree of its root alone.

        Args:
            root: (x, y, theta).
            corner, extent: lowest (x, y) of the map, and its size [m].
        """
        self.radius = radius
        self.x0, self.y0 = corner
        self.x_extent, self.y_extent = extent
        self.rounding = max(rounding_at(self.x0, self.y0), rounding_at(self.x0 + self.x_extent, self.y0 + self.y_extent))
        self.make_buckets(BUCKETS)
        self.size = self.indexed = 0
        self.poses = np.empty((0, 3))
        self.headings = np.empty((0, 2))
        self.parents = self.first_child = self.next_sibling = self.previous_sibling = self.next_in_bucket = np.empty(0, np.int32)
        self.costs = self.edge_costs = np.empty(0)
        self.words = np.empty(0, np.int8)
        self.lengths = np.empty((0, 3))
        self.reserve(64)
        self.add(Pose(root[0], root[1], root[2]), -1, Curve(0, 0, 0, 0), 0)

    def reserve(self, more: cython.int):
        """Make room for `more` nodes, so that adding them allocates nothing."""
        if self.size + more <= self.parents.shape[0]:
            return
        capacity = max(self.size + more, 2 * self.size)
        self.poses = resized(self.poses, capacity)
        self.headings = resized(self.headings, capacity)
        self.parents = resized(self.parents, capacity)
        self.costs, self.edge_costs = resized(self.costs, capacity), resized(self.edge_costs, capacity)
        self.words = resized(self.words, capacity)
        self.lengths = resized(self.lengths, capacity)
        self.first_child = resized(self.first_child, capacity)
        self.next_sibling = resized(self.next_sibling, capacity)
        self.previous_sibling = resized(self.previous_sibling, capacity)
        self.next_in_bucket = resized(self.next_in_bucket, capacity)

    def bucket_row(self, y):
        """Return the row of the bucket that holds `y`, the nearest outside the map."""
        row: cython.int = cython.cast(cython.int, (y - self.y0) / self.bucket_size)
        return min(max(row, 0), cython.cast(cython.int, self.buckets.shape[0]) - 1)

    def bucket_column(self, x):
        """Return the column of the bucket that holds `x`, the nearest outside the map."""
        column: cython.int = cython.cast(cython.int, (x - self.x0) / self.bucket_size)
        return min(max(column, 0), cython.cast(cython.int, self.buckets.shape[1]) - 1)

    def pose_of(self, node):
        """Return the pose of a node."""
        return Pose(self.poses[node, 0], self.poses[node, 1], self.poses[node, 2])

    def attach(self, node, parent, curve, cost):
        """Make `node`, which has no parent, a child of `parent` by a curve of this cost."""
        self.parents[node] = parent
        self.words[node] = curve.word
        self.lengths[node, 0], self.lengths[node, 1], self.lengths[node, 2] = curve.first, curve.second, curve.third
        self.edge_costs[node] = cost
        self.costs[node] = self.costs[parent] + self.edge_costs[node]
        sibling: cython.int = self.first_child[parent]
        self.first_child[parent] = node
        self.next_sibling[node] = sibling
        self.previous_sibling[node] = -1
        if sibling >= 0:
            self.previous_sibling[sibling] = node

    def add(self, pose, parent, curve, cost):
        """Add a node at the end of a curve and return it; room must have been reserved. The root is added with the parent -1."""
        node: cython.int = self.size
        self.size += 1
        self.poses[node, 0], self.poses[node, 1], self.poses[node, 2] = pose.x, pose.y, pose.theta
        self.headings[node, 0] = sin(pose.theta)
        self.headings[node, 1] = cos(pose.theta)
        self.first_child[node] = -1
        if parent < 0:
            self.parents[node] = self.next_sibling[node] = self.previous_sibling[node] = -1
            self.costs[node] = self.edge_costs[node] = self.words[node] = 0
            self.lengths[node, 0] = self.lengths[node, 1] = self.lengths[node, 2] = 0
        else:
            self.attach(node, parent, curve, cost)
        self.index(node)
        return node

    def index(self, node):
        """Put a node into its bucket."""
        row: cython.int = self.bucket_row(self.poses[node, 1])
        column: cython.int = self.bucket_column(self.poses[node, 0])
        self.next_in_bucket[node] = self.buckets[row, column]
        self.buckets[row, column] = node
        self.indexed += 1

    def prune_index(self, wanted: cython.schar[::1]):
        """Leave only the nodes whose entry in the (size,) array `wanted` is not 0 to be found as neighbours."""
        node: cython.int
        self.buckets[:, :] = -1
        self.indexed = 0
        with cython.nogil:
            for node in range(self.size):
                if wanted[node]:
                    self.index(node)

    def rehash(self):
        """Make more buckets if these are full. To be called at moments that depend on the samples alone."""
        count: cython.int = self.buckets.shape[0] * self.buckets.shape[1]
        if self.indexed <= MOST_PER_BUCKET * count or count >= MOST_BUCKETS:
            return
        wanted = np.zeros(self.size, np.int8)
        buckets, following = np.asarray(self.buckets), np.asarray(self.next_in_bucket)
        nodes = buckets[buckets >= 0]
        while len(nodes):
            wanted[nodes] = 1
            nodes = following[nodes]
            nodes = nodes[nodes >= 0]
        self.make_buckets(self.indexed)
        self.prune_index(wanted)

    def make_buckets(self, count):
        """Make about `count` buckets, all empty."""
        self.bucket_size = sqrt(self.x_extent * self.y_extent / count)
        shape = (int(self.y_extent / self.bucket_size) + 1, int(self.x_extent / self.bucket_size) + 1)
        self.buckets = np.full(shape, -1, dtype=np.int32)

    def reparent(self, node, parent, curve, cost):
        """Move `node` with all its descendants below `parent`, which must be none of them; their costs follow."""
        before: cython.int = self.previous_sibling[node]
        after: cython.int = self.next_sibling[node]
        if before >= 0:
            self.next_sibling[before] = after
        else:
            self.first_child[self.parents[node]] = after
        if after >= 0:
            self.previous_sibling[after] = before
        self.attach(node, parent, curve, cost)
        self.update_costs_below(node)

    def update_costs_below(self, root):
        """Recompute the costs of all descendants of `root`, in preorder along the links, without a stack."""
        node: cython.int = self.first_child[root]
        while node >= 0:
            self.costs[node] = self.costs[self.parents[node]] + self.edge_costs[node]
            if self.first_child[node] >= 0:
                node = self.first_child[node]
                continue
            while node != root and self.next_sibling[node] < 0:
                node = self.parents[node]
            if node == root:
                return
            node = self.next_sibling[node]
