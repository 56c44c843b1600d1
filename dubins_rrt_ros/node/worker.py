"""A thread that does one job after the other. It knows nothing of ROS."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

#: Called with a function that tells whether the job was cancelled; its result, or what it raises, is the outcome.
Job = Callable[[Callable[[], bool]], Any]
#: Called with the outcome of a job: its result, or the exception that ended it.
Done = Callable[[Any], None]


class Worker:
    """Does jobs in a thread of its own, in the order in which they come.

    Every job is begun, a cancelled one too, so that each has an outcome; it should end soon once it is cancelled. `done` is
    called from the worker's thread.
    """

    def __init__(self, name: str):
        self._state = threading.Condition()
        self._jobs: deque[tuple[Job, Done, threading.Event]] = deque()  # the first is the one that is done
        self._closed = False
        # A daemon: should a job not heed its cancellation, the process can end nevertheless.
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, job: Job, done: Done) -> None:
        """Do this after what was submitted before."""
        with self._state:
            self._jobs.append((job, done, threading.Event()))
            self._state.notify()

    def cancel(self) -> None:
        """Cancel all jobs that were submitted."""
        with self._state:
            for _, _, cancelled in self._jobs:
                cancelled.set()

    def close(self, timeout: float) -> bool:
        """Cancel all, begin nothing more and end the thread; False where it did not end within `timeout` [s]."""
        with self._state:
            self._closed = True
            self._state.notify()
        self.cancel()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while self._wait():
            self._do_next()
            with self._state:
                self._jobs.popleft()

    def _do_next(self) -> None:
        # In a frame of its own: while the worker waits, nothing keeps the last job's map alive.
        job, done, cancelled = self._jobs[0]
        done(_outcome(job, cancelled))

    def _wait(self) -> bool:
        """Wait for a job; False at the end."""
        with self._state:
            self._state.wait_for(lambda: self._closed or self._jobs)
            return not self._closed


def _outcome(job: Job, cancelled: threading.Event) -> Any:
    try:
        return job(cancelled.is_set)
    except Exception as error:  # a defect must not end the thread; the receiver tells of it
        return error
