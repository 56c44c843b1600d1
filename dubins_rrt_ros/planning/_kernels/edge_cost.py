# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The cost of an edge: its length. The one place in the kernels to change for another objective.

Every search minimises the sum of the costs of a path's edges. Pruning requires that an edge cost at least its length: only then
are the Dubins length, the straight line and the way around the obstacles lower bounds of the cost.
"""

import cython

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import length_of
else:
    from .dubins import length_of


def edge_cost(curve):
    """Return the cost of driving a curve [m]."""
    return length_of(curve)
