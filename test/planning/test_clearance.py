"""The clearance field against brute force, on random maps and where shapes touch."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from support import naive
from support.cases import boxes_grid, holed_polygons, maze_grid, naive_clearance, random_map, random_pose, scaled

from dubins_rrt_ros.planning import ClearanceField, DubinsCurve, GridMap, PolygonMap, Vehicle
from dubins_rrt_ros.planning.curves.dubins import shortest

MAPS = {
    "boxes": lambda rng: boxes_grid(rng), "unknown": lambda rng: boxes_grid(rng, unknown=True),
    "crowded": lambda rng: boxes_grid(rng, boxes=60), "fine": lambda rng: boxes_grid(rng, side=50, resolution=0.05),
    "coarse": lambda rng: boxes_grid(rng, side=7, resolution=1.7, boxes=2),
    "empty": lambda rng: boxes_grid(rng, boxes=0),
    "maze": maze_grid, "circles": lambda rng: holed_polygons(rng, "circles"),
    "walls": lambda rng: holed_polygons(rng, "walls"),
    "polygons": lambda rng: holed_polygons(rng, "boxes"), "one cell": lambda rng: GridMap([[0]], 3.0, (0, 0, 0.3)),
}
GRIDS = ("boxes", "unknown", "crowded", "fine", "coarse", "empty", "maze", "one cell")


def keeps(field, curve, need):
    """Whether a disc of a radius is free along a curve."""
    return field.curve_is_free(curve, Vehicle(robot_radius=float(need)))


def random_points(rng, map, count, share_outside=0.2):
    """Points of the map, and some around it."""
    corners = map.corners()
    share = rng.uniform(-share_outside, 1 + share_outside, (count, 2))
    return corners[0] + share @ (corners[[1, 3]] - corners[0])


@pytest.mark.slow
@pytest.mark.parametrize("allow_unknown", [False, True])
@pytest.mark.parametrize("kind", MAPS)
def test_distances_are_those_of_brute_force(kind, allow_unknown):
    rng = np.random.default_rng(1)
    for _ in range(3):
        map = MAPS[kind](rng)
        points = random_points(rng, map, scaled(2000))
        expected = naive_clearance(map, allow_unknown)(points)
        np.testing.assert_allclose(ClearanceField(map, allow_unknown).at(points), expected, rtol=0, atol=1e-9)


def test_unknown_space_counts_unless_it_is_allowed():
    grid = GridMap([[0, 0, 0, 0, -1]], 1.0)
    assert ClearanceField(grid).at([(3.75, 0.5)]) == pytest.approx(0.25)
    assert ClearanceField(grid, True).at([(3.75, 0.5)]) == pytest.approx(0.5)
    assert ClearanceField(grid).at([(4.5, 0.5)]) == 0


def test_points_of_any_shape():
    field = ClearanceField(GridMap(np.zeros((4, 4)), 1.0))
    assert field.at(np.array([2.0, 1.5])) == pytest.approx(1.5)
    assert field.at(np.full((2, 3, 2), 2.0)).tolist() == [[2.0] * 3] * 2
    assert field.at(np.empty((0, 2))).shape == (0,)


@pytest.mark.parametrize("map", [GridMap([[0]], 1.0), PolygonMap(shapely.box(0, 0, 1, 1))])
def test_read_only_points(map):
    points = np.array([[0.5, 0.25]])
    points.setflags(write=False)
    assert ClearanceField(map).at(points) == pytest.approx(0.25)


@pytest.mark.parametrize("map", [GridMap([[0]], 1.0), PolygonMap(shapely.box(0, 0, 1, 1))])
def test_not_a_number_is_outside(map):
    assert ClearanceField(map).at([(math.nan, 0.5), (0.5, math.inf), (1e300, -1e300)]).tolist() == [0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", MAPS)
def test_a_curve_is_free_exactly_where_its_least_clearance_suffices(kind):
    """Never with less than what is needed, always with a millimetre more."""
    rng = np.random.default_rng(2)
    map = MAPS[kind](rng)
    clearance, field = naive_clearance(map), ClearanceField(map)
    tested = 0
    for _ in range(scaled(50, least=20)):
        points = random_points(rng, map, 2, share_outside=0)
        start, goal = ((*point, rng.uniform(-math.pi, math.pi)) for point in points.tolist())
        curve = shortest(start, goal, rng.uniform(0.1, 1))
        if not clearance(points).all():
            continue
        tested += check_curve(field, clearance, curve)
    assert tested > 0


def check_curve(field, clearance, curve):
    """Whether there was a clearance to tell the limit by."""
    least = clearance(naive.points_along(curve.start, curve.word, curve.lengths, curve.radius, 0.001)).min()
    assert not keeps(field, curve, least + 1e-9)
    if least <= 0.0011:
        return False
    assert keeps(field, curve, least - 0.0011)
    assert keeps(field, curve, 0)
    return True


@pytest.mark.slow
@pytest.mark.parametrize("allow_unknown", [False, True])
def test_cells_that_may_be_free_hold_every_free_point(allow_unknown):
    rng = np.random.default_rng(3)
    for _ in range(10):
        map = random_map(rng)
        field = ClearanceField(map, allow_unknown)
        points = random_points(rng, map, 1000, share_outside=0)
        found = naive_clearance(map, allow_unknown)(points)
        for need in (0.0, 0.1, 0.3, 1.0):
            free = points[found >= need] if need else points[found > 0]
            assert field.may_be_free(free, need).all()
            assert field.possibly_free(need)[field.cells(free)].all()


def test_cells_that_cannot_be_free_are_ruled_out():
    """The supersets are not everything: far inside an obstacle, and where no point has the room, they are empty."""
    grid = GridMap(np.pad(np.full((20, 20), 100), 20), 0.1)
    field = ClearanceField(grid)
    assert not field.may_be_free(np.array([[3.0, 3.0]]), 0).any()
    assert field.possibly_free(0).sum() == 60 * 60 - 20 * 20
    assert not field.possibly_free(2.0).any()
    assert not ClearanceField(PolygonMap(shapely.box(0, 0, 3, 3))).possibly_free(1.7).any()


@pytest.mark.parametrize("kind", MAPS)
def test_the_raster_holds_lower_bounds(kind):
    rng = np.random.default_rng(4)
    map = MAPS[kind](rng)
    field = ClearanceField(map)
    points = random_points(rng, map, 3000, share_outside=0)
    found = naive_clearance(map)(points)
    bounds = np.asarray(field.kernel.field)[field.cells(points)]
    assert (found[bounds < 0] == 0).all()
    assert (bounds <= found + 1e-9)[bounds >= 0].all()


def wall_grid(yaw=0.0):
    """Free from x = 0 to 2 m, 20 m high, beside a wall."""
    data = np.zeros((80, 12))
    data[:, 8:] = 100
    return GridMap(data, 0.25, (0.0, 0.0, yaw))


@pytest.mark.parametrize("map", [wall_grid(), PolygonMap(shapely.box(0, 0, 2, 20))])
@pytest.mark.parametrize("gap", [0.1, 0.25, 0.3, 0.75])
def test_along_a_wall(map, gap):
    curve = DubinsCurve((2 - gap, 2.0, math.pi / 2), 1.0, "LSL", (0.0, 10.0, 0.0))
    field = ClearanceField(map)
    assert keeps(field, curve, gap - 0.0006)
    assert not keeps(field, curve, gap + 1e-9)


@pytest.mark.parametrize("turn, x, gap", [("LSL", 1.5, 0.5), ("RSR", 0.25, 0.25)])
def test_a_turn_touches_at_its_widest(turn, x, gap):
    """A full turn of radius 0.25 m away from the wall, and one that comes within `gap` of a wall or an edge."""
    field = ClearanceField(wall_grid())
    curve = DubinsCurve((x, 10.0, math.pi / 2), 0.25, turn, (math.pi / 2, 0.0, 0.0))
    assert keeps(field, curve, gap - 0.0006)
    assert not keeps(field, curve, gap + 1e-9)


def test_no_way_between_squares_that_touch_at_a_corner():
    field = ClearanceField(GridMap([[0, 0, 100], [0, 0, 0], [100, 0, 0]][::-1], 1.0))
    through = DubinsCurve((0.5, 0.5, 0.0), 1.0, "LSL", (0.0, 2.0, 0.0))
    assert not keeps(field, through, 0.0)
    data = np.zeros((4, 4))
    data[1, 1] = data[2, 2] = 100
    field = ClearanceField(GridMap(data, 1.0))
    diagonal = DubinsCurve((0.5, 3.5, -math.pi / 4), 1.0, "LSL", (0.0, 3 * math.sqrt(2), 0.0))
    assert not keeps(field, diagonal, 0.0)
    assert not keeps(field, DubinsCurve((0.5, 3.4, -math.pi / 4), 1.0, "LSL", (0.0, 3 * math.sqrt(2), 0.0)), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("need", [0.0, 1e-6, 0.1])
@pytest.mark.parametrize("thickness", [1, 1e-2, 1e-4, 1e-7])
def test_no_obstacle_is_too_thin(thickness, need):
    thin = PolygonMap(shapely.box(0, 0, 20, 10) - shapely.box(10, 1, 10 + thickness, 9))
    field = ClearanceField(thin)
    rng = np.random.default_rng(5)
    for x, y in rng.uniform((1.1, 1.1), (8, 8.9), (scaled(2000), 2)).tolist():
        assert not keeps(field, DubinsCurve((x, y, 0.0), 1.0, "LSL", (0.0, 18 - x, 0.0)), need)
    assert keeps(field, DubinsCurve((2.0, 0.5, 0.0), 1.0, "LSL", (0.0, 16.0, 0.0)), 0.4)


def test_one_occupied_cell_is_not_jumped():
    data = np.zeros((200, 200))
    data[100, 100] = 100
    field = ClearanceField(GridMap(data, 0.05))
    for y in np.linspace(5.0, 5.05, 11):
        assert not keeps(field, DubinsCurve((1.0, y, 0.0), 1.0, "LSL", (0.0, 8.0, 0.0)), 0.0)
    assert keeps(field, DubinsCurve((1.0, 5.3, 0.0), 1.0, "LSL", (0.0, 8.0, 0.0)), 0.249)


def test_out_of_the_map_and_back_is_not_free():
    field = ClearanceField(GridMap(np.zeros((20, 20)), 0.5))
    curve = DubinsCurve((9.5, 5.0, 0.0), 1.0, "LSL", (math.pi, 0.0, 0.0))
    assert not keeps(field, curve, 0.0)
    assert keeps(field, DubinsCurve((8.5, 5.0, 0.0), 1.0, "LSL", (math.pi, 0.0, 0.0)), 0.499)


def test_a_curve_of_length_0_is_its_pose():
    field = ClearanceField(wall_grid())
    still = DubinsCurve((1.5, 10.0, 0.0), 1.0, "LSL", (0.0, 0.0, 0.0))
    assert keeps(field, still, 0.499)
    assert not keeps(field, still, 0.5 + 1e-9)


def test_a_cell_holds_the_points_over_it():
    grid = GridMap(np.zeros((3, 5)), 0.5, (1.0, 2.0, 0.7))
    row, column = np.divmod(np.arange(15), 5)
    centres = grid.to_map_frame(np.column_stack([column + 0.5, row + 0.5]) * 0.5)
    found = ClearanceField(grid).cells(centres)
    np.testing.assert_array_equal(found, [row, column])


def test_walk_of_long_random_curves_in_a_turned_map():
    """Curves of all words, driven at random, most of them into something."""
    rng = np.random.default_rng(8)
    grid = boxes_grid(rng, boxes=3)
    field, clearance = ClearanceField(grid), naive_clearance(grid)
    centre = grid.corners().mean(axis=0)
    tested = 0
    for _ in range(scaled(200, least=20)):
        x, y, theta = random_pose(rng, 3.0)
        curve = DubinsCurve((centre[0] + x, centre[1] + y, theta), rng.uniform(0.1, 1), naive.WORDS[rng.integers(6)],
                            tuple(rng.uniform(0, 3, 3)))
        tested += check_curve(field, clearance, curve)
    assert tested > 3


def random_grid(rng, shape, share, resolution=0.05):
    return GridMap(np.where(rng.random(shape) < share, 100, 0), resolution)


def assert_same(found, expected):
    """Bit for bit the same field, and the same exact distances."""
    np.testing.assert_array_equal(np.asarray(found.kernel.field), np.asarray(expected.kernel.field))
    np.testing.assert_array_equal(np.asarray(found.kernel.row_gap), np.asarray(expected.kernel.row_gap))


@pytest.mark.parametrize("share", [0, 0.001, 0.1, 0.9, 1])
@pytest.mark.parametrize("shape", [(1, 1), (1, 200), (200, 1), (100, 150), (600, 500)])
def test_the_raster_is_the_distance_between_centres_less_a_diagonal(shape, share):
    """Rounded down to float32; from scipy's transform, with a ring of obstacles around."""
    grid = random_grid(np.random.default_rng(9), shape, share, 0.03337)
    between = ndimage.distance_transform_edt(np.pad(grid.data == 0, 1))[1:-1, 1:-1] * grid.resolution
    lower = np.nextafter((between - math.sqrt(2) * grid.resolution).astype(np.float32), np.float32(-math.inf)).clip(min=0)
    np.testing.assert_array_equal(np.asarray(ClearanceField(grid).kernel.field), np.where(grid.data == 100, -1, lower))


@settings(max_examples=scaled(300, least=20))
@given(st.integers(0, 2**31), st.sampled_from([0, 0.0005, 0.01, 0.2, 0.9]), st.sampled_from([0, 0.1, 1]))
def test_a_changed_map_has_the_field_of_a_new_one(seed, share, new_share):
    rng = np.random.default_rng(seed)
    old = random_grid(rng, rng.integers(1, (60, 250)), share)
    before = ClearanceField(old)
    kept = np.array(before.kernel.field), np.array(before.kernel.row_gap)
    data = old.data.copy()
    row, column = rng.integers(0, data.shape)
    box = data[row:row + rng.integers(1, 12), column:column + rng.integers(1, 30)]
    box[...] = np.where(rng.random(box.shape) < new_share, 100, 0)
    changed = GridMap(data, old.resolution, (1.0, 2.0, 0.3))
    found = ClearanceField(changed, previous=before)
    assert_same(found, ClearanceField(changed))
    points = random_points(rng, changed, 20)
    np.testing.assert_array_equal(found.at(points), ClearanceField(changed).at(points))
    np.testing.assert_array_equal(np.asarray(before.kernel.field), kept[0])
    np.testing.assert_array_equal(np.asarray(before.kernel.row_gap), kept[1])


@pytest.mark.parametrize("previous", [
    GridMap(np.zeros((9, 8)), 0.5), GridMap(np.zeros((8, 9)), 0.25), PolygonMap(shapely.box(0, 0, 4, 4)), None,
], ids=["shape", "resolution", "polygons", "none"])
def test_a_map_of_another_kind_is_no_help_and_no_harm(previous):
    grid = random_grid(np.random.default_rng(10), (8, 9), 0.2, 0.5)
    assert_same(ClearanceField(grid, previous=previous and ClearanceField(previous)), ClearanceField(grid))
