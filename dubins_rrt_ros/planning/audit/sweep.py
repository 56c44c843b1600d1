"""The least clearance of a vehicle along arcs, for the audit, with an error bound that holds between samples too.

A disc is judged by the point in its middle. On a piece of length s with clearances c and c' at its ends no point has less than
(c + c' - s) / 2, since the clearance changes by at most a metre per metre.

A polygon is judged by its edges. What it sweeps is where it begins, and what its edges sweep. On a piece every point of an edge
runs along a circle or straight on, so it stays within the sagitta of that arc from its chord, and all these chords lie in the
convex hull of where the edge begins and where it ends. So nothing on the piece is nearer to the obstacles than that hull, less
the sagitta, which falls with the square of the length. For the hull to be as tight as that, an edge is divided where it moves
along itself: on either side of that point it sweeps to one side only. The hull of all of the polygon at both ends holds all these
hulls: where it keeps clear, the edges need no look.

Where very many pieces of a disc's path stay undecided, as along a wall, the point in its middle is judged as such a polygon.

Pieces are divided until the bounds decide.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..problem import Problem
from ..text import at, fixed
from ..vehicle import Vehicle
from .obstacles import Obstacles, PathsideSquares, PolygonObstacles, obstacles_of

#: Penetration that counts as a violation [m]; between samples at most twice this goes unnoticed.
CONTACT = 1e-6
#: Least radius of a disc that is judged [m]: a point could cross a line at a clearance of 0.
POINT = 1e-5
#: Required clearance of a polygon [m]. It exceeds 2 CONTACT, since in an obstacle the distance is 0 at any depth.
TOUCH = 3 * CONTACT
#: Absolute [m] and relative error of the least clearance; the larger one counts.
PRECISION, SHARE = 1e-3, 0.02
#: Number of pieces after which the clearance counts as undecidable, as of a path that grazes curved walls all along.
MOST_PIECES = 4_000_000
#: Approximate number of pieces that a path is cut into at first, and maximum number of parts that an undecided piece is cut into.
FIRST_PIECES, PARTS = 48, 12
#: Maximum number of pieces of a disc that are judged at once, for the sake of memory and of the time, and how many of them take
#: as long as a piece for each corner of a polygon.
AT_ONCE, EFFORT = 4096, 2
#: Number of undecided pieces of a disc's path from which on they are judged by their chords.
MANY = 1024
#: Number of cells around a polygon within which obstacles are sought at first.
FIRST_CELLS = 24
#: Distance within which obstacles are sought at first around a disc, in required clearances and at least [m].
FIRST_REACH, LEAST_REACH = 3, 0.5
#: Number of cells beyond the size of a vehicle within which its gap at a pose is measured.
CELLS_AROUND = 8
#: Approximate maximum number of points along a path around which cells are read.
MOST_POINTS = 10_000


@dataclass(frozen=True)
class Arcs:
    """Arcs as arrays: the poses at which they begin [m, rad], their curvatures [1/m], positive to the left, and lengths [m]."""

    x: np.ndarray
    y: np.ndarray
    theta: np.ndarray
    curvature: np.ndarray
    length: np.ndarray

    def at(self, index: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the poses at arc lengths `s` of the arcs `index`: along the chord, which halves the turn."""
        half = self.curvature[index] * s / 2
        chord = s * np.sinc(half / math.pi)
        direction = self.theta[index] + half
        return self.x[index] + chord * np.cos(direction), self.y[index] + chord * np.sin(direction), self.theta[index] + 2 * half

    def pieces(self, longest: float | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cut each arc into pieces of one size; return the indices of their arcs, their begins and sizes.

        Args:
            longest: maximum size of the pieces [m], of all arcs or of each.
        """
        count = np.maximum(np.ceil(self.length / longest), 1).astype(int)
        index, nth = _counted(count)
        size = (self.length / count)[index]
        return index, nth * size, size


def any_time() -> None:
    """Let an audit go on, however long it takes."""


def clearance_findings(arcs: Arcs, problem: Problem, slack: float = 0.0, obstacles: Obstacles | None = None,
                       check_time: Callable[[], None] = any_time) -> tuple[list[str], float]:
    """Return what is wrong with the clearance along arcs, a sentence each, and the least clearance [m].

    Args:
        slack: maximum distance of the vehicle from where the arcs put it [m].
        obstacles: those of the problem's map, where they are known already.
        check_time: called every few milliseconds; what it raises ends the audit.
    """
    vehicle = problem.vehicle
    required_clearance = slack + (TOUCH if vehicle.footprint else max(vehicle.robot_radius, POINT))
    least, (x, y), decided = _least_clearance(arcs, problem, required_clearance, obstacles, check_time)
    findings = []
    if not decided:
        findings.append(f"at {at((x, y), 3)} and elsewhere the clearance is so close to {required_clearance:g} m "
                        "that it cannot be decided")
    if least < required_clearance - CONTACT:
        what = _too_near(least, vehicle, f"the {fixed(slack, 6)} m that the poses are off their arcs" if slack > CONTACT else "")
        findings.append(f"at {at((x, y), 3)} {what}")
    return findings, least


def _too_near(least: float, vehicle: Vehicle, off: str) -> str:
    if vehicle.footprint:
        return f"the footprint's clearance is {fixed(least, 6)} m, " + (f"no more than {off}" if off else "which is contact")
    return (f"the clearance is {fixed(least, 6)} m, less than the robot's radius, {vehicle.robot_radius:g} m"
            + (f", and {off}" if off else ""))


_Least = tuple[float, tuple[float, float], bool]


def _least_clearance(arcs: Arcs, problem: Problem, required_clearance: float, obstacles: Obstacles | None,
                     check_time: Callable[[], None]) -> _Least:
    """Return the least clearance, where it is, and whether no piece can hide contact."""
    obstacles = obstacles or obstacles_of(problem.map, problem.allow_unknown)
    footprint = problem.vehicle.footprint
    if not footprint:
        return _least_of_disc(arcs, obstacles, required_clearance, check_time)
    if isinstance(obstacles, PolygonObstacles):
        return refine(arcs, PolygonSweep(footprint, obstacles), required_clearance, check_time)
    reach = FIRST_CELLS * obstacles.grid.resolution
    spacing = max(reach, float(arcs.length.sum()) / MOST_POINTS)
    index, begin, _ = arcs.pieces(spacing)
    x, y, _ = arcs.at(index, begin)
    while True:
        squares = obstacles.near_path(x + 1j * y, problem.vehicle.robot_radius + spacing, reach, check_time)
        found = refine(arcs, PolygonSweep(footprint, squares), required_clearance, check_time)
        if found[0] < squares.reach:
            return found
        reach *= 4


def _least_of_disc(arcs: Arcs, obstacles: Obstacles, required_clearance: float, check_time: Callable[[], None]) -> _Least:
    """Return what `_least_clearance` does, for a disc: obstacles far away are left out, unless there are no others."""
    reach = max(FIRST_REACH * required_clearance, LEAST_REACH)
    while True:
        found = refine(arcs, DiscSweep(obstacles, reach), required_clearance, check_time)
        if found[0] < reach:
            return found
        reach *= 8


@dataclass(frozen=True)
class Pieces:
    """Pieces of arcs as arrays: the indices of their arcs, their begins and sizes, and the clearances at both ends [m]."""

    index: np.ndarray
    begin: np.ndarray
    size: np.ndarray
    at_begin: np.ndarray
    at_end: np.ndarray

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, chosen: np.ndarray | slice) -> "Pieces":
        return Pieces(*(a[chosen] for a in (self.index, self.begin, self.size, self.at_begin, self.at_end)))

    def divided(self, least: "_LeastFound", parts: np.ndarray) -> "Pieces":
        """Return them, each cut into (n,) `parts`, whose ends are measured."""
        piece, nth = _counted(parts)
        size = (self.size / parts)[piece]
        index, begin, at_begin = self.index[piece], self.begin[piece] + nth * size, self.at_begin[piece]
        inner = nth > 0
        at_begin[inner] = least.measure(index[inner], begin[inner])
        at_end = np.roll(at_begin, -1)
        at_end[np.cumsum(parts) - 1] = self.at_end
        return Pieces(index, begin, size, at_begin, at_end)


def _counted(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return each index as often as its count says, and beside it 0, 1, ... up to the count."""
    index = np.repeat(np.arange(len(counts)), counts)
    return index, np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)


class DiscSweep:
    """A vehicle that is a disc, as the point in its middle.

    Attributes:
        reach: distances are exact up to here, and never more [m].
        at_once: maximum number of pieces that are judged at once.
    """

    at_once = AT_ONCE

    def __init__(self, obstacles: Obstacles, reach: float = math.inf):
        self._obstacles, self.reach = obstacles, reach

    def clearance(self, x: np.ndarray, y: np.ndarray, theta: np.ndarray, reach: float = math.inf) -> np.ndarray:
        """Return the clearance at poses [m]; `reach` makes no difference, as the clearance ahead is known by that here."""
        return self._obstacles.distance(x, y, self.reach)

    def bound(self, arcs: Arcs, pieces: Pieces, enough: float = math.inf) -> np.ndarray:
        """Return lower bounds of the clearance on pieces; those above `enough` [m] need not be close."""
        bounds: np.ndarray = (pieces.at_begin + pieces.at_end - pieces.size) / 2
        low = np.flatnonzero(bounds < enough)
        if len(low) >= MANY:
            bounds[low] = np.maximum(bounds[low], self._bound_by_chords(arcs, pieces[low], enough))
        return bounds

    def parts(self, pieces: Pieces, enough: float) -> np.ndarray:
        """Return the numbers of parts that pieces are cut into: as many as suffice if the clearance is even in between."""
        room = pieces.at_begin + pieces.at_end - 2 * enough
        return np.asarray(np.ceil(pieces.size / np.maximum(room, pieces.size / PARTS)).clip(2, PARTS).astype(int))

    def _bound_by_chords(self, arcs: Arcs, pieces: Pieces, enough: float) -> np.ndarray:
        x, y, _ = arcs.at(pieces.index, pieces.begin)
        reach = float(min(enough + pieces.size.max(), self.reach))
        obstacles = self._obstacles.near_path(x + 1j * y, float(pieces.size.max()), reach)
        return PolygonSweep(((0.0, 0.0),), obstacles).bound(arcs, pieces, enough)


def fastest(corners: np.ndarray, curvature: np.ndarray) -> np.ndarray:
    """Return (n,) the speeds of the fastest of a polygon's corners x + iy on arcs, in metres per metre along them."""
    return np.asarray(np.abs(1 + 1j * np.outer(curvature, corners)).max(axis=1))


class PolygonSweep:
    """A vehicle that is a polygon; its corners are x + iy here, and turned by a complex factor.

    Attributes:
        at_once: maximum number of pieces that are judged at once.
    """

    def __init__(self, corners: Sequence[tuple[float, float]], obstacles: PolygonObstacles | PathsideSquares):
        self._corners = np.array([complex(*corner) for corner in corners])
        self._obstacles = obstacles
        self.at_once = max(2 * PARTS, AT_ONCE // (EFFORT * len(corners)))

    def clearance(self, x: np.ndarray, y: np.ndarray, theta: np.ndarray, reach: float = math.inf) -> np.ndarray:
        """Return the clearance at poses, at most `reach` [m]."""
        return self._obstacles.shape_distance(self._placed(x, y, theta, self._corners), reach=reach)

    def bound(self, arcs: Arcs, pieces: Pieces, enough: float = math.inf) -> np.ndarray:
        """Return lower bounds of the clearance on pieces; those above `enough` [m] need not be close."""
        curvature = arcs.curvature[pieces.index]
        # A circle's arc that turns by an angle a has the sagitta r (1 - cos(a / 2)), which is at most r a^2 / 8.
        sagitta: np.ndarray = fastest(self._corners, curvature) * np.abs(curvature) * pieces.size**2 / 8
        reach = enough + float(sagitta.max(initial=0.0)) + CONTACT  # so that rounding leaves more than enough
        bounds = self._swept(arcs, pieces, self._corners, reach) - sagitta
        low = np.flatnonzero(bounds < enough) if len(self._corners) > 1 else np.empty(0, int)
        if len(low):
            bounds[low] = self._bound_by_edges(arcs, pieces[low], reach) - sagitta[low]
        return np.asarray(np.minimum(pieces.at_begin, bounds))

    def parts(self, pieces: Pieces, enough: float) -> np.ndarray:
        """Return the numbers of parts that pieces are cut into, two each, as the error falls with the square of the size."""
        return np.full(len(pieces), 2)

    def _bound_by_edges(self, arcs: Arcs, pieces: Pieces, reach: float) -> np.ndarray:
        """Return the least distances of the hulls of the edges, at most `reach`."""
        piece, edges = self._edges(arcs.curvature[pieces.index])
        swept = self._swept(arcs, pieces[piece], edges, reach)
        return np.asarray(np.minimum.reduceat(swept, np.searchsorted(piece, np.arange(len(pieces)))))

    def _swept(self, arcs: Arcs, pieces: Pieces, points: np.ndarray, reach: float) -> np.ndarray:
        """Return the distances of the hulls of where points of the vehicle are at both ends of pieces, at most `reach`."""
        ends = [self._placed(*arcs.at(pieces.index, s), points) for s in (pieces.begin, pieces.begin + pieces.size)]
        return np.asarray(self._obstacles.shape_distance(np.concatenate(ends, axis=1), hull=True, reach=reach))

    @staticmethod
    def _placed(x: np.ndarray, y: np.ndarray, theta: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return where points of the vehicle, the same or others of each pose, are at poses."""
        placed: np.ndarray = (x + 1j * y)[:, None] + np.exp(1j * theta)[:, None] * points
        return placed

    def _edges(self, curvature: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the edges, in the vehicle's frame, divided where they move along themselves while it drives with the curvatures.

        Returns:
            For each of them the index of the curvature, and both ends, (n, 2).
        """
        first = np.tile(self._corners, (len(curvature), 1))
        along = np.roll(first, -1, axis=1) - first
        # A point p of the vehicle moves by 1 + ikp per metre; across the edge it moves by this, which changes evenly along it.
        across = (np.conj(along) * (1 + 1j * curvature[:, None] * first)).imag
        across_last = (np.conj(along) * (1 + 1j * curvature[:, None] * (first + along))).imag
        divided = across * across_last < 0
        share = np.divide(across, across - across_last, out=np.ones(across.shape), where=divided)
        ends = np.stack([first, first + share * along, first + along], axis=2)
        parts = np.stack([ends[:, :, :2], ends[:, :, 1:]], axis=2)
        kept = np.stack([np.ones_like(divided), divided], axis=2)
        return np.nonzero(kept)[0], parts[kept]


def pose_gaps(poses: np.ndarray, problem: Problem, obstacles: Obstacles | None = None) -> np.ndarray:
    """Return the gaps between vehicle and obstacles at (n, 3) poses [m]; negative, or 0 for polygons, where they meet."""
    obstacles, vehicle = obstacles or obstacles_of(problem.map, problem.allow_unknown), problem.vehicle
    x, y, theta = np.asarray(poses, dtype=float).T
    if not vehicle.footprint:
        return DiscSweep(obstacles).clearance(x, y, theta) - vehicle.robot_radius
    cell = 0.0 if isinstance(obstacles, PolygonObstacles) else obstacles.grid.resolution
    near = obstacles.near_path(x + 1j * y, vehicle.robot_radius, vehicle.robot_radius + CELLS_AROUND * cell)
    return PolygonSweep(vehicle.footprint, near).clearance(x, y, theta)


class _LeastFound:
    """The least clearance of all points of the arcs at which it was measured, and where it is.

    Attributes:
        clearance: the least one [m]; infinity before the first.
        place: its x and y [m].
    """

    def __init__(self, arcs: Arcs, vehicle: DiscSweep | PolygonSweep):
        self._arcs, self._vehicle = arcs, vehicle
        self.clearance, self.place = math.inf, (math.nan, math.nan)

    def measure(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the clearances at arc lengths `s` of the arcs `index`, and remember the least; those above it may be cut."""
        x, y, theta = self._arcs.at(index, s)
        found = self._vehicle.clearance(x, y, theta, self.clearance)
        nearest = int(np.argmin(found))
        if found[nearest] < self.clearance:
            self.clearance, self.place = float(found[nearest]), (float(x[nearest]), float(y[nearest]))
        return found


def refine(arcs: Arcs, vehicle: DiscSweep | PolygonSweep, required_clearance: float, check_time: Callable[[], None]) -> _Least:
    """Divide the pieces until none can hide contact; return the least clearance, where it is, and whether that was achieved."""
    least = _LeastFound(arcs, vehicle)
    waiting, judged = _first_pieces(arcs, least, vehicle.at_once, check_time), 0
    while waiting and judged <= MOST_PIECES and least.clearance >= required_clearance - CONTACT:
        check_time()
        pieces = waiting.pop()
        judged += len(pieces)
        enough = max(required_clearance - 2 * CONTACT, least.clearance - max(PRECISION, SHARE * least.clearance))
        undecided = pieces[vehicle.bound(arcs, pieces, enough) < enough]
        for first in range(0, len(undecided), vehicle.at_once // PARTS):
            some = undecided[first:first + vehicle.at_once // PARTS]
            waiting.append(some.divided(least, vehicle.parts(some, enough)))
    return least.clearance, least.place, judged <= MOST_PIECES


def _first_pieces(arcs: Arcs, least: _LeastFound, at_once: int, check_time: Callable[[], None]) -> list[Pieces]:
    """Return the pieces that a path is cut into at first, in portions."""
    index, begin, size = arcs.pieces(max(float(arcs.length.sum()) / FIRST_PIECES, PRECISION))
    portions = (slice(first, first + at_once) for first in range(0, len(index), at_once))
    return [_with_ends(index[some], begin[some], size[some], least, check_time) for some in portions]


def _with_ends(index: np.ndarray, begin: np.ndarray, size: np.ndarray, least: _LeastFound, check_time: Callable[[], None]
               ) -> Pieces:
    """Return pieces, whose ends are measured."""
    check_time()
    # A piece ends where the next begins, but for the last of an arc.
    last = np.append(index[1:] != index[:-1], True)
    found = least.measure(np.append(index, index[last]), np.append(begin, begin[last] + size[last]))
    at_end = np.roll(found[:len(index)], -1)
    at_end[last] = found[len(index):]
    return Pieces(index, begin, size, found[:len(index)], at_end)
