"""What covers a footprint: discs and convex parts that are together no less than it, and hardly more."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.cases import scaled
from support.footprints import CAR, OUTLINES

from dubins_rrt_ros.planning import Vehicle
from dubins_rrt_ros.planning.collision.footprint import PARTS_WORTH_HULL, cover


def check_cover(outline):
    found, polygon = cover(outline), shapely.Polygon(outline)
    discs = shapely.union_all([shapely.Point(x, y).buffer(r, 256) for x, y, r, _ in found.discs])
    assert polygon.difference(discs.buffer(1e-4 * found.discs[:, 2].max())).area < 1e-12
    farthest = shapely.distance(polygon, shapely.points(shapely.get_coordinates(discs))).max()
    assert found.excess == pytest.approx(farthest, rel=0.01, abs=1e-3 * polygon.length)
    for x, y, _, inner in found.discs:
        assert inner < 1e-9 or polygon.buffer(1e-9).contains(shapely.Point(x, y).buffer(inner))
    check_hull(found, polygon)
    check_parts(found, polygon)


def check_hull(found, polygon):
    """Made wider, it holds the polygon made wider."""
    assert (len(found.hull) > 0) == (len(found.first_corner) > PARTS_WORTH_HULL)
    if len(found.hull) == 0:
        return
    for wider in (0.0, 0.01, 1.0):
        hull = shapely.Polygon(found.hull[:, :2] + wider * found.hull[:, 2:])
        assert hull.exterior.is_ccw and hull.area == pytest.approx(hull.convex_hull.area, rel=1e-9)
        assert hull.buffer(1e-9 + 1e-6 * wider).contains(polygon.buffer(wider, 64))


def check_parts(found, polygon):
    """Together the convex parts are the polygon; made wider they hold it made wider, and reach at most sqrt(2) as far.

    Each is in its disc, which is made wider by more than that.
    """
    corners = np.array(polygon.exterior.coords)
    rim = (corners[:-1, None] + np.linspace(0, 1, 12)[:, None] * np.diff(corners, axis=0)[:, None]).reshape(-1, 1, 2)
    bearing = np.linspace(0, math.tau, 73)
    for wider in (0.0, 0.01, 1.0):
        rings = [ring[:, :2] + wider * ring[:, 2:] for ring in np.split(found.corners, found.first_corner[1:-1])]
        parts = shapely.union_all([shapely.convex_hull(shapely.MultiPoint(ring)) for ring in rings])
        tolerance = 1e-9 + 1e-6 * wider
        within = (rim + wider * np.column_stack([np.cos(bearing), np.sin(bearing)])).reshape(-1, 2)
        assert shapely.distance(parts, shapely.points(within)).max() <= tolerance
        assert shapely.distance(polygon, shapely.points(shapely.get_coordinates(parts))).max() <= math.sqrt(2) * wider + tolerance
        assert polygon.difference(parts.buffer(1e-9)).area < 1e-9
        for (x, y, radius), ring in zip(found.part_discs, rings, strict=True):
            assert np.hypot(*(ring - (x, y)).T).max() <= radius + (math.sqrt(2) + 1e-6) * wider + 1e-9
            assert shapely.Polygon(ring).area == pytest.approx(shapely.convex_hull(shapely.MultiPoint(ring)).area, rel=1e-9)
            assert shapely.LinearRing(ring).is_ccw


@pytest.mark.parametrize("kind", OUTLINES)
def test_a_footprint_is_covered(kind):
    check_cover(Vehicle(footprint=OUTLINES[kind]).footprint)


@pytest.mark.slow
@settings(max_examples=scaled(40, least=10))
@given(st.lists(st.tuples(st.floats(0, math.tau), st.floats(0.05, 3)), min_size=3, max_size=9, unique_by=lambda polar: polar[0]))
def test_any_footprint_is_covered(corners):
    outline = [[r * math.cos(angle), r * math.sin(angle)] for angle, r in sorted(corners)]
    polygon = shapely.Polygon(outline)
    assume(np.hypot(*np.diff(outline, axis=0).T).min() > 1e-6)  # else the direction of an edge is a matter of rounding
    assume(polygon.is_valid and polygon.area > 0.02 * polygon.length**2 and polygon.contains(shapely.Point(0, 0)))
    check_cover(Vehicle(footprint=str(outline)).footprint)


def test_a_car_is_covered_by_few_discs_tightly():
    found = cover(Vehicle(footprint=CAR).footprint)
    assert len(found.discs) == 10
    assert found.excess < 0.19
    assert len(found.first_corner) == 2 and len(found.hull) == 0
