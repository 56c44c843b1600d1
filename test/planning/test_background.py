"""Jobs in the background: each is run once, by whoever gets to it first."""

import gc
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from support.cases import needs_compiled

from dubins_rrt_ros.planning import Problem, Settings, Vehicle, load_map, plan, prepare
from dubins_rrt_ros.planning._kernels.cost_to_go import CostToGoKernel
from dubins_rrt_ros.planning.search import background
from dubins_rrt_ros.planning.search.background import BackgroundExecutor


@pytest.fixture(params=[1, 2], ids=["one core", "two cores"])
def work(request, monkeypatch):
    monkeypatch.setattr(background, "cores", lambda: request.param)
    return BackgroundExecutor()


def test_the_answer_is_that_of_one_call_however_often_it_is_asked_for(work):
    calls = []

    def function(a, b):
        calls.append((a, b))
        return a - b

    answer = work.start(function, 7, 5)
    assert [answer(), answer(), answer()] == [2, 2, 2]
    assert calls == [(7, 5)]


def test_an_error_reaches_whoever_asks(work):
    answer = work.start(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        answer()


def test_who_asks_before_the_computation_has_started_does_it_at_once(monkeypatch):
    monkeypatch.setattr(background, "cores", lambda: 2)
    work, started, go_on, computed_by = BackgroundExecutor(), threading.Event(), threading.Event(), []

    def wait():
        started.set()
        return go_on.wait(60)

    first = work.start(wait)
    second = work.start(lambda: computed_by.append(threading.current_thread()) or 5)
    third = work.start(lambda: 6)
    assert started.wait(60)
    assert [second(), second()] == [5, 5]
    assert computed_by == [threading.current_thread()]
    go_on.set()
    assert (first(), third()) == (True, 6)


def test_jobs_that_wait_for_others_do_not_block_each_other(monkeypatch):
    """Two requests share the executor, each job of which asks for another one."""
    monkeypatch.setattr(background, "cores", lambda: 2)
    work = BackgroundExecutor()

    def request():
        inner = work.start(lambda: 1)
        outer = work.start(lambda: inner() + 1)
        return outer() + inner()

    requests = [work.start(request) for _ in range(20)]
    with ThreadPoolExecutor(4) as callers:
        assert list(callers.map(lambda result: result(), requests)) == [3] * 20


def test_a_forked_process_has_threads_of_its_own(monkeypatch):
    monkeypatch.setattr(background, "cores", lambda: 2)
    assert background.BACKGROUND.start(lambda: 1)() == 1
    background.BACKGROUND.forget_threads()
    assert background.BACKGROUND.start(threading.get_ident)() > 0


def test_a_job_that_is_cancelled_before_it_begins_is_left_out(monkeypatch):
    monkeypatch.setattr(background, "cores", lambda: 2)
    work, go_on, calls = BackgroundExecutor(), threading.Event(), []
    first = work.start(go_on.wait, 60)
    second = work.start(calls.append, 2)
    second.cancel()
    go_on.set()
    assert first() and work.start(lambda: True)()  # which the same thread runs, after the second
    first.cancel()
    assert calls == [] and first()


@needs_compiled
@pytest.mark.parametrize("preferred_clearance", [0.0, -1.0])
@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_what_a_request_leaves_behind_does_not_wait_for_the_garbage_collector(planner, preferred_clearance):
    """Its arrays are large, and many requests come before the collector does."""
    world = prepare(load_map("maze"), Vehicle())
    problem = Problem(world, start=(1.5, 2.0, 1.57), goal=(13.5, 10.5, 1.57))
    gc.collect()
    gc.disable()
    try:
        before = kernels_alive()
        for seed in range(3):
            plan(problem, Settings(planner=planner, samples=100, seed=seed, preferred_clearance=preferred_clearance))
        while kernels_alive() > before:  # as long as something is under way in the background
            time.sleep(0.01)
    finally:
        gc.enable()


def kernels_alive():
    return sum(isinstance(alive, CostToGoKernel) for alive in gc.get_objects())
