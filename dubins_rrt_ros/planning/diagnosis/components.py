"""Proofs that start and goal lie in different parts of the free space."""

import math
from collections.abc import Callable

import numpy as np
import shapely
from scipy import ndimage, sparse
from scipy.sparse.csgraph import connected_components

from ..collision.clearance import ClearanceField
from ..deadline import unlimited
from ..maps.model import GridMap, PolygonMap
from ..problem import Problem
from .obstacles import strips


def are_separated(problem: Problem, field: ClearanceField) -> bool:
    """Return True if start and goal provably lie in different components of the space that is free for the vehicle's disc.

    The components are those of a superset of the free space, so that True is a proof; False proves nothing.
    """
    start, goals = _labels(problem, field, field.components(problem.vehicle.required_clearance))
    return (start not in goals
            or (problem.vehicle.required_clearance >= 0 and _are_in_different_polygons(problem)))


def are_walled_off(problem: Problem, field: ClearanceField, check_time: Callable[[], None] = unlimited) -> bool:
    """Return True if start and goal provably lie in different parts of the free space: no disc can pass, however small.

    `check_time` is called every few milliseconds; what it raises ends the work.
    """
    if not isinstance(problem.map, GridMap):
        return _are_in_different_polygons(problem)
    labels, component = _free_parts(problem.map, problem.allow_unknown, check_time)
    start, goals = _labels(problem, field, labels)
    return component[start] not in component[goals]


def _free_parts(grid: GridMap, allow_unknown: bool, check_time: Callable[[], None]) -> tuple[np.ndarray, np.ndarray]:
    """Return labels of a grid's cells, of which several may belong to one component of the free cells, and their components."""
    labels, count, joints = np.empty(grid.data.shape, np.int32), 0, []
    for strip in strips(grid):
        check_time()
        found, parts = ndimage.label(~grid.thresholds.blocked(grid.data[strip], allow_unknown))
        found[found > 0] += count
        labels[strip] = found
        count += parts
        joints.append(np.unique(labels[[max(strip.start - 1, 0), strip.start]].T, axis=0))
    first, second = np.concatenate(joints).T
    both = (first > 0) & (second > 0)
    graph = sparse.coo_array((np.ones(both.sum()), (first[both], second[both])), shape=(count + 1, count + 1))
    return labels, connected_components(graph, directed=False)[1]


def _labels(problem: Problem, field: ClearanceField, labels: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the label at the start, and those within the goal's tolerance."""
    cells = field.cells(np.array([problem.start[:2], problem.goal[:2]]))
    (start_row, row), (start_column, column) = (indices.tolist() for indices in cells)
    # A window that holds all cells with a point within the tolerance.
    reach = math.ceil(problem.goal_tolerance_xy / field.kernel.resolution) + (problem.goal_tolerance_xy > 0)
    window = labels[max(0, row - reach):row + reach + 1, max(0, column - reach):column + reach + 1]
    return int(labels[start_row, start_column]), window


def _are_in_different_polygons(problem: Problem) -> bool:
    """Return True if start and goal lie in different parts of a polygon map, which touch each other in points at most."""
    if not isinstance(problem.map, PolygonMap):
        return False
    parts = shapely.get_parts(problem.map.free)
    of_start = parts[shapely.intersects(parts, shapely.Point(problem.start[:2]))]
    return bool((shapely.distance(of_start, shapely.Point(problem.goal[:2])) > problem.goal_tolerance_xy).all())
