"""Jobs in the background: each is run once, by whoever gets to it first."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

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
