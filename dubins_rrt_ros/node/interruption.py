"""SIGINT and SIGTERM, which end the process regularly.

rclpy's own handlers are not used: in a thread of theirs they wake all executors there are, and use what an executor that is made
or destroyed meanwhile has freed. A managed node makes and destroys one whenever it is configured and cleaned up.
"""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from rclpy.executors import Executor

#: The signals by which users and launch files end a node.
SIGNALS = signal.SIGINT, signal.SIGTERM


class Interruption:
    """Takes the signals: the first one raises KeyboardInterrupt until an executor is woken instead; later ones do nothing.

    Attributes:
        came: True once there was a signal.
    """

    def __init__(self):
        self.came = self._is_deferred = False
        for number in SIGNALS:
            signal.signal(number, self._interrupt)

    @staticmethod
    def ignore() -> None:
        """Let no signal break off the end, nor that of the interpreter, which takes away handlers of Python."""
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        is_first, self.came = not self.came, True
        if is_first and not self._is_deferred:
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def waking(self, executor: Executor) -> Iterator[None]:
        """Have signals break off nothing from now on; each gives this executor something to do, so that it does not wait on."""
        self._is_deferred = True
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
        executor.create_task(lambda: None)
