"""The goals of an action as Nav2's servers take them: one runs, one waits, and a newer one takes the place of both."""

from typing import Any

from rclpy.task import Future

from .dispatcher import Submission


class Goal:
    """A goal that was accepted.

    Attributes:
        handle: rclpy's.
        turn: to be awaited; done when the goal may run, or is to end before it ran.
        is_replaced: True once a newer goal took its place.
    """

    def __init__(self, handle: Any):
        self.handle = handle
        self.turn = Future()
        self.is_replaced = False
        self._submission: Submission | None = None

    @property
    def is_to_end(self) -> bool:
        """True once it was replaced, or its client asked to cancel it."""
        return self.is_replaced or self.handle.is_cancel_requested

    def run(self, submission: Submission) -> None:
        """Let this be cancelled when the goal is to end."""
        self._submission = submission
        if self.is_to_end:
            self.end()

    def end(self) -> None:
        """End soon: have its turn, or cancel what is under way."""
        if not self.turn.done():
            self.turn.set_result(None)
        if self._submission is not None:
            self._submission.job.cancel()


class Goals:
    """The goals of one action that have not ended."""

    def __init__(self) -> None:
        self._running: Goal | None = None
        self._waiting: Goal | None = None

    def add(self, goal: Goal) -> None:
        """Give a goal its turn as soon as the one that runs has ended, which is asked to; one that waits ends at once."""
        if self._running is None:
            self._running = goal
            goal.turn.set_result(None)
            return
        for older in filter(None, (self._waiting, self._running)):
            older.is_replaced = True
            older.end()
        self._waiting = goal

    def remove(self, goal: Goal) -> None:
        """Take out a goal that has ended; where it ran, the one that waits has its turn."""
        if goal is self._waiting:
            self._waiting = None
        elif goal is self._running:
            self._running, self._waiting = self._waiting, None
            if self._running is not None:
                self._running.turn.set_result(None)
