"""A polygon footprint as the kernels need it: discs that cover it, and its hull and convex parts, which can be made wider."""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import shapely

from ..vehicle import Footprint

#: Number of discs side by side across a footprint, and maximum number one after the other along it; each covers a piece.
PIECES_PER_WIDTH = 2
MAX_PIECES_PER_LENGTH = 12
#: Minimum number of convex parts with which the check of the hull saves time.
PARTS_WORTH_HULL = 6
#: Number of points on the rim of each disc that are compared with the footprint.
RIM_POINTS = 361


@dataclass(frozen=True, eq=False)
class Cover:
    """The cover of a footprint, in the vehicle's frame: discs, the convex hull, and convex parts.

    Attributes:
        discs: (m, 4) float64: x, y and radius of discs that cover it, and radius of a disc with the same centre inside it [m].
        excess: how far the discs reach beyond the footprint, about [m].
        corners: (n, 4) float64: x and y of the corners of its convex parts [m], counter-clockwise, and their displacement
            per metre by which the part is widened, at most sqrt(2).
        first_corner: (p + 1,) int32: index of the first corner of each part, and the number of corners.
        part_discs: (p, 3) float64: x, y and radius of a disc around each part [m].
        hull: (h, 4) float64: as `corners`, those of the convex hull; none where there are too few parts for it to be worthwhile.
    """

    discs: np.ndarray
    excess: float
    corners: np.ndarray
    first_corner: np.ndarray
    part_discs: np.ndarray
    hull: np.ndarray


@lru_cache(maxsize=64)
def cover(footprint: Footprint) -> Cover:
    """Return the cover of a footprint, whose corners are counter-clockwise."""
    polygon = shapely.Polygon(footprint)
    discs = np.array([_disc_around(piece, polygon) for piece in _pieces(polygon)])
    excess = float(shapely.distance(polygon, shapely.points(_rims(discs))).max())
    convex_parts = _convex_parts(footprint)
    parts, part_discs = [_widened(part) for part in convex_parts], np.array([_disc_of(part) for part in convex_parts])
    first_corner = np.cumsum([0, *map(len, parts)]).astype(np.int32)
    hull = _widened(_hull(polygon)) if len(parts) >= PARTS_WORTH_HULL else np.empty((0, 4))
    return Cover(discs, excess, np.concatenate(parts), first_corner, part_discs, hull)


def summary(footprint: Footprint) -> str:
    """Return what covers a footprint, in words."""
    found = cover(footprint)
    return (f"a footprint of {len(footprint)} corners, covered by {len(found.discs)} discs that reach {found.excess:.2f} m "
            "beyond it (nearer to obstacles than that, the footprint itself decides)")


def _rims(discs: np.ndarray) -> np.ndarray:
    """Return (m, RIM_POINTS, 2) points on the rims of discs."""
    bearing = np.linspace(0, math.tau, RIM_POINTS)
    points: np.ndarray = discs[:, None, :2] + discs[:, None, 2:3] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    return points


def _pieces(polygon: shapely.Polygon) -> list[shapely.Geometry]:
    """Cut the footprint into pieces that are about as long as wide."""
    low, high = np.array(polygon.bounds).reshape(2, 2)
    side = max((high - low).min() / PIECES_PER_WIDTH, (high - low).max() / MAX_PIECES_PER_LENGTH)
    columns, rows = (np.linspace(a, b, math.ceil((b - a) / side - 1e-9) + 1) for a, b in zip(low, high, strict=True))
    squares = (shapely.box(x0, y0, x1, y1) for x0, x1 in pairwise(columns) for y0, y1 in pairwise(rows))
    return [piece for piece in map(polygon.intersection, squares) if piece.area > 0]


def _disc_around(piece: shapely.Geometry, polygon: shapely.Polygon) -> tuple[float, float, float, float]:
    """Return the smallest disc around a piece, and the radius of a disc with its centre that the polygon covers."""
    centre = shapely.minimum_bounding_circle(piece).centroid
    radius = max(math.dist((centre.x, centre.y), corner) for corner in shapely.get_coordinates(piece).tolist())
    inner = shapely.distance(polygon.exterior, centre) if polygon.contains(centre) else 0.0
    return centre.x, centre.y, radius * (1 + 1e-9), inner * (1 - 1e-9)


def _disc_of(corners: np.ndarray) -> tuple[float, float, float]:
    """Return the centre and the radius of a disc around (k, 2) corners."""
    x, y = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return x, y, float(np.hypot(*(corners - (x, y)).T).max()) * (1 + 1e-9)


def _convex_parts(footprint: Footprint) -> list[np.ndarray]:
    """Return the (k, 2) corners of convex parts that make up the footprint: itself, or triangles."""
    corners = np.array(footprint)
    if _turns(corners).min() >= 0:
        return [corners[_turns(corners) > 0]]
    parts = []
    while len(corners) > 3:
        ear = _ear(corners)
        parts.append(corners[[ear - 1, ear, (ear + 1) % len(corners)]])
        corners = np.delete(corners, ear, axis=0)
    return [part for part in [*parts, corners] if _turns(part).max() > 0]


def _hull(polygon: shapely.Polygon) -> np.ndarray:
    """Return (k, 2) the corners of the convex hull, counter-clockwise."""
    corners: np.ndarray = shapely.get_coordinates(polygon.convex_hull)[:-1]
    return corners if _turns(corners).sum() > 0 else corners[::-1]


def _turns(corners: np.ndarray) -> np.ndarray:
    """Return (k,) the sine of the turn at each corner, times the lengths of its edges."""
    to, onward = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turns: np.ndarray = to[:, 0] * onward[:, 1] - to[:, 1] * onward[:, 0]
    return turns


def _ear(corners: np.ndarray) -> int:
    """Return a corner that can be cut off: its triangle holds no other. There is one, as the footprint does not touch itself."""
    turns = _turns(corners)
    flat = np.flatnonzero(turns == 0)
    if len(flat):
        return int(flat[0])
    for ear in np.flatnonzero(turns > 0).tolist():
        indices = [ear - 1, ear, (ear + 1) % len(corners)]
        triangle, others = shapely.Polygon(corners[indices]), np.delete(corners, indices, axis=0)
        if not shapely.intersects_xy(triangle, others).any():
            return int(ear)
    return int(np.argmax(turns))  # only rounding can bring us here


def _widened(corners: np.ndarray) -> np.ndarray:
    """Return (2 k, 4): a convex part whose corners are cut off, so that made wider it stays within sqrt(2) of that.

    Each corner becomes two: where the line along either edge and the one that cuts the corner off, each moved outwards by a
    metre, meet. The edges have the unit normals n and m, the cut has u = (n + m) / |n + m|; the lines of n and u meet at
    (n + u) / (1 + n u) from the corner.
    """
    edges = np.roll(corners, -1, axis=0) - corners
    after = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.hypot(*edges.T)[:, None]
    before = np.roll(after, 1, axis=0)
    cut = before + after
    cut /= np.hypot(*cut.T)[:, None]
    moves = [(normal + cut) / (1 + (normal * cut).sum(axis=1))[:, None] for normal in (before, after)]
    return np.stack([np.column_stack([corners, move]) for move in moves], axis=1).reshape(-1, 4)
