"""Work in units that no clock counts, so that work which a clock interrupted can be repeated up to the same place."""

import sys
from collections.abc import Callable
from typing import NamedTuple

from .deadline import never


class WorkDone(NamedTuple):
    """The amounts of work after which a path was done, in units.

    Attributes:
        search: of the search.
        simplification: of the simplification of its path.
        merging: of merging its short arcs.
    """

    search: int
    simplification: int = 0
    merging: int = 0


#: No work, and more than any.
NO_WORK, UNLIMITED_WORK = WorkDone(0), WorkDone(sys.maxsize, sys.maxsize, sys.maxsize)


class Work:
    """Work of one thread: poses that are expanded, changes of a path that are tried, samples.

    Once it is over nothing more is done, whatever time is left later: what was done is a beginning of what would have been done.

    Attributes:
        done: number of units done.
    """

    def __init__(self, interrupted: Callable[[], bool] = never, limit: int = sys.maxsize):
        """Begin.

        Args:
            interrupted: called every few milliseconds; True ends the work early.
            limit: maximum number of units.
        """
        self._interrupted, self._limit = interrupted, limit
        self._is_over = False
        self.done = 0

    @property
    def is_over(self) -> bool:
        """True if no more is to be done."""
        self._is_over = self._is_over or self.done >= self._limit or self._interrupted()
        return self._is_over

    @property
    def is_interrupted(self) -> bool:
        """True if it was ended early, and not by its limit."""
        return self._is_over and self.done < self._limit

    def interrupting(self, interrupted: Callable[[], bool]) -> Callable[[], bool]:
        """Return what interrupts work in the background; once it did, this work is over too, and takes nothing of that."""
        def is_interrupted() -> bool:
            self._is_over = self._is_over or interrupted()
            return self._is_over
        return is_interrupted

    def begins(self) -> bool:
        """Begin a piece of work, which is a unit by itself; return False, without a unit, if it is to be left out."""
        if self.is_over:
            return False
        self.done += 1
        return True

    def portion(self, size: int) -> int:
        """Return how many of `size` units may be done."""
        return min(size, self._limit - self.done)
