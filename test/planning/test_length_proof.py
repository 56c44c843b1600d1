"""The proof of a path's length: no bound is above a path, whichever way round; and a search that it ends."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from support.cases import needs_compiled, random_maps, random_problem, scaled

from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, load_map, plan, prepare
from dubins_rrt_ros.planning._kernels.dubins import shortest_lengths
from dubins_rrt_ros.planning._kernels.interval_curves import bounds_between, relax, shortest_of_intervals
from dubins_rrt_ros.planning.deadline import never
from dubins_rrt_ros.planning.maps.locate import maps_directory
from dubins_rrt_ros.planning.plan_file import read_request, to_document
from dubins_rrt_ros.planning.proof.boxes import Portal
from dubins_rrt_ros.planning.proof.length_proof import LengthProof
from dubins_rrt_ros.planning.proof.level_sets import LevelSets
from dubins_rrt_ros.planning.proof.portals import PortalGraph
from dubins_rrt_ros.planning.search.background import PROOFS, BackgroundJob

START, GOAL = (1.5, 2.0, 1.57), (13.5, 10.5, 1.57)


@pytest.fixture(scope="module")
def maze():
    return Problem(prepare(load_map(maps_directory() / "maze.yaml"), Vehicle()), start=START, goal=GOAL)


def rounds(number):
    """An `interrupted` that ends a proof after some looks at it."""
    count = itertools.count()
    return lambda: next(count) >= number


def lengths_between(starts, goals, radius):
    out = np.empty(len(starts))
    shortest_lengths(np.ascontiguousarray(starts), np.ascontiguousarray(goals), radius, out)
    return out


def test_no_curve_between_intervals_of_headings_is_shorter():
    """Against the shortest of many curves with headings in the intervals, their ends included."""
    rng = np.random.default_rng(4)
    shares = np.array(list(itertools.product(np.linspace(-1, 1, 13), repeat=2)))
    for _ in range(scaled(1500, least=60)):
        distance = rng.choice([0.01, 0.5, 2, 4, 8]) * rng.random() + 1e-3
        (start, end), halves = rng.uniform(-4, 4, 2), rng.choice([0, 0.05, 0.5, 1.5, math.pi], 2) * rng.random(2)
        radius = rng.uniform(0.3, 2)
        least = shortest_of_intervals(distance, start, halves[0], end, halves[1], radius)
        starts = np.column_stack([np.zeros((len(shares), 2)), start + halves[0] * shares[:, 0]])
        goals = np.column_stack([np.full(len(shares), distance), np.zeros(len(shares)), end + halves[1] * shares[:, 1]])
        sampled = lengths_between(starts, goals, radius).min()
        assert least <= sampled + 1e-9
        assert least >= distance - 1e-9


def test_the_shortest_curve_between_intervals_exists():
    """Where the intervals are narrow it is about as long as the curve between their middles."""
    rng = np.random.default_rng(5)
    for _ in range(200):
        distance, (start, end) = rng.uniform(5, 9), rng.uniform(-3, 3, 2)
        least = shortest_of_intervals(distance, start, 1e-6, end, 1e-6, 1.0)
        whole = lengths_between(np.array([[0, 0, start]]), np.array([[distance, 0, end]]), 1.0)[0]
        assert least == pytest.approx(whole, abs=1e-4)


def test_no_curve_between_boxes_is_shorter():
    rng = np.random.default_rng(6)
    for _ in range(scaled(300, least=10)):
        angles, radius = rng.uniform(-4, 4, 4), rng.uniform(0.2, 2)
        boxes = np.array([[*rng.uniform(-4, 4, 2), math.cos(angle), math.sin(angle), *rng.uniform(0, [0.5, 0.2]), heading,
                           rng.uniform(0, 1)] for angle, heading in (angles[:2], angles[2:])])
        out = np.empty(1)
        bounds_between(boxes[:1], boxes[1:], radius, out)
        assert out[0] <= lengths_between(*(poses_in(box, rng, 400) for box in boxes), radius).min() + 1e-9


def test_no_chain_below_the_limit_is_left_out():
    """A quicker bound that is above it ends the look at two boxes; it must not be above a curve either."""
    rng = np.random.default_rng(7)
    for _ in range(scaled(600, least=10)):
        angles, radius = rng.uniform(-4, 4, 4), rng.uniform(0.2, 1)
        boxes = np.array([[*rng.uniform(-3, 3, 2), math.cos(angle), math.sin(angle), *rng.uniform(0, [0.2, 0.1]), heading,
                           rng.uniform(0, 0.4)] for angle, heading in (angles[:2], angles[2:])])
        limit = lengths_between(*(poses_in(box, rng, 400) for box in boxes), radius).min() + 1e-8
        for backwards in (False, True):
            sources, others = (boxes[1:], boxes[:1]) if backwards else (boxes[:1], boxes[1:])
            out, best = np.full(1, 1e300), np.empty(1, np.int32)
            relax(np.zeros(1), sources, others, np.zeros(1), 0.0, radius, limit, backwards, out, best)
            assert best[0] == 0 and out[0] < limit


def poses_in(box, rng, number):
    """Random poses in a box, its corners among them."""
    along, across, turn = np.clip(rng.uniform(-1.5, 1.5, (3, number)), -1, 1)
    x, y, c, s, length, width, heading, half = box
    return np.column_stack([x + c * length * along - s * width * across, y + s * length * along + c * width * across,
                            heading + half * turn])


def test_the_pieces_of_a_level_are_where_the_cost_is_the_level(maze):
    sets = LevelSets(maze, maze.world.field)
    for level in (2.0, 7.3, 15.0):
        pieces = sets.pieces(level, math.inf)
        for share in (0.1, 0.5, 0.9):  # the ends are on the edges of squares, where the next one need not be free
            points = (1 - share) * pieces.ends[:, :2] + share * pieces.ends[:, 2:]
            np.testing.assert_allclose(sets.costs(points), level, atol=1e-6)
        middles = (pieces.ends[:, :2] + pieces.ends[:, 2:]) / 2
        uphill = middles + 1e-4 * np.column_stack([np.cos(pieces.gradients), np.sin(pieces.gradients)])
        risen = sets.costs(uphill)
        assert np.mean(risen > level) > 0.95  # the others are on a triangle's edge, or at an obstacle


def test_a_level_is_made_of_portals_that_are_apart(maze):
    sets = LevelSets(maze, maze.world.field)
    for level in (2.0, 7.3, 15.0):
        pieces, portals = sets.pieces(level, 25.0), sets.portals(level, 25.0)
        assert sorted(np.concatenate([portal.squares for portal in portals])) == sorted(pieces.squares)
        labels = sets.components(level, level, 25.0)
        of_portals = [set(labels[portal.squares].tolist()) for portal in portals]
        assert all(len(of_portal) == 1 for of_portal in of_portals) and 0 not in set().union(*of_portals)


def island():
    """A problem with two ways round a wall of 4 m, which both are nearly shortest."""
    cells = np.zeros((80, 120))
    cells[38:42, 40:80] = 100
    world = prepare(GridMap(cells, 0.1, (0.0, 0.0, 0.0)), Vehicle(turning_radius=0.5, robot_radius=0.2))
    return Problem(world, start=(1.0, 4.0, 0.0), goal=(11.0, 4.0, 0.0))


def test_a_path_goes_back_to_come_from_one_way_round_to_the_other():
    """Beside the wall it is at least as long as the rise and twice the way back to where the wall begins."""
    problem = island()
    sets = LevelSets(problem, problem.world.field)
    start, goal = (Portal.of_pose(pose, 0.0, 0.0, level, square) for pose, level, square in (
        (problem.start, 0.0, -1), (problem.goal, sets.end, sets.square_at(problem.goal[:2]))))
    graph = PortalGraph(sets, 14.0, start, goal)
    lower, upper = graph.portals_at(6.0), graph.portals_at(6.5)
    assert len(lower) == len(upper) == 2
    for portal in (*lower, *upper):
        portal.cover()
    graph.link()
    assert [edge.portal for edge in graph.edges(lower[0], backwards=True)] == [portal for portal in upper
                                                                               if same_side(portal, lower[0])]
    assert {edge.portal for edge in graph.cut(goal, 2, False)} == set(lower)


def same_side(portal, other):
    return (portal.boxes[:, 1].mean() > 4) == (other.boxes[:, 1].mean() > 4)


def test_portals_that_are_not_covered_are_passed_by():
    problem = island()
    sets = LevelSets(problem, problem.world.field)
    start = Portal.of_pose(problem.start, 0.0, 0.0, 0.0)
    goal = Portal.of_pose(problem.goal, 0.0, 0.0, sets.end, sets.square_at(problem.goal[:2]))
    graph = PortalGraph(sets, 14.0, start, goal)
    one, other = graph.portals_at(6.0)
    one.cover()
    graph.link()
    assert {id(edge.portal) for edge in graph.edges(goal)} == {id(start), id(one)}
    assert graph.cover_between(start, goal, 6.0)
    graph.link()
    assert {id(edge.portal) for edge in graph.edges(goal)} == {id(one), id(other)}
    assert graph.cover_between(one, goal, 8.0)
    assert len(graph.portals_at(8.0)) == 1 or sum(portal.is_covered for portal in graph.portals_at(8.0)) == 1


@needs_compiled
def test_every_path_crosses_the_levels_in_order(maze):
    sets = LevelSets(maze, maze.world.field)
    path = plan(maze, Settings(seed=2, samples=200)).path
    costs = sets.costs(path.poses(0.01)[:, :2])
    for level in np.arange(1.0, sets.end, 1.0):
        first = np.argmax(costs >= level)
        points = path.poses(0.01)[first, :2]
        ends = sets.pieces(level, math.inf).ends
        assert np.hypot(*((ends[:, :2] + ends[:, 2:]) / 2 - points).T).min() < 0.15


@needs_compiled
def test_the_gap_of_the_maze_is_closed(maze):
    """The bound by the eikonal equation is 5 % below the path."""
    result = plan(maze, Settings(seed=1, samples=3000, length_proof=False, preferred_clearance=0.0))
    assert result.gap > 0.04
    proof = LengthProof(maze, maze.world.field, result.path)
    proof.run(rounds(400), gap=0.015)
    assert result.length / 1.015 - 1e-9 <= proof.bound <= result.length


@needs_compiled
def test_a_proof_that_is_interrupted_as_it_begins_has_fewer_levels_and_holds(maze):
    result = plan(maze, Settings(seed=1, samples=300, preferred_clearance=0.0))
    for looks in (0, 2):
        proof = LengthProof(maze, maze.world.field, result.path, interrupted=rounds(looks))
        assert len(proof.levels) == looks
        proof.run(rounds(20), gap=0.015)
        assert 0 < proof.bound <= result.length


@needs_compiled
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_no_bound_is_above_a_path_on_random_problems(seed):
    """Also where the proof is asked for more than is true: it takes the path for longer than it is."""
    rng, maps, judged = np.random.default_rng(300 + seed), random_maps(30), 0
    for number in range(15):
        loose, _ = random_problem(rng, maps[number % 30])
        if loose.vehicle.required_clearance <= 0:
            continue
        world = prepare(loose.map, loose.vehicle, loose.allow_unknown)
        problem = Problem(world, start=loose.start, goal=loose.goal, goal_tolerance_xy=loose.goal_tolerance_xy,
                          goal_tolerance_yaw=loose.goal_tolerance_yaw, any_goal_heading=loose.any_goal_heading)
        result = plan(problem, Settings(seed=seed, samples=500, planning_time=0.1))
        if not result.solved or result.length < 0.5:
            continue
        judged += 1
        for factor in (1.0, 1.3):
            proof = LengthProof(problem, world.field, result.path, limit=factor * result.length)
            proof.length = factor * result.length
            proof.run(rounds(60))
            assert proof.bound <= result.length * (1 + 1e-9), (seed, number, factor)
    assert judged >= 2


@needs_compiled
def test_a_search_ends_as_soon_as_its_path_is_proved(maze):
    settings = Settings(seed=1, samples=10_000_000, planning_time=60.0, stop_gap=0.02, preferred_clearance=0.0)
    result = plan(maze, settings)
    assert result.gap <= 0.02 + 1e-9
    assert result.planning_time < 60
    assert "proved to be at most " in result.message
    assert 0 < result.samples < settings.samples
    again = plan(*read_request(to_document(result, "maze"), maze.map))
    assert again.path == result.path


@needs_compiled
@pytest.mark.parametrize("samples", [3000, 10_000_000])
def test_on_one_core_the_proof_shares_it_with_the_search(maze, monkeypatch, samples):
    monkeypatch.setattr("dubins_rrt_ros.planning.search.background.cores", lambda: 1)
    settings = Settings(seed=1, samples=samples, planning_time=60.0, stop_gap=0.03, preferred_clearance=0.0)
    result = plan(maze, settings)
    assert result.gap <= 0.03 + 1e-9 and result.samples < 10_000_000
    assert result.path == plan(maze, replace(settings, samples=result.samples, stop_gap=0.0)).path


@needs_compiled
def test_a_proof_that_cannot_be_had_ends_with_the_time(maze):
    result = plan(maze, Settings(seed=1, samples=1000, planning_time=0.3, stop_gap=1e-9))
    assert result.solved
    assert "proved" not in result.message
    assert result.lower_bound <= result.length


@needs_compiled
def test_the_gap_is_told_at_every_request_and_the_path_is_the_same(maze, monkeypatch):
    """On two cores, with the time that a proof needs; with neither it is left out."""
    monkeypatch.setattr("dubins_rrt_ros.planning.proof.background_proof.cores", lambda: 2)
    monkeypatch.setattr("dubins_rrt_ros.planning.search.background.cores", lambda: 2)
    settings = Settings(seed=1, samples=20_000, planning_time=60.0, preferred_clearance=0.0)
    without, beside = plan(maze, replace(settings, length_proof=False)), plan(maze, settings)
    assert beside.path == without.path and beside.samples == without.samples
    assert without.lower_bound < beside.lower_bound == beside.cost_lower_bound <= beside.length
    assert "proved" not in beside.message


@needs_compiled
def test_the_length_of_a_roomy_path_is_proved_too(maze, monkeypatch):
    """The proof begins beside a search that minimises another cost, and raises the bound of the length."""
    monkeypatch.setattr("dubins_rrt_ros.planning.proof.background_proof.cores", lambda: 2)
    jobs = []
    monkeypatch.setattr(PROOFS, "start", lambda *job: jobs.append(job) or BackgroundJob(never, None))
    result = plan(maze, Settings(seed=1, samples=500, planning_time=60.0, preferred_clearance=-1.0))
    [(_, path, bounds)] = jobs
    proof = LengthProof(maze, maze.world.field, path, bounds)
    proof.run(rounds(60))
    assert result.lower_bound < proof.bound <= plan(maze, Settings(seed=1, samples=500, planning_time=60.0)).length


@needs_compiled
def test_with_a_preferred_clearance_a_stop_gap_is_one_of_the_cost(maze):
    result = plan(maze, Settings(seed=1, samples=10_000_000, planning_time=60.0, preferred_clearance=-1.0, stop_gap=0.1))
    assert result.cost_gap <= 0.1 + 1e-9
    assert result.planning_time < 60 and "proved to be at most " in result.message


@needs_compiled
def test_a_path_that_is_the_dubins_curve_needs_no_proof(monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.proof.background_proof.cores", lambda: 2)
    monkeypatch.setattr(PROOFS, "start", never)
    problem = island()
    straight = Problem(problem.world, start=(1.0, 1.0, 0.0), goal=(11.0, 1.0, 0.0))
    result = plan(straight, Settings(seed=1, samples=300, planning_time=60.0))
    assert result.gap < 1e-6 and result.samples == 300


@needs_compiled
def test_on_one_core_nothing_is_proved_without_a_gap_to_stop_at(maze, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.proof.background_proof.cores", lambda: 1)
    monkeypatch.setattr("dubins_rrt_ros.planning.proof.background_proof.LengthProof", never)
    assert plan(maze, Settings(seed=1, samples=scaled(200), planning_time=60.0)).solved
