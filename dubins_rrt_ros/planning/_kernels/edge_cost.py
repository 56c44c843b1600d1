# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""What an edge costs: its length. The one place to change for another objective.

Every search minimises the sum of the costs of a path's edges. What it prunes by needs the cost to be at least the length: then a
Dubins length, a straight line and the way around the obstacles stay lower bounds.
"""

import cython

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import length_of
else:
    from .dubins import length_of


def edge_cost(curve):
    """Return the cost of driving a curve [m]."""
    return length_of(curve)
