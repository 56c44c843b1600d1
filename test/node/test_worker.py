"""The worker: one job after the other, outcomes, cancel and close. Plain threads, no ROS."""

import gc
import queue
import threading
import weakref

import pytest

from dubins_rrt_ros.node.worker import Worker

SOON = 5.0


class Steps:
    """Work that ends when it is told to or cancelled, and shows how far it is."""

    def __init__(self, name):
        self.name = name
        self.begun, self.end = threading.Event(), threading.Event()
        self.thread = None

    def __call__(self, cancelled):
        self.thread = threading.current_thread()
        self.begun.set()
        while not self.end.wait(0.001) and not cancelled():
            pass
        return f"{self.name} {'cancelled' if cancelled() else 'done'}"


@pytest.fixture
def outcomes():
    return queue.Queue()


@pytest.fixture
def worker():
    worker = Worker("worker under test")
    yield worker
    assert worker.close(SOON)


def begun(job):
    assert job.begun.wait(SOON), f"{job.name} was not begun"
    return job


def test_a_job_is_done_in_another_thread_and_its_outcome_given(worker, outcomes):
    job = Steps("one")
    worker.submit(job, outcomes.put)
    assert begun(job).thread.name == "worker under test"
    assert outcomes.empty()
    job.end.set()
    assert outcomes.get(timeout=SOON) == "one done"


def test_the_outcome_is_given_in_the_worker_s_thread(worker, outcomes):
    worker.submit(lambda cancelled: None, lambda outcome: outcomes.put(threading.current_thread().name))
    assert outcomes.get(timeout=SOON) == "worker under test"


def test_jobs_are_done_one_at_a_time_in_the_order_in_which_they_come(worker, outcomes):
    jobs = [Steps(str(number)) for number in range(50)]
    for job in jobs:
        worker.submit(job, outcomes.put)
    for job, later in zip(jobs, [*jobs[1:], None], strict=True):
        begun(job)
        assert later is None or not later.begun.is_set()
        job.end.set()
        assert outcomes.get(timeout=SOON) == f"{job.name} done"


def test_cancel_all_reaches_the_job_that_is_done_and_those_that_wait_and_each_has_its_outcome(worker, outcomes):
    jobs = [Steps(name) for name in ("one", "two", "three")]
    for job in jobs:
        worker.submit(job, outcomes.put)
    begun(jobs[0])
    worker.cancel_all()
    assert [outcomes.get(timeout=SOON) for _ in jobs] == ["one cancelled", "two cancelled", "three cancelled"]


def test_what_is_submitted_after_a_cancellation_is_not_cancelled(worker, outcomes):
    first, second = Steps("first"), Steps("second")
    worker.submit(first, outcomes.put)
    begun(first)
    worker.cancel_all()
    worker.submit(second, outcomes.put)
    assert outcomes.get(timeout=SOON) == "first cancelled"
    begun(second).end.set()
    assert outcomes.get(timeout=SOON) == "second done"


def test_cancel_all_without_a_job_does_nothing(worker, outcomes):
    worker.cancel_all()
    job = Steps("one")
    worker.submit(job, outcomes.put)
    begun(job).end.set()
    assert outcomes.get(timeout=SOON) == "one done"


@pytest.mark.parametrize("cancelled", range(3))
def test_cancelling_one_job_leaves_two_others_running(worker, outcomes, cancelled):
    jobs = [Steps(name) for name in ("one", "two", "three")]
    handles = [worker.submit(job, outcomes.put) for job in jobs]
    begun(jobs[0])
    handles[cancelled].cancel()
    for number, job in enumerate(jobs):
        begun(job)
        if number != cancelled:
            assert outcomes.empty()
            job.end.set()
        ending = "cancelled" if number == cancelled else "done"
        assert outcomes.get(timeout=SOON) == f"{job.name} {ending}"


def test_cancelling_a_job_that_has_ended_does_nothing(worker, outcomes):
    handle = worker.submit(lambda cancelled: "one", outcomes.put)
    assert outcomes.get(timeout=SOON) == "one"
    handle.cancel()
    job = Steps("two")
    worker.submit(job, outcomes.put)
    begun(job).end.set()
    assert outcomes.get(timeout=SOON) == "two done"


def test_a_handle_keeps_nothing_of_its_job_alive(worker, outcomes):
    job = Steps("one")
    handle = worker.submit(job, outcomes.put)
    begun(job).end.set()
    assert outcomes.get(timeout=SOON) == "one done"
    worker.submit(lambda cancelled: None, outcomes.put)  # its begin is the end of what was kept of the last
    outcomes.get(timeout=SOON)
    kept = weakref.ref(job)
    del job
    gc.collect()
    assert kept() is None
    handle.cancel()


def test_a_defect_is_the_outcome_with_its_trace_and_the_thread_lives_on(worker, outcomes):
    def fail(cancelled):
        raise ZeroDivisionError("a defect")

    worker.submit(fail, outcomes.put)
    error = outcomes.get(timeout=SOON)
    assert isinstance(error, ZeroDivisionError)
    assert error.__traceback__ is not None
    worker.submit(lambda cancelled: "fine", outcomes.put)
    assert outcomes.get(timeout=SOON) == "fine"


def test_jobs_from_many_threads_are_all_done(worker, outcomes):
    def submit(number):
        for i in range(100):
            worker.submit(lambda cancelled, i=i: (number, i), outcomes.put)

    threads = [threading.Thread(target=submit, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    done = [outcomes.get(timeout=SOON) for _ in range(400)]
    for number in range(4):
        assert [i for who, i in done if who == number] == list(range(100))


def test_a_job_may_submit_another(worker, outcomes):
    def submit_another(cancelled):
        worker.submit(lambda cancelled: "inner", outcomes.put)
        return "outer"

    worker.submit(submit_another, outcomes.put)
    assert [outcomes.get(timeout=SOON) for _ in range(2)] == ["outer", "inner"]


def test_close_cancels_the_job_that_is_done_begins_no_other_and_ends_the_thread(outcomes):
    worker, job, waiting = Worker("closing"), Steps("one"), Steps("two")
    worker.submit(job, outcomes.put)
    worker.submit(waiting, outcomes.put)
    begun(job)
    assert worker.close(SOON)
    assert not job.thread.is_alive()
    assert not waiting.begun.is_set()
    assert outcomes.get_nowait() == "one cancelled"
    assert outcomes.empty()


def test_close_of_an_idle_worker_ends_its_thread_and_may_be_called_again():
    worker = Worker("idle")
    assert worker.close(SOON)
    assert worker.close(SOON)
    assert "idle" not in {thread.name for thread in threading.enumerate()}


def test_close_tells_of_a_job_that_does_not_heed_its_cancellation(outcomes):
    started, end = threading.Event(), threading.Event()

    def stubborn(cancelled):
        started.set()
        end.wait(SOON)

    worker = Worker("stubborn")
    worker.submit(stubborn, outcomes.put)
    assert started.wait(SOON)
    assert not worker.close(0.01)
    end.set()
    assert worker.close(SOON)
