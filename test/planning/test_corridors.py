"""Other corridors: saddles of the lengths of ways, detours over them and around closed places."""

import math
from itertools import pairwise

import numpy as np
import pytest
from support.cases import needs_compiled

from dubins_rrt_ros.planning import FREE, OCCUPIED, GridMap, Problem, Settings, Vehicle, plan
from dubins_rrt_ros.planning._kernels import UNLIMITED
from dubins_rrt_ros.planning._kernels.corridors import Descent, saddles
from dubins_rrt_ros.planning.collision.clearance import ClearanceField
from dubins_rrt_ros.planning.curves import dubins
from dubins_rrt_ros.planning.curves.path import Path
from dubins_rrt_ros.planning.search.cost import Objective
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.detours import ClosedPlaces, Landscape, SaddleDetours


def room_with(*blocks: tuple[int, int, int, int]) -> GridMap:
    """Return a room of 12 m x 8 m with blocks from one row and column up to others."""
    cells = np.full((80, 120), FREE, np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = OCCUPIED
    for low, left, high, right in blocks:
        cells[low:high, left:right] = OCCUPIED
    return GridMap(cells, 0.1)


#: A block that leaves a way of 2 m below and one of 1.5 m above it.
BLOCK = (20, 40, 65, 80)
START, GOAL = (1.0, 4.0, 0.0), (11.0, 4.0, 0.0)


def costs_of(problem: Problem) -> tuple[ClearanceField, CostToGo, CostToGo]:
    field = ClearanceField(problem.map)
    return field, CostToGo.from_start(problem, field).make_bound(), CostToGo.to_goal(problem, field).make_bound()


def path_over(x: float, y: float) -> Path:
    """Return a path from start over a point to the goal, whether it is free or not."""
    curves = [dubins.shortest(a, b, 0.5) for a, b in pairwise((START, (x, y, 0.0), GOAL))]
    return Path.of_curves(START, GOAL, curves)


@pytest.mark.parametrize(("blocks", "count"), [((), 0), ((BLOCK,), 1), (((20, 40, 35, 80), (50, 40, 65, 80)), 2)])
def test_there_is_a_saddle_for_each_obstacle_that_is_no_wall(blocks, count):
    problem = Problem(room_with(*blocks), Vehicle(turning_radius=0.5), START, GOAL)
    field, from_start, to_goal = costs_of(problem)
    nodes = from_start.kernel.nodes() + to_goal.kernel.nodes()
    landscape = Landscape(problem, field, from_start, to_goal)
    lengths = np.where(landscape.free != 0, np.minimum(nodes, UNLIMITED), UNLIMITED)
    assert len(saddles(lengths.reshape(-1), lengths.shape[1], 100.0)) == count
    assert len(saddles(lengths.reshape(-1), lengths.shape[1], 5.0)) == 0  # no way is as short


def test_no_detour_is_apart_from_a_path_that_a_huge_turning_radius_is_near_to():
    """The squares near the path are no longer listed then: their number grows with the square of the radius."""
    problem = Problem(room_with(BLOCK), Vehicle(turning_radius=1e4), START, GOAL)
    field, from_start, to_goal = costs_of(problem)
    detours = SaddleDetours(problem, Landscape(problem, field, from_start, to_goal), Objective(problem.vehicle, field), 100.0)
    assert detours.next(path_over(6.0, 7.25)) is None


def test_ways_over_a_node_fall_to_start_and_goal():
    problem = Problem(room_with(BLOCK), Vehicle(turning_radius=0.5), START, GOAL)
    field, from_start, to_goal = costs_of(problem)
    squares = Landscape(problem, field, from_start, to_goal)
    nodes = squares.costs
    descent = Descent(squares.free, *nodes)
    column, row = squares.places(np.array([6.0, 7.25])).astype(int)
    way = descent.way(int(row * squares.free.shape[1] + column), np.full(squares.free.size, -1, np.int32))
    along = nodes[0].reshape(-1)[way] - nodes[1].reshape(-1)[way]
    assert (np.diff(along) > 0).all()
    assert nodes[0].reshape(-1)[way[0]] < squares.side and nodes[1].reshape(-1)[way[-1]] < squares.side
    rows = way // squares.free.shape[1]
    assert (rows.max() - 1) * squares.side == pytest.approx(7.25, abs=0.2)  # above the block


def test_a_saddle_leads_a_path_round_the_other_side():
    problem = Problem(room_with(BLOCK), Vehicle(turning_radius=0.5), START, GOAL)
    field, from_start, to_goal = costs_of(problem)
    squares = Landscape(problem, field, from_start, to_goal)
    path = path_over(6.0, 7.25).cut(0.25)  # the longer way
    detours = SaddleDetours(problem, squares, Objective(problem.vehicle, field), 100.0)
    detour = detours.next(path)
    assert detour is not None
    column, row = squares.places(np.array([6.0, 1.5])).astype(int)
    assert detour.free[row, column]  # below the block
    column, row = squares.places(np.array([6.0, 7.25])).astype(int)
    assert not detour.free[row, column]
    assert detours.next(path) is None  # there it was planned


def test_a_closed_place_cuts_the_way():
    problem = Problem(room_with(BLOCK), Vehicle(turning_radius=0.5), START, GOAL)
    field, from_start, to_goal = costs_of(problem)
    path = path_over(6.0, 7.25).cut(0.25)
    landscape = Landscape(problem, field, from_start, to_goal)
    places = ClosedPlaces(landscape, Objective(problem.vehicle, field), np.random.default_rng(0))
    lengths = []
    for _ in range(20):
        detour = places.next(path)
        assert detour is not None and detour.first < detour.last
        ends = path.waypoints[[detour.first, detour.last], :2]
        way = CostToGo(field, problem.vehicle.inscribed_radius, tuple(ends[1]), free=detour.free).at(ends[:1])[0]
        if math.dist(*ends) > 9:  # so that the place lies beside the block
            lengths.append(way)
    assert lengths and min(lengths) > 9


@pytest.mark.parametrize("block", [(1, 40, 65, 80), (20, 40, 65, 80)])
def test_no_place_is_closed_where_all_ways_lead_through_it(block):
    problem = Problem(room_with(block), Vehicle(turning_radius=0.5), START, GOAL)
    field, from_start, to_goal = costs_of(problem)
    landscape = Landscape(problem, field, from_start, to_goal)
    places = ClosedPlaces(landscape, Objective(problem.vehicle, field), np.random.default_rng(0))
    detour = places.next(path_over(6.0, 7.25).cut(0.25))
    assert (detour is None) == (block[0] == 1)  # a block at the wall leaves but one way


@needs_compiled
def test_a_path_changes_its_corridor():
    """Of two ways to a goal behind a block, the one that the turn at the start leads to is the longer one."""
    problem = Problem(room_with((20, 40, 60, 80)), Vehicle(turning_radius=0.8), (1.0, 4.4, 1.5), (11.0, 4.0, -1.5))
    lengths = [plan(problem, Settings(samples=3000, planning_time=60, seed=seed)).length for seed in range(3)]
    assert max(lengths) < 1.003 * min(lengths)


@needs_compiled
def test_the_same_seed_gives_the_same_path_through_corridors():
    problem = Problem(room_with(BLOCK, (30, 90, 50, 100)), Vehicle(turning_radius=0.6), START, GOAL)
    first, second = (plan(problem, Settings(samples=1500, planning_time=60, seed=4)) for _ in range(2))
    assert first.path == second.path
