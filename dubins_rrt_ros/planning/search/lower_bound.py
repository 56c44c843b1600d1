"""A length that no path of a problem falls below."""

import math

import numpy as np

from ..curves import dubins
from ..problem import Problem
from .cost_to_go import DistanceField


def lower_bound(problem: Problem, field: DistanceField | None = None) -> float:
    """Return a length that no path of the problem falls below [m]; infinite where `field` tells that there is none.

    It is that of the Dubins curve without obstacles; or, where the goal has a tolerance, the straight line to where that
    begins and the turn to the first heading that will do. With `field`, the distances to the goal, it is no less than the way
    around the obstacles.
    """
    start, goal, radius = problem.start, problem.goal, problem.vehicle.turning_radius
    around = float(field.at(np.array([start[:2]]))[0]) if field else 0.0
    if problem.exact_goal:
        return max(around, dubins.shortest(start, goal, radius).length)
    turn = abs(math.remainder(goal[2] - start[2], math.tau)) - problem.yaw_tolerance
    return max(0.0, around, math.dist(start[:2], goal[:2]) - problem.goal_tolerance_xy, radius * turn)
