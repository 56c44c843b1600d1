"""Starts that are too near to an obstacle: they are left by no way that comes nearer, and the audit judges just that."""

import math
import re
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from support.cases import needs_compiled, scaled

from dubins_rrt_ros.evaluation.families.buildings import building
from dubins_rrt_ros.planning import (
    GridMap,
    Path,
    PolygonMap,
    Problem,
    Settings,
    Status,
    Vehicle,
    audit_path,
    load_map,
    plan,
    plan_through,
    planner,
    prepare,
    waypoints,
)
from dubins_rrt_ros.planning import departure as departures
from dubins_rrt_ros.planning.audit.departure import start_room
from dubins_rrt_ros.planning.curves.dubins import DubinsCurve
from dubins_rrt_ros.planning.deadline import OutOfTime, never

DISC = Vehicle(turning_radius=1.0, robot_radius=0.2)
CAR = Vehicle.from_footprint([(0.32, 0.36), (-0.48, 0.36), (-0.48, -0.36), (0.32, -0.36)], turning_radius=0.4)
SETTINGS = Settings(samples=scaled(100, least=20), planning_time=60.0, seed=1)
GOAL = (8.0, 4.0, 0.0)


def room(cell=0.1, marks=()):
    """10 m x 8 m with walls of 0.1 m, and with cells marked at places (x, y)."""
    cells = np.zeros((round(8 / cell), round(10 / cell)), np.int8)
    wall = round(0.1 / cell)
    cells[:wall], cells[-wall:], cells[:, :wall], cells[:, -wall:] = 100, 100, 100, 100
    for x, y in marks:
        cells[int(y / cell), int(x / cell)] = 100
    return GridMap(cells, cell)


ROOM = room()
POLYGONS = PolygonMap.of(shapely.box(0.1, 0.1, 9.9, 7.9))


def left(world_map, vehicle, start, slack, goal=GOAL, **options):
    answer = plan(Problem(world_map, vehicle, start, goal, start_slack=slack, **options), SETTINGS)
    answer.check()
    return answer


def gaps(poses, vehicle, depth=0.0):
    """The gaps between the walls and a vehicle that is smaller by a depth all around, measured without the package's help."""
    x, y, theta = np.asarray(poses).T
    corners = np.array(vehicle.footprint) * (1 - depth / np.abs(vehicle.footprint)) if vehicle.footprint else np.zeros((1, 2))
    px = x[:, None] + np.cos(theta)[:, None] * corners[:, 0] - np.sin(theta)[:, None] * corners[:, 1]
    py = y[:, None] + np.sin(theta)[:, None] * corners[:, 0] + np.cos(theta)[:, None] * corners[:, 1]
    to_walls = np.min([px - 0.1, 9.9 - px, py - 0.1, 7.9 - py], axis=(0, 2))
    return to_walls - (0 if vehicle.footprint else vehicle.robot_radius - depth)


def depth_at(pose, vehicle):
    """How far walls reach into the vehicle."""
    low, high = 0.0, 0.3
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (low, middle) if gaps([pose], vehicle, middle)[0] >= 0 else (middle, high)
    return high


def assert_comes_no_nearer(answer, slack):
    assert answer.solved, answer
    assert answer.start_too_near
    poses, vehicle = answer.path.poses(0.002), answer.problem.vehicle
    clear = int(np.argmax(gaps(poses, vehicle) >= 0))
    depth = depth_at(poses[0], vehicle)
    assert depth <= slack + 1e-6
    assert gaps(poses[:clear + 1], vehicle, depth + 1e-6).min() >= 0
    assert gaps(poses[clear:], vehicle).min() >= -1e-6
    assert audit_path(answer.path, answer.problem).ok


@pytest.mark.parametrize("world_map", [ROOM, POLYGONS], ids=["grid", "polygons"])
@pytest.mark.parametrize(("start", "slack"), [
    ((0.3, 4.0, 0.0), 0.001), ((0.25, 4.0, 0.0), 0.06), ((0.25, 4.0, math.pi / 2), 0.06), ((0.28, 4.0, -0.8), 0.1)])
def test_a_disc_leaves_a_wall(world_map, start, slack):
    answer = left(world_map, DISC, start, slack)
    assert_comes_no_nearer(answer, slack)
    refused = left(world_map, DISC, start, 0.0)
    assert refused.status == Status.START_OCCUPIED and not refused.start_too_near
    assert refused.message.endswith(", or set start_slack if it can leave.")


@needs_compiled
@pytest.mark.parametrize("world_map", [ROOM, POLYGONS], ids=["grid", "polygons"])
@pytest.mark.parametrize("start", [(5.0, 0.45, 0.2), (0.52, 4.0, 0.0), (1.5, 0.4, 0.5)])
def test_a_car_leaves_a_wall_that_its_corner_is_in(world_map, start):
    assert_comes_no_nearer(left(world_map, CAR, start, 0.25), 0.25)


@needs_compiled
@pytest.mark.parametrize("slack", [0.06, 0.3])
def test_the_swing_of_the_tail_is_told(slack):
    answer = left(ROOM, CAR, (5.0, 0.4, 0.0), slack)
    assert answer.status == Status.START_OCCUPIED
    assert "the start is 0.06 m too near, within start_slack" in answer.message
    assert "its tail swings 0.0" in answer.message


def test_a_start_deeper_than_the_slack_is_refused_with_its_depth():
    answer = left(ROOM, CAR, (5.0, 0.4, 0.0), 0.05)
    assert answer.status == Status.START_OCCUPIED
    assert "cells reach farther into the footprint than start_slack is 0.05 m, the deepest by 0.06 m at" in answer.message
    assert "it is 0.05 m too near, and start_slack is 0.02 m" in left(ROOM, DISC, (0.25, 4.0, 0.0), 0.02).message


def test_a_cell_deep_in_the_footprint_is_counted_and_named():
    answer = left(room(0.05, [(5.0, 4.0)]), CAR, (5.0, 4.0, 0.0), 0.1)
    assert answer.status == Status.START_OCCUPIED
    assert "1 cell reaches farther into the footprint than start_slack is 0.1 m" in answer.message
    assert math.dist(answer.location, (5.025, 4.025)) < 0.05


@needs_compiled
def test_a_cell_that_reaches_in_by_no_more_than_the_slack_is_left_behind():
    spoiled = room(0.05, [(4.54, 3.9)])  # at the rear edge of the car
    assert left(spoiled, CAR, (5.0, 4.0, 0.0), 0.0).status == Status.START_OCCUPIED
    answer = left(spoiled, CAR, (5.0, 4.0, 0.0), 0.1)
    assert answer.solved and answer.start_too_near


SHORT_CAR = Vehicle.from_footprint([(0.32, 0.26), (-0.48, 0.26), (-0.48, -0.26), (0.32, -0.26)], turning_radius=0.6)
LONG_NOSE = Vehicle.from_footprint([(0.6, 0.2), (-0.1, 0.2), (-0.1, -0.2), (0.6, -0.2)], turning_radius=0.8)


def departure_of(grid_map, vehicle, start, goal):
    world = prepare(grid_map, vehicle)
    problem = Problem(world, start=start, goal=goal, start_slack=0.1)
    path = departures.find_departure(problem, world, "Start is occupied.", never).path
    assert path is not None
    return audit_path(path, replace(problem, goal=path.end))


@needs_compiled
@pytest.mark.parametrize(("vehicle", "start"), [
    (SHORT_CAR, (9.4792, 6.614, 0.474)), (LONG_NOSE, (6.2777, 4.2529, 0.5147)), (LONG_NOSE, (8.0415, 8.9996, -3.0607))])
def test_departures_are_audited_until_one_passes(vehicle, start):
    assert departure_of(load_map("maze"), vehicle, start, (9.39, 10.81, 1.65)).ok


@needs_compiled
def test_a_departure_touches_nothing_once_it_was_clear():
    assert departure_of(load_map("maze"), SHORT_CAR, (2.7312743, 4.2974122, -1.4062564), (9.39, 10.81, 1.65)).ok


@needs_compiled
@pytest.mark.parametrize("start", [(28.3102, 13.8538, -3.0853), (30.4072, 17.752, -0.0205)])
def test_where_the_tail_has_little_room_a_slight_turn_leads_out(start):
    assert departure_of(building("office", 1, 0).map, SHORT_CAR, start, GOAL).ok


def test_facing_a_wall_there_is_no_way_out():
    answer = left(ROOM, DISC, (0.25, 4.0, math.pi), 0.1)
    assert answer.status == Status.START_OCCUPIED
    assert "no way leads out of it" in answer.message


def test_where_the_start_is_free_the_slack_changes_nothing():
    start = (2.0, 4.0, 0.0)
    answer = left(ROOM, DISC, start, 0.2)
    assert answer.path == left(ROOM, DISC, start, 0.0).path
    assert not answer.start_too_near


def test_waypoints_are_reached_from_such_a_start_too():
    problem = Problem(ROOM, DISC, (0.25, 4.0, 0.0), GOAL, start_slack=0.06)
    answer = plan_through(problem, [(0.25, 4.0), (5.0, 2.0), (6.0, 6.0)], SETTINGS)
    answer.check()
    assert_comes_no_nearer(answer, 0.06)
    assert answer.waypoint_indices[0] == 0
    np.testing.assert_allclose(answer.poses()[list(answer.waypoint_indices[1:]), :2], [(5.0, 2.0), (6.0, 6.0)])


LEAVING = Problem(ROOM, DISC, (0.25, 4.0, 0.0), GOAL, start_slack=0.06)


@pytest.mark.parametrize("through", [(), [(5.0, 2.0)]], ids=["goal", "waypoint"])
def test_the_times_are_those_since_the_request(through, monkeypatch):
    def found_late(*given):
        time.sleep(0.2)
        return departures.find_departure(*given)
    for module in (planner, waypoints):
        monkeypatch.setattr(module, "find_departure", found_late)
    reports = []
    answer = plan_through(LEAVING, through, SETTINGS) if through else plan(LEAVING, SETTINGS, on_progress=reports.append)
    answer.check()
    assert 0.2 <= answer.time_to_found <= answer.time_to_first <= answer.planning_time
    assert all(report.elapsed >= 0.2 for report in reports)


def test_a_timeout_tells_the_time_since_the_request(monkeypatch):
    def found_late(*given):
        time.sleep(0.2)
        return departures.find_departure(*given)
    monkeypatch.setattr(planner, "find_departure", found_late)
    corridor = room(marks=[(x, 1.25) for x in np.arange(5.05, 10.0, 0.1)])
    on_the_way_out = (6.0, 0.65, math.pi)  # of a corridor with one end, in which the vehicle cannot turn round
    problem = Problem(corridor, DISC, LEAVING.start, on_the_way_out, start_slack=0.06)
    answer = plan(problem, Settings(planning_time=1.0, seed=1))
    assert answer.status == Status.TIMEOUT and "within planning_time 1 s" in answer.message
    assert float(re.search(r"tree nodes?, ([0-9.]+) s", answer.message)[1]) >= 0.3


def test_a_whole_path_is_audited_once(monkeypatch):
    audited, snapshots = [], []

    def audit(path, *given):
        audited.append(path)
        return audit_path(path, *given)

    def look(report):
        snapshots.extend([report.snapshot(), report.snapshot()])
        assert tuple(report.tree().poses[0]) == LEAVING.start
    monkeypatch.setattr(departures, "audit_path", audit)
    answer = plan(LEAVING, SETTINGS, on_progress=look, report_samples=10)
    assert answer.solved and len(snapshots) > 2 * len(audited) > 0
    assert all(one != other for one, other in pairwise(audited))


@pytest.mark.parametrize("through", [(), [(5.0, 2.0)]], ids=["goal", "waypoint"])
def test_a_whole_path_that_there_is_no_time_to_audit_is_no_answer(through, monkeypatch):
    def late(*_):
        raise OutOfTime
    monkeypatch.setattr(departures, "audit_path", late)
    answer = plan_through(LEAVING, through, SETTINGS) if through else plan(LEAVING, SETTINGS)
    answer.check()
    assert answer.status == Status.TIMEOUT and not answer.start_too_near
    assert "no time left to audit it" in answer.message


def straight(start, length, word="LSL", turn=0.0):
    curve = DubinsCurve(start, 1.0, word, (turn, length, 0.0))
    return Path.of_curves(start, curve.end, [curve])


@pytest.mark.parametrize(("theta", "slack", "turn", "finding"), [
    (0.0, 0.06, 0.0, ""), (1.8, 0.06, 0.0, "never clear"), (math.pi / 2, 0.06, 0.0, "never clear"), (math.pi / 2, 0.06, 0.5, ""),
    (0.0, 0.04, 0.0, "more than start_slack 0.04 m"), (1.6, 0.06, 0.5, "comes nearer to an obstacle than at its start"),
])
def test_the_audit_judges_the_room_until_the_vehicle_is_clear(theta, slack, turn, finding):
    start = (0.25, 4.0, theta)
    path = straight(start, 1.0, "RSR", turn)
    problem = Problem(ROOM, DISC, start, path.end, start_slack=slack)
    found = audit_path(path, problem)
    assert found.ok == (not finding)
    assert any(finding in said for said in found.findings) or not finding, found
    assert not audit_path(path, replace(problem, start_slack=0.0)).ok


def test_the_audit_goes_on_where_the_vehicle_is_clear():
    start = (0.25, 4.0, 0.0)
    path = straight(start, 9.5)
    found = audit_path(path, Problem(ROOM, DISC, start, path.end, start_slack=0.06))
    assert any("less than the robot's radius" in said for said in found.findings)


@pytest.mark.parametrize(("y", "expected"), [(0.4, -0.06), (0.46, 0.0), (0.5, 0.04)])
@pytest.mark.parametrize("world_map", [ROOM, POLYGONS], ids=["grid", "polygons"])
def test_the_room_at_the_start_is_signed(world_map, y, expected):
    assert start_room(Problem(world_map, CAR, (5.0, y, 0.0), GOAL)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(("vehicle", "words"), [(DISC, r"is free, 0.051? m away"), (CAR, r"is free, 0.1[0-9]* m away")])
def test_an_occupied_goal_names_the_nearest_free_pose(vehicle, words):
    problem = Problem(prepare(ROOM, vehicle), start=(5.0, 4.0, 0.0), goal=(9.75, 4.0, 0.0))
    answer = plan(problem, SETTINGS)
    assert answer.status == Status.GOAL_OCCUPIED
    pose = tuple(float(number) for number in answer.message.rpartition("; (")[2].partition(")")[0].split(","))
    assert plan(replace(problem, goal=pose), SETTINGS).solved
