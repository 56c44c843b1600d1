"""Squares cut into triangles, the gates on their levels: against what is computed for each square by itself."""

import itertools
import math

import numpy as np
import pytest

from dubins_rrt_ros.checker.levels import CUTS, FROM_START, Squares, gradients

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
def squares():
    return Squares(document())


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


def cost_at(squares, x, y):
    """The square of a place, and the cost there, by the triangle that holds it."""
    across, up = (x + 1.0) / SIDE, (y - 2.0) / SIDE
    column, row = math.floor(across), math.floor(up)
    corners = corners_of(squares.costs[FROM_START], (row, column))
    for triangle in cut(corners):
        places = np.array([(1.0, j, i) for i, j in triangle])
        shares = np.linalg.solve(places.T, (1.0, across - column, up - row))
        if shares.min() >= -1e-9:
            return (row, column), float(shares @ [corners[i, j] for i, j in triangle])
    raise AssertionError


def test_costs_are_linear_on_the_less_steep_triangles(squares):
    for x, y in np.random.default_rng(2).uniform((-1, 2), (3.5, 5.5), (300, 2)):
        square, cost = squares.at(FROM_START, x, y)
        assert (square, pytest.approx(cost)) == cost_at(squares, x, y)


@pytest.mark.parametrize("place", [(-1.1, 3.0), (0.0, 1.9), (3.6, 3.0), (0.0, 5.6)])
def test_a_place_outside_has_no_square(squares, place):
    with pytest.raises(IndexError):
        squares.at(FROM_START, *place)


def test_triangles_are_the_less_steep_ones_and_have_their_slopes(squares):
    row, column = np.array(every_square()).T
    found = squares.triangles(FROM_START, row, column)
    diagonals = set()
    for square, triangles in zip(every_square(), found, strict=True):
        corners = corners_of(squares.costs[FROM_START], square)
        wanted = [[(square[1] + j, square[0] + i, corners[i, j]) for i, j in triangle] for triangle in cut(corners)]
        assert triangles.tolist() == np.array(wanted).tolist()
        assert gradients(triangles) == pytest.approx(np.array([slope(corners, triangle) for triangle in cut(corners)]))
        diagonals.add(cut(corners)[0][0])
    assert len(diagonals) == 2 and CUTS.shape == (2, 2, 3, 2)


def test_the_corridor_is_what_has_costs_below_the_limit(squares):
    near = {(row, column) for row in (4, 5) for column in (1, 2)}  # of the node without a cost
    costs = [np.array(document()[name], dtype=float) for name in ("from_start", "to_goal")]
    for square in every_square():
        has = square not in BLOCKED | near
        least = sum(corners_of(cost, square).min() for cost in costs)
        assert squares.domain[square] == has and squares.corridor[square] == (has and least < LIMIT)
        corners = corners_of(costs[0], square)
        slabs = range(sum(level < corners.min() for level in LEVELS), sum(level < corners.max() for level in LEVELS) + 1)
        assert [slab in slabs and bool(squares.corridor[square]) for slab in range(4)] == squares.parts[:, *square].tolist()
    assert 20 < squares.corridor.sum() < squares.domain.sum() < 63


def test_gates_are_where_costs_are_a_level_and_rise_or_fall_across(squares):
    found = []
    for gate, before, after in zip(*squares.gates(), strict=True):
        (slab, *square), (following, *same) = before.tolist(), after.tolist()
        assert square == same and abs(slab - following) == 1 and gate[9] == LEVELS[min(slab, following)]
        assert gate[10] == corners_of(np.array(document()["to_goal"], dtype=float), square).min()
        onward, way = np.array([math.cos(gate[6]), math.sin(gate[6])]), following - slab
        assert cost_at(squares, *gate[:2]) == (tuple(square), pytest.approx(gate[9]))
        behind, ahead = (cost_at(squares, *(gate[:2] + share * onward))[1] for share in (-1e-4, 1e-4))
        assert way * behind < way * gate[9] < way * ahead
        assert abs(gate[2:4] @ onward) < 1e-12 and math.hypot(*gate[2:4]) == pytest.approx(1)
        assert gate[[5, 8]].tolist() == [0, 0] and math.pi / 2 < gate[7] < math.pi / 2 + 1e-8
        found.append((*square, slab, following))
    wanted = []
    for square in every_square():
        corners = corners_of(squares.costs[FROM_START], square)
        for slab, level in enumerate(LEVELS):
            crossed = sum(len({bool(corners[i, j] < level) for i, j in triangle}) == 2 for triangle in cut(corners))
            wanted += squares.corridor[square] * crossed * [(*square, slab, slab + 1), (*square, slab + 1, slab)]
    assert sorted(found) == sorted(wanted)


def test_gates_reach_from_edge_to_edge(squares):
    """Their ends are on the edges of their triangles, where the cost is the level."""
    for gate, (_, row, column) in zip(*squares.gates()[:2], strict=True):
        corners, on = corners_of(squares.costs[FROM_START], (row, column)), []
        for triangle in cut(corners):
            for (i, j), (k, m) in itertools.combinations(triangle, 2):
                share = (gate[9] - corners[i, j]) / (corners[k, m] - corners[i, j])
                if 0 < share < 1:
                    on.append((-1 + SIDE * (column + j + share * (m - j)), 2 + SIDE * (row + i + share * (k - i))))
        ends = [gate[:2] + way * gate[4] * gate[2:4] for way in (-1, 1)]
        assert all(min(math.dist(end, point) for point in on) < 1e-12 for end in ends) and gate[4] > 0


def test_squares_within_a_distance_are_found(squares):
    for x, y, reach in ((0.1, 3.3, 0.0), (0.1, 3.3, 0.7), (-1.5, 1.0, 1.2), (3.4, 5.4, 0.3)):
        found = squares.near(x, y, reach)
        for row, column in every_square():
            middle = -1 + SIDE * (column + 0.5), 2 + SIDE * (row + 0.5)
            off = [max(0.0, abs(a - b) - SIDE / 2) for a, b in zip(middle, (x, y), strict=True)]
            assert found[row, column] == (math.hypot(*off) <= reach)
