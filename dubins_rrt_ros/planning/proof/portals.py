"""Portals: the connected parts of level sets, and from which of them chains may lead to which.

A path crosses the levels for the first time in their order, each in one of its portals. Only some of the portals are covered with
boxes; where a chain comes by another one nothing is asked of it. So the ways round have levels of their own: each is bounded by
portals where obstacles make it bend, and is free of those that the others need.

Between its first crossings of two levels a path does not come above the upper one. Where two portals are in different connected
parts of the places with costs from some way below the lower level up to the upper one, it goes back as far: that makes its length
at least the rise and twice the way back, so that a cheap chain does not change from one way round to another between two levels.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .boxes import Portal
from .level_sets import LevelSets

#: Ways back below a level that are looked at, ascending, as shares of the length of paths.
WAYS_BACK = 0.0025, 0.01, 0.04, 0.16


class Edge(NamedTuple):
    """An edge from one portal to another.

    Attributes:
        portal: the other one.
        least: length that no path between them falls below [m].
    """

    portal: Portal
    least: float


class PortalGraph:
    """The portals of all levels, and the chains of those that are covered.

    Attributes:
        portals: those that are covered, from the start to the goal; what leads to a portal is before it.
    """

    def __init__(self, sets: LevelSets, limit: float, start: Portal, goal: Portal):
        """Begin without levels; paths are shorter than `limit` [m]."""
        self._sets, self._limit = sets, limit
        self._levels = [[start], [goal]]
        self._ways_back = [np.zeros((1, 1))]
        self._sources: dict[int, list[Edge]] = {}  # edges to each covered portal, and from it, by its id
        self._targets: dict[int, list[Edge]] = {}
        self.link()

    @property
    def levels(self) -> np.ndarray:
        """The levels but those of start and goal, ascending [m]."""
        return np.array([portals[0].level for portals in self._levels[1:-1]])

    def portals_at(self, level: float) -> list[Portal]:
        """Return the portals of a level, which is added if it is new; none where no path crosses it."""
        for portals in self._levels[1:-1]:
            if portals[0].level == level:
                return portals
        portals = [Portal(self._sets, level, pieces, self._limit) for pieces in self._sets.portals(level, self._limit)]
        if portals:
            index = 1 + int(np.searchsorted(self.levels, level))
            self._levels.insert(index, portals)
            self._ways_back[index - 1:index] = [self._between(index - 1), self._between(index)]
        return portals

    def cover_between(self, source: Portal, target: Portal, level: float) -> bool:
        """Cover the portals of a level by which paths shorter than the limit may come from a portal to another; False if none."""
        between = [portal for portal in self.portals_at(level)
                   if target.level + self._way_back(source, portal) + self._way_back(portal, target) + target.left < self._limit]
        for portal in between:
            portal.cover()
        return bool(between)

    def link(self) -> None:
        """Find the edges anew, after levels were added or portals covered."""
        before = self._sources
        self.portals = [portal for portals in self._levels for portal in portals if portal.is_covered]
        self._sources = {id(portal): [] for portal in self.portals}
        self._targets = {id(portal): [] for portal in self.portals}
        for portal in self.portals:
            for other, back in self._reached_from(portal):
                least = other.level - portal.level + back
                self._sources[id(other)].append(Edge(portal, least))
                self._targets[id(portal)].append(Edge(other, least))
        for portal in self.portals:
            edges = self._sources[id(portal)]
            if edges != before.get(id(portal)):
                portal.before.forget()
                for edge in edges:
                    edge.portal.after.forget()

    def edges(self, portal: Portal, backwards: bool = False) -> list[Edge]:
        """Return the edges to a portal; backwards, those from it."""
        return (self._targets if backwards else self._sources)[id(portal)]

    def cut(self, portal: Portal, steps: int, backwards: bool) -> list[Edge]:
        """Return edges from portals of which each chain to a portal has one, some steps before; backwards, those after it."""
        found = {id(portal): Edge(portal, 0.0)}
        for _ in range(steps):
            following: dict[int, Edge] = {}
            for other, least in found.values():
                for edge in self.edges(other, backwards) or [Edge(other, 0.0)]:  # the start has none before it
                    known = following.get(id(edge.portal))
                    total = least + edge.least
                    if known is None or total < known.least:
                        following[id(edge.portal)] = Edge(edge.portal, total)
            if following.keys() == found.keys():
                break
            found = following
        return list(found.values())

    def _between(self, index: int) -> np.ndarray:
        """Return how far a path has to go back from the portals of a level to come to those of the next one, and there again."""
        below, above = self._levels[index:index + 2]
        ways = np.zeros((len(below), len(above)))
        is_last = index == len(self._levels) - 2
        if index == 0 or (is_last and above[0].squares[0] < 0):
            return ways
        for share in WAYS_BACK:
            back = share * self._limit
            labels = self._sets.components(below[0].level - back, math.inf if is_last else above[0].level, self._limit)
            here, there = (np.array([labels[portal.squares[0]] for portal in portals]) for portals in (below, above))
            apart = (here[:, None] != there) & (here[:, None] > 0) & (there > 0)
            if not apart.any():
                break
            ways[apart] = 2 * back
        return ways

    def _way_back(self, source: Portal, target: Portal) -> float:
        """Return how far a path goes back and forth from a portal to another over none that is covered; infinite if none can."""
        return next((back for other, back in self._reached_from(source, target) if other is target), math.inf)

    def _reached_from(self, portal: Portal, target: Portal | None = None) -> Iterator[tuple[Portal, float]]:
        """Yield the covered portals that chains lead to, over no other one, and how far a path goes back and forth for it.

        Args:
            target: taken to be covered.
        """
        index = next(index for index, portals in enumerate(self._levels) if portal in portals)
        costs = np.where([other is portal for other in self._levels[index]], 0, math.inf)
        for ways, portals in zip(self._ways_back[index:], self._levels[index + 1:], strict=True):
            if costs.min() == math.inf:
                return
            costs = (costs[:, None] + ways).min(axis=0)
            lengths = costs + [other.level + other.left for other in portals]
            costs[lengths >= self._limit] = math.inf
            for number in np.flatnonzero(costs < math.inf).tolist():
                if portals[number].is_covered or portals[number] is target:
                    yield portals[number], float(costs[number])
                    costs[number] = math.inf
