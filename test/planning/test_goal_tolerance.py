"""Goals with a tolerance that hybrid A* aims at."""

import math

import numpy as np
import pytest

from dubins_rrt_ros.planning import FREE, OCCUPIED, GridMap, Problem, Settings, Vehicle, plan
from dubins_rrt_ros.planning.collision.clearance import ClearanceField
from dubins_rrt_ros.planning.search.hybrid_astar import HEADINGS_AT_GOAL, goal_poses

CELLS = np.full((200, 200), FREE, np.int8)
CELLS[[0, -1]] = CELLS[:, [0, -1]] = OCCUPIED
CELLS[80:90, 100:] = OCCUPIED  # a wall up to y = 4.5 m
ROOM = GridMap(CELLS, 0.05)
START = (2.0, 2.0, 0.0)


def goals_of(y: float, **tolerances: float) -> np.ndarray:
    vehicle = Vehicle(turning_radius=1.0, robot_radius=0.2)
    problem = Problem(ROOM, vehicle, START, (8.0, y, 0.0), **tolerances)
    return goal_poses(problem, ClearanceField(ROOM).collision_checker(vehicle))


def test_a_free_goal_is_aimed_at_itself():
    assert goals_of(5.0, goal_tolerance_xy=0.1).tolist() == [[8.0, 5.0, 0.0]]
    turned = goals_of(5.0, goal_tolerance_xy=0.1, goal_tolerance_yaw=0.4)
    assert len(turned) == HEADINGS_AT_GOAL + 1 and (turned[:, :2] == (8.0, 5.0)).all()
    assert np.abs(turned[:, 2]).max() == pytest.approx(0.4)


def test_of_a_goal_too_near_a_wall_the_nearest_free_pose_is_aimed_at():
    (x, y, heading), = goals_of(4.68, goal_tolerance_xy=0.1).tolist()
    assert heading == 0
    assert 0.02 <= math.hypot(x - 8.0, y - 4.68) < 0.026  # it lacks 2 cm


def test_a_goal_without_a_free_pose_stays():
    assert goals_of(4.5, goal_tolerance_xy=0.1).tolist() == [[8.0, 4.5, 0.0]]
    assert goals_of(4.68).tolist() == [[8.0, 4.68, 0.0]]


@pytest.mark.parametrize("heading", [0.0, -1.5, -3.0])
def test_hybrid_astar_finds_the_path_to_a_goal_too_near_a_wall(heading):
    problem = Problem(ROOM, Vehicle(turning_radius=1.0, robot_radius=0.2), START, (8.0, 4.68, heading), goal_tolerance_xy=0.1)
    answer = plan(problem, Settings(planner="rrt", planning_time=60, seed=1))
    assert answer.solved and answer.found_by == "hybrid_astar" and answer.samples == 0
    assert math.dist(answer.path.end[:2], problem.goal[:2]) < 0.026
