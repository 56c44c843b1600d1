"""Polygon bodies on maps: never free where they touch an obstacle, always where a millimetre is left."""

import math

import numpy as np
import pytest
import shapely
from shapely import affinity
from support import naive
from support.cases import boxes_grid, holed_polygons, maze_grid, naive_clearance, scaled
from support.footprints import CAR, OUTLINES

from dubins_rrt_ros.planning import ClearanceField, DubinsCurve, GridMap, PolygonMap, Vehicle
from dubins_rrt_ros.planning.curves.dubins import shortest

MAPS = {
    "boxes": boxes_grid, "fine": lambda rng: boxes_grid(rng, side=150, resolution=0.08), "maze": maze_grid,
    "coarse": lambda rng: boxes_grid(rng, side=12, resolution=1.0, boxes=3),
    "one cell": lambda rng: GridMap([[0]], 9.0, (0, 0, 0.3)), "walls": lambda rng: holed_polygons(rng, "walls"),
    "polygons": lambda rng: holed_polygons(rng, "boxes"),
}
STEP = 0.02
#: With this gap a body is free for sure [m].
ENOUGH = 0.00075


def obstacles(map):
    """What is not free, out to far beyond the map, as shapely sees it."""
    corners = map.corners()
    reach = shapely.Polygon(corners).buffer(50, join_style="mitre")
    if isinstance(map, PolygonMap):
        return reach - map.free
    rows, columns = np.nonzero(~map.blocked(False))
    squares = shapely.box(columns, rows, columns + 1, rows + 1)
    x, y, yaw = map.origin
    c, s = map.resolution * math.cos(yaw), map.resolution * math.sin(yaw)
    return reach - affinity.affine_transform(shapely.union_all(squares), [c, -s, s, c, x, y])


def placed(outline, pose):
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    return affinity.affine_transform(shapely.Polygon(outline), [c, -s, s, c, x, y])


def poses_along(curve):
    """(n, 3) poses a step apart."""
    s = np.linspace(0, curve.length, math.ceil(curve.length / STEP) + 1)
    begins = np.cumsum([0.0, *curve.lengths[:2]])
    lengths = np.stack([np.clip(s - begin, 0, length) for begin, length in zip(begins, curve.lengths, strict=True)], axis=-1)
    return naive.drive(curve.start, curve.word, lengths, curve.radius)


def least_gap(curve, outline, blocked):
    """At poses a step apart, so that the true one is lower by what the body moves in half a step at most."""
    least = math.inf
    for pose in poses_along(curve):
        least = min(least, shapely.distance(placed(outline, pose), blocked))
        if least == 0:
            break
    return least


def random_curves(rng, map, clearance, radius, count):
    """Short curves that begin in free space."""
    corner, *sides = map.corners()[0], *(map.corners()[[1, 3]] - map.corners()[0])
    for start in rng.random((count, 2)) @ np.array(sides) + corner:
        if clearance(start[None])[0] > 0:
            theta, away = rng.uniform(-math.pi, math.pi), rng.normal(0, 2, 2)
            yield shortest((*start.tolist(), theta), (*(start + away).tolist(), theta + rng.normal(0, 1)), radius)


@pytest.mark.slow
@pytest.mark.parametrize("outline", OUTLINES)
@pytest.mark.parametrize("kind", MAPS)
def test_curves_and_poses_as_brute_force_sees_them(kind, outline):
    rng = np.random.default_rng(sum(map(ord, kind + outline)))
    map_ = MAPS[kind](rng)
    field, clearance, blocked = ClearanceField(map_), naive_clearance(map_), obstacles(map_)
    shapely.prepare(blocked)
    vehicle = Vehicle(turning_radius=float(rng.uniform(1, 3)), footprint=OUTLINES[outline])
    fastest = 1 + vehicle.robot_radius / vehicle.turning_radius
    for curve in random_curves(rng, map_, clearance, vehicle.turning_radius, scaled(12, least=6)):
        gap = shapely.distance(placed(vehicle.footprint, curve.start), blocked)
        assert gap > 0 if field.pose_is_free(curve.start, vehicle) else gap < ENOUGH
        least = least_gap(curve, vehicle.footprint, blocked)
        assert least > 0 if field.curve_is_free(curve, vehicle) else least < ENOUGH + fastest * STEP / 2


@pytest.mark.parametrize("gap", [-1e-6, 0.0, 1e-5])
@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_a_gap_that_just_passes_and_just_fails(gap, yaw):
    """A robot 0.6 m wide between two walls, straight on: with a millimetre in all it passes, without it does not."""
    vehicle = Vehicle(footprint="[[0.6, 0.3], [-0.6, 0.3], [-0.6, -0.3], [0.6, -0.3]]")
    c, s = math.cos(yaw), math.sin(yaw)
    for width, fits in ((0.6 + 2 * max(gap, 0), False), (0.6 + gap, False), (0.602, True)):
        free = shapely.box(-4, -3, 4, 3) - shapely.box(-1, width / 2, 1, 3.1) - shapely.box(-1, -3.1, 1, -width / 2)
        polygons = PolygonMap(affinity.affine_transform(free, [c, -s, s, c, 0, 0]))
        # The cells of the grid are as wide as the gap, one row of them.
        rows = math.floor(6 / width) // 2 * 2 + 1
        data = np.zeros((rows, 40))
        data[:, 15:25] = 100
        data[rows // 2, 15:25] = 0
        corner = -20 * width * np.array([c, s]) + rows * width / 2 * np.array([s, -c])
        grid = GridMap(data, width, (*corner.tolist(), yaw))
        for map in polygons, grid:
            through = DubinsCurve((-2.2 * c, -2.2 * s, yaw), 1.0, "LSL", (0.0, 4.4, 0.0))
            # A grid's walls are longer; the vehicle is between them from first to last then.
            assert ClearanceField(map).curve_is_free(through, vehicle) == fits


@pytest.mark.parametrize("swing", ["outer front", "inner side"])
@pytest.mark.parametrize("turn", ["L", "R"])
@pytest.mark.parametrize("gap, fits", [(-1e-6, False), (0.001, True)])
@pytest.mark.parametrize("kind", ["cell", "post"])
def test_a_turn_past_a_post(kind, gap, fits, turn, swing):
    """The car's outer front corner passes at one distance from the centre of the turn, its inner side at another."""
    vehicle, radius, side = Vehicle(turning_radius=5.0, footprint=CAR), 5.0, 1 if turn == "L" else -1
    away = math.hypot(3.6, radius + 0.9) + gap if swing == "outer front" else radius - 0.9 - gap
    bearing = math.pi / 4 if swing == "outer front" else -3 * math.pi / 4  # a corner of the cell is nearest to the body
    corner = away * np.array([math.cos(math.pi / 4), math.sin(math.pi / 4)])
    # The centre of the turn is (0, 0); the car comes from 90 degrees before the post and goes on 90 degrees beyond.
    begin = math.pi / 4 - side * math.pi / 2
    start = (radius * math.cos(begin), radius * math.sin(begin), begin + side * math.pi / 2)
    curve = DubinsCurve(start, radius, "LSL" if turn == "L" else "RSR", (radius * math.pi, 0.0, 0.0))
    if kind == "cell":
        size = 0.05
        first = corner if swing == "outer front" else corner - size
        data = np.zeros((601, 601))
        data[300, 300] = 100
        map = GridMap(data, size, (*(first - 300 * size).tolist(), 0.0))
    else:
        ahead, beside = np.array([math.cos(bearing), math.sin(bearing)]), np.array([-math.sin(bearing), math.cos(bearing)])
        post = shapely.Polygon([corner, corner + 0.02 * ahead + 0.002 * beside, corner + 0.02 * ahead - 0.002 * beside])
        map = PolygonMap(shapely.box(-15, -15, 15, 15) - post)
    assert ClearanceField(map).curve_is_free(curve, vehicle) == fits


def test_what_lies_within_the_outline_is_touched():
    """A post that no disc's rim and no corner comes near, within a long vehicle; and a vehicle within an obstacle."""
    bus = Vehicle(footprint="[[9, 1.2], [-2, 1.2], [-2, -1.2], [9, -1.2]]")
    post = shapely.box(4.3, 0.1, 4.4, 0.2)
    ring = shapely.box(-30, -30, 30, 30) - (shapely.box(-20, -20, 20, 20) - shapely.box(-19, -19, -18, -18))
    for map in PolygonMap(shapely.box(-20, -20, 20, 20) - post), PolygonMap(ring):
        field = ClearanceField(map)
        assert not field.pose_is_free((0.0, 0.0, 0.0), bus)
        assert not field.curve_is_free(DubinsCurve((0.0, 0.0, 0.0), 1.0, "LSL", (0.0, 0.01, 0.0)), bus)


def test_a_notch_goes_round_a_post():
    vehicle = Vehicle(footprint=OUTLINES["fork"])
    map = PolygonMap(shapely.box(-5, -5, 8, 5) - shapely.box(3, -0.1, 3.2, 0.1))
    field = ClearanceField(map)
    assert field.curve_is_free(DubinsCurve((0.0, 0.0, 0.0), 1.0, "LSL", (0.0, 2.49, 0.0)), vehicle)
    assert not field.curve_is_free(DubinsCurve((0.0, 0.0, 0.0), 1.0, "LSL", (0.0, 2.51, 0.0)), vehicle)
