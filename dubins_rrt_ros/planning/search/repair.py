"""Repair of a chain of arcs: their lengths are fitted so that it ends at the goal and keeps the clearance that it lacks.

In a tunnel that leaves millimetres the turns of a path must begin just where they have to. A search over arcs of given lengths
hardly ever meets these places; it does for a vehicle that needs a little less clearance. The arcs of its path are the right ones
in the right order, and their lengths nearly right. These are fitted by the method of Levenberg and Marquardt (Marquardt 1963,
doi:10.1137/0111030).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._kernels.clearance import Clearance
from ..curves.dubins import SIDES, WORDS
from ..curves.path import Path
from ..work import Work

#: Shares of the lacking clearance that are left after each of the first rounds of the fit; maximum number of iterations of these
#: rounds, and of the last ones.
SHORTFALLS, ITERATIONS, LAST_ITERATIONS = (0.5, 0.25, 0.1, 0.03), 20, 60
#: Sum of the squares of the residuals after a round with which no fit comes to an end any more.
HOPELESS = 2e-4
#: Distances between the samples at which the clearance is measured [turning radii]; the finer one where what is between them is
#: not free.
SPACINGS = 0.04, 0.01
#: Weight of the errors at the goal, among those of the clearance.
GOAL_WEIGHT = 3.0
#: Residual at which the last rounds are done, and those before them [turning radii].
PRECISION, COARSE_PRECISION = 1e-9, 1e-4
#: Step of the differences by which the clearance is differentiated [turning radii].
DIFFERENCE = 1e-7
#: Damping of the first iteration, its minimum, and its maximum, where a round ends; and the factors by which it rises and falls.
DAMPING, LEAST_DAMPING, MOST_DAMPING, RISE, FALL = 1e-4, 1e-9, 1e6, 4.0, 5.0
#: Maximum length of a chain that is tried, relative to the length at first: a step can lead anywhere.
MOST_LONGER = 2.0
#: Length of an arc that is left out [turning radii].
NEGLIGIBLE = 1e-9
_TURNS = np.array([[SIDES[letter] for letter in word] for word in WORDS], float)
#: A word for an arc of each turn, and the place of the arc in it.
_SINGLE = {1.0: (WORDS.index("LSL"), 0), 0.0: (WORDS.index("LSL"), 1), -1.0: (WORDS.index("RSR"), 0)}


def repaired(path: Path, clearance: Clearance, required: float, lacking: float, is_free: Callable[[Path], bool], work: Work
             ) -> Path | None:
    """Return a path of the same turns, between the same poses, that is free; None where no lengths of its arcs are found.

    Args:
        path: it may lack clearance.
        clearance: that of the map.
        required: clearance to keep at samples [m].
        lacking: how much less than that `path` keeps at most [m].
        is_free: judges a path that keeps it, between the samples too.
        work: counts the iterations; once it is over there is no path.
    """
    fit = _Fit(path, clearance, work)
    for shortfall in SHORTFALLS:
        if fit.run(required - shortfall * lacking, ITERATIONS, SPACINGS[0], COARSE_PRECISION) > HOPELESS:
            return None
    for spacing in SPACINGS:
        fit.run(required, LAST_ITERATIONS, spacing, PRECISION)
        if not fit.is_done:
            return None
        if is_free(fitted := fit.path()):
            return fitted
    return None


@dataclass(frozen=True)
class _Residuals:
    """The residuals of a chain: its errors at the goal, and what samples of it lack in clearance.

    Attributes:
        values: (3 + k,) [turning radii], of the goal first.
        x, y, theta: (n + 1,) poses at the ends of the arcs.
        lacking: (k, 2) samples that lack clearance.
        clearance: (k,) theirs [m].
        arc: (k,) the arcs that they are on.
        share: (k,) of the arc before them.
        heading: (k,) headings there.
    """

    values: np.ndarray
    x: np.ndarray
    y: np.ndarray
    theta: np.ndarray
    lacking: np.ndarray
    clearance: np.ndarray
    arc: np.ndarray
    share: np.ndarray
    heading: np.ndarray

    @property
    def cost(self) -> float:
        """The sum of their squares."""
        return float(self.values @ self.values)


class _Fit:
    """The lengths of a chain of arcs under way to where its residuals vanish."""

    def __init__(self, path: Path, clearance: Clearance, work: Work):
        turns, lengths = _TURNS[path.words[1:]].ravel(), path.lengths[1:].ravel()
        kept = lengths > NEGLIGIBLE * path.radius
        turns, lengths = turns[kept], lengths[kept]
        first = np.flatnonzero(np.append(True, turns[1:] != turns[:-1])) if len(turns) else np.empty(0, int)
        self._turns = turns[first]
        self._lengths = np.add.reduceat(lengths, first) if len(first) else lengths
        self._radius, self._start, self._goal = path.radius, path.start, path.end
        self._longest = MOST_LONGER * float(self._lengths.sum())
        self._clearance, self._work = clearance, work
        self._required = self._spacing = 0.0
        self.is_done = False

    def run(self, required: float, iterations: int, spacing: float, precision: float) -> float:
        """Fit the lengths for so many iterations, or until no residual is above `precision` [turning radii].

        Args:
            required: clearance that the chain is to keep [m] ...
            spacing: ... at places so far apart [turning radii].

        Returns:
            The sum of the squares of the residuals.
        """
        self._required, self._spacing, damping = required, spacing * self._radius, DAMPING
        now = self._residuals(self._lengths)
        for _ in range(iterations):
            self.is_done = bool(np.abs(now.values).max() < precision)
            if self.is_done or not self._work.begins():
                break
            jacobian = self._jacobian(now)
            gradient, curvature = jacobian.T @ now.values, jacobian.T @ jacobian
            while True:
                lengths = self._stepped(gradient, curvature, damping)
                next_one = self._residuals(lengths) if lengths.sum() <= self._longest else None  # NaN is not
                if next_one and next_one.cost < now.cost:
                    break
                damping *= RISE
                if damping > MOST_DAMPING:
                    return now.cost
            damping = max(damping / FALL, LEAST_DAMPING)
            self._lengths, now = lengths, next_one
        return now.cost

    def path(self) -> Path:
        """Return the chain as a path, each arc of it a curve; it ends at the goal to the last bit."""
        x, y, theta = self._ends(self._lengths)
        waypoints = np.column_stack([x, y, theta])
        waypoints[-1] = self._goal
        words, lengths = np.zeros(len(x), np.int8), np.zeros((len(x), 3))
        for i, (turn, length) in enumerate(zip(self._turns.tolist(), self._lengths.tolist(), strict=True), 1):
            words[i], place = _SINGLE[turn]
            lengths[i, place] = length
        return Path(waypoints, words, lengths, self._radius)

    def _stepped(self, gradient: np.ndarray, curvature: np.ndarray, damping: float) -> np.ndarray:
        """Return the lengths after a damped step of Gauss and Newton, NaN where there is none; those that are 0 do not fall."""
        scale = np.diag(curvature) + LEAST_DAMPING * np.trace(curvature)
        free = ~((self._lengths <= 0) & (gradient > 0))
        step = np.zeros(len(self._lengths))
        system = curvature[np.ix_(free, free)] + damping * np.diag(scale[free])
        try:
            step[free] = -np.linalg.solve(system, gradient[free])
        except np.linalg.LinAlgError:  # singular in spite of the damping
            step[:] = math.nan
        return np.maximum(0.0, self._lengths + step)

    def _ends(self, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the poses at the start and at the ends of the arcs."""
        x, y, theta = self._start
        headings = theta + np.append(0.0, np.cumsum(self._turns * lengths / self._radius))
        along, across = _chords(headings[:-1], self._turns, lengths, self._radius)
        return x + np.append(0.0, np.cumsum(along)), y + np.append(0.0, np.cumsum(across)), headings

    def _residuals(self, lengths: np.ndarray) -> _Residuals:
        x, y, theta = self._ends(lengths)
        count = np.maximum(1, np.ceil(lengths / self._spacing).astype(int))
        arc = np.repeat(np.arange(len(lengths)), count)
        share = (np.arange(len(arc)) - np.repeat(np.cumsum(count) - count, count) + 1.0) / count[arc]
        along, across = _chords(theta[arc], self._turns[arc], share * lengths[arc], self._radius)
        points = np.column_stack([x[arc] + along, y[arc] + across])
        clearance = self._clearance_at(points)
        short = np.flatnonzero(clearance < self._required)
        heading = theta[arc] + self._turns[arc] * share * lengths[arc] / self._radius
        off = np.array([x[-1], y[-1]]) - self._goal[:2]
        error = (*off / self._radius, math.remainder(theta[-1] - self._goal[2], math.tau))
        values = np.append(GOAL_WEIGHT * np.array(error), (self._required - clearance[short]) / self._radius)
        return _Residuals(values, x, y, theta, points[short], clearance[short], arc[short], share[short], heading[short])

    def _jacobian(self, now: _Residuals) -> np.ndarray:
        """Return the (3 + k, n) derivatives of the residuals by the lengths [1/m].

        What follows an arc that becomes longer moves with its end, and turns around the centre of the arc.
        """
        x, y, cos, sin = now.x[1:], now.y[1:], np.cos(now.theta[1:]), np.sin(now.theta[1:])
        bend = self._turns / self._radius
        of_goal = np.stack([cos - bend * (now.y[-1] - y), sin + bend * (now.x[-1] - x), self._turns])
        rise = self._rise_of_clearance(now)
        moved_x = cos - bend * (now.lacking[:, 1:] - y)
        moved_y = sin + bend * (now.lacking[:, :1] - x)
        of_clearance = rise[:, :1] * moved_x + rise[:, 1:] * moved_y
        of_clearance[np.arange(len(x)) > now.arc[:, None]] = 0.0
        samples = np.arange(len(now.arc))
        of_clearance[samples, now.arc] = now.share * (rise[:, 0] * np.cos(now.heading) + rise[:, 1] * np.sin(now.heading))
        return np.concatenate([GOAL_WEIGHT * of_goal, -of_clearance]) / self._radius

    def _rise_of_clearance(self, now: _Residuals) -> np.ndarray:
        """Return the (k, 2) derivatives of the clearance at the samples that lack it."""
        step = DIFFERENCE * self._radius
        rise = np.empty_like(now.lacking)
        for axis in range(2):
            points = now.lacking.copy()
            points[:, axis] += step
            rise[:, axis] = (self._clearance_at(points) - now.clearance) / step
        return rise

    def _clearance_at(self, points: np.ndarray) -> np.ndarray:
        """Return the (n,) clearances of (n, 2) points [m]."""
        clearance = np.empty(len(points))
        self._clearance.distances(points, clearance)
        return clearance


def _chords(heading: np.ndarray, turns: np.ndarray, lengths: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much arcs lead along x and y [m]."""
    half = turns * lengths / (2 * radius)
    chord = lengths * np.sinc(half / math.pi)
    return chord * np.cos(heading + half), chord * np.sin(heading + half)
