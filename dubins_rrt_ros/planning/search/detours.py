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
#: Minimum share of the way over a saddle that leads where nothing was planned before.
LEAST_NEW = 0.25
#: Range of the random length of the path before and behind a closed place that is planned anew, and maximum distance of the walls
#: that the place is closed between, in lengths of manoeuvres.
MARGINS, LONGEST_BAR = (5.0, 40.0), 6.0
#: Maximum length of a way around a closed place that is planned at first, relative to what it is to replace.
LONGEST_WAY = 1.2
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


class Detours(Protocol):
    """A source of detours.

    Attributes:
        most_in_vain: number of tries in a row without a shorter path after which no more is asked for.
        searches: how a detour is planned, until it is found.
    """

    most_in_vain: int
    searches: Searches

    def next(self, path: Path) -> Detour | None:
        """Return one more detour of a path that is cut into short pieces, or None."""


class Squares:
    """The squares of the cost-to-go that are free for a vehicle.

    Attributes:
        free: (rows, columns) int8, not 0 for each of them.
        cells, side: their side in cells of the clearance's raster, and in metres.
        scale: length of the vehicle's manoeuvres in sides of a square.
    """

    def __init__(self, problem: Problem, field: ClearanceField):
        self.cells, self.free = field.free_squares(problem.vehicle.required_clearance)
        self.side = self.cells * field.kernel.resolution
        self.scale = problem.vehicle.maneuver_scale / self.side
        self._frame = field.frame

    def places(self, points: np.ndarray) -> np.ndarray:
        """Return columns and rows of (..., 2) points [m]; they are whole numbers at the nodes."""
        return np.asarray(1 + self._frame.from_map(points[..., :2]) / self.side)


class SaddleDetours:
    """Detours over saddles of the shortest ways' lengths, the one that promises most first."""

    most_in_vain: int = 24
    searches: Searches = (NEAR_SHORTEST, SOON)

    def __init__(self, problem: Problem, squares: Squares, objective: Objective, from_start: CostToGo, to_goal: CostToGo,
                 limit: float):
        """Find the saddles with ways cheaper than `limit` [m]; both costs are bounds."""
        self._squares, self._objective = squares, objective
        costs = from_start.kernel.nodes(), to_goal.kernel.nodes()
        self._descent = Descent(squares.free, *costs)
        self._planned = np.zeros(squares.free.shape, np.int8)  # not 0 for each node of where it was planned
        column, row = squares.places(np.array(problem.start)).astype(int)
        nowhere = np.full(squares.free.size, -1, np.int32)
        shortest = self._descent.way(row * squares.free.shape[1] + column, nowhere)
        self._seeds = np.concatenate([shortest, saddles(self._lengths(*costs).reshape(-1), squares.free.shape[1], limit)])

    def _lengths(self, from_start: np.ndarray, to_goal: np.ndarray) -> np.ndarray:
        """Return (rows, columns) lengths of the shortest ways over squares, about [m]; 1e300 where there are none."""
        free, nodes = self._squares.free, from_start + to_goal
        lengths = np.full(free.shape, UNLIMITED)
        lengths[:-1, :-1] = 0.25 * (nodes[:-1, :-1] + nodes[1:, :-1] + nodes[:-1, 1:] + nodes[1:, 1:])
        lengths[(free == 0) | (lengths >= 0.25 * UNLIMITED)] = UNLIMITED
        return lengths

    def next(self, path: Path) -> Detour | None:
        """Return the detour with the greatest gain by the costs in relation to its length."""
        owners, costs = self._owners(path), np.append(0.0, np.cumsum(self._objective.curve_costs(path)))
        ends, lengths, new = self._descent.measure(self._seeds, owners, self._planned.reshape(-1))
        gains = costs[ends[:, 1]] - costs[ends[:, 0]] - lengths
        rates = gains / (lengths + 2 * MARGIN * self._squares.scale * self._squares.side)
        rates[(ends.min(axis=1) < 0) | (new < LEAST_NEW)] = 0
        best = int(np.argmax(rates))
        if rates[best] <= 0:
            return None
        begin, end = ends[best].tolist()
        first, last = _around(path, begin, end, MARGIN * self._squares.scale * self._squares.side)
        way = self._descent.way(int(self._seeds[best]), owners)
        free = self._near(way, self._squares.places(path.waypoints), first, begin, end, last)
        self._mark(free, way)
        return Detour(first, last, free)

    def _owners(self, path: Path) -> np.ndarray:
        """Return (n,) int32: the waypoint near each node, or -1."""
        rows, columns = self._squares.free.shape
        reach = max(1.5, APART * self._squares.scale)
        steps = np.arange(-math.floor(reach), math.floor(reach) + 1)
        up, right = np.nonzero(steps[:, None]**2 + steps**2 <= reach**2)
        places = np.rint(self._squares.places(path.waypoints)).astype(int)
        row = np.clip(places[:, 1, None] + steps[up], 0, rows - 1)
        column = np.clip(places[:, 0, None] + steps[right], 0, columns - 1)
        owners = np.full((rows, columns), -1, np.int32)
        owners[row, column] = np.arange(len(places))[:, None]
        return owners.reshape(-1)

    def _near(self, way: np.ndarray, places: np.ndarray, first: int, begin: int, end: int, last: int) -> np.ndarray:
        """Return the free squares near a way and the path before and behind it, but for those nearer to the path between."""
        free, scale = self._squares.free, self._squares.scale
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
    """Detours around places of the path, each of which is closed from wall to wall, or as far as a bar reaches."""

    most_in_vain: int = 128
    searches: Searches = (SOON, NEAR_SHORTEST)

    def __init__(self, squares: Squares, rng: np.random.Generator):
        self._squares, self._rng = squares, rng
        self._place = 0.0

    def next(self, path: Path) -> Detour | None:
        """Return the detour around the next place."""
        self._place = (self._place + NEXT_PLACE) % 1.0
        margin = math.exp(self._rng.uniform(*np.log(MARGINS)))
        arc_lengths, metres = path.arc_lengths(), self._squares.scale * self._squares.side
        place = int(np.searchsorted(arc_lengths, self._place * arc_lengths[-1]))
        if not 0 < place < len(arc_lengths) - 1:
            return None
        first, last = _around(path, place, place, margin * metres)
        free = self._between(path, first, last)
        self._close(free, path.waypoints[place])
        return Detour(first, last, free)

    def _between(self, path: Path, first: int, last: int) -> np.ndarray:
        """Return the free squares over which a way as long as the path between two waypoints may lead: in an ellipse."""
        free, ends = self._squares.free, self._squares.places(path.waypoints[[first, last]])
        length = LONGEST_WAY * (path.arc_lengths()[last] - path.arc_lengths()[first]) / self._squares.side
        reach = (length - math.hypot(*(ends[1] - ends[0]))) / 2 + 2
        window = _window(ends, reach + 1, free.shape)
        rows, columns = (np.arange(part.start, part.stop) + 0.5 for part in window)
        away = sum(np.hypot(columns - column, rows[:, None] - row) for column, row in ends)
        between = np.zeros_like(free)
        between[window] = free[window] * (away <= length + 3)
        return between

    def _close(self, free: np.ndarray, pose: np.ndarray) -> None:
        """Take the squares from a pose to the walls on its left and on its right."""
        place, neighbour = self._squares.places(np.array([pose[:2], pose[:2] + self._squares.side * np.array(
            [-math.sin(pose[2]), math.cos(pose[2])])]))
        left = neighbour - place
        for side in (1, -1):
            steps = np.arange(0, LONGEST_BAR * self._squares.scale, 0.5)
            columns, rows = (place + side * steps[:, None] * left).astype(int).T
            inside = (rows >= 0) & (rows < free.shape[0]) & (columns > 0) & (columns < free.shape[1])
            columns, rows = columns[inside], rows[inside]
            walls = np.flatnonzero(self._squares.free[rows, columns] == 0)
            stop = walls[0] if len(walls) else len(rows)
            free[rows[:stop], columns[:stop]] = free[rows[:stop], columns[:stop] - 1] = 0


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
