"""Dubins curves: a golden table, a million random pairs against the naive twin, and properties."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from support import naive
from support.cases import interpreted, needs_compiled, scaled

from dubins_rrt_ros.planning import WORDS, DubinsCurve
from dubins_rrt_ros.planning.curves.dubins import candidates, lengths, shortest

PI, TAU, HALF = math.pi, math.tau, math.pi / 2
MIRROR = str.maketrans("LR", "RL")

#: start, goal, radius, word where only one will do, length
GOLDEN = [
    ((0, 0, 0), (5, 0, 0), 1, None, 5),  # straight on
    ((1, 1, HALF), (1, 4, HALF), 1, None, 3),
    ((0, 0, PI / 4), (3, 3, PI / 4), 1, None, 3 * math.sqrt(2)),
    ((-7, 2, PI), (-9, 2, -PI), 0.5, None, 2),
    ((0, 0, 0), (1e-9, 0, 0), 1, None, 1e-9),
    ((0, 0, 0), (1e4, 0, 0), 1, None, 1e4),
    ((0, 0, 0), (1, 1, HALF), 1, None, HALF),  # one turn
    ((0, 0, 0), (1, -1, -HALF), 1, None, HALF),
    ((0, 0, 0), (2, 2, HALF), 2, None, PI),
    ((0, 0, 0), (0, 2, PI), 1, None, PI),
    ((0, 0, 0), (0, -2, PI), 1, None, PI),
    ((0, 0, 0), (-1, 1, -HALF), 1, None, 3 * HALF),
    ((3, 4, HALF), (2, 5, PI), 1, None, HALF),
    ((0, 0, 0), (math.sin(0.1), 1 - math.cos(0.1), 0.1), 1, None, 0.1),
    ((0, 0, 0), (4, 1, HALF), 1, None, 3 + HALF),  # straight on and one turn
    ((0, 0, 0), (4, -1, -HALF), 1, None, 3 + HALF),
    ((0, 0, 0), (1, 4, HALF), 1, None, 3 + HALF),
    ((0, 0, 0), (0, 5, PI), 1, "LSL", PI + 3),  # two turns and a line
    ((0, 0, 0), (0, -5, PI), 1, "RSR", PI + 3),
    ((0, 0, 0), (2, 5, 0), 1, "LSR", PI + 3),
    ((0, 0, 0), (2, -5, 0), 1, "RSL", PI + 3),
    ((0, 0, 0), (1, 10, 0), 0.5, "LSR", HALF + 9),
    ((0, 0, 0), (-3, 0, 0), 1, None, TAU + 3),  # back: there is no reverse gear
    ((0, 0, 0), (-1e-9, 0, 0), 1, None, TAU + 1e-9),
    ((0, 0, 0), (0, 1e-9, 0), 1, None, TAU + 1e-9),
    ((0, 0, 0), (0, 0, 1e-9), 1, None, TAU),
    ((0, 0, 0), (0, 4, 0), 1, None, TAU),  # two half turns
    ((0, 0, 0), (2, 2, 0), 1, None, PI),  # two quarter turns
    ((0, 0, 0), (2, -2, 0), 1, None, PI),
    ((0, 0, 0), (0, 0, PI), 1, None, 7 / 3 * PI),  # on the spot: three circles that touch each other
    ((5, 5, HALF), (5, 5, -HALF), 3, None, 7 * PI),
    ((0, 0, 0), (0, 0, 0), 1, None, 0),  # equal poses
    ((12.5, -3, 2), (12.5, -3, 2), 0.3, None, 0),
    ((0, 0, 0), (0, 0, TAU), 1, None, 0),
    ((1, 2, PI), (1, 2, -PI), 1, None, 0),
    ((0, 0, 0), (1, 0, 4 * PI), 1, None, 1),
]

small = st.floats(-20, 20).map(lambda v: round(v, 6))
poses = st.tuples(small, small, st.floats(-4, 4).map(lambda v: round(v, 6)))
radii = st.floats(0.1, 10)


def assert_same_pose(one, other, tolerance=1e-9):
    assert math.dist(one[:2], other[:2]) <= tolerance
    assert abs(math.remainder(one[2] - other[2], TAU)) <= tolerance


def assert_valid(curve):
    assert curve.word in WORDS
    assert all(length >= 0 for length in curve.lengths)
    for turn, length in zip(curve.word, curve.lengths, strict=True):
        assert turn == "S" or length < TAU * curve.radius


@pytest.mark.parametrize("start, goal, radius, word, length", GOLDEN)
def test_golden(start, goal, radius, word, length):
    curve = shortest(start, goal, radius)
    assert curve.length == pytest.approx(length, rel=1e-12, abs=3e-9)
    assert word is None or curve.word == word
    assert (curve.length == 0) == (length == 0)
    assert_same_pose(naive.drive(start, curve.word, curve.lengths, radius), goal)
    assert_valid(curve)


@pytest.mark.parametrize("x, length", [(1, 7.33), (2, 2.02)])
def test_length_jumps_where_the_car_cannot_swerve_in_time(x, length):
    assert shortest((0, 0, 0), (x, 0.3, 0), 1).length == pytest.approx(length, abs=0.005)


@pytest.mark.slow
@needs_compiled
def test_many_pairs():
    rng = np.random.default_rng(1)
    for radius, half_side in [(0.1, 3), (0.1, 100), (0.5, 1), (1.0, 2), (1.0, 10), (1.0, 100), (2.0, 7),
                              (7.3, 20), (30.0, 100), (100.0, 100)]:
        check_pairs(rng, 20_000, radius, half_side)


def test_some_pairs():
    check_pairs(np.random.default_rng(2), 1000, 0.8, 5)


def check_pairs(rng, count, radius, half_side):
    """Every curve ends at its goal, and no word has a shorter one."""
    ends = rng.uniform(-1, 1, (2, count, 3)) * (half_side, half_side, PI)
    curves = [shortest(*pair, radius) for pair in zip(*ends.tolist(), strict=True)]
    word = np.array([WORDS.index(curve.word) for curve in curves])
    arcs = np.array([curve.lengths for curve in curves])
    for i, name in enumerate(WORDS):
        of_word = word == i
        driven = naive.drive(ends[0, of_word], name, arcs[of_word], radius)
        off = np.hypot(*(driven - ends[1, of_word])[:, :2].T)
        turned = np.abs(np.angle(np.exp(1j * (driven - ends[1, of_word])[:, 2])))
        assert (off <= 1e-9).all()
        assert (turned <= 1e-9).all()
    total = arcs.sum(axis=1)
    assert (total > 0).all()
    assert (arcs >= 0).all()
    assert (arcs[:, [0, 2]] < TAU * radius).all()
    of_twin = naive.words(*ends, radius).sum(axis=-1)
    assert (total <= np.nanmin(of_twin, axis=1) + 1e-9).all()
    np.testing.assert_allclose(total, of_twin[np.arange(count), word], rtol=0, atol=1e-6)
    np.testing.assert_allclose(lengths(*ends, radius), total, rtol=1e-15)


def test_candidates_are_the_six_words_of_the_twin():
    rng = np.random.default_rng(3)
    seen = set()
    pairs = rng.uniform(-4, 4, (2, scaled(5000), 3))
    for *pair, of_twin in zip(*pairs.tolist(), naive.words(*pairs, 0.9), strict=True):
        found = candidates(*pair, 0.9)
        for word, arcs in zip(naive.WORDS, of_twin, strict=True):
            assert (word in found) == (not math.isnan(arcs.sum()))
            if word in found:
                assert found[word].word == word
                assert np.abs(np.subtract(found[word].lengths, arcs)).max() < 1e-6
                assert_same_pose(naive.drive(pair[0], word, found[word].lengths, 0.9), pair[1])
        best = shortest(*pair, 0.9)
        assert best.length == min(curve.length for curve in found.values())
        seen.add(best.word)
    assert seen == set(WORDS)


def test_middle_turn_is_more_than_half_around():
    for curve in candidates((0, 0, 0), (0.5, 0.2, 2), 1).values():
        assert curve.word[1] == "S" or PI < curve.lengths[1] < TAU


@given(poses, poses, radii)
@example((0, 0, 0), (0, 0, 1e-6), 1)
@example((0, 0, 0), (0, 4, 0), 1)
@example((0, 0, 0), (2, 2, 0), 1)
def test_ends_are_exact_and_no_word_is_shorter(start, goal, radius):
    curve = shortest(start, goal, radius)
    assert_valid(curve)
    assert_same_pose(naive.drive(start, curve.word, curve.lengths, radius), goal)
    assert_same_pose(curve.end, goal)
    assert curve.length >= math.dist(start[:2], goal[:2]) - 1e-9
    for other in candidates(start, goal, radius).values():
        assert_same_pose(other.end, goal)
        assert other.length >= curve.length - 1e-9


@given(poses, poses, radii)
def test_length_is_0_for_equal_poses_only(start, goal, radius):
    assert shortest(start, start, radius).length == 0
    equal = start[:2] == goal[:2] and math.remainder(start[2] - goal[2], TAU) == 0
    assert (shortest(start, goal, radius).length == 0) == equal


@pytest.mark.parametrize("nudge", [(1e-9, 0, 0), (0, 1e-9, 0), (0, 0, 1e-9), (1e-9, -1e-9, 1e-9), (1e-12, 1e-12, 0)])
@pytest.mark.parametrize("start", [(0, 0, 0), (3, -2, 1), (99, 99, -3)])
def test_poses_a_nanometre_apart(start, nudge):
    goal = tuple(np.add(start, nudge))
    curve = shortest(start, goal, 1)
    assert curve.length > 0
    assert_same_pose(naive.drive(start, curve.word, curve.lengths, 1), goal)


@given(poses, poses, radii, poses)
def test_invariant_under_rigid_motion(start, goal, radius, motion):
    def move(pose):
        z = complex(*pose[:2]) * np.exp(1j * motion[2])
        return z.real + motion[0], z.imag + motion[1], pose[2] + motion[2]

    assume(is_continuous(start, goal, radius))
    moved = shortest(move(start), move(goal), radius)
    assert moved.length == pytest.approx(shortest(start, goal, radius).length, abs=1e-6)


@given(poses, poses, radii, st.floats(0.1, 10))
def test_scales_with_the_radius(start, goal, radius, scale):
    assume(is_continuous(start, goal, radius))
    scaled_start, scaled_goal = ((scale * x, scale * y, theta) for x, y, theta in (start, goal))
    length = shortest(start, goal, radius).length
    assert shortest(scaled_start, scaled_goal, scale * radius).length == pytest.approx(scale * length, abs=1e-5)


@given(poses, poses, radii)
def test_mirror_swaps_left_and_right(start, goal, radius):
    mirrored = candidates(*((x, -y, -theta) for x, y, theta in (start, goal)), radius)
    assume(is_continuous(start, goal, radius))
    for word, curve in candidates(start, goal, radius).items():
        np.testing.assert_allclose(mirrored[word.translate(MIRROR)].lengths, curve.lengths, rtol=0, atol=1e-5)


@given(poses, poses, radii)
def test_driven_backwards_the_words_are_reversed(start, goal, radius):
    """From the goal turned around to the start turned around: the same track, its turns in reverse and swapped."""
    assume(is_continuous(start, goal, radius))
    back = candidates(*((x, y, theta + PI) for x, y, theta in (goal, start)), radius)
    for word, curve in candidates(start, goal, radius).items():
        np.testing.assert_allclose(back[word[::-1].translate(MIRROR)].lengths, curve.lengths[::-1], rtol=0, atol=1e-5)


def is_continuous(start, goal, radius):
    """Whether no word's lengths jump within rounding of the poses: no turn is nearly none, no circles nearly touch."""
    base = naive.words(start, goal, radius)
    for nudge in np.vstack([np.eye(3), -np.eye(3)]) * 1e-7:
        moved = naive.words(start, np.add(goal, nudge * (radius, radius, 1)), radius)
        if not np.allclose(moved, base, rtol=0, atol=1e-4 * radius, equal_nan=True):
            return False
    return True


@given(poses, poses, radii, st.floats(0.01, 5))
def test_sampled_poses(start, goal, radius, spacing):
    curve = shortest(start, goal, radius)
    spacing = max(spacing, curve.length / 1000)
    found = curve.poses(spacing)
    assert tuple(found[0]) == start
    assert_same_pose(found[-1], goal)
    chords = np.hypot(*np.diff(found[:, :2], axis=0).T)
    assert (chords <= spacing + 1e-9).all()
    turned = np.abs(np.angle(np.exp(1j * np.diff(found[:, 2]))))
    assume(spacing < 3 * radius)
    assert (turned <= spacing / radius + 1e-9).all()
    # On an arc the chord is 2 r sin(turn / 2), and only there the heading changes.
    arcs = np.where(turned > 1e-9, turned * radius, chords)
    assert arcs.sum() == pytest.approx(curve.length, abs=1e-6)
    np.testing.assert_allclose(np.where(turned > 1e-9, 2 * radius * np.sin(turned / 2), chords), chords, atol=1e-6)
    for joint in np.cumsum(curve.lengths):
        x, y, _ = curve.pose_at(min(joint, curve.length))
        assert np.hypot(found[:, 0] - x, found[:, 1] - y).min() < 1e-9


def test_length_is_the_integral_along_the_curve():
    curve = DubinsCurve((1, 2, 3), 0.7, "LRL", (0.4, 3.1, 1.2))
    found = curve.poses(1e-4)
    assert np.hypot(*np.diff(found[:, :2], axis=0).T).sum() == pytest.approx(curve.length, abs=1e-7)


@given(poses, poses, radii, st.floats(0, 1))
def test_pose_at_an_arc_length(start, goal, radius, share):
    curve = shortest(start, goal, radius)
    s = share * curve.length
    left = np.clip(s - np.concatenate([[0], np.cumsum(curve.lengths)[:2]]), 0, curve.lengths)
    assert_same_pose(curve.pose_at(s), naive.drive(start, curve.word, left, radius))


@pytest.mark.parametrize("s", [-1e-9, 5.1, math.nan, math.inf])
def test_no_pose_outside_the_curve(s):
    with pytest.raises(ValueError, match="curve is 5.0 m long"):
        DubinsCurve((0.0, 0.0, 0.0), 1.0, "LSL", (0.0, 5.0, 0.0)).pose_at(s)


@pytest.mark.parametrize("spacing", [0, -1, math.nan])
def test_spacing_is_positive(spacing):
    with pytest.raises(ValueError, match="spacing .* must be positive"):
        shortest((0, 0, 0), (5, 0, 0), 1).poses(spacing)


def test_a_curve_of_length_0_is_one_pose():
    assert shortest((1, 2, 3), (1, 2, 3), 1).poses(0.1).tolist() == [[1, 2, 3]]


def test_lengths_broadcast():
    rng = np.random.default_rng(4)
    starts, goals = rng.uniform(-5, 5, (4, 1, 3)), rng.uniform(-5, 5, (7, 3))
    found = lengths(starts, goals, 1.3)
    assert found.shape == (4, 7)
    for i, j in np.ndindex(4, 7):
        assert found[i, j] == pytest.approx(shortest(tuple(starts[i, 0]), tuple(goals[j]), 1.3).length, rel=1e-15)
    assert lengths(starts[0, 0], goals[0], 1.3) == found[0, 0]
    assert lengths(np.empty((0, 3)), goals[0], 1.3).shape == (0,)


def test_lengths_of_read_only_arrays():
    ends = np.array([[1.0, 2, 3], [4, 5, 6]])
    ends.setflags(write=False)
    assert lengths(ends, ends[::-1].copy(), 1.0).shape == (2,)


@pytest.mark.parametrize("far", [10.0, 1e3, 1e5, 1e7])
def test_an_arc_is_no_full_circle_longer(far):
    """Where the circles of both ends coincide, the direction between their centres is nothing but rounding."""
    rng, count = np.random.default_rng(5), scaled(2000)
    for start, turn, length in zip(rng.uniform((-far, -far, -3), (far, far, 3), (count, 3)), rng.integers(0, 2, count),
                                   rng.uniform(1e-6, 6.0, count), strict=True):
        arc = DubinsCurve(tuple(start), 1.0, ("LSL", "RSR")[turn], (length, 0.0, 0.0))
        assert shortest(arc.start, arc.end, 1.0).length <= length + 1e-9 * max(1.0, far / 1e5)


@pytest.mark.parametrize("far", [10.0, 1e3, 1e5, 1e7])
def test_what_is_left_of_a_curve_is_no_longer_than_that(far):
    """As a step towards a goal leaves it: its pose is rounded where its coordinates are large."""
    rng, count = np.random.default_rng(6), scaled(1000)
    for start, goal, share in zip(rng.uniform((-far, -far, -3), (far, far, 3), (count, 3)),
                                  rng.uniform((-20, -20, -3), (20, 20, 3), (count, 3)), rng.uniform(0, 1, count), strict=True):
        goal[:2] += start[:2]
        whole = shortest(tuple(start), tuple(goal), 0.5)
        left = shortest(whole.pose_at(share * whole.length), tuple(goal), 0.5)
        assert left.length <= (1 - share) * whole.length + 1e-6


@pytest.mark.slow
def test_a_limit_lets_just_the_shorter_curves_pass():
    """Short ones and any, with limits a little above and a little below the length of the shortest."""
    rng, kernel = np.random.default_rng(2), interpreted("dubins")
    for radius in (1.0, 0.3):
        pairs = list(naive.short_curves(rng, scaled(12_000)))
        pairs.append((np.column_stack([rng.uniform(-3, 3, (scaled(4000), 2)), rng.uniform(-PI, PI, scaled(4000))]),) * 2)
        pairs[-1] = pairs[-1][0], rng.permutation(pairs[-1][1])
        for starts, goals in pairs:
            starts, goals = (poses * (radius, radius, 1) for poses in (starts, goals))
            known = lengths(starts, goals, radius)
            for (x0, y0, a), (x1, y1, b), length in zip(starts.tolist(), goals.tolist(), known, strict=True):
                if length < 1e-6:
                    continue
                for limit in (length * (1 + 1e-6), length * (1 - 1e-6)):
                    curve = kernel.shortest_within(x1 - x0, y1 - y0, a, math.sin(a), math.cos(a),
                                                   b, math.sin(b), math.cos(b), radius, 0.0, limit)
                    arcs = curve.first, curve.second, curve.third
                    assert (arcs[0] < 1e300) == (limit > length)
                    assert limit < length or sum(arcs) == pytest.approx(length, rel=1e-9)
