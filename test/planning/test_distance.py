"""The kernels of the distance transform against brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import naive
from support.cases import scaled

from dubins_rrt_ros.planning._kernels.distance import fill_columns, measure_row_gaps

SHAPES = [(1, 1), (1, 30), (30, 1), (2, 2), (7, 8), (8, 7), (20, 150), (150, 20)]
SHARES = [0, 0.01, 0.2, 0.9, 1]


def looked_aside(blocked):
    row_gap = np.full(blocked.shape, -1, np.int32)
    measure_row_gaps((~blocked).view(np.uint8), row_gap)
    return row_gap


def squared_distances(blocked, columns=None):
    """By the kernels; float32 holds these integers exactly, and -1 is what was not written."""
    first, last = columns or (0, blocked.shape[1])
    out = np.full(blocked.shape, -1, np.float32)
    largest = ((min(blocked.shape) + 1) // 2) ** 2
    fill_columns(looked_aside(blocked), first, last, np.arange(largest + 1, dtype=np.float32), out)
    return out


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("shape", SHAPES)
def test_distances_are_those_of_brute_force(shape, share):
    blocked = np.random.default_rng(1).random(shape) < share
    np.testing.assert_array_equal(squared_distances(blocked), naive.squared_distances(blocked))


@settings(max_examples=scaled(200, least=20))
@given(st.integers(1, 25), st.integers(1, 25), st.sampled_from(SHARES), st.integers(0, 2**31))
def test_distances_in_random_grids(rows, columns, share, seed):
    blocked = np.random.default_rng(seed).random((rows, columns)) < share
    np.testing.assert_array_equal(squared_distances(blocked), naive.squared_distances(blocked))


@pytest.mark.parametrize("share", SHARES)
def test_next_cells_in_a_row(share):
    """Both are told, but that the farther one counts as one farther than the nearer."""
    blocked = np.random.default_rng(2).random((12, 15)) < share
    row_gap, expected = looked_aside(blocked), naive.next_in_row(blocked)
    nearer = expected.min(axis=-1)
    np.testing.assert_array_equal(row_gap >> 2, nearer)
    np.testing.assert_array_equal((row_gap >> 2) + (row_gap & 1), np.minimum(expected[..., 0], nearer + 1))
    np.testing.assert_array_equal((row_gap >> 2) + (row_gap >> 1 & 1), np.minimum(expected[..., 1], nearer + 1))


@pytest.mark.parametrize("first, last", [(0, 1), (0, 64), (63, 65), (5, 5), (60, 140), (149, 150)])
def test_only_the_columns_asked_for_are_written(first, last):
    blocked = np.random.default_rng(3).random((6, 150)) < 0.05
    expected = naive.squared_distances(blocked)
    expected[:, :first] = expected[:, last:] = -1
    np.testing.assert_array_equal(squared_distances(blocked, (first, last)), expected)


def test_many_rows():
    """So many that the square of their number is beyond an int32."""
    rows = scaled(100_000)
    distance = squared_distances(np.zeros((rows, 3), bool))
    assert distance[[0, -1]].tolist() == [[1, 1, 1]] * 2
    assert (distance[1:-1] == [1, 4, 1]).all()
