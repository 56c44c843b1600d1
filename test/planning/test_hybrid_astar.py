"""Hybrid A*: what it finds is free, continuous, within its limit and at the goal; the heap that it is built on."""

import heapq
import math

import numpy as np
import pytest
from support import naive
from support.cases import SCALE, arrays_of, empty_map, field_of, interpreted, needs_compiled, random_maps, random_problem, scaled

from dubins_rrt_ros.planning import ClearanceField, GridMap, Path, Problem, Settings, Vehicle, audit_path, load_map
from dubins_rrt_ros.planning._kernels.edge_cost import EdgeCost
from dubins_rrt_ros.planning._kernels.hybrid_astar import HybridAStar
from dubins_rrt_ros.planning.curves.dubins import WORDS, shortest
from dubins_rrt_ros.planning.maps.locate import maps_directory
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.hybrid_astar import FIRST_RUNS, HybridAStarRuns

VEHICLE = Vehicle(0.5, 0.2)
START, GOAL = (-8.0, -8.0, 0.0), (8.0, 8.0, 1.0)


def runs_on(problem, **options):
    field = field_of(problem)
    return HybridAStarRuns(problem, Settings(seed=1, **options), field, CostToGo.to_goal(problem, field))


def first_path(problem, portion=256):
    """The first path, or None, and the runs."""
    runs, expanded = runs_on(problem), 0
    while not runs.exhausted and expanded < scaled(100_000, least=25_000):
        if found := runs.run(portion, math.inf):
            return found, runs
        expanded += portion
    return None, runs


def search_on(problem, limit=1e300, arc=0.6, sectors=16, weight=1.5, most=50_000, visit_penalty=0.0):
    """One run."""
    field, corners = field_of(problem), problem.map.corners()
    radius = problem.vehicle.turning_radius
    to_goal = CostToGo.to_goal(problem, field).kernel
    return HybridAStar(checker=field.collision_checker(problem.vehicle), edge_cost=EdgeCost(), radius=radius,
                       start=problem.start, goals=np.array([problem.goal]), to_goal=to_goal,
                       corner=corners.min(axis=0), extent=np.ptp(corners, axis=0), arc=arc * radius, sectors=sectors,
                       weight=weight, visit_penalty=visit_penalty, limit=limit, max_expanded=most)


def finished(search, radius=VEHICLE.turning_radius, portion=1000):
    while not search.ended:
        search.run(portion)
    return search.path() and Path(*search.path(), radius)


def walled():
    data = np.zeros((40, 40))
    data[:30, 20] = data[32:, 20] = 100
    return Problem(GridMap(data, 0.5, (-10.0, -10.0, 0.0)), VEHICLE, START, (8.0, -8.0, 2.0))


def check(path, problem):
    """Each curve keeps the clearance and ends where the next begins, but for the first as it was asked for."""
    assert path.start == problem.start
    at = np.array(problem.start)
    for i, curve in enumerate(path.curves, start=1):
        assert min(curve.lengths) >= 0
        assert field_of(problem).curve_is_free(curve, problem.vehicle)
        end = naive.drive(at, curve.word, curve.lengths, curve.radius)
        np.testing.assert_allclose(end[:2], path.waypoints[i, :2], atol=1e-8)
        assert abs(math.remainder(end[2] - path.waypoints[i, 2], math.tau)) <= 1e-9
        at = path.waypoints[i]
    assert math.dist(path.end[:2], problem.goal[:2]) <= problem.goal_tolerance_xy
    assert abs(math.remainder(path.end[2] - problem.goal[2], math.tau)) <= problem.yaw_tolerance + 1e-9
    assert audit_path(path, problem).ok


@pytest.mark.slow
@needs_compiled
def test_paths_on_random_problems_are_free_and_lead_to_the_goal():
    """Of every kind of map, vehicle and tolerance; those that are found at all."""
    rng = np.random.default_rng(1)
    found = tried = 0
    for seed in range(60):
        problem, clearance = random_problem(rng, random_maps(30)[seed % 30])
        ends = clearance(np.array([problem.start[:2], problem.goal[:2]]))
        if ends.min() < problem.vehicle.robot_radius or not naive.are_connected(problem, problem.vehicle.robot_radius):
            continue
        tried += 1
        path, _ = first_path(problem)
        if path is not None:
            check(path, problem)
            least = 0 if problem.goal_tolerance_xy > 0 else math.dist(problem.start[:2], problem.goal[:2])
            assert path.length >= least - 1e-9
            found += 1
    assert found > tried / 2 > 1


def test_in_the_open_the_first_path_is_the_dubins_curve():
    problem = Problem(empty_map(), VEHICLE, START, GOAL)
    path, _ = first_path(problem, portion=1)
    curve = shortest(START, GOAL, 0.5)
    assert len(path.words) == 2
    assert (WORDS[path.words[1]], tuple(path.lengths[1])) == (curve.word, curve.lengths)


@pytest.mark.parametrize("portion", [1, 7, 256, 100_000])
def test_portions_do_not_change_the_path(portion):
    whole = first_path(walled(), portion=1000)[0]
    path = first_path(walled(), portion=portion)[0]
    assert arrays_of(path) == arrays_of(whole)
    assert len(path.words) > 10


@needs_compiled
def test_portions_do_not_change_later_paths():
    def later(portion):
        runs, best, found = runs_on(walled()), math.inf, []
        for _ in range(60_000 // portion):
            if (path := runs.run(portion, best)) is not None:
                found.append(path)
                best = path.length if best == math.inf else best
        return [path.waypoints.tobytes() for path in found]

    few, many = later(50), later(5)
    assert few[:len(many)] == many[:len(few)]
    assert min(len(few), len(many)) >= 2


@pytest.mark.parametrize("weight", [1.0, 1.5])
def test_no_path_is_as_long_as_the_limit(weight):
    free = finished(search_on(walled(), weight=weight))
    check(free, walled())
    same = finished(search_on(walled(), weight=weight, limit=free.length + 1e-6))
    assert same.length == pytest.approx(free.length)
    for limit in (free.length, 0.95 * free.length, 0.9 * free.length):
        path = finished(search_on(walled(), weight=weight, limit=limit))
        assert path is None or path.length < limit
    assert finished(search_on(walled(), weight=weight, limit=20.0)) is None  # the way around is longer


def test_the_limit_saves_expansions():
    free, limited = search_on(walled(), weight=1.0), search_on(walled(), weight=1.0, limit=25.0)
    finished(free)
    finished(limited)
    assert limited.expanded < free.expanded


@pytest.mark.parametrize("tolerance", [
    {"any_goal_heading": True}, {"goal_tolerance_yaw": 0.7}, {"goal_tolerance_xy": 1.0, "any_goal_heading": True},
    {"goal_tolerance_xy": 1.0}])
def test_goals_with_tolerances(tolerance):
    """Of the headings that are allowed, one with a path is taken that is about as short as to the goal itself."""
    problem = walled()
    exact = first_path(problem)[0]
    loose = Problem(problem.map, VEHICLE, problem.start, problem.goal, **tolerance)
    path = first_path(loose)[0]
    check(path, loose)
    assert path.length <= 1.02 * exact.length
    if loose.yaw_tolerance == 0:
        assert tuple(path.waypoints[-1]) == problem.goal


@pytest.mark.parametrize("goal", [(8.0, -8.0, 40.0), (8.0, -8.0, -1000.0)])
def test_headings_many_turns_beyond_pi(goal):
    problem = walled()
    turned = Problem(problem.map, VEHICLE, (*START[:2], -250.0), goal)
    path = first_path(turned)[0]
    check(path, turned)
    assert tuple(path.waypoints[-1]) == goal
    near = Problem(problem.map, VEHICLE, (*START[:2], math.remainder(-250.0, math.tau)),
                   (*goal[:2], math.remainder(goal[2], math.tau)))
    assert first_path(near)[0].length == pytest.approx(path.length, abs=1e-6)


def test_an_unreachable_goal_ends_the_runs():
    """Nothing is found behind a wall, by any of the first runs, nor by one for narrow places, which ends the search."""
    data = np.zeros((20, 20))
    data[:, 13] = 100
    closed = Problem(GridMap(data, 0.25), VEHICLE, (2.5, 2.5, 0.0), (4.5, 2.5, 0.0))
    path, runs = first_path(closed, portion=500)
    assert path is None
    assert runs.exhausted


def test_a_passage_that_the_vehicle_cannot_turn_into_is_given_up_sooner_where_crowds_count():
    """A slot of two walls whose gaps are apart: the shortest way for the disc, while the vehicle has to drive around."""
    data = np.zeros((200, 200))
    data[:160, 100], data[:160, 110] = 100, 100
    data[80:90, 100] = data[120:130, 110] = 0
    problem = Problem(GridMap(data, 0.1), Vehicle(2.0, 0.2), (3.0, 8.5, 0.0), (17.0, 8.5, 0.0))
    expanded = []
    for visit_penalty in (0.0, 1.0):
        search = search_on(problem, arc=0.5, weight=2.0, visit_penalty=visit_penalty)
        check(finished(search, 2.0), problem)
        expanded.append(search.expanded)
    assert expanded[1] < 0.85 * expanded[0]


def test_a_run_gives_up_after_so_many_poses():
    problem = Problem(load_map(maps_directory() / "maze.yaml"), Vehicle(), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))
    search = search_on(problem, most=20)
    assert finished(search) is None
    assert (search.expanded, search.ended) == (20, True)


def test_each_first_run_solves_the_maze():
    problem = Problem(load_map(maps_directory() / "maze.yaml"), Vehicle(), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))
    for arc, sectors in FIRST_RUNS[:3 if SCALE == 1 else 1]:
        path = finished(search_on(problem, arc=arc, sectors=sectors), problem.vehicle.turning_radius)
        check(path, problem)
        assert path.length < 32


@pytest.mark.parametrize("side, radius", [(400.0, 0.1), (1000.0, 0.02), (1e6, 0.001)])
def test_a_lattice_of_more_cells_than_memory(side, radius):
    """A vehicle that turns nearly on the spot, on a large map: its lattice has up to 10^21 cells."""
    data = np.zeros((40, 40))
    data[:30, 20] = 100
    vehicle = Vehicle(radius, 0.2)
    problem = Problem(GridMap(data, side / 40), vehicle, (0.3 * side, 0.9 * side, 0.0), (0.7 * side, 0.9 * side, 1.0))
    path, _ = first_path(problem)
    assert path.length == pytest.approx(0.4 * side, abs=10 * radius)
    behind = Problem(problem.map, vehicle, (0.3 * side, 0.3 * side, -1000.0), (0.7 * side, 0.3 * side, 1.0))
    runs = runs_on(behind)
    for _ in range(scaled(20)):
        runs.run(256, math.inf)


def test_a_start_in_the_corner_of_the_lattice_with_a_heading_many_turns_below_0():
    """Its cell is the first one, and no cell comes before that."""
    problem = Problem(GridMap(np.zeros((40, 40)), 0.5), Vehicle(1.0, 0.1), (0.11, 0.11, 0.6 - 40 * math.tau), (15.0, 15.0, 0.0))
    path, _ = first_path(problem)
    check(path, problem)


def test_the_distances_that_guide_it_are_not_changed():
    problem = walled()
    field = ClearanceField(problem.map)
    to_goal = CostToGo.to_goal(problem, field)
    before = to_goal.kernel.nodes().tobytes()
    HybridAStarRuns(problem, Settings(seed=1), field, to_goal).run(2000, math.inf)
    assert to_goal.kernel.nodes().tobytes() == before


def test_the_heap_of_a_run_orders_as_heapq_does():
    heap = interpreted("heap").Heap
    rng = np.random.default_rng(1)
    for _ in range(scaled(60, least=20)):
        expected, keys, item = [], heap(0), 0
        for _ in range(500):
            keys.reserve(1)
            if expected and rng.random() < 0.4:
                assert keys.least_key() == expected[0][0]
                popped = keys.pop()
                assert popped in {item for key, item in expected if key == expected[0][0]}
                expected = [pair for pair in expected if pair[1] != popped]
                heapq.heapify(expected)
            else:
                key = float(rng.integers(50)) if rng.random() < 0.5 else rng.random()
                keys.push(item, key)
                heapq.heappush(expected, (key, item))
                item += 1
            assert keys.count == len(expected)


def test_a_lattice_remembers_the_costs_of_its_cells():
    """Poses, headings beyond pi among them, are in one cell where rows, columns and sectors by another formula are the same."""
    rng = np.random.default_rng(2)
    for _ in range(scaled(16, least=4)):
        corner, extent, side = rng.uniform(-50, 50, 2), rng.uniform(0.1, 9, 2), rng.uniform(0.2, 1)
        sectors = int(rng.integers(1, 40))
        lattice, costs, seen = interpreted("closed_set").ClosedSet(corner, extent, side, sectors), {}, 0
        for pose in np.column_stack([corner + rng.random((1500, 2)) * extent, rng.uniform(-9, 9, 1500)]).tolist():
            cell = (int((pose[0] - corner[0]) // side), int((pose[1] - corner[1]) // side),
                    int((pose[2] % math.tau) // (math.tau / sectors)))
            lattice.reserve(1)
            entry = lattice.entry_at(*pose)
            assert lattice.costs[entry] == costs.get(cell, 0)
            seen += cell in costs
            costs[cell] = lattice.costs[entry] = np.float32(rng.uniform(1, 9))
        assert lattice.used == len(costs)
        assert seen > 0
    assert len(costs) > 1
