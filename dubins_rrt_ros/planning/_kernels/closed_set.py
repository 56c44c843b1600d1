# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The closed set of hybrid A*: a cost for each cell of a grid of positions and headings.

It is a hash table with linear probing, so that only the cells that were asked for take time and memory.
"""

from math import tau

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.libc.math import floor
else:
    from math import floor

#: Number that marks an entry without a cell.
NO_CELL = cython.declare(cython.longlong, -1)
#: Cost of a cell that was given none.
UNSEEN = cython.declare(cython.float, 0)
#: Base-2 logarithm of the number of entries at first; at most half of them are ever in use.
FIRST_BITS = 10
#: 2^64 divided by the golden ratio, which spreads neighbouring cells (D. Knuth, The art of computer programming, vol. 3, 6.4).
GOLDEN_RATIO_64 = cython.declare(cython.ulonglong, 0x9E3779B97F4A7C15)
#: Mask of the bits of a cell's number that are kept: of more than 2^63 cells, some share an entry.
TOLD_APART = cython.declare(cython.ulonglong, 0x7FFFFFFFFFFFFFFF)
BITS_OF_WORD = cython.declare(cython.ulonglong, 0xFFFFFFFFFFFFFFFF)


@cython.cclass
class ClosedSet:
    """The cells that were asked for, each with an entry of the table; `costs` holds their costs by entry."""

    def __init__(self, corner, extent, side, sectors):
        """Make an empty set.

        Args:
            corner, extent: lowest (x, y) of the map, and its size [m].
            side: side of a cell [m].
            sectors: number of headings that are told apart.
        """
        self.x0, self.y0 = corner
        self.side, self.sectors, self.circles_per_radian = side, sectors, 1 / tau
        self.columns, self.rows = int(extent[0] / side) + 1, int(extent[1] / side) + 1
        self.clear(FIRST_BITS)

    def clear(self, bits):
        """Remove all cells and make 2^bits entries."""
        self.used, self.bits = 0, bits
        self.cells, self.costs = np.full(1 << bits, -1, np.int64), np.empty(1 << bits, np.float32)

    def reserve(self, more: cython.int):
        """Make room for `more` cells; entries returned before are no longer valid."""
        if 2 * (self.used + more) <= self.cells.shape[0]:
            return
        cells, costs = np.asarray(self.cells), np.asarray(self.costs)
        taken = cells >= 0
        self.clear(int(2 * (self.used + more) - 1).bit_length())
        self.put(cells[taken], costs[taken])

    def put(self, cells: cython.longlong[::1], costs: cython.float[::1]):
        """Insert cells with their costs."""
        i: cython.Py_ssize_t
        for i in range(cells.shape[0]):
            self.costs[self.entry_of(cells[i])] = costs[i]

    def entry_at(self, x, y, theta):
        """Return the entry of the cell that holds a pose of the map; there must be room for a new one."""
        column: cython.longlong = min(cython.cast(cython.longlong, max(x - self.x0, 0.0) / self.side), self.columns - 1)
        row: cython.longlong = min(cython.cast(cython.longlong, max(y - self.y0, 0.0) / self.side), self.rows - 1)
        circles: cython.double = theta * self.circles_per_radian
        sector: cython.int = min(cython.cast(cython.int, (circles - floor(circles)) * self.sectors), self.sectors - 1)
        columns: cython.ulonglong = self.columns
        place: cython.ulonglong = row * columns + column
        return self.entry_of(cython.cast(cython.longlong, (place * self.sectors + sector) & TOLD_APART))

    def entry_of(self, cell):
        """Return the entry of a cell by its number, a new one if it has none."""
        number: cython.ulonglong = cython.cast(cython.ulonglong, cell)
        entry: cython.int = cython.cast(cython.int, (number * GOLDEN_RATIO_64 & BITS_OF_WORD) >> (64 - self.bits))
        while self.cells[entry] != cell:
            if self.cells[entry] == NO_CELL:
                self.cells[entry], self.costs[entry] = cell, UNSEEN
                self.used += 1
                break
            entry = (entry + 1) & ((1 << self.bits) - 1)
        return entry
