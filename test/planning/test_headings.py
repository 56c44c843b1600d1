"""The headings of samples: what `field` and `mixed` draw, and the distances to the goal that they follow."""

import math

import naive
import numpy as np
import pytest
from cases import (
    boxes_grid,
    empty_map,
    free_pose,
    holed_polygons,
    maze_grid,
    naive_clearance,
    needs_compiled,
    random_maps,
    random_problem,
    scaled,
)
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from dubins_rrt_ros.planning import ClearanceField, GridMap, Problem, Settings, Status, Vehicle, audit, headings, load_map, plan
from dubins_rrt_ros.planning._kernels.field import Eikonal
from dubins_rrt_ros.planning.headings import SPREAD, UNIFORM_SHARE, GoalField
from dubins_rrt_ros.planning.sampling import Sampler
from dubins_rrt_ros.share import maps_directory

KINDS = ("uniform", "goal", "field", "mixed")


def flooded(rng, map, block, need):
    """The kernel's costs from a few random cells on, what is passable by the naive clearance, and the costs at first."""
    field = ClearanceField.of(map)
    equation = Eikonal(field.kernel, block, need)
    seeds, costs = rng.integers(0, math.prod(equation.shape), 3).astype(np.int32), rng.uniform(0, 2, 3)
    found = equation.solve(seeds, costs)
    given = np.full(equation.shape, math.inf)
    np.minimum.at(given.ravel(), seeds, costs)
    return found, np.pad(passable_blocks(map, field, block, need), 1), given


def passable_blocks(map, field, block, need):
    """Blocks of raster cells of which one has a centre in the map with at least half a diagonal less than the clearance."""
    rows, columns = field.kernel.field.shape
    side = field.kernel.resolution
    corner, end = map.corners()[:2]
    along = (end - corner) / math.dist(corner, end) * side
    across = np.array([-along[1], along[0]])
    centres = corner + (np.arange(columns)[None, :, None] + 0.5) * along + (np.arange(rows)[:, None, None] + 0.5) * across
    free = naive_clearance(map)(centres.reshape(-1, 2)).reshape(rows, columns) >= need - side / math.sqrt(2)
    free &= np.asarray(field.kernel.field) >= 0
    padded = np.zeros((-(-rows // block) * block, -(-columns // block) * block), bool)
    padded[:rows, :columns] = free
    return padded.reshape(padded.shape[0] // block, block, -1, block).any(axis=(1, 3))


@pytest.mark.parametrize("seed", range(scaled(30, least=6)))
def test_the_costs_solve_the_equation(seed):
    rng = np.random.default_rng(seed)
    map = boxes_grid(rng, side=int(rng.integers(3, 25)), boxes=int(rng.integers(0, 14)))
    found, passable, given = flooded(rng, map, int(rng.integers(1, 4)), rng.choice([0.0, 0.3, 0.6]))
    np.testing.assert_allclose(found, naive.eikonal(passable, given), atol=1e-6)


@pytest.mark.parametrize("seed", range(scaled(10, least=2)))
def test_the_costs_are_those_by_steps_along_rows_and_columns_less_what_diagonals_save(seed):
    rng = np.random.default_rng(seed)
    found, passable, given = flooded(rng, maze_grid(rng), 1, 0.3)
    steps = by_dijkstra(passable, given)
    assert (found <= steps + 1e-6).all()
    assert (found >= steps / math.sqrt(2) - 1e-6).all()


def by_dijkstra(passable, given):
    """The costs where passable cells are joined to those in front, behind and beside them."""
    index = np.arange(passable.size, dtype=np.int32).reshape(passable.shape)  # SciPy 1.11 takes no longer ones
    begin = index[np.isfinite(given) & passable]
    edges = [(np.full_like(begin, passable.size), begin, given.ravel()[begin])]
    for axis in (0, 1):
        joined = passable & np.roll(passable, 1, axis)
        edges.append((index[joined], np.roll(index, 1, axis)[joined], np.ones(joined.sum())))
    one, other, cost = map(np.concatenate, zip(*edges, strict=True))
    graph = coo_array((cost, (one, other)), shape=(passable.size + 1,) * 2)
    return dijkstra(graph, directed=False, indices=passable.size)[:-1].reshape(passable.shape)


def goal_field(map, goal, vehicle, **options):
    problem = Problem(map, vehicle, (*goal, 0.0), (*goal, 0.0), **options)
    return GoalField(problem, ClearanceField.of(map))


def follow(field, point, goal, steps):
    """How far one gets to the goal along the field, and how many metres that takes."""
    step = field.cell / 4
    taken = 0
    while taken < steps and math.dist(point, goal) >= field.cell:
        heading = field.directions(np.array([point]))[0]
        point = point + step * np.array([math.cos(heading), math.sin(heading)])
        taken += 1
    return math.dist(point, goal), taken * step


def cost_at(field, map, point):
    """The field's cost at the centre of the cell that holds a point."""
    corner, end = map.corners()[:2]
    turned = complex(*(point - corner)) / complex(*(end - corner)) * math.dist(corner, end) / field.cell
    return field.cost[int(turned.imag) + 1, int(turned.real) + 1]


@pytest.mark.parametrize("kind", ["maze", "boxes", "walls", "circles"])
def test_the_field_leads_around_obstacles_to_the_goal(kind):
    """From anywhere with room, in turned grids and in polygons, on a way about as long as the cost says."""
    rng = np.random.default_rng(3)
    map = {"maze": maze_grid, "boxes": boxes_grid}[kind](rng) if kind in ("maze", "boxes") else holed_polygons(rng, kind)
    clearance, vehicle = naive_clearance(map), Vehicle(2.0, 0.3)
    goal = free_pose(rng, map, clearance, 0.5)[:2]
    field = goal_field(map, goal, vehicle)
    detour = 0
    for _ in range(30):
        point = np.array(free_pose(rng, map, clearance, 0.5)[:2])
        cost = cost_at(field, map, point)
        if cost == math.inf:
            continue
        left, length = follow(field, point, goal, int(8 * cost / field.cell) + 20)
        assert left < field.cell
        assert 0.8 * cost - 3 * field.cell <= length <= 1.2 * cost + 3 * field.cell
        detour = max(detour, cost / math.dist(point, goal))
    if kind in ("maze", "walls"):
        assert detour > 1.3


def test_in_the_open_the_field_leads_straight_to_the_goal():
    rng = np.random.default_rng(4)
    points = rng.uniform(-9, 9, (500, 2))
    field = goal_field(empty_map(), (3.0, -2.0), Vehicle(0.5, 0.2))
    off = field.directions(points) - np.arctan2(-2 - points[:, 1], 3 - points[:, 0])
    far = np.hypot(*(points - (3, -2)).T) > 4 * field.cell
    assert np.abs(np.remainder(off + math.pi, math.tau) - math.pi)[far].max() < math.radians(12)


def test_the_cost_is_the_distance_to_where_the_goal_is_reached():
    exact, tolerant = (goal_field(empty_map(), (3.0, -2.0), Vehicle(0.5, 0.2), goal_tolerance_xy=xy) for xy in (0.0, 2.5))
    assert exact.cell == tolerant.cell == 0.5
    x, y = np.meshgrid(*2 * [np.arange(-9.75, 10, 0.5)])
    distance = np.hypot(x - 3, y + 2)
    np.testing.assert_allclose(exact.cost[1:-1, 1:-1], distance, rtol=0.1, atol=0.25)
    np.testing.assert_allclose(tolerant.cost[1:-1, 1:-1], np.maximum(distance - 2.5, 0), rtol=0.1, atol=0.25)
    assert tolerant.cost[1:-1, 1:-1][distance < 2.5].max() == 0


def test_large_maps_have_coarse_cells(monkeypatch):
    monkeypatch.setattr(headings, "MOST_CELLS", 500)
    field = goal_field(maze_grid(np.random.default_rng(1)), (0.0, 0.0), Vehicle(1.0, 0.0))
    assert field.cell == 0.5
    assert field.cost.shape == (22, 22)


def test_beyond_the_map_the_field_has_no_headings():
    field = goal_field(empty_map(), (3.0, -2.0), Vehicle(0.5, 0.2))
    assert np.isnan(field.directions(np.array([(10.5, 0.0), (-30.0, 2.0), (1.0, 11.0), (1e6, -1e6)]))).all()


def walled():
    """A map that a wall across parts, and a problem whose start and goal lie below it."""
    data = np.zeros((40, 40), np.int8)
    data[20] = 100
    return Problem(GridMap(data, 0.25), Vehicle(0.5, 0.2), (1, 1, 0), (9, 1, 0))


def drawn(problem, count=4000, **options):
    settings = Settings(**{"seed": 1, "goal_bias": 0.0, **options})
    return Sampler(problem, settings, ClearanceField.of(problem.map)).draw(count)


@pytest.mark.parametrize("kind", ["field", "mixed"])
def test_headings_are_uniform_where_the_goal_is_not_reached(kind):
    poses = drawn(walled(), heading_sampling=kind)
    beyond = poses[poses[:, 1] > 5.5, 2]
    assert len(beyond) > 1000
    counts, _ = np.histogram(beyond, bins=8, range=(-math.pi, math.pi))
    assert (np.abs(counts / len(beyond) * 8 - 1) < 0.25).all()
    below = poses[poses[:, 1] < 4.5, 2]
    assert (np.abs(below) < math.pi / 2).mean() > 0.8


def test_mixed_headings_are_uniform_by_a_fixed_share_and_else_near_the_field():
    problem = walled()
    poses = drawn(problem, heading_sampling="mixed")
    led = GoalField(problem, ClearanceField.of(problem.map)).directions(poses[:, :2])
    off = np.abs(np.remainder(poses[:, 2] - led + math.pi, math.tau) - math.pi)[np.isfinite(led)]
    assert len(off) > 1500
    opposite = (off > math.pi / 2).mean()
    assert opposite == pytest.approx(UNIFORM_SHARE / 2, abs=0.03)
    within = (off < SPREAD).mean()
    assert within == pytest.approx((1 - UNIFORM_SHARE) * math.erf(math.sqrt(0.5)) + UNIFORM_SHARE * SPREAD / math.pi, abs=0.04)
    assert (np.abs(poses[:, 2]) <= math.pi).all()


def test_every_kind_draws_the_same_positions_and_its_own_headings():
    poses = {kind: drawn(walled(), 256, heading_sampling=kind) for kind in KINDS}
    for kind in KINDS:
        np.testing.assert_array_equal(poses[kind][:, :2], poses["uniform"][:, :2])
        np.testing.assert_array_equal(poses[kind], drawn(walled(), 256, heading_sampling=kind))
        assert all((poses[kind][:, 2] != poses[other][:, 2]).any() for other in KINDS if other != kind)


@needs_compiled
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_solves_the_maze(kind):
    problem = Problem(load_map(maps_directory() / "maze.yaml"), Vehicle(), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))
    for seed in range(5):
        settings = Settings(samples=1500, seed=seed, heading_sampling=kind, planning_time=60.0)
        result = plan(problem, settings)
        assert result.status == Status.NONE
        assert audit(result.path, problem).ok
        if seed == 0:
            again = plan(problem, settings)
            assert again.path.poses(0.1).tobytes() == result.path.poses(0.1).tobytes()


@pytest.mark.parametrize("kind", ["field", "mixed"])
def test_headings_on_random_problems(kind):
    """On every kind of map, with every kind of vehicle and tolerance."""
    rng = np.random.default_rng(6)
    for seed in range(scaled(60, least=6)):
        problem, _ = random_problem(rng, random_maps(30)[seed % 30])
        poses = drawn(problem, 300, heading_sampling=kind)
        assert np.isfinite(poses).all()
        result = plan(problem, Settings(samples=scaled(200, least=20), seed=seed, heading_sampling=kind, planning_time=60.0))
        assert result.path is None or audit(result.path, problem).ok
