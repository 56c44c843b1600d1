"""The size of portions of work, by what they are measured to cost."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from ..deadline import SLICE


class Pace:
    """Sizes portions so that each takes about `duration`: a clock or a cancellation is looked at between them.

    Attributes:
        size: number of items of the next portion.
    """

    def __init__(self, first: int, largest: int, duration: float = SLICE):
        self.size = first
        self._largest, self._duration = largest, duration

    @contextmanager
    def measured(self, items: int) -> Iterator[None]:
        """Measure a portion, which sets the size of the next; it is at most four times as large."""
        started = time.perf_counter()
        yield
        took = max(time.perf_counter() - started, 1e-6)
        self.size = max(1, min(int(self._duration * items / took), 4 * max(items, 1), self._largest))
