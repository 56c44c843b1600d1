"""The raster under the clearance kernels: for each cell a lower bound of the clearance of all points in it.

A cell of a grid map is a cell of its raster; over polygons lies a raster of its own.
"""

import math

import numpy as np
import shapely
from scipy import ndimage

from .._kernels import COMPILED
from .._kernels.clearance import GridClearance, PolygonClearance
from .._kernels.distance import fill_columns, measure_row_gaps
from .._kernels.edge_raster import rasterise_edges
from ..maps.model import GridMap, PolygonMap

#: A sample of a curve is free with this much more than the required clearance [m]; it bounds the shortest step along the curve.
CLEARANCE_MARGIN = 0.0005
#: Approximate number of the raster's cells over polygons of few and of many edges, and number of edges from which they are many.
FEW_CELLS, MANY_CELLS, MANY_EDGES = (1_000_000, 2_300_000, 3_000) if COMPILED else (35_000, 35_000, 3_000)
#: Approximate maximum number of times that an edge touches a cell.
MAX_TOUCHED = 50_000_000 if COMPILED else 500_000
#: Number of columns at a time that are searched for cells that a change reaches.
STRIP = 64


def grid_clearance(grid: GridMap, allow_unknown: bool, previous: GridClearance | None) -> GridClearance:
    """Return the distances to the blocked cells of a grid.

    Args:
        grid: the cells.
        allow_unknown: True if unknown cells are free.
        previous: the distances of another grid; if that has the same shape and resolution, only what differs is computed.
    """
    free, cell = ~grid.blocked(allow_unknown), grid.resolution
    if COMPILED and previous is not None and (previous.field.shape, previous.resolution) == (free.shape, cell):
        row_gap, bounds = _changed(previous, free)
    else:
        row_gap, bounds = _distances(free, cell)
    return GridClearance(field=bounds, resolution=cell, origin=grid.origin, margin=CLEARANCE_MARGIN, row_gap=row_gap)


def _distances(free: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the row gaps and the bounds."""
    if not COMPILED:
        return _by_scipy(free, cell)
    row_gap, bounds = np.empty(free.shape, np.int32), np.empty(free.shape, np.float32)
    _fill(row_gap, bounds, free, cell, *(slice(0, n) for n in free.shape))
    return row_gap, bounds


def _fill(row_gap: np.ndarray, bounds: np.ndarray, free: np.ndarray, cell: float, rows: slice, columns: slice) -> None:
    """Compute the row gaps in some rows, and with them the bounds in some columns."""
    measure_row_gaps(free[rows].view(np.uint8), row_gap[rows])
    farthest = min(int(row_gap[:, columns].max()) >> 2, (min(free.shape) + 1) // 2)
    fill_columns(row_gap, columns.start, columns.stop, _bound_of_squared(farthest, cell), bounds)


def _bound_of_squared(farthest: int, cell: float) -> np.ndarray:
    """Return the float32 bound for each squared distance in cells between centres, up to `farthest` cells."""
    between_centres = np.sqrt(np.arange(farthest**2 + 1)) * cell
    # From centre to centre, less half a diagonal for the square and half for the point anywhere in its cell.
    bounds = _rounded_down(between_centres - math.sqrt(2) * cell)
    bounds[0] = -1
    return bounds


def _changed(kernel: GridClearance, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the row gaps and the bounds where other cells are free, computed afresh only where these matter."""
    row_gap, bounds = np.asarray(kernel.row_gap), np.asarray(kernel.field)
    changes = free != (row_gap != 0)
    if not changes.any():
        return row_gap, bounds  # which nothing writes to
    rows, columns = (slice(n[0], n[-1] + 1) for n in (np.flatnonzero(changes.any(axis=axis)) for axis in (1, 0)))
    reached = _reached(bounds, kernel.resolution, rows, columns)
    row_gap, bounds = row_gap.copy(), bounds.copy()
    _fill(row_gap, bounds, free, kernel.resolution, rows, reached)
    return row_gap, bounds


def _reached(bounds: np.ndarray, cell: float, rows: slice, columns: slice) -> slice:
    """Return the columns with all cells that may lie as far from their nearest obstacle as from a box of cells.

    The distance of no other cell changes with the box. The straight way from such a cell to the box holds only points like it,
    since neither distance falls by more than the way is long. In each column that it crosses there is a cell at most half a cell
    off it, for which they compare the same to within a cell. So beyond columns without such cells there are none.
    """
    beyond_rows, beyond_columns = (np.maximum(np.maximum(box.start - n, n - box.stop + 1), 0)
                                   for box, n in zip((rows, columns), map(np.arange, bounds.shape), strict=True))

    def is_reached(strip: slice) -> bool:
        # A cell for what is said above, sqrt(2) for what the bounds are lower by, and the rest for rounding.
        at_most = np.maximum(bounds[:, strip], 0) / cell + 2.5
        return bool((at_most**2 >= beyond_rows[:, None]**2 + beyond_columns[strip]**2).any())

    first, last = columns.start, columns.stop
    while first > 0 and is_reached(slice(max(0, first - STRIP), first)):
        first = max(0, first - STRIP)
    while last < bounds.shape[1] and is_reached(slice(last, last + STRIP)):
        last = min(bounds.shape[1], last + STRIP)
    return slice(first, last)


def _by_scipy(free: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the row gaps and the bounds; interpreted kernels would take minutes for a large map."""
    columns = free.shape[1]
    index = np.arange(columns, dtype=np.int32)
    left = index - np.maximum.accumulate(np.where(free, np.int32(-1), index), axis=1)
    right = np.minimum.accumulate(np.where(free, np.int32(columns), index)[:, ::-1], axis=1)[:, ::-1] - index
    row_gap = 4 * np.minimum(left, right) + (left > right) + 2 * (right > left)
    squared = np.rint(ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]**2).astype(int)
    return np.ascontiguousarray(row_gap, np.int32), _bound_of_squared(math.isqrt(squared.max()) + 1, cell)[squared]


def grid_corners(blocked: np.ndarray, cell: float) -> np.ndarray:
    """Return (n, 2) float64: x and y of the corners of blocked cells that stick out, from the grid's corner on [m].

    Those are the nodes between cells around which a blocked one has no blocked neighbour beside it.
    """
    padded = np.pad(blocked, 1, constant_values=True)
    low, high = padded[:-1], padded[1:]
    a, b, c, d = low[:, :-1], low[:, 1:], high[:, :-1], high[:, 1:]
    sticks_out = ((a | d) & ~b & ~c) | ((b | c) & ~a & ~d)
    return np.argwhere(sticks_out)[:, ::-1] * cell


def polygon_clearance(polygons: PolygonMap) -> PolygonClearance:
    """Return the distances to the edges of polygons; as for a grid, with the cells that an edge touches as obstacles."""
    x0, y0, x1, y1 = shapely.bounds(polygons.free).tolist()
    edges = _edges(polygons.free) - np.array([x0, y0, x0, y0])
    cell = _cell_side(x1 - x0, y1 - y0, edges)
    columns, rows = (max(1, math.ceil(side / cell)) for side in (x1 - x0, y1 - y0))
    touched, inside = rasterise_edges(edges, cell, rows, columns)
    _, bounds = _distances(inside.view(bool), cell)
    bounds[touched.view(bool)] = 0
    return PolygonClearance(field=bounds, resolution=cell, origin=(x0, y0, 0.0), margin=CLEARANCE_MARGIN, edges=edges)


def _cell_side(width: float, height: float, edges: np.ndarray) -> float:
    """Return the side of the raster's cells over polygons [m]; in proportion to their size, so that scale makes no difference."""
    cells = FEW_CELLS if len(edges) < MANY_EDGES else MANY_CELLS
    crossed = float(np.abs(edges[:, :2] - edges[:, 2:]).sum())
    return max(math.sqrt(width / cells * height), max(width, height) / cells, crossed / MAX_TOUCHED)


def _edges(polygons: shapely.Geometry) -> np.ndarray:
    """Return (m, 4) float64: x, y, x, y of the edges of all rings."""
    rings = shapely.get_rings(shapely.get_parts(polygons))
    edges = np.concatenate([np.hstack([ring[:-1], ring[1:]]) for ring in map(shapely.get_coordinates, rings)])
    proper: np.ndarray = edges[(edges[:, :2] != edges[:, 2:]).any(axis=1)]
    return proper


def _rounded_down(values: np.ndarray) -> np.ndarray:
    """Return float32 numbers that are not above `values`, none below 0."""
    lower: np.ndarray = np.maximum(np.nextafter(values.astype(np.float32), np.float32(-np.inf)), 0)
    return lower
