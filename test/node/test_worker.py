"""The worker: newest request wins, anytime reports, cancel and close. Plain threads, no ROS."""

import queue
import threading
import time
from types import SimpleNamespace

import pytest

from dubins_rrt_ros.node.worker import IMPROVEMENT_INTERVAL, Request, Worker

SOON = 5.0


class Planning:
    """Stands in for plan(): it shows what it was called with and ends when told to or cancelled."""

    def __init__(self):
        self.calls = queue.Queue()

    def __call__(self, problem, settings, *, cancel, on_progress):
        call = SimpleNamespace(problem=problem, cancel=cancel, on_progress=on_progress,
                               thread=threading.current_thread(), end=threading.Event())
        self.calls.put(call)
        while not call.end.wait(0.001) and not cancel():
            pass
        return SimpleNamespace(path="final", of=problem, cancelled=cancel())


@pytest.fixture
def planning():
    return Planning()


@pytest.fixture
def reports():
    return queue.Queue()


@pytest.fixture
def worker(planning, reports):
    worker = Worker(reports.put, planning)
    yield worker
    assert worker.close(SOON)


def request(number):
    return Request(number, f"problem {number}", "settings")


def progress(improved, path="better"):
    return SimpleNamespace(improved=improved, snapshot=lambda: SimpleNamespace(path=path))


def test_a_request_is_planned_in_another_thread_and_its_end_reported(worker, planning, reports):
    worker.submit(request(1))
    call = planning.calls.get(timeout=SOON)
    assert call.thread is not threading.current_thread()
    call.end.set()
    report = reports.get(timeout=SOON)
    assert (report.request_id, report.plan.of, report.last, report.error) == (1, "problem 1", True, None)


def test_the_newest_request_cancels_the_one_that_is_planned(worker, planning, reports):
    worker.submit(request(1))
    first = planning.calls.get(timeout=SOON)
    worker.submit(request(2))
    second = planning.calls.get(timeout=SOON)
    assert first.cancel() and not second.cancel()
    second.end.set()
    assert [reports.get(timeout=SOON).request_id for _ in range(2)] == [1, 2]


def test_of_many_requests_that_wait_only_the_newest_is_planned(reports):
    begun, gate = threading.Event(), threading.Event()

    def plan(problem, settings, *, cancel, on_progress):
        begun.set()
        gate.wait(SOON)
        return SimpleNamespace(path=None)

    worker = Worker(reports.put, plan)
    worker.submit(request(1))
    assert begun.wait(SOON)
    for number in range(2, 100):
        worker.submit(request(number))
    gate.set()
    assert [reports.get(timeout=SOON).request_id for _ in range(2)] == [1, 99]
    assert worker.close(SOON)
    assert reports.empty()


def test_cancel_ends_the_present_request_and_the_next_is_not_affected(worker, planning, reports):
    worker.submit(request(1))
    planning.calls.get(timeout=SOON)
    worker.cancel()
    assert reports.get(timeout=SOON).plan.cancelled
    worker.submit(request(2))
    call = planning.calls.get(timeout=SOON)
    call.end.set()
    assert not reports.get(timeout=SOON).plan.cancelled


def test_cancel_without_a_request_does_nothing(worker, planning, reports):
    worker.cancel()
    worker.submit(request(1))
    call = planning.calls.get(timeout=SOON)
    assert not call.cancel()
    call.end.set()
    assert reports.get(timeout=SOON).request_id == 1


def test_the_first_path_is_reported_at_once_and_later_ones_when_the_interval_is_over(worker, planning, reports):
    worker.submit(request(1))
    call = planning.calls.get(timeout=SOON)
    call.on_progress(progress(improved=False))
    assert reports.empty()
    first = time.monotonic()
    call.on_progress(progress(improved=True))
    assert not reports.get(timeout=SOON).last
    call.on_progress(progress(improved=True))
    assert reports.empty()
    while reports.empty():  # the improvement is due by itself, though nothing better comes
        call.on_progress(progress(improved=False))
        assert time.monotonic() - first < SOON
    assert time.monotonic() - first >= IMPROVEMENT_INTERVAL
    reports.get()
    call.end.set()
    assert reports.get(timeout=SOON).last


def test_no_snapshot_is_made_where_nothing_improved_or_the_request_is_cancelled(worker, planning, reports):
    worker.submit(request(1))
    call = planning.calls.get(timeout=SOON)
    call.on_progress(SimpleNamespace(improved=False))  # it has no snapshot to call
    worker.cancel()
    call.on_progress(SimpleNamespace(improved=True))
    assert reports.get(timeout=SOON).last


def test_a_snapshot_without_a_path_is_no_news(worker, planning, reports):
    worker.submit(request(1))
    call = planning.calls.get(timeout=SOON)
    call.on_progress(progress(improved=True, path=None))
    call.end.set()
    assert reports.get(timeout=SOON).last


def test_a_defect_is_reported_with_its_trace_and_the_thread_lives_on(reports):
    def plan(problem, settings, *, cancel, on_progress):
        if problem == "problem 1":
            raise ZeroDivisionError("a defect")
        return SimpleNamespace(path=None)

    worker = Worker(reports.put, plan)
    worker.submit(request(1))
    report = reports.get(timeout=SOON)
    assert report.last and report.plan is None
    assert isinstance(report.error, ZeroDivisionError) and report.error.__traceback__ is not None
    worker.submit(request(2))
    assert reports.get(timeout=SOON).error is None
    assert worker.close(SOON)


def test_close_cancels_ends_the_thread_and_delivers_nothing_more(planning, reports):
    worker = Worker(reports.put, planning)
    worker.submit(request(1))
    call = planning.calls.get(timeout=SOON)
    assert worker.close(SOON)
    assert not call.thread.is_alive()
    assert reports.empty()


def test_close_tells_of_a_planner_that_does_not_heed_its_cancellation(reports):
    begun, end = threading.Event(), threading.Event()

    def plan(problem, settings, *, cancel, on_progress):
        begun.set()
        end.wait(SOON)
        return SimpleNamespace(path=None)

    worker = Worker(reports.put, plan)
    worker.submit(request(1))
    assert begun.wait(SOON)
    assert not worker.close(0.01)
    end.set()
    assert worker.close(SOON)
    assert reports.empty()
