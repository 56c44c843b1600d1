"""The distances around obstacles and the lower bound by them: below every path, and not far below the shortest way."""

import math

import numpy as np
import pytest
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from support.cases import (
    boxes_grid,
    empty_map,
    free_pose,
    holed_polygons,
    maze_grid,
    naive_clearance,
    random_maps,
    random_problem,
    scaled,
)

from dubins_rrt_ros.planning import ClearanceField, GridMap, PolygonMap, Problem, Settings, Status, Vehicle, plan
from dubins_rrt_ros.planning.collision import clearance
from dubins_rrt_ros.planning.curves.dubins import shortest
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.lower_bound import lower_bound

MAPS = {
    "boxes": boxes_grid, "crowded": lambda rng: boxes_grid(rng, boxes=40), "maze": maze_grid,
    "fine": lambda rng: boxes_grid(rng, side=90, resolution=0.1, boxes=30), "empty": lambda rng: boxes_grid(rng, boxes=0),
    "circles": lambda rng: holed_polygons(rng, "circles"), "walls": lambda rng: holed_polygons(rng, "walls"),
}
#: The steps to the neighbours of a lattice's node in 32 directions, those one way only.
STEPS = [(i, j) for i in range(-4, 5) for j in range(5) if (j, i) > (0, 0) and math.gcd(i, j) == 1 and abs(i) + j <= 5]


def free_points(rng, map, need, count):
    """(n, 2) random points with the clearance `need`."""
    corners = map.corners()
    points = corners[0] + rng.random((count, 2)) @ (corners[[1, 3]] - corners[0])
    return points[naive_clearance(map)(points) > need]


def lattice_lengths(map, need, goal, points, spacing):
    """(n,) lengths of ways from (n, 2) points to the goal on a lattice: no shorter than the shortest ways."""
    clearance = naive_clearance(map)
    corners = map.corners()
    sides = corners[[1, 3]] - corners[0]
    counts = np.ceil(np.hypot(*sides.T) / spacing).astype(int) + 1
    along = [np.arange(n) * spacing for n in counts]
    shares = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2) / np.hypot(*sides.T)
    nodes = np.vstack([corners[0] + shares @ sides, goal, points])
    room = clearance(nodes) - need
    index = np.arange(math.prod(counts)).reshape(counts)
    edges = []
    for i, j in STEPS:
        one = index[max(0, -i):counts[0] - max(0, i), :counts[1] - j].ravel()
        edges.append((one, one + i * counts[1] + j))
    for extra in range(index.size, len(nodes)):
        near = np.flatnonzero(np.hypot(*(nodes[:index.size] - nodes[extra]).T) < 3 * spacing)
        edges.append((near, np.full(len(near), extra)))
    one, other = np.concatenate(edges, axis=1)
    length = np.hypot(*(nodes[one] - nodes[other]).T)
    free = (room[one] + room[other] > length) & (room[one] >= 0) & (room[other] >= 0)
    # What the ends do not decide, points between them do.
    open_ = np.flatnonzero(~free & (room[one] >= 0) & (room[other] >= 0))
    shares = np.linspace(0, 1, 9)[:, None, None]
    between = nodes[one[open_]] * (1 - shares) + nodes[other[open_]] * shares
    found = clearance(between.reshape(-1, 2)).reshape(9, -1).min(axis=0)
    free[open_] = found >= need + length[open_] / 16
    graph = coo_array((length[free], (one[free].astype(np.int32), other[free].astype(np.int32))), shape=(len(nodes),) * 2)
    return dijkstra(graph, directed=False, indices=index.size)[index.size + 1:]


def slopes(field, squares):
    """(n,) the greater gradient of the triangles of all free squares that are reached, split where it is less."""
    cost = field.kernel.nodes()
    corners = [cost[:-1, :-1], cost[:-1, 1:], cost[1:, :-1], cost[1:, 1:]]
    here, right, above, beyond = (corner[(squares[:-1, :-1] != 0) & (corners[0] < 1e299)] for corner in corners)
    bottom, left, top, side = (right - here)**2, (above - here)**2, (beyond - above)**2, (beyond - right)**2
    steeper = np.minimum(np.maximum(bottom + side, left + top), np.maximum(bottom + left, top + side))
    return np.sqrt(steeper) / field.kernel.side


@pytest.mark.slow
@pytest.mark.parametrize("kind", MAPS)
def test_no_way_is_shorter_and_the_shortest_is_little_longer(kind):
    """Than the distances, against ways on a fine lattice in 32 directions."""
    rng = np.random.default_rng(7)
    for _ in range(scaled(2)):
        map, need = MAPS[kind](rng), 0.25
        points = free_points(rng, map, need + 0.05, 60)
        if len(points) < 10:
            continue
        field = CostToGo(ClearanceField(map), need, points[0]).make_bound()
        found = field.at(points[1:])
        lengths = lattice_lengths(map, need, points[0], points[1:], 0.1)
        assert (found <= lengths + 1e-9).all()
        far = np.isfinite(lengths) & (lengths > 2)
        if kind != "crowded":  # where many a gap is too narrow by less than a square
            assert np.median(found[far] / lengths[far]) > (0.88 if kind in ("boxes", "maze") else 0.92)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(scaled(15, least=5)))
def test_no_gradient_is_above_one_and_the_source_costs_nothing(seed):
    """On every triangle of the squares that may be free: that is the proof of the bound."""
    rng = np.random.default_rng(seed)
    problem, clearance = random_problem(rng, random_maps(30)[seed])
    field = ClearanceField(problem.map, problem.allow_unknown)
    _, squares = field.free_squares(problem.vehicle.robot_radius)
    for found in CostToGo.to_goal(problem, field).make_bound(), CostToGo.from_start(problem, field).make_bound():
        steep = slopes(found, squares)
        assert len(steep) == 0 or steep.max() <= 1
    bearing, share = rng.uniform(-math.pi, math.pi, 200), rng.random(200)
    places = problem.goal[:2] + (problem.goal_tolerance_xy * share * [np.cos(bearing), np.sin(bearing)]).T
    free = clearance(places) >= problem.vehicle.robot_radius
    assert (CostToGo.to_goal(problem, field).make_bound().at(places[free]) == 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(scaled(15, least=3)))
def test_every_place_that_is_free_lies_in_a_free_square(seed):
    """In turned grids and polygons; where it has a way to the source, the field knows a distance."""
    rng = np.random.default_rng(seed)
    map, need = random_maps(30)[seed], rng.uniform(0.05, 0.5)
    points = free_points(rng, map, need, 400)
    for source in points[:5]:
        found = CostToGo(ClearanceField(map), need, source).make_bound()
        assert found.at(source[None])[0] == 0
        near = source + rng.normal(0, 0.01, (20, 2))
        near = near[naive_clearance(map)(near) >= need]
        assert (found.at(near) <= np.hypot(*(near - source).T)).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(scaled(20, least=2)))
def test_the_way_there_is_as_long_as_the_way_back(seed):
    rng = np.random.default_rng(seed)
    map = random_maps(30)[seed]
    one, other = (free_pose(rng, map, naive_clearance(map), 0.25) for _ in range(2))
    problem = Problem(map, Vehicle(0.5, 0.2), one, other)
    field = ClearanceField(map)
    to_goal = CostToGo.to_goal(problem, field).make_bound()
    from_start = CostToGo.from_start(problem, field).make_bound()
    there, back = to_goal.at(np.array([one[:2]]))[0], from_start.at(np.array([other[:2]]))[0]
    if math.isinf(there) or math.isinf(back):
        assert there == back
    else:
        assert there == pytest.approx(back, rel=0.05, abs=2 * to_goal.kernel.side)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(scaled(15, least=2)))
def test_no_path_is_shorter_than_the_bound(seed):
    rng = np.random.default_rng(100 + seed)
    problem, _ = random_problem(rng, random_maps(30)[seed])
    field = ClearanceField(problem.map, problem.allow_unknown)
    bound = lower_bound(problem, CostToGo.to_goal(problem, field).make_bound())
    assert bound >= lower_bound(problem)
    result = plan(problem, Settings(samples=scaled(1000, least=200), seed=seed, planning_time=0.2))
    if result.status == Status.NONE:
        assert result.length >= bound - 1e-9
        places = result.path.poses(0.05)[:, :2]
        driven = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
        assert (CostToGo.to_goal(problem, field).make_bound().at(places) <= result.length - driven + 1e-9).all()
        assert (CostToGo.from_start(problem, field).make_bound().at(places) <= 1.01 * driven + 1e-9).all()


def test_in_the_open_the_distance_is_the_straight_line():
    rng = np.random.default_rng(1)
    points = rng.uniform(-9, 9, (500, 2))
    straight = np.hypot(*(points - (3, -2)).T)
    found = CostToGo(ClearanceField(empty_map()), 0.2, (3.0, -2.0)).make_bound().at(points)
    assert (found <= straight).all()
    assert (found >= 0.97 * straight - 0.5).all()


@pytest.mark.parametrize("tolerance", [0.05, 0.4, 2.5, 1e6])
def test_the_distance_is_that_to_where_the_goal_is_reached(tolerance):
    problem = Problem(empty_map(), Vehicle(0.5, 0.2), (-8, 5, 0), (3, -2, 0), goal_tolerance_xy=tolerance)
    found = CostToGo.to_goal(problem, ClearanceField(problem.map)).make_bound()
    points = np.random.default_rng(2).uniform(-9, 9, (500, 2))
    straight = np.maximum(np.hypot(*(points - (3, -2)).T) - tolerance, 0)
    assert (found.at(points) <= straight).all()
    assert (found.at(points) >= 0.97 * straight - 1.0).all()
    assert lower_bound(problem, found) == pytest.approx(lower_bound(problem))


def test_behind_a_wall_and_in_it_and_beyond_the_map_the_distance_is_infinite():
    data = np.zeros((40, 40), np.int8)
    data[20] = 100
    problem = Problem(GridMap(data, 0.25), Vehicle(0.5, 0.2), (1, 9, 0), (9, 1, 0))
    found = CostToGo.to_goal(problem, ClearanceField(problem.map)).make_bound()
    places = np.array([(1.0, 9.0), (5.0, 5.1), (-1.0, 1.0), (1.0, 11.0), (1e300, 0.0), (math.nan, 0.0)])
    assert np.isinf(found.at(places)).all()
    assert np.isnan(np.delete(found.headings(places), 1)).all()
    assert lower_bound(problem, found) == math.inf
    assert found.at(np.array([(1.0, 1.0)]))[0] == pytest.approx(8, rel=0.04)


@pytest.mark.parametrize("goal", [(0.1, 5, 0), (-3, 5, 0), (1e300, -1e300, 0), (10, 10, 0)])
def test_a_goal_without_room_is_infinitely_far(goal):
    problem = Problem(PolygonMap(shapely.box(0, 0, 10, 10)), Vehicle(0.5, 0.5), (5, 5, 0), goal)
    found = CostToGo.to_goal(problem, ClearanceField(problem.map)).make_bound()
    assert found.at(np.array([(5.0, 5.0)]))[0] == math.inf


def test_the_bound_is_the_greater_of_the_dubins_curve_and_the_way_around():
    data = np.zeros((80, 80), np.int8)
    data[40, :70] = 100
    problem = Problem(GridMap(data, 0.125), Vehicle(0.5, 0.2), (1, 4, math.pi / 2), (1, 6, math.pi / 2))
    around = 2 * math.hypot(8.75 - 1, 1)
    field = CostToGo.to_goal(problem, ClearanceField(problem.map)).make_bound()
    assert lower_bound(problem, field) == pytest.approx(around, rel=0.04)
    assert lower_bound(problem) == pytest.approx(2)
    backwards = Problem(problem.map, problem.vehicle, (1, 4, 0), (0.9, 4, 0))
    curve = shortest(backwards.start, backwards.goal, 0.5).length
    assert lower_bound(backwards, CostToGo.to_goal(backwards, ClearanceField(problem.map)).make_bound()) == curve


def test_large_maps_have_large_squares(monkeypatch):
    monkeypatch.setattr(clearance, "MAX_SQUARES", 500)
    map = maze_grid(np.random.default_rng(1))
    found = CostToGo(ClearanceField(map), 0.0, map.corners().mean(axis=0)).make_bound()
    assert found.kernel.side == 0.5
    assert found.kernel.shape == (23, 23)


@pytest.mark.parametrize("has_target", [False, True])
@pytest.mark.parametrize("kind", MAPS)
def test_until_it_is_a_bound_the_distance_is_little_too_long(kind, has_target):
    """By some hundredths; what is prepared for the bound changes nothing, and to make it twice neither."""
    rng = np.random.default_rng(7)
    map = MAPS[kind](rng)
    points = free_points(rng, map, 0.3, 200)
    field = CostToGo(ClearanceField(map), 0.25, points[0], target=points[1] if has_target else None)
    found = field.at(points)
    field.prepare_bound()
    np.testing.assert_array_equal(field.at(points), found)
    bound = field.make_bound().at(points)
    np.testing.assert_array_equal(field.make_bound().at(points), bound)
    assert bound[0] == 0
    np.testing.assert_array_equal(np.isinf(bound), np.isinf(found))
    reached = np.isfinite(found)
    assert (bound[reached] <= found[reached]).all()
    assert (found[reached] <= 1.1 * bound[reached] + 2 * field.kernel.side).all()


@pytest.mark.parametrize("kind", MAPS)
def test_distances_that_are_found_as_far_as_asked(kind):
    """Whatever is asked first, and whether or not all are found first: the same places are reached, and none is much farther."""
    rng = np.random.default_rng(8)
    map = MAPS[kind](rng)
    points = free_points(rng, map, 0.3, 60)
    whole = CostToGo(ClearanceField(map), 0.25, points[0])
    whole.finish()
    expected = whole.at(points)
    field = CostToGo(ClearanceField(map), 0.25, points[0], target=points[1])
    one_by_one = np.concatenate([field.at(point[None]) for point in points[1:]])
    field.finish()
    for found in one_by_one, field.at(points)[1:]:
        np.testing.assert_array_equal(np.isinf(found), np.isinf(expected[1:]))
        reached = np.isfinite(found)
        np.testing.assert_allclose(found[reached], expected[1:][reached], rtol=0.1, atol=2 * field.kernel.side)
