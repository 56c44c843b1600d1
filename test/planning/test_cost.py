"""The cost of clearance: its integral, its bounds, and the paths that minimise it."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from support.cases import boxes_grid, needs_compiled, random_pose, scaled

from dubins_rrt_ros.planning import ClearanceField, GridMap, PolygonMap, Problem, Settings, Vehicle, load_map, plan
from dubins_rrt_ros.planning._kernels.dubins import poses_along
from dubins_rrt_ros.planning.audit import cost_of, roomy_share_of
from dubins_rrt_ros.planning.curves.dubins import shortest
from dubins_rrt_ros.planning.plan_file import read_request, to_document
from dubins_rrt_ros.planning.search.cost import Objective
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo

DISC = Vehicle(turning_radius=1.0, robot_radius=0.3)
CAR = Vehicle(turning_radius=1.0, footprint="[[0.7, 0.25], [-0.3, 0.25], [-0.3, -0.25], [0.7, -0.25]]")
BOOMERANG = Vehicle(turning_radius=1.5, footprint="[[0.6, 0.0], [-0.4, 0.5], [-0.15, 0.0], [-0.4, -0.5]]")
PREFERRED, WEIGHT = 0.4, 2.0


def grid_with_noise(seed):
    """A turned grid with boxes and single cells."""
    rng = np.random.default_rng(seed)
    boxes = boxes_grid(rng)
    data = boxes.data.copy()
    data[tuple(rng.integers(0, side, 25) for side in data.shape)] = 100
    return GridMap(data, boxes.resolution, boxes.origin)


def polygons(seed):
    """A square with triangles in it."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-4, 4, (9, 1, 2))
    return PolygonMap.of(shapely.box(-5, -5, 5, 5), [shapely.Polygon(corners).convex_hull
                                                     for corners in centres + rng.uniform(-0.8, 0.8, (9, 3, 2))])


def obstacles_of(world_map):
    """The obstacles as one geometry, with what is outside the map."""
    low, high = world_map.corners().min(axis=0), world_map.corners().max(axis=0)
    around = shapely.box(*(low - 5), *(high + 5))
    if isinstance(world_map, PolygonMap):
        return around.difference(world_map.free)
    x0, y0, yaw = world_map.origin
    rows, columns = np.nonzero(world_map.blocked(False))
    squares = [shapely.box(c, r, c + 1, r + 1) for r, c in zip(rows.tolist(), columns.tolist(), strict=True)]
    cells = shapely.unary_union([*squares, shapely.box(-50, -50, 200, 200).difference(
        shapely.box(0, 0, *world_map.data.shape[::-1]))])
    side, cos, sin = world_map.resolution, math.cos(yaw), math.sin(yaw)
    return shapely.transform(cells, lambda points: np.array([x0, y0]) + side * points @ np.array([[cos, sin], [-sin, cos]]))


def outline(vehicle, pose):
    corners = np.array(vehicle.footprint) @ np.array([1, 1j])
    placed = complex(pose[0], pose[1]) + corners * np.exp(1j * pose[2])
    return shapely.Polygon(np.column_stack([placed.real, placed.imag]))


def free_curves(world_map, field, vehicle, count, rng, longest=6.0):
    """Random curves that are free for a vehicle."""
    found = []
    low, high = world_map.corners().min(axis=0), world_map.corners().max(axis=0)
    while len(found) < count:
        start = (*rng.uniform(low, high).tolist(), rng.uniform(-math.pi, math.pi))
        across = math.exp(rng.uniform(math.log(0.05), math.log(longest))) * np.exp(1j * rng.uniform(-math.pi, math.pi))
        goal = (start[0] + across.real, start[1] + across.imag, rng.uniform(-math.pi, math.pi))
        curve = shortest(start, goal, vehicle.turning_radius)
        if field.curve_is_free(curve, vehicle):
            found.append(curve)
    return found


@pytest.mark.parametrize("vehicle", [CAR, BOOMERANG], ids=["car", "boomerang"])
@pytest.mark.parametrize("world_map", [grid_with_noise(1), polygons(2)], ids=["grid", "polygons"])
def test_the_room_of_a_footprint_is_its_distance_from_the_obstacles(world_map, vehicle):
    field, rng = ClearanceField(world_map), np.random.default_rng(3)
    room, obstacles = field.room(vehicle), obstacles_of(world_map)
    low, high = world_map.corners().min(axis=0), world_map.corners().max(axis=0)
    poses = np.column_stack([rng.uniform(low, high, (scaled(4000, 300), 2)), rng.uniform(-math.pi, math.pi, scaled(4000, 300))])
    poses = np.array([pose for pose in poses.tolist() if field.pose_is_free(tuple(pose), vehicle)])
    assert len(poses) > 20
    expected = np.array([shapely.distance(outline(vehicle, pose), obstacles) for pose in poses])
    for enough in (0.2, 100.0):
        found = np.empty(len(poses))
        room.rooms(poses, enough, found)
        decided = (found < enough) | (expected < enough)
        np.testing.assert_allclose(found[decided], expected[decided], atol=1e-9)
        assert (found[~decided] >= enough).all() and (found[~decided] <= expected[~decided] + 1e-9).all()


@needs_compiled
@pytest.mark.parametrize("vehicle", [DISC, CAR, pytest.param(BOOMERANG, marks=pytest.mark.slow)],
                         ids=["disc", "car", "boomerang"])
@pytest.mark.parametrize("world_map", [grid_with_noise(1), polygons(2)], ids=["grid", "polygons"])
def test_the_cost_of_an_edge_is_the_integral(world_map, vehicle):
    """To 0.1 %, at any weight that paths are planned with by default and at several distances."""
    field, rng = ClearanceField(world_map), np.random.default_rng(4)
    for preferred in (PREFERRED / 2, PREFERRED):
        objective, room = Objective(vehicle, field, preferred, WEIGHT), field.room(vehicle)
        for curve in free_curves(world_map, field, vehicle, 50, rng):
            found = objective.edge_cost().of_curve(curve.start, curve.radius, curve.index, curve.lengths)
            points = 2000
            poses, rooms = np.empty((points, 3)), np.empty(points)
            poses_along(curve.start, curve.radius, curve.index, curve.lengths,
                        (np.arange(points) + 0.5) * curve.length / points, poses)
            room.rooms(poses, preferred, rooms)
            expected = curve.length * (1 + WEIGHT * np.maximum(0, 1 - rooms / preferred)**2).mean()
            assert found == pytest.approx(expected, rel=1e-3), curve


@pytest.mark.parametrize("vehicle", [DISC, CAR], ids=["disc", "car"])
def test_a_limit_ends_an_integral_at_a_lower_bound_that_is_not_below_it(vehicle):
    world_map, rng = grid_with_noise(1), np.random.default_rng(5)
    field = ClearanceField(world_map)
    costs = Objective(vehicle, field, PREFERRED, WEIGHT).edge_cost()
    for curve in free_curves(world_map, field, vehicle, scaled(100, 10), rng):
        arguments = curve.start, curve.radius, curve.index, curve.lengths
        cost = costs.of_curve(*arguments)
        for share in (0.5, 0.99, 1.01, 2.0):
            found = costs.of_curve(*arguments, limit=share * cost)
            assert found == cost if share > 1 else share * cost <= found <= cost * (1 + 1e-12)


@pytest.mark.parametrize("vehicle", [DISC, CAR], ids=["disc", "car"])
@pytest.mark.parametrize("seed", range(3))
def test_no_path_falls_below_the_bounds(vehicle, seed):
    rng = np.random.default_rng(seed)
    problem = some_problem(vehicle, seed)
    field = ClearanceField(problem.map)
    objective = Objective(vehicle, field, PREFERRED, WEIGHT)
    result = plan(problem, Settings(seed=seed, samples=scaled(500, 50), preferred_clearance=0.0))
    if not result.solved:
        pytest.skip("there is no path")
    shares = np.sort(rng.random(20))
    to_goal, from_start = CostToGo.to_goal(problem, field, objective), CostToGo.from_start(problem, field, objective)
    settings = Settings(preferred_clearance=PREFERRED, clearance_weight=WEIGHT)
    driven = np.array([cost_of(part_of(result.path, share), problem, settings) for share in shares])
    whole = cost_of(result.path, problem, settings)
    points = result.path.at(shares)[:, :2]
    assert (from_start.make_bound().at(points) <= driven * 1.0005 + 1e-6).all()
    assert (to_goal.make_bound().at(points) <= (whole - driven) + 0.0005 * whole + 1e-6).all()
    length = CostToGo.to_goal(problem, field).make_bound().at(points)
    assert to_goal.at(points).sum() > length.sum()


def part_of(path, share):
    """The first part of a path."""
    left, curves = share * path.length, []
    for curve in path.curves:
        lengths = np.diff(np.minimum(np.cumsum([0.0, *curve.lengths]), left))
        curves.append(replace(curve, lengths=tuple(lengths.tolist())))
        left -= curve.length
        if left <= 0:
            break
    return type(path).of_curves(path.start, curves[-1].end, curves)


def some_problem(vehicle, seed):
    """A problem on a grid with noise, whose ends are free."""
    world_map, rng = grid_with_noise(seed), np.random.default_rng(seed)
    field = ClearanceField(world_map)
    low, high = world_map.corners().min(axis=0), world_map.corners().max(axis=0)
    middle = (low + high) / 2
    poses = (tuple((np.array([*middle, 0]) + random_pose(rng, 4.5)).tolist()) for _ in range(10_000))
    start, goal = [pose for pose, _ in zip((p for p in poses if field.pose_is_free(p, vehicle)), range(2), strict=False)]
    return Problem(world_map, vehicle, start, goal)


@needs_compiled
@pytest.mark.parametrize("vehicle", [DISC, CAR], ids=["disc", "car"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))])
def test_a_path_costs_less_than_the_shortest_one_and_the_audit_measures_the_same(vehicle, seed):
    problem = some_problem(vehicle, seed)
    field = ClearanceField(problem.map)
    objective = Objective(vehicle, field, PREFERRED, WEIGHT)
    settings = Settings(seed=seed, samples=300, planning_time=5.0, preferred_clearance=PREFERRED, clearance_weight=WEIGHT)
    shortest_path = plan(problem, replace(settings, preferred_clearance=0.0))
    result = plan(problem, settings)
    assert result.solved == shortest_path.solved
    if not result.solved:
        return
    result.check()
    result.tree.check(field, vehicle)
    assert result.cost == objective.path_cost(result.path)
    assert result.cost <= 1.001 * objective.path_cost(shortest_path.path)
    assert result.cost == pytest.approx(cost_of(result.path, problem, settings), rel=1e-3)
    assert result.lower_bound <= result.cost_lower_bound <= result.cost and result.length <= result.cost
    assert result.lower_bound <= shortest_path.length
    assert shortest_path.roomy_share is None and result.roomy_share == pytest.approx(
        roomy_share_of(result.path, problem, settings), abs=0.02)
    again = plan(problem, settings)
    assert again.path == result.path and again.cost == result.cost


def test_without_a_preference_the_cost_is_the_length():
    problem = some_problem(DISC, 1)
    for settings in (Settings(seed=1, samples=100, preferred_clearance=0.0),
                     Settings.paper(seed=1, samples=scaled(2000, 200), preferred_clearance=0.3)):
        result = plan(problem, settings)
        if result.solved:
            assert (result.cost, result.cost_lower_bound, result.cost_gap) == (result.length, result.lower_bound, result.gap)
    assert Settings(preferred_clearance=-1).preferred_clearance_of(CAR) == CAR.inscribed_radius == 0.25
    assert Settings(preferred_clearance=0.1).preferred_clearance_of(CAR) == 0.1
    assert Settings(preferred_clearance=0.1, clearance_weight=0.0).preferred_clearance_of(CAR) == 0


def test_a_file_of_an_earlier_version_is_planned_again_for_the_shortest_path():
    problem = some_problem(DISC, 1)
    document = to_document(plan(problem, Settings(seed=1, samples=20)), "map")
    del document["settings"]["preferred_clearance"], document["settings"]["clearance_weight"]
    _, settings = read_request(document, problem.map)
    assert settings.preferred_clearance == 0


@needs_compiled
def test_around_a_corner_the_path_keeps_its_distance():
    vehicle = Vehicle(turning_radius=1.0, robot_radius=0.2)
    problem = Problem(load_map("maze"), vehicle, (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))
    near, far = (plan(problem, Settings(seed=1, preferred_clearance=p, planning_time=10.0)) for p in (0.0, 0.2))
    assert near.min_clearance < 0.21 and far.min_clearance > 0.3
    assert near.length < far.length < 1.06 * near.length
    assert len(far.path.curves) <= 2 * len(near.path.curves)
