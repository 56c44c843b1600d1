"""Known paths: the cheapest free curves onto them and off them, and searches that begin with one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.cases import boxes_grid, maze_grid, needs_compiled, scaled
from support.yard import GOAL, START, yard

from dubins_rrt_ros.planning import GridMap, Problem, Settings, Status, Vehicle, plan, prepare
from dubins_rrt_ros.planning.collision.clearance import ClearanceField
from dubins_rrt_ros.planning.curves import dubins
from dubins_rrt_ros.planning.curves.path import Path
from dubins_rrt_ros.planning.search.known_path import KnownPath

DISC = Vehicle(turning_radius=1.0, robot_radius=0.2)
SETTINGS = Settings(samples=200, planning_time=120.0, seed=1, preferred_clearance=0.0)


@pytest.fixture(scope="module")
def world():
    return prepare(GridMap(yard(), 0.1), DISC)


@pytest.fixture(scope="module")
def first(world):
    answer = plan(Problem(world, start=START, goal=GOAL), SETTINGS)
    assert answer.path
    return answer.path


def cheapest(field, path, pose, onto_path):
    """The cheapest junction by trying all, in order of their cost."""
    poses = [tuple(waypoint) for waypoint in path.waypoints.tolist()]
    lengths = path.lengths[1:].sum(axis=1)
    found = []
    for i, other in enumerate(poses):
        curve = dubins.shortest(*((pose, other) if onto_path else (other, pose)), path.radius)
        if field.curve_is_free(curve, DISC):
            found.append((curve.length + lengths[i:].sum() if onto_path else lengths[:i].sum() + curve.length, i))
    return min(found, default=(math.inf, -1))


@pytest.mark.parametrize("onto_path", [True, False])
def test_junctions_are_the_cheapest_free_curves(world, first, onto_path):
    known = KnownPath(first, world.field, DISC)
    rng = np.random.default_rng(3)
    poses = [(*rng.uniform(0, 10, 2).tolist(), rng.uniform(-3, 3)) for _ in range(scaled(60, least=3))]
    found = known.onto(poses) if onto_path else known.off(poses)
    for pose, cost, index in zip(poses, *found, strict=True):
        expected, at = cheapest(world.field, first.cut(0.5), pose, onto_path)
        assert cost == pytest.approx(expected)
        if at >= 0:
            assert index == at


def test_its_own_ends_are_joined_by_itself(world, first):
    again = KnownPath(first, world.field, DISC).joined(START, GOAL)
    assert again.length == pytest.approx(first.length)


def test_where_the_ways_onto_the_path_and_off_it_cross_the_direct_curve_is_taken(world):
    straight = Path.of_curves((2.0, 1.0, 0.0), (6.0, 1.0, 0.0), [dubins.shortest((2.0, 1.0, 0.0), (6.0, 1.0, 0.0), 1.0)])
    known, goal = KnownPath(straight, ClearanceField(GridMap(np.zeros((100, 100), np.int8), 0.1)), DISC), (6.2, 1.0, 0.0)
    for start in (2.0, 1.0, 0.0), (2.1, 1.0, 0.0), (5.9, 1.0, 0.0):
        joined = known.joined(start, goal)
        assert (joined.start, joined.end) == (start, goal)
        assert joined.length == pytest.approx(6.2 - start[0])


def test_what_is_blocked_now_is_not_joined(world, first):
    cells = yard()
    x, y, _ = first.at(np.array([0.5]))[0]
    cells[int(10 * y), int(10 * x)] = 100
    field = world.updated(GridMap(cells, 0.1)).field
    assert KnownPath(first, world.field, DISC).joined(START, GOAL)
    assert KnownPath(first, field, DISC).joined(START, GOAL) is None


def test_a_search_begins_with_the_path_of_a_vehicle_that_moved_on(world, first):
    x, y, theta = first.at(np.array([0.2]))[0].tolist()
    problem = Problem(world, start=(x + 0.02, y - 0.03, theta + 0.05), goal=GOAL)
    answer = plan(problem, replace(SETTINGS, planner="rrt"), seed_path=first)
    answer.check()
    assert (answer.found_by, answer.samples) == ("seed_path", 0)
    assert answer.message.startswith("Path of ") and "found by the seed path" in answer.message
    assert answer.length < 0.85 * first.length
    assert plan(problem, replace(SETTINGS, planner="rrt"), seed_path=first).path == answer.path


@pytest.mark.parametrize("options", [{}, {"informed": False}, {"shortcut": False}, {"step_size": 0.7}])
def test_it_goes_on_from_there(world, first, options):
    answer = plan(Problem(world, start=START, goal=GOAL), replace(SETTINGS, **options), seed_path=first)
    answer.check()
    assert answer.length <= first.length + 1e-9


def test_another_goal_is_driven_to_off_the_path(world, first):
    goal = (GOAL[0] - 0.5, GOAL[1] + 0.3, GOAL[2])
    answer = plan(Problem(world, start=START, goal=goal), replace(SETTINGS, planner="rrt"), seed_path=first)
    answer.check()
    assert answer.found_by == "seed_path"


@pytest.mark.parametrize("vehicle", [replace(DISC, turning_radius=0.7), replace(DISC, robot_radius=0.9)])
def test_a_path_that_does_not_fit_is_left_out(world, first, vehicle):
    problem = Problem(world.for_vehicle(vehicle), start=START, goal=GOAL)
    assert plan(problem, SETTINGS, seed_path=first).path == plan(problem, SETTINGS).path


def test_a_start_in_an_obstacle_has_no_path_whatever_the_seed(world, first):
    assert plan(Problem(world, start=(5.0, 5.0, 0.0), goal=GOAL), SETTINGS, seed_path=first).status == Status.START_OCCUPIED


@needs_compiled
@pytest.mark.parametrize("make", [boxes_grid, maze_grid])
def test_seeded_paths_are_right_in_worlds_that_change(make):
    rng = np.random.default_rng(7)
    world, path = prepare(make(rng), DISC), None
    corners = world.map.corners()
    goal = (*(corners[0] + 0.9 * (corners[2] - corners[0])), 0.5)
    for _ in range(20):
        cells = world.map.data.copy()
        row, column = rng.integers(0, cells.shape[0] - 4, 2)
        cells[row:row + 3, column:column + 3] = rng.choice([0, 100])
        world = world.updated(GridMap(cells, world.map.resolution, world.map.origin, percent=True))
        start = (*(corners[0] + rng.uniform(0.05, 0.5, 2) @ (corners[[1, 3]] - corners[0])), rng.uniform(-3, 3))
        answer = plan(Problem(world, start=start, goal=goal), Settings(samples=100, planning_time=0.1, seed=1), seed_path=path)
        answer.check()
        path = answer.path or path
