"""Detours: where a path may be shorter in another corridor, and in which squares to plan it there."""

import math
from typing import NamedTuple, Protocol

import numpy as np
from scipy import ndimage

from .._kernels import UNLIMITED
from .._kernels.corridors import Descent, saddles
from ..collision.clearance import ClearanceField
from ..curves.path import Path
from ..problem import Problem
from .cost import Objective
from .cost_to_go import CostToGo

#: Weight of the cost-to-go and visit penalty of searches.
Searches = tuple[tuple[float, float], ...]
#: A search that finds a nearly shortest path, and one that finds a path soon.
NEAR_SHORTEST, SOON = (1.1, 0.0), (2.0, 0.5)
#: Distance from the path within which no other corridor begins; distance from the way over a saddle within which it is planned,
#: and length of the path that is planned anew before and behind it, in lengths of manoeuvres.
APART, WIDTH, MARGIN = 1.0, 3.0, 4.0
#: Maximum number of squares near nodes that are listed at once: their number grows with the square of the turning radius.
MOST_AT_ONCE = 1_000_000
#: Minimum share of the way over a saddle that leads where nothing was planned before.
LEAST_NEW = 0.25
#: Range of the random length of the path before and behind a closed place that is planned anew, and maximum distance of the walls
#: that the place is closed between, in lengths of manoeuvres.
MARGINS, LONGEST_BAR = (5.0, 40.0), 6.0
#: Maximum length of a way around a closed place that is planned at first, relative to what it is to replace.
LONGEST_WAY = 1.2
#: Number of places that are looked at for one that may have a detour.
PLACES = 32
#: Minimum relative decrease of the path's cost for which the regions where no cheaper one can lead are found anew.
CLOSE = 1e-3
#: Share of the path between one closed place and the next, by the golden ratio, which spreads them evenly.
NEXT_PLACE = (math.sqrt(5) - 1) / 2


class Detour(NamedTuple):
    """A part of a path that is to be planned anew.

    Attributes:
        first, last: the waypoints at its ends.
        free: (rows, columns) int8, not 0 for each of the field's squares that it may lead over.
    """

    first: int
    last: int
    free: np.ndarray


class _Bar(NamedTuple):
    """A row of squares from the path to a wall.

    Attributes:
        rows, columns: of the squares.
        wall: number of the region that it ends at, or 0 where it ends before.
    """

    rows: np.ndarray
    columns: np.ndarray
    wall: int


class Detours(Protocol):
    """A source of detours.

    Attributes:
        most_in_vain: number of tries in a row without a shorter path after which no more is asked for.
        is_finite: True if each of its detours is tried once.
        searches: how a detour is planned, until it is found.
    """

    most_in_vain: int
    is_finite: bool
    searches: Searches

    def next(self, path: Path) -> Detour | None:
        """Return one more detour of a path that is cut into short pieces, or None."""


class Landscape:
    """The squares of the cost-to-go that are free for a vehicle, and the lengths of the shortest ways over them.

    Attributes:
        free: (rows, columns) int8, not 0 for each of them.
        costs: (rows, columns) costs of the nodes from the start, and to the goal [m].
        lengths: (rows, columns) costs of the ways over them, about [m]; 1e300 where there are none.
        least: the least of them.
        cells, side: their side in cells of the clearance's raster, and in metres.
        scale: length of the vehicle's manoeuvres in sides of a square.
    """

    def __init__(self, problem: Problem, field: ClearanceField, from_start: CostToGo, to_goal: CostToGo):
        """Take the costs, both of them bounds."""
        self.cells, self.free = field.free_squares(problem.vehicle.required_clearance)
        self.side = self.cells * field.kernel.resolution
        self.scale = problem.vehicle.maneuver_scale / self.side
        self._frame = field.frame
        self.costs = from_start.kernel.nodes(), to_goal.kernel.nodes()
        self.lengths = self._lengths()
        self.least = float(self.lengths.min())
        self._regions: np.ndarray | None = None
        self._limit = math.inf  # of the lengths between the regions

    def _lengths(self) -> np.ndarray:
        free, nodes = self.free, sum(self.costs)
        lengths = np.full(free.shape, UNLIMITED)
        lengths[:-1, :-1] = 0.25 * (nodes[:-1, :-1] + nodes[1:, :-1] + nodes[:-1, 1:] + nodes[1:, 1:])
        lengths[(free == 0) | (lengths >= 0.25 * UNLIMITED)] = UNLIMITED
        return lengths

    def places(self, points: np.ndarray) -> np.ndarray:
        """Return columns and rows of (..., 2) points [m]; they are whole numbers at the nodes."""
        return np.asarray(1 + self._frame.from_map(points[..., :2]) / self.side)

    def regions(self, cost: float) -> np.ndarray:
        """Return (rows, columns) int32: 0 where a path cheaper than about `cost` may lead, else the number of a region."""
        if self._regions is None or cost < self._limit * (1 - CLOSE):
            self._limit = cost
            self._regions = ndimage.label(self.lengths >= cost)[0]
        return self._regions


class SaddleDetours:
    """Detours over saddles of the shortest ways' lengths, the one that promises most first."""

    most_in_vain: int = 24
    is_finite: bool = True
    searches: Searches = (NEAR_SHORTEST, SOON)

    def __init__(self, problem: Problem, landscape: Landscape, objective: Objective, limit: float):
        """Find the saddles with ways cheaper than `limit` [m]."""
        self._landscape, self._objective = landscape, objective
        self._descent = Descent(landscape.free, *landscape.costs)
        self._planned = np.zeros(landscape.free.shape, np.int8)  # not 0 for each node of where it was planned
        column, row = landscape.places(np.array(problem.start)).astype(int)
        nowhere = np.full(landscape.free.size, -1, np.int32)
        shortest = self._descent.way(row * landscape.free.shape[1] + column, nowhere)
        self._seeds = np.concatenate([shortest, saddles(landscape.lengths.reshape(-1), landscape.free.shape[1], limit)])

    def next(self, path: Path) -> Detour | None:
        """Return the detour with the greatest gain by the costs in relation to its length."""
        if APART * self._landscape.scale >= math.hypot(*self._landscape.free.shape):
            return None  # the whole map is near the path
        owners, costs = self._owners(path), np.append(0.0, np.cumsum(self._objective.curve_costs(path)))
        ends, lengths, new = self._descent.measure(self._seeds, owners, self._planned.reshape(-1))
        gains = costs[ends[:, 1]] - costs[ends[:, 0]] - lengths
        rates = gains / (lengths + 2 * MARGIN * self._landscape.scale * self._landscape.side)
        rates[(ends.min(axis=1) < 0) | (new < LEAST_NEW)] = 0
        best = int(np.argmax(rates))
        if rates[best] <= 0:
            return None
        begin, end = ends[best].tolist()
        first, last = _around(path, begin, end, MARGIN * self._landscape.scale * self._landscape.side)
        way = self._descent.way(int(self._seeds[best]), owners)
        free = self._near(way, self._landscape.places(path.waypoints), first, begin, end, last)
        self._mark(free, way)
        return Detour(first, last, free)

    def _owners(self, path: Path) -> np.ndarray:
        """Return (n,) int32: the waypoint near each node, or -1."""
        rows, columns = self._landscape.free.shape
        reach = max(1.5, APART * self._landscape.scale)
        steps = np.arange(-math.floor(reach), math.floor(reach) + 1)
        up, right = np.nonzero(steps[:, None]**2 + steps**2 <= reach**2)
        places = np.rint(self._landscape.places(path.waypoints)).astype(int)
        owners = np.full((rows, columns), -1, np.int32)
        at_once = max(1, MOST_AT_ONCE // len(up))
        for begin in range(0, len(places), at_once):
            column, row = places[begin:begin + at_once].T
            squares = (np.clip(row[:, None] + steps[up], 0, rows - 1), np.clip(column[:, None] + steps[right], 0, columns - 1))
            owners[squares] = np.arange(begin, begin + len(row))[:, None]
        return owners.reshape(-1)

    def _near(self, way: np.ndarray, places: np.ndarray, first: int, begin: int, end: int, last: int) -> np.ndarray:
        """Return the free squares near a way and the path before and behind it, but for those nearer to the path between."""
        free, scale = self._landscape.free, self._landscape.scale
        rows, columns = np.divmod(way, free.shape[1])
        points = np.concatenate([_filled(places[first:begin + 1]), np.column_stack([columns, rows]),
                                 _filled(places[end:last + 1])])
        reach = WIDTH * scale + 2
        window = _window(points, reach, free.shape)
        distance = _distances(points, window)
        allowed = (distance <= reach) & (distance <= _distances(_filled(places[begin:end + 1]), window) + APART * scale)
        near = np.zeros_like(free)
        near[window] = free[window] * allowed
        return near

    def _mark(self, free: np.ndarray, way: np.ndarray) -> None:
        """Mark the nodes of squares, and those of a way, as planned."""
        for nodes in self._planned[:-1, :-1], self._planned[1:, :-1], self._planned[:-1, 1:], self._planned[1:, 1:]:
            nodes |= free[:-1, :-1]
        self._planned.reshape(-1)[way] = 1


class ClosedPlaces:
    """Detours around places of the path, each of which is closed from wall to wall, or as far as a bar reaches.

    Walls are where no cheaper path can lead. Where those on both sides belong to the same region every cheaper path leads through
    the place, and there is no detour.
    """

    most_in_vain: int = 128
    is_finite: bool = False
    searches: Searches = (SOON, NEAR_SHORTEST)

    def __init__(self, landscape: Landscape, objective: Objective, rng: np.random.Generator):
        self._landscape, self._objective, self._rng = landscape, objective, rng
        self._place = 0.0

    def next(self, path: Path) -> Detour | None:
        """Return the detour around the next place that may have one."""
        regions, arc_lengths = self._landscape.regions(self._objective.path_cost(path)), path.arc_lengths()
        for _ in range(PLACES):
            self._place = (self._place + NEXT_PLACE) % 1.0
            place = int(np.searchsorted(arc_lengths, self._place * arc_lengths[-1]))
            if 0 < place < len(arc_lengths) - 1:
                left, right = (self._bar(path.waypoints[place], side, regions) for side in (1, -1))
                if left.wall == 0 or left.wall != right.wall:
                    return self._around_bar(path, place, (left, right), regions)
        return None

    def _around_bar(self, path: Path, place: int, bars: tuple[_Bar, _Bar], regions: np.ndarray) -> Detour:
        margin = math.exp(self._rng.uniform(*np.log(MARGINS)))
        first, last = _around(path, place, place, margin * self._landscape.scale * self._landscape.side)
        free = self._between(path, first, last, regions)
        for bar in bars:
            free[bar.rows, bar.columns] = free[bar.rows, bar.columns - 1] = 0
        return Detour(first, last, free)

    def _between(self, path: Path, first: int, last: int, regions: np.ndarray) -> np.ndarray:
        """Return the free squares over which a cheaper way that is not much longer may lead between two waypoints."""
        free, ends = self._landscape.free, self._landscape.places(path.waypoints[[first, last]])
        length = LONGEST_WAY * (path.arc_lengths()[last] - path.arc_lengths()[first]) / self._landscape.side
        window = _window(ends, (length - math.hypot(*(ends[1] - ends[0]))) / 2 + 3, free.shape)
        between = np.zeros_like(free)
        between[window] = regions[window] == 0
        return between

    def _bar(self, pose: np.ndarray, side: int, regions: np.ndarray) -> _Bar:
        """Return the squares from a pose to the wall on its left (side 1) or right (-1)."""
        place, neighbour = self._landscape.places(np.array([pose[:2], pose[:2] + self._landscape.side * np.array(
            [-math.sin(pose[2]), math.cos(pose[2])])]))
        steps = np.arange(0, LONGEST_BAR * self._landscape.scale, 0.5)
        columns, rows = (place + side * steps[:, None] * (neighbour - place)).astype(int).T
        inside = (rows >= 0) & (rows < regions.shape[0]) & (columns > 0) & (columns < regions.shape[1])
        columns, rows = columns[inside], rows[inside]
        walls = np.flatnonzero(regions[rows, columns])
        stop = walls[0] if len(walls) else len(rows)
        return _Bar(rows[:stop], columns[:stop], int(regions[rows[stop], columns[stop]]) if len(walls) else 0)


def _around(path: Path, begin: int, end: int, margin: float) -> tuple[int, int]:
    """Return the waypoints that are `margin` [m] before one and behind another."""
    arc_lengths = path.arc_lengths()
    first = int(np.searchsorted(arc_lengths, arc_lengths[begin] - margin, "right")) - 1
    last = int(np.searchsorted(arc_lengths, arc_lengths[end] + margin))
    return max(first, 0), min(last, len(arc_lengths) - 1)


def _filled(places: np.ndarray) -> np.ndarray:
    """Return places on the straight lines between (n, 2) places, at most one apart along rows and columns."""
    steps = np.diff(places, axis=0)
    shares = np.linspace(0, 1, math.ceil(np.abs(steps).max(initial=1)), endpoint=False)
    between = places[:-1, None] + shares[:, None] * steps[:, None]
    return np.concatenate([between.reshape(-1, 2), places[-1:]])


def _window(places: np.ndarray, reach: float, shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Return the rows and columns within reach of (n, 2) places."""
    low = np.maximum(np.floor(places.min(axis=0) - reach).astype(int), 0)
    high = np.minimum(np.ceil(places.max(axis=0) + reach).astype(int), np.array(shape[::-1]) - 2)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _distances(places: np.ndarray, window: tuple[slice, slice]) -> np.ndarray:
    """Return (rows, columns) distances of the squares in a window from (n, 2) places, which count as if they lay in it."""
    away = np.ones([part.stop - part.start for part in window], bool)
    columns, rows = places.astype(int).T
    away[np.clip(rows - window[0].start, 0, len(away) - 1), np.clip(columns - window[1].start, 0, away.shape[1] - 1)] = False
    return np.asarray(ndimage.distance_transform_edt(away))
