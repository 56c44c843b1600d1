"""The cost of a path by the audit's own measure: points close together, distances to the obstacles' true shapes, and cells."""

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..maps.model import GridMap
from ..problem import Problem
from ..settings import ROOMY, Settings
from .obstacles import Obstacles, PathsideSquares, PolygonObstacles, obstacles_of
from .sweep import Arcs, DiscSweep, PolygonSweep, any_time, fastest
from .verdict import driven_arcs

if TYPE_CHECKING:
    from ..curves.path import Path

#: Way of the vehicle's fastest point from one of the points to the next, in preferred clearances, and their maximum number.
SPACING, MOST_POINTS = 1 / 64, 1_000_000
#: Size of the pieces that a path over cells with costs is cut into, in cells; number of parts of one that leaves its cell, and
#: how often that is done with those parts that do.
CELL_PIECE, CELL_PARTS, CELL_CUTS = 1 / 8, 8, 4
#: Relative error of a cost that is claimed and right: that of the planner's integrals, and that of these.
COST_ERROR = 1.5e-3
#: Error of a share of the length with room that is claimed and right, where the room is about what counts as such.
SHARE_ERROR = 0.02
#: Number of points that are measured at once.
AT_ONCE = 2048


def cost_of(path: "Path", problem: Problem, settings: Settings, obstacles: Obstacles | None = None,
            check_time: Callable[[], None] = any_time) -> float:
    """Return the cost of a path that is free [m].

    It is the integral of 1 + clearance_weight * max(0, 1 - room / preferred_clearance)^2 + cost_weight * (the cost of the cell)
    / 100.

    Args:
        path: its curves can be driven.
        problem: with map and vehicle.
        settings: with the weights.
        obstacles: those of the problem's map, where they are at hand.
        check_time: called every few milliseconds; what it raises ends the audit.
    """
    cost = path.length
    if not path.curves:
        return cost
    arcs = driven_arcs(path.curves, path.start)[2]
    if (preferred_clearance := settings.preferred_clearance_of(problem.vehicle)) > 0:
        cost += settings.clearance_weight * _closeness(arcs, problem, preferred_clearance, obstacles, check_time)
    if (cell_weight := settings.weight_of_cells) > 0 and isinstance(problem.map, GridMap) and problem.map.costs is not None:
        cost += cell_weight * _over_cells(arcs, problem.map, check_time)
    return cost


def roomy_share_of(path: "Path", problem: Problem, settings: Settings, obstacles: Obstacles | None = None,
                   check_time: Callable[[], None] = any_time) -> float | None:
    """Return the share of a path's length with room of at least 0.8 preferred clearances; None where there is none of either.

    The arguments are as for `cost_of`.
    """
    preferred_clearance = settings.preferred_clearance_of(problem.vehicle)
    if preferred_clearance == 0 or path.length == 0:
        return None
    arcs = driven_arcs(path.curves, path.start)[2]
    return sum(float(size[room >= ROOMY * preferred_clearance].sum())
               for size, room in _rooms(arcs, problem, preferred_clearance, obstacles, check_time)) / path.length


def _closeness(arcs: Arcs, problem: Problem, preferred_clearance: float, obstacles: Obstacles | None,
              check_time: Callable[[], None]) -> float:
    """Return the integral of max(0, 1 - room / preferred_clearance)^2 [m]."""
    return sum(float((size * np.maximum(0, 1 - room / preferred_clearance)**2).sum())
               for size, room in _rooms(arcs, problem, preferred_clearance, obstacles, check_time))


def _rooms(arcs: Arcs, problem: Problem, preferred_clearance: float, obstacles: Obstacles | None, check_time: Callable[[], None]
           ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the sizes of pieces of the arcs [m], and the room in their middles, as far as that is below the preferred one [m]."""
    corners = np.array([complex(*corner) for corner in problem.vehicle.footprint or ((0.0, 0.0),)])
    speed = fastest(corners, arcs.curvature)
    longest = max(SPACING * preferred_clearance, float((arcs.length * speed).sum()) / MOST_POINTS)
    index, begin, size = arcs.pieces(longest / speed)
    x, y, theta = arcs.at(index, begin + size / 2)
    vehicle, inset = _vehicle(problem, preferred_clearance, obstacles, arcs, check_time)
    for first in range(0, len(x), AT_ONCE):
        check_time()
        some = slice(first, first + AT_ONCE)
        yield size[some], vehicle.clearance(x[some], y[some], theta[some]) - inset


def _over_cells(arcs: Arcs, grid: GridMap, check_time: Callable[[], None]) -> float:
    """Return the integral of the costs of the cells under the reference point, as shares of 100 % [m]."""
    index, begin, size = arcs.pieces(max(CELL_PIECE * grid.resolution, float(arcs.length.sum()) / MOST_POINTS))
    integral = 0.0
    for first in range(0, len(index), AT_ONCE):
        check_time()
        some = slice(first, first + AT_ONCE)
        integral += _over_pieces(arcs, grid, index[some], begin[some], size[some], CELL_CUTS)
    return integral


def _over_pieces(arcs: Arcs, grid: GridMap, arc: np.ndarray, begin: np.ndarray, size: np.ndarray, cuts: int) -> float:
    """Return the integral over pieces of arcs, those that leave their cells being cut so many times [m]."""
    leaves = _cell_at(grid, arcs, arc, begin) != _cell_at(grid, arcs, arc, begin + size)
    counts = ~leaves | (cuts == 0)
    integral = float((size * _shares(grid, _cell_at(grid, arcs, arc, begin + size / 2)))[counts].sum())
    if cuts > 0 and leaves.any():
        arc, begin, size = (np.repeat(array[leaves], CELL_PARTS) for array in (arc, begin, size / CELL_PARTS))
        integral += _over_pieces(arcs, grid, arc, begin + size * np.tile(np.arange(CELL_PARTS), leaves.sum()), size, cuts - 1)
    return integral


def _cell_at(grid: GridMap, arcs: Arcs, index: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return the cells at arc lengths, as complex numbers column + i row."""
    x, y, _ = arcs.at(index, s)
    place = (x - grid.origin[0] + 1j * (y - grid.origin[1])) * np.exp(-1j * grid.origin[2]) / grid.resolution
    cells: np.ndarray = np.floor(place.real) + 1j * np.floor(place.imag)
    return cells


def _shares(grid: GridMap, cells: np.ndarray) -> np.ndarray:
    """Return the costs of cells as shares of 100 %."""
    assert grid.costs is not None
    rows, columns = grid.costs.shape
    row, column = (np.clip(part.astype(int), 0, count - 1) for part, count in ((cells.imag, rows), (cells.real, columns)))
    return np.asarray(grid.costs[row, column] / 100.0)


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
