# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The connected components of cells, by runs along the rows and a union of those that touch.

Roots are the lowest runs of their trees, so that components are numbered in the order of their first cells.
"""

import cython
import numpy as np


def label_components(field: cython.float[:, ::1], least: cython.double, labels: cython.int[:, ::1]):
    """Label the components of the cells whose value is at least `least`; cells touch at corners, too.

    Args:
        field: (rows, columns) float32.
        labels: (rows, columns) int32, filled: from 1 on, 0 for cells that belong to none.

    Returns:
        The number of components.
    """
    rows: cython.Py_ssize_t = field.shape[0]
    columns: cython.int = cython.cast(cython.int, field.shape[1])
    most: cython.Py_ssize_t = rows * ((columns + 1) // 2)
    first: cython.int[::1] = np.empty(most, np.int32)  # of each run, and the column behind its last
    end: cython.int[::1] = np.empty(most, np.int32)
    parent: cython.int[::1] = np.empty(most, np.int32)
    begin: cython.int[::1] = np.empty(rows + 1, np.int32)  # of each row's runs
    row: cython.Py_ssize_t
    column: cython.int
    run: cython.int = 0
    above: cython.int
    count: cython.int = 0
    with cython.nogil:
        for row in range(rows):
            begin[row] = run
            above = begin[row - 1] if row > 0 else 0
            column = 0
            while column < columns:
                while column < columns and field[row, column] < least:
                    column += 1
                if column == columns:
                    break
                first[run], parent[run] = column, run
                while column < columns and field[row, column] >= least:
                    column += 1
                end[run] = column
                while above < begin[row] and end[above] < first[run]:
                    above += 1
                while above < begin[row] and first[above] <= column:
                    join(parent, above, run)
                    if end[above] > column:  # the next run of this row may touch it too
                        break
                    above += 1
                run += 1
        begin[rows] = run
        labels[:, :] = 0
        for row in range(rows):
            for run in range(begin[row], begin[row + 1]):
                # Each parent comes before its children, and has become a number by now: minus that of its component.
                if parent[run] == run:
                    count += 1
                    parent[run] = -count
                else:
                    parent[run] = parent[parent[run]]
                for column in range(first[run], end[run]):
                    labels[row, column] = -parent[run]
    return count


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def root_of(parent: cython.int[::1], run: cython.int) -> cython.int:
    """Return the root of a run's tree, and shorten the way there."""
    while parent[run] != run:
        parent[run] = parent[parent[run]]
        run = parent[run]
    return run


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def join(parent: cython.int[::1], a: cython.int, b: cython.int) -> cython.void:
    """Join the trees of two runs; the lower root stays one."""
    a, b = root_of(parent, a), root_of(parent, b)
    if a < b:
        parent[b] = a
    else:
        parent[a] = b
