"""Work beside the search: each thing is computed once, by whoever gets to it first."""

import threading

import pytest

from dubins_rrt_ros.planning.search import background as beside


@pytest.fixture(params=[1, 2], ids=["one core", "two cores"])
def work(request, monkeypatch):
    monkeypatch.setattr(beside, "cores", lambda: request.param)
    return beside.Beside()


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


def test_who_asks_before_the_computation_has_begun_does_it_at_once(monkeypatch):
    monkeypatch.setattr(beside, "cores", lambda: 2)
    work, begun, go_on, computed_by = beside.Beside(), threading.Event(), threading.Event(), []

    def wait():
        begun.set()
        return go_on.wait(60)

    first = work.start(wait)
    second = work.start(lambda: computed_by.append(threading.current_thread()) or 5)
    third = work.start(lambda: 6)
    assert begun.wait(60)
    assert [second(), second()] == [5, 5]
    assert computed_by == [threading.current_thread()]
    go_on.set()
    assert (first(), third()) == (True, 6)
