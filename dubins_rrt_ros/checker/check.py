"""Check a certificate: that its path can be driven, and that no path is shorter than its bound (`docs/proof.md`)."""

import gzip
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from .bounds import too_high
from .levels import DOWNWARD, UPWARD, Squares, squared_slopes
from .maps import UnreadableMap, World, read_map

#: Greatest error of the path's end [m, rad], and distance of a curve from the polygon that stands for it [m].
END, SAGITTA = 1e-6, 1e-6
#: Allowance for rounding, as a share of all lengths: some thousand times what the formulas lose.
MARGIN = 1e-11
#: Greatest range of headings [rad] of the boxes into which those of the goal are cut, and greatest number of boxes across it.
GOAL_TURN, GOAL_PARTS = 0.1, 8
#: Number of times that a square is halved at most, both ways, to show that the vehicle's disc cannot be there.
SQUARE_HALVINGS = 12


#: The cells before and after a crossing of a level; and the boxes of each.
Portal = tuple[int, int]
Portals = dict[Portal, np.ndarray]


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
        document = json.loads(gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data, parse_constant=_refuse)
        world = read_map(map_path, bool(document["map"]["allow_unknown"]))
        _demand(document["map"] == world.description | {"allow_unknown": document["map"]["allow_unknown"]},
                "the map is not the one that the certificate is for")
        _Path(document, world).check()
        _Bound(document, world).check()
    except (KeyError, IndexError, TypeError, ValueError, ArithmeticError, EOFError, gzip.BadGzipFile) as error:
        if isinstance(error, UnreadableMap):
            raise
        raise Refused(f"the file is not as certificates are: {type(error).__name__}: {error}") from None
    return {name: document[name] for name in ("request", "length", "bound")}


def _refuse(number: str) -> None:
    raise ValueError(f"{number} is no number of a certificate")


def _demand(holds: Any, otherwise: str) -> None:
    if not holds:
        raise Refused(otherwise)


class _Path:
    """The path of a certificate, as it drives from the start."""

    def __init__(self, document: dict[str, Any], world: World):
        self._request, self._world, self._segments = document["request"], world, document["path"]
        self._length = document["length"]
        self._radius = float(self._request["turning_radius"])

    def check(self) -> None:
        """Raise Refused where it is not free, does not end at the goal, or is longer than claimed."""
        sizes = (self._request[name] for name in ("robot_radius", "goal_tolerance_xy", "goal_tolerance_yaw"))
        _demand(self._radius > 0 and min(sizes) >= 0, "the vehicle or a tolerance has a size below 0")
        own = sum(metres for _, _, metres in self._segments)
        can = [metres >= 0 and word in ("L", "S", "R") and radius >= self._radius * (1 - END)
               for word, radius, metres in self._segments]
        _demand(all(can), "the path turns tighter than the vehicle can, or drives backwards")
        _demand(own <= self._length * (1 + MARGIN), f"the path is {own:.9g} m long")
        poses = self._poses()
        x, y, heading = self._world.own(self._request["goal"])
        off = math.hypot(poses[-1, 0] - x, poses[-1, 1] - y) - self._request["goal_tolerance_xy"]
        turned = abs(math.remainder(poses[-1, 2] - heading, math.tau)) - self._request["goal_tolerance_yaw"]
        _demand(off <= END and turned <= END, f"the path ends {off:.2g} m and {turned:.2g} rad beyond the goal's tolerance")
        self._check_clearance(poses)

    def _poses(self) -> np.ndarray:
        """Return (n, 3) poses along the path, so close that what is between them is within SAGITTA of a straight line."""
        x, y, heading = self._world.own(self._request["start"])
        poses, outline = [(x, y, heading)], self._request["footprint"]
        reach = max((math.hypot(*corner) for corner in outline), default=0.0)
        for word, radius, metres in self._segments:
            turn = {"L": 1, "S": 0, "R": -1}[word] * metres / radius
            # A corner at `reach` from the reference point drives on a circle of a radius of at most radius + reach.
            parts = max(1, math.ceil(abs(turn) * math.sqrt((radius + reach) / (8 * SAGITTA))))
            for part in range(1, parts + 1):
                angle, far = turn * part / parts, metres * part / parts
                chord = far * float(np.sinc(angle / math.tau))  # numpy's sinc is sin(pi t) / (pi t)
                towards = heading + angle / 2
                poses.append((x + chord * math.cos(towards), y + chord * math.sin(towards), heading + angle))
            x, y, heading = poses[-1]
        return np.array(poses)

    def _check_clearance(self, poses: np.ndarray) -> None:
        outline = np.array(self._request["footprint"] or [[0.0, 0.0]], dtype=float)
        wider = float(self._request["robot_radius"]) if not self._request["footprint"] else 1e-9 * self._world.size
        c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        corners = np.stack([poses[:, :1] + c * outline[:, 0] - s * outline[:, 1],
                            poses[:, 1:2] + s * outline[:, 0] + c * outline[:, 1]], axis=-1)
        hit = self._world.touched(np.array([shapely.MultiPoint(corners[0]).convex_hull if len(outline) < 3
                                            else shapely.Polygon(corners[0])]), wider)
        _demand(not len(hit), "the vehicle touches an obstacle where it starts")
        for edge in range(len(outline)):
            swept = np.concatenate([corners[:-1, (edge, edge - 1)], corners[1:, (edge, edge - 1)]], axis=1)
            hit = self._world.touched(shapely.convex_hull(shapely.multipoints(swept)), wider + SAGITTA)
            if len(hit):
                raise Refused(f"the vehicle comes too near to an obstacle at {poses[hit[0], :2].round(3).tolist()}")


class _Bound:
    """The proof that no path is shorter than the bound."""

    def __init__(self, document: dict[str, Any], world: World):
        self._document, self._world, request = document, world, document["request"]
        self._bound, self._radius = float(document["bound"]), float(request["turning_radius"])
        self._start, self._goal = world.own(request["start"]), world.own(request["goal"])
        self._tolerance, self._turn = float(request["goal_tolerance_xy"]), min(float(request["goal_tolerance_yaw"]), math.pi)
        self._inner = inner_radius(request)
        self._start_box = pose_box(*self._start, 0.0, 0.0, 0.0, math.nan)
        self._goal_boxes = goal_boxes(self._goal, self._tolerance, self._turn, self._bound)
        self._margin = MARGIN * (float(document["limit"]) + world.size)
        grid = document["squares"]
        x, y = map(float, grid["corner"])
        place = (x, y), float(grid["side"])
        _demand(place[1] > 0, "the squares have no size")
        self._levels = np.array(document["levels"], dtype=float)
        self._squares = Squares(*place, np.array(document["from_start"], dtype=float), self._levels)
        self._to_goal = Squares(*place, np.array(document["to_goal"], dtype=float), self._levels[:0])

    def check(self) -> None:
        """Raise Refused where something of the proof does not hold."""
        if not len(self._levels):
            return self._check_edges({}, 0, {0}, math.inf)
        domain = self._check_potentials()
        _demand(np.all(np.diff(self._levels) > 0) and not np.isin(self._squares.costs, self._levels).any(),
                "the levels do not ascend, or one is a node's")
        square, cost = self._squares.at(*self._start[:2])
        self._start_box[:, 9] = cost
        ends = self._squares.within(domain, *self._goal[:2], self._tolerance + self._margin)
        excess = max(0.0, cost) + max(0.0, self._highest_at_goal(ends))
        least = sum(squares.corners(domain).min(axis=(1, 2)) for squares in (self._squares, self._to_goal))
        limit = float(self._document["limit"])
        _demand(limit >= self._bound + excess + self._margin, "the corridor is too narrow")
        corridor = domain[least < limit]
        _demand(np.isin(square, corridor) and np.abs(self._levels - cost).min() > END, "the start is not inside a slab")
        self._find_cells(corridor)
        start, goals = int(self._cell(square, self._squares.slabs(cost))), self._goal_cells(np.intersect1d(ends, corridor))
        enough = self._bound + max(0.0, self._highest_at_goal(ends)) + self._margin
        return self._check_edges(self._portals(corridor, start, goals), start, goals, enough)

    def _highest_at_goal(self, ends: np.ndarray) -> float:
        """Return an upper bound of the cost to the goal where it is reached [m]."""
        return float(self._to_goal.corners(ends).max()) if self._tolerance else self._to_goal.at(*self._goal[:2])[1]

    def _goal_cells(self, ends: np.ndarray) -> set[int]:
        """Return the cells that may hold a place where the goal is reached."""
        if self._tolerance:
            high = self._squares.slabs(self._squares.corners(ends).max(axis=(1, 2)))
            return {int(cell) for square, first, last in zip(ends, self._low[ends], high, strict=True)
                    for cell in self._cell(square, np.arange(first, last + 1))}
        square, cost = self._squares.at(*self._goal[:2])
        _demand(np.isin(square, ends) and np.abs(self._levels - cost).min() > END, "the goal is not inside a slab")
        self._goal_boxes[:, 9] = cost
        return {int(self._cell(square, self._squares.slabs(cost)))}

    def _check_potentials(self) -> np.ndarray:
        """Return the squares that have costs, after showing that none is too steep and that nothing free touches them."""
        has = [~np.isnan(squares.costs) for squares in (self._squares, self._to_goal)]
        nodes = has[0] & has[1]
        free = np.array([[letter == "1" for letter in row] for row in self._document["squares"]["free"]])
        full = free & nodes[:-1, :-1] & nodes[1:, :-1] & nodes[:-1, 1:] & nodes[1:, 1:]
        domain = np.flatnonzero(full)
        for squares in (self._squares, self._to_goal):
            corners = squares.corners(domain)
            slopes = np.minimum(squared_slopes(corners, UPWARD), squared_slopes(corners, DOWNWARD))
            _demand(np.all(slopes <= squares.side**2 * (1 - 1e-10)), "a potential is steeper than 1")
        _demand(not (full[[0, -1]].any() or full[:, [0, -1]].any()), "squares with costs reach the border")
        around = np.pad(full, 1)
        near = np.any([around[i:i + full.shape[0], j:j + full.shape[1]] for i in range(3) for j in range(3)], axis=0)
        self._check_blocked(np.flatnonzero(near & ~full))
        return domain

    def _check_blocked(self, some: np.ndarray) -> None:
        """Show that squares hold no place where the inscribed disc may be: the middle of each part is too near to an obstacle."""
        row, column = np.divmod(some, self._squares.columns)
        half = self._squares.side / 2
        points = np.array(self._squares.corner) + half * np.column_stack([2 * column + 1, 2 * row + 1])
        for _ in range(SQUARE_HALVINGS):
            room = self._world.clearances(points, self._inner) + self._margin
            place = points[room.argmax()].round(3).tolist() if len(room) else []
            _demand(np.all(room < self._inner), f"the vehicle may be outside of all squares, at {place}")
            points = points[room + half * math.sqrt(2) >= self._inner]
            half /= 2
            points = (points[:, None] + half * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])).reshape(-1, 2)
        _demand(not len(points), "the vehicle may be outside of all squares")

    def _find_cells(self, corridor: np.ndarray) -> None:
        """Take the cell of each part of a square in a slab from the certificate, and show that parts that meet have the same."""
        cells = self._document["cells"]
        values = self._squares.corners(corridor)
        self._low, high = (np.zeros(self._squares.costs.size, int) for _ in range(2))
        self._low[corridor] = self._squares.slabs(values.min(axis=(1, 2)))
        high[corridor] = self._squares.slabs(values.max(axis=(1, 2)))
        counts = high[corridor] - self._low[corridor] + 1
        _demand([len(some) for some in cells] == counts.tolist(), "the cells do not fit the squares of the corridor")
        self._cells = np.array([cell for some in cells for cell in some], dtype=int)
        self._first = np.zeros(self._squares.costs.size, int)
        self._first[corridor] = np.cumsum(counts) - counts
        for one, other, low, high in self._squares.neighbours(corridor):
            for slab in range(len(self._levels) + 1):
                both = (low <= slab) & (slab <= high)
                _demand(np.all(self._cell(one[both], slab) == self._cell(other[both], slab)), "two cells meet within a slab")

    def _cell(self, squares: np.ndarray | int, slab: np.ndarray | int) -> np.ndarray:
        return np.asarray(self._cells[self._first[squares] + slab - self._low[squares]])

    def _portals(self, corridor: np.ndarray, start: int, goals: set[int]) -> Portals:
        """Return the boxes between each two cells that a path may enter one after the other, where they cover all."""
        pieces = self._squares.pieces(corridor)
        below, above = self._cell(pieces.square, pieces.level), self._cell(pieces.square, pieces.level + 1)
        rows = np.array(self._document["boxes"], dtype=float).reshape(-1, 9)
        names = np.column_stack([pieces.square, pieces.triangle, pieces.level]).tolist()
        number = {tuple(name): index for index, name in enumerate(names)}
        index = np.array([number[tuple(name)] for name in rows[:, :3].astype(int).tolist()], dtype=int)
        boxes = np.column_stack([pieces.boxes(index, rows[:, 3], rows[:, 4:8], self._margin), rows[:, 8],
                                 self._levels[pieces.level[index]], self._to_goal.corners(pieces.square[index]).min(axis=(1, 2))])
        is_open = self._may_be_free(boxes, rows)
        keys = [list(zip(*cells, strict=True)) for cells in ((below.tolist(), above.tolist()), (above.tolist(), below.tolist()))]
        used = used_portals({*keys[0], *keys[1]}, start, goals)
        found: dict[Portal, list[np.ndarray]] = {}
        for way, of_pieces in ((1, keys[0]), (-1, keys[1])):
            groups = _grouped(np.where(rows[:, 3] == way, index, -1))
            for piece, key in enumerate(of_pieces):
                mine = groups.get(piece, np.empty(0, int))
                if key in used:
                    _demand(_covers(rows[mine, 4:8]), f"boxes do not cover a level at {pieces.ends[piece].round(3).tolist()}")
                    found.setdefault(key, []).append(boxes[mine[is_open[mine]]])
        return {key: np.concatenate(some) for key, some in found.items()}

    def _may_be_free(self, boxes: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return which boxes have a potential, after showing that no place of the others is free."""
        closed = np.isnan(rows[:, 8])
        room = self._world.clearances(boxes[closed, :2], self._inner) + boxes[closed, 4] + self._margin
        _demand(np.all(room < self._inner), "a box that may be free has no potential")
        return ~closed

    def _check_edges(self, portals: Portals, start: int, goals: set[int], enough: float) -> None:
        """Show that no potential is higher than the curves from the start allow, or those before it and the curves from there."""
        # After the others what is left of the way to the goal is too long by itself.
        opened = {key: boxes[boxes[:, 8] + boxes[:, 10] < enough] for key, boxes in portals.items()}
        for (before, after), boxes in portals.items():
            self._check_boxes(boxes, [opened[key] for key in opened if key[1] == before and key[0] != after], before == start)
        self._check_boxes(self._goal_boxes, [opened[key] for key in opened if key[1] in goals], start in goals)

    def _check_boxes(self, boxes: np.ndarray, ahead: list[np.ndarray], is_first: bool) -> None:
        excess = too_high(self._start_box, boxes, self._radius, self._margin)
        if not is_first:
            boxes = boxes[excess > 0]
            excess = np.max([too_high(some, boxes, self._radius, self._margin) for some in ahead], axis=0, initial=0)
        if excess.max(initial=0) > 0:
            place = boxes[excess.argmax(), (0, 1, 6)].round(3).tolist()
            raise Refused(f"the potential at {place} is {excess.max():.3g} m higher than those before it allow")


def goal_boxes(goal: tuple[float, float, float], tolerance: float, turn: float, bound: float) -> np.ndarray:
    """Return boxes that cover where the goal is reached, with the bound as their potential."""
    parts = 1 if tolerance == 0 else GOAL_PARTS
    turns = max(1, math.ceil(2 * turn / GOAL_TURN))
    half, turn = tolerance / parts, turn / turns
    middles = ((2 * np.arange(parts) + 1 - parts) * half).tolist()
    headings = (goal[2] + (2 * np.arange(turns) + 1 - turns) * turn).tolist()
    return np.concatenate([pose_box(goal[0] + x, goal[1] + y, heading, half, turn, bound, math.nan)
                           for x in middles for y in middles for heading in headings
                           if math.hypot(max(0.0, abs(x) - half), max(0.0, abs(y) - half)) <= tolerance])


def pose_box(x: float, y: float, heading: float, half: float, turn: float, potential: float, cost: float) -> np.ndarray:
    """Return the box of the poses near one, with its potential and the cost there."""
    return np.array([[x, y, 1.0, 0.0, half, half, heading, turn, potential, cost, 0.0]])


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
    onward: dict[Portal, list[Portal]] = {portal: [] for portal in portals}
    back: dict[Portal, list[Portal]] = {portal: [] for portal in portals}
    by_first: dict[int, list[Portal]] = {}
    for portal in portals:
        by_first.setdefault(portal[0], []).append(portal)
    for portal in portals:
        for following in by_first.get(portal[1], ()):
            if following[1] != portal[0]:
                onward[portal].append(following)
                back[following].append(portal)
    return (_reached(onward, {portal for portal in portals if portal[0] == start})
            & _reached(back, {portal for portal in portals if portal[1] in goals}))


def _reached(links: dict[Portal, list[Portal]], found: set[Portal]) -> set[Portal]:
    """Return what can be reached by links, from what is found already on."""
    found, due = set(found), list(found)
    while due:
        new = set(links[due.pop()]) - found
        found |= new
        due += new
    return found


def _grouped(keys: np.ndarray) -> dict[int, np.ndarray]:
    order = np.argsort(keys, kind="stable")
    values, begins = np.unique(keys[order], return_index=True)
    return dict(zip(values.tolist(), np.split(order, begins[1:]), strict=True))


def _covers(rectangles: np.ndarray) -> bool:
    """Return whether rectangles (s0, s1, h0, h1) cover the one from (0, -1) to (1, 1)."""
    s = np.unique(np.clip(np.append(rectangles[:, :2], (0, 1)), 0, 1))
    h = np.unique(np.clip(np.append(rectangles[:, 2:], (-1, 1)), -1, 1))
    held = [(s0 <= s[:-1, None]) & (s[1:, None] <= s1) & (h0 <= h[:-1]) & (h[1:] <= h1) for s0, s1, h0, h1 in rectangles]
    return bool(held) and bool(np.any(held, axis=0).all())
