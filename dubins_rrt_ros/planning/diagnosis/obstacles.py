"""Obstacles around a point: the nearest one, and whether they leave room enough."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import shapely

from ..collision.clearance import ClearanceField
from ..deadline import unlimited
from ..maps.model import GridMap, Map
from ..problem import Problem
from ..vehicle import Point

#: Distances below this are due to rounding [m].
ROUNDING = 1e-9
#: Coordinates are clamped to this, so that their squares stay finite [m].
LARGEST_COORDINATE = 1e100
#: Approximate number of cells of a grid that are worked on before the time is looked at.
STRIP = 250_000
#: The kinds of obstacles.
OBSTACLE, UNKNOWN_SPACE, MAP_EDGE = "obstacle", "unknown space", "the map's edge"
#: Points of the unit disc, those of a square grid that lie beyond it moved to its rim ...
DISC = np.array([(x / 8, y / 8) for x in range(-9, 10) for y in range(-9, 10) if x * x + y * y <= 81])
DISC /= np.maximum(np.hypot(*DISC.T), 1)[:, None]
#: ... and the largest distance of a point of the disc from the nearest of them.
DISC_GAP = math.sqrt(2) / 16


class Obstacle(NamedTuple):
    """An obstacle near a point.

    Attributes:
        nearest: its point (x, y) that is nearest [m].
        kind: OBSTACLE, UNKNOWN_SPACE or MAP_EDGE.
        value: of the cell, where it is one of a grid.
    """

    nearest: Point
    kind: str
    value: int | None = None


def rectangle(world_map: Map) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest corner of a map, (2,), and its sides from there, (2, 2) [m]."""
    corners = world_map.corners()
    return corners[0], corners[[1, 3]] - corners[0]


def nearest_in_map(world_map: Map, point: Point) -> Point:
    """Return the point of the map's rectangle that is nearest to `point`: itself where it is inside."""
    corner, sides = rectangle(world_map)
    (x0, y0), ((ax, ay), (bx, by)) = corner.tolist(), sides.tolist()  # as floats: each request asks
    dx, dy = (min(max(c, -LARGEST_COORDINATE), LARGEST_COORDINATE) - c0 for c, c0 in zip(point, (x0, y0), strict=True))
    a, b = (dx * ax + dy * ay) / (ax * ax + ay * ay), (dx * bx + dy * by) / (bx * bx + by * by)
    if 0 <= a <= 1 and 0 <= b <= 1:
        return point
    a, b = min(max(a, 0.0), 1.0), min(max(b, 0.0), 1.0)
    return x0 + a * ax + b * bx, y0 + a * ay + b * by


def has_no_room(field: ClearanceField, required_clearance: float, point: Point, tolerance: float) -> bool:
    """Return True if provably no place within `tolerance` [m] of a point has the required clearance [m]."""
    places = point + tolerance * DISC if tolerance > 0 else np.array([point])
    return bool(field.at(places).max() + tolerance * DISC_GAP < required_clearance)


def strips(grid: GridMap, factor: int = 1) -> Iterator[slice]:
    """Yield slices of a grid's rows that take a few milliseconds each; all but the last have a multiple of `factor` rows."""
    rows, columns = grid.data.shape
    height = factor * max(1, STRIP // (factor * columns))
    for first in range(0, rows, height):
        yield slice(first, min(first + height, rows))


def avoids_unknown(problem: Problem, check_time: Callable[[], None] = unlimited) -> bool:
    """Return True if the map has unknown space that is taken as an obstacle."""
    if not isinstance(problem.map, GridMap) or problem.allow_unknown:
        return False
    for strip in strips(problem.map):
        check_time()
        cells, blocked = problem.map.data[strip], problem.map.thresholds.blocked
        if (blocked(cells, False) != blocked(cells, True)).any():
            return True
    return False


def nearest_obstacle(world_map: Map, allow_unknown: bool, point: Point, clearance: float) -> Obstacle:
    """Find the nearest point of the obstacles around a point of the map, and what it belongs to.

    Args:
        world_map, allow_unknown: tell what the obstacles are.
        point: (x, y) [m].
        clearance: its distance to them [m].
    """
    on_edge = _nearest_on(shapely.LinearRing(world_map.corners()), point)
    if isinstance(world_map, GridMap):
        found = _nearest_cell(world_map.window(point, clearance), allow_unknown, point)
    else:
        found = Obstacle(_nearest_on(shapely.boundary(world_map.free), point) if clearance > 0 else point, OBSTACLE)
    if found is None or math.dist(on_edge, point) <= math.dist(found.nearest, point) + ROUNDING:
        return Obstacle(on_edge, MAP_EDGE)
    return found


def _nearest_cell(grid: GridMap, allow_unknown: bool, point: Point) -> Obstacle | None:
    """Return the nearest of the squares of the blocked cells, if there are any."""
    rows, columns = np.divmod(np.flatnonzero(grid.blocked(allow_unknown)), grid.data.shape[1])
    if len(rows) == 0:
        return None
    here = grid.to_grid_frame(np.array(point))
    lowest = np.column_stack([columns, rows]) * grid.resolution
    nearest = np.clip(here, lowest, lowest + grid.resolution)
    away = np.hypot(*(nearest - here).T)
    first = np.argmin(away)
    is_obstacle = grid.blocked(True)[rows, columns] & (away <= away[first] + ROUNDING)
    first = np.argmax(is_obstacle) if is_obstacle.any() else first
    x, y = grid.to_map_frame(nearest[first]).tolist()
    value = int(grid.data[rows[first], columns[first]])
    return Obstacle((x, y), OBSTACLE if is_obstacle.any() else UNKNOWN_SPACE, value)


def _nearest_on(line: shapely.Geometry, point: Point) -> Point:
    x, y = shapely.get_coordinates(shapely.shortest_line(line, shapely.Point(point)))[0]
    return float(x), float(y)
