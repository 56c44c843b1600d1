"""Paths as arrays: cut into pieces, and asked for poses along them."""

import math
from itertools import pairwise

import numpy as np
import pytest
from support import naive
from support.cases import chain_of, chain_over, path_of, random_pose

from dubins_rrt_ros.planning import Path
from dubins_rrt_ros.planning.curves.chain import Chain
from dubins_rrt_ros.planning.curves.dubins import WORDS, shortest


def random_chain(rng, count=6):
    radius = rng.uniform(0.3, 2.0)
    return chain_over([random_pose(rng) for _ in range(count)], radius), radius


def assert_joined(chain, radius):
    """Each curve ends where the next begins, by the naive way of driving it."""
    for i in range(1, len(chain.words)):
        end = naive.drive(chain.poses[i - 1], WORDS[chain.words[i]], chain.lengths[i], radius)
        np.testing.assert_allclose(end[:2], chain.poses[i, :2], atol=1e-9)
        assert abs(math.remainder(end[2] - chain.poses[i, 2], math.tau)) <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("longest", [0.01, 0.3, 1.0, 2.5, 1e6])
def test_pieces_are_no_longer_than_asked(longest):
    rng = np.random.default_rng(1)
    for _ in range(3 if longest < 0.1 else 20):
        chain, radius = random_chain(rng)
        pieces = chain.cut(radius, longest)
        lengths = pieces.lengths[1:].sum(axis=1)
        assert lengths.max() <= longest * (1 + 1e-9)
        assert (pieces.lengths >= 0).all()
        assert len(lengths) == np.ceil(chain.lengths[1:].sum(axis=1) / longest).clip(min=1).sum()
        assert pieces.length == pytest.approx(chain.length, rel=1e-12)
        assert_joined(pieces, radius)


@pytest.mark.parametrize("longest", [0.3, 1.0])
def test_cutting_keeps_the_poses_and_the_arcs(longest):
    """All poses of the path, its ends exactly, and of each curve the sums of its arcs."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        chain, radius = random_chain(rng)
        pieces = chain.cut(radius, longest)
        kept = [np.flatnonzero((pieces.poses == pose).all(axis=1))[0] for pose in chain.poses]
        assert kept[0] == 0
        assert kept[-1] == len(pieces.poses) - 1
        for i in range(1, len(kept)):
            between = slice(kept[i - 1] + 1, kept[i] + 1)
            np.testing.assert_allclose(pieces.lengths[between].sum(axis=0), chain.lengths[i], atol=1e-12)
            assert (pieces.words[between] == chain.words[i]).all()


def test_cut_without_a_limit_or_a_curve_is_the_same():
    chain, radius = random_chain(np.random.default_rng(3))
    alone = Chain(chain.poses[:1], chain.words[:1], chain.lengths[:1])
    for same, longest in ((chain, 0), (alone, 0.1)):
        cut = same.cut(radius, longest)
        assert [array.tobytes() for array in cut] == [array.tobytes() for array in same]


def test_a_curve_of_a_whole_number_of_steps_has_as_many_pieces():
    for steps in (1, 3, 7, 30):
        for step in (0.1, 0.7, 1.0):
            chain = chain_over([(0.0, 0.0, 0.0), (steps * step, 0.0, 0.0)], 1.0)
            assert len(chain.cut(1.0, step).words) == steps + 1


def test_cut_curves_of_length_zero():
    pose = (1.0, 2.0, 3.0)
    chain = chain_over([pose, pose, (4.0, 2.0, 1.0), (4.0, 2.0, 1.0)], 0.5)
    pieces = chain.cut(0.5, 0.4)
    assert np.isfinite(pieces.poses).all()
    assert pieces.length == pytest.approx(chain.length)
    assert_joined(pieces, 0.5)


def test_poses_along_the_path_are_those_of_its_curves():
    """In any order; 0 and the length give the ends, and headings are in [-pi, pi]."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        chain, radius = random_chain(rng)
        path = path_of(chain, radius)
        stations = rng.permutation(np.concatenate([rng.random(50) * chain.length, [0, chain.length]]))
        for s, pose in zip(stations, chain.at(stations, radius), strict=True):
            curve = next(i for i, end in enumerate(np.cumsum(chain.lengths.sum(axis=1))[1:]) if s <= end + 1e-9)
            expected = path.curves[curve].pose_at(min(s - chain.lengths[:curve + 1].sum(), path.curves[curve].length))
            np.testing.assert_allclose(pose[:2], expected[:2], atol=1e-9)
            assert abs(math.remainder(pose[2] - expected[2], math.tau)) <= 1e-9
            assert abs(pose[2]) <= math.pi
    np.testing.assert_allclose(chain.at(np.array([0, chain.length]), radius)[:, :2], chain.poses[[0, -1], :2], atol=1e-9)


def test_no_poses_are_asked_for():
    chain, radius = random_chain(np.random.default_rng(5))
    assert chain.at(np.empty(0), radius).shape == (0, 3)


def test_the_length_is_that_of_the_path():
    rng = np.random.default_rng(6)
    poses = [random_pose(rng) for _ in range(5)]
    path = Path(poses[0], poses[-1], tuple(shortest(*pair, 0.7) for pair in pairwise(poses)))
    assert chain_of(path).length == pytest.approx(path.length, rel=1e-14)
    assert path_of(chain_of(path), 0.7) == path
