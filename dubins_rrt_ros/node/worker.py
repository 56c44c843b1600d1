"""One thread that plans: the newest request wins. It knows nothing of ROS."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from dubins_rrt_ros.planning import Plan, Problem, Progress, Settings, plan

#: Improvements of a path are reported at most once in this time [s].
IMPROVEMENT_INTERVAL = 0.1


@dataclass(frozen=True, eq=False)
class Request:
    """What to plan; the reports on it carry its id."""

    id: int
    problem: Problem
    settings: Settings


@dataclass(frozen=True, eq=False)
class Report:
    """News of a request: its best plan so far, or the defect that ended it. The last one says how it ended."""

    request_id: int
    plan: Plan | None
    error: Exception | None = None
    last: bool = False


class Worker:
    """Plans in a thread of its own.

    Reports go to `deliver`, which is called from that thread: the first path at once, improvements at most every
    `IMPROVEMENT_INTERVAL`, the end of each request that was begun always. A replaced request still reports its end.
    """

    def __init__(self, deliver: Callable[[Report], None], plan: Callable[..., Plan] = plan):
        self._deliver = deliver
        self._plan = plan
        self._state = threading.Condition()
        self._waiting: tuple[Request, threading.Event] | None = None
        self._cancelled = threading.Event()
        self._closed = False
        # A daemon: should a computation not heed its cancellation, the process can end nevertheless.
        self._thread = threading.Thread(target=self._run, name="planning", daemon=True)
        self._thread.start()

    def submit(self, request: Request) -> None:
        """Plan this; what is planned or waits now is given up."""
        with self._state:
            self._cancelled.set()
            self._cancelled = threading.Event()
            self._waiting = request, self._cancelled
            self._state.notify()

    def cancel(self) -> None:
        """End the present request, if there is one, with the best path so far."""
        with self._state:
            self._cancelled.set()

    def close(self, timeout: float) -> bool:
        """Cancel, deliver nothing more and end the thread; False where it did not end within `timeout` [s]."""
        with self._state:
            self._closed = True
            self._cancelled.set()
            self._state.notify()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (item := self._next()) is not None:
            self._report(self._serve(*item))

    def _next(self) -> tuple[Request, threading.Event] | None:
        with self._state:
            self._state.wait_for(lambda: self._closed or self._waiting is not None)
            item, self._waiting = self._waiting, None
            return None if self._closed else item

    def _serve(self, request: Request, cancelled: threading.Event) -> Report:
        throttle = _Throttle(IMPROVEMENT_INTERVAL)

        def on_progress(progress: Progress) -> None:
            if throttle.lets_pass(progress.improved) and not cancelled.is_set():
                self._report_improvement(request.id, progress)

        try:
            plan = self._plan(request.problem, request.settings, cancel=cancelled.is_set, on_progress=on_progress)
        except Exception as error:  # a defect must not end the thread; the receiver tells of it
            return Report(request.id, None, error, last=True)
        return Report(request.id, plan, last=True)

    def _report_improvement(self, request_id: int, progress: Progress) -> None:
        plan = progress.snapshot()
        if plan.path is not None:
            self._report(Report(request_id, plan))

    def _report(self, report: Report) -> None:
        with self._state:  # so that nothing is delivered once close() has begun
            if not self._closed:
                self._deliver(report)


class _Throttle:
    """Lets the first improvement pass at once and later ones when the interval is over, however long ago they came."""

    def __init__(self, interval: float):
        self._interval = interval
        self._due = -float("inf")
        self._pending = False

    def lets_pass(self, improved: bool) -> bool:
        self._pending |= improved
        now = time.monotonic()
        if not self._pending or now < self._due:
            return False
        self._pending, self._due = False, now + self._interval
        return True
