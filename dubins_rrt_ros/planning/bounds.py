"""What can be said of a problem before it is searched: lower bounds, and whether start and goal are connected at all."""

import math

import numpy as np

from . import dubins
from .clearance import ClearanceField
from .problem import Problem


def lower_bound(problem: Problem) -> float:
    """A length that no path of the problem falls below [m].

    It is that of the Dubins curve without obstacles; or, where the goal has a tolerance, the straight line to where that
    begins and the turn to the first heading that will do.
    """
    start, goal, radius = problem.start, problem.goal, problem.vehicle.turning_radius
    if problem.exact_goal:
        return dubins.shortest(start, goal, radius).length
    turn = abs(math.remainder(goal[2] - start[2], math.tau)) - problem.yaw_tolerance
    return max(0.0, math.dist(start[:2], goal[:2]) - problem.goal_tolerance_xy, radius * turn)


def are_separated(problem: Problem, field: ClearanceField) -> bool:
    """Whether start and goal provably lie in different components of the space that is free for the vehicle's disc.

    The components are those of a superset of the free space, so that True is a proof; False proves nothing.
    """
    labels = field.components(problem.vehicle.robot_radius)
    start = labels[field.cells(np.array(problem.start[:2]))]
    return start not in labels[_cells_within(problem.goal[:2], problem.goal_tolerance_xy, field)]


def _cells_within(centre: tuple[float, float], distance: float, field: ClearanceField) -> tuple[slice, slice]:
    """A window of the raster that holds all cells with a point within `distance` of `centre`."""
    row, column = field.cells(np.array(centre))
    reach = math.ceil(distance / field.kernel.resolution) + (distance > 0)
    return slice(max(0, row - reach), row + reach + 1), slice(max(0, column - reach), column + reach + 1)
