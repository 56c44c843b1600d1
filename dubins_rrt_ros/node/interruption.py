"""SIGINT and SIGTERM, which end the process regularly.

rclpy's own handlers are not used: in a thread of theirs they wake all executors there are, and use after it was freed what an
executor that is made or destroyed meanwhile leaves behind. A managed node does both whenever it is configured and cleaned up.
"""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from rclpy.executors import Executor

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Makes the first signal a KeyboardInterrupt in the main thread; later ones do nothing.

    Attributes:
        came: True once there was one: what Python runs as an object is destroyed may have lost the exception.
    """

    def __init__(self):
        self.came = False
        for number in SIGNALS:
            signal.signal(number, self._interrupt)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if not self.came:
            self.came = True
            raise KeyboardInterrupt

    @staticmethod
    def ignore() -> None:
        """Let no signal break off the end of the process."""
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    @staticmethod
    @contextlib.contextmanager
    def waking(executor: Executor) -> Iterator[None]:
        """Have each signal end the wait of this executor, during which the interpreter raises nothing."""
        reader, writer = os.pipe()
        os.set_blocking(writer, False)
        waker = threading.Thread(target=_wake, args=(executor, reader), name="signals", daemon=True)
        waker.start()
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        try:
            yield
        finally:
            signal.set_wakeup_fd(-1)
            os.close(writer)
            waker.join()
            os.close(reader)


def _wake(executor: Executor, reader: int) -> None:
    while os.read(reader, 1):
        executor.wake()
