# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Near neighbours by Dubins length. It is not symmetric, so the nodes that reach a pose and those reached from it are two sets.

S. Karaman and E. Frazzoli, Sampling-based optimal motion planning for non-holonomic dynamical systems (2013), define both.
The search is exact. It visits the tree's buckets in rings around the pose and stops at the first ring farther away than the
neighbour radius, since no Dubins curve is shorter than the straight line. Nodes within the radius are ruled out by two more lower
bounds: the turn from heading to heading, and half a circle for all that lies behind or beside the vehicle.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import TWO_PI, UNLIMITED, Curve, length_of, shortest_within
    from cython.cimports.dubins_rrt_ros.planning._kernels.tree import SearchTree
    from cython.cimports.libc.math import cos, fabs, sin, sqrt
else:
    from math import cos, fabs, sin, sqrt

    from .dubins import TWO_PI, UNLIMITED, Curve, length_of, shortest_within
    from .tree import SearchTree


#: Factor from one neighbour radius to the guess of the next.
RADIUS_GUESS_FACTOR = cython.declare(cython.double, 1.25)
#: Multiplicative steps of a running 20 % quantile of the neighbour radius.
RISE = cython.declare(cython.double, 1.1 ** 0.2)
FALL = cython.declare(cython.double, 1.1 ** 0.8)
#: Half the diagonal of a unit square, rounded up.
HALF_DIAGONAL = cython.declare(cython.double, 0.7072)
#: Tolerance above the rounding of a position, in turning radii.
NEARLY = cython.declare(cython.double, 1e-9)
#: Least guess of the neighbour radius, in turning radii; doubling could not get away from 0.
LEAST_RADIUS_GUESS = cython.declare(cython.double, 1e-3)


@cython.cclass
class BackwardNeighbors:
    """The nodes with the shortest curves *to* a pose, shortest first, with these curves.

    Attributes:
        count: number of neighbours; the first `count` entries of the arrays are in use.
        nodes: (n,) their numbers in the tree.
        words, lengths: (n,) and (n, 3): their curves.
        keys: (n,) the lengths of these [m].
        neighbor_radius: length that a curve must be below [m]; it shrinks as nodes are found.
        cost_budget: limit of the cost by way of a node; its curve must be shorter than what its cost leaves of that [m].
        direction: -1 for curves to the pose, +1 for curves from it.
    """

    def __init__(self, tree: SearchTree, capacity: cython.int):
        self.tree = tree
        self.count = 0
        self.radius_guess = self.typical_radius = tree.radius
        self.direction = -1
        self.keys = np.empty(capacity)
        self.nodes = np.empty(capacity, np.int32)
        self.words = np.empty(capacity, np.int8)
        self.lengths = np.empty((capacity, 3))

    def collect_nearest(self, pose, wanted, max_length):
        """Find the `wanted` nodes with the shortest curves to a pose, each shorter than `max_length`; at most the capacity.

        Nodes beyond a guessed radius cost no curve; where the guess was too small, the search starts again with twice as much.
        """
        self.wanted = min(min(wanted, self.tree.indexed), cython.cast(cython.int, self.keys.shape[0]))
        self.begin(pose, min(self.radius_guess, max_length))
        self.consider_all()
        while self.count < self.wanted and self.radius_guess < max_length:
            self.radius_guess *= 2
            self.begin(pose, min(self.radius_guess, max_length))
            self.consider_all()
        self.radius_guess = max(RADIUS_GUESS_FACTOR * self.neighbor_radius, LEAST_RADIUS_GUESS * self.tree.radius)
        if self.neighbor_radius > self.typical_radius:
            self.typical_radius = self.typical_radius * RISE
        else:
            self.typical_radius = self.typical_radius / FALL

    def collect_useful(self, pose, wanted, max_cost, max_length):
        """Find the `wanted` nodes with the shortest curves by which a pose costs less than `max_cost`, within the typical radius.

        The straight line alone shows most nodes to be too expensive, so that few curves are computed.
        """
        self.wanted = min(wanted, cython.cast(cython.int, self.keys.shape[0]))
        self.begin(pose, min(self.typical_radius, max_length))
        self.cost_budget = max_cost
        self.consider_all()

    def begin(self, pose, radius):
        """Empty the set, for a new pose and radius."""
        self.count = 0
        self.neighbor_radius = radius
        self.cost_budget = UNLIMITED
        self.pose = pose
        self.sin_theta, self.cos_theta = sin(pose.theta), cos(pose.theta)

    def curve_at(self, i):
        """Return the curve of the i-th neighbour."""
        return Curve(self.words[i], self.lengths[i, 0], self.lengths[i, 1], self.lengths[i, 2])

    def write(self, i, node, curve, length):
        """Make a node and its curve the i-th neighbour."""
        self.keys[i] = length
        self.nodes[i] = node
        self.words[i] = curve.word
        self.lengths[i, 0], self.lengths[i, 1], self.lengths[i, 2] = curve.first, curve.second, curve.third

    def insert(self, node, curve):
        """Insert a node in the order of the curves' lengths; the last one drops out when the set is full."""
        if self.count < self.wanted:
            self.count += 1
        length: cython.double = length_of(curve)
        i: cython.int = self.count - 1
        while i > 0 and self.keys[i - 1] > length:
            self.keys[i] = self.keys[i - 1]
            self.nodes[i] = self.nodes[i - 1]
            self.words[i] = self.words[i - 1]
            self.lengths[i, 0] = self.lengths[i - 1, 0]
            self.lengths[i, 1] = self.lengths[i - 1, 1]
            self.lengths[i, 2] = self.lengths[i - 1, 2]
            i -= 1
        self.write(i, node, curve, length)
        if self.count == self.wanted:
            self.neighbor_radius = self.keys[self.count - 1]

    def consider(self, node, dx, dy, limit):
        """Insert a node, which lies (dx, dy) from the pose, if its curve to the pose is shorter than `limit`."""
        curve: Curve = shortest_within(
            -dx, -dy, self.tree.poses[node, 2], self.tree.headings[node, 0], self.tree.headings[node, 1],
            self.pose.theta, self.sin_theta, self.cos_theta, self.tree.radius, self.tree.rounding, limit)
        if curve.first < UNLIMITED:
            self.insert(node, curve)

    def consider_bucket(self, row, column):
        """Consider the nodes of a bucket that the lower bounds do not rule out."""
        node: cython.int = self.tree.buckets[row, column]
        radius: cython.double = self.tree.radius
        half_circle: cython.double = TWO_PI / 2 * radius
        dx: cython.double
        dy: cython.double
        limit: cython.double
        if node >= 0 and self.neighbor_radius <= half_circle:
            dx = self.tree.x0 + (column + 0.5) * self.tree.bucket_size - self.pose.x
            dy = self.tree.y0 + (row + 0.5) * self.tree.bucket_size - self.pose.y
            if takes_half_circle(self.direction * dx, self.direction * dy, self.sin_theta, self.cos_theta, radius,
                                 HALF_DIAGONAL * self.tree.bucket_size):
                return
        while node >= 0:
            limit = min(self.neighbor_radius, self.cost_budget + self.direction * self.tree.costs[node])
            dx = self.tree.poses[node, 0] - self.pose.x
            dy = self.tree.poses[node, 1] - self.pose.y
            if (limit > 0 and dx * dx + dy * dy < limit * limit
                    and radius * turned(self.pose.theta, self.tree.poses[node, 2]) < limit
                    and not (limit <= half_circle and (
                        takes_half_circle(self.direction * dx, self.direction * dy, self.sin_theta, self.cos_theta, radius, 0)
                        or takes_half_circle(self.direction * dx, self.direction * dy, self.tree.headings[node, 0],
                                             self.tree.headings[node, 1], radius, 0)))):
                self.consider(node, dx, dy, limit)
            node = self.tree.next_in_bucket[node]

    def consider_all(self):
        """Consider the buckets in rings around the pose, until a ring lies beyond the neighbour radius."""
        row: cython.int = self.tree.bucket_row(self.pose.y)
        column: cython.int = self.tree.bucket_column(self.pose.x)
        rows: cython.int = cython.cast(cython.int, self.tree.buckets.shape[0])
        columns: cython.int = cython.cast(cython.int, self.tree.buckets.shape[1])
        side: cython.double = self.tree.bucket_size
        # Ring k lies k - 1 buckets beyond the nearest side of the pose's own bucket.
        u: cython.double = self.pose.x - self.tree.x0 - column * side
        v: cython.double = self.pose.y - self.tree.y0 - row * side
        inner: cython.double = min(min(u, side - u), min(v, side - v))
        rings: cython.int = 1 + max(max(row, rows - 1 - row), max(column, columns - 1 - column))
        ring: cython.int
        i: cython.int
        j: cython.int
        for ring in range(rings):
            if ring > 0 and inner + (ring - 1) * side >= self.neighbor_radius:
                return
            for i in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
                if i == row - ring or i == row + ring:
                    for j in range(max(column - ring, 0), min(column + ring, columns - 1) + 1):
                        self.consider_bucket(i, j)
                else:
                    if column - ring >= 0:
                        self.consider_bucket(i, column - ring)
                    if column + ring < columns:
                        self.consider_bucket(i, column + ring)


@cython.cclass
class ForwardNeighbors(BackwardNeighbors):
    """The nodes that would be cheaper if they were reached *from* a node, within a radius, with the curves to them."""

    def __init__(self, tree: SearchTree, capacity: cython.int):
        BackwardNeighbors.__init__(self, tree, capacity)
        self.direction = 1

    def collect_cheaper(self, node, radius, least_gain):
        """Find the nodes whose cost falls by more than `least_gain` with a curve shorter than `radius` from `node`."""
        self.begin(self.tree.pose_of(node), radius)
        self.cost_budget = -(self.tree.costs[node] + least_gain)
        self.consider_all()

    def consider(self, node, dx, dy, limit):
        """Add a node if its cost falls; once the set is full, further nodes are ignored."""
        if self.count >= self.nodes.shape[0]:
            return
        curve: Curve = shortest_within(
            dx, dy, self.pose.theta, self.sin_theta, self.cos_theta,
            self.tree.poses[node, 2], self.tree.headings[node, 0], self.tree.headings[node, 1], self.tree.radius,
            self.tree.rounding, limit)
        if curve.first < UNLIMITED:
            self.write(self.count, node, curve, length_of(curve))
            self.count += 1


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def turned(theta0: cython.double, theta1: cython.double) -> cython.double:
    """Return the angle between two headings; 0, a lower bound, where they are too far from [-pi, pi] to save a division."""
    angle: cython.double = fabs(theta1 - theta0)
    if angle > TWO_PI / 2:
        angle = fabs(TWO_PI - angle)
    return angle if angle <= TWO_PI / 2 else 0


@cython.ccall
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def takes_half_circle(x: cython.double, y: cython.double, sine: cython.double, cosine: cython.double, radius: cython.double,
                      slack: cython.double) -> cython.bint:
    """Return whether no curve shorter than half a circle leads to (x, y), nor to any point within `slack` of it.

    Such a curve reaches neither the half plane behind its first pose nor the inside of its two turning circles there. `sine` and
    `cosine` are of the heading at the start; by symmetry, those at the end serve as well.
    """
    along: cython.double = x * cosine + y * sine
    across: cython.double = fabs(y * cosine - x * sine) - slack
    far: cython.double = sqrt(x * x + y * y) + slack
    return along + slack < -NEARLY * radius or far * far < (2 * across - NEARLY * radius) * radius
