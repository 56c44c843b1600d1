"""Check a certificate: that its path can be driven, and that no path is shorter than its bound (`docs/proof.md`)."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.lib.stride_tricks import sliding_window_view

from .bounds import part, too_high
from .levels import FROM_START, TO_GOAL, Squares, gradients
from .maps import World, read_map

#: Greatest error of the path's end [m, rad], and distance of a curve from the polygon that stands for it [m].
END, SAGITTA = 1e-6, 1e-6
#: Allowance for rounding, as a share of all lengths: some thousand times what the formulas lose.
MARGIN = 1e-11
#: Version of the certificates that are checked, and the greatest number of poses of a path.
VERSION, MOST_POSES = 1, 10**7
#: What is said of a document that is no certificate, and what reading it raises.
NO_CERTIFICATE = "the file is not as certificates are, which `dubins_rrt certify` writes"
_MALFORMED = (LookupError, TypeError, ValueError, ArithmeticError, AttributeError, RecursionError, MemoryError,
              shapely.errors.ShapelyError)
#: Greatest range of headings [rad] of the boxes into which those of the goal are cut, and greatest number of boxes across it.
GOAL_TURN, GOAL_PARTS = 0.1, 8
#: Number of times that a square is halved at most, both ways, to show that the vehicle's disc cannot be there.
SQUARE_HALVINGS = 12
#: The arcs of a path, and which way they turn.
TURNS = {"L": 1, "S": 0, "R": -1}
#: What stands for the cells from which a path comes to its start, and to which it goes from the goal.
BEFORE, AFTER = -1, -2


class Refused(Exception):
    """A certificate that does not hold; the message says what does not."""


def check(certificate: bytes, map_path: str | Path) -> dict[str, Any]:
    """Return the claims of a certificate, by its JSON, if they hold.

    Raises:
        Refused: they do not, or it is no certificate.
        UnreadableMap, OSError: the map cannot be read.
    """
    try:
        document = json.loads(certificate, parse_float=_finite, parse_constant=_finite)
        _check_numbers(document)
        world = read_map(map_path, bool(document["map"]["allow_unknown"]))
        _demand(document["map"] == world.description | {"allow_unknown": document["map"]["allow_unknown"]},
                "the map is not the one that the certificate is for")
        _check_path(document, world)
        _Bound(document, world).check()
    except _MALFORMED as error:
        raise Refused(f"{NO_CERTIFICATE}: {type(error).__name__}: {str(error)[:200]}") from None
    return {name: document[name] for name in ("request", "length", "bound")}


def _check_numbers(document: Any) -> None:
    """Refuse a document of another version, and numbers with which an inequality would hold that says nothing."""
    request, version, outline = document["request"], document["certificate"], document["request"]["footprint"]
    _demand(version == VERSION and type(version) is int, f"it is of version {version!r:.50}; version {VERSION} can be checked")
    sizes = {name: request[name] for name in ("turning_radius", "robot_radius", "goal_tolerance_xy", "goal_tolerance_yaw")}
    for name, number in (sizes | {name: document[name] for name in ("length", "bound", "limit")}).items():
        _demand(type(number) in (int, float), f"{name} is {number!r:.50}, which is no number")
    _demand(sizes["turning_radius"] > 0 and min(sizes.values()) >= 0, "the vehicle or a tolerance has a size below 0")
    _demand(type(document["map"]["allow_unknown"]) is bool, "allow_unknown is neither true nor false")
    _demand(not outline or shapely.is_valid(shapely.Polygon(outline)), "the footprint crosses itself")


def _finite(number: str) -> float:
    if not math.isfinite(float(number)):
        raise ValueError(f"{number} is no number of a certificate")
    return float(number)


def _demand(holds: Any, otherwise: str, world: World | None = None, points: Any = None) -> None:
    """Refuse unless something holds, or all of it; of points of the map's own frame the first that lacks it is told."""
    for missing in np.flatnonzero(~np.asarray(holds, dtype=bool)):
        raise Refused(otherwise if world is None else f"{otherwise} at {_place(world, points[missing])}")


def _place(world: World, point: np.ndarray) -> list[float]:
    """Return x and y of a point of the map's own frame in that of the poses, as messages have them [m]."""
    (x, y, yaw), (across, up, *_) = world.origin, point.tolist()
    c, s = math.cos(yaw), math.sin(yaw)
    return [round(x + c * across - s * up, 3), round(y + s * across + c * up, 3)]


def _check_path(document: dict[str, Any], world: World) -> None:
    """Refuse a path that the vehicle cannot drive from the start to the goal, or that is longer than claimed."""
    request, length, path = document["request"], document["length"], document["path"]
    can = [word in TURNS and metres >= 0 and radius >= request["turning_radius"] * (1 - END) for word, radius, metres in path]
    _demand(all(can), "the path turns tighter than the vehicle can, or drives backwards")
    own = sum(metres for _, _, metres in path)
    _demand(abs(own - length) <= length * MARGIN, f"the path is {own:.9g} m long")
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
            raise Refused(f"the vehicle comes too near to an obstacle at {_place(world, poses[hit])}")


def _poses(start: tuple[float, float, float], path: list[Any], reach: float) -> np.ndarray:
    """Return (n, 3) poses, so close that what is within `reach` [m] drives within SAGITTA of a straight line between them."""
    poses = [np.array([start])]
    for word, radius, metres in path:
        x, y, heading = poses[-1][-1]
        turn = TURNS[word] * metres / radius
        # What is at `reach` drives on a circle of a radius of at most radius + reach.
        parts = max(1, math.ceil(abs(turn) * math.sqrt((radius + reach) / (8 * SAGITTA))))
        _demand(parts + sum(map(len, poses)) <= MOST_POSES, "the path is too long to be looked at")
        share = np.arange(1, parts + 1) / parts
        chord, towards = metres * share * np.sinc(turn * share / math.tau), heading + turn * share / 2
        poses.append(np.column_stack([x + chord * np.cos(towards), y + chord * np.sin(towards), heading + turn * share]))
    return np.concatenate(poses)


class _Bound:
    """The proof that no path is shorter than the bound."""

    def __init__(self, document: dict[str, Any], world: World):
        self._document, self._world, request = document, world, document["request"]
        self._radius, self._bound, self._tolerance = request["turning_radius"], document["bound"], request["goal_tolerance_xy"]
        self._start, self._goal = world.own(request["start"]), world.own(request["goal"])
        self._margin, self._inner = margin_of(document, world), inner_radius(request)
        self._start_box = goal_boxes(self._start, 0, 0, 0, self._margin)
        self._goal_boxes = goal_boxes(self._goal, self._tolerance, request["goal_tolerance_yaw"], self._bound, self._margin)

    def check(self) -> None:
        """Raise Refused where something of the proof does not hold."""
        if not self._document["levels"]:
            # Of a limit far below 0 the margin would excuse any bound.
            _demand(self._document["limit"] >= max(0, self._bound), "the limit is below the bound")
            return self._check_steps(np.array([[False, True], [False, False]]), [self._start_box, self._goal_boxes], math.inf)
        squares = self._squares = Squares(self._document)
        _demand(squares.side > 0, "the squares have no size")
        _demand(np.all(np.diff(squares.levels) > 0) and not np.isin(squares.costs[FROM_START], squares.levels).any(),
                "the levels do not ascend, or one is a node's")
        self._check_squares()
        # What a path of at least the limit is longer than the bound at least, as costs at its ends may be above 0.
        near = squares.domain & squares.near(*self._goal[:2], self._tolerance + self._margin)
        highest = squares.corners[TO_GOAL][near].max() if self._tolerance else squares.at(TO_GOAL, *self._goal[:2])[1]
        enough = self._bound + max(0.0, float(highest)) + self._margin
        lowest = squares.at(FROM_START, *self._start[:2])[1]
        _demand(self._document["limit"] >= enough + max(0.0, lowest), "the corridor is too narrow")
        self._find_cells()
        (start,), self._start_box[:, 9] = self._cells_at(self._start, 0.0)
        goals, self._goal_boxes[:, 9] = self._cells_at(self._goal, self._tolerance)
        return self._check_gates(start, goals, enough)

    def _check_squares(self) -> None:
        """Show that no cost rises by more than a metre a metre, and that nothing free touches the squares that have costs."""
        squares, half = self._squares, self._squares.side / 2
        middles = squares.corner + squares.side * (np.argwhere(squares.domain)[:, ::-1] + 0.5)
        for which in (FROM_START, TO_GOAL):
            slopes = np.linalg.norm(gradients(squares.triangles(which, *np.nonzero(squares.domain))), axis=-1)
            is_flat = np.all(slopes <= squares.side * (1 - 5e-11), axis=1)
            _demand(is_flat, "a potential is steeper than 1", self._world, middles)
        around = np.pad(squares.domain, 2)
        near = sliding_window_view(around, (3, 3)).any(axis=(2, 3)) & ~around[1:-1, 1:-1]
        points = squares.corner + squares.side * (np.argwhere(near)[:, ::-1] - 0.5)
        for _ in range(SQUARE_HALVINGS):
            room = self._room(points)
            _demand(room < self._inner, "the vehicle may be outside of all squares", self._world, points)
            points, half = points[room + half * math.sqrt(2) >= self._inner], half / 2
            points = (points[:, None] + half * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])).reshape(-1, 2)
        _demand(np.zeros(len(points), bool), "the vehicle may be outside of all squares", self._world, points)

    def _room(self, points: np.ndarray) -> np.ndarray:
        return self._world.clearances(points, self._inner) + self._margin

    def _find_cells(self) -> None:
        """Take the cell of each part of a square from the certificate, and show that parts that meet have the same."""
        parts, named = self._squares.parts, np.array(self._document["cells"], dtype=int)
        _demand(named.shape == (parts.sum(),) and named.min(initial=0) >= 0, "the cells do not fit the corridor")
        cells = self._cells = np.full(parts.shape, -1)  # where there is none
        cells[parts] = named
        meeting = sliding_window_view(np.pad(cells, 1, constant_values=-1), (2, 2), axis=(1, 2))
        is_one = (meeting == meeting.max(axis=(3, 4), keepdims=True)) | (meeting < 0)
        _demand(is_one.all(), "two cells meet within a slab")

    def _cells_at(self, pose: tuple[float, float, float], tolerance: float) -> tuple[set[int], float]:
        """Return the cells that may hold a place that is as near to a pose [m], and the cost there if it is the only one."""
        if tolerance:
            found = self._cells[:, self._squares.near(*pose[:2], tolerance + self._margin)]
            return set(found[found >= 0].tolist()), math.nan
        square, cost = self._squares.at(FROM_START, *pose[:2])
        is_inside = self._squares.corridor[square] and np.abs(self._squares.levels - cost).min() > END
        _demand(is_inside, "an end is not inside a slab")
        return {int(self._cells[int(self._squares.slabs(cost)), *square])}, cost

    def _check_gates(self, start: int, goals: set[int], enough: float) -> None:
        """Show that boxes cover the gates of all ways from the start's cell to the goal's, and that their potentials hold."""
        gates, *parts = self._squares.gates()
        crossings, portal = np.unique(np.column_stack([self._cells[*some.T] for some in parts]), axis=0, return_inverse=True)
        rows = self._document["boxes"]
        gate = np.repeat(np.arange(len(rows)), [len(some) for some in rows])
        table = np.array([row for some in rows for row in some], dtype=float).reshape(-1, 5)
        _demand(len(rows) == len(gates) and np.all(np.abs(table[:, :4]) <= 1), "the boxes do not fit the gates")
        boxes = boxes_on(gates[gate], table, self._margin)
        closed = np.isnan(boxes[:, 8])
        room = self._room(boxes[closed, :2]) + boxes[closed, 4]
        _demand(room < self._inner, "a box that may be free has no potential", self._world, boxes[closed])
        steps = ways(crossings, start, goals)
        for number in np.flatnonzero(np.asarray(steps.any(axis=0))[portal]):
            _demand(_covers(table[gate == number]), "boxes do not cover a level", self._world, gates[[number]])
        on_portals = [boxes[~closed & (portal[gate] == number)] for number in range(len(crossings))]
        self._check_steps(steps, [*on_portals, self._start_box, *[self._goal_boxes] * len(goals)], enough)

    def _check_steps(self, steps: np.ndarray, boxes: list[np.ndarray], enough: float) -> None:
        """Show that no potential is higher than the curves from the start allow, or those before it and the curves from there."""
        # After the others what is left of the way to the goal is too long by itself.
        ahead = [some[some[:, 8] + some[:, 10] < enough] for some in boxes]
        for number in np.flatnonzero(steps.any(axis=0)):
            higher = boxes[number][too_high(self._start_box, boxes[number], self._radius, self._margin) > 0]
            before = np.flatnonzero(steps[:, number])
            excess = np.max([too_high(ahead[i], higher, self._radius, self._margin) for i in before], axis=0, initial=0)
            if excess.any():
                worst = np.argmax(excess)
                raise Refused(f"the potential at {_place(self._world, higher[worst])} is {higher[worst, 8]:.6g} m, "
                              f"{excess[worst]:.3g} m higher than those before it allow")


def margin_of(document: dict[str, Any], world: World) -> float:
    """Return the margin for rounding of a certificate's proof [m]."""
    return float(MARGIN * (document["limit"] + document["request"]["turning_radius"] + world.size))


def goal_boxes(goal: tuple[float, float, float], tolerance: float, turn: float, bound: float, margin: float) -> np.ndarray:
    """Return boxes that cover the poses within tolerances of one, with a potential, whose costs are not known.

    They are larger by a margin for rounding [m].
    """
    parts, turn = GOAL_PARTS if tolerance else 1, min(turn, math.pi)
    counts = parts, parts, max(1, math.ceil(2 * turn / GOAL_TURN))
    index = np.indices(counts).reshape(3, -1).T
    whole = [*goal[:2], 1.0, 0.0, tolerance, tolerance, goal[2], turn, bound, math.nan, 0.0]
    boxes = part(np.tile(whole, (len(index), 1)), 2 * index / counts - 1, 2 * (index + 1) / counts - 1)
    off = np.maximum(np.abs(boxes[:, :2] - goal[:2]) - boxes[:, 4:6], 0)
    boxes = boxes[np.hypot(*off.T) <= tolerance]
    boxes[:, 4:6] += margin
    return boxes


def boxes_on(gates: np.ndarray, rows: np.ndarray, margin: float) -> np.ndarray:
    """Return (n, 11) boxes on gates by (n, 5) rows of a certificate, larger by a margin for rounding [m]."""
    boxes = part(gates, rows[:, (0, 0, 2)], rows[:, (1, 1, 3)])  # a gate has no width
    boxes[:, 4:6] += margin
    boxes[:, 8] = rows[:, 4]
    return boxes


def inner_radius(request: dict[str, Any]) -> float:
    """Return the radius of the largest disc around the reference point in the vehicle, 0 where there is none [m]."""
    if not request["footprint"]:
        return float(request["robot_radius"])
    outline = shapely.Polygon(request["footprint"])
    return float(outline.exterior.distance(shapely.Point(0, 0))) if outline.contains(shapely.Point(0, 0)) else 0.0


def ways(crossings: np.ndarray, start: int, goals: set[int]) -> np.ndarray:
    """Return the steps of all ways through the cells from the start to the goal, as a mask over pairs of portals.

    Portals are the (n, 2) cells before and after a crossing, then the start, then the goal's cells. A way never goes straight
    back, nor into the cell of the start, nor on from that of the goal if there is but one: it ends with its last visit there.
    """
    before, after = np.array([*crossings.tolist(), (BEFORE, start), *((cell, AFTER) for cell in goals)]).T
    is_start, is_goal = before == BEFORE, after == AFTER
    is_last = ~is_goal & (len(goals) == 1) & np.isin(before, list(goals))
    on = is_start | (before != after) & (after != start) & ~is_last
    steps = (after[:, None] == before) & (before[:, None] != after) & on[:, None] & on
    reached, leads = is_start, is_goal
    for _ in before:
        reached, leads = reached | steps[reached].any(axis=0), leads | steps[:, leads].any(axis=1)
    return np.asarray(steps & (reached & leads)[:, None] & reached & leads)


def _covers(rectangles: np.ndarray) -> bool:
    """Return whether rectangles (s0, s1, h0, h1, ...) cover the one from (-1, -1) to (1, 1)."""
    s, h = (np.unique([-1, 1, *rectangles[:, axis:axis + 2].flat]) for axis in (0, 2))
    held = [(s0 <= s[:-1, None]) & (s[1:, None] <= s1) & (h0 <= h[:-1]) & (h[1:] <= h1) for s0, s1, h0, h1, _ in rectangles]
    return bool(np.any(held, axis=0).all())
