"""GridMap, PolygonMap and rasterise."""

import math
import pickle
import warnings

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_rrt_ros.planning import InvalidPose, Problem, Settings, Vehicle, audit_path, plan, plan_through, prepare, save_map
from dubins_rrt_ros.planning.maps.cells import FREE, OCCUPIED, DoubtfulGrid
from dubins_rrt_ros.planning.maps.errors import MapError, MapMetadataError
from dubins_rrt_ros.planning.maps.frame import DoubtfulYaw
from dubins_rrt_ros.planning.maps.model import DoubtfulObstacles, GridMap, PolygonMap, rasterise

coordinates = st.floats(-1e3, 1e3)


def test_cells_of_a_grid_are_small_and_read_only():
    grid = GridMap([[0, 100, -1]], 1)
    assert grid.data.dtype == np.int8
    assert grid.size == (3, 1)
    with pytest.raises(ValueError, match="read-only"):
        grid.data[0, 0] = 5


@pytest.mark.parametrize("allow_unknown, expected", [
    (False, [False, False, True, True, True, True, True]), (True, [False, False, False, False, True, True, False])])
def test_blocked(allow_unknown, expected):
    assert GridMap([[0, 25, 26, 64, 65, 100, -1]], 1.0).blocked(allow_unknown).tolist() == [expected]


def test_frames_of_a_turned_grid():
    grid = GridMap(np.zeros((2, 4)), 0.5, (1, 2, math.pi / 2))
    np.testing.assert_allclose(grid.corners(), [[1, 2], [1, 4], [0, 4], [0, 2]], atol=1e-15)
    np.testing.assert_allclose(grid.to_map_frame([[2, 0], [0, 1]]), [[1, 4], [0, 2]], atol=1e-15)
    np.testing.assert_allclose(grid.to_grid_frame([0, 4]), [2, 1], atol=1e-15)


@given(coordinates, coordinates, st.floats(-10, 10), coordinates, coordinates)
def test_frames_are_inverse_and_rigid(x, y, yaw, px, py):
    grid = GridMap([[0]], 1.0, (x, y, yaw))
    there = grid.to_map_frame(np.array([px, py]))
    assert math.dist(there, (x, y)) == pytest.approx(math.hypot(px, py), abs=1e-9)
    np.testing.assert_allclose(grid.to_grid_frame(there), [px, py], atol=1e-9)


@pytest.mark.parametrize("changes, word", [
    ({"data": np.zeros((0, 3))}, "cells"), ({"data": np.zeros(3)}, "cells"), ({"resolution": 0}, "resolution"),
    ({"resolution": math.nan}, "resolution"), ({"resolution": math.inf}, "resolution"),
    ({"origin": (0, math.nan, 0)}, "origin"), ({"origin": (0, 0, 1e300)}, "origin"), ({"origin": (0, 0)}, "origin"),
    ({"origin": 3}, "origin"), ({"resolution": "fine"}, "resolution"), ({"resolution": None}, "resolution")])
def test_bad_grid(changes, word):
    with pytest.raises(MapError, match=f"^yard: .*{word}.*; ?.*"):
        GridMap(**{"data": [[0]], "resolution": 1.0, "name": "yard", **changes})


@pytest.mark.parametrize("data, cells", [
    ([[True, False]], [[100, 0]]), (np.array([[False, True]]), [[0, 100]]), (np.zeros((1, 2), int), [[0, 0]]),
    (np.zeros((1, 2)), [[0, 0]]), ([[0.0, 100.0, -1.0]], [[0, 100, -1]]), (np.array([[0, 255 - 155]], np.uint8), [[0, 100]]),
    ([[0, 1, 2]], [[0, 1, 2]]), ([[0, -1]], [[0, -1]])])
def test_cells_that_are_understood(data, cells):
    assert GridMap(data, 1.0).data.tolist() == cells


@pytest.mark.parametrize("data, remedy", [
    ([[0, 1]], "give 100 for an obstacle, or data == 1"), ([[1, 1]], "give 100"), ([[0, 1, -1]], "give 100"),
    (np.array([[0, 1]], np.int8), "give 100"), ([[0.0, 1.0]], "give 100"), ([[0.0, 0.7, 1.0]], "holds 0.7; give whole percent"),
    ([[0.0, 99.5]], "holds 99.5"), ([[math.nan, 0.0]], "nan"), ([["a"]], "give integers"), ([[0, 300]], "from 0 to 300")])
def test_cells_that_may_be_meant_otherwise_are_refused_with_the_remedy(data, remedy):
    with pytest.raises(MapError, match=remedy):
        GridMap(data, 1.0)


@pytest.mark.parametrize("data, remedy", [
    (np.ma.masked_array([[0, 0]], [[False, True]]), "cells are masked; .* such as data.filled"),
    (np.zeros((4, 5, 3), np.uint8), r"shape \(4, 5, 3\) have not rows and columns alone"), (np.zeros(5), "give .rows, columns.")])
def test_cells_that_a_grid_has_no_values_for_are_refused(data, remedy):
    with pytest.raises(MapError, match=remedy):
        GridMap(data, 1.0)
    assert GridMap(np.ma.masked_array([[0, 100]], False), 1.0).data.tolist() == [[0, 100]]


def test_a_truth_value_is_no_resolution():
    with pytest.raises(MapMetadataError, match="resolution is True"):
        GridMap([[0, 100]], True)


@pytest.mark.parametrize("pose", [
    ("1", "1", "0"), "110", (True, 1, 0), (np.True_, 1, 0), {0.0, 1.0, 2.0}, {1: 1, 2: 1, 0: 0}, b"110"],
                         ids=["texts", "text", "truth value", "numpy truth value", "set", "mapping", "bytes"])
def test_texts_truth_values_and_what_has_no_order_are_no_pose(pose):
    grid = GridMap(np.zeros((40, 40)), 0.1)
    with pytest.raises(InvalidPose, match="The goal pose is .*; give three finite numbers"):
        Problem(grid, Vehicle(), (1, 1, 0), pose)
    with pytest.raises(MapMetadataError, match="origin is .*; give x and y, finite, in metres"):
        GridMap(np.zeros((40, 40)), 0.1, pose)


def test_a_text_is_no_resolution():
    with pytest.raises(MapMetadataError, match="resolution is '0.1'"):
        GridMap([[0, 100]], "0.1")


@pytest.mark.parametrize("corners", [[("0", "0"), ("5", "0"), ("5", "5")], [(False, False), (True, False), (True, True)]],
                         ids=["texts", "truth values"])
def test_corners_are_numbers(corners):
    with pytest.raises(MapError, match="the bounds polygon is .*; give a polygon"):
        PolygonMap.of(corners)
    with pytest.raises(MapError, match="obstacle 1 is .*; give a polygon"):
        PolygonMap.of(shapely.box(-9, -9, 9, 9), [corners])


def test_obstacles_outside_of_the_bounds_are_told():
    """As where x and y are swapped in them, or the unit is another."""
    with pytest.warns(DoubtfulObstacles, match=r"yard: 1 of 2 obstacles lie outside .*: obstacle 2, which begins at \(40, 4\)"):
        yard = PolygonMap.of(shapely.box(0, 0, 30, 50), [shapely.box(3, 39, 5, 41), shapely.box(40, 4, 42, 5)], name="yard")
    assert yard.free.area == 1500 - 4


def test_a_share_next_to_a_whole_number_is_quoted_with_all_digits():
    with pytest.raises(MapError, match="a cell holds 0.999999999; give whole percent"):
        GridMap([[0.999999999, 0.0]], 1.0)


def test_a_grid_of_small_numbers_is_taken_with_a_warning():
    with pytest.warns(DoubtfulGrid, match="no value above 2, which stands for 2 % and is free"):
        GridMap([[0, 1, 2]], 1.0)
    with pytest.warns(DoubtfulGrid, match="1 and 100 and no value between, and 1 stands for 1 % and is free"):
        GridMap([[0, 1, -1, 100]], 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for data in ([[0, 10]], [[0, 0]], [[-1, 100]], [[0, 1, 2, 100]]):
            GridMap(data, 1.0)
        for data in ([[0, 1, 2]], [[0, 1, 100]]):
            GridMap(data, 1.0, percent=True)


def test_an_origin_in_degrees_is_taken_with_a_warning():
    with pytest.warns(DoubtfulYaw, match="the origin has the yaw 90 rad; did you mean 1.5708?"):
        grid = GridMap([[0, 100]], 1.0, (0, 0, 90))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        grid.window((0.5, 0.5), 3.0)


@pytest.mark.parametrize("given", ["maze", np.zeros((4, 4)), None], ids=["name", "array", "none"])
def test_what_is_no_map_is_refused_by_a_problem(given):
    with pytest.raises(TypeError, match="give a GridMap, a PolygonMap or a World; load_map reads files"):
        Problem(given, Vehicle(), (0, 0, 0), (1, 0, 0))


def test_what_a_function_does_not_take_is_named():
    """Which was an AttributeError somewhere below."""
    grid = GridMap(np.zeros((40, 40)), 0.1)
    problem = Problem(grid, Vehicle(), (1, 1, 0), (3, 3, 0))
    for call, says in ((lambda: plan(Settings(), problem), "the problem is Settings"),
                       (lambda: plan(None), "the problem is None"),
                       (lambda: plan(problem, {"samples": 3}), "the settings are {'samples': 3}; give Settings"),
                       (lambda: plan(problem, cancel=True), "cancel is True; give a function"),
                       (lambda: plan_through(problem, [], on_progress=5), "on_progress is 5; give a function"),
                       (lambda: plan(problem, seed_path=[(1, 1, 0)]), "seed_path is .*; give a Path, such as the path of a Plan"),
                       (lambda: plan_through(problem, [], seed_path=grid), "seed_path is GridMap"),
                       (lambda: rasterise(grid, 0.1), "the map is GridMap.*; give a PolygonMap"),
                       (lambda: save_map(np.zeros((4, 4)), "map.yaml"), "the map is array.*; give a GridMap"),
                       (lambda: plan_through(problem, [], 3), "the settings are 3; give Settings"),
                       (lambda: plan_through(problem, None), "the waypoints are None; give a list of poses"),
                       (lambda: plan_through(grid, [(1, 2)]), "the problem is GridMap"),
                       (lambda: prepare(np.zeros((4, 4)), Vehicle()), "give a GridMap or a PolygonMap; load_map reads files"),
                       (lambda: prepare(grid, (1.0, 0.2)), r"the vehicle is \(1.0, 0.2\); give a Vehicle"),
                       (lambda: audit_path([(1, 1, 0), (3, 3, 0)], problem), "give a Path, such as that of a Plan")):
        with pytest.raises(TypeError, match=says):
            call()


def test_rows_of_several_lengths_are_refused():
    with pytest.raises(MapError, match="rows of cells are not all of one length"):
        GridMap([[0, 100], [0]], 1.0)


def test_one_percent_is_taken_where_percent_is_said():
    grid = GridMap([[0, 1, -1]], 1.0, percent=True)
    assert grid.data.tolist() == [[0, 1, -1]]
    for again in (pickle.loads(pickle.dumps(grid)), grid.window((0.5, 0.5), 3.0)):
        assert again.data.tolist() == grid.data.tolist() and not again.data.flags.writeable


@pytest.mark.parametrize("wall", [True, 100])
def test_a_path_goes_around_a_wall_of_booleans_as_around_one_of_percent(wall):
    cells = np.zeros((100, 200), type(wall))
    cells[:60, 100] = wall
    answer = plan(Problem(GridMap(cells, 0.1), Vehicle(), (2, 2, 0), (18, 2, 0)), Settings(seed=1))
    assert 17.3 < answer.length < 18.5


def test_id_of_a_grid_is_that_of_its_content():
    grid = GridMap([[0, 9]], 0.5, (1, 2, 3), "a")
    assert grid.id == GridMap(np.array([[0, 9]], np.int64), 0.5, (1.0, 2.0, 3.0), "b").id
    others = [GridMap([[0, 2]], 0.5, (1, 2, 3)), GridMap([[0], [9]], 0.5, (1, 2, 3)),
              GridMap([[0, 9]], 0.25, (1, 2, 3)), GridMap([[0, 9]], 0.5, (1, 2, 3.5))]
    assert len({grid.id, *(other.id for other in others)}) == 5


def test_id_of_polygons_is_that_of_their_content():
    assert PolygonMap(shapely.box(0, 0, 1, 1), name="a").id == PolygonMap(shapely.box(0, 0, 1, 1), name="b").id
    assert PolygonMap(shapely.box(0, 0, 1, 1)).id != PolygonMap(shapely.box(0, 0, 1, 2)).id


def test_corners_of_polygons():
    assert PolygonMap(shapely.box(1, 2, 4, 8)).corners().tolist() == [[1, 2], [4, 2], [4, 8], [1, 8]]


@pytest.mark.parametrize("free", [
    shapely.Point(0, 0), shapely.Polygon(), shapely.LineString([(0, 0), (1, 1)]),
    shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)])])
def test_bad_polygons(free):
    with pytest.raises(MapError, match="^yard: .*free space"):
        PolygonMap(free, name="yard")


SQUARE, WALL = [(0, 0), (10, 0), (10, 6), (0, 6)], [(4, 0), (5, 0), (5, 4), (4, 4)]
PIECES = [[(6, 1), (7, 1), (7, 2)], WALL]


@pytest.mark.parametrize("bounds, obstacles", [
    (SQUARE, PIECES), ([*SQUARE, SQUARE[0]], np.array([SQUARE[:3], SQUARE[:3]]) / 10 + 5),
    (shapely.Polygon(SQUARE), [shapely.Polygon(WALL)]),
    (SQUARE, shapely.MultiPolygon([shapely.Polygon(WALL), shapely.box(8, 1, 9, 2)])), (SQUARE, ())])
def test_polygons_of_bounds_and_obstacles(bounds, obstacles):
    of_each = obstacles.geoms if isinstance(obstacles, shapely.Geometry) else obstacles
    expected = shapely.Polygon(SQUARE) - shapely.union_all([shapely.Polygon(obstacle) for obstacle in of_each])
    yard = PolygonMap.of(bounds, obstacles, name="yard")
    assert yard.free.equals(expected) and yard.name == "yard"
    assert PolygonMap.of(bounds).free.area == 60


def ring(x, y, radius, corners=3000):
    angles = np.linspace(0, math.tau, corners, endpoint=False)
    return shapely.Polygon(np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)]))


APART = [ring(x, y, 0.9) for x in (1, 3, 5, 7) for y in (1, 3)]


@pytest.mark.parametrize(("bounds", "obstacles"), [
    (shapely.box(0, 0, 10, 6), APART), (shapely.box(0, 0, 10, 6) - ring(3, 5, 0.5), APART),
    (shapely.box(0, 0, 10, 6), [*APART, ring(3, 3, 0.5)]), (shapely.box(0, 0, 10, 6), [*APART, ring(20, 3, 0.5)]),
    (shapely.box(0, 0, 10, 6) - ring(3, 5, 0.5), [*APART, ring(3, 5, 0.2)]),
    (shapely.box(0, 0, 10, 6) - ring(3, 5, 0.2), [*APART, ring(3, 5, 0.5)]),
    (shapely.box(0, 0, 10, 6), [*APART[1:], APART[0] - ring(1, 1, 0.5)]), (shapely.box(0, 0, 10, 6), [*APART, ring(6.5, 3, 1)]),
    (shapely.MultiPolygon([shapely.box(0, 0, 10, 6), ring(20, 3, 1)]), APART), (ring(4, 2, 2), APART)],
    ids=["apart", "bounds with a hole", "nested", "outside", "in a hole", "around a hole", "hollow", "crossing", "two bounds",
         "across the bounds"])
def test_obstacles_of_many_corners_are_taken_from_the_bounds(bounds, obstacles):
    free = PolygonMap.of(bounds, obstacles).free
    assert free.is_valid and free.equals(bounds - shapely.union_all(obstacles))


def test_a_path_goes_around_the_obstacles_of_polygons():
    problem = Problem(PolygonMap.of(SQUARE, [WALL]), Vehicle(turning_radius=0.5), (1, 1, 0), (9, 1, 0))
    assert 9.5 < plan(problem, Settings(planner="rrt", planning_time=60.0, seed=1)).length < 11


@pytest.mark.parametrize("bounds, obstacles, reason", [
    (SQUARE, WALL, r"obstacle 1 is \(4, 0\); give a polygon"),
    ((0, 0, 10, 6), [], "the bounds polygon is .*three or more corners"),
    (SQUARE, 7, "the obstacles are 7; give a list"), (SQUARE, [WALL, WALL[:2]], "obstacle 2 is"),
    (SQUARE, [SQUARE], "no free space"),
    (SQUARE, [[(0, 0), (1, 1), (1, 0), (0, 1)]], "obstacle 1 is not valid"),
    (SQUARE, [[(0, 0), (math.nan, 0), (1, 1)]], "obstacle 1 has"),
    ([(0, 0), (1e10, 0), (0, 5)], [], "the bounds polygon has the coordinate 1e.10"),
    (shapely.Point(0, 0), [], "the bounds polygon is a Point"),
    ("yard", [], "the bounds polygon is 'yard'")])
def test_bounds_and_obstacles_that_are_no_polygons_are_named(bounds, obstacles, reason):
    with pytest.raises(MapError, match=reason):
        PolygonMap.of(bounds, obstacles)


def test_obstacles_are_not_taken_for_the_name():
    with pytest.raises(TypeError, match="positional"):
        PolygonMap(shapely.box(0, 0, 9, 9), [shapely.box(1, 1, 2, 2)])
    with pytest.raises(MapError, match=r"the name of a map is \[.*PolygonMap.of"):
        PolygonMap(shapely.box(0, 0, 9, 9), name=[shapely.box(1, 1, 2, 2)])
    with pytest.raises(MapError, match=r"the free space is \[.*PolygonMap.of"):
        PolygonMap(SQUARE)
    again = pickle.loads(pickle.dumps(PolygonMap(shapely.box(0, 0, 9, 9), name="yard")))
    assert (again.name, again.free.area) == ("yard", 81)


@pytest.mark.parametrize("resolution", [0, -0.1, math.inf, math.nan, "0.1", None])
def test_a_resolution_that_is_none_makes_no_grid(resolution):
    with pytest.raises(MapMetadataError, match="resolution is .*; give a positive number"):
        rasterise(PolygonMap(shapely.box(0, 0, 1, 1)), resolution)


def naive_rasterise(polygons, resolution):
    """The same by the area of what is free in every cell."""
    x0, y0, x1, y1 = polygons.free.bounds
    columns, rows = round((x1 - x0) / resolution) + 2, round((y1 - y0) / resolution) + 2
    data = np.empty((rows, columns), int)
    for row in range(rows):
        for column in range(columns):
            x, y = x0 + (column - 1) * resolution, y0 + (row - 1) * resolution
            free = polygons.free.intersection(shapely.box(x, y, x + resolution, y + resolution)).area
            data[row, column] = FREE if free > resolution**2 * (1 - 1e-6) else OCCUPIED
    return data


# Sixteenths, so that the cells' borders are exact and an obstacle that meets a cell takes a real part of it.
sixteenths = st.integers(1, 63).map(lambda number: number / 16)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(sixteenths, sixteenths, sixteenths, sixteenths), max_size=4))
def test_rasterise_agrees_with_the_naive_way(obstacles):
    boxes = [shapely.box(min(a, c), min(b, d), max(a, c), max(b, d)) for a, b, c, d in obstacles if a != c and b != d]
    polygons = PolygonMap(shapely.box(0, 0, 4, 4) - shapely.union_all(boxes), name="yard")
    grid = rasterise(polygons, 0.25)
    assert grid.data.tolist() == naive_rasterise(polygons, 0.25).tolist()
    x0, y0, _, _ = polygons.free.bounds
    assert grid.origin == (x0 - 0.25, y0 - 0.25, 0)
    assert (grid.resolution, grid.name) == (0.25, "yard")


def test_rasterise_of_a_slanted_obstacle_never_frees_what_is_occupied():
    polygons = PolygonMap(shapely.box(0, 0, 3, 2) - shapely.Polygon([(0.5, 0.5), (2.3, 0.9), (1.1, 1.7)]))
    grid = rasterise(polygons, 0.1)
    assert grid.data.shape == (22, 32)
    points = np.random.default_rng(1).uniform((-0.2, -0.2), (3.2, 2.2), (5000, 2))
    columns, rows = np.floor(grid.to_grid_frame(points) / 0.1).astype(int).T
    inside = (rows >= 0) & (rows < 22) & (columns >= 0) & (columns < 32)
    free_cell = np.zeros(len(points), bool)
    free_cell[inside] = grid.data[rows[inside], columns[inside]] == FREE
    free_point = shapely.intersects_xy(polygons.free, points)
    assert not (free_cell & ~free_point).any()
    # Only cells that the border meets are lost.
    lost = shapely.distance(shapely.points(points[free_point & ~free_cell]), polygons.free.boundary)
    assert lost.max() <= 0.1 * math.sqrt(2)


def test_rasterise_surrounds_the_map_and_rounds_its_size_up():
    data = rasterise(PolygonMap(shapely.box(0, 0, 1.05, 0.95)), 0.1).data
    assert data.shape == (12, 13)
    assert (data[[0, -1]] == OCCUPIED).all()
    assert (data[:, [0, -1, -2]] == OCCUPIED).all()
    assert (data[1:10, 1:11] == FREE).all()
