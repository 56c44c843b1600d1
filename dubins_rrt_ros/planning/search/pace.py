"""The size of portions of work, by what they are measured to cost."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from ..deadline import SLICE

#: Share of the expected time of an item that it keeps at least after a portion that took less: poses near obstacles, which take
#: many times as long as others, come in clusters.
MEMORY = 0.95


class Pace:
    """Sizes portions so that each takes about `duration`: a clock or a cancellation is looked at between them.

    Attributes:
        size: number of items of the next portion.
    """

    def __init__(self, first: int, largest: int, duration: float = SLICE):
        self.size = first
        self._largest, self._duration = largest, duration
        self._expected = 0.0

    @contextmanager
    def measured(self, items: int) -> Iterator[None]:
        """Measure a portion, which sets the size of the next; it is at most four times as large."""
        started = time.perf_counter()
        yield
        took = max(time.perf_counter() - started, 1e-6)
        self._expected = max(took / max(items, 1), MEMORY * self._expected)
        self.size = max(1, min(int(self._duration / self._expected), 4 * max(items, 1), self._largest))
