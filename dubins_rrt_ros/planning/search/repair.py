"""Repair of a chain of arcs: their lengths are fitted so that it ends at the goal and keeps the clearance that it lacks.

In a tunnel that leaves millimetres the turns of a path must begin just where they have to. A search over arcs of given lengths
hardly ever meets these places; it does for a vehicle that needs a little less clearance. The arcs of its path are the right ones
in the right order, and their lengths nearly right. These are fitted by the method of Levenberg and Marquardt (Marquardt 1963,
doi:10.1137/0111030).
"""

import math
from collections.abc import Callable

import numpy as np

from .._kernels.arc_fit import ArcFit
from .._kernels.cholesky import solve_definite
from .._kernels.clearance import Clearance
from ..curves.dubins import SIDES, WORDS
from ..curves.path import Path
from ..work import Work

#: Shares of the lacking clearance that are left after each of the first rounds of the fit; maximum number of iterations of these
#: rounds, and of the last ones.
SHORTFALLS, ITERATIONS, LAST_ITERATIONS = (0.5, 0.25, 0.1, 0.03), 20, 60
#: Sum of the squares of the residuals after a round with which no fit comes to an end any more.
HOPELESS = 2e-4
#: Distance between the samples at which the clearance is measured in the first rounds [turning radii]; distances in the last
#: ones, the finer one where what is between the samples is not free.
COARSE_SPACING, SPACINGS = 0.1, (0.04, 0.01)
#: Residual at which the last rounds are done, and those before them [turning radii].
PRECISION, COARSE_PRECISION = 1e-9, 1e-4
#: Damping of the first iteration, its minimum, and its maximum, where a round ends; and the factors by which it rises and falls.
DAMPING, LEAST_DAMPING, MOST_DAMPING, RISE, FALL = 1e-4, 1e-9, 1e6, 4.0, 5.0
#: Maximum number of times that a step is solved for, as lengths that would be negative become 0.
MOST_SOLUTIONS = 6
#: Maximum length of a chain that is tried, relative to the length at first: a step can lead anywhere.
MOST_LONGER = 2.0
#: Maximum number of arcs of a chain, as a step takes time with the third power of that; and its maximum length [turning radii],
#: as the samples of an arc are measured without a look at the time.
MOST_ARCS, MOST_LENGTH = 300, 500.0
#: Length of an arc that is left out [turning radii].
NEGLIGIBLE = 1e-9
#: The point of a disc whose clearance counts, in the vehicle's frame, and what that exceeds the required one by [m].
DISC = np.zeros((1, 3))
_TURNS = np.array([[SIDES[letter] for letter in word] for word in WORDS], np.int32)
#: A word for an arc of each turn, and the place of the arc in it.
_SINGLE = {1: (WORDS.index("LSL"), 0), 0: (WORDS.index("LSL"), 1), -1: (WORDS.index("RSR"), 0)}


def repaired(path: Path, clearance: Clearance, required: float, lacking: float, is_free: Callable[[Path], bool], work: Work
             ) -> Path | None:
    """Return a path of the same turns, between the same poses, that is free; None where no lengths of its arcs are found.

    Args:
        path: it may lack clearance.
        clearance: that of the map.
        required: clearance to keep at samples [m].
        lacking: how much less than that `path` keeps at most [m].
        is_free: judges a path that keeps it, between the samples too.
        work: counts slices of the iterations; once it is over there is no path.
    """
    fit = _Fit(path, clearance, DISC, work)
    if fit.size > MOST_ARCS or path.length > MOST_LENGTH * path.radius:
        return None
    for shortfall in SHORTFALLS:
        if fit.run(required - shortfall * lacking, ITERATIONS, COARSE_SPACING, COARSE_PRECISION) > HOPELESS:
            return None
    for spacing in SPACINGS:
        fit.run(required, LAST_ITERATIONS, spacing, PRECISION)
        if not fit.is_done:
            return None
        if is_free(fitted := fit.path()):
            return fitted
    return None


class _Fit:
    """The lengths of a chain of arcs under way to where its residuals vanish."""

    def __init__(self, path: Path, clearance: Clearance, points: np.ndarray, work: Work):
        turns, lengths = _TURNS[path.words[1:]].ravel(), path.lengths[1:].ravel()
        kept = lengths > NEGLIGIBLE * path.radius
        turns, lengths = turns[kept], lengths[kept]
        first = np.flatnonzero(np.append(True, turns[1:] != turns[:-1])) if len(turns) else np.empty(0, int)
        self._turns = turns[first]
        self._lengths = np.add.reduceat(lengths, first) if len(first) else lengths
        self._path, self._work = path, work
        self._longest = MOST_LONGER * float(self._lengths.sum())
        self._residuals = ArcFit(clearance, path.radius, path.start, path.end, self._turns, points)
        self.is_done = False

    @property
    def size(self) -> int:
        """The number of arcs."""
        return len(self._turns)

    def run(self, required: float, iterations: int, spacing: float, precision: float) -> float:
        """Fit the lengths for so many iterations, or until no residual is above `precision` [turning radii].

        Args:
            required: clearance that the chain is to keep [m] ...
            spacing: ... at places so far apart [turning radii].

        Returns:
            The sum of the squares of the residuals.
        """
        self._residuals.require(required, spacing * self._path.radius, self._longest)
        cost, damping = self._cost(self._lengths, math.inf), DAMPING
        for _ in range(iterations):
            self.is_done = cost < math.inf and self._residuals.largest < precision
            derivatives = None if self.is_done else self._derivatives()
            if derivatives is None:
                break
            while True:
                lengths = self._stepped(*derivatives, damping)
                is_short = bool(lengths.sum() <= self._longest)  # NaN is not
                next_cost = self._cost(lengths, cost) if is_short else math.inf
                if next_cost < cost:
                    break
                damping *= RISE
                if damping > MOST_DAMPING:
                    return cost
            damping = max(damping / FALL, LEAST_DAMPING)
            self._lengths, cost = lengths, next_cost
        return cost

    def _cost(self, lengths: np.ndarray, limit: float) -> float:
        """Return the sum of the squares of the residuals; infinite above `limit`, and where the work is over."""
        residuals = self._residuals
        total = float(residuals.begin(lengths))
        while total <= limit and not residuals.measured:
            if not self._work.begins():
                return math.inf
            total = float(residuals.measure(total, limit))
        return total if total <= limit else math.inf

    def _derivatives(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the gradient and the curvature of half the cost that was asked for last; None where the work is over."""
        gradient, curvature = np.zeros(len(self._turns)), np.zeros((len(self._turns), len(self._turns)))
        while not self._residuals.differentiated:
            if not self._work.begins():
                return None
            self._residuals.differentiate(gradient, curvature)
        return gradient, curvature

    def path(self) -> Path:
        """Return the chain as a path, each arc of it a curve; it ends at the goal to the last bit."""
        words, lengths = np.zeros(len(self._turns) + 1, np.int8), np.zeros((len(self._turns) + 1, 3))
        for i, (turn, length) in enumerate(zip(self._turns.tolist(), self._lengths.tolist(), strict=True), 1):
            words[i], place = _SINGLE[turn]
            lengths[i, place] = length
        self._residuals.begin(self._lengths)
        waypoints = np.array(self._residuals.ends)
        waypoints[-1] = self._path.end
        return Path(waypoints, words, lengths, self._path.radius)

    def _stepped(self, gradient: np.ndarray, curvature: np.ndarray, damping: float) -> np.ndarray:
        """Return the lengths after a damped step of Gauss and Newton, NaN where there is none; none becomes negative.

        Where some would, they become 0, and the step of the others is found anew.
        """
        system = curvature + damping * np.diag(np.diag(curvature) + LEAST_DAMPING * np.trace(curvature))
        is_free = (self._lengths > 0) | (gradient <= 0)
        step = np.zeros(len(self._lengths))
        for _ in range(MOST_SOLUTIONS):
            values = -gradient[is_free] - (system[np.ix_(is_free, ~is_free)] * step[~is_free]).sum(axis=1)
            if solve_definite(system[np.ix_(is_free, is_free)], values):
                step[is_free] = values
            else:  # singular in spite of the damping
                step[:] = math.nan
            is_negative = is_free & (self._lengths + step < 0)
            if not is_negative.any():
                break
            step[is_negative] = -self._lengths[is_negative]
            is_free &= ~is_negative
        return np.maximum(0.0, self._lengths + step)
