"""Calls from any thread to the executor's, in which alone the node publishes; and the timers of that thread."""

import queue
import threading
from collections.abc import Callable
from functools import partial

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from rclpy.timer import Timer


class ExecutorQueue:
    """Calls that any thread posts and the executor's thread makes, in order."""

    def __init__(self, node: Node):
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._posting = threading.Lock()
        self._closed = False
        self._posted = node.create_guard_condition(self._make_call)

    def post(self, call: Callable[[], None]) -> None:
        """Have this called in the executor's thread; once the queue is closed, it is not called."""
        with self._posting:
            if not self._closed:
                self._calls.put(call)
                self._posted.trigger()

    async def rounds(self, number: int) -> None:
        """Wait for so many rounds of the executor, in each of which all coroutines go on that can."""
        for _ in range(number):
            passed = Future()
            self.post(partial(passed.set_result, None))
            await passed

    def close(self) -> None:
        """Take no more calls."""
        with self._posting:
            self._closed = True

    def _make_call(self) -> None:
        # One at a time: of several coroutines that may go on, rclpy resumes the one that began last first.
        if self._calls.empty():
            return
        call = self._calls.get()
        try:
            call()
        finally:
            if not self._calls.empty():
                self._posted.trigger()


def steady_timer(node: Node, interval: float, callback: Callable[[], None]) -> Timer:
    """Call back every `interval` [s] of real time, also where the node's clock is a simulation's."""
    return node.create_timer(interval, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))
