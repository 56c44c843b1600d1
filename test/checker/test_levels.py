"""Squares cut into triangles, the gates on their levels: against what is computed for each square by itself."""

import itertools
import math

import numpy as np
import pytest

from dubins_rrt_ros.checker.levels import CUTS, Corridor, gradients

SIDE, ROWS, COLUMNS = 0.5, 7, 9
LEVELS = [0.71, 1.33, 2.04]
#: The squares that are not free, one that has no costs, and those that the limit leaves out.
BLOCKED, WITHOUT, LIMIT = {(0, 4), (3, 4)}, (5, 2), 3.3


def document():
    """Squares with costs that no two nodes share, as a certificate has them."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:ROWS + 1, :COLUMNS + 1] * SIDE
    from_start = np.hypot(x - 1.1, y - 0.4) * 0.7 + 0.05 * rng.random(x.shape)
    to_goal = np.hypot(x - 3.9, y - 2.5) * 0.7 + 0.05 * rng.random(x.shape)
    free = ["".join("01"[(row, column) not in BLOCKED] for column in range(COLUMNS)) for row in range(ROWS)]
    costs = {"from_start": from_start.tolist(), "to_goal": to_goal.tolist()}
    costs["to_goal"][WITHOUT[0]][WITHOUT[1]] = None
    return {"squares": {"corner": [-1, 2], "side": SIDE, "free": free}, "levels": LEVELS, "limit": LIMIT, **costs}


@pytest.fixture
def corridor():
    return Corridor(document())


def corners_of(costs, square):
    row, column = square
    return costs[row:row + 2, column:column + 2]


def every_square():
    return list(itertools.product(range(ROWS), range(COLUMNS)))


def cut(corners):
    """The triangles of a square, by the (row, column) of their corners: those with the less steep steeper one."""
    upward = [((0, 0), (0, 1), (1, 1)), ((0, 0), (1, 0), (1, 1))]
    downward = [((0, 1), (0, 0), (1, 0)), ((0, 1), (1, 1), (1, 0))]
    return min((upward, downward), key=lambda triangles: max(np.hypot(*slope(corners, triangle)) for triangle in triangles))


def slope(corners, triangle):
    """The rise of a triangle along x and y, for a square of side 1."""
    (a, b), *others = triangle
    return np.linalg.solve([(j - b, i - a) for i, j in others], [corners[i, j] - corners[a, b] for i, j in others])


def cost_at(corridor, x, y):
    """The square of a place, and the cost there, by the triangle that holds it."""
    across, up = (x + 1.0) / SIDE, (y - 2.0) / SIDE
    column, row = math.floor(across), math.floor(up)
    corners = corners_of(corridor.from_start.costs, (row, column))
    for triangle in cut(corners):
        places = np.array([(1.0, j, i) for i, j in triangle])
        shares = np.linalg.solve(places.T, (1.0, across - column, up - row))
        if shares.min() >= -1e-9:
            return (row, column), float(shares @ [corners[i, j] for i, j in triangle])
    raise AssertionError


def test_costs_are_linear_on_the_less_steep_triangles(corridor):
    for x, y in np.random.default_rng(2).uniform((-1, 2), (3.5, 5.5), (300, 2)):
        square, cost = corridor.from_start.at(x, y)
        assert (square, pytest.approx(cost)) == cost_at(corridor, x, y)


@pytest.mark.parametrize("place", [(-1.1, 3.0), (0.0, 1.9), (3.6, 3.0), (0.0, 5.6)])
def test_a_place_outside_has_no_square(corridor, place):
    with pytest.raises(IndexError):
        corridor.from_start.at(*place)


def test_triangles_are_the_less_steep_ones_and_have_their_slopes(corridor):
    row, column = np.array(every_square()).T
    found = corridor.from_start.triangles(row, column)
    diagonals = set()
    for square, triangles in zip(every_square(), found, strict=True):
        corners = corners_of(corridor.from_start.costs, square)
        wanted = [[(square[1] + j, square[0] + i, corners[i, j]) for i, j in triangle] for triangle in cut(corners)]
        assert triangles.tolist() == np.array(wanted).tolist()
        assert gradients(triangles) == pytest.approx(np.array([slope(corners, triangle) for triangle in cut(corners)]))
        diagonals.add(cut(corners)[0][0])
    assert len(diagonals) == 2 and CUTS.shape == (2, 2, 3, 2)


def test_the_corridor_is_what_has_costs_below_the_limit(corridor):
    near = {(row, column) for row in (4, 5) for column in (1, 2)}  # of the node without a cost
    costs = [np.array(document()[name], dtype=float) for name in ("from_start", "to_goal")]
    for square in every_square():
        has = square not in BLOCKED | near
        least = sum(corners_of(cost, square).min() for cost in costs)
        assert corridor.domain[square] == has and corridor.mask[square] == (has and least < LIMIT)
        corners = corners_of(costs[0], square)
        slabs = range(sum(level < corners.min() for level in LEVELS), sum(level < corners.max() for level in LEVELS) + 1)
        assert [slab in slabs and bool(corridor.mask[square]) for slab in range(4)] == corridor.parts[:, *square].tolist()
    assert 20 < corridor.mask.sum() < corridor.domain.sum() < 63


def test_gates_are_where_costs_are_a_level_and_rise_or_fall_across(corridor):
    gates, found = corridor.gates(), []
    onward = np.stack([np.cos(gates.heading), np.sin(gates.heading)], axis=1)
    for row, column, before, after, cost, left, ends, on in zip(*gates[:7], onward, strict=True):
        assert cost == LEVELS[min(before, after)] and abs(before - after) == 1
        assert left == corners_of(corridor.to_goal.costs, (row, column)).min()
        middle, way = ends.mean(axis=0), after - before
        assert cost_at(corridor, *middle) == ((row, column), pytest.approx(cost))
        behind, ahead = (cost_at(corridor, *(middle + share * on))[1] for share in (-1e-4, 1e-4))
        assert way * behind < way * cost < way * ahead
        assert abs((ends[1] - ends[0]) @ on) < 1e-12
        assert all(min(abs(point - corner) % SIDE for point, corner in zip(end, (-1, 2), strict=True)) < 1e-9
                   or abs(cost_at(corridor, *(end + 1e-9))[1] - cost) < 1e-6 for end in ends)
        found.append((row, column, before, after))
    wanted = []
    for square in every_square():
        corners = corners_of(corridor.from_start.costs, square)
        for slab, level in enumerate(LEVELS):
            crossed = sum(len({bool(corners[i, j] < level) for i, j in triangle}) == 2 for triangle in cut(corners))
            wanted += corridor.mask[square] * crossed * [(*square, slab, slab + 1), (*square, slab + 1, slab)]
    assert sorted(found) == sorted(wanted)


def test_gates_reach_from_edge_to_edge(corridor):
    """Their ends are on the edges of their triangles, where the cost is the level."""
    gates = corridor.gates()
    for row, column, cost, ends in zip(gates.row, gates.column, gates.cost, gates.ends, strict=True):
        corners, on = corners_of(corridor.from_start.costs, (row, column)), []
        for triangle in cut(corners):
            for (i, j), (k, m) in itertools.combinations(triangle, 2):
                share = (cost - corners[i, j]) / (corners[k, m] - corners[i, j])
                if 0 < share < 1:
                    on.append((-1 + SIDE * (column + j + share * (m - j)), 2 + SIDE * (row + i + share * (k - i))))
        assert all(min(math.dist(end, point) for point in on) < 1e-12 for end in ends) and math.dist(*ends) > 0


def test_boxes_are_shares_of_a_gate_and_of_the_headings(corridor):
    gates = corridor.gates()
    rows = np.array([(0.0, 1.0, -1.0, 1.0, 3.0), (0.25, 0.5, -1.0, 0.0, np.nan), (0.5, 1.0, 0.5, 1.0, 2.0)])
    index = np.array([3, 4, 8])
    for box, gate, (s0, s1, h0, h1, u) in zip(gates.boxes(index, rows, 1e-3), index, rows, strict=True):
        first, last = gates.ends[gate]
        length = math.dist(first, last)
        assert box[:2] == pytest.approx(first + (s0 + s1) / 2 * (last - first))
        assert box[2:4] == pytest.approx((last - first) / length)
        assert box[4:6] == pytest.approx(((s1 - s0) / 2 * length + 1e-3, 1e-3))
        assert box[6:8] == pytest.approx((gates.heading[gate] + (h0 + h1) / 2 * math.pi / 2, (h1 - h0) / 2 * math.pi / 2))
        assert box[7] > (h1 - h0) / 2 * math.pi / 2
        assert box[8:] == pytest.approx((u, gates.cost[gate], gates.left[gate]), nan_ok=True)
    short = gates._replace(ends=gates.ends[:, [0, 0]])
    assert short.boxes(index, rows, 1e-3)[:, 2:5] == pytest.approx(np.tile((1.0, 0.0, 1e-3), (3, 1)))


def test_squares_within_a_distance_are_found(corridor):
    for x, y, reach in ((0.1, 3.3, 0.0), (0.1, 3.3, 0.7), (-1.5, 1.0, 1.2), (3.4, 5.4, 0.3)):
        found = corridor.from_start.near(x, y, reach)
        for row, column in every_square():
            middle = -1 + SIDE * (column + 0.5), 2 + SIDE * (row + 0.5)
            off = [max(0.0, abs(a - b) - SIDE / 2) for a, b in zip(middle, (x, y), strict=True)]
            assert found[row, column] == (math.hypot(*off) <= reach)
