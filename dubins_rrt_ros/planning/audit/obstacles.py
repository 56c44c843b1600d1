"""The obstacles' true shapes, for the audit: the distances of points, and of polygons along a path, from them.

For a grid they are the squares of its blocked cells and what is outside of it, for polygons what is outside of them.
"""

import math
from collections.abc import Callable

import numpy as np
import shapely

from ..maps.model import GridMap, Map

#: Number of cells around a point within which obstacles are sought at first.
FIRST_REACH = 8
#: Least margin [cells] around the square tiles in which cells are read, and the side of a tile in margins.
MARGIN, TILE = 64, 8
#: Approximate number of rows of cells that are searched at once, for the sake of memory.
ROWS_AT_ONCE = 1_000_000
#: Side of the squares in which cells along the path of a polygon are read [cells].
BLOCK = 32
#: Least distance within which shapes are sought, which must not be 0.
TINY = 1e-12
#: Number of runs of blocks that are read at once.
RUNS_AT_ONCE = 64


class PolygonObstacles:
    """The outside of polygons."""

    def __init__(self, free: shapely.Geometry):
        self._free = free
        shapely.prepare(free)  # each audit asks it for many points
        #: Distances are exact up to here [m].
        self.reach = math.inf
        corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(free)), return_index=True)
        edges = np.stack([corners[:-1], corners[1:]], axis=1)[ring[:-1] == ring[1:]]
        self._tree = shapely.STRtree(shapely.linestrings(edges))

    def distance(self, x: np.ndarray, y: np.ndarray, reach: float = math.inf) -> np.ndarray:
        """Return the distances of points from the obstacles [m]; 0 in one, and never more than `reach` [m]."""
        inside = shapely.contains_xy(self._free, x, y)
        out = np.zeros(len(x))
        out[inside] = _to_nearest(self._tree, shapely.points(x[inside], y[inside]), reach)
        return out

    def shape_distance(self, corners: np.ndarray, hull: bool = False, reach: float = math.inf) -> np.ndarray:
        """Return the distances of polygons, or of their convex hulls, from the obstacles: 0 where they meet, at most `reach`.

        Args:
            corners: (n, c) complex, x + iy [m].
            hull: True for the convex hulls of the corners.
            reach: maximum distance that matters [m]; it takes much less time where there is nothing as near as that.
        """
        # Where no edge is in a shape, all of it is on the side of the edges that its first corner is on.
        inside = shapely.contains_xy(self._free, corners[:, 0].real, corners[:, 0].imag)
        out = np.zeros(len(corners))
        out[inside] = _to_nearest(self._tree, _shapes(corners[inside], hull), reach)
        return out

    def near_path(self, points: np.ndarray, margin: float, reach: float, check_time: Callable[[], None] | None = None
                  ) -> "PolygonObstacles":
        """Return obstacles that hold those near points of a path, as `GridObstacles` does: all of them."""
        return self


class GridObstacles:
    """The squares of a grid's blocked cells, and what is outside the grid. Only cells near the points asked for are read."""

    def __init__(self, grid: GridMap, allow_unknown: bool):
        self.grid = grid
        self._data, self._resolution, self._origin = grid.data, grid.resolution, grid.origin
        self._thresholds, self._allow_unknown = grid.thresholds, allow_unknown
        self._windows: dict[tuple[int, complex], _Window] = {}

    def distance(self, x: np.ndarray, y: np.ndarray, reach: float = math.inf) -> np.ndarray:
        """Return the distances of points from the obstacles [m]; 0 in one, `reach` [m] where there is none within reach."""
        x0, y0, yaw = self._origin
        rows, columns = self._data.shape
        place = (x - x0 + 1j * (y - y0)) * np.exp(-1j * yaw) / self._resolution
        to_edge = np.minimum(np.minimum(place.real, columns - place.real), np.minimum(place.imag, rows - place.imag))
        out = np.clip(to_edge, 0.0, reach / self._resolution)
        cells, undecided = FIRST_REACH, np.flatnonzero(out)
        while len(undecided):
            out[undecided] = np.minimum(out[undecided], self._within(cells, place[undecided]))
            undecided = undecided[out[undecided] >= cells]
            if cells >= reach / self._resolution:
                break
            cells *= 4
        distances: np.ndarray = out * self._resolution
        return distances

    def near_path(self, points: np.ndarray, margin: float, reach: float, check_time: Callable[[], None] | None = None
                  ) -> "PathsideSquares":
        """Return the obstacles within margin and reach of points of a path, as `PathsideSquares` takes them."""
        return PathsideSquares(self.grid, self._allow_unknown, points, margin, reach, check_time)

    def _within(self, reach: int, place: np.ndarray) -> np.ndarray:
        """Return the distances of points in the grid from blocked cells, in cells; infinity from `reach` on."""
        margin = max(MARGIN, reach)
        side = TILE * margin
        tiles = place.real // side + 1j * (place.imag // side)
        out = np.empty(len(place))
        at_once = max(1, ROWS_AT_ONCE // reach)
        for tile in set(tiles.tolist()):
            if (margin, tile) not in self._windows:
                self._windows[margin, tile] = self._window(side * tile, side, margin)
            here = np.flatnonzero(tiles == tile)
            for first in range(0, len(here), at_once):
                some = here[first:first + at_once]
                out[some] = self._windows[margin, tile].distance(place[some], reach)
        return np.where(out < reach, out, math.inf)

    def _window(self, corner: complex, side: int, margin: int) -> "_Window":
        """Return the cells of a square tile and those within the margin around it."""
        left, low = max(0, int(corner.real) - margin), max(0, int(corner.imag) - margin)
        part = self._data[low:int(corner.imag) + side + margin, left:int(corner.real) + side + margin]
        return _Window(self._thresholds.blocked(part, self._allow_unknown), left, low)


class _Window:
    """The blocked cells of a part of a grid.

    Args:
        blocked: (rows, columns) bool.
        left, low: the column and the row of the grid where the part begins.
    """

    def __init__(self, blocked: np.ndarray, left: int, low: int):
        self._rows = np.flatnonzero(blocked.any(axis=1))
        # With blocked columns on both sides every cell has a blocked one before and after it in its row.
        blocked = np.pad(blocked[self._rows], ((0, 0), (1, 1)), constant_values=True)
        self._width = blocked.shape[1]
        self._cells = np.flatnonzero(blocked)
        self._left, self._low = left - 1, low

    def distance(self, place: np.ndarray, reach: int) -> np.ndarray:
        """Return the distances of points from the blocked cells, in cells; exact below `reach`, at least `reach` elsewhere.

        In each row within reach that holds blocked cells, the next ones to the left and to the right are looked up.
        """
        if not len(self._rows):
            return np.full(len(place), math.inf)
        x, y = (place.real - self._left)[:, None], (place.imag - self._low)[:, None]
        to_either_side = min(reach, len(self._rows))
        row = np.searchsorted(self._rows, y.astype(int)) + np.arange(-to_either_side, to_either_side + 1)
        row = np.minimum(np.maximum(row, 0), len(self._rows) - 1)
        begin = row * self._width
        following = np.searchsorted(self._cells, begin + x.astype(int))
        sideways = np.minimum(self._cells[following] - begin - x, x - (self._cells[following - 1] - begin) - 1)
        above = np.maximum(self._rows[row] - y, y - self._rows[row] - 1)
        return np.asarray(np.sqrt((np.maximum(sideways, 0)**2 + np.maximum(above, 0)**2).min(axis=1)))


class PathsideSquares:
    """The squares of a grid's blocked cells along a path, and what is outside the grid, for shapes that move along the path.

    Args:
        points: of the path, x + iy [m].
        margin: maximum distance of a shape's points from the nearest of those points [m].
        reach: maximum distance from a shape at which obstacles matter [m]; cells beyond margin and reach are not read.
        check_time: called every few milliseconds; what it raises ends the reading of cells.
    """

    def __init__(self, grid: GridMap, allow_unknown: bool, points: np.ndarray, margin: float, reach: float,
                 check_time: Callable[[], None] | None = None):
        self._grid = grid
        near = self._blocks_near(points, (margin + reach) / grid.resolution)
        #: Distances are exact up to here, and never more [m].
        self.reach = math.inf if near.all() else reach
        runs = BLOCK * _runs(near)
        rectangles = [np.empty((0, 4), int)]
        for begin in range(0, len(runs), RUNS_AT_ONCE):
            if check_time:
                check_time()
            rectangles.append(self._rectangles_in(runs[begin:begin + RUNS_AT_ONCE], allow_unknown))
        self._tree = shapely.STRtree(shapely.box(*np.concatenate(rectangles).T))

    def shape_distance(self, corners: np.ndarray, hull: bool = False, reach: float = math.inf) -> np.ndarray:
        """Return the distances of polygons, or of their convex hulls, from the obstacles: 0 where they meet, at most `reach`.

        Args:
            corners: (n, c) complex, x + iy [m].
            hull: True for the convex hulls of the corners.
            reach: maximum distance that matters [m], at most that of all obstacles along the path; it takes much less time where
                there is nothing as near as that.
        """
        reach = min(reach, self.reach)
        place = self._place(corners)
        rows, columns = self._grid.data.shape
        to_edge = np.min([place.real, columns - place.real, place.imag, rows - place.imag], axis=(0, 2))
        out = np.where(to_edge > 0, to_edge, 0.0)
        inside = np.flatnonzero(out)
        if len(self._tree):
            shapes = _shapes(place[inside], hull)
            out[inside] = np.minimum(out[inside], _to_nearest(self._tree, shapes, reach / self._grid.resolution))
        return np.minimum(out * self._grid.resolution, reach)

    def _rectangles_in(self, runs: np.ndarray, allow_unknown: bool) -> np.ndarray:
        """Return rectangles as `_rectangles` does, of the cells in runs of blocks, which are laid side by side for it."""
        data = self._grid.data
        width = runs[:, 2] - runs[:, 1] + 1  # with a free column that keeps it apart from the next
        begin = np.cumsum(width) - width
        cells = np.zeros((BLOCK, int(width.sum())), bool)
        for (row, first, end), at in zip(runs.tolist(), begin.tolist(), strict=True):
            part = self._grid.thresholds.blocked(data[row:row + BLOCK, first:end], allow_unknown)
            cells[:part.shape[0], at:at + part.shape[1]] = part
        rectangles = _rectangles(cells)
        run = np.searchsorted(begin, rectangles[:, 0], side="right") - 1
        across, along = runs[run, 0], runs[run, 1] - begin[run]
        return np.asarray(rectangles + np.column_stack([along, across, along, across]))

    def _place(self, points: np.ndarray) -> np.ndarray:
        """Return points in the grid's own frame, in cells."""
        x, y, yaw = self._grid.origin
        place: np.ndarray = (points - complex(x, y)) * np.exp(-1j * yaw) / self._grid.resolution
        return place

    def _blocks_near(self, points: np.ndarray, distance: float) -> np.ndarray:
        """Return which blocks of the grid hold everything within a distance of points, in cells."""
        near = np.zeros([-(-cells // BLOCK) for cells in self._grid.data.shape], bool)
        place = self._place(points) / BLOCK
        # A point outside the grid may count as one at its edge: there the shape meets an obstacle wherever the cells are.
        blocks = np.clip(np.column_stack([place.imag, place.real]), 0, np.array(near.shape) - 1).astype(int)
        around = math.ceil(min(distance / BLOCK, max(near.shape)))
        for row, column in np.unique(blocks, axis=0).tolist():
            near[max(0, row - around):row + around + 1, max(0, column - around):column + around + 1] = True
        return near


def _runs(cells: np.ndarray) -> np.ndarray:
    """Return (n, 3) row, first column and the column after the last, of the runs of True along the rows of an array."""
    padded = np.pad(cells, ((0, 0), (1, 1)))
    changes = padded[:, 1:] != padded[:, :-1]
    row, column = np.divmod(np.flatnonzero(changes), changes.shape[1])  # np.nonzero of two dimensions takes several times as long
    return np.column_stack([row[::2], column[::2], column[1::2]])


def _rectangles(cells: np.ndarray) -> np.ndarray:
    """Return (n, 4) first column, first row, and those after the last, of rectangles that cover the cells that are True.

    They are the runs along rows; equal runs in successive rows are one rectangle.
    """
    row, first, end = _runs(cells).T
    order = np.lexsort((row, end, first))
    row, first, end = row[order], first[order], end[order]
    begins = np.ones(len(row), bool)
    begins[1:] = (np.diff(first) != 0) | (np.diff(end) != 0) | (np.diff(row) != 1)
    return np.column_stack([first[begins], row[begins], end[begins], row[np.roll(begins, -1)] + 1])


def _shapes(corners: np.ndarray, hull: bool) -> np.ndarray:
    """Return the polygons with (n, c) complex corners, or their convex hulls."""
    coordinates = np.stack([corners.real, corners.imag], axis=-1)
    return np.asarray(shapely.convex_hull(shapely.linestrings(coordinates)) if hull else shapely.polygons(coordinates))


def _to_nearest(tree: shapely.STRtree, shapes: np.ndarray, reach: float) -> np.ndarray:
    """Return the distances of shapes from the nearest one in a tree, at most `reach`."""
    out = np.full(len(shapes), reach)
    (found, _), distance = tree.query_nearest(shapes, max_distance=None if reach == math.inf else max(reach, TINY),
                                              return_distance=True, all_matches=False)
    out[found] = np.minimum(distance, reach)
    return out


Obstacles = GridObstacles | PolygonObstacles


def obstacles_of(world_map: Map, allow_unknown: bool) -> Obstacles:
    """Return the obstacles of a map; they keep what they have read of it, for the next path on it."""
    return GridObstacles(world_map, allow_unknown) if isinstance(world_map, GridMap) else PolygonObstacles(world_map.free)
