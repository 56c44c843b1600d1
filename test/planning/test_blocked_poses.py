"""Poses at which, and between which, a vehicle touches an obstacle."""

import math

import numpy as np
import pytest
from support.cases import boxes_grid, holed_polygons, needs_compiled, random_pose

from dubins_rrt_ros.planning import GridMap, PolygonMap, Problem, Settings, Vehicle, load_map, plan, prepare
from dubins_rrt_ros.planning.audit.sweep import Arcs, clearance_findings
from dubins_rrt_ros.planning.collision.clearance import ClearanceField
from dubins_rrt_ros.planning.collision.poses import blocked_poses

TRUCK = "[[2.0, 0.5], [-0.5, 0.5], [-0.5, -0.5], [2.0, -0.5]]"


def wall():
    """10 m x 10 m with a wall of 0.1 m across it at x from 5.0 to 5.1 m, with a gap of 2 m around y = 5 m."""
    cells = np.zeros((100, 100), np.int8)
    cells[:, 50] = 100
    cells[40:60, 50] = 0
    return ClearanceField(GridMap(cells, 0.1))


def straight(y, spacing=0.5, yaw=0.0, begin=1.0):
    """Poses from x = 1 to 7.5 m, or from another one on."""
    x = np.arange(begin, 7.5 + 1e-9, spacing)
    return np.column_stack([x, np.full_like(x, y), np.full_like(x, yaw)])


def test_poses_in_an_obstacle_and_before_one_are_blocked():
    field, disc = wall(), Vehicle(robot_radius=0.2)
    assert blocked_poses(field, disc, straight(5.0)) == []
    assert blocked_poses(field, disc, straight(2.0)) == [8]  # at 5.0
    assert blocked_poses(field, Vehicle(robot_radius=0.1), straight(2.0, begin=1.25)) == [7]  # between 4.75 and 5.25
    assert blocked_poses(field, disc, straight(2.0, spacing=0.1)) == [38, 39, 40, 41, 42]


@pytest.mark.parametrize("yaw", [0.0, math.pi, math.pi / 2])
def test_a_disc_may_move_in_any_direction(yaw):
    assert blocked_poses(wall(), Vehicle(robot_radius=0.2), straight(5.0, yaw=yaw)) == []
    assert blocked_poses(wall(), Vehicle(robot_radius=0.1), straight(2.0, yaw=yaw, begin=1.25)) == [7]


def test_the_outline_counts_and_not_the_disc_around_it():
    car = Vehicle.from_footprint(TRUCK)
    assert blocked_poses(wall(), car, straight(4.6)) == []
    assert blocked_poses(wall(), car, straight(4.4)) == [5, 6, 7, 8, 9]
    assert blocked_poses(wall(), car, straight(5.0, yaw=math.pi, begin=2.5)) == []
    assert blocked_poses(wall(), car, straight(5.0, yaw=math.pi / 2)) == [8, 9]  # it is 2.5 m long, the gap 2 m


def test_a_turn_on_the_spot_sweeps_what_the_vehicle_turns_through():
    car = Vehicle.from_footprint(TRUCK)
    turn = np.array([[4.0, 3.0, -1.5], [4.0, 3.0, 1.5]])
    assert blocked_poses(wall(), car, turn) == [0]  # by way of 0, through the wall
    assert blocked_poses(wall(), car, turn - np.array([1.5, 0, 0])) == []


def test_what_is_outside_of_the_map_is_blocked():
    assert blocked_poses(wall(), Vehicle(), np.array([[9.5, 5.0, 0.0], [10.5, 5.0, 0.0]])) == [1]
    polygons = ClearanceField(PolygonMap.of([(0, 0), (4, 0), (4, 4), (0, 4)], [[(2, 1), (2.5, 1), (2.5, 3), (2, 3)]]))
    assert blocked_poses(polygons, Vehicle(), np.array([[1, 2, 0], [2.2, 2, 0], [3.5, 2, 0], [9, 2, 0]], float)) == [1, 3]


def test_a_single_pose_and_none():
    assert blocked_poses(wall(), Vehicle(), np.array([[5.05, 1.0, 0.0]])) == [0]
    assert blocked_poses(wall(), Vehicle(), np.array([[3.0, 1.0, 0.0]])) == []
    assert blocked_poses(wall(), Vehicle(), np.empty((0, 3))) == []


@needs_compiled
@pytest.mark.parametrize("vehicle", [Vehicle(), Vehicle.from_footprint("[[0.5, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.5, -0.2]]")])
@pytest.mark.parametrize("name", ["maze", "maze.geojson", "forest"])
def test_the_planner_s_own_paths_are_free(name, vehicle):
    world = prepare(load_map(name), vehicle)
    for seed in range(2):
        start, goal = ((1.5, 2.0, 1.57), (13.5, 10.5, 1.57)) if "maze" in name else ((1.0, 1.0, 0.8), (9.0, 9.0, 0.8))
        found = plan(Problem(world, start=start, goal=goal), Settings(samples=200, planning_time=20.0, seed=seed))
        if found.path:
            for spacing in (0.01, 0.1, 10.0):
                assert blocked_poses(world.field, vehicle, found.path.poses(spacing)) == []


#: A vehicle, and one that is smaller by 2 mm on all sides.
SMALLER = [
    (Vehicle(robot_radius=0.3), Vehicle(robot_radius=0.298)),
    (Vehicle.from_footprint(TRUCK),
     Vehicle.from_footprint("[[1.998, 0.498], [-0.498, 0.498], [-0.498, -0.498], [1.998, -0.498]]")),
]


@needs_compiled
@pytest.mark.parametrize(("vehicle", "smaller"), SMALLER, ids=["disc", "polygon"])
def test_random_arcs_are_judged_as_the_audit_does(vehicle, smaller):
    rng = np.random.default_rng(5)
    judged = {True: 0, False: 0}
    for number in range(20):
        world_map = boxes_grid(rng) if number % 2 else PolygonMap(holed_polygons(rng, count=4).free)
        field, (x0, y0) = ClearanceField(world_map), world_map.corners().mean(axis=0)
        for _ in range(20):
            x, y, theta = random_pose(rng, 4.0)
            arc = Arcs(*(np.array([value]) for value in (x + x0, y + y0, theta, rng.uniform(-1, 1), rng.uniform(0.1, 3.0))))
            poses = np.column_stack(arc.at(np.zeros(2, int), np.array([0.0, arc.length[0]])))
            blocked = bool(blocked_poses(field, vehicle, poses))
            vehicle_or_smaller = vehicle if blocked else smaller
            assert touches(arc, world_map, vehicle_or_smaller, poses) == blocked, (number, arc)
            judged[blocked] += 1
    assert min(judged.values()) > 50


def touches(arc, world_map, vehicle, poses):
    return bool(clearance_findings(arc, Problem(world_map, vehicle, poses[0], poses[1]))[0])
