"""The processes of `dubins_rrt campaign`: each works at one task after the other, and what kills it or never ends is noticed."""

import contextlib
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

_CONTEXT = get_context("spawn")


def results(work: Callable[[Any], Any], tasks: Iterable[Any], jobs: int, limit: float,
            when_lost: Callable[[Any, str], Any]) -> Iterator[Any]:
    """What `work` makes of each task, in any order, in `jobs` processes.

    Args:
        work: a function of a module.
        limit: a task that takes longer is given up, and its process ended [s].
        when_lost: makes the result of a task, and of a sentence on what happened, where its process died or was ended.
    """
    tasks = iter(tasks)
    workers = [_Worker(work, limit, task) for task in islice(tasks, jobs)]
    try:
        while workers:
            ready = wait([worker.pipe for worker in workers], timeout=1.0)
            for worker in [worker for worker in workers if worker.pipe in ready or worker.is_late]:
                done, result = worker.take() if worker.pipe in ready else (False, f"no answer within {limit:g} s")
                yield result if done else when_lost(worker.task, result)
                workers.remove(worker)
                workers += [worker.next(task, alive=done) for task in islice(tasks, 1)]
                if worker not in workers:
                    worker.end()
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A process with a task.

    Attributes:
        task: what it works at.
        pipe: is ready when the result is there, or the process has died.
    """

    def __init__(self, work: Callable[[Any], Any], limit: float, task: Any):
        self._work, self._limit = work, limit
        self.pipe, theirs = _CONTEXT.Pipe()
        self._process = _CONTEXT.Process(target=_serve, args=(work, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self._give(task)

    @property
    def is_late(self) -> bool:
        """Whether it takes longer than the limit."""
        return time.monotonic() > self._due

    def take(self) -> tuple[bool, Any]:
        """Whether there is a result, and that, or what happened."""
        try:
            return True, self.pipe.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            return False, f"the process died with status {self._process.exitcode}"

    def next(self, task: Any, alive: bool) -> "_Worker":
        """The worker for the next task: this one, or where it is not alive a fresh one."""
        if not alive:
            return _Worker(self._work, self._limit, task)
        self._give(task)
        return self

    def end(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join()
        self.pipe.close()

    def _give(self, task: Any) -> None:
        self.task, self._due = task, time.monotonic() + self._limit
        with contextlib.suppress(ConnectionError):  # of a process that has died; take() tells
            self.pipe.send(task)


def _serve(work: Callable[[Any], Any], pipe: Connection) -> None:
    """Answer until the other end is closed. Ctrl-C on a terminal reaches this process too, and ends it without a trace."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            pipe.send(work(pipe.recv()))
