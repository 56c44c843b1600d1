"""The proof of a search that is under way, beside it on another core."""

import time
from collections.abc import Callable

from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..problem import Problem
from ..search.background import PROOFS
from .length_proof import LengthProof


class BackgroundProof:
    """Raises the lower bound of the lengths of a problem's paths until the best one is at most `gap` above it.

    On one core it waits for `finish`.
    """

    def __init__(self, problem: Problem, field: ClearanceField, path: Path, gap: float, interrupted: Callable[[], bool]):
        """Start.

        Args:
            interrupted: asked every few milliseconds, from another thread; True ends the proof with the bound so far.
        """
        self._gap, self._interrupted = gap, interrupted
        self._length, self._is_over = path.length, False
        self._proof: LengthProof | None = None
        self._job = PROOFS.start(self._run, problem, field, path)

    def _run(self, problem: Problem, field: ClearanceField, path: Path) -> None:
        if self._is_interrupted():
            return
        self._proof = LengthProof(problem, field, path, interrupted=self._is_interrupted)
        self.follow(self._length)
        self._proof.run(self._is_interrupted, self._gap)

    def _is_interrupted(self) -> bool:
        return self._is_over or self._interrupted()

    @property
    def bound(self) -> float:
        """Length that no path falls below, as far as it is proved [m]."""
        return self._proof.bound if self._proof else 0.0

    @property
    def holds(self) -> bool:
        """True if the best path is proved to be at most the gap above the shortest possible."""
        return self._length <= (1 + self._gap) * self.bound

    def follow(self, length: float) -> None:
        """Go on with the length of a shorter path [m]."""
        self._length = min(length, self._length)
        if self._proof:
            self._proof.length = self._length

    def finish(self, seconds: float) -> float:
        """Wait for so long at most, end the proof, and return its bound [m]."""
        until = time.perf_counter() + seconds
        interrupted = self._interrupted
        self._interrupted = lambda: interrupted() or time.perf_counter() > until
        if not self.holds and seconds > 0 and self._job.wait(seconds):
            self._job()
        self._is_over = True
        return self.bound
