"""A length that no path of a problem falls below."""

import numpy as np

from ..curves import dubins
from ..curves.angles import heading_error, position_error
from ..problem import Problem
from .cost_to_go import CostToGo


def lower_bound(problem: Problem, to_goal: CostToGo | None = None) -> float:
    """Return a length that no path of the problem falls below [m]; infinite where `to_goal` tells that there is none.

    It is the length of the Dubins curve without obstacles; where the goal has a tolerance, the straight line and the turn to the
    nearest pose within it. With `to_goal`, which must be a bound then, it is at least the way around the obstacles.
    """
    start, goal, radius = problem.start, problem.goal, problem.vehicle.turning_radius
    around = float(to_goal.at(np.array([start[:2]]))[0]) if to_goal else 0.0
    if problem.exact_goal:
        return max(around, dubins.shortest(start, goal, radius).length)
    turn = heading_error(goal, start) - problem.yaw_tolerance
    return max(0.0, around, position_error(start, goal) - problem.goal_tolerance_xy, radius * turn)
