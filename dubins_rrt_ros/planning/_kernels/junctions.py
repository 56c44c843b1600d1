# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Dubins curves between many poses, and which of them are free."""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.collision import CollisionChecker
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import UNLIMITED, Pose, length_of, shortest
else:
    from .collision import CollisionChecker
    from .dubins import UNLIMITED, Pose, length_of, shortest


def cheapest_junctions(checker: CollisionChecker, poses: cython.double[:, ::1], path: cython.double[:, ::1],
                       rest: cython.double[::1], onto_path: cython.bint, radius: cython.double, most: cython.int,
                       index: cython.int[::1], cost: cython.double[::1]):
    """Find for each pose the free curve between it and a path that is cheapest together with the rest of the path.

    Args:
        poses: (m, 3).
        path: (n, 3) poses of the path.
        rest: (n,) the cost of the part of the path that is driven with a curve to or from each of them [m].
        onto_path: True for curves from the poses to the path, False for those from the path to the poses.
        most: maximum number of curves that are checked for a pose.
        index: (m,) filled: where on the path the curve begins or ends; -1 where none of those that were checked is free.
        cost: (m,) filled: of the curve and of the rest [m]; UNLIMITED where there is none.
    """
    total: cython.double[::1] = np.empty(len(path))
    i: cython.Py_ssize_t
    k: cython.int
    best: cython.int
    _: cython.int
    pose: Pose
    other: Pose
    with cython.nogil:
        for i in range(poses.shape[0]):
            pose = Pose(poses[i, 0], poses[i, 1], poses[i, 2])
            for k in range(cython.cast(cython.int, path.shape[0])):
                other = Pose(path[k, 0], path[k, 1], path[k, 2])
                total[k] = rest[k] + length_of(shortest(pose, other, radius) if onto_path else shortest(other, pose, radius))
            index[i], cost[i] = -1, UNLIMITED
            for _ in range(most):
                best = least(total)
                if total[best] >= UNLIMITED:
                    break
                other = Pose(path[best, 0], path[best, 1], path[best, 2])
                if is_free(checker, pose if onto_path else other, other if onto_path else pose, radius):
                    index[i], cost[i] = best, total[best]
                    break
                total[best] = UNLIMITED


def check_curves(checker: CollisionChecker, starts: cython.double[:, ::1], ends: cython.double[:, ::1], radius: cython.double,
                 free: cython.uchar[::1]):
    """Write to (n,) `free` 1 where the shortest curve between two of (n, 3) poses is free, 0 elsewhere."""
    i: cython.Py_ssize_t
    with cython.nogil:
        for i in range(starts.shape[0]):
            free[i] = is_free(checker, Pose(starts[i, 0], starts[i, 1], starts[i, 2]), Pose(ends[i, 0], ends[i, 1], ends[i, 2]),
                              radius)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def is_free(checker: CollisionChecker, start: Pose, end: Pose, radius: cython.double) -> cython.bint:
    """Return whether the shortest curve between two poses is free."""
    return checker.motion_is_free(start, radius, shortest(start, end, radius))


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def least(values: cython.double[::1]) -> cython.int:
    """Return the index of the least value, the first of equal ones."""
    best: cython.int = 0
    i: cython.int
    for i in range(1, cython.cast(cython.int, values.shape[0])):
        if values[i] < values[best]:
            best = i
    return best
