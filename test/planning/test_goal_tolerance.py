"""Goals with a tolerance: a path ends at the free pose nearest to the goal."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.cases import scaled

from dubins_rrt_ros.planning import FREE, OCCUPIED, GridMap, Problem, Settings, Vehicle, plan
from dubins_rrt_ros.planning.collision.clearance import ClearanceField
from dubins_rrt_ros.planning.curves import dubins
from dubins_rrt_ros.planning.curves.path import Path
from dubins_rrt_ros.planning.search.goal_poses import HEADINGS_AT_GOAL, goal_poses
from dubins_rrt_ros.planning.search.growing_tree import GrowingTree

CELLS = np.full((200, 200), FREE, np.int8)
CELLS[[0, -1]] = CELLS[:, [0, -1]] = OCCUPIED
CELLS[80:90, 100:] = OCCUPIED  # a wall up to y = 4.5 m
ROOM = GridMap(CELLS, 0.05)
FIELD = ClearanceField(ROOM)
START = (2.0, 2.0, 0.0)
VEHICLE = Vehicle(turning_radius=1.0, robot_radius=0.2)
SAMPLES = scaled(600, least=60)
NEAR_WALL = (8.0, 4.68, 0.0)  # it lacks 2 cm


def goals_of(y: float, start: tuple[float, float, float] = START, room: GridMap = ROOM, vehicle: Vehicle = VEHICLE,
             **tolerances: float) -> np.ndarray:
    return goal_poses(Problem(room, vehicle, start, (8.0, y, 0.0), **tolerances), ClearanceField(room))


def ends_off(problem: Problem, settings: Settings | None = None) -> float:
    """Return how far from the goal a path ends [m]."""
    answer = plan(problem, settings or Settings(samples=SAMPLES, planning_time=60, seed=1))
    answer.check()
    assert answer.path is not None, answer.message
    return math.dist(answer.path.end[:2], problem.goal[:2])


def test_a_free_goal_is_aimed_at_itself():
    assert goals_of(5.0, goal_tolerance_xy=0.1).tolist() == [[8.0, 5.0, 0.0]]
    turned = goals_of(5.0, goal_tolerance_xy=0.1, goal_tolerance_yaw=0.4)
    assert len(turned) == HEADINGS_AT_GOAL + 1 and (turned[:, :2] == (8.0, 5.0)).all()
    assert np.abs(turned[:, 2]).max() == pytest.approx(0.4)


def test_of_a_goal_too_near_a_wall_the_nearest_free_pose_is_aimed_at():
    (x, y, heading), = goals_of(4.68, goal_tolerance_xy=0.1).tolist()
    assert heading == 0
    assert 0.02 <= math.hypot(x - 8.0, y - 4.68) < 0.021


def test_the_nearest_pose_may_be_one_with_another_heading():
    lying = Vehicle(turning_radius=1.0, footprint=((0.5, 0.1), (-0.5, 0.1), (-0.5, -0.1), (0.5, -0.1)))
    (x, y, _), = goals_of(4.58, vehicle=lying, goal_tolerance_xy=0.6).tolist()
    assert 0.02 <= math.hypot(x - 8.0, y - 4.58) < 0.022  # along the wall
    across = goal_poses(Problem(ROOM, lying, START, (8.0, 4.58, math.pi / 2), 0.6, math.pi / 2), FIELD)
    assert math.hypot(*(across[0, :2] - (8.0, 4.58))) < 0.022


def test_a_goal_without_a_free_pose_stays():
    assert goals_of(4.5, goal_tolerance_xy=0.1).tolist() == [[8.0, 4.5, 0.0]]
    assert goals_of(4.68).tolist() == [[8.0, 4.68, 0.0]]


def test_a_pose_that_is_cut_off_from_the_start_is_none():
    cells = CELLS.copy()
    cells[80:82] = OCCUPIED  # a wall of 10 cm across the room
    room = GridMap(cells, 0.05)
    (x, y, _), = goals_of(4.4, room=room, goal_tolerance_xy=1.0).tolist()
    assert y < 4.0 - 0.2  # on the start's side, though the other one is nearer
    assert 0.6 <= math.hypot(x - 8.0, y - 4.4) < 0.61


@pytest.mark.parametrize("heading", [0.0, -1.5, -3.0])
def test_hybrid_astar_finds_the_path_to_a_goal_too_near_a_wall(heading):
    problem = Problem(ROOM, VEHICLE, START, (*NEAR_WALL[:2], heading), goal_tolerance_xy=0.1)
    answer = plan(problem, Settings(planner="rrt", planning_time=60, seed=1))
    assert answer.solved and answer.found_by == "hybrid_astar" and answer.samples == 0
    assert math.dist(answer.path.end[:2], problem.goal[:2]) < 0.021


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_a_path_ends_as_near_to_the_goal_as_a_free_pose_is(planner):
    settings = Settings(planner=planner, samples=SAMPLES, planning_time=60, seed=1)
    near_wall = Problem(ROOM, VEHICLE, START, NEAR_WALL, goal_tolerance_xy=0.3)
    assert 0.02 <= ends_off(near_wall, settings) < 0.021
    assert ends_off(replace(near_wall, goal=(8.0, 6.0, 1.0)), settings) == 0
    assert ends_off(replace(near_wall, goal=(8.0, 6.0, 1.0), any_goal_heading=True), settings) == 0


def test_a_path_does_not_end_behind_a_wall_beside_the_goal():
    cells = CELLS.copy()
    cells[80:82, 40:] = OCCUPIED
    problem = Problem(GridMap(cells, 0.05), VEHICLE, START, (8.0, 4.75, 0.0), goal_tolerance_xy=1.2)
    assert ends_off(problem) == 0


def test_plain_algorithms_end_anywhere_within_the_tolerance():
    problem = Problem(ROOM, VEHICLE, START, (8.0, 6.0, 1.0), goal_tolerance_xy=1.0, any_goal_heading=True)
    assert 0 < ends_off(problem, Settings.paper(planner="rrt", samples=5000, planning_time=60, seed=1)) <= 1.0


def test_a_seed_path_to_the_edge_of_the_tolerance_is_led_on():
    problem = Problem(ROOM, VEHICLE, START, (8.0, 2.0, 0.0), goal_tolerance_xy=0.3)
    known = Path.of_curves(START, (7.8, 2.0, 0.0), [dubins.shortest(START, (7.8, 2.0, 0.0), 1.0)])
    answer = plan(problem, Settings(samples=1, planning_time=60, seed=1), seed_path=known)
    assert answer.found_by == "seed_path"
    assert answer.path.end == problem.goal


def test_a_path_that_ends_elsewhere_is_led_to_the_nearest_pose():
    problem = Problem(ROOM, VEHICLE, START, (8.0, 2.0, 0.0), goal_tolerance_xy=0.5)
    tree = GrowingTree(problem, Settings(), FIELD, np.array(problem.goal[:2]))
    end = (7.6, 2.0, 0.0)
    tree.insert_if_better(Path.of_curves(START, end, [dubins.shortest(START, end, 1.0)]), "rrt")
    assert tree.path.end == end
    tree.approach_nearest()
    assert tree.path.end == problem.goal and tree.found_by == "rrt"
    assert tree.problem.exact_goal
    tree.take(np.array([(7.9, 2.0, 0.0)]), 0, 1, is_rrt=False)
    assert tree.path.end == problem.goal  # though another node within the tolerance is nearer to the start


def test_the_outermost_headings_are_within_the_tolerance_in_spite_of_rounding():
    rng = np.random.default_rng(4)
    for heading, tolerance in zip(rng.uniform(-300, 300, 200).tolist(), (10 ** rng.uniform(-3, 0.4, 200)).tolist(), strict=True):
        headings = goal_poses(Problem(ROOM, VEHICLE, START, (8.0, 6.0, heading), 0.0, tolerance), FIELD)[:, 2]
        assert max(abs(math.remainder(turned - heading, math.tau)) for turned in headings.tolist()) <= tolerance


@pytest.mark.parametrize("turning_radius", [1e3, 1e4])
def test_a_free_heading_is_that_of_an_arc_and_a_straight_where_others_need_a_loop(turning_radius):
    """Of 16 headings none is near enough to that in which a goal a little aside is reached without turning all the way round."""
    problem = Problem(ROOM, Vehicle(turning_radius, 0.2), START, (8.0, 2.001, 0.0), any_goal_heading=True)
    for seed in range(3):
        answer = plan(problem, Settings(samples=10, planning_time=60, seed=seed))
        assert answer.length == pytest.approx(6.0, abs=1e-3)
