"""Check a certificate: that its path can be driven, and that no path is shorter than its bound (`docs/proof.md`)."""

import gzip
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from .bounds import too_high
from .levels import Corridor, gradients
from .maps import UnreadableMap, World, read_map

#: Greatest error of the path's end [m, rad], and distance of a curve from the polygon that stands for it [m].
END, SAGITTA = 1e-6, 1e-6
#: Allowance for rounding, as a share of all lengths: some thousand times what the formulas lose.
MARGIN = 1e-11
#: Greatest range of headings [rad] of the boxes into which those of the goal are cut, and greatest number of boxes across it.
GOAL_TURN, GOAL_PARTS = 0.1, 8
#: Number of times that a square is halved at most, both ways, to show that the vehicle's disc cannot be there.
SQUARE_HALVINGS = 12
#: The arcs of a path, and which way they turn.
TURNS = {"L": 1, "S": 0, "R": -1}
#: The cells before and after a crossing of a level.
Portal = tuple[int, int]


class Refused(Exception):
    """A certificate that does not hold; the message says what does not."""


def check(certificate: str | Path, map_path: str | Path) -> dict[str, Any]:
    """Return the claims of a certificate, if they hold.

    Raises:
        Refused: they do not, or the file is no certificate.
        UnreadableMap, OSError: a file cannot be read.
    """
    try:
        data = Path(certificate).read_bytes()
        text = gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data
        document = json.loads(text, parse_float=_finite, parse_constant=_finite)
        world = read_map(map_path, bool(document["map"]["allow_unknown"]))
        _demand(document["map"] == world.description | {"allow_unknown": document["map"]["allow_unknown"]},
                "the map is not the one that the certificate is for")
        _check_path(document, world)
        _Bound(document, world).check()
    except UnreadableMap:
        raise
    except (KeyError, IndexError, TypeError, ValueError, ArithmeticError, EOFError, gzip.BadGzipFile) as error:
        raise Refused(f"the file is not as certificates are: {type(error).__name__}: {error}") from None
    return {name: document[name] for name in ("request", "length", "bound")}


def _finite(number: str) -> float:
    if not math.isfinite(float(number)):
        raise ValueError(f"{number} is no number of a certificate")
    return float(number)


def _demand(holds: Any, otherwise: str) -> None:
    if not holds:
        raise Refused(otherwise)


def _check_path(document: dict[str, Any], world: World) -> None:
    """Refuse a path that the vehicle cannot drive from the start to the goal, or that is longer than claimed."""
    request, length, path = document["request"], document["length"], document["path"]
    sizes = [request[name] for name in ("robot_radius", "goal_tolerance_xy", "goal_tolerance_yaw")]
    _demand(request["turning_radius"] > 0 and min(sizes) >= 0, "the vehicle or a tolerance has a size below 0")
    can = [word in TURNS and metres >= 0 and radius >= request["turning_radius"] * (1 - END) for word, radius, metres in path]
    _demand(all(can), "the path turns tighter than the vehicle can, or drives backwards")
    own = sum(metres for _, _, metres in path)
    _demand(own <= length * (1 + MARGIN), f"the path is {own:.9g} m long")
    outline = np.array(request["footprint"] or [(0, 0)], dtype=float)
    poses = _poses(world.own(request["start"]), path, float(np.hypot(*outline.T).max()))
    x, y, heading = poses[-1] - world.own(request["goal"])
    off = math.hypot(x, y) - request["goal_tolerance_xy"]
    turned = abs(math.remainder(heading, math.tau)) - request["goal_tolerance_yaw"]
    _demand(off <= END and turned <= END, f"the path ends {off:.2g} m and {turned:.2g} rad beyond the goal's tolerance")
    wider = 1e-9 * world.size if request["footprint"] else request["robot_radius"]
    c, s, at = np.cos(poses[:, 2:]), np.sin(poses[:, 2:]), poses[:, :2, None]
    corners = (at + np.stack([c, s], axis=1) * outline[:, 0] + np.stack([-s, c], axis=1) * outline[:, 1]).swapaxes(1, 2)
    start = shapely.Polygon(corners[0]) if len(outline) > 2 else shapely.MultiPoint(corners[0]).convex_hull
    _demand(not len(world.touched(np.array([start]), wider)), "the vehicle touches an obstacle where it starts")
    for edge in range(len(outline)):
        swept = np.concatenate([corners[:-1, (edge, edge - 1)], corners[1:, (edge, edge - 1)]], axis=1)
        for hit in world.touched(shapely.convex_hull(shapely.multipoints(swept)), wider + SAGITTA):
            raise Refused(f"the vehicle comes too near to an obstacle at {poses[hit, :2].round(3).tolist()}")


def _poses(start: tuple[float, float, float], path: list[Any], reach: float) -> np.ndarray:
    """Return (n, 3) poses, so close that what is within `reach` [m] drives within SAGITTA of a straight line between them."""
    poses = [np.array([start])]
    for word, radius, metres in path:
        x, y, heading = poses[-1][-1]
        turn = TURNS[word] * metres / radius
        # What is at `reach` drives on a circle of a radius of at most radius + reach.
        parts = max(1, math.ceil(abs(turn) * math.sqrt((radius + reach) / (8 * SAGITTA))))
        share = np.arange(1, parts + 1) / parts
        chord, towards = metres * share * np.sinc(turn * share / math.tau), heading + turn * share / 2
        poses.append(np.column_stack([x + chord * np.cos(towards), y + chord * np.sin(towards), heading + turn * share]))
    return np.concatenate(poses)


class _Bound:
    """The proof that no path is shorter than the bound."""

    def __init__(self, document: dict[str, Any], world: World):
        self._document, self._world, request = document, world, document["request"]
        self._radius, self._bound, self._limit = (float(number) for number in (
            request["turning_radius"], document["bound"], document["limit"]))
        self._start, self._goal = world.own(request["start"]), world.own(request["goal"])
        self._tolerance = float(request["goal_tolerance_xy"])
        self._start_box = pose_box(*self._start)
        self._goal_boxes = goal_boxes(self._goal, self._tolerance, request["goal_tolerance_yaw"], self._bound)
        self._inner = inner_radius(request)
        self._margin = MARGIN * (self._limit + world.size)

    def check(self) -> None:
        """Raise Refused where something of the proof does not hold."""
        if not self._document["levels"]:
            return self._check_edges({}, 0, {0}, math.inf)
        corridor = self._corridor = Corridor(self._document)
        _demand(corridor.to_goal.side > 0, "the squares have no size")
        _demand(np.all(np.diff(corridor.levels) > 0) and not np.isin(corridor.from_start.costs, corridor.levels).any(),
                "the levels do not ascend, or one is a node's")
        self._check_squares()
        # What a path of at least the limit is longer than the bound at least, as costs at its ends may be above 0.
        near = corridor.domain & corridor.to_goal.near(*self._goal[:2], self._tolerance + self._margin)
        highest = corridor.to_goal.corners()[near].max() if self._tolerance else corridor.to_goal.at(*self._goal[:2])[1]
        enough = self._bound + max(0.0, float(highest)) + self._margin
        _demand(self._limit >= enough + max(0.0, corridor.from_start.at(*self._start[:2])[1]), "the corridor is too narrow")
        self._find_cells()
        (start,), self._start_box[:, 9] = self._cells_at(self._start, 0.0)
        goals, self._goal_boxes[:, 9] = self._cells_at(self._goal, self._tolerance)
        return self._check_edges(self._portals(start, goals), start, goals, enough)

    def _check_squares(self) -> None:
        """Show that no cost rises by more than a metre a metre, and that nothing free touches the squares that have costs."""
        domain, (corner, side, _) = self._corridor.domain, self._corridor.to_goal
        for squares in (self._corridor.from_start, self._corridor.to_goal):
            slopes = np.hypot(*np.moveaxis(gradients(squares.triangles(*np.nonzero(domain))), -1, 0))
            _demand(np.all(slopes <= side * (1 - 5e-11)), "a potential is steeper than 1")
        around = np.pad(domain, 2)
        near = np.lib.stride_tricks.sliding_window_view(around, (3, 3)).any(axis=(2, 3)) & ~around[1:-1, 1:-1]
        points, half = corner + side * (np.argwhere(near)[:, ::-1] - 0.5), side / 2
        for _ in range(SQUARE_HALVINGS):
            room = self._room(points)
            _demand(np.all(room < self._inner), "the vehicle may be outside of all squares")
            points, half = points[room + half * math.sqrt(2) >= self._inner], half / 2
            points = (points[:, None] + half * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])).reshape(-1, 2)
        _demand(not len(points), "the vehicle may be outside of all squares")

    def _room(self, points: np.ndarray) -> np.ndarray:
        return self._world.clearances(points, self._inner) + self._margin

    def _find_cells(self) -> None:
        """Take the cell of each part of a square from the certificate, and show that parts that meet have the same."""
        parts, named = self._corridor.parts, np.array(self._document["cells"], dtype=int)
        _demand(named.shape == (parts.sum(),) and named.min(initial=0) >= 0, "the cells do not fit the corridor")
        cells = self._cells = np.full(parts.shape, -1)  # where there is none
        cells[parts] = named
        for one, other in ((cells[:, :-1], cells[:, 1:]), (cells[:, :, :-1], cells[:, :, 1:]),
                           (cells[:, :-1, :-1], cells[:, 1:, 1:]), (cells[:, :-1, 1:], cells[:, 1:, :-1])):
            _demand(np.all((one == other) | (one < 0) | (other < 0)), "two cells meet within a slab")

    def _cells_at(self, pose: tuple[float, float, float], tolerance: float) -> tuple[set[int], float]:
        """Return the cells that may hold a place that is as near to a pose [m], and the cost there if it is the only one."""
        if tolerance:
            found = self._cells[:, self._corridor.to_goal.near(*pose[:2], tolerance + self._margin)]
            return set(found[found >= 0].tolist()), math.nan
        square, cost = self._corridor.from_start.at(*pose[:2])
        is_inside = self._corridor.mask[square] and np.abs(self._corridor.levels - cost).min() > END
        _demand(is_inside, "an end is not inside a slab")
        return {int(self._cells[int(self._corridor.slabs(cost)), *square])}, cost

    def _portals(self, start: int, goals: set[int]) -> dict[Portal, np.ndarray]:
        """Return the boxes of all portals that a path may come through, those that may be free, after showing that they cover."""
        gates, rows = self._corridor.gates(), self._document["boxes"]
        _demand(len(rows) == len(gates.cost), "the boxes do not fit the gates")
        before, after = (self._cells[slab, gates.row, gates.column].tolist() for slab in (gates.before, gates.after))
        keys = list(zip(before, after, strict=True))
        used = used_portals(set(keys), start, goals)
        found: dict[Portal, list[tuple[float, ...]]] = {key: [] for key in used}
        for gate, (key, boxes) in enumerate(zip(keys, rows, strict=True)):
            if key in used:
                _demand(_covers(boxes), f"boxes do not cover a level at {gates.ends[gate].round(3).tolist()}")
                found[key] += [(gate, *row) for row in boxes]
        portals = {}
        for key, some in found.items():
            table = np.array(some, dtype=float)
            boxes = gates.boxes(table[:, 0].astype(int), table[:, 1:], self._margin)
            closed = np.isnan(boxes[:, 8])
            room = self._room(boxes[closed, :2]) + boxes[closed, 4]
            _demand(np.all(room < self._inner), "a box that may be free has no potential")
            portals[key] = boxes[~closed]
        return portals

    def _check_edges(self, portals: dict[Portal, np.ndarray], start: int, goals: set[int], enough: float) -> None:
        """Show that no potential is higher than the curves from the start allow, or those before it and the curves from there."""
        # After the others what is left of the way to the goal is too long by itself.
        opened = {key: boxes[boxes[:, 8] + boxes[:, 10] < enough] for key, boxes in portals.items()}
        steps = [(boxes, before == start, [opened[key] for key in opened if key[1] == before and key[0] != after])
                 for (before, after), boxes in portals.items()]
        steps += [(self._goal_boxes, start in goals, [opened[key] for key in opened if key[1] in goals])]
        for boxes, is_first, ahead in steps:
            excess = too_high(self._start_box, boxes, self._radius, self._margin)
            if not is_first:
                boxes = boxes[excess > 0]
                excess = np.max([too_high(some, boxes, self._radius, self._margin) for some in ahead], axis=0, initial=0)
            if excess.max(initial=0) > 0:
                place = boxes[excess.argmax(), (0, 1, 6)].round(3).tolist()
                raise Refused(f"the potential at {place} is {excess.max():.3g} m higher than those before it allow")


def goal_boxes(goal: tuple[float, float, float], tolerance: float, turn: float, bound: float) -> np.ndarray:
    """Return boxes that cover where the goal is reached, with the bound as their potential."""
    parts, turn = GOAL_PARTS if tolerance else 1, min(turn, math.pi)
    turns = max(1, math.ceil(2 * turn / GOAL_TURN))
    half, turn = tolerance / parts, turn / turns
    middles = [(2 * i + 1 - parts) * half for i in range(parts)]
    return np.concatenate([pose_box(goal[0] + x, goal[1] + y, goal[2] + (2 * i + 1 - turns) * turn, half, turn, bound)
                           for x in middles for y in middles for i in range(turns)
                           if math.hypot(max(0.0, abs(x) - half), max(0.0, abs(y) - half)) <= tolerance])


def pose_box(x: float, y: float, heading: float, half: float = 0.0, turn: float = 0.0, potential: float = 0.0) -> np.ndarray:
    """Return the box of the poses near one, whose cost is not known."""
    return np.array([[x, y, 1.0, 0.0, half, half, heading, turn, potential, math.nan, 0.0]])


def inner_radius(request: dict[str, Any]) -> float:
    """Return the radius of the largest disc around the reference point in the vehicle, 0 where there is none [m]."""
    if not request["footprint"]:
        return float(request["robot_radius"])
    outline = shapely.Polygon(request["footprint"])
    return float(outline.exterior.distance(shapely.Point(0, 0))) if outline.contains(shapely.Point(0, 0)) else 0.0


def used_portals(portals: set[Portal], start: int, goals: set[int]) -> set[Portal]:
    """Return the portals on ways from the start to the goal that never go straight back, nor into the start's cell."""
    last = next(iter(goals)) if len(goals) == 1 else None  # a path ends with its last visit there
    portals = {(before, after) for before, after in portals if before != after and after != start and before != last}
    onward = {one: {other for other in portals if other[0] == one[1] and other[1] != one[0]} for one in portals}
    back = {one: {other for other in portals if one in onward[other]} for one in portals}
    return (_reached(onward, {portal for portal in portals if portal[0] == start})
            & _reached(back, {portal for portal in portals if portal[1] in goals}))


def _reached(links: dict[Portal, set[Portal]], found: set[Portal]) -> set[Portal]:
    """Return what can be reached by links, from what is found already on."""
    due = found
    while due:
        due = set().union(*(links[portal] for portal in due)) - found
        found = found | due
    return found


def _covers(rows: list[list[float]]) -> bool:
    """Return whether rectangles (s0, s1, h0, h1, ...) cover the one from (0, -1) to (1, 1) and nothing else."""
    rectangles = np.array(rows, dtype=float).reshape(-1, 5)[:, :4]
    s, h = np.unique(rectangles[:, :2]), np.unique(rectangles[:, 2:])
    held = [(s0 <= s[:-1, None]) & (s[1:, None] <= s1) & (h0 <= h[:-1]) & (h[1:] <= h1) for s0, s1, h0, h1 in rectangles]
    return bool(held) and (s[0], s[-1], h[0], h[-1]) == (0, 1, -1, 1) and bool(np.any(held, axis=0).all())
