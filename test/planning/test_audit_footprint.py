"""The audit of polygons: its verdict is that of the polygon put at very many poses, and right where that is decided by a hair."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_rrt_ros.planning import DubinsCurve, GridMap, Path, PolygonMap, Problem, Vehicle, audit_path
from dubins_rrt_ros.planning.audit import obstacles as audit_obstacles
from dubins_rrt_ros.planning.audit import sweep as audit_sweep
from dubins_rrt_ros.planning.curves.dubins import shortest
from dubins_rrt_ros.planning.maps.model import Thresholds

CAR = [(3.6, 0.9), (-0.9, 0.9), (-0.9, -0.9), (3.6, -0.9)]
#: An L: its front right quarter is missing.
NOTCHED = [(2, 1), (-1, 1), (-1, -1), (0.5, -1), (0.5, 0.1), (2, 0.1)]
HAIR = 1e-5


def vehicle_of(corners, turning_radius=1.0):
    return Vehicle(turning_radius=turning_radius, footprint=json.dumps([list(map(float, corner)) for corner in corners]))


def path_of(*curves):
    return Path.of_curves(curves[0].start, curves[-1].end, curves)


def judged(map, vehicle, *curves, **request):
    path = path_of(*curves)
    return audit_path(path, Problem(map, vehicle, path.start, path.end, **request))


def straight(x, y, theta, length):
    return DubinsCurve((x, y, theta), 1.0, "LSL", (0.0, length, 0.0))


def obstacles_of(map):
    """All obstacles as one geometry: the naive twin of what the audit looks up in parts."""
    around = shapely.box(-1e3, -1e3, 1e3, 1e3)
    if isinstance(map, PolygonMap):
        return around - map.free
    row, column = np.nonzero(map.blocked(allow_unknown=False))
    squares = np.stack([column, row], axis=1)[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    return shapely.union_all([around - shapely.Polygon(map.corners()),
                              *shapely.polygons(map.to_map_frame(squares * map.resolution))])


def placed(vehicle, poses):
    """The footprint at each of the poses."""
    x, y, theta = (values[:, None] for values in np.asarray(poses).T)
    ahead, left = np.array(vehicle.footprint).T
    return shapely.polygons(np.stack([x + np.cos(theta) * ahead - np.sin(theta) * left,
                                      y + np.sin(theta) * ahead + np.cos(theta) * left], axis=-1))


def least_distance(map, vehicle, path, step):
    """At poses that far apart."""
    return float(shapely.distance(placed(vehicle, path.poses(step)), obstacles_of(map)).min())


@st.composite
def outlines(draw):
    """Star-shaped around the reference point, convex or not, and not always in its middle."""
    corners = draw(st.integers(3, 8))
    angles = (np.arange(corners) + draw(st.floats(0, 1))) * math.tau / corners
    radii = [draw(st.floats(0.15, 1.2)) for _ in range(corners)]
    return [(r * math.cos(a), 0.6 * r * math.sin(a)) for a, r in zip(angles, radii, strict=True)]


@st.composite
def maps(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = draw(st.integers(0, 6))
    if draw(st.booleans()):
        x, y = rng.uniform(0, 8, (2, count))
        posts = shapely.buffer(shapely.points(x, y), rng.uniform(0.01, 0.5, count), quad_segs=4)
        return PolygonMap(shapely.box(0, 0, 8, 8) - shapely.union_all(posts))
    resolution = draw(st.sampled_from([0.1, 0.25, 0.5]))
    side = int(8 / resolution)
    data = np.zeros((side, side + 3))
    for row, column, height, width in zip(*rng.integers(0, side, (2, count)), *rng.integers(1, 4, (2, count)), strict=True):
        data[row:row + height, column:column + width] = rng.choice([100, -1])
    yaw = draw(st.sampled_from([0.0, 0.4, -2.0]))
    corner = 4 - 4 * np.array([math.cos(yaw) - math.sin(yaw), math.sin(yaw) + math.cos(yaw)])
    return GridMap(data, resolution, (*corner, yaw))


POSES = st.tuples(st.floats(1.5, 6.5), st.floats(1.5, 6.5), st.floats(-3, 3))


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(maps(), outlines(), st.lists(POSES, min_size=2, max_size=3), st.floats(0.3, 2.0))
def test_the_verdict_is_that_of_the_polygon_at_many_poses(map, outline, poses, radius):
    vehicle = vehicle_of(outline, radius)
    path = path_of(*(shortest(a, b, radius) for a, b in pairwise(poses)))
    verdict = audit_path(path, Problem(map, vehicle, path.start, path.end))
    step = 0.01
    seen = least_distance(map, vehicle, path, step)
    # No corner moves faster than this, so that between the poses it may be that much nearer.
    least = seen - step / 2 * (1 + vehicle.robot_radius / radius)
    if seen <= 1e-9:
        assert not verdict.ok
    if least > HAIR:
        assert verdict.ok
    if verdict.ok:
        assert least - 1e-9 <= verdict.min_clearance <= max(1.021 * seen, seen + 0.001)


@pytest.mark.parametrize("gap", [HAIR, -HAIR])
@pytest.mark.parametrize("yaw", [0.0, 0.7])
@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_a_hair_decides_along_a_wall(kind, yaw, gap):
    """40 m straight along the map's lower edge."""
    map, turn = hall(kind, 60.0, yaw)
    x, y = turn(5.0, 0.9 + gap)
    verdict = judged(map, vehicle_of(CAR), straight(x, y, yaw, 40.0))
    assert verdict.ok == (gap > 0)
    assert verdict.min_clearance == pytest.approx(max(gap, 0.0), abs=1e-8)


def hall(kind, side, yaw):
    """A free square from (0, 0), turned around there by a yaw, and the function that turns a point."""
    def turn(x, y):
        return math.cos(yaw) * x - math.sin(yaw) * y, math.sin(yaw) * x + math.cos(yaw) * y

    if kind == "grid":
        return GridMap(np.zeros((240, 240)), side / 240, (0.0, 0.0, yaw)), turn
    return PolygonMap(shapely.Polygon([turn(x, y) for x, y in ((0, 0), (side, 0), (side, side), (0, side))])), turn


@pytest.mark.parametrize("gap", [HAIR, -HAIR])
@pytest.mark.parametrize("kind", ["grid", "polygons"])
@pytest.mark.parametrize("word", ["LSL", "RSR"])
@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_a_hair_decides_where_the_front_swings_out(yaw, word, kind, gap):
    """Halfway round, the outer front corner, which runs on the widest circle, comes nearest to the wall."""
    map, turn = hall(kind, 20.0, yaw)
    widest = math.hypot(5.0 + 0.9, 3.6)
    side = 1 if word == "LSL" else -1
    # Around a point that far from the wall at x = 20.
    start = (*turn(20 - widest - gap, 10 - 5.0 * side), yaw)
    curve = DubinsCurve(start, 5.0, word, (1.2 * math.pi / 2 * 5.0, 0.0, 0.0))
    verdict = judged(map, vehicle_of(CAR, 5.0), curve)
    assert verdict.ok == (gap > 0)
    assert verdict.min_clearance <= max(gap, 0) + 0.001


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("depth", [1e-4, HAIR, -HAIR])
def test_a_post_that_only_the_swinging_tail_hits_is_found(side, depth):
    """The tail's outer corner runs on a circle around the middle of the turn, and the post stands on it by so much."""
    vehicle = vehicle_of([(1, 0.4), (-2, 0.4), (-2, -0.4), (1, -0.4)], 2.0)
    outer = math.hypot(2.4, 2)
    for share in (0.31, 0.51, 0.83):
        angle = share * math.pi / 2
        corner = np.array([-2.0, -side * 0.4]) - (0, side * 2.0)
        direction = math.atan2(corner[1], corner[0]) + side * angle
        post = np.array([0.0, side * 2.0]) + (outer - depth) * np.array([math.cos(direction), math.sin(direction)])
        away = post + 0.01 * np.array([[math.cos(direction + a), math.sin(direction + a)] for a in (0.5, -0.5)])
        map = PolygonMap(shapely.box(-9, -9, 9, 9) - shapely.Polygon([post, *away]))
        curve = DubinsCurve((0.0, 0.0, 0.0), 2.0, "LSL" if side > 0 else "RSR", (math.pi, 0.0, 0.0))
        assert shapely.distance(placed(vehicle, curve.poses(0.1)), obstacles_of(map)).min() > 0
        assert judged(map, vehicle, curve).ok == (depth < 0)


def around_a_post(kind):
    """20 m x 20 m with a post of 0.1 m x 0.1 m in the middle."""
    if kind == "polygons":
        return PolygonMap(shapely.box(0, 0, 20, 20) - shapely.box(10, 10, 10.1, 10.1))
    data = np.zeros((200, 200))
    data[100, 100] = 100
    return GridMap(data, 0.1)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_a_post_inside_of_the_footprint_is_contact(kind):
    """Also where the vehicle only stands, and where no corner or edge comes near it."""
    map = around_a_post(kind)
    for x, free in ((9.0, False), (10.9, False), (6.39, True), (11.01, True)):
        pose = (x, 10.0, 0.0)
        verdict = audit_path(Path.of_pose(pose), Problem(map, vehicle_of(CAR), pose, pose))
        assert verdict.ok == free
        assert verdict.min_clearance == pytest.approx(0.01 if free else 0.0, abs=1e-9)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_a_vehicle_wholly_within_an_obstacle_or_outside_is_found(kind):
    data = np.zeros((100, 100))
    data[20:80, 20:80] = 100
    map = GridMap(data, 0.2) if kind == "grid" else PolygonMap(shapely.box(0, 0, 20, 20) - shapely.box(4, 4, 16, 16))
    for x in (10.0, -30.0):
        verdict = judged(map, vehicle_of(CAR), straight(x, 10.0, 0.3, 0.5))
        assert not verdict.ok and verdict.min_clearance == 0


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_the_notch_of_a_footprint_passes_around_a_post(kind):
    """It comes to stand in the missing quarter, whose hind edge is 0.5 m ahead, and whose left edge is 0.1 m to the left."""
    map = around_a_post(kind)
    for ends_at, y, free in ((9.5 - HAIR, 10.5, True), (9.5 + HAIR, 10.5, False),
                             (9.4, 10.0 + HAIR, True), (9.4, 10.0 - HAIR, False)):
        verdict = judged(map, vehicle_of(NOTCHED), straight(5.0, y, 0.0, ends_at - 5.0))
        assert verdict.ok == free
        assert verdict.min_clearance == pytest.approx(HAIR if free else 0.0, abs=1e-9)


def test_of_a_bend_inside_its_notch_a_post_stays_free():
    """The notch' corner turns around the post: its hull would hit it."""
    vehicle = vehicle_of(NOTCHED, 4.0)
    curve = DubinsCurve((5.0, 5.0, 0.0), 4.0, "RSR", (2.0, 0.0, 0.0))
    swept = shapely.union_all(placed(vehicle, curve.poses(0.001)))
    x, y, theta = curve.end
    for ahead, free in ((0.9, True), (0.4, False)):
        post = shapely.Point(x + math.cos(theta) * ahead + math.sin(theta) * 0.5,
                             y + math.sin(theta) * ahead - math.cos(theta) * 0.5).buffer(0.05)
        assert shapely.intersects(swept, post) != free and shapely.intersects(swept.convex_hull, post)
        verdict = judged(PolygonMap(shapely.box(0, 0, 12, 12) - post), vehicle, curve)
        assert verdict.ok == free
        assert verdict.min_clearance == pytest.approx(shapely.distance(swept, post), rel=0.021, abs=0.002)


def test_the_finding_says_where():
    map = PolygonMap(shapely.box(0, 0, 20, 20) - shapely.box(10, 10, 10.1, 10.1))
    found, = judged(map, vehicle_of(CAR), straight(5.0, 10.0, 0.0, 4.0)).findings
    assert "the footprint's clearance is 0.000000 m, which is contact" in found and "at (6." in found


def test_unknown_space_counts_unless_it_is_allowed():
    data = np.zeros((60, 60))
    data[:, 40] = -1
    curve = straight(2.0, 5.0, 0.0, 4.0)
    assert not judged(GridMap(data, 0.2), vehicle_of(CAR), curve).ok
    allowed = judged(GridMap(data, 0.2), vehicle_of(CAR), curve, allow_unknown=True)
    assert allowed.ok and allowed.min_clearance == pytest.approx(2.0 - 0.9)


@pytest.mark.parametrize("away", [3, 30, 150, 700])
def test_the_least_clearance_is_right_however_far_the_obstacles(away):
    data = np.zeros((1500, 1600), np.int8)
    data[750, 750 + away] = 100
    map = GridMap(data, 0.05, (3.0, -2.0, 0.3))
    x, y = map.to_map_frame(np.array([750 * 0.05 - 3.6, 750.5 * 0.05]))
    verdict = judged(map, vehicle_of(CAR), straight(x - 2 * math.cos(0.3), y - 2 * math.sin(0.3), 0.3, 2.0))
    assert verdict.ok
    assert verdict.min_clearance == pytest.approx(min(0.05 * away, 31.0), rel=1e-6)  # so far is the edge behind


def test_of_a_large_grid_only_what_is_near_is_read(monkeypatch):
    rng = np.random.default_rng(1)
    data = np.where(rng.random((2000, 2000)) < 0.1, 100, 0).astype(np.int8)
    data[960:1040] = 0
    map, read = GridMap(data, 0.05), []
    blocked = Thresholds.blocked
    monkeypatch.setattr(Thresholds, "blocked", lambda self, part, unknown: read.append(part.size) or blocked(self, part, unknown))
    verdict = judged(map, vehicle_of(CAR), straight(20.0, 50.0, 0.0, 25.0))
    assert verdict.ok and verdict.min_clearance == pytest.approx(2.0 - 0.9, rel=0.02)
    assert 0 < sum(read) < 300_000


def test_every_part_of_a_path_counts_on_a_large_grid():
    """A lane with one blocked cell in it, or none."""
    noise = np.where(np.random.default_rng(3).random((100, 3000)) < 0.2, 100, 0).astype(np.int8)
    noise[30:70] = 0
    for column in (None, *range(150, 2900, 480)):
        data = noise.copy()
        if column is not None:
            data[57, column] = 100
        verdict = judged(GridMap(data, 0.05), vehicle_of([(0.8, 0.4), (-0.4, 0.4), (-0.4, -0.4), (0.8, -0.4)]),
                         straight(1.0, 2.5, 0.0, 148.0))
        assert verdict.ok == (column is None)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
@pytest.mark.parametrize("length", [1e6, 1e300])
def test_a_path_beyond_all_bounds_is_found(kind, length):
    map, _ = hall(kind, 20.0, 0.0)
    start = (10.0, 10.0, 0.0)
    for lengths in ((0.0, length, 0.0), (length, 0.0, 0.0), (0.0, length, length)):
        with np.errstate(all="ignore"):
            path = Path.of_curves(start, start, (DubinsCurve(start, 5.0, "LSL", lengths),))
            findings = audit_path(path, Problem(map, vehicle_of(CAR), start, start)).findings
            assert any("the footprint" in found for found in findings)


@pytest.mark.parametrize("x", [12.5, 25.0])
def test_contact_far_ahead_is_found_where_something_else_is_near(x):
    """Beside the tail stands a post that keeps clear, and another one where the front is."""
    data = np.zeros((800, 1000), np.int8)
    data[400 + 20, round(x / 0.05)] = 100
    clear = data.copy()
    data[400, round((x + 3.55) / 0.05)] = 100
    for map, free in ((GridMap(clear, 0.05), True), (GridMap(data, 0.05), False)):
        verdict = judged(map, vehicle_of(CAR), straight(x - 0.1, 20.0, 0.0, 0.1))
        assert verdict.ok == free
        assert verdict.min_clearance == pytest.approx(0.1 if free else 0.0, abs=1e-9)


def test_squares_along_a_path_are_all_that_matter():
    """Distances are those of all blocked cells, and none that is below the reach is missed."""
    rng = np.random.default_rng(8)
    for _ in range(40):
        data = np.where(rng.random((230, 310)) < rng.choice([0, 1e-4, 2e-3]), 100, 0)
        map = GridMap(data, 0.1, (*rng.uniform(-5, 5, 2), rng.uniform(-3, 3)))
        points = (map.corners()[0] + rng.random((2, 2)) @ (map.corners()[[1, 3]] - map.corners()[0])) @ (1, 1j)
        margin, reach = rng.uniform(0.1, 6, 2)
        corners = points[:, None] + margin * np.sqrt(rng.random((2, 3))) * np.exp(1j * math.tau * rng.random((2, 3)))
        squares = audit_obstacles.PathsideSquares(map, False, points, margin, reach)
        shapes = shapely.convex_hull(shapely.linestrings(np.stack([corners.real, corners.imag], axis=-1)))
        known = np.minimum(shapely.distance(shapes, obstacles_of(map)), squares.reach)
        assert squares.reach in (reach, math.inf)
        assert squares.shape_distance(corners, hull=True) == pytest.approx(known, abs=1e-9)
        assert squares.shape_distance(corners) == pytest.approx(known, abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(maps(), outlines(), POSES, st.floats(-3, 3), st.floats(0.001, 3))
def test_no_piece_has_less_than_its_bound(map, outline, pose, curvature, size):
    arcs = audit_sweep.Arcs(*(np.array([value]) for value in (*pose, curvature, size)))
    distances = naive_distances(map, vehicle_of(outline), arcs, np.linspace(0, size, 200))
    assert bounds(map, vehicle_of(outline), arcs)[0] <= distances.min() + 1e-9


def naive_distances(map, vehicle, arcs, s):
    return shapely.distance(placed(vehicle, np.column_stack(arcs.at(np.zeros(len(s), int), s))), obstacles_of(map))


def bounds(map, vehicle, arcs):
    """Of arcs, each as one piece."""
    index, begin = np.arange(len(arcs.length)), np.zeros(len(arcs.length))
    squares = (audit_obstacles.PathsideSquares(map, False, arcs.x + 1j * arcs.y, 20.0, 20.0) if isinstance(map, GridMap)
               else audit_obstacles.PolygonObstacles(map.free))
    outline = audit_sweep.PolygonSweep(vehicle.footprint, squares)
    ends = [outline.clearance(*arcs.at(index, s)) for s in (begin, arcs.length)]
    return outline.bound(arcs, audit_sweep.Pieces(index, begin, arcs.length, *ends))


@pytest.mark.parametrize("curvature", [0.2, -0.2, 0.0])
def test_the_error_of_a_bound_falls_with_the_square_of_the_length(curvature):
    """To both sides of a car, where its edges move along themselves."""
    posts = shapely.union_all([shapely.box(0.01, 1.2, 0.02, 2), shapely.box(0.01, -2, 0.02, -1.2)])
    map, sizes = PolygonMap(shapely.box(-20, -20, 20, 20) - posts), np.array([0.4, 0.04, 0.004])
    arcs = audit_sweep.Arcs(*np.zeros((3, 3)), np.full(3, curvature), sizes)
    found = bounds(map, vehicle_of(CAR), arcs)
    for i, size in enumerate(sizes):
        one = audit_sweep.Arcs(*np.zeros((3, 1)), np.array([curvature]), sizes[i:i + 1])
        error = naive_distances(map, vehicle_of(CAR), one, np.linspace(0, size, 300)).min() - found[i]
        assert -1e-9 <= error <= 0.3 * size**2


def test_rectangles_make_up_the_blocked_cells():
    rng = np.random.default_rng(4)
    for density in (0.0, 0.1, 0.5, 0.9, 1.0):
        cells = rng.random((20, 30)) < density
        counted = np.zeros(cells.shape, int)
        for left, low, right, high in audit_obstacles._rectangles(cells):
            counted[low:high, left:right] += 1
        assert np.array_equal(counted, cells)
