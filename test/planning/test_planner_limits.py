"""How the planner ends and reports: time limit, budget, cancellation, progress."""

import itertools
import time
from dataclasses import replace

import numpy as np
import pytest
from support.cases import SCALE, empty_map, needs_compiled
from support.planner_cases import GOAL, START, VEHICLE, assert_refused, hard_to_reach, settings, walled

from dubins_rrt_ros.planning import GridMap, Path, Problem, Status, Tree, audit_path, load_map, plan, prepare
from dubins_rrt_ros.planning.plan_file import read_request, to_document
from dubins_rrt_ros.planning.search.cost import Objective
from dubins_rrt_ros.planning.search.hybrid_astar import HybridAStarRuns
from dubins_rrt_ros.planning.search.rrt import Search
from dubins_rrt_ros.planning.search.smoothing import smooth
from dubins_rrt_ros.planning.work import Work


@pytest.fixture(params=["rrt", "rrt_star"])
def planner(request):
    return request.param


def test_the_time_limit_ends_it(planner, monkeypatch):
    now = iter(np.arange(1e6) / 100)
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: next(now))
    result = plan(hard_to_reach(), settings(planner, samples=1_000_000, planning_time=0.5, informed=False))
    assert_refused(result, Status.TIMEOUT, "planning_time 0.5 s", "of 1000000 samples drawn", "allow more time")
    assert 0 < result.samples < 1_000_000
    assert 0.5 <= result.planning_time < 1.0
    assert f"{len(result.tree)} tree node" in result.message


def test_the_time_limit_ends_hybrid_a_star(planner, monkeypatch):
    now = iter(np.arange(1e6) / 100)
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: next(now))
    result = plan(hard_to_reach(), settings(planner, samples=1_000_000, planning_time=0.05))
    assert_refused(result, Status.TIMEOUT, "planning_time 0.05 s", "0 of 1000000 samples drawn")
    assert result.samples == 0


def test_a_path_found_by_the_time_limit_is_kept(monkeypatch):
    now = iter(np.arange(1e6) / 10_000)
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: next(now))
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL),
                  settings("rrt_star", goal_bias=0.5, samples=1_000_000, planning_time=0.05))
    assert result.status == Status.NONE
    assert result.samples < 1_000_000
    assert not result.cancelled


def test_a_path_is_audited_before_time_is_spent_on_its_better_forms(monkeypatch):
    """As of a footprint of a hundred corners, whose smoothing takes longer than there is time."""
    def endlessly(path, vehicle, field, rng, first_round, work, *_):
        while not work.is_over:
            time.sleep(0.001)
        time.sleep(0.02)
        return path
    monkeypatch.setattr("dubins_rrt_ros.planning.search.smoothing.smooth", endlessly)
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings("rrt_star", planning_time=0.6, preferred_clearance=0.5))
    assert result.solved, result.message


def test_nothing_is_kept_back_of_a_time_that_is_over(planner, monkeypatch):
    """Of a path that comes 4 ms late no better form is sought: only what is nearly done then goes on, and the audit."""
    now, smoothed, run = [0.0], [], HybridAStarRuns.run

    def late(*arguments):
        path = run(*arguments)
        now[0] += 1.004 if path else 0.0
        return path

    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: now[0])
    monkeypatch.setattr(HybridAStarRuns, "run", late)
    monkeypatch.setattr("dubins_rrt_ros.planning.search.smoothing.smooth", lambda path, *_: smoothed.append(path) or path)
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings(planner, planning_time=1.0, preferred_clearance=0.0))
    assert result.solved and smoothed == []


@needs_compiled
@pytest.mark.parametrize("what", ["tree", "cost"])
def test_the_time_that_is_kept_for_the_audit_includes_what_goes_with_it(what, monkeypatch):
    """The search ends so early that the tree and the cost of its path, of which one takes 10 s, are there in time."""
    looks, took, is_cost_due, tree_with, path_cost = itertools.count(), [], [], Search.tree_with, Objective.path_cost

    def tree_slowly(search, path):
        (took if what == "tree" else is_cost_due).append(10.0)
        return tree_with(search, path)

    def cost_slowly(objective, path):
        took.extend(is_cost_due[:1])  # only the cost that goes with a tree, and not those that the search asks for
        is_cost_due.clear()
        return path_cost(objective, path)

    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: 0.002 * next(looks) + sum(took))
    monkeypatch.setattr(Search, "tree_with", tree_slowly)
    monkeypatch.setattr(Objective, "path_cost", cost_slowly)
    result = plan(Problem(walled_with_a_gap(), VEHICLE, START, GOAL),
                  settings("rrt_star", samples=1_000_000, planning_time=40.0, preferred_clearance=0.0))
    assert result.solved and len(took) > 1
    assert result.planning_time <= 40.0


def test_what_the_time_limit_cuts_short_is_told(monkeypatch):
    """By a search with the work that it took the same path is had again."""
    problem, told = Problem(walled_with_a_gap(), VEHICLE, START, GOAL), []
    with monkeypatch.context() as patched:
        now = iter(np.arange(1e6) / 10_000)
        patched.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: next(now))
        result = plan(problem, settings("rrt_star", samples=1_000_000, planning_time=0.1),
                      on_progress=lambda progress: told.append(progress.length))
    assert result.status == Status.NONE
    assert 0 < result.samples < 1_000_000
    assert f", after {result.samples} of 1000000 samples in " in result.message
    assert told[-1] == pytest.approx(result.length, abs=1e-6)
    again = plan(*read_request(to_document(result, "gap"), problem.map))
    assert (again.path, again.samples) == (result.path, result.samples)


def test_a_path_is_found_before_it_is_smoothed_and_ready_afterwards(planner, monkeypatch):
    def slowly(*arguments, **options):
        time.sleep(0.05)
        return smooth(*arguments, **options)

    monkeypatch.setattr("dubins_rrt_ros.planning.search.smoothing.smooth", slowly)
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings(planner, samples=200, goal_bias=0.5))
    assert 0 < result.time_to_found < result.time_to_first - 0.05


@pytest.mark.parametrize("informed", [False, True])
def test_a_cancellation_waits_for_no_more_than_a_step(planner, informed):
    """Each step takes some milliseconds, whether it expands poses, smooths a path or draws samples."""
    times = []

    def cancel():
        times.append(time.perf_counter())
        return False

    plan(Problem(walled_with_a_gap(), VEHICLE, START, GOAL), settings(planner, informed=informed), cancel=cancel)
    if SCALE == 1:
        assert np.median(np.diff(times[2:])) < 0.02
        assert np.sort(np.diff(times[2:]))[-2:].min() < 0.3  # of a machine that may be busy


def test_the_sample_budget_ends_it(planner):
    result = plan(hard_to_reach(), settings(planner, samples=200, informed=False))
    assert_refused(result, Status.TIMEOUT, "200 of 200 samples", "allow more samples")
    assert result.samples == 200


@needs_compiled
def test_a_search_without_a_path_goes_on_beyond_the_budget(planner, monkeypatch):
    """Until the time is over, by a clock that goes on with each look at it."""
    looks = itertools.count()
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: next(looks) / 10_000)
    result = plan(hard_to_reach(), settings(planner, samples=200, planning_time=0.2))
    assert_refused(result, Status.TIMEOUT, "planning_time 0.2 s", "allow more time")
    assert result.samples > 200
    assert f"{result.samples} samples drawn" in result.message


def test_cancelled_before_the_first_path(planner):
    asked = []
    result = plan(hard_to_reach(), settings(planner, informed=False), cancel=lambda: asked.append(1) or len(asked) == 4)
    assert_refused(result, Status.CANCELLED, "Cancelled before a first path", "samples drawn")
    assert result.cancelled
    assert len(asked) == 4
    assert 0 < result.samples < settings(planner).samples


def test_cancelled_while_hybrid_a_star_seeks_the_first_path(planner):
    asked = []
    result = plan(hard_to_reach(), settings(planner), cancel=lambda: asked.append(1) or len(asked) == 4)
    assert_refused(result, Status.CANCELLED, "Cancelled before a first path: 0 of", "samples drawn")
    assert (len(asked), result.samples, len(result.tree)) == (4, 0, 1)


def test_cancelled_at_once_before_the_clearance_field_is_computed(planner, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.planner.world_of", None)
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings(planner), cancel=lambda: True)
    assert_refused(result, Status.CANCELLED, "Cancelled before a first path: 0 of", "samples drawn, 1 tree node, ")
    assert (result.samples, len(result.tree), result.map_time) == (0, 1, 0.0)


def test_cancelled_while_the_clearance_field_was_computed(planner, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.planner.explain", None)
    asked = []
    result = plan(Problem(walled(), VEHICLE, START, GOAL), settings(planner), cancel=lambda: asked.append(1) or len(asked) == 2)
    assert_refused(result, Status.CANCELLED)
    assert result.map_time > 0


def test_prepare_does_what_does_not_depend_on_the_request(monkeypatch):
    from dubins_rrt_ros.planning.collision import clearance as module

    world = prepare(walled(-1), VEHICLE, allow_unknown=True)
    for name in ("grid_clearance", "free_squares"):
        monkeypatch.setattr(module, name, None)
    monkeypatch.setattr(module.ndimage, "label", None)
    assert world.field.components(VEHICLE.robot_radius).max() == 1
    result = plan(Problem(world, start=START, goal=GOAL), settings("rrt_star", samples=1))
    assert result.map_time < 0.01


def test_cancelled_after_the_first_path_gives_the_best_so_far():
    found = []
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings("rrt_star"), cancel=lambda: bool(found),
                  on_progress=lambda progress: found.append(progress.length) if progress.length else None)
    assert result.status == Status.NONE
    assert result.cancelled
    assert result.length == pytest.approx(found[-1])
    assert result.samples < settings("rrt_star").samples
    assert "cancelled " in result.message


def test_progress_tells_of_every_better_path():
    told, snapshots = [], []

    def on_progress(progress):
        told.append(progress)
        snapshots.append(progress.snapshot())

    problem = Problem(walled_with_a_gap(), VEHICLE, START, GOAL)
    result = plan(problem, settings("rrt_star", preferred_clearance=0.0), on_progress=on_progress)
    assert result.status == Status.NONE
    assert " so far" not in result.message
    better = [progress.length for progress in told if progress.improved]
    assert len(better) >= 1
    assert better == sorted(better, reverse=True)
    assert len(set(better)) == len(better)
    assert better[-1] == pytest.approx(result.length, abs=1e-5)
    samples = [progress.samples for progress in told]
    assert samples == sorted(samples)
    for progress, snapshot in zip(told, snapshots, strict=True):
        assert snapshot.samples <= progress.samples  # a path is told with the search as it was when that was audited
        assert snapshot.samples == progress.samples or (snapshot.path and not progress.improved)
        assert (snapshot.path is None) == (progress.length is None)
        if snapshot.path:
            so_far = "" if snapshot.message == result.message else " so far"  # the last one may be the answer itself
            assert snapshot.message.startswith(f"Path of {snapshot.length:.2f} m{so_far}, at most ")
            assert snapshot.audit.ok
            assert audit_path(snapshot.path, problem).ok
            assert snapshot.length == pytest.approx(progress.length)
            assert isinstance(snapshot.tree, Tree)


def walled_with_a_gap():
    grid = walled()
    data = np.array(grid.data)
    data[30:, :] = 0
    return GridMap(data, grid.resolution, grid.origin)


def test_a_snapshot_without_a_path_says_that_the_search_goes_on(planner, monkeypatch):
    now = iter(np.arange(1e6) / 10)
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: next(now))
    messages = []
    plan(hard_to_reach(), settings(planner, samples=20, planning_time=1000.0),
         on_progress=lambda progress: messages.append(progress.snapshot().message))
    assert messages
    assert all(message.startswith("No path so far: ") for message in messages)


def test_progress_of_rrt_has_one_path():
    told = []
    result = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings("rrt"), on_progress=told.append)
    assert [progress.length for progress in told if progress.improved] == [pytest.approx(result.length)]


@needs_compiled
def test_the_reasons_look_at_the_time(monkeypatch):
    """A clock that moves on by a millisecond with each look ends them in the middle; the proof stands without its figures."""
    grid = np.zeros((2000, 2000), np.int8)
    grid[:, 1000:1010] = 100
    problem = Problem(prepare(GridMap(grid, 0.01, (-10.0, -10.0, 0.0)), VEHICLE), start=START, goal=GOAL)
    now = iter(np.arange(1e6) / 1000)
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: next(now))
    for limit, words in ((0.02, "allow more time to be told where"), (10.0, "no robot_radius is small enough")):
        result = plan(problem, settings("rrt_star", planning_time=limit))
        assert_refused(result, Status.NO_VALID_PATH, "walls", words)
        assert result.planning_time < limit + 0.01


@needs_compiled
def test_smoothing_looks_at_the_time_before_the_first_change():
    """Where a path has very many poses, of which most are not needed."""
    grid_map, looks = empty_map(), []
    field = prepare(grid_map, VEHICLE).field
    xs = np.linspace(-8.0, 8.0, 20_000)
    path = Path(np.column_stack([xs, np.zeros_like(xs), np.zeros_like(xs)]), np.zeros(len(xs), np.int8),
                np.column_stack([np.zeros_like(xs), np.full_like(xs, xs[1] - xs[0]), np.zeros_like(xs)]), 0.5)

    def look():
        looks.append(0)
        return len(looks) > 3

    smoothed = smooth(path, VEHICLE, field, np.random.default_rng(1), True, Work(look))
    assert 1000 < len(smoothed.words) < len(path.words)
    assert smoothed.length == pytest.approx(16.0)


@needs_compiled
def test_a_simple_path_stays_the_answer_where_there_is_no_time_to_simplify_a_cheaper_one(monkeypatch):
    simplified, simpler = Search.simplified, []

    def hurried(search, path, work):
        if simpler:
            work.interrupting(lambda: True)()  # as the time does
            return path
        simpler.append(simplified(search, path, work))
        return simpler[0]

    def is_due(call, search):
        return call._best is None or (not simpler and search.samples >= 1000)

    monkeypatch.setattr(Search, "simplified", hurried)
    monkeypatch.setattr("dubins_rrt_ros.planning.planner._Call._is_audit_due", is_due)  # whatever an audit takes here
    problem = Problem(load_map("forest"), VEHICLE, (1.2, 1.2, 0.79), (18.8, 16.8, 0.79))
    result = plan(problem, settings("rrt_star", seed=3), on_progress=lambda _: None)
    assert len(simpler) == 1 and result.path == simpler[0]
    assert result.samples < result.settings.samples
    monkeypatch.undo()
    again = plan(problem, replace(result.settings, work_limits=result.work))
    assert again.path == result.path


def test_work_is_interrupted_by_its_time_and_not_by_its_limit():
    ended, limited = Work(lambda: True), Work(limit=1)
    limited.done += 1
    assert (ended.is_over, limited.is_over) == (True, True)
    assert (ended.is_interrupted, limited.is_interrupted) == (True, False)
