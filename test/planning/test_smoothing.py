"""Smoothing: never a longer path, with the same ends, as free as the one before, and the shortest where that is known."""

import math

import numpy as np
import pytest
from support import naive
from support.cases import (
    SCALE,
    arrays_of,
    empty_map,
    field_of,
    finish,
    path_over,
    random_maps,
    random_problem,
    scaled,
    search_on,
)

from dubins_rrt_ros.planning import ClearanceField, GridMap, Problem, Settings, Vehicle, audit_path
from dubins_rrt_ros.planning.curves import dubins
from dubins_rrt_ros.planning.search.smoothing import smooth

COUNT = 60 if SCALE == 1 else 6
VEHICLE = Vehicle(0.5, 0.2)


def rrt_paths(count, **options):
    """Random problems with the naive clearance of their maps and paths as RRT finds them, which are far from short."""
    rng = np.random.default_rng(5)
    for seed in range(count):
        problem, clearance = random_problem(rng, random_maps(30)[seed % 30])
        settings = Settings(**{"planner": "rrt", "samples": scaled(600, least=200), "goal_bias": 0.2, "seed": seed,
                               "shortcut": False, "informed": False, "heading_sampling": "uniform", **options})
        if clearance(np.array([problem.start[:2]]))[0] < problem.vehicle.robot_radius:
            continue
        search = finish(search_on(problem, settings))
        if search.path is not None:
            yield problem, clearance, search.path


def smoothed(path, vehicle, field, times=1, seed=0):
    """The path smoothed that many times, and its length each time."""
    rng, lengths = np.random.default_rng(seed), [path.length]
    for time in range(times):
        path = smooth(path, vehicle, field, rng, first_round=time == 0)
        lengths.append(path.length)
    return path, lengths


def check(path, problem, clearance):
    """A drive along the path in small steps: its joints, its turns and its clearance."""
    at = path.waypoints[0]
    for curve in path.curves:
        assert min(curve.lengths) >= 0
        assert_close(at, curve.start)
        assert field_of(problem).curve_is_free(curve, problem.vehicle)
        points = naive.points_along(curve.start, curve.word, curve.lengths, curve.radius, 0.02)
        assert clearance(points).min() >= problem.vehicle.robot_radius - 1e-9
        at = naive.drive(curve.start, curve.word, curve.lengths, curve.radius)
    assert_close(at, path.end)
    assert audit_path(path, problem).ok


def assert_close(pose, other):
    assert math.dist(pose[:2], other[:2]) <= 1e-9 * (1 + math.hypot(*other[:2]))
    assert abs(math.remainder(pose[2] - other[2], math.tau)) <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"step_size": 1.5}, {"planner": "rrt_star", "samples": scaled(300, least=50)}])
def test_a_smoothed_path_is_as_free_and_never_longer(options):
    gains = []
    for problem, clearance, path in rrt_paths(COUNT, **options):
        shorter, lengths = smoothed(path, problem.vehicle, field_of(problem), times=4)
        assert (np.diff(lengths) <= 1e-9).all()
        assert shorter.waypoints[[0, -1]].tobytes() == path.waypoints[[0, -1]].tobytes()
        assert shorter.length == pytest.approx(shorter.lengths[1:].sum())
        check(shorter, problem, clearance)
        ends = (tuple(pose) for pose in path.waypoints[[0, -1]].tolist())
        assert shorter.length >= dubins.shortest(*ends, problem.vehicle.turning_radius).length - 1e-9
        gains.append(1 - shorter.length / path.length)
    assert len(gains) >= COUNT / 6
    assert np.mean(gains) > 0.02


def test_a_path_is_smoothed_by_the_rng_alone():
    for problem, _, path in rrt_paths(COUNT // 6):
        given = arrays_of(path)
        once, again, other = (smoothed(path, problem.vehicle, field_of(problem), seed=seed)[0] for seed in (1, 1, 2))
        assert arrays_of(once) == arrays_of(again)
        assert len(path.words) < 4 or once.waypoints.tobytes() != other.waypoints.tobytes()
        assert arrays_of(path) == given


def test_the_numbers_drawn_do_not_depend_on_the_path():
    """So that what is drawn after it is not changed by where the search stood."""
    field, short = ClearanceField(empty_map()), path_over([(-8.0, -8.0, 0.0), (8.0, 8.0, 0.0)], 0.5)
    states = []
    for path in (short, path_over([(-8.0, -8.0, 0.0), (0.0, 5.0, 3.0), (3.0, -5.0, 3.0), (8.0, 8.0, 0.0)], 0.5)):
        rng = np.random.default_rng(1)
        smooth(path, VEHICLE, field, rng, True)
        states.append(rng.bit_generator.state["state"])
    assert states[0] == states[1]


def test_a_loop_on_an_open_field_becomes_the_dubins_curve():
    """With ends that are kept as they are, be their headings given a turn too many."""
    start, goal = (-8.0, -8.0, 7.0), (8.0, 8.0, -7.0)
    path = path_over([start, (-3.0, 6.0, 2.0), (5.0, -6.0, -1.0), (6.0, 5.0, 3.0), goal], 0.5)
    direct = dubins.shortest(start, goal, 0.5).length
    assert path.length > 1.5 * direct
    for seed in range(scaled(20)):
        shorter, lengths = smoothed(path, VEHICLE, ClearanceField(empty_map()), times=6, seed=seed)
        assert shorter.length == pytest.approx(direct, abs=1e-6)
        assert lengths[-1] >= direct - 1e-9
        assert tuple(shorter.waypoints[0]) == start
        assert tuple(shorter.waypoints[-1]) == goal


def test_the_shortest_path_stays():
    path = path_over([(-8.0, -8.0, 0.5), (8.0, 8.0, 2.0)], 0.5)
    shorter, _ = smoothed(path, VEHICLE, ClearanceField(empty_map()), times=3)
    assert shorter == path


def walled():
    """A wall of one cell between start and goal, open at the top, and a path around it."""
    data = np.zeros((200, 200))
    data[:150, 100] = 100
    problem = Problem(GridMap(data, 0.1, (-10.0, -10.0, 0.0)), VEHICLE, (-3.0, 0.0, 1.5), (3.0, 0.0, -1.5))
    return problem, path_over([problem.start, (-1.0, 7.0, 0.5), (1.5, 7.0, -0.5), problem.goal], 0.5)


@pytest.mark.parametrize("seed", range(3))
def test_no_shortcut_leads_through_a_thin_wall(seed):
    """The path tightens around its end: what is left above the shortest way of a point around the disc is for the turns."""
    problem, path = walled()
    shorter, lengths = smoothed(path, VEHICLE, field_of(problem), times=scaled(8, least=2), seed=seed)
    assert audit_path(shorter, problem).ok
    assert shorter.poses(0.01)[:, 1].max() > 5.2
    around = 2 * math.hypot(2.85, 5.0)
    assert around < shorter.length < path.length - 0.3
    if SCALE == 1:
        assert shorter.length < 1.1 * around
        assert lengths[-2] - lengths[-1] < 0.01


def test_a_path_along_an_edge_of_the_clearance_is_kept():
    """It passes an obstacle at just the distance that is needed, where no detour is free."""
    data = np.zeros((40, 40))
    data[18:22, 18:22] = 100
    problem = Problem(GridMap(data, 0.5, (-10.0, -10.0, 0.0)), Vehicle(0.5, 0.5), (-8.0, 1.501, 0.0), (8.0, 1.501, 0.0))
    path = path_over([problem.start, (-2.0, 1.501, 0.0), (2.0, 1.501, 0.0), problem.goal], 0.5)
    shorter, _ = smoothed(path, problem.vehicle, field_of(problem))
    assert shorter.length == pytest.approx(16, abs=1e-9)
    assert len(shorter.words) == 2
    assert audit_path(shorter, problem).ok


@pytest.mark.parametrize("poses", [
    [(1.0, 2.0, 3.0)] * 2,
    [(1.0, 2.0, 3.0)] * 5,
    [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (4.0, 1.0, 1.0), (4.0, 1.0, 1.0), (-4.0, 1.0, 1.0), (-4.0, 1.0, 1.0)],
    [(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 0.0, 0.0)],
    [(0.0, 0.0, 0.0), (1e-12, 0.0, 0.0), (2e-12, 0.0, 0.0), (1e-9, 0.0, 0.0)],
    [(0.0, 0.0, 0.0), (0.0, 0.0, math.tau), (1.0, 0.0, -math.tau)]])
@pytest.mark.parametrize("seed", range(scaled(3, least=1)))
def test_poses_that_come_twice_and_curves_of_no_length(poses, seed):
    path = path_over(poses, 0.5)
    shorter, lengths = smoothed(path, VEHICLE, ClearanceField(empty_map()), times=3, seed=seed)
    assert (np.diff(lengths) <= 1e-9).all()
    assert shorter.waypoints[[0, -1]].tobytes() == path.waypoints[[0, -1]].tobytes()
    assert shorter.length == pytest.approx(dubins.shortest(poses[0], poses[-1], 0.5).length, abs=1e-6)
    at = path.waypoints[0]
    for curve in shorter.curves:
        assert_close(at, curve.start)
        at = naive.drive(curve.start, curve.word, curve.lengths, 0.5)
    assert_close(at, poses[-1])


def test_a_path_of_thousands_of_curves():
    x = np.linspace(-9, 9, scaled(4001, least=401))
    poses = [(float(a), float(b), float(c)) for a, b, c in zip(x, np.sin(x), np.arctan(np.cos(x)), strict=True)]
    path = path_over(poses, 0.5)
    assert len(path.words) == len(poses)
    shorter, _ = smoothed(path, VEHICLE, ClearanceField(empty_map()), times=4)
    direct = dubins.shortest(poses[0], poses[-1], 0.5).length
    assert direct - 1e-9 <= shorter.length < direct + 0.2 * (path.length - direct)
    at = path.waypoints[0]
    for curve in shorter.curves:
        assert_close(at, curve.start)
        at = naive.drive(curve.start, curve.word, curve.lengths, 0.5)
    assert_close(at, poses[-1])
