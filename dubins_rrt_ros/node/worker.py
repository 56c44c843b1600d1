"""A thread that does one job after the other. It knows nothing of ROS."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

#: The work of a job: called with a function that returns True once the job is cancelled; its result, or what it raises, is the
#: outcome.
Work = Callable[[Callable[[], bool]], Any]
#: Called with the outcome of a job: its result, or the exception that ended it.
Done = Callable[[Any], None]


class Job:
    """A handle of what was submitted to a worker; it does not keep that alive."""

    def __init__(self):
        self._cancelled = threading.Event()

    def cancel(self) -> None:
        """Ask this job alone to end soon. One that waits is still begun, so that it has an outcome."""
        self._cancelled.set()

    def is_cancelled(self) -> bool:
        """Return True once the job was cancelled."""
        return self._cancelled.is_set()


class Worker:
    """Does jobs in a thread of its own, in the order in which they come.

    Every job is begun, a cancelled one too, so that each has an outcome; it should end soon once it is cancelled. `done` is
    called from the worker's thread.
    """

    def __init__(self, name: str):
        self._state = threading.Condition()
        self._jobs: deque[tuple[Job, Work, Done]] = deque()  # the first is the one that is done
        self._closed = False
        # A daemon: should a job ignore its cancellation, the process can end nevertheless.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, work: Work, done: Done) -> Job:
        """Do this after what was submitted before."""
        job = Job()
        with self._state:
            self._jobs.append((job, work, done))
            self._state.notify()
        return job

    def cancel_all(self) -> None:
        """Cancel every job that was submitted and has not ended."""
        with self._state:
            for job, _, _ in self._jobs:
                job.cancel()

    def close(self, timeout: float) -> bool:
        """Cancel all jobs, begin none and end the thread; False where it did not end within `timeout` [s]."""
        with self._state:
            self._closed = True
            self._state.notify()
        self.cancel_all()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while self._wait():
            self._do_next()
            with self._state:
                self._jobs.popleft()

    def _do_next(self) -> None:
        # In a frame of its own: while the worker waits, nothing keeps the last job's map alive.
        job, work, done = self._jobs[0]
        done(_outcome(work, job))

    def _wait(self) -> bool:
        """Wait for a job; False at the end."""
        with self._state:
            self._state.wait_for(lambda: self._closed or self._jobs)
            return not self._closed


def _outcome(work: Work, job: Job) -> Any:
    try:
        return work(job.is_cancelled)
    except Exception as error:  # a defect must not end the thread; the receiver reports it
        return error
