"""A search of hybrid A* over a problem's map: how it is set up, and taken further until its work is over."""

import math
from typing import Any

import numpy as np

from .._kernels.collision import CollisionChecker
from .._kernels.edge_cost import EdgeCost
from .._kernels.hybrid_astar import HybridAStar
from ..problem import Problem
from ..work import Work
from .pace import Pace

#: Number of poses that are expanded at first before the time is looked at, and their maximum number later.
FIRST_SLICE, LARGEST_SLICE = 16, 1024


def new_search(problem: Problem, checker: CollisionChecker, edge_cost: EdgeCost, arc: float, headings: int, weight: float,
               visit_penalty: float, **options: Any) -> HybridAStar:
    """Return a search of hybrid A* on the problem's map.

    Args:
        checker, edge_cost: judge every arc, and say what it costs.
        arc: length of the arcs in lengths of manoeuvres.
        headings: number of headings in the closed set.
        options: as of `HybridAStar`, between which poses above all.
    """
    radius, scale = problem.vehicle.turning_radius, problem.vehicle.maneuver_scale
    turning_arc = min(arc * scale, max(arc, math.tau / headings) * radius)
    corners = problem.map.corners()
    return HybridAStar(
        checker=checker, edge_cost=edge_cost, radius=radius, corner=corners.min(axis=0), extent=np.ptp(corners, axis=0),
        arc=arc * scale, turning_arc=turning_arc, sectors=headings, weight=weight, visit_penalty=visit_penalty, **options)


def expand(search: HybridAStar, pace: Pace, expansions: int, work: Work) -> int:
    """Expand that many poses, in slices after each of which the work may be over; return their number."""
    begin = search.expanded
    while expansions > 0 and not search.ended and not work.is_over:
        size, before = min(work.portion(pace.size), expansions), search.expanded
        with pace.measured(size):
            search.run(size)
        work.done += int(search.expanded - before + search.ended)  # interpreted, it is one of NumPy's
        expansions -= size
    return int(search.expanded - begin)
