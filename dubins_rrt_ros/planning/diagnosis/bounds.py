"""What can be said of a problem without a search: lower bounds, room, components, and the widest way between two of these."""

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy import ndimage

from .._kernels import COMPILED
from .._kernels.widest_path import WidestPathSearch
from ..collision.clearance import MARGIN, ClearanceField
from ..curves import dubins
from ..maps.model import FREE, OCCUPIED, UNKNOWN, GridMap, Map, PolygonMap
from ..problem import Problem
from ..search.cost_to_go import DistanceField

Point = tuple[float, float]

#: Less is rounding [m].
ROUNDING = 1e-9
#: What is farther away is taken to be here, that its square be a number [m].
FAR = 1e100
#: The widest way is sought on a lattice of at most about this many nodes ...
MOST_NODES = 1_000_000 if COMPILED else 50_000
#: ... and through unknown space on a grid of at most about this many cells.
MOST_CELLS = 500_000
#: Points of the unit disc, those on the squares of a grid that reach beyond it moved to its rim, ...
DISC = np.array([(x / 8, y / 8) for x in range(-9, 10) for y in range(-9, 10) if x * x + y * y <= 81])
DISC /= np.maximum(np.hypot(*DISC.T), 1)[:, None]
#: ... and how far a point of it can be from all of them.
APART = math.sqrt(2) / 16
#: About how many points of a way have their clearance measured, at least.
MEASURED = 20_000 if COMPILED else 2_000


@dataclass(frozen=True, eq=False)
class Way:
    """A way from start to goal for a disc that can turn on the spot.

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


def lower_bound(problem: Problem, field: DistanceField | None = None) -> float:
    """A length that no path of the problem falls below [m]; infinite where `field` tells that there is none.

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


def nearest_in_map(map: Map, point: Point) -> Point:
    """The point of the map's rectangle that is nearest to `point`: itself where it is inside."""
    corner, sides = _rectangle(map)
    (x0, y0), ((ax, ay), (bx, by)) = corner.tolist(), sides.tolist()  # as floats: each request asks
    dx, dy = (min(max(c, -FAR), FAR) - c0 for c, c0 in zip(point, (x0, y0), strict=True))
    a, b = (dx * ax + dy * ay) / (ax * ax + ay * ay), (dx * bx + dy * by) / (bx * bx + by * by)
    if 0 <= a <= 1 and 0 <= b <= 1:
        return point
    a, b = min(max(a, 0.0), 1.0), min(max(b, 0.0), 1.0)
    return x0 + a * ax + b * bx, y0 + a * ay + b * by


def has_no_room(field: ClearanceField, need: float, point: Point, tolerance: float) -> bool:
    """Whether provably no place within `tolerance` [m] of a point has the clearance `need` [m]."""
    places = point + tolerance * DISC if tolerance > 0 else np.array([point])
    return bool(field.at(places).max() + tolerance * APART < need)


def are_separated(problem: Problem, field: ClearanceField) -> bool:
    """Whether start and goal provably lie in different components of the space that is free for the vehicle's disc.

    The components are those of a superset of the free space, so that True is a proof; False proves nothing.
    """
    return (_have_different_labels(problem, field, field.components(problem.vehicle.inscribed_radius))
            or (isinstance(problem.map, PolygonMap) and _are_in_different_parts(problem)))


def are_walled_off(problem: Problem, field: ClearanceField) -> bool:
    """Whether start and goal provably lie in different parts of the free space: no disc can pass, however small."""
    if isinstance(problem.map, PolygonMap):
        return _are_in_different_parts(problem)
    return _have_different_labels(problem, field, ndimage.label(~problem.map.blocked(problem.allow_unknown))[0])


def avoids_unknown(problem: Problem) -> bool:
    """Whether the map has unknown space that is taken as an obstacle."""
    return (isinstance(problem.map, GridMap) and not problem.allow_unknown
            and bool((problem.map.blocked(False) != problem.map.blocked(True)).any()))


def widest_way(problem: Problem, field: ClearanceField) -> Way | None:
    """The widest way from start to goal on a lattice, or one that is wide enough; None where the lattice has none.

    No way between start and goal is wider than four of `lattice_spacing` where there is none.
    """
    lattice = _Lattice(problem.map, field)
    starts = lattice.nodes_at(problem.start[:2], 0.0)
    targets = lattice.nodes_at(problem.goal[:2], problem.goal_tolerance_xy)
    if len(starts) == 0 or len(targets) == 0:
        return None
    is_target = np.zeros(lattice.rows * lattice.columns, np.int8)
    is_target[targets] = 1
    search = WidestPathSearch(field.kernel, lattice.first, lattice.along, (lattice.rows, lattice.columns), is_target,
                              lattice.spacing / 2, problem.vehicle.inscribed_radius + MARGIN + lattice.spacing)
    _, nodes = search.widest_path(int(starts[np.argmax(field.at(lattice.points(starts)))]))
    if len(nodes) == 0:
        return None
    points = lattice.points(nodes)
    to_goal = problem.goal[:2] - points[-1]
    left = math.hypot(*to_goal)
    end = points[-1] + to_goal * (max(0.0, left - problem.goal_tolerance_xy) / left if left > 0 else 0.0)
    return _measured(np.vstack([problem.start[:2], points, end]), field)


def widest_way_through_unknown(problem: Problem) -> Way | None:
    """A way that is wide enough for the vehicle where unknown space is taken as free, if one is found."""
    if not avoids_unknown(problem):
        return None
    grid = _coarsened(problem.map, math.ceil(math.sqrt(problem.map.data.size / MOST_CELLS)))
    way = widest_way(replace(problem, map=grid, allow_unknown=True), ClearanceField(grid, allow_unknown=True))
    return way if way and way.radius >= problem.vehicle.inscribed_radius else None


def lattice_spacing(map: Map, field: ClearanceField) -> float:
    """The distance between the neighbours of the lattice on which the widest way is sought [m].

    Half a cell of a grid, if that is not too fine: such a lattice has the middles of all gaps between cells.
    """
    _, sides = _rectangle(map)
    finest = field.kernel.resolution / 2 if isinstance(map, GridMap) else 0.0
    return max(finest, math.sqrt(math.hypot(*sides[0]) * math.hypot(*sides[1]) / MOST_NODES))


class _Lattice:
    """A square lattice over the inside of a map."""

    def __init__(self, map: Map, field: ClearanceField):
        corner, sides = _rectangle(map)
        lengths = np.hypot(*sides.T)
        self._field = field
        self.spacing = lattice_spacing(map, field)
        self.columns, self.rows = (max(1, math.ceil(length / self.spacing - 1e-6) - 1) for length in lengths.tolist())
        self._steps = sides / lengths[:, None] * self.spacing
        self.along = self._steps[0].tolist()
        self.first = (corner + self._steps.sum(axis=0)).tolist()

    def points(self, nodes: np.ndarray) -> np.ndarray:
        """(n, 2) positions of nodes [m]."""
        return self.first + np.column_stack([nodes % self.columns, nodes // self.columns]) @ self._steps

    def nodes_at(self, point: Point, tolerance: float) -> np.ndarray:
        """The nodes within `tolerance` of a point, and those from where a short straight line that is free leads there."""
        reach = tolerance / self.spacing + 1
        column, row = (np.array(point) - self.first) @ self._steps.T / self.spacing**2
        rows, columns = (np.arange(max(0, math.ceil(at - reach)), min(n, math.floor(at + reach) + 1))
                         for at, n in ((row, self.rows), (column, self.columns)))
        nodes = (rows[:, None] * self.columns + columns).ravel()
        left = np.hypot(*(self.points(nodes) - point).T) - tolerance
        around = (left > 0) & (left <= self.spacing)
        around[around] = self._field.at(self.points(nodes[around])) > left[around]
        return nodes[around | (left <= 0)]


def _measured(corners: np.ndarray, field: ClearanceField) -> Way:
    """The way along straight lines; between two points s apart with clearances c and c' there is at least (c + c' - s) / 2."""
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    stations = np.union1d(at, np.linspace(0, at[-1], MEASURED))
    points = np.column_stack([np.interp(stations, at, corners[:, axis]) for axis in (0, 1)])
    clearance = field.at(points)
    radius = float(((clearance[1:] + clearance[:-1] - np.diff(stations)) / 2).min())
    return Way(points, radius, *_narrowest(corners, field.at(corners)))


def _narrowest(corners: np.ndarray, clearance: np.ndarray) -> tuple[float, Point]:
    """Width and position of the narrowest place: the middle of the first one, after which the flood need not avoid others."""
    as_narrow = clearance <= clearance.min() + ROUNDING
    first = int(np.argmax(as_narrow))
    length = int(np.argmin(np.append(as_narrow[first:], False)))
    return 2 * float(clearance.min()), tuple(corners[first + (length - 1) // 2].tolist())


def _coarsened(grid: GridMap, factor: int) -> GridMap:
    """The grid with blocks of `factor` x `factor` cells as cells, each as bad as the worst of them."""
    if factor == 1:
        return grid
    rows, columns = (np.arange(0, n, factor) for n in grid.data.shape)

    def any_of(cells):
        return np.logical_or.reduceat(np.logical_or.reduceat(cells, rows, axis=0), columns, axis=1)

    occupied, blocked = any_of(grid.blocked(True)), any_of(grid.blocked(False))
    for axis, n in enumerate(grid.data.shape):
        if n % factor:  # the last block reaches beyond the map
            np.moveaxis(occupied, axis, 0)[-1] = True
    data = np.where(occupied, OCCUPIED, np.where(blocked, UNKNOWN, FREE)).astype(np.int8)
    return GridMap(data, grid.resolution * factor, grid.origin, grid.name)


def _rectangle(map: Map) -> tuple[np.ndarray, np.ndarray]:
    """The lowest corner of a map and (2, 2) its sides from there."""
    corners = map.corners()
    return corners[0], corners[[1, 3]] - corners[0]


def _have_different_labels(problem: Problem, field: ClearanceField, labels: np.ndarray) -> bool:
    """Whether the label at the start is none of those within the goal's tolerance."""
    cells = field.cells(np.array([problem.start[:2], problem.goal[:2]]))
    (start_row, row), (start_column, column) = (indices.tolist() for indices in cells)
    # A window that holds all cells with a point within the tolerance.
    reach = math.ceil(problem.goal_tolerance_xy / field.kernel.resolution) + (problem.goal_tolerance_xy > 0)
    window = labels[max(0, row - reach):row + reach + 1, max(0, column - reach):column + reach + 1]
    return labels[start_row, start_column] not in window


def _are_in_different_parts(problem: Problem) -> bool:
    """Whether start and goal lie in different parts of a polygon map, which touch each other in points at most."""
    parts = shapely.get_parts(problem.map.free)
    of_start = parts[shapely.intersects(parts, shapely.Point(problem.start[:2]))]
    return bool((shapely.distance(of_start, shapely.Point(problem.goal[:2])) > problem.goal_tolerance_xy).all())
