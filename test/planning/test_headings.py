"""The headings of samples: what `field` and `mixed` draw, and the distances to the goal that they follow."""

import math

import numpy as np
import pytest
from support.cases import (
    boxes_grid,
    empty_map,
    field_of,
    free_pose,
    holed_polygons,
    maze_grid,
    naive_clearance,
    needs_compiled,
    random_maps,
    random_problem,
    scaled,
)

from dubins_rrt_ros.planning import ClearanceField, GridMap, Problem, Settings, Status, Vehicle, audit_path, load_map, plan
from dubins_rrt_ros.planning.maps.locate import maps_directory
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.headings import DEVIATION, UNIFORM_SHARE
from dubins_rrt_ros.planning.search.sampling import Sampler

KINDS = ("uniform", "goal", "field", "mixed")


def goal_field(map, goal, vehicle, **options):
    problem = Problem(map, vehicle, (*goal, 0.0), (*goal, 0.0), **options)
    return CostToGo.to_goal(problem, ClearanceField(map))


def follow(field, point, goal, steps):
    """How far one gets to the goal along the field, and how many metres that takes."""
    step = field.kernel.side / 4
    taken = 0
    while taken < steps and math.dist(point, goal) >= field.kernel.side:
        heading = field.headings(np.array([point]))[0]
        point = point + step * np.array([math.cos(heading), math.sin(heading)])
        taken += 1
    return math.dist(point, goal), taken * step


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
        cost = field.at(point[None])[0]
        if cost == math.inf:
            continue
        left, length = follow(field, point, goal, int(8 * cost / field.kernel.side) + 20)
        assert left < field.kernel.side
        assert 0.8 * cost - 3 * field.kernel.side <= length <= 1.2 * cost + 3 * field.kernel.side
        detour = max(detour, cost / math.dist(point, goal))
    if kind in ("maze", "walls"):
        assert detour > 1.3


def test_in_the_open_the_field_leads_straight_to_the_goal():
    rng = np.random.default_rng(4)
    points = rng.uniform(-9, 9, (500, 2))
    field = goal_field(empty_map(), (3.0, -2.0), Vehicle(0.5, 0.2))
    off = field.headings(points) - np.arctan2(-2 - points[:, 1], 3 - points[:, 0])
    far = np.hypot(*(points - (3, -2)).T) > 4 * field.kernel.side
    assert np.abs(np.remainder(off + math.pi, math.tau) - math.pi)[far].max() < math.radians(12)


def test_beyond_the_map_the_field_has_no_headings():
    field = goal_field(empty_map(), (3.0, -2.0), Vehicle(0.5, 0.2))
    assert np.isnan(field.headings(np.array([(10.5, 0.0), (-30.0, 2.0), (1.0, 11.0), (1e6, -1e6)]))).all()


def walled():
    """A map that a wall across parts, and a problem whose start and goal lie below it."""
    data = np.zeros((40, 40), np.int8)
    data[20] = 100
    return Problem(GridMap(data, 0.25), Vehicle(0.5, 0.2), (1, 1, 0), (9, 1, 0))


def drawn(problem, count=4000, **options):
    settings, field = Settings(**{"seed": 1, "goal_bias": 0.0, **options}), field_of(problem)
    return Sampler(problem, settings, field, CostToGo.to_goal(problem, field)).draw(count)


@pytest.mark.parametrize("kind", ["field", "mixed"])
def test_headings_are_uniform_where_the_goal_is_not_reached(kind):
    poses = drawn(walled(), heading_sampling=kind, informed=False)
    beyond = poses[poses[:, 1] > 5.5, 2]
    assert len(beyond) > 1000
    counts, _ = np.histogram(beyond, bins=8, range=(-math.pi, math.pi))
    assert (np.abs(counts / len(beyond) * 8 - 1) < 0.25).all()
    below = poses[poses[:, 1] < 4.5, 2]
    assert (np.abs(below) < math.pi / 2).mean() > 0.8


def test_mixed_headings_are_uniform_by_a_fixed_share_and_else_near_the_field():
    problem = walled()
    poses = drawn(problem, heading_sampling="mixed")
    led = CostToGo.to_goal(problem, ClearanceField(problem.map)).headings(poses[:, :2])
    off = np.abs(np.remainder(poses[:, 2] - led + math.pi, math.tau) - math.pi)[np.isfinite(led)]
    assert len(off) > 1500
    opposite = (off > math.pi / 2).mean()
    assert opposite == pytest.approx(UNIFORM_SHARE / 2, abs=0.03)
    within = (off < DEVIATION).mean()
    assert within == pytest.approx((1 - UNIFORM_SHARE) * math.erf(math.sqrt(0.5)) + UNIFORM_SHARE * DEVIATION / math.pi, abs=0.04)
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
    for seed in range(3):
        settings = Settings(samples=500, seed=seed, heading_sampling=kind, planning_time=60.0)
        result = plan(problem, settings)
        assert result.status == Status.NONE
        assert audit_path(result.path, problem).ok
        if seed == 0:
            again = plan(problem, settings)
            assert again.path.poses(0.1).tobytes() == result.path.poses(0.1).tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["field", "mixed"])
def test_headings_on_random_problems(kind):
    """On every kind of map, with every kind of vehicle and tolerance."""
    rng = np.random.default_rng(6)
    for seed in range(scaled(60, least=6)):
        problem, _ = random_problem(rng, random_maps(30)[seed % 30])
        poses = drawn(problem, 300, heading_sampling=kind)
        assert np.isfinite(poses).all()
        result = plan(problem, Settings(samples=scaled(200, least=20), seed=seed, heading_sampling=kind, planning_time=0.15))
        assert result.path is None or audit_path(result.path, problem).ok
