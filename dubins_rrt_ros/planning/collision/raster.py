"""The raster under the clearance kernels: for each cell a lower bound of the clearance of all points in it.

A cell of a grid map is a cell of its raster; over polygons lies a raster of its own.
"""

import math
from functools import lru_cache

import numpy as np
import shapely
from scipy import ndimage

from .._kernels import COMPILED
from .._kernels.clearance import GridClearance, PolygonClearance
from .._kernels.distance import fill_columns, measure_row_gaps, reached_columns
from .._kernels.edge_raster import rasterise_edges
from ..maps.model import GridMap, PolygonMap

#: A sample of a curve is free with this much more than the required clearance [m]; it bounds the shortest step along the curve.
CLEARANCE_MARGIN = 0.0005
#: Approximate number of the raster's cells over polygons of few and of many edges, and number of edges from which they are many.
FEW_CELLS, MANY_CELLS, MANY_EDGES = (1_000_000, 2_300_000, 3_000) if COMPILED else (35_000, 35_000, 3_000)
#: Approximate maximum number of times that an edge touches a cell.
MAX_TOUCHED = 50_000_000 if COMPILED else 500_000
#: Maximum distance up to which tables of bounds are kept for the next map [cells].
KEPT = 1024
#: Number of columns without changes from which on what changes on either side is looked at apart, and share of the columns that
#: may differ from which on all are computed afresh.
APART, AFRESH = 64, 0.75
#: Distance between the rows that are looked at first: changes all over the map are found there, at a fraction of the cost.
FIRST_ROWS = 16


def grid_clearance(grid: GridMap, allow_unknown: bool, previous: GridClearance | None
                   ) -> tuple[GridClearance, list[slice] | None]:
    """Return the distances to the blocked cells of a grid.

    Args:
        grid: the cells.
        allow_unknown: True if unknown cells are free.
        previous: the distances of another grid; if that has the same shape and resolution, only what differs is computed.

    Returns:
        The distances, and the columns outside which they are those of `previous`; None where they were computed afresh.
    """
    free, cell, differs = ~grid.blocked(allow_unknown), grid.resolution, None
    if COMPILED and previous is not None and (previous.field.shape, previous.resolution) == (free.shape, cell):
        differs = _differing_columns(previous, free)
    if previous is not None and differs is not None:
        row_gap, bounds = _changed(previous, free, *differs)
    else:
        row_gap, bounds = _distances(free, cell)
    kernel = GridClearance(field=bounds, resolution=cell, origin=grid.origin, margin=CLEARANCE_MARGIN, row_gap=row_gap)
    return kernel, differs and differs[1]


def _distances(free: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the row gaps and the bounds."""
    if not COMPILED:
        return _by_scipy(free, cell)
    row_gap, bounds = np.empty(free.shape, np.int32), np.empty(free.shape, np.float32)
    measure_row_gaps(free.view(np.uint8), row_gap)
    _fill_columns(row_gap, bounds, cell, slice(0, free.shape[1]))
    return row_gap, bounds


def _fill_columns(row_gap: np.ndarray, bounds: np.ndarray, cell: float, columns: slice) -> None:
    """Compute the bounds in some columns from the row gaps."""
    farthest = min(int(row_gap[:, columns].max()) >> 2, (min(bounds.shape) + 1) // 2)
    table = _kept_bounds(1 << (farthest - 1).bit_length(), cell) if 0 < farthest <= KEPT else _bound_of_squared(farthest, cell)
    fill_columns(row_gap, columns.start, columns.stop, table, bounds)


@lru_cache(maxsize=4)
def _kept_bounds(farthest: int, cell: float) -> np.ndarray:
    """Return what `_bound_of_squared` does, for maps that change."""
    return _bound_of_squared(farthest, cell)


def _bound_of_squared(farthest: int, cell: float) -> np.ndarray:
    """Return the float32 bound for each squared distance in cells between centres, up to `farthest` cells."""
    between_centres = np.sqrt(np.arange(farthest**2 + 1)) * cell
    # From centre to centre, less half a diagonal for the square and half for the point anywhere in its cell.
    bounds = _rounded_down(between_centres - math.sqrt(2) * cell)
    bounds[0] = -1
    return bounds


def _differing_columns(kernel: GridClearance, free: np.ndarray) -> tuple[list[slice], list[slice]] | None:
    """Return the rows in which cells changed, and the columns in which bounds may; None where these are most of all columns."""
    row_gap, bounds, most = np.asarray(kernel.row_gap), np.asarray(kernel.field), AFRESH * free.shape[1]
    first = free[::FIRST_ROWS] != (row_gap[::FIRST_ROWS] != 0)
    if _width(_spans(first.any(axis=0))) > most:
        return None
    changes = free != (row_gap != 0)
    boxes = [(_rows(changes[:, columns]), columns) for columns in _spans(changes.any(axis=0))]
    reached = _united([slice(*reached_columns(bounds, kernel.resolution, rows.start, rows.stop, columns.start, columns.stop))
                       for rows, columns in boxes])
    return None if _width(reached) > most else ([rows for rows, _ in boxes], reached)


def _changed(kernel: GridClearance, free: np.ndarray, rows: list[slice], reached: list[slice]) -> tuple[np.ndarray, np.ndarray]:
    """Return the row gaps and the bounds where other cells are free, computed only in these rows and columns."""
    row_gap, bounds = np.asarray(kernel.row_gap), np.asarray(kernel.field)
    if rows:  # else nothing writes to them
        row_gap, bounds = row_gap.copy(), bounds.copy()
    for some in rows:
        measure_row_gaps(free[some].view(np.uint8), row_gap[some])
    for columns in reached:
        _fill_columns(row_gap, bounds, kernel.resolution, columns)
    return row_gap, bounds


def _spans(changed: np.ndarray) -> list[slice]:
    """Return slices that hold all columns that changed, (n,) bool; those with few columns between them share one."""
    columns = np.flatnonzero(changed)
    parts = np.split(columns, np.flatnonzero(np.diff(columns) > APART) + 1) if len(columns) else []
    return [slice(int(some[0]), int(some[-1]) + 1) for some in parts]


def _rows(changes: np.ndarray) -> slice:
    """Return the rows of changes from the first to the last."""
    rows = np.flatnonzero(changes.any(axis=1))
    return slice(int(rows[0]), int(rows[-1]) + 1)


def _width(columns: list[slice]) -> int:
    return sum(some.stop - some.start for some in columns)


def _united(slices: list[slice]) -> list[slice]:
    """Return slices, ordered by their starts, with those that overlap or touch made one."""
    united: list[slice] = []
    for one in sorted(slices, key=lambda one: int(one.start)):
        if united and one.start <= united[-1].stop:
            united[-1] = slice(united[-1].start, max(united[-1].stop, one.stop))
        else:
            united.append(one)
    return united


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
    row, column = np.divmod(np.flatnonzero(sticks_out), sticks_out.shape[1])
    return np.column_stack([column, row]) * cell


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
