# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The eikonal equation |grad cost| = slowness on a grid of squares: costs from a source around obstacles, nowhere too steep.

Each free square is split into two triangles, along the diagonal that makes the steeper one less steep; the cost is linear on
each. Its gradient is at most the slowness on every triangle, and close to it on almost all; the slowness is 1, which makes the
costs distances, or a number from 1 on for each square. Three stages compute it:

1. First-order upwind differences, roughly in the order of the costs, as fast marching does; or, given a target, in the order of
   the cost plus the straight line to the target, as A* does, and only as far as asked.
2. Around the source and around corners, where paths fan out, that is too steep. The equation is solved again, node by node in the
   order noted, with a gradient reduced by the factor that it had exceeded 1 by; a node whose cost falls passes it on once more.
3. The few triangles that are still slightly too steep are flattened by height: all costs between two levels are scaled down by
   the greatest gradient between these levels.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.libc.math import floor, hypot, sqrt
else:
    from math import floor, hypot, sqrt

#: Cost of a node that is not reached.
FAR = cython.declare(cython.double, 1e300)
#: Least decrease of a cost that is passed on [squares]. It is greater with a target: in A* order a node is often processed before
#: both of its upwind neighbours, and would be queued again and again for tiny decreases.
LEAST_FALL = cython.declare(cython.double, 1e-4)
LEAST_FALL_WITH_TARGET = cython.declare(cython.double, 0.1)
#: Step by which the limit is raised, without a target and with one [squares].
RISE = cython.declare(cython.double, 1)
RISE_WITH_TARGET = cython.declare(cython.double, 4)
#: Number of times that the equation is solved again.
REPEATS = cython.declare(cython.int, 3)
#: Number of cost levels per side of a square.
LEVELS = cython.declare(cython.double, 4)
#: Slope of the costs around the source, the cosine of pi / 8: triangles at the tip of such a cone are not too steep.
FLATTER = cython.declare(cython.double, 0.9238795325112867)
#: States of a node: in no queue, in the queue, or postponed until the limit is raised.
IDLE = cython.declare(cython.schar, 0)
QUEUED = cython.declare(cython.schar, 1)
POSTPONED = cython.declare(cython.schar, 2)


@cython.cclass
class Eikonal:
    """The costs of the nodes, in sides of a square.

    Square s = row * width + column has the nodes s, s + 1, s + width and s + width + 1. The squares of the first row and column
    and of the last two are never free.
    """

    def __init__(self, free, slowness=None):
        """Prepare the equation.

        Args:
            free: (rows, columns) int8, not 0 for each free square; `columns` is the width.
            slowness: what `node_slowness` returns, after the slowness of the squares it was given; None is 1.
        """
        self.width, self.size = free.shape[1], free.size
        self.free = free.reshape(-1)
        self.cost = np.full(free.size, FAR)
        self.has_slowness = self.has_gradients = slowness is not None  # without, all gradients are 1 at first
        if slowness is not None:
            self.slowness, self.gradient = (array.reshape(-1) for array in slowness)
        self.state = np.zeros(free.size, np.int8)
        self.queue, self.later, self.order = np.empty((3, free.size), np.int32)
        self.rank = np.full(free.size, free.size, np.int32)
        self.first = self.waiting = self.postponed = self.ordered = 0
        self.last, self.until, self.least_fall, self.rise = free.size, FAR, LEAST_FALL, RISE
        self.has_target, self.target_column, self.target_row = False, 0, 0

    def begin(self, column: cython.double, row: cython.double, reach: cython.double):
        """Start from all points within `reach` of a place, in sides of a square.

        The nodes around it get at most their distances to it. The costs can come out too steep; see `flatten`.
        """
        with cython.nogil:
            self.limit = 1 + self.straight_on(cython.cast(cython.int, row) * self.width + cython.cast(cython.int, column))
            self.seed(column, row, reach)

    def aim(self, column: cython.double, row: cython.double):
        """Find the costs towards a place first, some hundredths too high. To be called before `begin`."""
        self.has_target, self.target_column, self.target_row = True, column, row
        self.least_fall, self.rise = LEAST_FALL_WITH_TARGET, RISE_WITH_TARGET

    def finish(self):
        """Find the costs of all nodes."""
        with cython.nogil:
            if self.has_target:  # from now on the order of the costs is faster
                self.has_target, self.limit, self.least_fall, self.rise = False, 0, LEAST_FALL, RISE
            self.until = FAR
            self.flood()

    def flatten(self):
        """Lower the costs where they are too steep. To be called once, and only without a target."""
        self.finish()
        self.gradient = np.array(self.gradient) if self.has_slowness else np.ones(self.size)
        self.slope, self.has_gradients = np.zeros(self.size), True
        _: cython.int
        with cython.nogil:
            levels: cython.double = self.limit * LEVELS  # no cost is above the limit, and none rises
            self.limit = FAR
            for _ in range(REPEATS):
                self.reduce_slopes()
        steepest: cython.double[::1] = np.ones(int(levels) + 2)
        heights: cython.double[::1] = np.zeros(steepest.shape[0])
        with cython.nogil:
            self.find_steepest(steepest)
            self.compress(steepest, heights)

    def seed(self, column, row, reach):
        """Queue the nodes of all free squares within `reach` of a place."""
        columns: cython.double = self.width - 3
        rows: cython.double = self.size // self.width - 3
        left: cython.int = cython.cast(cython.int, min(max(1.0, floor(column - reach)), columns))
        right: cython.int = cython.cast(cython.int, max(0.0, min(floor(column + reach), columns)))
        low: cython.int = cython.cast(cython.int, min(max(1.0, floor(row - reach)), rows))
        high: cython.int = cython.cast(cython.int, max(0.0, min(floor(row + reach), rows)))
        i: cython.int
        j: cython.int
        node: cython.int
        corner: cython.int
        for i in range(low, high + 1):
            for j in range(left, right + 1):
                if not self.free[i * self.width + j] or hypot(
                        max(0.0, max(j - column, column - j - 1)), max(0.0, max(i - row, row - i - 1))) > reach:
                    continue
                for corner in range(4):
                    node = (i + (corner >> 1)) * self.width + j + (corner & 1)
                    self.rank[node] = -1
                    self.relax(node, FLATTER * max(0.0, hypot(j + (corner & 1) - column, i + (corner >> 1) - row) - reach))

    def straight_on(self, node):
        """Return the distance from a node to the target, 0 without one."""
        if not self.has_target:
            return 0
        columns: cython.double = node % self.width - self.target_column
        rows: cython.double = node // self.width - self.target_row
        return sqrt(columns * columns + rows * rows)

    def ensure_final(self, square):
        """Compute the costs of the nodes of a free square, unless they are known or cannot be reached."""
        if self.waiting + self.postponed > 0 and not self.is_final(square):
            self.flood_up_to(square)

    def flood_up_to(self, square):
        """Raise the limit until the nodes of a square were processed, and once more for later ones that lower their costs."""
        while self.waiting + self.postponed > 0 and not self.is_final(square):
            self.until = self.limit + self.rise
            self.flood()
        self.until = self.limit + self.rise
        self.flood()

    def is_final(self, square):
        """Return whether all nodes of a square were processed."""
        return max(max(self.rank[square], self.rank[square + 1]),
                   max(self.rank[square + self.width], self.rank[square + self.width + 1])) < self.size

    def flood(self):
        """Pass costs from node to node until none falls, raising the limit up to `until`.

        `order` lists the nodes as they were processed for the first time.
        """
        node: cython.int
        while self.waiting + self.postponed > 0:
            if self.waiting == 0:
                if self.limit >= self.until:
                    return
                self.raise_limit()
                continue
            node = self.dequeue()
            if self.rank[node] == self.size:
                self.rank[node] = self.ordered
                self.order[self.ordered] = node
                self.ordered += 1
            if self.free[node] or self.free[node - self.width]:
                self.pass_on(node, node + 1)
            if self.free[node - 1] or self.free[node - self.width - 1]:
                self.pass_on(node, node - 1)
            if self.free[node] or self.free[node - 1]:
                self.pass_on(node, node + self.width)
            if self.free[node - self.width] or self.free[node - self.width - 1]:
                self.pass_on(node, node - self.width)

    def pass_on(self, node, neighbour):
        """Update a neighbour that costs more than a node."""
        if self.falls_behind(neighbour, node):
            self.relax(neighbour, self.update(neighbour, self.gradient[neighbour] if self.has_gradients else 1))

    def relax(self, node, cost):
        """Lower the cost of a node, if this one is lower, and queue it below the limit or postpone it above."""
        if cost >= self.cost[node] - self.least_fall:
            return
        self.cost[node] = cost
        if cost + self.straight_on(node) < self.limit:
            self.enqueue(node)
        elif self.state[node] == IDLE:
            self.state[node] = POSTPONED
            self.later[self.postponed] = node
            self.postponed += 1

    def raise_limit(self):
        """Raise the limit, and queue the postponed nodes that are below it now."""
        count: cython.int = self.postponed
        node: cython.int
        i: cython.int
        self.limit += self.rise
        self.postponed = 0
        for i in range(count):
            node = self.later[i]
            if self.state[node] != POSTPONED:  # queued since
                continue
            if self.cost[node] + self.straight_on(node) < self.limit:
                self.enqueue(node)
            else:
                self.later[self.postponed] = node
                self.postponed += 1

    def enqueue(self, item):
        """Append a node to the queue, unless it is there."""
        if self.state[item] == QUEUED:
            return
        self.state[item] = QUEUED
        end: cython.int = self.first + self.waiting
        self.queue[end if end < self.size else end - self.size] = item
        self.waiting += 1

    def dequeue(self):
        """Remove the first node from the queue and return it."""
        item: cython.int = self.queue[self.first]
        self.state[item] = IDLE
        self.first = self.first + 1 if self.first + 1 < self.size else 0
        self.waiting -= 1
        return item

    def update(self, node, gradient):
        """Return the cost of a node by its neighbours: the least over the free squares around it."""
        before: cython.double = self.cost[node - 1]
        behind: cython.double = self.cost[node + 1]
        below: cython.double = self.cost[node - self.width]
        above: cython.double = self.cost[node + self.width]
        least: cython.double = FAR
        if self.free[node] and self.free[node - 1] and self.free[node - self.width] and self.free[node - self.width - 1]:
            return upwind(min(before, behind), min(below, above), gradient)
        if self.free[node]:
            least = upwind(behind, above, gradient)
        if self.free[node - 1]:
            least = min(least, upwind(before, above, gradient))
        if self.free[node - self.width]:
            least = min(least, upwind(behind, below, gradient))
        if self.free[node - self.width - 1]:
            least = min(least, upwind(before, below, gradient))
        return least

    def reduce_slopes(self):
        """Solve again, node by node in order, each with a gradient reduced by the steepest square around it."""
        square: cython.int
        node: cython.int
        i: cython.int
        for square in range(self.size):
            if self.free[square] and self.cost[square] < FAR:
                self.slope[square] = self.steepest(square)
        for i in range(self.ordered):
            node = self.order[i]
            self.gradient[node] /= max(1.0, max(max(self.slope[node], self.slope[node - 1]),
                                                max(self.slope[node - self.width], self.slope[node - self.width - 1])))
            self.cost[node] = self.update(node, self.gradient[node])
            self.last = i
            if (self.falls_behind(node + 1, node) or self.falls_behind(node - 1, node)
                    or self.falls_behind(node + self.width, node) or self.falls_behind(node - self.width, node)):
                self.enqueue(node)
                self.flood()

    def falls_behind(self, neighbour, node):
        """Return whether a neighbour that was processed costs more than a node, so that it may be reached from there."""
        return self.rank[neighbour] <= self.last and self.cost[neighbour] > self.cost[node] + self.least_fall

    def find_steepest(self, steepest):
        """Find, for each level of the cost, the greatest gradient of the squares that reach it in slownesses, and at least 1."""
        square: cython.int
        level: cython.int
        slope: cython.double
        low: cython.double
        high: cython.double
        for square in range(self.size):
            if not self.free[square] or self.cost[square] >= FAR:
                continue
            slope = self.steepest(square)
            if slope <= 1:
                continue
            low = min(min(self.cost[square], self.cost[square + 1]),
                      min(self.cost[square + self.width], self.cost[square + self.width + 1]))
            high = max(max(self.cost[square], self.cost[square + 1]),
                       max(self.cost[square + self.width], self.cost[square + self.width + 1]))
            for level in range(cython.cast(cython.int, LEVELS * low), cython.cast(cython.int, LEVELS * high) + 1):
                steepest[level] = max(steepest[level], slope)

    def compress(self, steepest, heights):
        """Scale each level down so that no gradient exceeds the slowness; `heights` is working memory, where the levels begin."""
        level: cython.int
        node: cython.int
        heights[0] = 0
        for level in range(1, heights.shape[0]):
            heights[level] = heights[level - 1] + 1 / (LEVELS * steepest[level - 1])
        for node in range(self.size):
            if self.cost[node] < FAR:
                level = cython.cast(cython.int, LEVELS * self.cost[node])
                self.cost[node] = heights[level] + (self.cost[node] - level / LEVELS) / steepest[level]

    def steepest(self, square):
        """Return the greater gradient of a square's triangles in its slownesses, at least 1."""
        upwards: cython.double
        across: cython.double
        scale: cython.double
        upwards, across = squared_slopes(self.cost[square], self.cost[square + 1], self.cost[square + self.width],
                                         self.cost[square + self.width + 1])
        if self.has_slowness:
            scale = 1 / (self.slowness[square] * self.slowness[square])
            upwards, across = upwards * scale, across * scale
        return sqrt(min(upwards, across)) if upwards > 1 and across > 1 else 1.0


def node_slowness(free: cython.schar[:, ::1], slowness: cython.double[:, ::1]):
    """Return the least slowness of the free squares around each node, (rows, columns) float64; 1 where there is none."""
    found = np.ones((free.shape[0], free.shape[1]))
    out: cython.double[:, ::1] = found
    row: cython.int
    column: cython.int
    i: cython.int
    least: cython.double
    with cython.nogil:
        for row in range(1, cython.cast(cython.int, free.shape[0])):
            for column in range(1, cython.cast(cython.int, free.shape[1])):
                least = FAR
                for i in range(4):
                    if free[row - (i >> 1), column - (i & 1)]:
                        least = min(least, slowness[row - (i >> 1), column - (i & 1)])
                if least < FAR:
                    out[row, column] = least
    return found


def squared_slopes(here, right, above, beyond):
    """Return the squared greater gradient of a square's triangles, by the diagonal from `here` to `beyond` and by the other."""
    bottom: cython.double = (right - here) * (right - here)
    top: cython.double = (beyond - above) * (beyond - above)
    left: cython.double = (above - here) * (above - here)
    side: cython.double = (beyond - right) * (beyond - right)
    return max(bottom + side, left + top), max(bottom + left, top + side)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def upwind(one: cython.double, other: cython.double, gradient: cython.double) -> cython.double:
    """Return the cost of a node by one neighbour in its row and one in its column, each a square away."""
    apart: cython.double = one - other
    if apart >= gradient:
        return other + gradient
    if apart <= -gradient:
        return one + gradient
    return 0.5 * (one + other + sqrt(2 * gradient * gradient - apart * apart))
