"""The contract that every planner meets: it answers each request with a path or a reason, within its limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from support.cases import empty_map, needs_compiled, scaled
from support.planner_cases import GOAL, START, VEHICLE, assert_refused, settings, walled

from dubins_rrt_ros.planning import GridMap, PolygonMap, Problem, Settings, Status, Vehicle, audit_path, load_map, plan
from dubins_rrt_ros.planning.maps.locate import maps_directory


@pytest.fixture(params=["rrt", "rrt_star"])
def planner(request):
    return request.param


@pytest.fixture(scope="module", params=["yaml", "geojson"])
def maze(request):
    map = load_map(maps_directory() / f"maze.{request.param}")
    return Problem(map, Vehicle(), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))


def test_solves(planner):
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings(planner))
    assert result.status == Status.NONE
    assert result.solved and result.audit.ok
    assert result.path.start == START
    assert result.path.end == GOAL
    poses = result.path.poses(0.05)
    assert tuple(poses[0]) == START
    assert tuple(poses[-1]) == GOAL
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= 0.05 + 1e-9
    assert result.length >= result.lower_bound
    assert result.gap == pytest.approx(result.length / result.lower_bound - 1)
    assert result.max_curvature == pytest.approx(2.0)
    assert result.min_clearance >= 0.2
    assert 0 < result.time_to_first <= result.planning_time
    assert f"{result.length:.2f} m" in result.message
    result.tree.check()


@needs_compiled
@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3, 4))])
def test_solves_the_maze(maze, planner, seed):
    result = plan(maze, settings(planner, seed=seed))
    assert result.status == Status.NONE
    assert audit_path(result.path, maze).ok
    assert 20 < result.length < (25 if planner == "rrt_star" else 60)


@pytest.mark.parametrize("x, y", [(6.83, 7.402), (2.324, 4.09), (5.914, 2.929), (7.386, 7.685), (3.0, 5.0)])
def test_a_point_does_not_drive_through_a_wall(planner, x, y):
    """A vehicle without size, and a wall of a centimetre between it and the goal."""
    wall = shapely.box(10, 1, 10.01, 9)
    problem = Problem(PolygonMap(shapely.box(0, 0, 20, 10) - wall), Vehicle(0.5, 0.0), (x, y, 0.0), (18.0, y, 0.0))
    result = plan(problem, settings(planner, goal_bias=0.5, samples=scaled(1000, least=200), planning_time=2.0))
    assert result.status in (Status.NONE, Status.TIMEOUT)
    if result.path:
        assert not shapely.LineString(result.path.poses(0.005)[:, :2]).intersects(wall)


@pytest.mark.parametrize("map", [walled(), PolygonMap(shapely.box(-10, -10, 10, 10) - shapely.box(-0.5, -11, 0.5, 11))])
def test_proves_that_there_is_no_way(planner, map):
    result = plan(Problem(map, VEHICLE, START, GOAL), settings(planner))
    assert_refused(result, Status.NO_VALID_PATH, "No path exists: walls separate start and goal")
    assert result.location is None
    assert result.samples == 0
    assert len(result.tree) == 1


@needs_compiled
def test_a_tolerance_may_reach_around_the_wall(planner):
    """The goal's disc reaches through the wall to the start's side, so nothing is proved and a path is found."""
    goal = (1.0, -8.0, 0.0)
    assert plan(Problem(walled(), VEHICLE, START, goal), settings(planner)).status == Status.NO_VALID_PATH
    problem = Problem(walled(), VEHICLE, START, goal, goal_tolerance_xy=3.0, any_goal_heading=True)
    result = plan(problem, settings(planner))
    assert result.status == Status.NONE
    assert result.path.end[0] < -0.5


def test_same_seed_same_bytes(planner, maze):
    budget = settings(planner, samples=scaled(1000, least=100))
    one, other = (plan(maze, budget) for _ in range(2))
    assert one.status == other.status
    assert one.path == other.path
    assert one.samples == other.samples
    for name in ("poses", "parents", "costs", "words", "lengths"):
        assert getattr(one.tree, name).tobytes() == getattr(other.tree, name).tobytes()


@pytest.mark.parametrize("goal", [(1.0, 2.0, 2.9999999999999996), (math.nextafter(1.0, 0), 2.0, 3.0), (1.0, 2.0, 3.0 - math.tau)])
def test_poses_that_differ_by_rounding_are_the_same(planner, goal):
    result = plan(Problem(empty_map(), VEHICLE, (1.0, 2.0, 3.0), goal), settings(planner))
    assert (result.status, result.samples, result.length) == (Status.NONE, 0, 0.0)
    assert result.path.poses(0.1).tolist() == [[1.0, 2.0, 3.0]]


def test_a_boxed_in_start_is_told(planner):
    data = np.zeros((40, 40))
    data[:, 22] = 100
    problem = Problem(GridMap(data, 0.5), Vehicle(1.0, 0.3), (10.55, 10.0, 0.0), (3.0, 3.0, 0.0))
    result = plan(problem, settings(planner, samples=50, planning_time=3.0))
    assert result.status == Status.NO_VALID_PATH
    assert "every forward arc from the start hits an obstacle within 0.16 m, the longest at (11.00, 9.99)" in result.message
    assert "move or turn the start" in result.message
    assert result.location == pytest.approx((11.0, 9.99), abs=0.01)


@pytest.mark.parametrize("pose, by", [((-10.5, 0, 0), "0.50 m"), ((0, 10.01, 0), "0.01 m"), ((0, 10.0004, 0), "0.0004 m"),
                                      ((13.0, -14.0, 0), "5.00 m"), ((1e9, 0, 0), "1e+09 m")])
def test_outside_the_map(planner, pose, by):
    words = (f"({pose[0]:g}, {pose[1]:g}) is {by} outside the map", "x -10.00 to 10.00 m", "y -10.00 to 10.00 m", "check the")
    result = plan(Problem(empty_map(), VEHICLE, pose, GOAL), settings(planner))
    assert_refused(result, Status.START_OUTSIDE_MAP, "Start", *words)
    result = plan(Problem(empty_map(), VEHICLE, START, pose), settings(planner))
    assert_refused(result, Status.GOAL_OUTSIDE_MAP, "Goal", *words)
    assert result.location == pytest.approx(np.clip(pose[:2], -10, 10))


@pytest.mark.parametrize("pose, words", [
    ((0, 0, 0), ("clearance 0.00 m", "(0.00, 0.00) lies in an obstacle; move it")),
    ((0.6, 0, 0), ("clearance 0.10 m", "nearest obstacle at (0.50, 0.00); move it", "robot_radius")),
    ((9.9, 0, 0), ("clearance 0.10 m", "nearest obstacle is the map's edge at (10.00, 0.00)", "robot_radius"))])
def test_occupied(planner, pose, words):
    words = ("is occupied: ", ", needed 0.20 m", *words)
    result = plan(Problem(walled(), VEHICLE, pose, GOAL), settings(planner))
    assert_refused(result, Status.START_OCCUPIED, "Start", *words)
    result = plan(Problem(walled(), VEHICLE, START, pose), settings(planner))
    assert_refused(result, Status.GOAL_OCCUPIED, "Goal", *words)
    assert "unknown" not in result.message


def test_unknown_space_is_named_as_the_cause(planner):
    problem = Problem(walled(-1), VEHICLE, (0.0, 0.0, 0.0), GOAL)
    assert_refused(plan(problem, settings(planner)), Status.START_OCCUPIED, "lies in unknown space", "allow_unknown")
    allowed = Problem(walled(-1), VEHICLE, (0.0, 0.0, 0.0), GOAL, allow_unknown=True)
    assert plan(allowed, settings(planner)).status == Status.NONE


@pytest.mark.slow
@needs_compiled
@pytest.mark.parametrize("goal", [(10.1, 3.0, 0.5), (0.0, -3.0, 0.5), (0.3, 3.0, -2.0)])
@pytest.mark.parametrize("any_heading", [False, True])
def test_the_tolerance_excuses_a_goal_outside_or_in_an_obstacle(planner, goal, any_heading):
    data = np.zeros((80, 80))
    data[:60, 39:41] = 100
    problem = Problem(GridMap(data, 0.25, (-10.0, -10.0, 0.0)), VEHICLE, START, goal, goal_tolerance_xy=0.6,
                      any_goal_heading=any_heading)
    result = plan(problem, settings(planner, samples=scaled(6000, least=3000)))
    assert result.status == Status.NONE, result.message
    assert audit_path(result.path, problem).ok
    assert math.dist(result.path.end[:2], goal[:2]) <= 0.6
    assert result.min_clearance >= 0.2
    exact = plan(Problem(problem.map, VEHICLE, START, goal), settings(planner))
    assert exact.status == (Status.GOAL_OUTSIDE_MAP if goal[0] > 10 else Status.GOAL_OCCUPIED)


def test_start_equal_to_goal(planner):
    result = plan(Problem(empty_map(), VEHICLE, START, (*START[:2], START[2] + math.tau)), settings(planner))
    assert result.status == Status.NONE
    assert (result.length, result.gap, result.samples, result.audit.ok) == (0, 0, 0, True)
    assert result.path.poses(0.05).tolist() == [list(START)]


def test_start_beside_the_goal_by_rounding(planner):
    """Between two such poses the shortest curve may be a full circle, which no bound of a path of length 0 may be."""
    result = plan(Problem(empty_map(), VEHICLE, START, (START[0] - 1e-11, START[1] + 1e-11, START[2] - 1e-11)), settings(planner))
    result.check()
    assert (result.length, result.lower_bound, result.gap) == (0, 0, 0)


def test_start_within_the_tolerance(planner):
    near = (START[0] + 0.3, START[1], START[2] + 0.2)
    tolerances = {"goal_tolerance_xy": 0.31, "goal_tolerance_yaw": 0.21}
    result = plan(Problem(empty_map(), VEHICLE, START, near, **tolerances), settings(planner))
    assert result.length == 0
    assert "it ends 0.300 m and 0.200 rad from the goal" in result.message


@pytest.mark.parametrize("tolerance", [
    {"goal_tolerance_xy": 0.5}, {"goal_tolerance_yaw": 0.3}, {"goal_tolerance_xy": 0.5, "goal_tolerance_yaw": 0.3},
    {"any_goal_heading": True}, {"goal_tolerance_xy": 0.5, "any_goal_heading": True}])
def test_goal_with_tolerance(planner, tolerance):
    problem = Problem(empty_map(), VEHICLE, START, GOAL, **tolerance)
    result = plan(problem, settings(planner))
    assert result.status == Status.NONE
    off = math.dist(result.path.end[:2], GOAL[:2])
    turned = abs(math.remainder(result.path.end[2] - GOAL[2], math.tau))
    assert off <= problem.goal_tolerance_xy
    assert turned <= problem.yaw_tolerance
    heading = f", with the heading {result.path.end[2]:.3f} rad" if problem.any_goal_heading else ""
    figures = f"{off:.3f} m from the goal{heading}" if heading else f"{off:.3f} m and {turned:.3f} rad from the goal"
    assert f"it ends {figures}" in result.message
    assert result.length >= result.lower_bound
    straight = math.dist(START[:2], GOAL[:2]) - problem.goal_tolerance_xy  # which the proof beside the search may raise
    assert result.lower_bound >= straight - 1e-6


def test_a_fresh_seed_is_reported_and_repeats(planner):
    problem = Problem(empty_map(), VEHICLE, START, GOAL)
    one, other = (plan(problem, settings(planner, seed=-1, samples=100)) for _ in range(2))
    assert one.settings.seed >= 0
    assert one.settings.seed != other.settings.seed
    again = plan(problem, settings(planner, seed=one.settings.seed, samples=100))
    assert again.tree.poses.tobytes() == one.tree.poses.tobytes()


def test_a_vehicle_with_a_wheelbase(planner):
    vehicle = Vehicle(wheelbase=0.5, max_steering_angle=0.4, robot_radius=0.2)
    result = plan(Problem(empty_map(), vehicle, START, GOAL), settings(planner))
    assert result.status == Status.NONE
    assert {curve.radius for curve in result.path.curves} == {0.5 / math.tan(0.4)}
    assert result.max_curvature == pytest.approx(math.tan(0.4) / 0.5)


def test_a_path_that_fails_the_audit_is_a_defect_and_not_a_path(planner, monkeypatch):
    from dubins_rrt_ros.planning import planner as module

    def strict(path, problem, obstacles, check_time=None):
        return audit_path(path, Problem(problem.map, Vehicle(0.5, 5.0), problem.start, problem.goal))

    monkeypatch.setattr(module, "audit_path", strict)
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings(planner))
    assert result.status == Status.UNKNOWN
    assert result.path is None
    assert "the clearance is" in str(result.audit)
    assert "defect in the planner" in result.message
    assert str(result.audit) in result.message


def test_the_numbers_of_the_statuses():
    assert {status.name: int(status) for status in Status} == {
        "NONE": 0, "UNKNOWN": 200, "TF_ERROR": 202, "START_OUTSIDE_MAP": 203, "GOAL_OUTSIDE_MAP": 204,
        "START_OCCUPIED": 205, "GOAL_OCCUPIED": 206, "TIMEOUT": 207,
        "NO_VALID_PATH": 208, "NO_MAP": 210, "NO_START": 211, "INVALID_POSE": 212,
        "CANCELLED": 213}


def test_a_goal_that_is_never_drawn_is_told(planner):
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings(planner, goal_bias=0.0, samples=50, informed=False))
    assert result.status is Status.TIMEOUT
    assert "goal_bias 0" in result.message


def test_hybrid_a_star_finds_a_goal_that_is_never_drawn(planner):
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings(planner, goal_bias=0.0, samples=50))
    assert result.status is Status.NONE
    assert result.samples == (0 if planner == "rrt" else 50)
    assert result.length == pytest.approx(result.lower_bound, abs=1e-6)


def test_a_problem_alone_is_planned_with_the_default_settings():
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL))
    assert result.solved
    assert replace(result.settings, seed=-1) == Settings()


def test_a_plan_is_shown_in_one_line():
    solved, failed = (plan(Problem(empty_map(), VEHICLE, START, goal), settings("rrt")) for goal in (GOAL, (99.0, 0.0, 0.0)))
    assert repr(solved) == f"Plan(NONE: {solved.message})"
    assert repr(failed).startswith("Plan(GOAL_OUTSIDE_MAP: Goal (99, 0) is ") and not failed.solved


@pytest.mark.parametrize(("resolution", "radius", "spacing", "expected"), [
    (0.05, 1.0, 0.0, 0.05), (1.0, 2.0, 0.0, 0.2), (0.05, 0.05, 0.0, 0.01), (0.05, 1.0, 0.3, 0.3)])
def test_the_poses_of_a_plan_are_a_cell_apart_or_a_tenth_of_the_turning_radius_unless_a_spacing_is_given(
        resolution, radius, spacing, expected):
    grid = GridMap(np.zeros((200, 200), np.int8), resolution)
    found = plan(Problem(grid, Vehicle(turning_radius=radius, robot_radius=0.0), (1.0, 1.0, 0.0), (4.0, 2.0, 0.3)),
                 Settings(samples=10, seed=1, planning_time=60.0, path_spacing=spacing))
    assert found.path_spacing == pytest.approx(expected)
    steps = np.linalg.norm(np.diff(found.poses()[:, :2], axis=0), axis=1)
    assert 0.5 * expected < steps.max() <= expected + 1e-9


@pytest.mark.parametrize(("robot_radius", "expected"), [(0.2, 0.05), (0.01, 0.01), (2.0, 0.1)])
def test_on_polygons_the_poses_are_a_quarter_of_the_inscribed_radius_apart(robot_radius, expected):
    free = PolygonMap.of([(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)], [])
    found = plan(Problem(free, Vehicle(robot_radius=robot_radius), (4.0, 4.0, 0.0), (9.0, 6.0, 0.3)),
                 Settings(samples=10, seed=1, planning_time=60.0))
    assert found.path_spacing == pytest.approx(expected)
