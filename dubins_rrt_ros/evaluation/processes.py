"""Worker processes for campaigns and for the paper: a task that kills its process, or never ends, is reported."""

import contextlib
import signal
import time
from collections.abc import Callable, Generator, Iterable
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

_CONTEXT = get_context("spawn")


def run_in_processes(work: Callable[[Any], Any], tasks: Iterable[Any], jobs: int, limit: float,
            when_lost: Callable[[Any, str], Any]) -> Generator[Any, None, None]:
    """Yield what `work` returns for each task, in any order, from `jobs` processes.

    Args:
        work: a function of a module.
        limit: time limit of a task [s]; beyond it the process is ended.
        when_lost: makes the result of a task whose process died or was ended, from it and a sentence on what happened.
    """
    tasks = iter(tasks)
    workers = [_Worker(work, limit, task) for task in islice(tasks, jobs)]
    try:
        while workers:
            ready = wait([worker.pipe for worker in workers], timeout=1.0)
            for worker in [worker for worker in workers if worker.pipe in ready or worker.is_late]:
                done, result = worker.receive() if worker.pipe in ready else (False, f"no answer within {limit:g} s")
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
        task: the task under way.
        pipe: the connection that is ready when there is a result, or the process has died.
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
        """True if the task takes longer than the limit."""
        return time.monotonic() > self._due

    def receive(self) -> tuple[bool, Any]:
        """Return True and the result, or False and what happened."""
        try:
            return True, self.pipe.recv()
        except (EOFError, ConnectionError):
            self._process.join()
            return False, f"the process died with status {self._process.exitcode}"

    def next(self, task: Any, alive: bool) -> "_Worker":
        """Return the worker for the next task: this one, or a fresh one if it is not alive."""
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
        with contextlib.suppress(ConnectionError):  # of a process that has died; receive() says so
            self.pipe.send(task)


def _serve(work: Callable[[Any], Any], pipe: Connection) -> None:
    """Answer until the other end is closed. Ctrl-C on a terminal reaches this process too, and ends it without a trace."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with contextlib.suppress(EOFError, ConnectionError):
        while True:
            pipe.send(work(pipe.recv()))
