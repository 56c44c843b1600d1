"""From any thread to the executor's, in which alone the node publishes."""

import queue
import threading
from collections.abc import Callable

from rclpy.node import Node


class Mailbox:
    """Calls that any thread posts and the executor's thread makes, in order."""

    def __init__(self, node: Node):
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._posting = threading.Lock()
        self._closed = False
        self._posted = node.create_guard_condition(self._make_calls)

    def post(self, call: Callable[[], None]) -> None:
        """Have this called in the executor's thread; nothing is, once the mailbox is closed."""
        with self._posting:
            if not self._closed:
                self._calls.put(call)
                self._posted.trigger()

    def close(self) -> None:
        """Take no more calls."""
        with self._posting:
            self._closed = True

    def _make_calls(self) -> None:
        while not self._calls.empty():
            call = self._calls.get()
            try:
                call()
            finally:
                if not self._calls.empty():
                    self._posted.trigger()  # what a defect leaves behind is called too
