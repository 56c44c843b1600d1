"""The proof of a search that is under way, in a thread beside it."""

import math
import time
from collections.abc import Callable

from .._kernels import COMPILED
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..problem import Problem
from ..search.background import PROOFS, BackgroundJob, cores
from ..search.cost_bounds import LengthBounds
from ..settings import Settings
from .length_proof import LengthProof

#: Gap at which a proof ends where no `stop_gap` says so: what is less is in the margins that paths keep from obstacles.
NEGLIGIBLE_GAP = 5e-4


class BackgroundProof:
    """Raises the lower bound of the lengths of a problem's paths towards the length of the best one.

    On one core it takes the search's time: there it is started for a `stop_gap` of the length alone.
    """

    def __init__(self, problem: Problem, field: ClearanceField, settings: Settings, interrupted: Callable[[], bool],
                 bound: float, is_length: bool):
        """Prepare it; `follow` starts it.

        Args:
            bound: length that no path falls below [m]: a path that is as short needs no proof.
            interrupted: asked every few milliseconds, from another thread; True ends the proof with the bound so far.
            is_length: True if the search minimises the length, so that a `stop_gap` is one of the length.
        """
        self._problem, self._field, self._interrupted, self._least = problem, field, interrupted, bound
        self._waits = settings.stop_gap > 0 and is_length
        self._gap = settings.stop_gap if self._waits else NEGLIGIBLE_GAP
        self._is_beside = settings.length_proof and settings.informed and COMPILED and cores() > 1
        self._length, self._is_over = math.inf, False
        self._proof: LengthProof | None = None
        self._job: BackgroundJob[None] | None = None

    def follow(self, path: Path, bounds: LengthBounds | None, may_start: bool) -> None:
        """Go on with a shorter path, or start.

        Args:
            bounds: of the search, which nothing changes any more; computed where there are none.
            may_start: False as long as the search has more urgent work for the other cores.
        """
        self._length = min(path.length, self._length)
        if self._proof:
            self._proof.length = self._length
        elif self._job is None and (self._waits or self._is_beside) and may_start and not self.holds:
            self._job = PROOFS.start(self._run, path, bounds)

    def _run(self, path: Path, bounds: LengthBounds | None) -> None:
        if self._is_interrupted():
            return
        proof = self._proof = LengthProof(self._problem, self._field, path, bounds, interrupted=self._is_interrupted)
        proof.length = self._length
        proof.run(self._is_interrupted, self._gap)
        if self._is_over:
            self._proof = None

    def _is_interrupted(self) -> bool:
        return self._is_over or self._interrupted()

    @property
    def bound(self) -> float:
        """Length that no path falls below, as far as it is proved [m]."""
        proof = self._proof
        return max(self._least, proof.bound) if proof else self._least

    @property
    def holds(self) -> bool:
        """True if the best path is proved to be at most the gap above the shortest possible."""
        return self._length <= (1 + self._gap) * self.bound

    def finish(self, seconds: float) -> float:
        """Wait for so long at most where there is a `stop_gap`, end the proof, and return its bound [m]."""
        until = time.perf_counter() + seconds
        interrupted = self._interrupted
        self._interrupted = lambda: interrupted() or time.perf_counter() > until
        if self._waits and self._job and not self.holds and seconds > 0 and self._job.wait(seconds):
            self._job()
        self._is_over = True
        self._least = self.bound
        self._proof = self._job = None  # which refer to this object: large arrays would wait for the garbage collector
        return self._least
