# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The cells of a raster that the edges of polygons touch, and those that lie inside of them."""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.libc.math import floor
else:
    from math import floor

#: States of a cell: the edges leave it on one side; they touch it; the bit that flips where they cross the middle of its row.
UNTOUCHED = cython.declare(cython.uchar, 0)
TOUCHED = cython.declare(cython.uchar, 1)
CROSSED = cython.declare(cython.uchar, 2)
#: Distance from an edge up to which a cell counts as touched, for rounding, in cells.
ROUNDING = cython.declare(cython.double, 1e-6)


def rasterise_edges(edges: cython.double[:, ::1], cell: cython.double, rows: cython.int, columns: cython.int):
    """Find which cells of a raster the edges of closed rings touch, and which lie inside by the even-odd rule.

    Args:
        edges: (m, 4): x, y, x, y of both ends from the raster's corner on [m].
        cell: side of a cell [m].
        rows, columns: shape of the raster.

    Returns:
        (rows, columns) uint8 each: 1 where an edge touches a cell, and where none does and the cell is inside.
    """
    touched = np.zeros((rows, columns), np.uint8)
    inside = np.empty((rows, columns), np.uint8)
    states: cython.uchar[:, ::1] = touched
    fill: cython.uchar[:, ::1] = inside
    edge: cython.Py_ssize_t
    with cython.nogil:
        for edge in range(edges.shape[0]):
            if edges[edge, 1] <= edges[edge, 3]:
                mark(states, edges[edge, 0] / cell, edges[edge, 1] / cell, edges[edge, 2] / cell, edges[edge, 3] / cell)
            else:
                mark(states, edges[edge, 2] / cell, edges[edge, 3] / cell, edges[edge, 0] / cell, edges[edge, 1] / cell)
        split(states, fill)
    return touched, inside


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def mark(states: cython.uchar[:, ::1], x0: cython.double, y0: cython.double, x1: cython.double, y1: cython.double
         ) -> cython.void:
    """Mark the cells that an edge touches and those in which it crosses the middle of a row, from its lower end on."""
    slope: cython.double = (x1 - x0) / (y1 - y0) if y1 > y0 else 0
    last_row: cython.int = index(y1 + ROUNDING, states.shape[0])
    row: cython.int
    column: cython.int
    here: cython.double
    there: cython.double
    for row in range(index(y0 - ROUNDING, states.shape[0]), last_row + 1):
        here, there = x0, x1
        if row - ROUNDING > y0:
            here = between(x0 + slope * (row - ROUNDING - y0), x0, x1)
        if row + 1 + ROUNDING < y1:
            there = between(x0 + slope * (row + 1 + ROUNDING - y0), x0, x1)
        for column in range(index(min(here, there) - ROUNDING, states.shape[1]),
                            index(max(here, there) + ROUNDING, states.shape[1]) + 1):
            states[row, column] |= TOUCHED
        if y0 <= row + 0.5 < y1:
            column = index(between(x0 + slope * (row + 0.5 - y0), x0, x1), states.shape[1])
            states[row, column] = (states[row, column] | TOUCHED) ^ CROSSED


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def split(states: cython.uchar[:, ::1], inside: cython.uchar[:, ::1]) -> cython.void:
    """Go along the rows: tell which cells are inside and leave only whether they are touched."""
    row: cython.Py_ssize_t
    column: cython.Py_ssize_t
    crossed: cython.uchar
    for row in range(states.shape[0]):
        crossed = 0
        for column in range(states.shape[1]):
            crossed ^= states[row, column] & CROSSED
            states[row, column] &= TOUCHED
            inside[row, column] = 1 if crossed != 0 and states[row, column] == UNTOUCHED else 0


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def index(place: cython.double, count: cython.Py_ssize_t) -> cython.int:
    """Return the row or column that holds a place, the first or last one beyond the raster."""
    return cython.cast(cython.int, min(max(floor(place), 0.0), count - 1.0))


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def between(value: cython.double, one: cython.double, other: cython.double) -> cython.double:
    """Return a value, moved to between two others."""
    return min(max(value, min(one, other)), max(one, other))
