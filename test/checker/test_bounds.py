"""The checker's lower bounds of curves between boxes: never above the curves, near to them, and barely touched by rounding."""

import numpy as np
import pytest
from support.cases import scaled

from dubins_rrt_ros.checker import bounds
from dubins_rrt_ros.planning.curves.dubins import lengths

#: The turning radius of the tests [m], and the words of a curve: which way each of its arcs turns.
RADIUS = 0.7
STRAIGHT_WORDS, TURNING_WORDS = [(1, 0, 1), (1, 0, -1), (-1, 0, 1), (-1, 0, -1)], [(1, -1, 1), (-1, 1, -1)]
#: By so much boxes are larger than what they hold [m].
MARGIN = 1e-11
#: What docs/proof.md says that the formulas lose by rounding, as a share of the lengths in them.
LOST = 1e-14


def random_boxes(rng, count, size=1.0):
    """Boxes within some metres, of any direction, their sizes drawn from 0 to `size`."""
    angle, share = rng.uniform(-np.pi, np.pi, count), rng.random((3, count)) * (rng.random((3, count)) < 0.8)
    return np.column_stack([*rng.uniform(-3, 3, (2, count)), np.cos(angle), np.sin(angle), size * share[0], size * share[1],
                            rng.uniform(-4, 4, count), size * share[2], *np.zeros((3, count))])


def poses_in(boxes, rng):
    """A random pose of each box, often at its border."""
    share = np.clip(rng.uniform(-1.5, 1.5, (3, len(boxes))), -1, 1)
    along, across = share[0] * boxes[:, 4], share[1] * boxes[:, 5]
    return np.column_stack([boxes[:, 0] + along * boxes[:, 2] - across * boxes[:, 3],
                            boxes[:, 1] + along * boxes[:, 3] + across * boxes[:, 2], boxes[:, 6] + share[2] * boxes[:, 7]])


def driven(poses, word, amounts):
    """The poses after a word's arcs of some amounts: turns [rad], or the straight line [m]."""
    x, y, heading = poses.T
    for turn, amount in zip(word, amounts, strict=True):
        if turn:
            x = x + turn * RADIUS * (np.sin(heading + turn * amount) - np.sin(heading))
            y = y - turn * RADIUS * (np.cos(heading + turn * amount) - np.cos(heading))
            heading = heading + turn * amount
        else:
            x, y = x + amount * np.cos(heading), y + amount * np.sin(heading)
    return np.column_stack([x, y, heading])


def curves(rng, word, count, size):
    """Boxes, other boxes to which curves of a word lead from them, and their lengths; many have an arc of next to nothing."""
    share = rng.random((3, count)) ** rng.choice([1, 6, 100], (3, count))
    middle = 3 * share[1] if word[1] == 0 else np.pi * (1 + share[1])
    amounts = 2 * np.pi * share[0], middle, 2 * np.pi * share[2]
    a, b = (random_boxes(rng, count, size) for _ in range(2))
    off = driven(poses_in(a, rng), word, amounts) - poses_in(b, rng)
    b[:, (0, 1, 6)] += off + np.column_stack([np.zeros((count, 2)), 2 * np.pi * rng.integers(-2, 3, count)])
    for boxes in (a, b):
        boxes[:, 4:6] += MARGIN
    return a, b, RADIUS * (amounts[0] + amounts[2]) + middle * (RADIUS if word[1] else 1)


def bound_of(word, a, b):
    """The checker's bound of a word."""
    return (bounds._three_turns(a, b, word[0], RADIUS) if word[1]
            else bounds._turn_straight_turn(a, b, word[0], word[2], RADIUS))


@pytest.mark.parametrize("size", [0.0, 1e-3, 0.02, 0.3, 2.0])
@pytest.mark.parametrize("word", STRAIGHT_WORDS + TURNING_WORDS)
def test_no_bound_of_a_word_is_above_a_curve_of_it(word, size):
    a, b, length = curves(np.random.default_rng(1), word, scaled(20_000), size)
    assert (bound_of(word, a, b) <= length + 1e-9).all()


@pytest.mark.parametrize("word", STRAIGHT_WORDS + TURNING_WORDS)
@pytest.mark.parametrize(("size", "off"), [(0.0, 1e-5), (1e-3, 0.01), (0.02, 0.2)])
def test_the_bound_of_a_word_is_its_curve_between_poses_and_mostly_near_to_it_between_small_boxes(word, size, off):
    """Less often where the middle one of three turns is hardly more than half a turn, as its bound grows with a root there."""
    a, b, length = curves(np.random.default_rng(2), word, 5000, size)
    assert (bound_of(word, a, b) >= length - off).mean() > (0.5 if word[1] and size else 0.94)


@pytest.mark.parametrize("size", [0.02, 0.3, 2.0])
def test_no_bound_is_above_a_curve(size):
    rng = np.random.default_rng(1)
    a, b = (random_boxes(rng, 800, size) for _ in range(2))
    found = bounds._least_of_whole(a, b, 0.7)
    least = np.min([lengths(poses_in(a, rng), poses_in(b, rng), 0.7) for _ in range(scaled(200))], axis=0)
    assert (found <= least + 1e-9).all() and (found > 0.5 * least).mean() > 0.3


def test_between_poses_the_bound_is_the_curve_but_for_three_turns():
    rng = np.random.default_rng(2)
    a, b = (random_boxes(rng, 2000, 0.0) for _ in range(2))
    a[:1000, :2] *= 0.3  # near enough for three turns
    found, least = bounds._least_of_whole(a, b, 0.7), lengths(poses_in(a, rng), poses_in(b, rng), 0.7)
    assert (found <= least + 1e-9).all()
    assert (np.abs(found - least) < 1e-9).mean() > 0.85 and (found > 0.6 * least).all()


def test_halves_cover_the_whole():
    rng = np.random.default_rng(3)
    a, b = (random_boxes(rng, 300) for _ in range(2))
    halves = bounds._halves(a, b, 0.7)
    for whole, parts in zip((a, b), halves, strict=True):
        pose = poses_in(whole, rng)
        inside = [_holds(part, pose) for part in (parts[:300], parts[300:])]
        assert (inside[0] | inside[1]).all()
    sizes = [np.concatenate(boxes)[:, (4, 5, 7)].sum() for boxes in ((a, a, b, b), halves)]
    assert sizes[1] < sizes[0]


def _holds(boxes, poses):
    x, y = poses[:, 0] - boxes[:, 0], poses[:, 1] - boxes[:, 1]
    off = np.stack([x * boxes[:, 2] + y * boxes[:, 3], y * boxes[:, 2] - x * boxes[:, 3], poses[:, 2] - boxes[:, 6]])
    return (np.abs(off) <= boxes[:, (4, 5, 7)].T + 1e-12).all(axis=0)


def test_what_is_asked_for_is_found_by_halving_up_to_little():
    rng = np.random.default_rng(4)
    a, b = (random_boxes(rng, 60, 0.2) for _ in range(2))
    least = np.min([lengths(poses_in(a, rng), poses_in(b, rng), 0.7) for _ in range(scaled(500))], axis=0)
    found = bounds.least_length(a, b, 0.7, least)
    assert (found <= least).all() and (found > least - 0.05).mean() > 0.8
    assert (bounds.least_length(a, b, 0.7, 0.2 * least) == 0.2 * least).mean() > 0.9


def test_potentials_are_too_high_by_what_they_are_above_the_shortest_curve():
    ahead = np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 5.0, 0.0],
                      [9.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 6.0, 0.0]])
    boxes = np.repeat([[4.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 4.4, 8.0, 0.0]], 3, axis=0)
    boxes[:, 8] = 4.4, 4.6, 5.0
    assert bounds.too_high(ahead[:1], boxes, 1.0, 0.0) == pytest.approx([0, 0.1, 0.5], abs=2e-3)
    assert bounds.too_high(ahead, boxes, 1.0, 0.2) == pytest.approx([0.1, 0.3, 0.7], abs=2e-3)
    boxes[:, 9] = 9.4  # the costs rise by more than the curve is long at least
    assert bounds.too_high(ahead, boxes, 1.0, 0.0) == pytest.approx([0, 0, 0], abs=2e-3)
    boxes[:, 9] = np.nan
    assert bounds.too_high(ahead, boxes, 1.0, 0.0) == pytest.approx([0, 0.1, 0.5], abs=2e-3)


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="has no numbers that are longer than doubles")
@pytest.mark.parametrize("size", [0.0, 0.01, 1.0])
def test_rounding_loses_as_little_as_is_said(size, monkeypatch):
    """The same formulas in numbers of 64 bits in place of 53 give bounds that are lower by less than the stated share."""
    rng = np.random.default_rng(5)
    a, b = (random_boxes(rng, 3000, size) for _ in range(2))
    scale = 10.0  # metres, about the longest curve between them
    found = bounds._least_of_whole(a, b, 0.7)
    monkeypatch.setattr(bounds, "TAU", 8 * np.arctan(np.longdouble(1)))
    long = bounds._least_of_whole(a.astype(np.longdouble), b.astype(np.longdouble), np.longdouble(0.7))
    assert long.dtype == np.longdouble
    assert (np.abs(found - long) <= LOST * scale).all()
