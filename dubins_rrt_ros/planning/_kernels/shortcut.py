# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Shortcuts of a path: the shortest chain of free Dubins curves and of pieces of the path between poses along it."""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.clearance import Clearance
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import NO_CURVE, drive, shortest_within, turn_of
    from cython.cimports.libc.math import cos, sin
else:
    from math import cos, sin

    from .clearance import Clearance
    from .dubins import NO_CURVE, drive, shortest_within, turn_of

#: A smaller gain is rounding [m].
LEAST_GAIN = cython.declare(cython.double, 1e-9)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def is_free(clearance: Clearance, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double,
            word: cython.int, first: cython.double, second: cython.double, third: cython.double,
            need: cython.double) -> cython.bint:
    """Whether a curve keeps the clearance `need`. Most that do not are blocked in the middle, so that is looked at first."""
    px: cython.double
    py: cython.double
    ptheta: cython.double
    px, py, ptheta = drive(x, y, theta, radius, turn_of(word, 0), first)
    px, py, ptheta = drive(px, py, ptheta, radius, turn_of(word, 1), second / 2)
    return clearance.free(px, py, need) and clearance.curve_is_free(x, y, theta, radius, word, first, second, third, need)


def shortest_chain(stations: cython.double[:, ::1], at: cython.double[::1], radius: cython.double, clearance: Clearance,
                   need: cython.double, costs: cython.double[::1], before: cython.int[::1], words: cython.schar[::1],
                   lengths: cython.double[:, ::1]):
    """Write how each station of a path is reached at the least length: by a dynamic programme along the path.

    Args:
        stations: (n, 3): x [m], y [m], theta [rad] of poses along the path, from its start to its end.
        at: (n,): how far along the path they are [m].
        need: the clearance that the curves keep [m], as the path does.
        costs: (n,), written: the least length to each station [m].
        before: (n,), written: the station from which it is reached, always an earlier one; -1 for the first.
        words, lengths: (n,) and (n, 3), written: by what curve; lengths in metres. The word -1 is the piece of the path, which
            leads from the station just before.
    """
    headings_array = np.empty((at.shape[0], 2))
    headings: cython.double[:, ::1] = headings_array
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    dx: cython.double
    dy: cython.double
    kept: cython.double
    limit: cython.double
    word: cython.int
    first: cython.double
    second: cython.double
    third: cython.double
    with cython.nogil:
        for j in range(at.shape[0]):
            headings[j, 0] = sin(stations[j, 2])
            headings[j, 1] = cos(stations[j, 2])
            kept = costs[j - 1] + (at[j] - at[j - 1]) if j > 0 else 0
            # Where it is rounding that decides, a curve from far back is better than several.
            costs[j] = kept + 2 * LEAST_GAIN
            before[j] = j - 1
            words[j] = -1
            for i in range(j):
                limit = costs[j] - LEAST_GAIN - costs[i]
                dx = stations[j, 0] - stations[i, 0]
                dy = stations[j, 1] - stations[i, 1]
                if limit <= 0 or dx * dx + dy * dy >= limit * limit:
                    continue
                word, first, second, third = shortest_within(dx, dy, stations[i, 2], headings[i, 0], headings[i, 1],
                                                             stations[j, 2], headings[j, 0], headings[j, 1], radius, limit)
                if first < NO_CURVE and is_free(clearance, stations[i, 0], stations[i, 1], stations[i, 2], radius, word,
                                                first, second, third, need):
                    costs[j] = costs[i] + (first + second + third)
                    before[j] = i
                    words[j] = word
                    lengths[j, 0] = first
                    lengths[j, 1] = second
                    lengths[j, 2] = third
            if words[j] < 0:
                costs[j] = kept
