"""The free space between bounds and obstacles, each of them checked."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
import shapely

from ..text import quoted
from .errors import MapError

#: Largest coordinate of a map [m]; beyond it a double cannot tell tenths of a micrometre.
MAX_COORDINATE = 1e9
#: Maximum number of vertices of polygons; more would take many seconds to check and to plan on.
MAX_VERTICES = 500_000
#: Minimum width and height of a map [m]: the planner keeps half a millimetre from obstacles on either side.
MIN_SIDE = 0.001
#: Maximum number of pairs of edges of different polygons that may cross, beyond one for each edge: a crossing takes 10 us and a
#: kilobyte.
MAX_CROSSINGS = 100_000
#: Number of vertices from which on polygons that do not touch are put together without GEOS' overlay, which reorders the rings.
MANY_VERTICES = 20_000
#: Number of pairs of edges that are looked at together.
_PAIRS = 5_000_000
#: Numbers by which shapely knows Polygon and MultiPolygon.
_POLYGONS = (3, 6)

#: A polygon as a user gives it: a shapely Polygon or MultiPolygon, or its corners (x, y) [m] in order.
Shape: TypeAlias = shapely.Geometry | Sequence[Sequence[float]] | np.ndarray


def free_space(bounds: shapely.Geometry, obstacles: Sequence[shapely.Geometry], what: str) -> shapely.Geometry:
    """Return the bounds less the union of the obstacles, which is valid as all of them are.

    Raises:
        MapError: their edges cross too often, or nothing is left; `what` says in the message what they are.
    """
    may_touch = _check_crossings([bounds, *obstacles], what)
    if not may_touch and (free := _with_holes(bounds, obstacles)):
        return free
    try:
        free = bounds - shapely.union_all(obstacles)
    except shapely.GEOSException as error:
        raise MapError(f"{what}: the obstacles cannot be taken from the bounds ({error}); simplify them") from None
    if shapely.is_empty(free):
        raise MapError(f"{what}: the obstacles leave no free space; move or remove some")
    return valid(free, f"{what}: the free space")


def _with_holes(bounds: shapely.Geometry, obstacles: Sequence[shapely.Geometry]) -> shapely.Geometry | None:
    """Return bounds of many vertices with a hole for each obstacle, where that is all: what GEOS takes ten seconds for.

    Args:
        bounds, obstacles: valid, and no two rings of them meet.
    """
    parts = shapely.get_parts(obstacles)
    if shapely.get_num_coordinates([bounds, *parts]).sum() < MANY_VERTICES or len(shapely.get_parts(bounds)) > 1:
        return None
    shell, *holes = shapely.get_rings(bounds)
    rings = [*holes, *shapely.get_rings(parts)]
    corners = shapely.points([ring.coords[0] for ring in rings])
    inside_others = shapely.STRtree(parts).query(corners, predicate="within")
    is_own = inside_others[0] == inside_others[1] + len(holes)
    if len(rings) > len(holes) + len(parts) or not is_own.all() or not shapely.covers(bounds, corners).all():
        return None
    return shapely.Polygon(shell, rings)


def polygon_of(shape: Shape, label: str) -> shapely.Geometry:
    """Return a shape as a polygon.

    Raises:
        MapError: it is no valid polygon in metres; `label` names it.
    """
    polygon = shape if isinstance(shape, shapely.Geometry) else shapely.Polygon(_corners(shape, label))
    if shapely.get_type_id(polygon) not in _POLYGONS or shapely.is_empty(polygon):
        raise MapError(f"{label} is a {polygon.geom_type} without area; give a polygon or its corners")
    _checked_coordinates(shapely.get_coordinates(polygon), label)
    return valid(polygon, label)


def polygons_of(shapes: shapely.Geometry | Iterable[Shape], label: str) -> list[shapely.Geometry]:
    """Return shapes as polygons.

    Raises:
        MapError: one of them is no valid polygon in metres; `label` and its number, from 1 on, name it.
    """
    if isinstance(shapes, shapely.Geometry):
        shapes = shapely.get_parts(shapes).tolist()
    try:
        given = list(shapes)
    except TypeError:
        raise MapError(f"the {label}s are {quoted(shapes)}; give a list of polygons") from None
    return [polygon_of(shape, f"{label} {number}") for number, shape in enumerate(given, 1)]


def doubt_about_outside(bounds: shapely.Geometry, obstacles: Sequence[shapely.Geometry], labels: Sequence[str]) -> str:
    """Return how many obstacles lie outside of the bounds, in words; "" where none does."""
    x0, y0, x1, y1 = shapely.bounds(bounds)
    left, low, right, top = shapely.bounds(obstacles).reshape(-1, 4).T
    outside = np.flatnonzero((left > x1) | (right < x0) | (low > y1) | (top < y0))
    if not len(outside):
        return ""
    first = int(outside[0])
    return (f"{len(outside)} of {len(obstacles)} obstacles lie outside of the bounds and have no effect: {labels[first]}, which "
            f"begins at ({left[first]:g}, {low[first]:g}), is the first; give all in one frame, x before y, in metres")


def valid(geometry: shapely.Geometry, label: str) -> shapely.Geometry:
    """Return a geometry that is valid.

    Raises:
        MapError: it is not, or has too many vertices to tell soon.
    """
    check_size(geometry, label)
    if not shapely.is_valid(geometry):
        raise MapError(f"{label} is not valid ({shapely.is_valid_reason(geometry)}); mend its rings")
    return geometry


def check_size(geometry: shapely.Geometry, label: str) -> None:
    """Refuse polygons that cannot be checked or used in time, before that is tried.

    Raises:
        MapError: there are too many vertices.
    """
    count = int(shapely.get_num_coordinates(geometry))
    if count > MAX_VERTICES:
        raise MapError(f"{label} has {count} vertices; simplify the polygons to {MAX_VERTICES} in all")


def _corners(shape: Any, label: str) -> np.ndarray:
    """Return (n, 2) corners [m]."""
    try:
        corners = np.array(shape, dtype=float) if np.asarray(shape).dtype.kind in "iuf" else np.empty(0)
    except (TypeError, ValueError, OverflowError):
        corners = np.empty(0)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise MapError(f"{label} is {quoted(shape)}; give a polygon: three or more corners [x, y] in metres")
    return _checked_coordinates(corners, label)


def _checked_coordinates(corners: np.ndarray, label: str) -> np.ndarray:
    wrong = ~(np.abs(corners) <= MAX_COORDINATE)
    if wrong.any():
        raise MapError(f"{label} has the coordinate {corners[wrong][0]:g}; give metres from {-MAX_COORDINATE:g} to "
                       f"{MAX_COORDINATE:g}")
    return corners


def _check_crossings(shapes: Sequence[shapely.Geometry], what: str) -> bool:
    """Refuse polygons that may cross each other so often that their union would take minutes and gigabytes.

    Returns:
        True if any of them may cross.
    """
    polygons, shape = shapely.get_parts(shapes, return_index=True)
    rings, polygon = shapely.get_rings(polygons, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    along = ring[:-1] == ring[1:]
    edges = shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1)[along])
    owner = shape[polygon[ring[:-1][along]]]
    near, box = shapely.STRtree(shapely.envelope(shapes)).query(edges)
    near = np.unique(near[owner[near] != box])  # only these edges are near another of the shapes
    most, count = MAX_CROSSINGS + len(edges), 0
    edges, owner = edges[near], owner[near]
    if len(np.unique(owner)) < 2:
        return False
    tree = shapely.STRtree(edges)
    step = 1 + _PAIRS // len(edges)
    for begin in range(0, len(edges), step):
        some, others = tree.query(edges[begin:begin + step])
        count += int(np.count_nonzero(owner[begin + some] < owner[others]))
        if count > most:
            raise MapError(f"{what}: more than {most} pairs of their {np.count_nonzero(along)} edges may cross; unite what "
                           "overlaps")
    return count > 0
