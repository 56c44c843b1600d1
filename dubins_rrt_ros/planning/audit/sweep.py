"""The least clearance of a vehicle along arcs, for the audit, with an error bound that holds between samples too.

A disc is judged by the point in its middle. On a piece of length s with clearances c and c' at its ends no point has less than
(c + c' - s) / 2, since the clearance changes by at most a metre per metre.

A polygon is judged by its edges. What it sweeps is where it begins, and what its edges sweep. On a piece every point of an edge
runs along a circle or straight on, so it stays within the sagitta of that arc from its chord, and all these chords lie in the
convex hull of where the edge begins and where it ends. So nothing on the piece is nearer to the obstacles than that hull, less
the sagitta, which falls with the square of the length. For the hull to be as tight as that, an edge is divided where it moves
along itself: on either side of that point it sweeps to one side only.

Pieces are halved until the bounds decide.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..maps.model import GridMap
from ..problem import Problem
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
#: Number of open pieces above which the clearance is undecidable, as of a path that grazes obstacles all along.
MOST_PIECES = 500_000
#: Approximate number of pieces that a path is cut into at first.
FIRST_PIECES = 64
#: Number of cells around a polygon within which obstacles are sought at first.
FIRST_CELLS = 24
#: Distance within which obstacles are sought at first around a disc, in required clearances and at least [m].
FIRST_REACH, LEAST_REACH = 3, 0.5
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

    def pieces(self, longest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cut each arc into pieces of one size, at most `longest`; return the indices of their arcs, their begins and sizes."""
        count = np.maximum(np.ceil(self.length / longest), 1).astype(int)
        index = np.repeat(np.arange(len(count)), count)
        nth = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
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
        findings.append(f"at ({x:.3f}, {y:.3f}) and elsewhere the clearance is so close to {required_clearance:g} m "
                        "that it cannot be decided")
    if least < required_clearance - CONTACT:
        what = _too_near(least, vehicle, f"the {slack:.6f} m that the poses are off their arcs" if slack > CONTACT else "")
        findings.append(f"at ({x:.3f}, {y:.3f}) {what}")
    return findings, least


def _too_near(least: float, vehicle: Vehicle, off: str) -> str:
    if vehicle.footprint:
        return f"the footprint's clearance is {least:.6f} m, " + (f"no more than {off}" if off else "which is contact")
    return (f"the clearance is {least:.6f} m, less than the robot's radius, {vehicle.robot_radius:g} m"
            + (f", and {off}" if off else ""))


_Least = tuple[float, tuple[float, float], bool]


def _least_clearance(arcs: Arcs, problem: Problem, required_clearance: float, obstacles: Obstacles | None,
                     check_time: Callable[[], None]) -> _Least:
    """Return the least clearance, where it is, and whether no piece can hide contact."""
    world_map, unknown, footprint = problem.map, problem.allow_unknown, problem.vehicle.footprint
    if not footprint:
        return _least_of_disc(arcs, obstacles or obstacles_of(world_map, unknown), required_clearance, check_time)
    if not isinstance(world_map, GridMap):
        polygons = obstacles if isinstance(obstacles, PolygonObstacles) else PolygonObstacles(world_map.free)
        return _bisect(arcs, PolygonSweep(footprint, polygons), required_clearance, check_time)
    reach = FIRST_CELLS * world_map.resolution
    spacing = max(reach, float(arcs.length.sum()) / MOST_POINTS)
    index, begin, _ = arcs.pieces(spacing)
    x, y, _ = arcs.at(index, begin)
    while True:
        squares = PathsideSquares(world_map, unknown, x + 1j * y, problem.vehicle.robot_radius + spacing, reach, check_time)
        found = _bisect(arcs, PolygonSweep(footprint, squares), required_clearance, check_time)
        if found[0] < squares.reach:
            return found
        reach *= 4


def _least_of_disc(arcs: Arcs, obstacles: Obstacles, required_clearance: float, check_time: Callable[[], None]) -> _Least:
    """Return what `_least_clearance` does, for a disc: obstacles far away are left out, unless there are no others."""
    reach = max(FIRST_REACH * required_clearance, LEAST_REACH)
    while True:
        found = _bisect(arcs, DiscSweep(obstacles, reach), required_clearance, check_time)
        if found[0] < reach:
            return found
        reach *= 8


class DiscSweep:
    """A vehicle that is a disc, as the point in its middle.

    Attributes:
        reach: distances are exact up to here, and never more [m].
    """

    def __init__(self, obstacles: Obstacles, reach: float = math.inf):
        self._obstacles, self.reach = obstacles, reach

    def clearance(self, x: np.ndarray, y: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the clearance at poses [m]."""
        return self._obstacles.distance(x, y, self.reach)

    def bound(self, arcs: Arcs, index: np.ndarray, begin: np.ndarray, size: np.ndarray,
              at_begin: np.ndarray, at_end: np.ndarray) -> np.ndarray:
        """Return lower bounds of the clearance on pieces, given the clearances at both ends of each."""
        bounds: np.ndarray = (at_begin + at_end - size) / 2
        return bounds


class PolygonSweep:
    """A vehicle that is a polygon; its corners are x + iy here, and turned by a complex factor."""

    def __init__(self, corners: tuple[tuple[float, float], ...], obstacles: PolygonObstacles | PathsideSquares):
        self._corners = np.array([complex(*corner) for corner in corners])
        self._obstacles = obstacles

    def clearance(self, x: np.ndarray, y: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return the clearance at poses [m]."""
        return self._obstacles.shape_distance((x + 1j * y)[:, None] + np.exp(1j * theta)[:, None] * self._corners)

    def bound(self, arcs: Arcs, index: np.ndarray, begin: np.ndarray, size: np.ndarray,
              at_begin: np.ndarray, at_end: np.ndarray) -> np.ndarray:
        """Return lower bounds of the clearance on pieces, given the clearances at both ends of each."""
        curvature = arcs.curvature[index]
        piece, edges = self._edges(curvature)
        corners = []
        for s in (begin, begin + size):
            x, y, theta = arcs.at(index, s)
            corners.append((x + 1j * y)[piece, None] + np.exp(1j * theta)[piece, None] * edges)
        swept = self._obstacles.shape_distance(np.concatenate(corners, axis=1), hull=True)
        # A circle's arc that turns by an angle a has the sagitta r (1 - cos(a / 2)), which is at most r a^2 / 8.
        speed: np.ndarray = np.abs(1 + 1j * np.outer(curvature, self._corners)).max(axis=1)
        sagitta = speed * np.abs(curvature) * size**2 / 8
        bounds: np.ndarray = np.minimum.reduceat(swept, np.searchsorted(piece, np.arange(len(index)))) - sagitta
        return np.asarray(np.minimum(at_begin, bounds))

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
        """Return the clearances at arc lengths `s` of the arcs `index`, and remember the least."""
        x, y, theta = self._arcs.at(index, s)
        found = self._vehicle.clearance(x, y, theta)
        nearest = int(np.argmin(found))
        if found[nearest] < self.clearance:
            self.clearance, self.place = float(found[nearest]), (float(x[nearest]), float(y[nearest]))
        return found


def _bisect(arcs: Arcs, vehicle: DiscSweep | PolygonSweep, required_clearance: float, check_time: Callable[[], None]) -> _Least:
    """Halve the pieces until none can hide contact; return the least clearance, where it is, and whether that was achieved."""
    least = _LeastFound(arcs, vehicle)
    index, begin, size = arcs.pieces(max(float(arcs.length.sum()) / FIRST_PIECES, PRECISION))
    # A piece ends where the next begins, but for the last of an arc.
    last = np.append(index[1:] != index[:-1], True)
    found = least.measure(np.append(index, index[last]), np.append(begin, arcs.length))
    at_begin, at_ends = np.split(found, [len(index)])
    at_end = np.roll(at_begin, -1)
    at_end[last] = at_ends
    while 0 < len(index) <= MOST_PIECES and least.clearance >= required_clearance - CONTACT:
        check_time()
        bound = vehicle.bound(arcs, index, begin, size, at_begin, at_end)
        is_open = ((bound < required_clearance - 2 * CONTACT)
                   | (bound < least.clearance - max(PRECISION, SHARE * least.clearance)))
        index, begin, size, at_begin, at_end = (a[is_open] for a in (index, begin, size / 2, at_begin, at_end))
        if len(index):
            at_middle = least.measure(index, begin + size)
            begin = np.concatenate([begin, begin + size])
            at_begin, at_end = np.concatenate([at_begin, at_middle]), np.concatenate([at_middle, at_end])
            index, size = np.tile(index, 2), np.tile(size, 2)
    return least.clearance, least.place, len(index) <= MOST_PIECES
