"""Smoothing: shortcuts and moved waypoints make a path cheaper, and keep it free; a price of each curve makes it simpler."""

import math
from functools import cached_property

import numpy as np

from .._kernels.shortcut import Shortcutter
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..vehicle import Vehicle
from ..work import Work
from .cost import Objective
from .pace import Pace

#: Number of changes that are tried in one round; and where the cost is not the length, which takes several times as long, in the
#: first round and in later ones.
TRIES, FIRST_COSTLY_TRIES, COSTLY_TRIES = 512, 128, 256
#: Number of changes in the first slice of a round, after which the time is looked at.
FIRST_SLICE = 4
#: Share of shortcuts, which are coarse, among the changes: in the first round, and in later ones.
FIRST_SHORTCUTS, LATER_SHORTCUTS = 0.8, 0.3
#: Price of a curve of a path that is published, in turning radii; number of changes that are tried in a round that simplifies it,
#: and maximum number of rounds: one that saves less than a curve is the last.
PRICE, SIMPLIFYING_TRIES, SIMPLIFICATIONS = 0.01, 128, 12
#: Minimum gain of a round, relative to the cost, that makes another one worthwhile.
WORTHWHILE_GAIN = 1e-4


def price_of_curve(vehicle: Vehicle) -> float:
    """Return the price of a curve of a path that is published [m]."""
    return PRICE * vehicle.maneuver_scale


def smooth(path: Path, vehicle: Vehicle, field: ClearanceField, rng: np.random.Generator, first_round: bool,
           work: Work | None = None, objective: Objective | None = None, price: float = 0.0) -> Path:
    """Return a path with the same ends that never costs more, but for what the price of curves saves.

    Args:
        path: it is free for the vehicle, and so is what is returned.
        first_round: True if it was not smoothed before, and may have large loops.
        work: counts the changes that are tried; once it is over the round ends with the path as it is by then.
        objective: the cost; None makes it the length.
        price: what a curve more may save [m]; without effect where the cost is the length.
    """
    work = work or Work()
    edge_cost = (objective or Objective(vehicle, field)).edge_cost()
    costly = SIMPLIFYING_TRIES if price > 0 else FIRST_COSTLY_TRIES if first_round else COSTLY_TRIES
    tries = TRIES if edge_cost.is_length else costly
    draws = np.column_stack([rng.random((tries, 4)), rng.normal(size=(tries, 2))])
    shortcutter = Shortcutter(checker=field.collision_checker(vehicle), edge_cost=edge_cost, radius=path.radius,
                              scale=vehicle.maneuver_scale, poses=path.waypoints, words=path.words, lengths=path.lengths,
                              tries=tries, price=price)
    pace, tried, is_left = Pace(FIRST_SLICE, tries), 0, True
    while is_left and not work.is_over:
        checks = work.portion(pace.size)
        with pace.measured(checks):
            checked = int(shortcutter.prepare(checks))  # interpreted, it is one of NumPy's
        work.done += checked
        is_left = checked == checks
    while tried < tries and not work.is_over:
        begin, tried = tried, min(tried + work.portion(pace.size), tries)
        with pace.measured(tried - begin):
            shortcutter.improve(draws, begin, tried, FIRST_SHORTCUTS if first_round else LATER_SHORTCUTS)
        work.done += tried - begin
    waypoints, words, lengths = (np.array(view[:shortcutter.count])
                                 for view in (shortcutter.poses, shortcutter.words, shortcutter.lengths))
    smoothed = Path(waypoints, words, lengths, path.radius)
    return smoothed if field.test_accepts(smoothed) else path


class Smoother:
    """Smooths the best path of a search as long as that is worthwhile, by random numbers of its own."""

    def __init__(self, objective: Objective, seed: int, work: Work):
        self._objective, self._seed, self._work = objective, seed, work
        self._exhausted_at = math.inf

    @cached_property
    def _rng(self) -> np.random.Generator:
        return np.random.default_rng((self._seed, 2))  # apart from those of the samples and of hybrid A*

    def smooth(self, path: Path, first_round: bool) -> Path:
        """Return a path with the same ends that never costs more."""
        return smooth(path, self._objective.vehicle, self._objective.field, self._rng, first_round, self._work,
                      self._objective)

    def simplify(self, path: Path, work: Work) -> Path:
        """Return a path with the same ends and fewer curves that costs hardly more; the same path where the cost is the length.

        A bend that is wider than the turning radius is no Dubins curve, and the search makes it of many.
        """
        if self._objective.is_length:
            return path
        rng = np.random.default_rng((self._seed, 4))
        price = price_of_curve(self._objective.vehicle)
        cost, before = self._objective.path_cost(path) + price * len(path.words), math.inf
        for _ in range(SIMPLIFICATIONS):
            if before - cost < price or work.is_over:
                break
            path = smooth(path, self._objective.vehicle, self._objective.field, rng, False, work, self._objective,
                          price)
            before, cost = cost, self._objective.path_cost(path) + price * len(path.words)
        return path

    def record(self, before: float, after: float) -> None:
        """Record the costs of the best path before and after a round."""
        self._exhausted_at = after if before - after <= WORTHWHILE_GAIN * before else math.inf

    def is_worthwhile(self, cost: float) -> bool:
        """Return True unless the last round gained little and the best path has not become cheaper since."""
        return cost < self._exhausted_at
