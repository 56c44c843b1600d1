"""Proofs that start and goal lie in different parts of the free space."""

import math

import numpy as np
import shapely
from scipy import ndimage

from ..collision.clearance import ClearanceField
from ..maps.model import GridMap, PolygonMap
from ..problem import Problem


def are_separated(problem: Problem, field: ClearanceField) -> bool:
    """Return True if start and goal provably lie in different components of the space that is free for the vehicle's disc.

    The components are those of a superset of the free space, so that True is a proof; False proves nothing.
    """
    return (_have_different_labels(problem, field, field.components(problem.vehicle.required_clearance))
            or (problem.vehicle.required_clearance >= 0 and _are_in_different_polygons(problem)))


def are_walled_off(problem: Problem, field: ClearanceField) -> bool:
    """Return True if start and goal provably lie in different parts of the free space: no disc can pass, however small."""
    if isinstance(problem.map, GridMap):
        return _have_different_labels(problem, field, ndimage.label(~problem.map.blocked(problem.allow_unknown))[0])
    return _are_in_different_polygons(problem)


def _have_different_labels(problem: Problem, field: ClearanceField, labels: np.ndarray) -> bool:
    """Return True if the label at the start is none of those within the goal's tolerance."""
    cells = field.cells(np.array([problem.start[:2], problem.goal[:2]]))
    (start_row, row), (start_column, column) = (indices.tolist() for indices in cells)
    # A window that holds all cells with a point within the tolerance.
    reach = math.ceil(problem.goal_tolerance_xy / field.kernel.resolution) + (problem.goal_tolerance_xy > 0)
    window = labels[max(0, row - reach):row + reach + 1, max(0, column - reach):column + reach + 1]
    return labels[start_row, start_column] not in window


def _are_in_different_polygons(problem: Problem) -> bool:
    """Return True if start and goal lie in different parts of a polygon map, which touch each other in points at most."""
    if not isinstance(problem.map, PolygonMap):
        return False
    parts = shapely.get_parts(problem.map.free)
    of_start = parts[shapely.intersects(parts, shapely.Point(problem.start[:2]))]
    return bool((shapely.distance(of_start, shapely.Point(problem.goal[:2])) > problem.goal_tolerance_xy).all())
