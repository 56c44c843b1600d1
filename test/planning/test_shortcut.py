"""Shortcuts: never a longer path, with the same ends, as free as the one that they shorten, and the best over the stations."""

import math
from itertools import pairwise

import naive
import numpy as np
import pytest
from cases import SCALE, empty_map, random_maps, random_problem, scaled

from dubins_rrt_ros.planning import ClearanceField, GridMap, Path, Problem, Settings, Vehicle, audit, dubins, rrt, shortcut
from dubins_rrt_ros.planning._kernels.shortcut import shortest_chain
from dubins_rrt_ros.planning.dubins import WORDS, DubinsCurve
from dubins_rrt_ros.planning.rrt import Search
from dubins_rrt_ros.planning.shortcut import shortened

COUNT = 60 if SCALE == 1 else 9


def field_of(problem):
    return ClearanceField.of(problem.map, problem.allow_unknown)


def tree_paths(count, **options):
    """Random problems with the naive clearance of their maps and paths as RRT finds them, which are far from short."""
    rng = np.random.default_rng(5)
    for seed in range(count):
        problem, clearance = random_problem(rng, random_maps(30)[seed % 30])
        settings = Settings(**{"planner": "rrt", "samples": scaled(600, least=200), "goal_bias": 0.2, "seed": seed,
                               "shortcut": False, **options})
        search = Search(problem, settings, field_of(problem))
        if clearance(np.array([problem.start[:2]]))[0] < problem.vehicle.robot_radius:
            continue
        while not search.done:
            search.grow()
        if search.path is not None:
            yield problem, clearance, search.path


def check(path, problem, clearance):
    """A drive along the path in small steps: its joints, its turns, its clearance, and both ends."""
    at = np.array(path.start)
    for curve in path.curves:
        assert curve.radius == problem.vehicle.turning_radius
        assert min(curve.lengths) >= 0
        assert_close(at, curve.start)
        points = naive.points_along(curve.start, curve.word, curve.lengths, curve.radius, 0.02)
        assert clearance(points).min() >= problem.vehicle.robot_radius - 1e-9
        at = naive.drive(curve.start, curve.word, curve.lengths, curve.radius)
    assert_close(at, path.end)
    assert path.curves[0].start == path.start


def assert_close(pose, other):
    assert math.dist(pose[:2], other[:2]) <= 1e-9 * (1 + math.hypot(*other[:2]))
    assert abs(math.remainder(pose[2] - other[2], math.tau)) <= 1e-9


@pytest.mark.parametrize("options", [{}, {"step_size": 1.5}, {"planner": "rrt_star"}])
def test_a_shortened_path_is_as_free_and_no_longer(options):
    gains = []
    for problem, clearance, path in tree_paths(COUNT, **options):
        shorter = shortened(path, field_of(problem), problem.vehicle.robot_radius)
        assert shorter.length <= path.length
        assert (shorter.start, shorter.end) == (path.start, path.end)
        assert tuple(shorter.poses(0.1)[0]) == path.start
        assert tuple(shorter.poses(0.1)[-1]) == path.end
        check(shorter, problem, clearance)
        assert audit(shorter, problem).ok
        assert shorter.length >= dubins.shortest(path.start, path.end, path.curves[0].radius).length - 1e-9
        gains.append(1 - shorter.length / path.length)
    assert len(gains) > COUNT / 6
    assert np.mean(gains) > 0.02


def test_each_round_shortens_and_the_last_gains_little(monkeypatch):
    shifts = shortcut.SHIFTS
    for problem, _, path in tree_paths(COUNT // 3):
        lengths = [path.length]
        for rounds in range(1, len(shifts) + 1):
            monkeypatch.setattr(shortcut, "SHIFTS", shifts[:rounds])
            lengths.append(shortened(path, field_of(problem), problem.vehicle.robot_radius).length)
        gains = -np.diff(lengths)
        assert (gains >= 0).all()
        assert (gains[1:][gains[:-1] < shortcut.LEAST_GAIN] == 0).all()


def test_the_chain_is_the_shortest_over_the_stations():
    """Against brute force, and its lengths are those of the curves that it names."""
    for problem, _, path in tree_paths(COUNT // 3):
        stations, field = shortcut._stations_along(path, 0.5), field_of(problem)
        poses, at, radius = stations.poses, stations.at, problem.vehicle.turning_radius
        costs, before = np.empty(len(at)), np.empty(len(at), np.int32)
        words, lengths = np.empty(len(at), np.int8), np.empty((len(at), 3))
        shortest_chain(poses, at, radius, field.kernel, problem.vehicle.robot_radius, costs, before, words, lengths)

        def curve(begin, end, poses=poses, radius=radius):
            return dubins.shortest(tuple(poses[begin].tolist()), tuple(poses[end].tolist()), radius)

        def length_between(begin, end, field=field, problem=problem, at=at, curve=curve):
            direct = curve(begin, end)
            free = field.curve_is_free(direct, problem.vehicle.robot_radius)
            return min(direct.length if free else math.inf, at[end] - at[begin] if end == begin + 1 else math.inf)

        np.testing.assert_allclose(costs, naive.shortest_chain(len(at), length_between), rtol=1e-9, atol=1e-7)
        assert (costs <= at + 1e-9).all()
        assert before[0] == -1
        for end in range(1, len(at)):
            begin = before[end]
            if words[end] < 0:
                assert begin == end - 1
                step = at[end] - at[begin]
            else:
                direct = curve(begin, end)
                assert (WORDS[words[end]], tuple(lengths[end])) == (direct.word, direct.lengths)
                step = direct.length
            assert costs[end] == pytest.approx(costs[begin] + step, abs=1e-12)


def test_stations_lie_on_the_path():
    for _, _, path in tree_paths(COUNT // 3):
        for shift in shortcut.SHIFTS:
            stations = shortcut._stations_along(path, shift)
            assert tuple(stations.poses[0]) == path.start
            assert tuple(stations.poses[-1]) == path.end
            assert (np.diff(stations.at) >= 0).all()
            assert np.diff(stations.at).max() <= path.length / shortcut.EVENLY + 1e-9
            assert stations.at[-1] == pytest.approx(path.length)
            for curve, offset, pose in zip(stations.curves, stations.offsets, stations.poses, strict=True):
                assert_close(path.curves[curve].pose_at(offset), pose)


def open_field(start, goal):
    problem = Problem(empty_map(), Vehicle(0.5, 0.2), start, goal)
    return problem, ClearanceField.of(problem.map)


def path_over(poses, radius=0.5):
    curves = tuple(dubins.shortest(*pair, radius) for pair in pairwise(poses))
    return Path(poses[0], poses[-1], curves)


def test_a_detour_on_an_open_field_becomes_the_dubins_curve():
    """With ends that are kept as they are, be their headings given a turn too many."""
    start, goal = (-8.0, -8.0, 7.0), (8.0, 8.0, -7.0)
    _, field = open_field(start, goal)
    path = path_over([start, (-3.0, 6.0, 2.0), (5.0, -6.0, -1.0), (6.0, 5.0, 3.0), goal])
    direct = dubins.shortest(start, goal, 0.5)
    assert path.length > 1.5 * direct.length
    assert shortened(path, field, 0.2) == Path(start, goal, (direct,))


def test_the_shortest_path_stays():
    start, goal = (-8.0, -8.0, 0.5), (8.0, 8.0, 2.0)
    _, field = open_field(start, goal)
    path = Path(start, goal, (dubins.shortest(start, goal, 0.5),))
    assert shortened(path, field, 0.2) == path


def test_no_shortcut_leads_through_a_thin_wall():
    data = np.zeros((200, 200))
    data[:150, 100] = 100
    problem = Problem(GridMap(data, 0.1, (-10.0, -10.0, 0.0)), Vehicle(0.5, 0.2), (-3.0, 0.0, 1.5), (3.0, 0.0, -1.5))
    path = path_over([problem.start, (-1.0, 7.0, 0.5), (1.5, 7.0, -0.5), problem.goal])
    field = ClearanceField.of(problem.map)
    assert all(field.curve_is_free(curve, 0.2) for curve in path.curves)
    shorter = shortened(path, field, 0.2)
    assert shorter.length < path.length - 0.3
    assert audit(shorter, problem).ok
    assert shorter.poses(0.01)[:, 1].max() > 5.2


def test_a_path_of_hundreds_of_curves_has_as_few_stations():
    rng = np.random.default_rng(1)
    x = np.linspace(-9, 9, 601)
    poses = [(float(a), float(b), float(c)) for a, b, c in zip(x, np.sin(x), np.arctan(np.cos(x)), strict=True)]
    problem, field = open_field(poses[0], poses[-1])
    path = path_over(poses)
    assert len(path.curves) == 600
    stations = shortcut._stations_along(path, rng.random())
    assert len(stations.at) <= shortcut.EVENLY + shortcut.MOST_JOINTS + 1
    shorter = shortened(path, field, 0.2)
    direct = dubins.shortest(problem.start, problem.goal, 0.5)
    assert shorter.length == pytest.approx(direct.length, rel=1e-6)


def test_pieces_of_a_curve_make_up_the_curve():
    curve = DubinsCurve((1.0, 2.0, 3.0), 0.5, "LSR", (0.7, 2.0, 0.4))
    cuts = [0.0, 0.3, 0.7, 1.5, 2.9, curve.length]
    at = curve.start
    for low, high in pairwise(cuts):
        piece = shortcut._piece(curve, curve.pose_at(low), low, high)
        assert piece.length == pytest.approx(high - low)
        assert_close(at, piece.start)
        at = piece.end
    assert_close(at, curve.end)


@pytest.mark.parametrize("shortcuts", [False, True])
def test_more_whole_blocks_never_give_a_longer_path(shortcuts):
    rng = np.random.default_rng(7)
    for seed in range(scaled(12)):
        problem, _ = random_problem(rng, random_maps(30)[seed])
        lengths = [math.inf]
        for blocks in range(1, 5 if SCALE == 1 else 2):
            search = Search(problem, Settings(samples=blocks * rrt.BLOCK, seed=seed, shortcut=shortcuts), field_of(problem))
            while not search.done:
                search.grow()
                search.shorten(search.done)
            lengths.append(math.inf if search.path is None else search.path.length)
            assert search.length in (None, lengths[-1])
            assert search.best < 0 or search.length <= search.tree.costs[search.best]
        assert (np.array(lengths[1:]) <= lengths[:-1]).all()
