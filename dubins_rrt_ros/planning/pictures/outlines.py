"""The outlines of polygons and vehicles, as matplotlib draws them."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from matplotlib.path import Path as Contour
from matplotlib.transforms import Affine2D

from ..vehicle import Vehicle

#: Maximum error of the edge of the area that a disc sweeps, in its radii.
FLAT = 0.01


def contour(polygons: shapely.Geometry) -> Contour:
    """Join all rings to one contour: shells counter-clockwise and holes clockwise, so that holes stay empty."""
    parts = []
    for polygon in shapely.get_parts(polygons):
        for ring, is_shell in ((polygon.exterior, True), *((hole, False) for hole in polygon.interiors)):
            points = np.asarray(ring.coords)[:, :2]
            if len(points):
                parts.append(Contour(points if ring.is_ccw == is_shell else points[::-1], closed=True))
    return Contour.make_compound_path(*parts) if parts else Contour(np.empty((0, 2)))


def swept(vehicle: Vehicle, path: np.ndarray) -> Contour:
    """Return the area that the vehicle sweeps along (n, 3) poses, with straight lines from pose to pose."""
    if not vehicle.footprint:
        line = shapely.LineString(path[:, :2]) if len(path) > 1 else shapely.Point(path[0, :2])
        # Corners that are too flat to see would make up most of the file.
        return contour(line.buffer(vehicle.robot_radius).simplify(FLAT * vehicle.robot_radius))
    bodies = [_body(vehicle, pose) for pose in path]
    return contour(shapely.union_all([shapely.union(*pair).convex_hull for pair in pairwise(bodies)] or bodies))


def body(vehicle: Vehicle, pose: Sequence[float]) -> Contour:
    """Return the area that the vehicle covers at a pose."""
    return contour(_body(vehicle, pose))


def _body(vehicle: Vehicle, pose: Sequence[float]) -> shapely.Polygon:
    x, y, theta = pose
    if not vehicle.footprint:
        return shapely.Point(x, y).buffer(vehicle.robot_radius)
    return shapely.Polygon(Affine2D().rotate(theta).translate(x, y).transform(np.array(vehicle.footprint)))
