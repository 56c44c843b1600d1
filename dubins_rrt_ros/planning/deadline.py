"""The time of a request, which slow work looks at between its slices."""

import time
from collections.abc import Callable

#: Time beyond the limit until which work that is nearly done may go on [s], and until which an audit may [s].
GRACE, AUDIT_GRACE = 0.003, 0.006
#: Time after a cancellation within which the search may come to where it is whole, so that it can be repeated by its samples, and
#: within which the path that was found can be audited [s].
CANCEL_GRACE, CANCEL_AUDIT_GRACE = 0.01, 0.02
#: Time that a slice of work is to take [s].
SLICE = 0.002


class OutOfTime(Exception):
    """The time is up before the work is done."""


def never() -> bool:
    """Return False, as the interruption of work that may take its time."""
    return False


def unlimited() -> None:
    """Let work go on, however long it takes, where `Deadline.check` would end it."""


class Deadline:
    """The end of a request's time.

    Attributes:
        reserve: time before the limit that is kept for what follows the search [s].
        cancel: tells whether the request is cancelled; for the thread of the request.
        cancelled: True once `poll` saw the request cancelled.
    """

    def __init__(self, limit: float, cancel: Callable[[], bool]):
        """Start the clock, for `limit` seconds."""
        self._limit, self.cancel = limit, cancel
        self._cancelled_at = 0.0
        self.reserve = 0.0
        self.cancelled = False
        self.restart()

    def restart(self) -> None:
        """Set the clock to 0."""
        self._started = time.perf_counter()

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return time.perf_counter() - self._started

    @property
    def left(self) -> float:
        """Time until the limit [s]; negative once it is over."""
        return self._limit - self.elapsed

    @property
    def is_due(self) -> bool:
        """True if the search is to end where it is whole."""
        return self.cancelled or self.left <= self.reserve

    @property
    def is_over(self) -> bool:
        """True if the search has to end at once; any thread may ask."""
        return self._is_cancelled_for(CANCEL_GRACE) or self.left <= self.reserve - GRACE

    def poll(self) -> bool:
        """Return `is_over`, after a look at the cancellation; for the thread of the request."""
        if not self.cancelled and self.cancel():
            self.cancelled, self._cancelled_at = True, self.elapsed
        return self.is_over

    def check(self) -> None:
        """Look at the time of an audit, or of what else follows the search.

        Raises:
            OutOfTime: it is used up.
        """
        self.poll()
        if self.left <= -AUDIT_GRACE or self._is_cancelled_for(CANCEL_AUDIT_GRACE):
            raise OutOfTime

    def _is_cancelled_for(self, time_since: float) -> bool:
        return self.cancelled and self.elapsed >= self._cancelled_at + time_since
