# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The widest path (bottleneck shortest path) on a square grid: the one whose least clearance is greatest.

A flood enters the neighbour with the most clearance first. The level is the least clearance that was needed so far. Nodes with at
least that clearance wait in a queue, first in, first out, so that paths are short in open space; all others wait in a heap.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.clearance import Clearance
    from cython.cimports.dubins_rrt_ros.planning._kernels.heap import Heap
else:
    from .clearance import Clearance
    from .heap import Heap

#: States of a node: not entered; entered from the left, the right, below, above; or the start.
UNSEEN = cython.declare(cython.schar, 0)
FROM_LEFT = cython.declare(cython.schar, 1)
FROM_RIGHT = cython.declare(cython.schar, 2)
FROM_BELOW = cython.declare(cython.schar, 3)
FROM_ABOVE = cython.declare(cython.schar, 4)
START = cython.declare(cython.schar, 5)


@cython.cclass
class WidestPathSearch:
    """A flood over a grid; node `row * columns + column` lies `column` steps along and `row` steps across from the first."""

    def __init__(self, clearance: Clearance, first, along, shape, is_target, least, enough):
        """Prepare a search from any node.

        Args:
            first: (x, y) of the first node [m].
            along: (x, y) of the step along a row [m]; the step across is the same turned left.
            shape: (rows, columns).
            is_target: (rows * columns,) int8, not 0 for each node where the flood may end.
            least: clearance that nodes must exceed to be entered [m].
            enough: clearance above which more does not count [m].
        """
        self.clearance = clearance
        self.rows, self.columns = shape
        self.x0, self.y0 = first
        self.along_x, self.along_y = along
        self.least, self.level = least, enough
        self.is_target = is_target
        nodes = self.rows * self.columns
        self.entered = np.zeros(nodes, np.int8)
        self.queue, self.heap = np.empty(nodes, np.int32), Heap(nodes)
        self.queued = self.served = 0
        self.target = -1

    def begin(self, start: cython.int):
        """Begin the flood at a node."""
        with cython.nogil:
            self.enter(start, START)

    def run(self, nodes: cython.int) -> bool:
        """Flood over that many nodes; return True while the flood goes on."""
        with cython.nogil:
            self.target = self.flood(nodes)
        return self.target < 0 and (self.served < self.queued or self.heap.count > 0)

    def widest_path(self):
        """Return the least clearance on the widest path [m], at most `enough`, and the nodes of the path as (n,) int32.

        Where no target was reached, these are 0 and empty.
        """
        return (self.level, self.nodes_to(self.target)) if self.target >= 0 else (0.0, np.empty(0, np.int32))

    def flood(self, nodes):
        """Flood over that many nodes, or until a target is reached; return that, or -1."""
        node: cython.int
        row: cython.int
        column: cython.int
        while nodes > 0 and (self.served < self.queued or self.heap.count > 0):
            nodes -= 1
            if self.served < self.queued:
                node = self.queue[self.served]
                self.served += 1
            else:
                self.level = -self.heap.least_key()
                node = self.heap.pop()
            if self.is_target[node]:
                return node
            row, column = node // self.columns, node % self.columns
            if column + 1 < self.columns:
                self.enter(node + 1, FROM_LEFT)
            if column > 0:
                self.enter(node - 1, FROM_RIGHT)
            if row + 1 < self.rows:
                self.enter(node + self.columns, FROM_BELOW)
            if row > 0:
                self.enter(node - self.columns, FROM_ABOVE)
        return -1

    def enter(self, node, how):
        """Queue a node, or put it into the heap, unless it was seen or has too little clearance."""
        if self.entered[node] != UNSEEN:
            return
        self.entered[node] = how
        row: cython.int = node // self.columns
        column: cython.int = node % self.columns
        x: cython.double = self.x0 + column * self.along_x - row * self.along_y
        y: cython.double = self.y0 + column * self.along_y + row * self.along_x
        found: cython.double = self.clearance.at_least(x, y, self.level)
        if found <= self.least:
            return
        if found >= self.level:
            self.queue[self.queued] = node
            self.queued += 1
        else:
            self.heap.push(node, -found)

    def nodes_to(self, node: cython.int):
        """Return the nodes of the path from the start to `node`, (n,) int32."""
        path = [node]
        while self.entered[node] != START:
            if self.entered[node] == FROM_LEFT:
                node -= 1
            elif self.entered[node] == FROM_RIGHT:
                node += 1
            else:
                node += -self.columns if self.entered[node] == FROM_BELOW else self.columns
            path.append(node)
        return np.array(path[::-1], np.int32)
