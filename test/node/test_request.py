"""A request as a worker serves it: improvements as they come, cancellation, a map that is still prepared. No ROS, no mocks."""

import itertools
import threading
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

from dubins_rrt_ros.node import request as module
from dubins_rrt_ros.node.request import IMPROVEMENT_INTERVAL, PlanRequest, Refusal, Route, _Throttle
from dubins_rrt_ros.planning import GridMap, PlanError, Problem, Progress, Settings, Status, Vehicle, plan, prepare

ENDLESS = {"samples": 10_000_000, "planning_time": 600.0, "seed": 1}


@pytest.fixture(scope="module")
def problem():
    cells = np.zeros((100, 100), dtype=np.int8)
    cells[40:60, 40:60] = 100
    return Problem(GridMap(cells, 0.1), Vehicle(), (1.5, 5.0, 0.0), (8.5, 5.0, 0.5))


@pytest.fixture
def request_for(problem):
    """A function that makes a request whose map is prepared."""
    def make(wanted=problem, **settings):
        options = {"preferred_clearance": 0.0, **settings}
        return PlanRequest(*route_of(wanted), Settings(**options), in_future(prepare(wanted.map, wanted.vehicle)))
    return make


def route_of(problem):
    """The arguments of a request for this problem, whose poses are known."""
    return lambda: Route(problem.start, problem.goal), lambda start, goal: replace(problem, start=start, goal=goal)


def in_future(world):
    future = Future()
    future.set_result(world)
    return future


@pytest.fixture
def clock(monkeypatch):
    """The time that the throttle sees, in a list of one."""
    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    return now


def never():
    return False


def test_a_request_is_answered_as_the_planner_answers_it(request_for):
    reported = []
    answer = request_for(samples=300, planning_time=60.0, seed=1).serve(reported.append, never)
    assert (answer.status, answer.audit.ok, answer.samples, answer.cancelled) == (Status.NONE, True, 300, False)
    assert all(report.path is not None and report.audit.ok for report in reported)
    lengths = [plan.length for plan in (*reported, answer)]
    assert lengths == sorted(lengths, reverse=True)


def test_the_first_path_is_reported_though_the_search_goes_on_and_nothing_after_a_cancellation(request_for):
    reported = []
    answer = request_for(**ENDLESS).serve(reported.append, lambda: bool(reported))
    assert answer.cancelled
    assert answer.path is not None
    assert len(reported) == 1
    assert reported[0].samples <= answer.samples < ENDLESS["samples"]


def test_nothing_is_reported_without_a_path(request_for, problem):
    reported = []
    answer = request_for(replace(problem, goal=(5.0, 5.0, 0.0)), samples=100, seed=1).serve(reported.append, never)
    assert (answer.status, reported) == (Status.GOAL_OCCUPIED, [])


def test_a_request_that_was_cancelled_before_is_not_planned(request_for):
    with pytest.raises(Refusal, match="Cancelled before a first path") as refusal:
        request_for(**ENDLESS).serve(pytest.fail, lambda: True)
    assert refusal.value.status is Status.CANCELLED


def test_a_request_waits_until_its_map_is_prepared(problem):
    world, waiting = Future(), threading.Event()
    answers = []

    def not_cancelled():
        waiting.set()
        return False

    request = PlanRequest(*route_of(problem), Settings(samples=100, planning_time=60.0, seed=1), world)
    serving = threading.Thread(target=lambda: answers.append(request.serve(lambda plan: None, not_cancelled)))
    serving.start()
    assert waiting.wait(5.0)
    assert answers == []
    world.set_result(prepare(problem.map, problem.vehicle))
    serving.join(60.0)
    assert answers[0].status is Status.NONE


def test_a_request_can_be_cancelled_while_its_map_is_prepared(problem):
    asked = itertools.count()
    with pytest.raises(Refusal) as refusal:
        PlanRequest(*route_of(problem), Settings(), Future()).serve(pytest.fail, lambda: next(asked) > 2)
    assert refusal.value.status is Status.CANCELLED


def test_a_defect_in_the_planner_is_raised(request_for, monkeypatch):
    def fail(*args, **kwargs):
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr(module, "plan", fail)
    with pytest.raises(ZeroDivisionError, match="a defect"):
        request_for().serve(pytest.fail, never)


def test_an_answer_is_checked_where_that_is_wanted(request_for, monkeypatch):
    genuine = module.plan
    monkeypatch.setattr(module, "plan", lambda *args, **more: replace(genuine(*args, **more), message=""))
    request = request_for(samples=10, planning_time=60.0, seed=1)
    assert request.serve(None, never).message == ""
    with pytest.raises(PlanError, match="the message is ''"):
        replace(request, check_invariants=True).serve(None, never)


def test_an_improvement_that_breaks_an_invariant_ends_the_request(request_for, monkeypatch):
    """And what it would have answered is not reported."""
    def report_broken(problem, settings, *, cancel, on_progress, seed_path):
        answer = plan(problem, settings)
        on_progress(Progress(1, 0.0, answer.length, True, lambda: replace(answer, audit=None), lambda: answer.tree))
        return answer

    monkeypatch.setattr(module, "plan", report_broken)
    request = replace(request_for(samples=10, planning_time=60.0, seed=1), check_invariants=True)
    with pytest.raises(PlanError, match="its audit is None"):
        request.serve(pytest.fail, never)


def test_the_search_begins_with_the_seed_path(request_for):
    first = request_for(samples=100, planning_time=60.0, seed=1).serve(None, never)
    request = replace(request_for(planner="rrt", planning_time=60.0, seed=2), seed_path=first.path)
    answer = request.serve(None, never)
    assert answer.found_by == "seed_path" and answer.length <= first.length


def test_improvements_are_not_reported_before_the_interval_is_over(request_for, clock):
    reported = []
    answer = request_for(samples=300, planning_time=60.0, seed=1).serve(reported.append, never)  # while the clock stands still
    assert len(reported) == 1
    assert answer.length <= reported[0].length and answer.samples > reported[0].samples


def test_the_throttle_lets_the_first_improvement_pass_at_once(clock):
    throttle = _Throttle(IMPROVEMENT_INTERVAL)
    assert not throttle.lets_pass(False)
    assert throttle.lets_pass(True)


def test_the_throttle_keeps_a_later_improvement_until_the_interval_is_over(clock):
    throttle = _Throttle(1.0)
    assert throttle.lets_pass(True)
    assert not throttle.lets_pass(True)
    clock[0] += 0.5
    assert not throttle.lets_pass(False)
    clock[0] += 0.5
    assert throttle.lets_pass(False)  # it is due by itself, though nothing better comes
    clock[0] += 10.0
    assert not throttle.lets_pass(False)  # and once alone


def test_the_throttle_lets_an_improvement_after_a_pause_pass_at_once(clock):
    throttle = _Throttle(1.0)
    assert throttle.lets_pass(True)
    clock[0] += 1.5
    assert not throttle.lets_pass(False)
    assert throttle.lets_pass(True)
