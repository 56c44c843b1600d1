# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The exact distances from the cells of a grid to the nearest blocked one, in two passes; all cells outside it are blocked.

The first goes along the rows: how far away is the next blocked cell in the same row, its `gap`? The second goes along the
columns. Seen from row r, the nearest blocked cell in row i is (r - i)^2 + gap(i)^2 away, squared: a parabola over r for each i,
and the squared distances are the lower envelope of them all. They are integers, and so are not rounded.
"""

import cython
import numpy as np

#: So many columns are worked on together, since what lies side by side in memory is fetched together.
TOGETHER = cython.declare(cython.int, 64)


def measure_row_gaps(free: cython.uchar[:, ::1], row_gap: cython.int[:, ::1]):
    """Find the next blocked cells to the left and to the right of each cell in its row; it can be itself.

    Args:
        free: (rows, columns) uint8, 1 for each cell that is free, 0 for each that is blocked.
        aside: (rows, columns) int32, filled: four times how many cells away the nearer one is, and 1 more where the left one is
            farther, 2 more where the right one is.
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
    """Write a function of the squared distance to the columns from `first` up to `last`, without that.

    Args:
        aside: (rows, columns) int32, what `measure_row_gaps` finds.
        of_squared: float32, its value for each squared distance, up to that of a cell in the middle to the outside.
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


def envelope(column, apex, height, begin):
    """Replace the gaps of a column's cells by the squared distances.

    The column has one cell outside the grid at either end. The other arrays are for the parabolas of the envelope: the row and
    the height of the lowest point, and the first row in which it is the lowest of all so far.
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
        while True:  # until one is met that is not above the new one all along; the first never is
            away, new_away = begin[top] - apex[top], begin[top] - row
            if away * away + height[top] <= new_away * new_away + new:
                break
            top -= 1
        away = row - apex[top]
        # As doubles, which divide faster: they hold these integers, and no quotient below an integer is rounded up to it.
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
