"""Exact distance to the nearest obstacle, computed once per map; everything outside the map is an obstacle.

Guaranteed: a curve that `curve_is_free` accepts keeps the needed clearance everywhere, between samples too, and one that keeps
MARGIN more is always accepted (`_kernels/clearance.py` has the proof). The distances are those to the squares of occupied
cells, or to polygons, in double precision.
"""

import math
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from scipy import ndimage

from ._kernels.clearance import GridClearance, PolygonClearance
from .dubins import WORDS, DubinsCurve
from .map import GridMap, Map, PolygonMap
from .problem import Pose

#: A sample of a curve is free with this much more than the needed clearance [m]; it bounds the walk's shortest step.
MARGIN = 0.0005
#: About how many raster cells lie over a polygon map.
POLYGON_CELLS = 15_000

_fields: WeakKeyDictionary[Map, dict[bool, "ClearanceField"]] = WeakKeyDictionary()


class ClearanceField:
    """The distance from any point to the nearest obstacle.

    Attributes:
        kernel: the compiled field, for the planner's inner loop.
    """

    def __init__(self, map: Map, allow_unknown: bool = False):
        """Compute the field; `of` keeps one per map."""
        is_grid = isinstance(map, GridMap)
        self.kernel, self._origin = _grid_parts(map, allow_unknown) if is_grid else _polygon_parts(map)
        self._polygons = None if is_grid else map.free
        self._components: tuple[float, np.ndarray] | None = None

    @classmethod
    def of(cls, map: Map, allow_unknown: bool = False) -> "ClearanceField":
        """The field of a map, computed at the first call for as long as the map lives."""
        fields = _fields.setdefault(map, {})
        if allow_unknown not in fields:
            fields[allow_unknown] = cls(map, allow_unknown)
        return fields[allow_unknown]

    def at(self, points: np.ndarray) -> np.ndarray:
        """The exact clearance at (..., 2) points [m]; 0 in obstacles and outside the map."""
        points = np.asarray(points, dtype=float)
        out = np.empty(points.shape[:-1])
        self.kernel.distances(np.require(points.reshape(-1, 2), requirements="CW"), out.reshape(-1))
        if self._polygons is not None:  # whose kernel gives the distance to their edges from both sides
            out[~shapely.contains_xy(self._polygons, points[..., 0], points[..., 1])] = 0
        return out

    def curve_is_free(self, curve: DubinsCurve, need: float) -> bool:
        """Whether the clearance along a curve is nowhere below `need` [m]."""
        # The kernel's distance to polygons has no sign: what starts in free space stays there.
        if not self.at(np.array(curve.start[:2])) > 0:
            return False
        return self.kernel.is_curve_free(*curve.start, curve.radius, WORDS.index(curve.word), *curve.lengths, need)

    def cells(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the raster's cells that hold (..., 2) points of the map."""
        x, y, yaw = self._origin
        d = np.asarray(points, dtype=float) - (x, y)
        c, s = math.cos(yaw), math.sin(yaw)
        rows, columns = self.kernel.field.shape
        row = ((c * d[..., 1] - s * d[..., 0]) / self.kernel.resolution).astype(int)
        column = ((c * d[..., 0] + s * d[..., 1]) / self.kernel.resolution).astype(int)
        return np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)

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

    def _may_be_free(self, bounds: np.ndarray, need: float) -> np.ndarray:
        # The bound of a cell is at most two of its diagonals below the clearance of any point in it.
        return (bounds >= 0) & (bounds + np.float32(2 * math.sqrt(2) * self.kernel.resolution + 1e-6) >= need)


def _rounded_down(values: np.ndarray) -> np.ndarray:
    """float32 numbers that are not above `values`, none below 0."""
    return np.maximum(np.nextafter(values.astype(np.float32), np.float32(-np.inf)), 0)


def _grid_parts(grid: GridMap, allow_unknown: bool) -> tuple[GridClearance | PolygonClearance, Pose]:
    blocked = grid.blocked(allow_unknown)
    if blocked.any():
        between_centres = ndimage.distance_transform_edt(~blocked) * grid.resolution
    else:
        between_centres = np.full(blocked.shape, math.inf)
    between_centres = np.minimum(between_centres, _to_outer_centres(blocked.shape) * grid.resolution)
    # From centre to centre, less half a diagonal for the square and half for the point anywhere in its cell.
    field = _rounded_down(between_centres - math.sqrt(2) * grid.resolution)
    field[blocked] = -1
    kernel = GridClearance(field, grid.resolution, grid.origin, MARGIN, *_cells_to_blocked(blocked))
    return kernel, grid.origin


def _to_outer_centres(shape: tuple[int, int]) -> np.ndarray:
    """(rows, columns): how many cells the nearest cell outside the grid is away."""
    rows, columns = (np.minimum(np.arange(1, n + 1), np.arange(n, 0, -1)) for n in shape)
    return np.minimum(rows[:, None], columns[None, :])


def _cells_to_blocked(blocked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How many cells to the left and to the right of each cell the next blocked one in its row is, as int32."""
    columns = blocked.shape[1]
    index = np.arange(columns, dtype=np.int32)
    left = np.maximum.accumulate(np.where(blocked, index, np.int32(-columns)), axis=1)
    right = np.minimum.accumulate(np.where(blocked, index, np.int32(2 * columns))[:, ::-1], axis=1)[:, ::-1]
    return index - left, np.ascontiguousarray(right - index)


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
