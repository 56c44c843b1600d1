"""The cost of a path by the audit's own measure: points close together, and distances to the obstacles' true shapes."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..maps.model import GridMap
from ..problem import Problem
from .obstacles import Obstacles, PathsideSquares, PolygonObstacles, obstacles_of
from .sweep import Arcs, DiscSweep, PolygonSweep, any_time
from .verdict import driven_arcs

if TYPE_CHECKING:
    from ..curves.path import Path

#: Distance between the points, in preferred clearances, and their maximum number.
SPACING, MOST_POINTS = 1 / 64, 1_000_000
#: Relative error of a cost that is claimed and right: that of the planner's integrals, and that of these.
COST_ERROR = 1.5e-3
#: Number of points that are measured at once.
AT_ONCE = 2048


def cost_of(path: "Path", problem: Problem, preferred_clearance: float, weight: float, obstacles: Obstacles | None = None,
            check_time: Callable[[], None] = any_time) -> float:
    """Return the cost of a path that is free [m]: the integral of 1 + weight * max(0, 1 - room / preferred_clearance)^2.

    Args:
        path: its curves can be driven.
        problem: with map and vehicle.
        preferred_clearance, weight: of the cost; 0 makes it the length [m].
        obstacles: those of the problem's map, where they are at hand.
        check_time: called every few milliseconds; what it raises ends the audit.
    """
    if preferred_clearance == 0 or weight == 0 or not path.curves:
        return path.length
    arcs = driven_arcs(path.curves, path.start)[2]
    index, begin, size = arcs.pieces(max(SPACING * preferred_clearance, float(arcs.length.sum()) / MOST_POINTS))
    x, y, theta = arcs.at(index, begin + size / 2)
    vehicle, inset = _vehicle(problem, preferred_clearance, obstacles, arcs, check_time)
    cost = 0.0
    for first in range(0, len(x), AT_ONCE):
        check_time()
        some = slice(first, first + AT_ONCE)
        room = vehicle.clearance(x[some], y[some], theta[some]) - inset
        cost += float((size[some] * (1 + weight * np.maximum(0, 1 - room / preferred_clearance)**2)).sum())
    return cost


def _vehicle(problem: Problem, reach: float, obstacles: Obstacles | None, arcs: Arcs, check_time: Callable[[], None]
             ) -> tuple[DiscSweep | PolygonSweep, float]:
    """Return what measures distances from the obstacles, up to `reach` at least, and by how much the room is less than these."""
    footprint, world_map = problem.vehicle.footprint, problem.map
    if not footprint:
        radius = problem.vehicle.robot_radius
        return DiscSweep(obstacles or obstacles_of(world_map, problem.allow_unknown), radius + reach), radius
    if not isinstance(world_map, GridMap):
        return PolygonSweep(footprint, PolygonObstacles(world_map.free)), 0.0
    index, begin, _ = arcs.pieces(reach)
    x, y, _ = arcs.at(index, begin)
    cells = math.ceil(reach / world_map.resolution) + 1
    squares = PathsideSquares(world_map, problem.allow_unknown, x + 1j * y, problem.vehicle.robot_radius + reach,
                              cells * world_map.resolution, check_time)
    return PolygonSweep(footprint, squares), 0.0
