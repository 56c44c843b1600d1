"""A second core, where there is one: work beside the search, whose answer does not depend on when or where it was computed."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar

Answer = TypeVar("Answer")


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Beside:
    """Computes one thing after the other beside its caller. What is computed must not touch what the caller works on.

    The kernels hold no lock, so that both make progress. With one core nothing is computed before it is asked for.
    """

    def __init__(self):
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="dubins_rrt_beside") if cores() > 1 else None

    def start(self, function: Callable[..., Answer], *arguments: Any) -> Callable[[], Answer]:
        """Compute `function(*arguments)` when what was begun before is done; what is returned gives its answer.

        Where that is asked for before the computation has begun, the caller does it at once.
        """
        if not self._pool:
            return cache(lambda: function(*arguments))
        future = self._pool.submit(function, *arguments)
        return cache(lambda: function(*arguments) if future.cancel() else future.result())
