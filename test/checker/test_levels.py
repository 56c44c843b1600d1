"""Squares cut into triangles, their levels and what touches: against what is computed for each square by itself."""

import itertools
import math

import numpy as np
import pytest

from dubins_rrt_ros.checker.levels import DOWNWARD, UPWARD, Squares, squared_slopes

SIDE = 0.5
LEVELS = np.array([0.71, 1.33, 2.04])


@pytest.fixture
def squares():
    """Seven by nine squares with costs that no two nodes share."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:8, :10] * SIDE
    return Squares((-1.0, 2.0), SIDE, np.hypot(x - 1.1, y - 0.4) * 0.7 + 0.05 * rng.random((8, 10)), LEVELS)


def cost_at(squares, x, y):
    """The cost at a place, by the triangle that holds it."""
    across, up = (x + 1.0) / SIDE, (y - 2.0) / SIDE
    column, row = math.floor(across), math.floor(up)
    corners = squares.corners(np.array([row * 9 + column]))[0]
    upward = steepness(corners, UPWARD) <= steepness(corners, DOWNWARD)
    for triangle in UPWARD if upward else DOWNWARD:
        places = np.array([(1.0, j, i) for i, j in triangle])
        shares = np.linalg.solve(places.T, (1.0, across - column, up - row))
        if shares.min() >= -1e-9:
            return row * 9 + column, float(shares @ [corners[i, j] for i, j in triangle])
    raise AssertionError


def steepness(corners, triangles):
    return max(float((np.linalg.solve([(j - b, i - a), (m - b, k - a)], (corners[i, j] - corners[a, b],
                                                                        corners[k, m] - corners[a, b]))**2).sum())
               for (a, b), (i, j), (k, m) in triangles)


def test_costs_are_linear_on_the_less_steep_triangles(squares):
    for x, y in np.random.default_rng(2).uniform((-1, 2), (3.5, 5.5), (300, 2)):
        square, cost = squares.at(x, y)
        assert (square, pytest.approx(cost)) == cost_at(squares, x, y)


def test_slopes_are_those_of_the_steeper_triangle(squares):
    corners = squares.corners(np.arange(63))
    for triangles in (UPWARD, DOWNWARD):
        assert squared_slopes(corners, triangles) == pytest.approx([steepness(square, triangles) for square in corners])
    assert set(squares.is_upward(corners).tolist()) == {True, False}


def test_pieces_are_where_costs_are_a_level_and_rise_across(squares):
    some = np.setdiff1d(np.arange(63), [4, 31])
    pieces = squares.pieces(some)
    rising = np.stack([np.cos(pieces.rising), np.sin(pieces.rising)], axis=1)
    for square, level, ends, up in zip(pieces.square, pieces.level, pieces.ends, rising, strict=True):
        middle, off = (ends[:2] + ends[2:]) / 2, 1e-4 * up
        assert cost_at(squares, *middle) == (square, pytest.approx(LEVELS[level]))
        higher, lower = (cost_at(squares, *(middle + way * off))[1] for way in (1, -1))
        assert higher > LEVELS[level] > lower
        assert abs((ends[2:] - ends[:2]) @ up) < 1e-12
    inside, found = cost_at(squares, 0.1, 3.3), {}
    assert inside[0] in some.tolist()
    for square, triangle, level in zip(*pieces[:3], strict=True):
        found.setdefault((int(square), int(level)), []).append(int(triangle))
    corners = squares.corners(np.arange(63))
    crossed = {(square, level) for square in some.tolist() for level in range(3)
               if corners[square].min() < LEVELS[level] < corners[square].max()}
    assert set(found) == crossed and all(len(set(triangles)) == len(triangles) for triangles in found.values())
    for square, level in crossed:
        triangles = UPWARD if squares.is_upward(corners[[square]])[0] else DOWNWARD
        assert found[square, level] == [number for number, triangle in enumerate(triangles)
                                        if len({bool(corners[square][i, j] < LEVELS[level]) for i, j in triangle}) == 2]


def test_boxes_are_shares_of_a_piece_and_of_the_headings(squares):
    pieces = squares.pieces(np.arange(63))
    ways, shares = np.array([1, -1, 1]), np.array([(0.0, 1.0, -1.0, 1.0), (0.25, 0.5, -1.0, 0.0), (0.5, 1.0, 0.5, 1.0)])
    index = np.array([3, 4, 8])
    for box, piece, way, (s0, s1, h0, h1) in zip(pieces.boxes(index, ways, shares, 1e-3), index, ways, shares, strict=True):
        first, last = pieces.ends[piece, :2], pieces.ends[piece, 2:]
        length = math.dist(first, last)
        assert box[:2] == pytest.approx(first + (s0 + s1) / 2 * (last - first))
        assert box[2:4] == pytest.approx((last - first) / length)
        assert box[4:6] == pytest.approx(((s1 - s0) / 2 * length + 1e-3, 1e-3))
        middle = pieces.rising[piece] + (h0 + h1) / 2 * math.pi / 2 + (math.pi if way < 0 else 0)
        assert box[6:] == pytest.approx((middle, (h1 - h0) / 2 * math.pi / 2)) and box[7] > (h1 - h0) / 2 * math.pi / 2
    short = pieces._replace(ends=np.tile(pieces.ends[:, :2], 2))
    assert short.boxes(index, ways, shares, 1e-3)[:, 2:5] == pytest.approx(np.tile((1.0, 0.0, 1e-3), (3, 1)))


def test_neighbours_share_nodes_and_the_slabs_between(squares):
    some = np.setdiff1d(np.arange(63), [10, 12, 40])
    found = {(int(one), int(other)): (int(low), int(high)) for group in squares.neighbours(some)
             for one, other, low, high in zip(*group, strict=True)}
    wanted = {}
    for one, other in itertools.combinations(some.tolist(), 2):
        nodes = [{(square // 9 + i, square % 9 + j) for i in (0, 1) for j in (0, 1)} for square in (one, other)]
        slabs = [sum(level < squares.costs[node] for level in LEVELS) for node in nodes[0] & nodes[1]]
        if slabs:
            wanted[one, other] = min(slabs), max(slabs)
    assert found == wanted


def test_squares_within_a_distance_are_found(squares):
    some = np.setdiff1d(np.arange(63), [20])
    for x, y, reach in ((0.1, 3.3, 0.0), (0.1, 3.3, 0.7), (-1.5, 1.0, 1.2), (3.4, 5.4, 0.3)):
        middles = np.array([(-1 + SIDE * (square % 9 + 0.5), 2 + SIDE * (square // 9 + 0.5)) for square in some])
        off = [max(0.0, abs(a - x) - SIDE / 2) ** 2 + max(0.0, abs(b - y) - SIDE / 2) ** 2 for a, b in middles]
        assert squares.within(some, x, y, reach).tolist() == some[np.array(off) <= reach**2].tolist()
