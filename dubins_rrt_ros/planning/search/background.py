"""Work in the background, whose results do not depend on when or where they were computed."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import ParamSpec, TypeVar

Result = TypeVar("Result")
Parameters = ParamSpec("Parameters")


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class BackgroundExecutor:
    """Runs jobs on the other cores; a caller that waits for a job not yet started runs it itself.

    So no job waits for another, and any number of requests can share one executor. On a single core every job is run by the
    caller that asks for its result. A job must not change what its caller works on; kernels release the interpreter's lock.
    """

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None

    def start(self, function: Callable[Parameters, Result], *args: Parameters.args, **kwargs: Parameters.kwargs
              ) -> Callable[[], Result]:
        """Start `function(*args, **kwargs)`, and return a function that waits for the result and returns it each time."""
        if cores() == 1:
            return cache(lambda: function(*args, **kwargs))
        if self._pool is None:
            self._pool = ThreadPoolExecutor(max(1, cores() - 1), thread_name_prefix="dubins_rrt_background")
        future = self._pool.submit(function, *args, **kwargs)
        return cache(lambda: function(*args, **kwargs) if future.cancel() else future.result())

    def forget_threads(self) -> None:
        """Start new threads for the next jobs, as a forked process must: it has none of its parent's."""
        self._pool = None


#: The executor of this process.
BACKGROUND = BackgroundExecutor()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=BACKGROUND.forget_threads)
