# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The exact Euclidean distance transform of a grid, in two passes; all cells outside the grid are blocked.

The first pass goes along the rows and finds each cell's gap to the next blocked cell in its row. The second goes along the
columns. Seen from row r, the nearest blocked cell in row i has the squared distance (r - i)^2 + gap(i)^2: a parabola over r for
each i. The squared distances are the lower envelope of these (P. Felzenszwalb and D. Huttenlocher, Distance transforms of
sampled functions, 2012), computed in integers, without rounding.
"""

import cython
import numpy as np

#: Number of columns that are processed together, for the sake of the cache.
TOGETHER = cython.declare(cython.int, 64)


def measure_row_gaps(free: cython.uchar[:, ::1], row_gap: cython.int[:, ::1]):
    """Find the next blocked cells to the left and to the right of each cell in its row; it can be itself.

    Args:
        free: (rows, columns) uint8, 1 for each cell that is free, 0 for each that is blocked.
        row_gap: (rows, columns) int32, filled: four times the distance to the nearer of both in cells, plus 1 where the left one
            is farther, plus 2 where the right one is.
    """
    row: cython.Py_ssize_t
    column: cython.Py_ssize_t
    columns: cython.Py_ssize_t = free.shape[1]
    left: cython.int
    right: cython.int
    with cython.nogil:
        for row in range(free.shape[0]):
            left = 0
            for column in range(columns):
                left = (left + 1) * cython.cast(cython.int, free[row, column])
                row_gap[row, column] = left
            right = 0
            for column in range(columns - 1, -1, -1):
                right = (right + 1) * cython.cast(cython.int, free[row, column])
                left = row_gap[row, column]
                row_gap[row, column] = 4 * min(left, right) + (left > right) + 2 * (right > left)


def fill_columns(row_gap: cython.int[:, ::1], first: cython.int, last: cython.int, of_squared: cython.float[::1],
                 out: cython.float[:, ::1]):
    """Write a function of the squared distance to the columns `first:last`.

    Args:
        row_gap: (rows, columns) int32, as `measure_row_gaps` fills it.
        of_squared: float32, the function's value for each squared distance that can occur in the grid.
        out: (rows, columns) float32.
    """
    rows: cython.int = cython.cast(cython.int, row_gap.shape[0])
    squared: cython.int[:, ::1] = np.empty((TOGETHER, rows + 2), np.int32)
    apex: cython.longlong[::1] = np.empty(rows + 2, np.int64)
    height: cython.longlong[::1] = np.empty(rows + 2, np.int64)
    begin: cython.longlong[::1] = np.empty(rows + 2, np.int64)
    block: cython.int
    column: cython.int
    count: cython.int
    row: cython.int
    i: cython.int
    with cython.nogil:
        for block in range((last - first + TOGETHER - 1) // TOGETHER):
            column = first + block * TOGETHER
            count = min(TOGETHER, last - column)
            for row in range(rows):
                for i in range(count):
                    squared[i, row + 1] = row_gap[row, column + i] >> 2
            for i in range(count):
                envelope(squared[i], apex, height, begin)
            for row in range(rows):
                for i in range(count):
                    out[row, column + i] = of_squared[squared[i, row + 1]]


def reached_columns(bounds: cython.float[:, ::1], cell: cython.double, first_row: cython.int, last_row: cython.int,
                    first_column: cython.int, last_column: cython.int):
    """Find the columns with cells that may lie as far from their nearest obstacle as from a box of cells.

    The distance of no other cell changes with the box. The straight way from such a cell to the box holds only points like it,
    since neither distance falls by more than the way is long. In each column that it crosses there is a cell at most half a cell
    off it, for which they compare the same to within a cell. So beyond columns without such cells there are none.

    Args:
        bounds: (rows, columns) float32, the lower bounds of the clearance [m].
        cell: the side of a cell [m].
        first_row, last_row, first_column, last_column: of the box; the last ones are those behind it.

    Returns:
        The first column and the one behind the last.
    """
    columns: cython.int = cython.cast(cython.int, bounds.shape[1])
    first: cython.int = first_column
    last: cython.int = last_column
    with cython.nogil:
        while first > 0 and is_reached(bounds, cell, first - 1, first_row, last_row, first_column - first + 1):
            first -= 1
        while last < columns and is_reached(bounds, cell, last, first_row, last_row, last - last_column + 1):
            last += 1
    return first, last


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def is_reached(bounds: cython.float[:, ::1], cell: cython.double, column: cython.int, first_row: cython.int,
               last_row: cython.int, gap: cython.int) -> cython.bint:
    """Return whether a column has such a cell, which is `gap` columns beside the box."""
    row: cython.int
    beyond: cython.double
    at_most: cython.double
    for row in range(cython.cast(cython.int, bounds.shape[0])):
        beyond = max(0, max(first_row - row, row - last_row + 1))
        # A cell for what `reached_columns` says, sqrt(2) for what the bounds are lower by, and the rest for rounding.
        at_most = max(0.0, cython.cast(cython.double, bounds[row, column])) / cell + 2.5
        if at_most * at_most >= beyond * beyond + gap * gap:
            return True
    return False


def envelope(column, apex, height, begin):
    """Replace the gaps of a column's cells by the squared distances.

    The column has one more cell, outside the grid, at either end. The other arrays are working memory for the parabolas of the
    envelope: the row and the height of their lowest points, and the first row in which each is the lowest so far.
    """
    last: cython.int = cython.cast(cython.int, column.shape[0]) - 1
    top: cython.int = 0
    row: cython.int
    new: cython.longlong
    away: cython.longlong
    new_away: cython.longlong
    crossing: cython.longlong
    column[0] = column[last] = 0
    apex[0] = height[0] = begin[0] = 0
    for row in range(1, last + 1):
        new = cython.cast(cython.longlong, column[row])
        new *= new
        while True:  # remove the parabolas that lie above the new one; the first never does
            away, new_away = begin[top] - apex[top], begin[top] - row
            if away * away + height[top] <= new_away * new_away + new:
                break
            top -= 1
        away = row - apex[top]
        # In doubles, which divide faster: they hold these integers exactly, and round no quotient up to an integer.
        crossing = cython.cast(cython.longlong, cython.cast(cython.double, (row + apex[top]) * away + new - height[top])
                               / cython.cast(cython.double, 2 * away))
        if crossing + 1 < last:
            top += 1
            apex[top], height[top], begin[top] = row, new, crossing + 1
    for row in range(last - 1, 0, -1):
        while begin[top] > row:
            top -= 1
        away = row - apex[top]
        column[row] = cython.cast(cython.int, away * away + height[top])
