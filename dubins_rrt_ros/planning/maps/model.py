"""Free and occupied space, from a grid or from polygons. Everything outside a map is an obstacle."""

import hashlib
import math
import warnings as python_warnings
from collections.abc import Iterable
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely

from ..option import own_floats, plain_float
from ..pictures import Plottable, check_matplotlib
from ..text import quoted
from .cells import FREE, OCCUPIED, check_meaning, checked_cells
from .errors import MapError, MapMetadataError
from .frame import LARGEST_YAW, DoubtfulYaw, Frame, doubt_about_yaw
from .free_space import MIN_SIDE, Shape, check_size, doubt_about_outside, free_space, polygon_of, polygons_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Thresholds(NamedTuple):
    """The meaning of the values of cells, on the scale of nav_msgs/OccupancyGrid; by default what map_server's 0.25 and 0.65 do.

    Attributes:
        free_up_to: maximum value of a free cell [%].
        occupied_from: minimum value of an occupied cell [%]; between the two a cell is unknown.
        between_is_free: True if cells between the two are free, and have a cost, their value.
    """

    free_up_to: int = 25
    occupied_from: int = 65
    between_is_free: bool = False

    @classmethod
    def of_fractions(cls, free_thresh: float, occupied_thresh: float) -> "Thresholds":
        """Take map_server's fractions, both inclusive."""
        return cls(math.floor(100 * free_thresh + 1e-9), math.ceil(100 * occupied_thresh - 1e-9))

    def meaning(self, value: int) -> str:
        """Return what a cell's value means: free, occupied or unknown."""
        return "occupied" if value >= self.occupied_from else "free" if 0 <= value <= self._greatest_free else "unknown"

    @property
    def _greatest_free(self) -> int:
        return self.occupied_from - 1 if self.between_is_free else self.free_up_to

    def blocked(self, data: np.ndarray, allow_unknown: bool) -> np.ndarray:
        """Return (height, width) bool: which cells of a grid's data are obstacles."""
        if allow_unknown:
            return np.asarray(data >= self.occupied_from)
        return np.asarray((data > self._greatest_free) | (data < 0))

    def between(self, data: np.ndarray) -> np.ndarray:
        """Return (height, width) bool: which cells of a grid's data are neither free nor occupied by the two limits."""
        return np.asarray((data > self.free_up_to) & (data < self.occupied_from))


DEFAULT_THRESHOLDS = Thresholds()

#: Smallest side of a cell and largest coordinate [m] that leave rounding far below what the planner guarantees.
FINEST, FARTHEST = 1e-4, 1e8


class DoubtfulObstacles(UserWarning):
    """A warning: obstacles outside of the bounds, which have no effect, as in another frame or unit."""


class _PlottableMap(Plottable):
    """A base of maps, with their pictures."""

    def plot(self: "Map", ax: "Axes | None" = None) -> "Axes":  # type: ignore[misc]  # a mixin of both kinds of map
        """Draw free, occupied and unknown space, on axes or in a new pyplot figure, and return the axes.

        Raises:
            PictureError: matplotlib is not installed.
        """
        check_matplotlib()
        from ..pictures.plots import plot_map
        return plot_map(self, ax)


@dataclass(frozen=True, eq=False)
class GridMap(_PlottableMap):
    """An occupancy grid.

    Attributes:
        data: (height, width) int8, the values of nav_msgs/OccupancyGrid: -1 unknown, 0 free to 100 occupied. Row 0
            is the lowest in the grid's own frame. An array of Booleans is taken, too: True is an obstacle.
        resolution: the side of a cell [m].
        origin: (x [m], y [m], yaw [rad]) of the outer corner of cell (0, 0) in the map's frame.
        name: where it came from, for messages.
        thresholds: which of these values are free, and which occupied.
        warnings: what a person should know of how the file was understood, one line each.
        percent: take 1 as 1 % even if there is no cell above it. Without this such a grid is refused, since 1 is often meant to
            be an obstacle.

    Raises:
        MapError: the cells are not of two dimensions, not whole numbers from -1 to 100, or likely meant as 0 and 1.
        MapMetadataError: resolution or origin are not finite, or out of range.
    """

    data: np.ndarray
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    name: str = "grid"
    percent: InitVar[bool] = False
    thresholds: Thresholds = field(default=DEFAULT_THRESHOLDS, kw_only=True)
    warnings: tuple[str, ...] = field(default=(), kw_only=True)

    def __post_init__(self, percent: bool) -> None:
        _check_name(self.name)
        data = checked_cells(self.data, self.name)
        if not percent:
            check_meaning(data, self.name)
        resolution, origin = _checked_resolution(self.resolution, self.name), _checked_origin(self.origin, self.name)
        rows, columns = data.shape
        if resolution < FINEST or max(map(abs, (*origin[:2], rows * resolution, columns * resolution))) > FARTHEST:
            raise MapMetadataError(f"{self.name}: cells of {resolution:g} m, {columns} x {rows} of them from ({origin[0]:g}, "
                                   f"{origin[1]:g}) on, cannot be planned on; give metres, cells of {FINEST:g} m at least and "
                                   f"coordinates up to {FARTHEST:g} m")
        if not percent and (doubt := doubt_about_yaw(origin[2])):
            python_warnings.warn(f"{self.name}: the origin has {doubt}", DoubtfulYaw, stacklevel=3)
        object.__setattr__(self, "data", _read_only(data))
        object.__setattr__(self, "resolution", resolution)
        object.__setattr__(self, "origin", origin)

    def blocked(self, allow_unknown: bool) -> np.ndarray:
        """Return (height, width) bool: the cells that are obstacles."""
        return self.thresholds.blocked(self.data, allow_unknown)

    def describe_cells(self) -> str:
        """Return the shares of free, occupied and unknown cells in words."""
        cells = self.data.size
        free = cells - np.count_nonzero(self.blocked(allow_unknown=False))
        occupied = np.count_nonzero(self.blocked(allow_unknown=True))
        return f"{free / cells:.1%} free, {occupied / cells:.1%} occupied, {(cells - free - occupied) / cells:.1%} unknown"

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in the grid's own frame [m]."""
        return self.data.shape[1] * self.resolution, self.data.shape[0] * self.resolution

    def to_grid_frame(self, points: np.ndarray) -> np.ndarray:
        """Return (..., 2) points of the map's frame in the grid's own, where cell (0, 0) has its outer corner at (0, 0)."""
        return Frame(*self.origin).from_map(points)

    def to_map_frame(self, points: np.ndarray) -> np.ndarray:
        """Return (..., 2) points of the grid's own frame in the map's."""
        return Frame(*self.origin).to_map(points)

    def window(self, centre: tuple[float, float], reach: float) -> "GridMap":
        """Return the part of the grid that holds everything within `reach` [m] of a point in it."""
        column, row = self.to_grid_frame(np.array(centre)) / self.resolution
        cells = math.ceil(reach / self.resolution) + 1
        left, low = max(0, int(column) - cells), max(0, int(row) - cells)
        corner = self.to_map_frame(np.array([left, low]) * self.resolution)
        return GridMap(self.data[low:int(row) + cells + 1, left:int(column) + cells + 1], self.resolution,
                       (*corner, self.origin[2]), self.name, percent=True, thresholds=self.thresholds)

    def with_costs(self, has_costs: bool) -> "GridMap":
        """Return the map with its cells between the thresholds free at a cost, or else unknown; the same if it is so."""
        if has_costs == self.thresholds.between_is_free or not self._has_cells_between:
            return self
        return self._with_other_costs

    @cached_property
    def _with_other_costs(self) -> "GridMap":
        return self.with_thresholds(self.thresholds._replace(between_is_free=not self.thresholds.between_is_free))

    @cached_property
    def _has_cells_between(self) -> bool:
        return bool(self.thresholds.between(self.data).any())

    @cached_property
    def costs(self) -> np.ndarray | None:
        """(height, width) uint8: the costs of the cells [%], read-only; None where no cell has one."""
        if not (self.thresholds.between_is_free and self._has_cells_between):
            return None
        return _read_only(np.where(self.thresholds.between(self.data), self.data, 0).astype(np.uint8))

    def with_thresholds(self, thresholds: Thresholds) -> "GridMap":
        """Return the map with the same cells, whose values are taken otherwise."""
        return replace(self, percent=True, thresholds=thresholds)

    def corners(self) -> np.ndarray:
        """(4, 2) corners of the map, counter-clockwise, in the map's frame [m]; read-only."""
        return self._corners

    @cached_property
    def _corners(self) -> np.ndarray:
        w, h = self.size
        return _read_only(self.to_map_frame(np.array([[0, 0], [w, 0], [w, h], [0, h]])))

    @cached_property
    def id(self) -> str:
        """A short digest of the content."""
        limits = self.thresholds[:2]
        unusual = () if limits == DEFAULT_THRESHOLDS[:2] else (limits,)
        return _digest(self.data.tobytes(), repr((self.data.shape, self.resolution, self.origin, *unusual)).encode())

    def __reduce__(self) -> tuple[Any, ...]:
        # Made anew, so that its cells are read-only again.
        make = partial(GridMap, percent=True, thresholds=self.thresholds, warnings=self.warnings)
        return make, (self.data, self.resolution, self.origin, self.name)


@dataclass(frozen=True, eq=False)
class PolygonMap(_PlottableMap):
    """Free space as polygons: `PolygonMap(free)`, or `PolygonMap.of(bounds, obstacles)`.

    Attributes:
        free: the free space, a valid shapely Polygon or MultiPolygon in metres; holes and the outside are obstacles.
        name: where it came from, for messages; by keyword alone.
        warnings: what a person should know of how the file was understood, one line each.

    Args:
        known_valid: True if the free space is known to be valid, which takes seconds to find out for 100,000 vertices.
    """

    free: shapely.Geometry
    name: str = field(default="polygons", kw_only=True)
    warnings: tuple[str, ...] = field(default=(), kw_only=True)
    known_valid: InitVar[bool] = field(default=False, kw_only=True)

    #: The costs of cells: polygons have none.
    costs = None

    def with_costs(self, has_costs: bool) -> "PolygonMap":
        """Return this map."""
        return self

    def __post_init__(self, known_valid: bool) -> None:
        _check_name(self.name)
        if not isinstance(self.free, shapely.Geometry):
            raise MapError(f"{self.name}: the free space is {quoted(self.free)}; give a shapely Polygon or MultiPolygon, or "
                           "PolygonMap.of(bounds, obstacles)")
        if shapely.get_type_id(self.free) not in (3, 6) or shapely.is_empty(self.free):
            raise MapError(f"{self.name}: the free space is a {self.free.geom_type} without area; "
                           "give a Polygon or MultiPolygon")
        check_size(self.free, f"{self.name}: the free space")
        if not (known_valid or shapely.is_valid(self.free)):
            raise MapError(f"{self.name}: the free space is no valid polygon ({shapely.is_valid_reason(self.free)}); "
                           "mend its rings")
        if not np.isfinite(shapely.bounds(self.free)).all():
            raise MapError(f"{self.name}: a coordinate is not finite; give finite metres")
        x0, y0, x1, y1 = shapely.bounds(self.free).tolist()
        if min(x1 - x0, y1 - y0) < MIN_SIDE:
            raise MapError(f"{self.name}: the free space is {x1 - x0:g} m x {y1 - y0:g} m, too thin for any vehicle; give "
                           f"metres, {MIN_SIDE:g} m at least each way")
        prepare_for_threads(self.free)

    @classmethod
    def of(cls, bounds: Shape, obstacles: Iterable[Shape] = (), *, name: str = "polygons") -> "PolygonMap":
        """Make the map of what is inside the bounds and in no obstacle.

        Args:
            bounds: a polygon: its corners [(x, y), ...] in order [m], or a shapely Polygon or MultiPolygon.
            obstacles: a list of such polygons.
            name: where it came from, for messages.

        Raises:
            MapError: one of them is no valid polygon, or the obstacles leave no free space.
        """
        outer, shapes = polygon_of(bounds, "the bounds polygon"), polygons_of(obstacles, "obstacle")
        doubt = doubt_about_outside(outer, shapes, [f"obstacle {number}" for number in range(1, len(shapes) + 1)])
        if doubt:
            python_warnings.warn(f"{name}: {doubt}", DoubtfulObstacles, stacklevel=2)
        return cls(free_space(outer, shapes, "polygons"), name=name, known_valid=True)

    def corners(self) -> np.ndarray:
        """(4, 2) corners of the bounding rectangle, counter-clockwise [m]; read-only."""
        return self._corners

    @cached_property
    def _corners(self) -> np.ndarray:
        x0, y0, x1, y1 = shapely.bounds(self.free)
        return _read_only(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]))

    @cached_property
    def id(self) -> str:
        """A short digest of the content."""
        return _digest(shapely.to_wkb(self.free, byte_order=1))

    def __reduce__(self) -> tuple[Any, ...]:
        # Made anew, so that they are prepared for threads again.
        return partial(PolygonMap, name=self.name, warnings=self.warnings, known_valid=True), (self.free,)


Map = GridMap | PolygonMap


def _check_name(name: Any) -> None:
    if not isinstance(name, str):
        raise MapError(f"the name of a map is {quoted(name)}; give a text, or PolygonMap.of(bounds, obstacles) for obstacles")


def _checked_resolution(resolution: Any, name: str) -> float:
    try:
        number = math.nan if isinstance(resolution, str | bytes) else plain_float(resolution)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not 0 < number < math.inf:
        raise MapMetadataError(f"{name}: resolution is {quoted(resolution)}; give a positive number of metres per cell")
    return number


def _checked_origin(origin: Any, name: str) -> tuple[float, float, float]:
    try:
        x, y, yaw = own_floats(origin)
    except (TypeError, ValueError, OverflowError):
        x = y = yaw = math.nan
    if not (math.isfinite(x) and math.isfinite(y) and abs(yaw) <= LARGEST_YAW):
        raise MapMetadataError(f"{name}: origin is {quoted(origin)}; give x and y, finite, in metres, and a yaw in radians "
                               f"within {LARGEST_YAW:g} of 0, where rounding leaves its direction exact")
    return x, y, yaw


def _read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


def prepare_for_threads(polygons: shapely.Geometry) -> None:
    """Prepare polygons for fast tests of points, in several threads.

    What shapely prepares is built with the first two tests, which must not happen in two threads at once.
    """
    shapely.prepare(polygons)
    x0, y0, x1, y1 = shapely.bounds(polygons)
    shapely.contains_xy(polygons, [x0, x1, (x0 + x1) / 2], [y0, y1, (y0 + y1) / 2])


def _digest(*parts: bytes) -> str:
    return hashlib.sha256(b"".join(parts)).hexdigest()[:12]


def rasterise(polygons: PolygonMap, resolution: float) -> GridMap:
    """Return the grid of a polygon map, with one ring of occupied cells around it.

    A cell is occupied where its open square meets an obstacle, so that what is free in the grid is free in the polygons.

    Args:
        polygons: the map.
        resolution: the side of a cell [m].

    Raises:
        TypeError: polygons is no polygon map.
        MapMetadataError: resolution is no size of a cell.
    """
    if not isinstance(polygons, PolygonMap):
        raise TypeError(f"the map is {quoted(polygons)}; give a PolygonMap")
    resolution = _checked_resolution(resolution, polygons.name)
    x0, y0, x1, y1 = shapely.bounds(polygons.free)
    columns, rows = (math.ceil(side / resolution - 1e-9) + 2 for side in (x1 - x0, y1 - y0))
    left = x0 + (np.arange(columns) - 1) * resolution
    low = y0 + (np.arange(rows) - 1) * resolution
    inset = 1e-9 * resolution
    left, low = np.meshgrid(left + inset, low + inset)
    squares = shapely.box(left, low, left + resolution - 2 * inset, low + resolution - 2 * inset)
    data = np.where(shapely.covers(polygons.free, squares), FREE, OCCUPIED).astype(np.int8)
    return GridMap(data, resolution, (x0 - resolution, y0 - resolution, 0.0), polygons.name)
