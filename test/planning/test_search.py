"""Searches with all that goes beyond the paper: bytes by seed and samples alone, never a longer path, none lost by pruning."""

import itertools
import math

import numpy as np
import pytest
from support import naive
from support.cases import (
    SCALE,
    contents,
    field_of,
    finish,
    holed_polygons,
    naive_clearance,
    needs_compiled,
    random_maps,
    random_problem,
    scaled,
    search_on,
    steps_of,
)

from dubins_rrt_ros.planning import GridMap, Problem, Settings, Status, Vehicle, audit_path, load_map, plan
from dubins_rrt_ros.planning.maps.locate import maps_directory
from dubins_rrt_ros.planning.plan_file import read_request, to_document
from dubins_rrt_ros.planning.search import background, rrt
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.lower_bound import lower_bound

BUDGETS = (1, 7, rrt.BLOCK - 1, rrt.BLOCK, rrt.BLOCK + 1, 1100, 3000) if SCALE == 1 else (1, 7, 20, 40)
KINDS = ["maze", "polygons", "late", "brief"] if SCALE == 1 else ["maze"]
VEHICLE = Vehicle(1.0, 0.2)


@pytest.fixture(scope="module")
def problems():
    """By name; `late` is one where hybrid A* finds nothing before the first samples do, `brief` one whose second run is cut."""
    polygons = holed_polygons(np.random.default_rng(1), "walls")
    return {"maze": Problem(load_map(maps_directory() / "maze.yaml"), Vehicle(), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57)),
            "brief": Problem(polygons, Vehicle(0.3, 0.1), (0.5, 0.5, 1), (9, 9, -2)),
            "polygons": Problem(polygons, Vehicle(0.4, 0.1), (0.5, 0.5, 1), (9, 9, 1)),
            "late": Problem(polygons, Vehicle(0.4, 0.1), (0.5, 0.5, 1), (9, 9, 1), goal_tolerance_xy=0.3, goal_tolerance_yaw=0.3)}


@pytest.fixture(params=KINDS)
def problem(request, problems, monkeypatch):
    if request.param == "late":
        monkeypatch.setattr(rrt, "MOST_FIRST", 1)
    if request.param == "brief":
        monkeypatch.setattr(rrt, "MOST_SECOND", 20)
    if request.param in ("late", "brief"):
        monkeypatch.setattr(rrt, "EXPANSIONS", 16)
    return problems[request.param]


def searched(problem, **options):
    return finish(search_on(problem, Settings(**{"seed": 1, "samples": scaled(1000, least=40), **options})))


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_a_seed_determines_every_byte(planner, problem, monkeypatch):
    """Not the time that a batch takes, nor the number of cores."""
    once = searched(problem, planner=planner)
    assert contents(searched(problem, planner=planner)) == contents(once)
    for batch_time, cores in ((1e-9, 2), (1.0, 2), (0.005, 1), (0.005, 2))[:scaled(4, least=2)]:
        monkeypatch.setattr(rrt, "BATCH_TIME", batch_time)
        monkeypatch.setattr(background, "cores", lambda cores=cores: cores)
        other = searched(problem, planner=planner)
        assert contents(other) == contents(once)
        assert (other.best, other.samples) == (once.best, once.samples)


@pytest.mark.parametrize("cores", [1, 2])
def test_a_bound_that_is_left_to_who_asks_is_not_computed_without_the_time_for_it(problems, monkeypatch, cores):
    monkeypatch.setattr(background, "cores", lambda: cores)
    search = search_on(problems["maze"], Settings(seed=1))
    next(search.run())  # ends before the bounds are started
    assert search.make_bound(0.0) is None and search.make_bound(0.1) is None
    assert search.make_bound() is not None


def test_another_seed_gives_another_tree(problem):
    assert contents(searched(problem, seed=2)) != contents(searched(problem))


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"step_size": 0.8}, {"shortcut": False}, {"informed": False}, {"planner": "rrt"}])
def test_a_smaller_budget_is_the_beginning_of_a_larger_one(problem, options, monkeypatch):
    """So a plan that was cut short can be had again with the samples that it took; and more of them never give a dearer path."""
    monkeypatch.setattr(rrt, "BATCH_TIME", 1e-9)  # batches of one sample, but for the first, of eight
    whole, costs = search_on(problem, Settings(samples=BUDGETS[-1], seed=1, **options)), []
    steps, may_end = whole.run(), True
    for budget in BUDGETS:
        part = searched(problem, samples=budget, **options)
        assert part.samples <= budget or options.get("informed", True)  # which goes on up to a path
        costs.append(part.cost)
        while whole.samples < part.samples or whole.best < 0 <= part.best or not may_end:
            may_end = next(steps)
        if part.samples not in (1, 7):
            assert (whole.samples, contents(whole)) == (part.samples, contents(part))
    assert costs == sorted(costs, reverse=True)


@needs_compiled
def test_the_first_path_is_smoothed_and_another_sought_before_the_first_sample(problems):
    search = search_on(problems["maze"], Settings(samples=1000, seed=1))
    before = itertools.takewhile(lambda _: search.samples == 0, search.run())
    costs = [search.cost for _ in before]
    assert len(costs) < 20
    lengths = [cost for cost in costs if cost < math.inf]
    assert lengths[-1] < 0.99 * lengths[0]
    assert lengths == sorted(lengths, reverse=True)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(scaled(30, least=3)))
def test_the_best_path_on_random_problems(seed):
    """Its cost never rises, it reaches the goal free, no bound is above it, and the tree holds its invariants."""
    rng = np.random.default_rng(200 + seed)
    problem, clearance = random_problem(rng, random_maps(30)[seed])
    if clearance(np.array([problem.start[:2]]))[0] < problem.vehicle.robot_radius:
        return
    step, best = float(rng.choice([0.0, 0.5])), math.inf
    search = search_on(problem, Settings(samples=scaled(1000, least=100), seed=seed, step_size=step,
                                         preferred_clearance=(0.0, -1.0)[seed % 2]))
    for _ in steps_of(search):
        assert search.cost <= best
        best = search.cost
    tree = search.tree
    tree.check(field_of(problem), problem.vehicle)
    lengths = naive.costs(tree.parents, tree.lengths)
    if search.objective.is_length:
        np.testing.assert_allclose(tree.costs, lengths, rtol=1e-12)
    assert (tree.costs >= lengths * (1 - 1e-12)).all()
    assert step == 0 or tree.lengths.sum(axis=1).max() <= step * (1 + 1e-9)
    problem = search.growing.problem  # whose goals are those nearest to the goal that was asked for
    off = np.hypot(*(tree.poses[:, :2] - problem.goal[:2]).T)
    turned = np.abs(np.remainder(tree.poses[:, 2] - problem.goal[2] + math.pi, math.tau) - math.pi)
    reaching = (off <= problem.goal_tolerance_xy) & (turned <= problem.yaw_tolerance + 1e-12)
    reaching[0] = False
    assert (search.best >= 0) == reaching.any()
    if search.best >= 0:
        assert reaching[search.best]
        assert search.cost <= tree.costs[reaching].min() + 1e-9
        assert search.cost == pytest.approx(search.objective.path_cost(search.path), rel=1e-9)
        assert search.path == tree.path_to(search.best)
        assert audit_path(search.path, problem).ok
        bound = lower_bound(problem, CostToGo.to_goal(problem, field_of(problem)).make_bound())
        assert search.length >= bound - 1e-9


@pytest.mark.slow
@needs_compiled
def test_what_is_left_out_would_not_have_helped():
    """Without pruning, and with more samples, no path is shorter by more than what the samples' chance makes."""
    rng, ratios = np.random.default_rng(8), []
    for seed in range(16):
        loose, clearance = random_problem(rng, random_maps(30)[seed])
        problem = Problem(loose.map, loose.vehicle, loose.start, loose.goal, allow_unknown=loose.allow_unknown)
        if clearance(np.array([problem.start[:2], problem.goal[:2]])).min() < problem.vehicle.robot_radius:
            continue
        pruned = searched(problem, samples=3000, seed=seed, preferred_clearance=0.0).length
        all_kept = searched(problem, samples=5000, seed=seed, informed=False).length
        if pruned and all_kept:
            ratios.append(pruned / all_kept)
    assert len(ratios) >= 5
    assert max(ratios) < 1.01
    assert np.mean(ratios) < 1.001


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_a_plan_that_ends_at_once_has_the_bound_of_one_that_does_not(planner):
    """While the bounds are still computed in the background; an answer of RRT does not wait for it."""
    side = 700 if SCALE == 1 else 60
    data = np.zeros((side, side))
    data[side // 4:side // 2:side // 8, side // 10:-side // 10] = 100
    problem = Problem(GridMap(data, 0.1), VEHICLE, (0.05 * side, 0.01 * side, 0.0), (0.09 * side, 0.09 * side, 1.0))
    expected = lower_bound(problem, CostToGo.to_goal(problem, field_of(problem)).make_bound())
    for seed in range(scaled(15, least=2)):
        result = plan(problem, Settings(planner=planner, samples=1, seed=seed, planning_time=60.0, length_proof=False))
        assert result.status == Status.NONE
        assert result.lower_bound <= expected <= result.length
        assert planner == "rrt" or result.lower_bound == expected


@needs_compiled
@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
@pytest.mark.parametrize("asked", [3, 4, 5, 6, 7, 9, 12, 16, 30, 60])
def test_a_cancelled_plan_is_had_again_by_its_file(planner, asked, problems, monkeypatch):
    """By seed and number of samples, also where hybrid A* found the path before the first one, on however slow a machine."""
    for grace in ("CANCEL_GRACE", "CANCEL_AUDIT_GRACE"):
        monkeypatch.setattr(f"dubins_rrt_ros.planning.deadline.{grace}", 600.0)
    count = []
    result = plan(problems["maze"], Settings(planner=planner, seed=3, samples=scaled(3000), planning_time=600.0),
                  cancel=lambda: count.append(1) or len(count) >= asked)
    if result.path is None:
        assert result.status == Status.CANCELLED
        return
    again = plan(*read_request(to_document(result, "maze"), problems["maze"].map))
    assert again.path == result.path
    assert again.tree.poses.tobytes() == result.tree.poses.tobytes()
    assert again.samples == result.samples


@pytest.mark.slow
@needs_compiled
def test_a_plan_that_ran_out_of_time_is_had_again_by_its_file(problems, monkeypatch):
    for limit in (0.1, 0.2):
        with monkeypatch.context() as patched:
            now = iter(np.arange(1e6) / 10_000)
            patched.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda now=now: next(now))
            result = plan(problems["maze"], Settings(seed=3, samples=1_000_000, planning_time=limit))
        if result.path is None:
            assert result.status == Status.TIMEOUT
            continue
        assert 0 < result.samples < 1_000_000
        assert plan(*read_request(to_document(result, "maze"), problems["maze"].map)).path == result.path


def street(width=0.6):
    """A street around three corners that the vehicle just fits into, with no room beside it but at its ends."""
    data = np.full((100, 100), 100)
    cells = round(width / 0.1)
    data[5:25, 5:25] = data[75:95, 75:95] = 0
    data[15:15 + cells, 15:90] = 0
    data[15:50, 90 - cells:90] = 0
    data[50 - cells:50, 10:90] = 0
    data[50 - cells:85, 10:10 + cells] = 0
    data[85 - cells:85, 10:85] = 0
    return Problem(GridMap(data, 0.1), Vehicle(0.3, 0.2), (1.0, 1.8, 0.0), (8.5, 8.2, 0.0))


@pytest.mark.slow
@needs_compiled
def test_a_narrow_street_is_solved_by_every_seed():
    """Where the plain algorithm, with as many samples, mostly fails."""
    problem = street()
    plain = {"informed": False, "shortcut": False, "heading_sampling": "uniform"}
    statuses = [plan(problem, Settings(samples=3000, seed=seed, planning_time=60.0, **plain)).status for seed in range(4)]
    assert statuses.count(Status.NONE) <= 1
    for seed in range(20):
        result = plan(problem, Settings(samples=600, seed=seed, planning_time=60.0))
        assert result.status == Status.NONE, result.message
        assert audit_path(result.path, problem).ok
        assert result.length < 1.25 * result.lower_bound


@pytest.mark.parametrize("step", [0.0, 0.7])
def test_the_tree_holds_the_smoothed_path(step, problems):
    """In edges no longer than the step; and the start is where it was."""
    problem = problems["maze"]
    search = searched(problem, step_size=step, samples=1)
    path = search.path
    clearance = naive_clearance(problem.map)
    assert search.length == pytest.approx(path.length, rel=1e-12)
    assert tuple(path.waypoints[0]) == problem.start
    assert tuple(path.waypoints[-1]) == problem.goal
    assert clearance(path.waypoints[:, :2]).min() >= problem.vehicle.robot_radius
    if step:
        assert path.lengths.sum(axis=1).max() <= step * (1 + 1e-9)
        assert len(path.words) > 25


@needs_compiled
@pytest.mark.parametrize("turning_radius", [pytest.param(0.1, marks=pytest.mark.slow), 0.001])
def test_a_smaller_turning_radius_hardly_makes_a_path_longer(turning_radius):
    """Whatever the one vehicle drives the other can; it used to be a third longer, or not found at all."""
    rng = np.random.default_rng(1)
    cells = np.where(np.kron(rng.random((50, 50)) < 0.1, np.ones((8, 8), bool)), 100, 0).astype(np.int8)
    cells[:16, :16] = cells[-16:, -16:] = 0
    settings, lengths = Settings(seed=1, planning_time=60.0), {}
    for radius in (1.0, turning_radius):
        vehicle = Vehicle(radius, 0.2)
        lengths[radius] = plan(Problem(GridMap(cells, 0.1), vehicle, (0.8, 0.8, 0.8), (39.2, 39.2, 0.8)), settings).length
    assert lengths[turning_radius] <= 1.02 * lengths[1.0]
