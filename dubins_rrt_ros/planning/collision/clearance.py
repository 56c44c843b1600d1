"""Exact distance to the nearest obstacle, computed once per map; everything outside the map is an obstacle.

Guaranteed: along a curve that `curve_is_free` accepts the vehicle touches no obstacle anywhere, between samples too, and keeps a
quarter of MARGIN from them; a curve along which it keeps MARGIN (a disc) or sqrt(2) of that (a polygon) is always accepted.
`_kernels/clearance.py` and `_kernels/collision.py` have the proofs. The distances are those to the squares of occupied
cells, or to polygons, in double precision; nothing is rounded to cells.
"""

import copy
import math
from typing import NamedTuple

import numpy as np
import shapely
from scipy import ndimage

from .._kernels import COMPILED
from .._kernels.clearance import GridClearance, PolygonClearance
from .._kernels.collision import CollisionChecker, PolygonChecker
from .._kernels.cost_to_go import free_squares
from .._kernels.distance import fill_columns, measure_row_gaps
from ..curves.dubins import WORDS, DubinsCurve
from ..maps.model import GridMap, Map, PolygonMap
from ..problem import Pose
from ..vehicle import Vehicle
from .footprint import cover

#: A sample of a curve is free with this much more than the needed clearance [m]; it bounds the walk's shortest step.
MARGIN = 0.0005
#: About how many raster cells lie over a polygon map.
POLYGON_CELLS = 15_000
#: So many columns at a time are searched for cells that a change reaches.
STRIP = 64
#: The side of a free square is at most this share of the required clearance, so that walls do not vanish between squares ...
SQUARE_SHARE = 0.6
#: ... unless that makes more squares than about this many.
MAX_SQUARES = 270_000 if COMPILED else 4_000


class FreeSquares(NamedTuple):
    """Squares of the raster's cells that may hold a point with the required clearance.

    Attributes:
        cells: the side of a square in cells of the raster.
        is_free: (rows, columns) of squares, with a row and a column more on each side.
    """

    cells: int
    is_free: np.ndarray


class ClearanceField:
    """The distance from any point to the nearest obstacle.

    Attributes:
        kernel: the compiled field, for the planner's inner loop.
    """

    def __init__(self, map: Map, allow_unknown: bool = False, previous: "ClearanceField | None" = None):
        """Compute the distances.

        Where `previous` is the field of a grid of the same shape and resolution, only what depends on the cells that differ is
        computed; the result is the same as without it, and the previous field stays as it is.
        """
        is_grid = isinstance(map, GridMap)
        self.kernel, self._origin = _grid_parts(map, allow_unknown, previous) if is_grid else _polygon_parts(map)
        self._polygons = None if is_grid else map.free
        self._forget()

    def _forget(self) -> None:
        self._components: tuple[float, np.ndarray] | None = None
        self._free_squares: tuple[float, FreeSquares] | None = None

    def shared(self) -> "ClearanceField":
        """The same distances for another vehicle, whose components and free squares it keeps apart from these."""
        other = copy.copy(self)
        other._forget()
        return other

    def at(self, points: np.ndarray) -> np.ndarray:
        """The exact clearance at (..., 2) points [m]; 0 in obstacles and outside the map."""
        points = np.asarray(points, dtype=float)
        out = np.empty(points.shape[:-1])
        self.kernel.distances(np.require(points.reshape(-1, 2), requirements="CW"), out.reshape(-1))
        if self._polygons is not None:  # whose kernel gives the distance to their edges from both sides
            out[~shapely.contains_xy(self._polygons, points[..., 0], points[..., 1])] = 0
        return out

    def body(self, vehicle: Vehicle) -> CollisionChecker:
        """The vehicle's body on the map, for one thread."""
        if not vehicle.footprint:
            return CollisionChecker(self.kernel, vehicle.robot_radius)
        found = cover(vehicle.footprint)
        return PolygonChecker(self.kernel, vehicle.inscribed_radius, found.discs, found.corners, found.first_corner,
                           max(found.excess, 2 * MARGIN))

    def pose_is_free(self, pose: Pose, vehicle: Vehicle) -> bool:
        """Whether the vehicle touches no obstacle at a pose and keeps a margin of less than a millimetre."""
        # The kernel's distance to polygons has no sign.
        return bool(self.at(np.array(pose[:2])) > 0) and self.body(vehicle).is_free(*pose)

    def curve_is_free(self, curve: DubinsCurve, vehicle: Vehicle) -> bool:
        """Whether the vehicle touches no obstacle along a curve; see `_kernels/clearance.py` and `_kernels/collision.py`."""
        # What starts in free space stays there, as no edge is crossed.
        if not self.at(np.array(curve.start[:2])) > 0:
            return False
        return self.body(vehicle).is_curve_free(*curve.start, curve.radius, WORDS.index(curve.word), *curve.lengths)

    def cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the raster's cells that hold (..., 2) points of the map."""
        x, y, yaw = self._origin
        d = np.asarray(points, dtype=float) - (x, y)
        c, s = math.cos(yaw), math.sin(yaw)
        rows, columns = self.kernel.field.shape
        row = ((c * d[..., 1] - s * d[..., 0]) / self.kernel.resolution).astype(int)
        column = ((c * d[..., 0] + s * d[..., 1]) / self.kernel.resolution).astype(int)
        return np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)

    def in_map_frame(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) points of the map's frame [m] at points of the raster's, whose origin is the corner of its first cell."""
        x, y, yaw = self._origin
        c, s = math.cos(yaw), math.sin(yaw)
        return np.stack([x + c * points[..., 0] - s * points[..., 1], y + s * points[..., 0] + c * points[..., 1]], axis=-1)

    def may_be_free(self, points: np.ndarray, need: float) -> np.ndarray:
        """(n,) bool: whether the cells that hold (n, 2) points of the map are among the `possibly_free` ones."""
        return self._may_be_free(np.asarray(self.kernel.field)[self.cells(points)], need)

    def possibly_free(self, need: float) -> np.ndarray:
        """(rows, columns) bool: a superset of the raster's cells that hold a point with a clearance of at least `need` [m]."""
        return self._may_be_free(np.asarray(self.kernel.field), need)

    def components(self, need: float) -> np.ndarray:
        """(rows, columns) int32: the connected components of the `possibly_free` cells, from 1 on, 0 elsewhere.

        Kept for the last `need`, since the requests of one vehicle ask for the same.
        """
        kept = self._components
        if kept is None or kept[0] != need:
            self._components = kept = need, ndimage.label(self.possibly_free(need), structure=np.ones((3, 3)))[0]
        return kept[1]

    def free_squares(self, need: float) -> FreeSquares:
        """The squares that may hold a point with a clearance of at least `need` [m]; kept for the last `need`."""
        kept = self._free_squares
        if kept is None or kept[0] != need:
            cells = _cells_of_square(self.kernel.field.shape, SQUARE_SHARE * need / self.kernel.resolution)
            self._free_squares = kept = need, FreeSquares(cells, free_squares(self.kernel, cells, need))
        return kept[1]

    def _may_be_free(self, bounds: np.ndarray, need: float) -> np.ndarray:
        # The bound of a cell is at most two of its diagonals below the clearance of any point in it.
        return bounds >= max(0.0, need - 2 * math.sqrt(2) * self.kernel.resolution - 1e-6)


def _cells_of_square(shape: tuple[int, int], wish: float) -> int:
    """How many cells of the raster make a side of a free square."""
    return max(1, math.floor(wish), math.ceil(math.sqrt(shape[0] * shape[1] / MAX_SQUARES)))


def _rounded_down(values: np.ndarray) -> np.ndarray:
    """float32 numbers that are not above `values`, none below 0."""
    return np.maximum(np.nextafter(values.astype(np.float32), np.float32(-np.inf)), 0)


def _grid_parts(grid: GridMap, allow_unknown: bool,
                previous: "ClearanceField | None") -> tuple[GridClearance | PolygonClearance, Pose]:
    free, cell = ~grid.blocked(allow_unknown), grid.resolution
    if not COMPILED:
        row_gap, field = _by_scipy(free, cell)
    elif (previous is not None and isinstance(previous.kernel, GridClearance)
          and (previous.kernel.field.shape, previous.kernel.resolution) == (free.shape, cell)):
        row_gap, field = _changed(previous.kernel, free)
    else:
        row_gap, field = np.empty(free.shape, np.int32), np.empty(free.shape, np.float32)
        _fill(row_gap, field, free, cell, *(slice(0, n) for n in free.shape))
    return GridClearance(field, cell, grid.origin, MARGIN, row_gap), grid.origin


def _fill(row_gap: np.ndarray, field: np.ndarray, free: np.ndarray, cell: float, rows: slice, columns: slice) -> None:
    """Compute `row_gap` in some rows, and with it the field in some columns."""
    measure_row_gaps(free[rows].view(np.uint8), row_gap[rows])
    farthest = min(int(row_gap[:, columns].max()) >> 2, (min(free.shape) + 1) // 2)
    fill_columns(row_gap, columns.start, columns.stop, _bounds(farthest, cell), field)


def _bounds(farthest: int, cell: float) -> np.ndarray:
    """float32: what the field holds for each squared distance in cells between centres, up to `farthest` cells."""
    between_centres = np.sqrt(np.arange(farthest**2 + 1)) * cell
    # From centre to centre, less half a diagonal for the square and half for the point anywhere in its cell.
    bounds = _rounded_down(between_centres - math.sqrt(2) * cell)
    bounds[0] = -1
    return bounds


def _changed(kernel: GridClearance, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`row_gap` and the field where other cells are free, computed afresh only where these matter."""
    row_gap, field = np.asarray(kernel.row_gap), np.asarray(kernel.field)
    changes = free != (row_gap != 0)
    if not changes.any():
        return row_gap, field  # which nothing writes to
    rows, columns = (slice(n[0], n[-1] + 1) for n in (np.flatnonzero(changes.any(axis=axis)) for axis in (1, 0)))
    reached = _reached(field, kernel.resolution, rows, columns)
    row_gap, field = row_gap.copy(), field.copy()
    _fill(row_gap, field, free, kernel.resolution, rows, reached)
    return row_gap, field


def _reached(field: np.ndarray, cell: float, rows: slice, columns: slice) -> slice:
    """Columns with all cells that may lie as far from their nearest obstacle as from a box of cells.

    The distance of no other cell changes with the box. The straight way from such a cell to the box holds only points like it,
    since neither distance falls by more than the way is long. In each column that it crosses there is a cell at most half a cell
    off it, for which they compare the same to within a cell. So beyond columns without such cells there are none.
    """
    beyond_rows, beyond_columns = (np.maximum(np.maximum(box.start - n, n - box.stop + 1), 0)
                                   for box, n in zip((rows, columns), map(np.arange, field.shape), strict=True))

    def is_reached(strip: slice) -> bool:
        # A cell for what is said above, sqrt(2) for what the field is lower by, and the rest for rounding.
        at_most = np.maximum(field[:, strip], 0) / cell + 2.5
        return bool((at_most**2 >= beyond_rows[:, None]**2 + beyond_columns[strip]**2).any())

    first, last = columns.start, columns.stop
    while first > 0 and is_reached(slice(max(0, first - STRIP), first)):
        first = max(0, first - STRIP)
    while last < field.shape[1] and is_reached(slice(last, last + STRIP)):
        last = min(field.shape[1], last + STRIP)
    return slice(first, last)


def _by_scipy(free: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """`row_gap` and the field, for where the kernels are interpreted: they would take minutes for a large map."""
    columns = free.shape[1]
    index = np.arange(columns, dtype=np.int32)
    left = index - np.maximum.accumulate(np.where(free, np.int32(-1), index), axis=1)
    right = np.minimum.accumulate(np.where(free, np.int32(columns), index)[:, ::-1], axis=1)[:, ::-1] - index
    row_gap = 4 * np.minimum(left, right) + (left > right) + 2 * (right > left)
    squared = np.rint(ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]**2).astype(int)
    return np.ascontiguousarray(row_gap, np.int32), _bounds(math.isqrt(squared.max()) + 1, cell)[squared]


def _polygon_parts(polygons: PolygonMap) -> tuple[GridClearance | PolygonClearance, Pose]:
    x0, y0, x1, y1 = shapely.bounds(polygons.free)
    cell = math.sqrt((x1 - x0) * (y1 - y0) / POLYGON_CELLS)
    columns, rows = (max(1, math.ceil(side / cell)) for side in (x1 - x0, y1 - y0))
    centre_x, centre_y = np.meshgrid(x0 + (np.arange(columns) + 0.5) * cell, y0 + (np.arange(rows) + 0.5) * cell)
    centres = shapely.points(centre_x.ravel(), centre_y.ravel())
    edges = _edges(polygons.free)
    tree = shapely.STRtree(shapely.linestrings(edges.reshape(-1, 2, 2)))
    _, distance = tree.query_nearest(centres, all_matches=False, return_distance=True)
    half_diagonal = cell / math.sqrt(2)
    # Only an edge that is at most a diagonal farther from the centre than the nearest can be nearest to a point of the cell.
    of_cell, edge = tree.query(centres, predicate="dwithin", distance=distance + 2 * half_diagonal * (1 + 1e-9))
    order = np.argsort(of_cell, kind="stable")
    first = np.searchsorted(of_cell[order], np.arange(rows * columns + 1))
    field = _rounded_down(distance - half_diagonal)
    field[~shapely.contains_xy(polygons.free, centre_x.ravel(), centre_y.ravel()) & (distance > half_diagonal)] = -1
    origin = (x0, y0, 0.0)
    kernel = PolygonClearance(field.reshape(rows, columns), cell, origin, MARGIN, edges - np.array([x0, y0, x0, y0]),
                              first.astype(np.int64), edge[order].astype(np.int32))
    return kernel, origin


def _edges(polygons: shapely.Geometry) -> np.ndarray:
    """(m, 4) float64: x, y, x, y of the edges of all rings."""
    rings = shapely.get_rings(shapely.get_parts(polygons))
    edges = np.concatenate([np.hstack([ring[:-1], ring[1:]]) for ring in map(shapely.get_coordinates, rings)])
    return edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)]
