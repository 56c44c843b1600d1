# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Solution of small symmetric systems by their Cholesky factors: in one thread, and by the same operations on each machine.

Libraries of linear algebra share such a system among threads, which wait for each other far longer than it takes where other
processes want the processors too.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.libc.math import sqrt
else:
    from math import sqrt


def solve_definite(matrix: cython.double[:, ::1], values: cython.double[::1]) -> bool:
    """Solve a system of a symmetric, positive definite matrix.

    Args:
        matrix: (n, n), of which the lower triangle counts; it is overwritten.
        values: (n,), what the solution is to be multiplied to; filled with the solution.

    Returns:
        False where the matrix is not positive definite to working precision; `values` then mean nothing.
    """
    size: cython.int = cython.cast(cython.int, values.shape[0])
    column: cython.double[::1] = np.empty(size)
    is_definite: cython.bint = True
    factor: cython.double
    i: cython.int
    j: cython.int
    k: cython.int
    with cython.nogil:
        for k in range(size):
            if not matrix[k, k] > 0:
                is_definite = False
                break
            matrix[k, k] = sqrt(matrix[k, k])
            for i in range(k + 1, size):
                matrix[i, k] /= matrix[k, k]
                column[i] = matrix[i, k]
            for i in range(k + 1, size):
                factor = column[i]
                for j in range(k + 1, i + 1):
                    matrix[i, j] -= factor * column[j]
        for k in range(size if is_definite else 0):
            for j in range(k):
                values[k] -= matrix[k, j] * values[j]
            values[k] /= matrix[k, k]
        for k in range(size - 1 if is_definite else -1, -1, -1):
            values[k] /= matrix[k, k]
            for j in range(k):
                values[j] -= matrix[k, j] * values[k]
    return is_definite
