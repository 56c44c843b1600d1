"""Slow and obvious twins of the package's kernels, written from geometry and the definitions; nothing here imports it.

A Dubins curve is two circles and a line or a third circle that touches both. Points are complex numbers, so that
turning by an angle is a multiplication; everything works on numbers and on arrays of them.
"""

import math
from itertools import pairwise

import numpy as np
import shapely

WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
SIDE = {"L": 1, "S": 0, "R": -1}
TAU = math.tau


def drive(pose, word, lengths, radius):
    """The pose after the arcs of a word, driven from a pose; (..., 3) arrays of poses and lengths too."""
    pose, lengths = np.asarray(pose, dtype=float), np.asarray(lengths, dtype=float)
    z, theta = pose[..., 0] + 1j * pose[..., 1], pose[..., 2]
    for arc, turn in enumerate(word):
        side, length = SIDE[turn], lengths[..., arc]
        if side == 0:
            z = z + length * np.exp(1j * theta)
            continue
        centre = z + side * 1j * radius * np.exp(1j * theta)
        angle = side * length / radius
        z = centre + (z - centre) * np.exp(1j * angle)
        theta = theta + angle
    return np.stack(np.broadcast_arrays(z.real, z.imag, theta), axis=-1)


def words(start, goal, radius):
    """(..., 6, 3): the lengths of the arcs of all words between (..., 3) poses; NaN where a word has no curve."""
    start, goal = np.broadcast_arrays(np.asarray(start, dtype=float), np.asarray(goal, dtype=float))
    out = np.full((*start.shape[:-1], 6, 3), math.nan)
    for i, word in enumerate(WORDS):
        first, last = SIDE[word[0]], SIDE[word[2]]
        c0, c1 = _centre(start, first, radius), _centre(goal, last, radius)
        with np.errstate(invalid="ignore"):
            if word[1] == "S":
                headings, middle = _line_between(c0, c1, first, last, radius)
            else:
                headings, middle = _circle_between(c0, c1, first, radius)
        out[..., i, 0] = radius * _turn(first * (headings[0] - start[..., 2]))
        out[..., i, 1] = middle
        out[..., i, 2] = radius * _turn(last * (goal[..., 2] - headings[1]))
    return out


def shortest(start, goal, radius):
    """The length of the shortest of the six curves between (..., 3) poses."""
    return np.nanmin(words(start, goal, radius).sum(axis=-1), axis=-1)


def _centre(pose, side, radius):
    return pose[..., 0] + 1j * pose[..., 1] + side * 1j * radius * np.exp(1j * pose[..., 2])


def _turn(angle):
    """`angle` as a turn in [0, 2 pi); what is a full circle but for rounding is none."""
    angle = angle % TAU
    return np.where(angle > TAU - 1e-9, 0.0, angle)


def _line_between(c0, c1, first, last, radius):
    """The headings on leaving the first and on reaching the last circle, and the length of the line that touches both.

    Along the line and across it the centres are `length` and `(first - last) * radius` apart.
    """
    across = (first - last) * radius
    length = np.sqrt(np.abs(c1 - c0) ** 2 - across**2)
    heading = np.angle(c1 - c0) - np.angle(length - 1j * across)
    return (heading, heading), length


def _circle_between(c0, c1, first, radius):
    """The same where a third circle touches both from outside: its centre is the apex of an isosceles triangle.

    Of the two such circles it is the one that is driven more than half around.
    """
    apart, apex_height = np.abs(c1 - c0), np.sqrt(4 * radius**2 - np.abs(c1 - c0) ** 2 / 4)
    across = np.where(apart > 0, 1j * (c1 - c0) / np.where(apart > 0, apart, 1), 1j)
    middle = (c0 + c1) / 2 + first * across * apex_height
    # On a circle driven with the side s the heading is the bearing from the centre, turned by s pi / 2.
    leaving = np.angle(middle - c0) + first * math.pi / 2
    reaching = np.angle(middle - c1) + first * math.pi / 2
    return (leaving, reaching), radius * (-first * (reaching - leaving) % TAU)


def clearance_in_grid(points, blocked, resolution, origin):
    """Distance from (n, 2) points to the nearest blocked cell's square or to the outside; 0 in them."""
    z = (points[:, 0] - origin[0] + 1j * (points[:, 1] - origin[1])) * np.exp(-1j * origin[2])
    x, y = z.real, z.imag
    rows, columns = blocked.shape
    out = np.minimum(np.minimum(x, columns * resolution - x), np.minimum(y, rows * resolution - y)).clip(min=0)
    for row, column in np.argwhere(blocked):
        row_gap = np.maximum(np.maximum(column * resolution - x, x - (column + 1) * resolution), 0)
        above = np.maximum(np.maximum(row * resolution - y, y - (row + 1) * resolution), 0)
        out = np.minimum(out, np.hypot(row_gap, above))
    return out


def clearance_in_polygons(points, rings):
    """Distance from (n, 2) points to the nearest ring; 0 outside the free space.

    A point is inside where a ray from it to the right crosses the (m, 2) closed rings an odd number of times.
    """
    x, y = points[:, 0], points[:, 1]
    inside, out = np.zeros(len(points), bool), np.full(len(points), math.inf)
    for ring in rings:
        for (ax, ay), (bx, by) in pairwise(ring):
            dx, dy = bx - ax, by - ay
            share = (((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)).clip(0, 1)
            out = np.minimum(out, np.hypot(ax + share * dx - x, ay + share * dy - y))
            crosses = (ay <= y) != (by <= y)
            inside ^= crosses & (x < ax + (y - ay) * (dx / dy if dy else 0.0))
    return np.where(inside, out, 0.0)


def points_along(start, word, lengths, radius, spacing):
    """(n, 2) points of a curve, closer together than `spacing`, with both its ends."""
    s = np.linspace(0, sum(lengths), int(sum(lengths) / spacing) + 2)[:, None]
    before = np.concatenate([[0], np.cumsum(lengths)[:2]])
    return drive(start, word, np.clip(s - before, 0, lengths), radius)[:, :2]


def nearest(poses, goal, radius, count):
    """The `count` poses with the shortest curves to a goal, the nearest first, and the lengths of these."""
    lengths = shortest(poses, goal, radius)
    order = np.argsort(lengths)[:count]
    return order, lengths[order]


def costs(parents, lengths):
    """(n,): for each node of a tree the sum of the lengths of all edges on the way to the root."""
    out = np.zeros(len(parents))
    for node in range(len(parents)):
        at = node
        while parents[at] >= 0:
            out[node] += sum(lengths[at])
            at = parents[at]
    return out


def widest(clearance, start, targets):
    """The largest clearance with which neighbours in a (rows, columns) array lead from `start` to one of `targets`; else 0."""
    for level in np.unique(clearance[clearance > 0])[::-1]:
        reached, waiting = set(), [start]
        while waiting:
            row, column = node = waiting.pop()
            inside = 0 <= row < clearance.shape[0] and 0 <= column < clearance.shape[1]
            if inside and node not in reached and clearance[node] >= level:
                reached.add(node)
                waiting += [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)]
        if reached & set(targets):
            return level
    return 0.0


def free_space(map, allow_unknown=False):
    """The free space of any map as shapely polygons."""
    if hasattr(map, "free"):
        return map.free
    values = map.data.astype(int)
    rows, columns = np.nonzero(values >= 65 if allow_unknown else (values > 25) | (values < 0))
    left, low = columns * map.resolution, rows * map.resolution
    obstacles = shapely.union_all(shapely.box(left, low, left + map.resolution, low + map.resolution))
    return shapely.transform(shapely.box(0, 0, *map.size) - obstacles, map.to_map_frame)


def are_connected(problem, radius):
    """Whether a disc moves from start to goal: whether these lie in one part of the free space, made smaller by the radius."""
    room = shapely.buffer(free_space(problem.map, problem.allow_unknown), -radius, quad_segs=32)
    reached = [part for part in shapely.get_parts(room) if part.distance(shapely.Point(problem.start[:2])) < 1e-9]
    goal = shapely.Point(problem.goal[:2])
    return any(part.distance(goal) <= problem.goal_tolerance_xy + 1e-9 for part in reached)


def squared_distances(blocked):
    """(rows, columns) int: from each cell's centre to the nearest of a blocked cell, also just outside, squared and in cells."""
    around = np.argwhere(np.pad(blocked, 1, constant_values=True)) - 1
    rows, columns = np.indices(blocked.shape)
    return ((rows[..., None] - around[:, 0]) ** 2 + (columns[..., None] - around[:, 1]) ** 2).min(axis=-1)


def next_in_row(blocked):
    """(rows, columns, 2) int: how many cells the next blocked ones to the left and to the right are away; 0 is itself."""
    out = np.zeros((*blocked.shape, 2), int)
    for row, column in np.ndindex(blocked.shape):
        beside = [-1, *np.flatnonzero(blocked[row]), blocked.shape[1]]
        out[row, column] = [min(column - c for c in beside if c <= column), min(c - column for c in beside if c >= column)]
    return out


def short_curves(rng, count):
    """Poses and where random curves of all words shorter than pi lead from them; radius 1."""
    for word in WORDS:
        shares = rng.dirichlet((0.5, 0.5, 0.5), count // 6)
        length = math.pi * rng.random((count // 6, 1)) ** rng.choice([0.1, 1, 3], (count // 6, 1))
        starts = np.column_stack([rng.uniform(-5, 5, (count // 6, 2)), rng.uniform(-math.pi, math.pi, count // 6)])
        yield starts, drive(starts, word, shares * length, 1.0)
