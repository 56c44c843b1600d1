"""The widest passage between start and goal: how large a disc that turns on the spot gets through, and where it is narrowest."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .._kernels import COMPILED
from .._kernels.widest_path import WidestPathSearch
from ..collision.clearance import ClearanceField
from ..collision.raster import CLEARANCE_MARGIN
from ..deadline import unlimited
from ..maps.cells import FREE, OCCUPIED, UNKNOWN
from ..maps.model import GridMap, Map
from ..problem import Problem
from ..vehicle import Point
from .obstacles import ROUNDING, avoids_unknown, rectangle, strips

#: Maximum number of nodes, about, of the grid of samples that passages are sought on ...
MAX_NODES = 1_000_000 if COMPILED else 50_000
#: ... and maximum number of cells, about, of the map that they are sought on through unknown space.
MAX_CELLS = 500_000
#: Minimum number of points along a passage whose clearance is measured, and number of them that are measured at once.
MEASURED, AT_ONCE = (20_000, 2_000) if COMPILED else (2_000, 50)
#: Number of places across a passage of which the one with most clearance is taken; the middle one is a sample.
PLACES = 9
#: Number of nodes that are visited before the time is looked at.
SLICE = 5_000 if COMPILED else 50


@dataclass(frozen=True, eq=False)
class Passage:
    """A passage from start to goal for a disc that can turn on the spot.

    Attributes:
        points: (n, 2) float64 along it, close together [m].
        radius: a disc of this radius moves all along it and touches no obstacle [m].
        width: the distance between the obstacles at its narrowest place, twice the clearance there [m].
        narrowest: (x, y) of that place [m].
    """

    points: np.ndarray
    radius: float
    width: float
    narrowest: Point


def widest_passage(problem: Problem, field: ClearanceField, check_time: Callable[[], None] = unlimited) -> Passage | None:
    """Find the widest passage from start to goal on a grid of samples, or one that is wide enough; None where there is none.

    Then no passage between start and goal is wider than four of `sample_spacing`. `check_time` is called every few milliseconds;
    what it raises ends the search.
    """
    grid = _SampleGrid(problem.map, field)
    starts = grid.nodes_at(problem.start[:2], 0.0)
    targets = grid.nodes_at(problem.goal[:2], problem.goal_tolerance_xy)
    if len(starts) == 0 or len(targets) == 0:
        return None
    is_target = np.zeros(grid.rows * grid.columns, np.int8)
    is_target[targets] = 1
    search = WidestPathSearch(clearance=field.kernel, first=grid.first, along=grid.step_along, shape=(grid.rows, grid.columns),
                              is_target=is_target, least=grid.spacing / 2,
                              enough=problem.vehicle.inscribed_radius + CLEARANCE_MARGIN + grid.spacing)
    search.begin(int(starts[np.argmax(field.at(grid.points(starts)))]))
    while search.run(SLICE):
        check_time()
    _, nodes = search.widest_path()
    if len(nodes) == 0:
        return None
    points = grid.points(nodes)
    to_goal = problem.goal[:2] - points[-1]
    left = math.hypot(*to_goal)
    end = points[-1] + to_goal * (max(0.0, left - problem.goal_tolerance_xy) / left if left > 0 else 0.0)
    found, centred = (_measured(np.vstack([problem.start[:2], way, end]), field, check_time)
                      for way in (points, _centred(points, field, grid.spacing, check_time)))
    return centred if found.radius < min(centred.radius, problem.vehicle.required_clearance) else found


def widest_passage_through_unknown(problem: Problem, check_time: Callable[[], None] = unlimited) -> Passage | None:
    """Find a passage that is wide enough for the vehicle where unknown space is taken as free; None where none is found."""
    if not (isinstance(problem.map, GridMap) and avoids_unknown(problem, check_time)):
        return None
    grid = _coarsened(problem.map, math.ceil(math.sqrt(problem.map.data.size / MAX_CELLS)), check_time)
    opened = replace(problem, map=grid, allow_unknown=True)
    passage = widest_passage(opened, ClearanceField(grid, allow_unknown=True), check_time)
    return passage if passage and passage.radius >= problem.vehicle.inscribed_radius else None


def sample_spacing(world_map: Map, field: ClearanceField) -> float:
    """Return the distance between neighbours in the grid of samples on which the widest passage is sought [m].

    Half a cell of a grid map, if that is not too fine: such samples include the middles of all gaps between cells.
    """
    _, sides = rectangle(world_map)
    finest = field.kernel.resolution / 2 if isinstance(world_map, GridMap) else 0.0
    return max(finest, math.sqrt(math.hypot(*sides[0]) * math.hypot(*sides[1]) / MAX_NODES))


class _SampleGrid:
    """A square grid of samples over the inside of a map."""

    def __init__(self, world_map: Map, field: ClearanceField):
        corner, sides = rectangle(world_map)
        lengths = np.hypot(*sides.T)
        self._field = field
        self.spacing = sample_spacing(world_map, field)
        self.columns, self.rows = (max(1, math.ceil(length / self.spacing - 1e-6) - 1) for length in lengths.tolist())
        self._steps = sides / lengths[:, None] * self.spacing
        self.step_along = self._steps[0].tolist()
        self.first = (corner + self._steps.sum(axis=0)).tolist()

    def points(self, nodes: np.ndarray) -> np.ndarray:
        """Return the (n, 2) positions of nodes [m]."""
        points: np.ndarray = self.first + np.column_stack([nodes % self.columns, nodes // self.columns]) @ self._steps
        return points

    def nodes_at(self, point: Point, tolerance: float) -> np.ndarray:
        """Return the nodes within `tolerance` of a point, and those from where a short straight line that is free leads there."""
        reach = tolerance / self.spacing + 1
        column, row = (np.array(point) - self.first) @ self._steps.T / self.spacing**2
        rows, columns = (np.arange(max(0, math.ceil(at - reach)), min(n, math.floor(at + reach) + 1))
                         for at, n in ((row, self.rows), (column, self.columns)))
        nodes = (rows[:, None] * self.columns + columns).ravel()
        left = np.hypot(*(self.points(nodes) - point).T) - tolerance
        around = (left > 0) & (left <= self.spacing)
        around[around] = self._field.at(self.points(nodes[around])) > left[around]
        found: np.ndarray = nodes[around | (left <= 0)]
        return found


def _centred(points: np.ndarray, field: ClearanceField, spacing: float, check_time: Callable[[], None]) -> np.ndarray:
    """Return points of a passage, each moved across it by up to `spacing` to where the clearance is greatest."""
    along = points[np.minimum(np.arange(len(points)) + 3, len(points) - 1)] - points[np.maximum(np.arange(len(points)) - 3, 0)]
    length = np.hypot(*along.T)
    across = np.column_stack([-along[:, 1], along[:, 0]]) / np.where(length > 0, length, 1.0)[:, None]
    places = points + spacing * np.linspace(-1, 1, PLACES)[:, None, None] * across
    clearance = _clearance(places, field, check_time)
    return np.asarray(places[np.argmax(clearance, axis=0), np.arange(len(points))])


def _measured(corners: np.ndarray, field: ClearanceField, check_time: Callable[[], None]) -> Passage:
    """Return a passage along straight lines; between points s apart with clearances c, c' there is at least (c + c' - s) / 2."""
    at_corners = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    arc_lengths = np.union1d(at_corners, np.linspace(0, at_corners[-1], MEASURED))
    points = np.column_stack([np.interp(arc_lengths, at_corners, corners[:, axis]) for axis in (0, 1)])
    clearance = _clearance(points, field, check_time)
    radius = float(((clearance[1:] + clearance[:-1] - np.diff(arc_lengths)) / 2).min())
    return Passage(points, radius, *_narrowest(corners, _clearance(corners, field, check_time)))


def _clearance(points: np.ndarray, field: ClearanceField, check_time: Callable[[], None]) -> np.ndarray:
    """Return the clearance at (..., 2) points [m], some of them at a time."""
    flat, clearance = points.reshape(-1, 2), np.empty(points.shape[:-1])
    for first in range(0, len(flat), AT_ONCE):
        check_time()
        clearance.reshape(-1)[first:first + AT_ONCE] = field.at(flat[first:first + AT_ONCE])
    return clearance


def _narrowest(corners: np.ndarray, clearance: np.ndarray) -> tuple[float, Point]:
    """Return width and position of the narrowest place: the middle of the first, after which the search need not avoid others."""
    as_narrow = clearance <= clearance.min() + ROUNDING
    first = int(np.argmax(as_narrow))
    length = int(np.argmin(np.append(as_narrow[first:], False)))
    x, y = corners[first + (length - 1) // 2].tolist()
    return 2 * float(clearance.min()), (x, y)


def _coarsened(grid: GridMap, factor: int, check_time: Callable[[], None]) -> GridMap:
    """Return the grid with blocks of `factor` x `factor` cells as cells, each as bad as the worst of them."""
    if factor == 1:
        return grid
    rows, columns = (-(-cells // factor) for cells in grid.data.shape)
    data = np.full((rows, columns), FREE, np.int8)
    for strip in strips(grid, factor):
        check_time()
        cells = grid.data[strip]
        occupied, blocked = (_any_of_blocks(grid.thresholds.blocked(cells, unknown), factor) for unknown in (True, False))
        data[strip.start // factor:strip.start // factor + len(occupied)] = np.where(
            occupied, OCCUPIED, np.where(blocked, UNKNOWN, FREE))
    for axis, cells in enumerate(grid.data.shape):
        if cells % factor:  # the last block reaches beyond the map
            np.moveaxis(data, axis, 0)[-1] = OCCUPIED
    return GridMap(data, grid.resolution * factor, grid.origin, grid.name)


def _any_of_blocks(cells: np.ndarray, factor: int) -> np.ndarray:
    rows, columns = (np.arange(0, n, factor) for n in cells.shape)
    return np.asarray(np.logical_or.reduceat(np.logical_or.reduceat(cells, rows, axis=0), columns, axis=1))
