# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The distance to a goal around obstacles, for a disc that can turn on the spot, at every cell of a coarse raster.

It is the solution of the eikonal equation |grad cost| = 1 by first-order upwind differences, as in fast marching. Cells whose
cost fell wait in a queue, first in, first out, to let it count for their neighbours: that needs no heap, and the costs at which
nothing falls any more do not depend on the order.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.clearance import Clearance
    from cython.cimports.libc.math import fabs, sqrt
else:
    from math import fabs, sqrt

    from .clearance import Clearance

#: A smaller fall of a cost is rounding [cells].
LEAST_FALL = cython.declare(cython.double, 1e-9)


@cython.cclass
class Eikonal:
    """The equation on cells, each a block of `block` x `block` cells of the clearance's raster, in a border of impassable cells.

    Attributes:
        shape: (rows, columns) with the border; `row * columns + column` is the index of a cell.
    """

    shape = cython.declare(tuple, visibility="readonly")
    clearance: Clearance
    block: cython.int
    width: cython.int
    passable: cython.schar[::1]
    cost: cython.double[::1]
    queue: cython.int[::1]
    is_waiting: cython.schar[::1]
    first: cython.int
    waiting: cython.int

    def __init__(self, clearance: Clearance, block: cython.int, need: cython.double):
        """A cell is passable where the clearance in it may be `need` [m]."""
        self.clearance, self.block = clearance, block
        rows: cython.int = (clearance.field.shape[0] + block - 1) // block
        columns: cython.int = (clearance.field.shape[1] + block - 1) // block
        self.shape, self.width = (rows + 2, columns + 2), columns + 2
        cells = (rows + 2) * (columns + 2)
        self.passable, self.is_waiting = np.zeros(cells, np.int8), np.zeros(cells, np.int8)
        self.cost, self.queue = np.full(cells, np.inf), np.empty(cells, np.int32)
        self.first = self.waiting = 0
        row: cython.int
        column: cython.int
        with cython.nogil:
            for row in range(1, rows + 1):
                for column in range(1, columns + 1):
                    self.passable[row * self.width + column] = self.may_be_free(row, column, need)

    def solve(self, cells: cython.int[::1], costs: cython.double[::1]):
        """Flood from where the goal is.

        Args:
            cells: (n,) int32 where to begin; impassable ones are left out.
            costs: (n,) float64 the costs there, in sides of a cell.

        Returns:
            float64 of `shape`: the costs of all cells, in sides of a cell; infinite for what is not reached.
        """
        i: cython.Py_ssize_t
        with cython.nogil:
            for i in range(cells.shape[0]):
                if self.passable[cells[i]]:
                    self.offer(cells[i], costs[i])
            while self.waiting > 0:
                self.serve()
        return np.asarray(self.cost).reshape(self.shape)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def may_be_free(self, row: cython.int, column: cython.int, need: cython.double) -> cython.bint:
        """Whether a block has a cell whose centre is at most half a diagonal short of the clearance."""
        side: cython.double = self.clearance.resolution
        enough: cython.double = need - side * sqrt(0.5)
        bound: cython.double
        i: cython.int
        j: cython.int
        end: cython.int = min(row * self.block, cython.cast(cython.int, self.clearance.field.shape[0]))
        right: cython.int = min(column * self.block, cython.cast(cython.int, self.clearance.field.shape[1]))
        for i in range((row - 1) * self.block, end):
            for j in range((column - 1) * self.block, right):
                bound = cython.cast(cython.double, self.clearance.field[i, j])
                if bound >= 0 and (bound >= enough or self.clearance.exact((j + 0.5) * side, (i + 0.5) * side) >= enough):
                    return True
        return False

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def serve(self) -> cython.void:
        """Let the neighbours of the first cell in the queue have costs by what it costs."""
        cell: cython.int = self.queue[self.first]
        self.first = (self.first + 1) % cython.cast(cython.int, self.queue.shape[0])
        self.waiting -= 1
        self.is_waiting[cell] = 0
        self.update(cell + 1)
        self.update(cell - 1)
        self.update(cell + self.width)
        self.update(cell - self.width)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def update(self, cell: cython.int) -> cython.void:
        """Offer a passable cell its cost by its neighbours: the way leads between the cheapest in its row and in its column."""
        if not self.passable[cell]:
            return
        along: cython.double = min(self.cost[cell - 1], self.cost[cell + 1])
        across: cython.double = min(self.cost[cell - self.width], self.cost[cell + self.width])
        if fabs(along - across) < 1:
            self.offer(cell, (along + across + sqrt(2 - (along - across) * (along - across))) / 2)
        else:
            self.offer(cell, min(along, across) + 1)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def offer(self, cell: cython.int, cost: cython.double) -> cython.void:
        """Let a cell have a cost that is lower than its own, and wait in the queue to pass it on."""
        if cost >= self.cost[cell] - LEAST_FALL:
            return
        self.cost[cell] = cost
        if not self.is_waiting[cell]:
            self.is_waiting[cell] = 1
            self.queue[(self.first + self.waiting) % cython.cast(cython.int, self.queue.shape[0])] = cell
            self.waiting += 1
