"""Paths as arrays: cut into pieces, and asked for poses along them."""

import math
import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support import naive
from support.cases import arrays_of, path_over, random_pose

from dubins_rrt_ros.planning import Path, PathError
from dubins_rrt_ros.planning.curves.dubins import WORDS, shortest


def random_path(rng, count=6):
    radius = rng.uniform(0.3, 2.0)
    return path_over([random_pose(rng) for _ in range(count)], radius)


def assert_joined(path):
    """Each curve ends where the next begins, by the naive way of driving it."""
    for i in range(1, len(path.words)):
        end = naive.drive(path.waypoints[i - 1], WORDS[path.words[i]], path.lengths[i], path.radius)
        np.testing.assert_allclose(end[:2], path.waypoints[i, :2], atol=1e-9)
        assert abs(math.remainder(end[2] - path.waypoints[i, 2], math.tau)) <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("longest", [0.01, 0.3, 1.0, 2.5, 1e6])
def test_pieces_are_no_longer_than_asked(longest):
    rng = np.random.default_rng(1)
    for _ in range(3 if longest < 0.1 else 20):
        path = random_path(rng)
        pieces = path.cut(longest)
        lengths = pieces.lengths[1:].sum(axis=1)
        assert lengths.max() <= longest * (1 + 1e-9)
        assert (pieces.lengths >= 0).all()
        assert len(lengths) == np.ceil(path.lengths[1:].sum(axis=1) / longest).clip(min=1).sum()
        assert pieces.length == pytest.approx(path.length, rel=1e-12)
        assert_joined(pieces)


@pytest.mark.parametrize("longest", [0.3, 1.0])
def test_cutting_keeps_the_poses_and_the_arcs(longest):
    """All poses of the path, its ends exactly, and of each curve the sums of its arcs."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        path = random_path(rng)
        pieces = path.cut(longest)
        kept = [np.flatnonzero((pieces.waypoints == pose).all(axis=1))[0] for pose in path.waypoints]
        assert kept[0] == 0
        assert kept[-1] == len(pieces.waypoints) - 1
        for i in range(1, len(kept)):
            between = slice(kept[i - 1] + 1, kept[i] + 1)
            np.testing.assert_allclose(pieces.lengths[between].sum(axis=0), path.lengths[i], atol=1e-12)
            assert (pieces.words[between] == path.words[i]).all()


def test_cut_without_a_limit_or_a_curve_is_the_same():
    path = random_path(np.random.default_rng(3))
    alone = Path.of_pose(path.start, path.radius)
    for same, longest in ((path, 0), (alone, 0.1)):
        assert arrays_of(same.cut(longest)) == arrays_of(same)


@pytest.mark.parametrize("longest", [0.3, 1.0, 100.0])
def test_a_path_that_was_cut_is_not_changed_by_cutting_it_again(longest):
    rng = np.random.default_rng(5)
    for _ in range(20):
        path = random_path(rng)
        pieces = path.cut(longest)
        assert arrays_of(pieces.cut(longest)) == arrays_of(pieces)
    assert longest < 100 or arrays_of(pieces) == arrays_of(path)


def test_a_curve_of_a_whole_number_of_steps_has_as_many_pieces():
    for steps in (1, 3, 7, 30):
        for step in (0.1, 0.7, 1.0):
            path = path_over([(0.0, 0.0, 0.0), (steps * step, 0.0, 0.0)], 1.0)
            assert len(path.cut(step).words) == steps + 1


def test_cut_curves_of_length_zero():
    pose = (1.0, 2.0, 3.0)
    path = path_over([pose, pose, (4.0, 2.0, 1.0), (4.0, 2.0, 1.0)], 0.5)
    pieces = path.cut(0.4)
    assert np.isfinite(pieces.waypoints).all()
    assert pieces.length == pytest.approx(path.length)
    assert_joined(pieces)


def test_poses_along_the_path_are_those_of_its_curves():
    """In any order; 0 and the length give the ends, and headings are in [-pi, pi]."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        path = random_path(rng)
        shares = rng.permutation(np.concatenate([rng.random(50), [0, 1]]))
        for s, pose in zip(shares * path.length, path.at(shares), strict=True):
            curve = next(i for i, end in enumerate(np.cumsum(path.lengths.sum(axis=1))[1:]) if s <= end + 1e-9)
            expected = path.curves[curve].pose_at(min(s - path.lengths[:curve + 1].sum(), path.curves[curve].length))
            np.testing.assert_allclose(pose[:2], expected[:2], atol=1e-9)
            assert abs(math.remainder(pose[2] - expected[2], math.tau)) <= 1e-9
            assert abs(pose[2]) <= math.pi
    np.testing.assert_allclose(path.at(np.array([0, 1]))[:, :2], path.waypoints[[0, -1], :2], atol=1e-9)


def test_what_is_left_of_a_path_is_driven_as_before():
    path = random_path(np.random.default_rng(6))
    ends = np.cumsum(path.lengths[1:].sum(axis=1))
    for arc_length in (*np.linspace(0.0, path.length, 50), *ends.tolist()):
        left = path.after(arc_length)
        left.check()
        assert left.end == path.end
        assert left.length == pytest.approx(path.length - arc_length, abs=1e-9)
        assert abs(left.start[2]) <= math.pi
        shares = np.linspace(0.0, 1.0, 30)
        if left.curves:
            expected = path.at((arc_length + shares * left.length) / path.length)
            assert np.abs(left.at(shares)[:, :2] - expected[:, :2]).max() < 1e-9
            assert np.abs(np.sin((left.at(shares)[:, 2] - expected[:, 2]) / 2)).max() < 1e-9


def test_no_poses_are_asked_for():
    path = random_path(np.random.default_rng(5))
    assert path.at(np.empty(0)).shape == (0, 3)


def test_a_path_of_curves_has_just_these():
    rng = np.random.default_rng(6)
    poses = [random_pose(rng) for _ in range(5)]
    curves = tuple(shortest(*pair, 0.7) for pair in pairwise(poses))
    path = Path.of_curves(poses[0], poses[-1], curves)
    assert (path.start, path.end, path.curves) == (poses[0], poses[-1], curves)
    length = 0.0
    for curve in curves:
        length += curve.length
    assert path.length == length


def test_paths_are_equal_where_their_curves_are():
    rng = np.random.default_rng(7)
    path = random_path(rng)
    same = Path.of_curves(path.start, path.end, path.curves)
    assert same == path
    assert hash(same) == hash(path)
    assert pickle.loads(pickle.dumps(path)) == path
    others = (path.cut(0.1), replace(path, radius=2 * path.radius), replace(path, lengths=path.lengths + 1e-9), path.curves)
    assert all(other != path for other in others)


def test_curves_that_are_no_path_are_refused():
    path = random_path(np.random.default_rng(8))
    first, *others = path.curves
    for curves, start, message in ((others, path.start, "the first curve starts at"), ((), path.start, "no curve leads from"),
                                   ((first, replace(others[0], radius=3.0)), path.start, "another one of 3.0 m")):
        with pytest.raises(PathError, match=message):
            Path.of_curves(start, path.end, curves)
