"""Buildings as polygons, drawn by rule: offices, serpentines and spirals of any size, and a district of houses."""

import math

import numpy as np
import shapely

from dubins_rrt_ros.planning import PolygonMap


def office(rooms, seed=0, side=5.0, wall=0.12, door=1.4):
    """Return rooms x rooms square rooms, joined by doors along a random spanning tree and some more."""
    rng = np.random.default_rng(seed)
    size, doors, seen = rooms * side, set(), {(0, 0)}
    stack = [(0, 0)]
    while stack:
        column, row = stack[-1]
        around = [(column + dx, row + dy) for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        fresh = [at for at in around if min(at) >= 0 and max(at) < rooms and at not in seen]
        if not fresh:
            stack.pop()
            continue
        there = fresh[rng.integers(len(fresh))]
        doors.add(frozenset(((column, row), there)))
        seen.add(there)
        stack.append(there)
    walls = []
    for i in range(rooms):
        for j in range(1, rooms):
            for upright in (True, False):
                cells = ((j - 1, i), (j, i)) if upright else ((i, j - 1), (i, j))
                gap = door if frozenset(cells) in doors or rng.random() < 0.1 else 0.0
                middle = rng.uniform(1.5, side - 1.5) if gap else side / 2
                for low, high in ((0.0, middle - gap / 2), (middle + gap / 2, side)):
                    across = (j * side - wall / 2, j * side + wall / 2)
                    along = (i * side + low - wall / 2 * (low == 0), i * side + high + wall / 2 * (high == side))
                    walls.append(shapely.box(across[0], along[0], across[1], along[1]) if upright
                                 else shapely.box(along[0], across[0], along[1], across[1]))
    return PolygonMap(shapely.box(0, 0, size, size) - shapely.union_all(walls))


def serpentine(corridors, length=20.0, width=2.0, wall=0.2):
    """Return corridors one above the other, each joined to the next at alternate ends."""
    walls = []
    for i in range(1, corridors):
        low, left = i * (width + wall) - wall, 0.0 if i % 2 else width
        walls.append(shapely.box(left, low, left + length - width, low + wall))
    return PolygonMap(shapely.box(0, 0, length, corridors * (width + wall) - wall) - shapely.union_all(walls))


def spiral(turns, pitch=2.2, wall=0.2):
    """Return a corridor that winds inwards around the origin."""
    angle = np.linspace(0, 2 * math.pi * turns, 60 * turns)
    radius = 2.0 + pitch * angle / (2 * math.pi)
    line = shapely.LineString(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    outside = radius[-1] + pitch
    return PolygonMap(shapely.box(-outside, -outside, outside, outside) - line.buffer(wall / 2, quad_segs=2))


def district(blocks=45, side=1000.0, gap=0.1, seed=0):
    """Return houses in a square, blocks x blocks of them with streets between; half of them stand in pairs, a gap apart."""
    rng = np.random.default_rng(seed)
    step, houses = side / blocks, []
    for column in range(blocks):
        for row in range(blocks):
            left = column * step + (gap / 2 if column % 2 else rng.uniform(2, 6))
            right = (column + 1) * step - (rng.uniform(2, 6) if column % 2 else gap / 2)
            houses.append(shapely.box(left, row * step + rng.uniform(2, 6), right, (row + 1) * step - rng.uniform(2, 6)))
    return PolygonMap(shapely.box(0, 0, side, side) - shapely.union_all(houses))


def scaled_map(polygon_map, factor):
    """Return the map, larger by a factor from the origin on."""
    return PolygonMap(shapely.transform(polygon_map.free, lambda points: points * factor))
