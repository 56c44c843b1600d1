"""Work in the background, whose results do not depend on when or where they were computed."""

import os
import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import suppress
from functools import cache
from typing import Generic, ParamSpec, TypeVar

Result = TypeVar("Result")
Parameters = ParamSpec("Parameters")


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class BackgroundJob(Generic[Result]):
    """A job in the background; called, it waits for the result and returns it, each time.

    Args:
        compute: computes the result.
        future: of the job, or None where it is left to who asks for its result.
    """

    def __init__(self, compute: Callable[[], Result], future: "Future[Result] | None"):
        self._future = future
        self._result = cache(lambda: compute() if future is None or future.cancel() else future.result())

    def __call__(self) -> Result:
        """Wait for the result, or compute it."""
        return self._result()

    @property
    def is_done(self) -> bool:
        """True if the result is there."""
        return self._result.cache_info().currsize > 0 or (self._future is not None and self._future.done()
                                                          and not self._future.cancelled())

    def cancel(self) -> None:
        """Leave the job out unless it has begun: nobody will ask for its result."""
        if self._future is not None:
            self._future.cancel()

    def wait(self, seconds: float) -> bool:
        """Wait for so long; return True if the result is there, or is left to who asks for it."""
        return self._future is None or self._future.cancelled() or bool(wait_for([self._future], seconds).done)


class BackgroundExecutor:
    """Runs jobs on the other cores; a caller that waits for a job not yet started runs it itself.

    So no job waits for another, and any number of requests can share one executor. On a single core every job is run by the
    caller that asks for its result, unless `shares_core`. A job must not change what its caller works on; kernels release the
    interpreter's lock.

    Args:
        niceness: of the threads, where the system knows such of threads: with more than 0 they take what others leave.
        shares_core: if True, jobs have a thread of their own on a single core too.
    """

    def __init__(self, niceness: int = 0, shares_core: bool = False) -> None:
        self._niceness, self._shares_core = niceness, shares_core
        self._pool: ThreadPoolExecutor | None = None

    def start(self, function: Callable[Parameters, Result], *args: Parameters.args, **kwargs: Parameters.kwargs
              ) -> BackgroundJob[Result]:
        """Start `function(*args, **kwargs)`."""
        def compute() -> Result:
            return function(*args, **kwargs)

        if cores() == 1 and not self._shares_core:
            return BackgroundJob(compute, None)
        if self._pool is None:
            self._pool = ThreadPoolExecutor(max(1, cores() - 1), thread_name_prefix="dubins_rrt_background",
                                            initializer=self._give_way)
        return BackgroundJob(compute, self._pool.submit(compute))

    def _give_way(self) -> None:
        """Lower the priority of this thread: 0 is the thread on Linux, where each has its own."""
        if self._niceness and sys.platform == "linux":
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, 0, self._niceness)

    def forget_threads(self) -> None:
        """Start new threads for the next jobs, as a forked process must: it has none of its parent's."""
        self._pool = None


#: The executors of this process: for the searches, and for proofs, for which no search may have to wait.
BACKGROUND, PROOFS = BackgroundExecutor(), BackgroundExecutor(niceness=10, shares_core=True)
if hasattr(os, "register_at_fork"):
    for executor in (BACKGROUND, PROOFS):
        os.register_at_fork(after_in_child=executor.forget_threads)
