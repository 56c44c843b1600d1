"""Costs of a grid's cells: their integral, their bounds, and paths over costmaps and grids of probabilities."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage
from support.cases import needs_compiled, scaled

from dubins_rrt_ros.planning import GridMap, PolygonMap, Problem, Settings, Status, Thresholds, Vehicle, plan, prepare
from dubins_rrt_ros.planning._kernels.cell_costs import CellCosts
from dubins_rrt_ros.planning._kernels.dubins import poses_along
from dubins_rrt_ros.planning.audit import cost_of
from dubins_rrt_ros.planning.collision.cell_costs import cells_to_cost, costs_of_squares
from dubins_rrt_ros.planning.plan_file import read_request, to_document
from dubins_rrt_ros.planning.search.cost import Objective
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo

DISC = Vehicle(turning_radius=1.0, robot_radius=0.3)
CAR = Vehicle(turning_radius=1.0, footprint="[[0.7, 0.25], [-0.3, 0.25], [-0.3, -0.25], [0.7, -0.25]]")
COSTMAP = Thresholds.of_fractions(free_thresh=0.0, occupied_thresh=0.995)
WEIGHT = 3.0


def speckled_grid(seed, yaw=0.4):
    """A turned grid of smooth and of scattered costs, with some walls and unknown cells."""
    rng = np.random.default_rng(seed)
    data = np.clip(ndimage.gaussian_filter(rng.normal(size=(50, 60)), 4) * 700, 0, 99).astype(np.int8)
    data[tuple(rng.integers(0, side, 200) for side in data.shape)] = rng.integers(1, 100, 200)
    for _ in range(6):
        row, column = rng.integers(0, 44), rng.integers(0, 54)
        data[row:row + 5, column:column + 3] = 100
    data[3, 4] = -1
    return GridMap(data, 0.2, (-3.0, -4.0, yaw), thresholds=COSTMAP)


def kernel_of(grid):
    return CellCosts(grid.costs, cells_to_cost(grid.costs), grid.resolution, grid.origin)


def sampled(grid, pose, radius, turn, length, points):
    """The integral of the costs along an arc, by points."""
    word, lengths = {1: (0, (length, 0.0, 0.0)), 0: (0, (0.0, length, 0.0)), -1: (1, (length, 0.0, 0.0))}[turn]
    poses = np.empty((points, 3))
    poses_along(pose, radius, word, lengths, (np.arange(points) + 0.5) * length / points, poses)
    column, row = np.floor(grid.to_grid_frame(poses[:, :2]) / grid.resolution).astype(int).T
    rows, columns = grid.data.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    costs = grid.costs[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    return float(np.where(inside, costs, 0).mean()) / 100 * length


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_the_integral_over_cells_is_exact(yaw):
    grid, rng = speckled_grid(1, yaw).with_costs(True), np.random.default_rng(2)
    kernel, points = kernel_of(grid), scaled(10_000, 2000)
    for _ in range(scaled(120, 20)):
        pose = (*grid.to_map_frame(rng.uniform((-1, -1), (13, 11))).tolist(), rng.uniform(-math.pi, math.pi))
        radius, turn, length = math.exp(rng.uniform(-4, 8)), int(rng.integers(-1, 2)), rng.uniform(0, 8)
        found = kernel.integral_along(pose, radius, turn, length)
        # A point stands for the length around it, which is wrong for half of that at most where an edge is crossed.
        assert found == pytest.approx(sampled(grid, pose, radius, turn, length, points), abs=2e-2 * length / points**0.5 + 1e-9)


@pytest.mark.parametrize(("turn", "heading"), [(0, 0.0), (0, math.pi / 2), (0, math.pi), (1, 0.0), (-1, 0.5)])
def test_a_curve_from_and_along_the_edges_of_cells_ends(turn, heading):
    data = np.zeros((20, 20), np.int8)
    data[5:15, 5:15] = 50
    grid = GridMap(data, 0.5, thresholds=COSTMAP).with_costs(True)
    for begin in ((5.0, 5.0), (2.5, 2.5), (7.5, 5.0)):
        found = kernel_of(grid).integral_along((*begin, heading), 0.5, turn, 2.0)
        ahead, behind = (sampled(grid, (begin[0] + off, begin[1] + off, heading), 0.5, turn, 2.0, 4000) for off in (1e-4, -1e-4))
        assert min(ahead, behind) - 0.01 <= found <= max(ahead, behind) + 0.01


def test_an_integral_ends_at_its_limit():
    grid = speckled_grid(1).with_costs(True)
    pose = (*grid.to_map_frame(np.array([1.0, 1.0])).tolist(), 1.0)
    whole = kernel_of(grid).integral_along(pose, 1.0, 0, 9.0)
    assert whole / 2 <= kernel_of(grid).integral_along(pose, 1.0, 0, 9.0, whole / 2) <= whole


def test_squares_cost_the_least_and_the_mean_of_their_free_cells():
    costs, blocked = np.array([[10, 20, 90], [30, 40, 0], [7, 0, 5]], np.uint8), np.zeros((3, 3), bool)
    blocked[0, 0] = blocked[0, 2] = blocked[1, 2] = True
    np.testing.assert_allclose(costs_of_squares(costs, blocked, 2, is_bound=True), [[0.2, 0.0], [0.0, 0.05]])
    np.testing.assert_allclose(costs_of_squares(costs, blocked, 2, is_bound=False), [[0.3, 0.0], [0.035, 0.05]])


def test_cells_between_the_thresholds_are_free_at_a_cost_or_unknown():
    grid = speckled_grid(1)
    costly = grid.with_costs(True)
    assert grid.costs is None and costly.with_costs(False).costs is None
    assert grid.with_costs(False) is grid and grid.with_costs(True) is costly and costly.id == grid.id
    between = (grid.data > 0) & (grid.data < 100)
    assert (grid.blocked(False) == ((grid.data == -1) | between | (grid.data == 100))).all()
    assert (costly.blocked(False) == ((grid.data == -1) | (grid.data == 100))).all()
    assert (costly.blocked(True) == grid.blocked(True)).all()
    assert (costly.costs == np.where(between, grid.data, 0)).all()
    assert (costly.thresholds.meaning(50), grid.thresholds.meaning(50)) == ("free", "unknown")
    trinary = GridMap(np.where(between, 0, grid.data), 0.2)
    assert trinary.with_costs(True) is trinary
    polygons = PolygonMap.of([(0, 0), (1, 0), (1, 1)])
    assert polygons.with_costs(True) is polygons and polygons.costs is None


def test_a_world_keeps_the_world_with_costs():
    world = prepare(speckled_grid(1), DISC)
    costly = world.with_costs(True)
    assert world.with_costs(False) is world and world.with_costs(True) is costly and costly.map.costs is not None
    assert costly.with_costs(False).map.costs is None and costly.with_costs(True) is costly


def some_problem(vehicle, seed, world_map=None):
    """A problem on a speckled grid, whose ends are free."""
    world_map = (world_map or speckled_grid(seed)).with_costs(True)
    field, rng = prepare(world_map, vehicle).field, np.random.default_rng(seed)
    poses = ((*world_map.to_map_frame(rng.uniform((1, 1), (11, 9))).tolist(), rng.uniform(-math.pi, math.pi))
             for _ in range(10_000))
    start, goal = [pose for pose, _ in zip((p for p in poses if field.pose_is_free(p, vehicle)), range(2), strict=False)]
    return Problem(world_map, vehicle, start, goal)


@needs_compiled
@pytest.mark.parametrize("preferred", [0.0, 0.3])
@pytest.mark.parametrize("vehicle", [DISC, CAR], ids=["disc", "car"])
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_a_path_costs_less_than_the_shortest_one_and_the_audit_measures_the_same(vehicle, seed, preferred):
    problem = some_problem(vehicle, seed)
    settings = Settings(seed=seed, samples=300, planning_time=10.0, preferred_clearance=preferred, cost_weight=WEIGHT)
    result = plan(problem, settings)
    assert result.solved, result.message
    result.check()
    field = prepare(problem.map, vehicle).field
    result.tree.check(field, vehicle)
    objective = Objective.of(problem, settings, field)
    free = GridMap(np.where(problem.map.costs > 0, 0, problem.map.data), 0.2, problem.map.origin, thresholds=COSTMAP)
    shortest_path = plan(replace(problem, map=free), replace(settings, preferred_clearance=0.0))
    assert result.cost == objective.path_cost(result.path) <= 1.001 * objective.path_cost(shortest_path.path)
    assert result.cost == pytest.approx(cost_of(result.path, problem, settings), rel=1e-3)
    assert shortest_path.length <= 1.01 * result.length
    assert result.lower_bound <= result.cost_lower_bound <= result.cost and result.length < result.cost


@pytest.mark.parametrize("preferred", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(2))
def test_no_path_falls_below_the_bounds(seed, preferred):
    """Nor does a straight line, whatever it crosses."""
    problem = some_problem(DISC, seed)
    field, rng = prepare(problem.map, DISC).field, np.random.default_rng(seed)
    objective = Objective(DISC, field, preferred, 2.0 if preferred else 0.0, WEIGHT)
    to_goal, length = (CostToGo.to_goal(problem, field, cost).make_bound() for cost in (objective, None))
    points = problem.map.to_map_frame(rng.uniform((0.5, 0.5), (11.5, 9.5), (scaled(400, 60), 2)))
    costs, lengths = to_goal.at(points), length.at(points)
    known = np.isfinite(costs)
    assert (costs[known] >= lengths[known] - 0.2).all() and costs[known].sum() > 1.02 * lengths[known].sum()
    kernel, checker = objective.edge_cost(), field.collision_checker(DISC)
    for (x, y), cost in zip(points[known].tolist(), costs[known].tolist(), strict=True):
        ahead = rng.uniform(0.1, 3.0)
        pose = (x, y, rng.uniform(-math.pi, math.pi))
        end = (x + ahead * math.cos(pose[2]), y + ahead * math.sin(pose[2]))
        if checker.is_motion_free(pose, 1.0, 0, (0.0, ahead, 0.0)):
            assert abs(cost - to_goal.at(np.array([end]))[0]) <= kernel.of_curve(pose, 1.0, 0, (0.0, ahead, 0.0)) * 1.0015 + 1e-6


def test_without_a_weight_such_cells_are_unknown_as_informed_false_has_them():
    problem = some_problem(DISC, 1)
    start = problem.start
    data = problem.map.data.copy()
    column, row = np.floor(problem.map.to_grid_frame(np.array(start[:2])) / 0.2).astype(int)
    data[row, column] = 40
    problem = replace(problem, map=GridMap(data, 0.2, problem.map.origin, thresholds=COSTMAP))
    for settings in (Settings(seed=1, samples=50), Settings.paper(seed=1, samples=50, cost_weight=2.0)):
        result = plan(problem, settings)
        assert result.status == Status.START_OCCUPIED and "a cell of" in result.message
    assert plan(problem, Settings(seed=1, samples=50, cost_weight=2.0, planning_time=60.0)).solved


@needs_compiled
def test_a_plan_over_costs_is_planned_again_from_its_file():
    grid = speckled_grid(2)
    problem = replace(some_problem(DISC, 2), map=grid)
    result = plan(problem, Settings(seed=3, samples=300, cost_weight=2.0, planning_time=30.0))
    document = to_document(result, "map")
    again, settings = read_request(document, grid)
    assert plan(again, settings).path == result.path and document["settings"]["cost_weight"] == 2.0
    del document["settings"]["cost_weight"]
    assert read_request(document, grid)[1].cost_weight == 0.0


def inflated(occupied, resolution, inscribed, reach, scaling):
    """What Nav2's costmap publishes of walls: 100 in them, 99 within the inscribed radius, and ever less beyond."""
    away = ndimage.distance_transform_edt(~occupied) * resolution
    cost = np.where(away <= inscribed, 253, np.floor(252 * np.exp(-scaling * (away - inscribed))))
    cost = np.where(away > reach, 0, cost).astype(int)
    published = np.where(cost == 253, 99, np.where(cost == 0, 0, 1 + 97 * (cost - 1) // 251))
    return np.where(occupied, 100, published).astype(np.int8)


def two_rooms(resolution=0.05):
    """Walls of two rooms of 4 m x 4 m, with a door of 1.0 m between them."""
    occupied = np.zeros((round(4 / resolution), round(8.2 / resolution)), bool)
    occupied[:2], occupied[-2:], occupied[:, :2], occupied[:, -2:] = True, True, True, True
    occupied[:, 80:84] = True
    occupied[30:50, 80:84] = False
    return occupied


@needs_compiled
def test_through_a_door_of_a_metre_in_an_inflated_costmap():
    """A vehicle 0.9 m wide: all cells of the door but those in its middle are at 99."""
    vehicle = Vehicle(turning_radius=0.8, footprint="[[0.7, 0.45], [-0.5, 0.45], [-0.5, -0.45], [0.7, -0.45]]")
    data = inflated(two_rooms(), 0.05, vehicle.inscribed_radius, 1.0, 3.0)
    assert (data[30:50, 82] == 99).sum() >= 16
    problem = Problem(GridMap(data, 0.05, thresholds=COSTMAP), vehicle, (1.2, 2.0, 0.0), (6.8, 2.0, 0.0))
    assert plan(problem, Settings(seed=1)).status == Status.START_OCCUPIED
    result = plan(problem, Settings(seed=1, cost_weight=2.0, samples=300, planning_time=10.0))
    assert result.solved and result.length < 6.0 < result.cost, result.message
    assert 0 < result.min_clearance < 0.1


@needs_compiled
def test_around_what_an_inflated_costmap_knows_of_where_the_detour_is_short():
    occupied = np.zeros((160, 160), bool)
    occupied[78:82, 78:82] = True
    vehicle = Vehicle(turning_radius=0.6, robot_radius=0.2)
    data = inflated(occupied, 0.05, 0.2, 1.5, 2.0)
    problem = Problem(GridMap(data, 0.05, thresholds=COSTMAP), vehicle, (1.0, 4.0, 0.0), (7.0, 4.0, 0.0))
    near, far = (plan(problem, Settings(seed=1, cost_weight=weight, samples=300, planning_time=10.0, preferred_clearance=0.0))
                 for weight in (0.01, 5.0))
    assert near.min_clearance < 0.3 and far.min_clearance > 0.7 and near.length < far.length < 7.5


@needs_compiled
def test_over_a_grid_of_probabilities_as_cartographer_makes_it():
    """Floor seen often is 1 to 20 %, floor seen rarely 30 to 49 %, walls 70 to 100 %, the rest -1."""
    rng = np.random.default_rng(1)
    data = rng.integers(1, 21, (80, 160)).astype(np.int8)
    data[:, 70:90] = rng.integers(30, 50, (80, 20))
    data[:50, 78:82] = rng.integers(70, 101, (50, 4))
    data[[0, -1]], data[:, [0, -1]] = 100, 100
    data[60:70, 20:30] = -1
    problem = Problem(GridMap(data, 0.05), Vehicle(turning_radius=0.5, robot_radius=0.2), (1.0, 1.0, 0.0), (7.0, 1.0, 0.0))
    assert plan(problem, Settings(seed=1)).status == Status.NO_VALID_PATH
    result = plan(problem, Settings(seed=1, cost_weight=2.0, samples=300, planning_time=10.0, preferred_clearance=0.0))
    assert result.solved and result.cost > result.length + 0.5
    assert result.cost == pytest.approx(cost_of(result.path, result.problem, result.settings), rel=1e-3)
