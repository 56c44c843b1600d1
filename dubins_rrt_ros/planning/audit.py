"""The independent judge of paths: shapely and plain numpy, no code in common with the planner.

It drives the curves by its own solution of the car's equations (1), and measures distances to the obstacles' true shapes.
The verdict on clearance holds between samples too: on a piece of length s with clearances c and c' at its ends no point has
less than (c + c' - s) / 2, since the clearance changes by at most a metre per metre; pieces are halved until that decides.
"""

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import shapely

from .map import GridMap, Map
from .path import Path
from .problem import Problem

#: How far a curve may end from where the next one begins [m, rad], and relatively how much tighter a turn may be.
TOLERANCE = 1e-6
#: A sample this much too near an obstacle is a finding [m]; what may lie between samples is at most that nearer still.
CONTACT = 1e-6
#: A vehicle without extent is judged as a disc of this radius [m]: a point may cross a line that it keeps the distance 0 to.
POINT = 1e-5
#: The least clearance is found to within this [m], or to within this share of it.
PRECISION, SHARE = 1e-3, 0.02
#: With more pieces than this open the clearance counts as undecidable: the path grazes the obstacles all along.
MOST_PIECES = 500_000
#: About how many pieces a path is cut into at first.
FIRST_PIECES = 64
#: Obstacles in a grid are looked for within so many cells of a point at first.
FIRST_REACH = 8
#: Cells are read, and kept, in square tiles with a margin around: the margin at least, the side of a tile in margins.
MARGIN, TILE = 64, 8
#: About how many rows of cells are searched at once, for the sake of memory.
ROWS_AT_ONCE = 1_000_000


@dataclass(frozen=True)
class Audit:
    """What the audit found.

    Attributes:
        findings: what is wrong with the path, one sentence each; none where it is right.
        min_clearance: the least distance between path and obstacles, to within a millimetre or 2 % [m].
        max_curvature: [1/m].
    """

    findings: tuple[str, ...]
    min_clearance: float
    max_curvature: float

    @property
    def ok(self) -> bool:
        """Whether nothing was found."""
        return not self.findings


def audit(path: Path, problem: Problem) -> Audit:
    """Judge a path of a problem: its ends, its joints, its turns and its clearance."""
    if broken := _broken_parts(path):
        return Audit(broken, 0.0, math.inf)
    starts, ends, arcs = _drive(path)
    findings = [*_end_findings(path, problem), *_joint_findings(path, starts, ends), *_turn_findings(path, problem)]
    obstacles = _obstacles_of(problem.map, problem.allow_unknown)
    need = max(problem.vehicle.robot_radius, POINT)
    least, where, decided = _least_clearance(arcs, obstacles, need)
    if not decided:
        findings.append(f"at ({where[0]:.3f}, {where[1]:.3f}) and elsewhere the clearance is so close to {need:g} m "
                        "that it cannot be decided")
    if least < need - CONTACT:
        findings.append(f"at ({where[0]:.3f}, {where[1]:.3f}) the clearance is {least:.6f} m, "
                        f"less than the robot's radius, {problem.vehicle.robot_radius:g} m")
    turning = [curve.radius for curve in path.curves if _turns(curve)]
    return Audit(tuple(findings), least, 1 / min(turning) if turning else 0.0)


@dataclass(frozen=True)
class _Arcs:
    """Arcs as arrays: where they begin, their curvature [1/m] (left is positive) and their length [m]."""

    x: np.ndarray
    y: np.ndarray
    theta: np.ndarray
    curvature: np.ndarray
    length: np.ndarray

    def at(self, index: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The poses at arc lengths `s` of the arcs `index`: along the chord, which halves the turn."""
        half = self.curvature[index] * s / 2
        chord = s * np.sinc(half / math.pi)
        direction = self.theta[index] + half
        return self.x[index] + chord * np.cos(direction), self.y[index] + chord * np.sin(direction), self.theta[index] + 2 * half


def _broken_parts(path: Path) -> tuple[str, ...]:
    """A sentence for each pose that is none and each curve that cannot be driven."""
    poses = [f"the path's {name} is {pose}" for name, pose in (("start", path.start), ("end", path.end))
             if not all(map(math.isfinite, pose))]
    return (*poses, *(f"curve {i} cannot be driven: start {curve.start}, radius {curve.radius}, lengths {curve.lengths}"
                 for i, curve in enumerate(path.curves)
                 if not (all(map(math.isfinite, (*curve.start, curve.radius, *curve.lengths)))
                         and curve.radius > 0 and min(curve.lengths) >= 0)))


def _turns(curve) -> bool:
    return any(length > 0 and turn != "S" for turn, length in zip(curve.word, curve.lengths, strict=True))


def _drive(path: Path) -> tuple[np.ndarray, np.ndarray, _Arcs]:
    """Starts and ends of the curves, (n, 3) each, and all their arcs; a path without curves is one arc of length 0."""
    signs = {"L": 1.0, "S": 0.0, "R": -1.0}
    starts = np.array([curve.start for curve in path.curves]).reshape(-1, 3)
    curvature = np.array([[signs[turn] / curve.radius for turn in curve.word] for curve in path.curves]).reshape(-1, 3)
    length = np.array([curve.lengths for curve in path.curves]).reshape(-1, 3)
    poses = [starts]
    for arc in range(3):
        one = _Arcs(*poses[-1].T, curvature[:, arc], length[:, arc])
        poses.append(np.column_stack(one.at(np.arange(len(starts)), length[:, arc])))
    if not path.curves:
        x, y, theta = path.start
        return starts, starts, _Arcs(*(np.array([value]) for value in (x, y, theta, 0.0, 0.0)))
    begins = np.concatenate(poses[:3])
    return starts, poses[3], _Arcs(*begins.T, curvature.T.ravel(), length.T.ravel())


def _end_findings(path: Path, problem: Problem) -> list[str]:
    findings = []
    if path.start != problem.start:
        findings.append(f"the path starts at {path.start}, not at {problem.start}")
    off, turned = _apart(path.end, problem.goal)
    if off > problem.goal_tolerance_xy + TOLERANCE or turned > problem.yaw_tolerance + TOLERANCE:
        findings.append(f"the path ends {off:.6f} m and {turned:.6f} rad from the goal, whose tolerance is "
                        f"{problem.goal_tolerance_xy:g} m and {problem.yaw_tolerance:g} rad")
    return findings


def _joint_findings(path: Path, starts: np.ndarray, ends: np.ndarray) -> list[str]:
    before = np.vstack([[path.start], ends])
    after = np.vstack([starts, [path.end]])
    findings = []
    for i, (a, b) in enumerate(zip(before, after, strict=True)):
        off, turned = _apart(a, b)
        if not (off <= TOLERANCE and turned <= TOLERANCE):
            findings.append(f"before curve {i} the path jumps by {off:.6g} m and {turned:.6g} rad at ({a[0]:.3f}, {a[1]:.3f})")
    return findings


def _turn_findings(path: Path, problem: Problem) -> list[str]:
    least = problem.vehicle.turning_radius
    findings = []
    for i, curve in enumerate(path.curves):
        if curve.radius < least * (1 - TOLERANCE):
            findings.append(f"curve {i} turns with a radius of {curve.radius:g} m, tighter than {least:g} m")
    return findings


def _apart(a, b) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses."""
    return math.hypot(a[0] - b[0], a[1] - b[1]), abs(math.remainder(a[2] - b[2], math.tau))


class _PolygonObstacles:
    """What is outside of polygons."""

    def __init__(self, free: shapely.Geometry):
        self._free = free
        corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(free)), return_index=True)
        edges = np.stack([corners[:-1], corners[1:]], axis=1)[ring[:-1] == ring[1:]]
        self._tree = shapely.STRtree(shapely.linestrings(edges))

    def distance(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Of points from the obstacles; 0 in one."""
        _, distance = self._tree.query_nearest(shapely.points(x, y), return_distance=True, all_matches=False)
        return np.where(shapely.contains_xy(self._free, x, y), distance, 0.0)


class _GridObstacles:
    """The squares of a grid's blocked cells, and what is outside the grid. Only cells near the points asked for are read."""

    def __init__(self, grid: GridMap, allow_unknown: bool):
        # Not the grid itself: it would be kept alive by what is kept for as long as it lives.
        self._data, self._resolution, self._origin = grid.data, grid.resolution, grid.origin
        self._allow_unknown = allow_unknown
        self._windows: dict[tuple[int, complex], _Window] = {}

    def distance(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Of points from the obstacles; 0 in one."""
        x0, y0, yaw = self._origin
        rows, columns = self._data.shape
        place = (x - x0 + 1j * (y - y0)) * np.exp(-1j * yaw) / self._resolution
        to_edge = np.minimum.reduce([place.real, columns - place.real, place.imag, rows - place.imag])
        out = np.where(to_edge > 0, to_edge, 0.0)
        reach, undecided = FIRST_REACH, np.flatnonzero(out)
        while len(undecided):
            out[undecided] = np.minimum(out[undecided], self._within(reach, place[undecided]))
            undecided = undecided[out[undecided] >= reach]
            reach *= 4
        return out * self._resolution

    def _within(self, reach: int, place: np.ndarray) -> np.ndarray:
        """How far points in the grid are from blocked cells, in cells; infinity where none is nearer than `reach`."""
        margin = max(MARGIN, reach)
        side = TILE * margin
        tiles = place.real // side + 1j * (place.imag // side)
        out = np.empty(len(place))
        at_once = max(1, ROWS_AT_ONCE // reach)
        for tile in set(tiles.tolist()):
            if (margin, tile) not in self._windows:
                self._windows[margin, tile] = self._window(side * tile, side, margin)
            here = np.flatnonzero(tiles == tile)
            for first in range(0, len(here), at_once):
                some = here[first:first + at_once]
                out[some] = self._windows[margin, tile].distance(place[some], reach)
        return np.where(out < reach, out, math.inf)

    def _window(self, corner: complex, side: int, margin: int) -> "_Window":
        """The cells of a square tile and those within the margin around it."""
        left, low = max(0, int(corner.real) - margin), max(0, int(corner.imag) - margin)
        part = self._data[low:int(corner.imag) + side + margin, left:int(corner.real) + side + margin]
        return _Window(GridMap(part, self._resolution).blocked(self._allow_unknown), left, low)


class _Window:
    """The blocked cells of a part of a grid.

    Args:
        blocked: (rows, columns) bool.
        left, low: the column and the row of the grid where the part begins.
    """

    def __init__(self, blocked: np.ndarray, left: int, low: int):
        self._rows = np.flatnonzero(blocked.any(axis=1))
        # With blocked columns on both sides every cell has a blocked one before and after it in its row.
        blocked = np.pad(blocked[self._rows], ((0, 0), (1, 1)), constant_values=True)
        self._width = blocked.shape[1]
        self._cells = np.flatnonzero(blocked)
        self._left, self._low = left - 1, low

    def distance(self, place: np.ndarray, reach: int) -> np.ndarray:
        """Of points from the blocked cells, in cells, where it is below `reach`; elsewhere it is `reach` or more.

        In each of the rows so near to a point that hold such cells, the next to the left and to the right are looked up.
        """
        if not len(self._rows):
            return np.full(len(place), math.inf)
        x, y = (place.real - self._left)[:, None], (place.imag - self._low)[:, None]
        to_either_side = min(reach, len(self._rows))
        row = np.searchsorted(self._rows, y.astype(int)) + np.arange(-to_either_side, to_either_side + 1)
        row = np.minimum(np.maximum(row, 0), len(self._rows) - 1)
        begin = row * self._width
        following = np.searchsorted(self._cells, begin + x.astype(int))
        beside = np.minimum(self._cells[following] - begin - x, x - (self._cells[following - 1] - begin) - 1)
        above = np.maximum(self._rows[row] - y, y - self._rows[row] - 1)
        return np.sqrt((np.maximum(beside, 0)**2 + np.maximum(above, 0)**2).min(axis=1))


_Obstacles = _GridObstacles | _PolygonObstacles
_obstacles: WeakKeyDictionary[Map, dict[bool, _Obstacles]] = WeakKeyDictionary()


def _obstacles_of(map: Map, allow_unknown: bool) -> _Obstacles:
    """Kept as long as the map, for the next path on it."""
    by_unknown = _obstacles.setdefault(map, {})
    if allow_unknown not in by_unknown:
        by_unknown[allow_unknown] = (_GridObstacles(map, allow_unknown) if isinstance(map, GridMap)
                                     else _PolygonObstacles(map.free))
    return by_unknown[allow_unknown]


def _least_clearance(arcs: _Arcs, obstacles: _Obstacles, need: float) -> tuple[float, tuple[float, float], bool]:
    """The least clearance, where it is, and whether no piece can hide contact: they are halved until that is so."""
    longest = max(float(arcs.length.sum()) / FIRST_PIECES, PRECISION)
    pieces = np.maximum(np.ceil(arcs.length / longest), 1).astype(int)
    index = np.repeat(np.arange(len(pieces)), pieces)
    nth = np.arange(len(index)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    size = (arcs.length / pieces)[index]
    begin = nth * size

    def clearance(index, s):
        nonlocal least, where
        x, y, _ = arcs.at(index, s)
        found = obstacles.distance(x, y)
        nearest = int(np.argmin(found))
        if found[nearest] < least:
            least, where = float(found[nearest]), (float(x[nearest]), float(y[nearest]))
        return found

    least, where = math.inf, (math.nan, math.nan)
    # A piece ends where the next begins, but for the last of an arc.
    at_begin, at_ends = np.split(clearance(np.append(index, np.arange(len(pieces))), np.append(begin, arcs.length)), [len(index)])
    at_end = np.roll(at_begin, -1)
    at_end[np.cumsum(pieces) - 1] = at_ends
    while 0 < len(index) <= MOST_PIECES and least >= need - CONTACT:
        bound = (at_begin + at_end - size) / 2
        open_ = (bound < need - 2 * CONTACT) | (bound < least - max(PRECISION, SHARE * least))
        index, begin, size, at_begin, at_end = (a[open_] for a in (index, begin, size / 2, at_begin, at_end))
        if len(index):
            at_middle = clearance(index, begin + size)
            begin = np.concatenate([begin, begin + size])
            at_begin, at_end = np.concatenate([at_begin, at_middle]), np.concatenate([at_middle, at_end])
            index, size = np.tile(index, 2), np.tile(size, 2)
    return least, where, len(index) <= MOST_PIECES
