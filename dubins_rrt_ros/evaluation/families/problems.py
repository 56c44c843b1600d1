"""Problems that are solvable by construction: a random Dubins path first, then obstacles that leave it room.

Each family leaves exactly `spare` [m] beyond what the vehicle needs along the whole constructed path, or more where the cells of
a grid are coarse. A family, a seed and a number always give the same problem.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from shapely import affinity

from dubins_rrt_ros.planning import FREE, OCCUPIED, DubinsCurve, GridMap, Map, PolygonMap, Pose, Problem, Vehicle

#: Range of the turning radius [m].
TURNING_RADII = 0.4, 3.0
#: Range of the room along the constructed path beyond what the vehicle needs [m], log-uniform.
SPARES = 0.001, 0.1
#: Range of the number of arcs of a constructed path.
ARCS = 4, 12
#: Range of the length of an arc in turning radii.
ARC_LENGTHS = 0.3, 3.0
#: Spacing of the samples of a path that obstacles are held away from [turning radii].
SPACING = 0.004
#: Outlines in units of the turning radius: x ahead of the reference point, y to the left.
OUTLINES = {
    "car": [(0.9, 0.2), (-0.25, 0.2), (-0.25, -0.2), (0.9, -0.2)],
    "long": [(0.6, 0.1), (-0.6, 0.1), (-0.6, -0.1), (0.6, -0.1)],
    "kite": [(0.7, 0.0), (0.0, 0.25), (-0.4, 0.0), (0.0, -0.25)],
    "L": [(0.5, 0.3), (0.1, 0.3), (0.1, 0.1), (-0.4, 0.1), (-0.4, -0.2), (0.5, -0.2)],
}


@dataclass(frozen=True)
class Constructed:
    """A problem with a path that solves it.

    Attributes:
        family: name of the family.
        problem: what to plan.
        curves: the constructed path, arc by arc.
        spare: room along it beyond what the vehicle needs, at least [m].
    """

    family: str
    problem: Problem
    curves: tuple[DubinsCurve, ...]
    spare: float

    @property
    def length(self) -> float:
        """Length of the constructed path [m]."""
        return sum(curve.length for curve in self.curves)


def constructed(family: str, seed: int, number: int) -> Constructed:
    """Return problem `number` of a family.

    Raises:
        KeyError: there is no such family.
    """
    rng = np.random.default_rng((list(FAMILIES).index(family), seed, number))
    radius = _log_uniform(rng, *TURNING_RADII)
    spare = _log_uniform(rng, *SPARES)
    vehicle, curves = FAMILIES[family].vehicle(rng, radius), _random_path(rng, radius)
    world_map = FAMILIES[family].map(rng, vehicle, curves, spare)
    end = curves[-1].end
    return Constructed(family, Problem(world_map, vehicle, curves[0].start, (end[0], end[1], math.remainder(end[2], math.tau))),
                       curves, spare)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def _random_path(rng: np.random.Generator, radius: float) -> tuple[DubinsCurve, ...]:
    """Draw single arcs, left, right or straight, one after the other from the origin."""
    pose: Pose = (0.0, 0.0, float(rng.uniform(-math.pi, math.pi)))
    curves: list[DubinsCurve] = []
    turn = ""
    for _ in range(int(rng.integers(*ARCS))):
        turn = str(rng.choice([each for each in "LSR" if each != turn]))
        length = radius * float(rng.uniform(*ARC_LENGTHS))
        word, lengths = ("LSL", (0.0, length, 0.0)) if turn == "S" else (turn + "S" + turn, (length, 0.0, 0.0))
        curves.append(DubinsCurve(pose, radius, word, lengths))
        pose = curves[-1].end
    return tuple(curves)


def _disc(rng: np.random.Generator, radius: float) -> Vehicle:
    return Vehicle(turning_radius=radius, robot_radius=radius * float(rng.uniform(0.15, 0.45)))


def _outline(rng: np.random.Generator, radius: float) -> Vehicle:
    corners = OUTLINES[str(rng.choice(list(OUTLINES)))]
    return Vehicle(turning_radius=radius, footprint=tuple((radius * x, radius * y) for x, y in corners))


def _swept(vehicle: Vehicle, curves: tuple[DubinsCurve, ...], spare: float) -> shapely.Geometry:
    """Return what the vehicle sweeps along the path, with `spare` [m] around it."""
    spacing = SPACING * vehicle.turning_radius
    poses = np.concatenate([curve.poses(spacing) for curve in curves])
    sag = spacing**2 / (8 * vehicle.turning_radius)  # of a chord between two samples
    if not vehicle.footprint:
        return shapely.LineString(poses[:, :2]).buffer(vehicle.robot_radius + spare + sag, quad_segs=64)
    outline = shapely.Polygon(vehicle.footprint)
    placed = [affinity.affine_transform(outline, [c, -s, s, c, x, y])
              for x, y, c, s in zip(poses[:, 0], poses[:, 1], np.cos(poses[:, 2]), np.sin(poses[:, 2]), strict=True)]
    pairs = [shapely.union(a, b).convex_hull if outline.equals(outline.convex_hull) else shapely.union(a, b)
             for a, b in pairwise(placed)]
    reach = float(np.hypot(*np.array(vehicle.footprint).T).max())
    return shapely.union_all(pairs).buffer(spare + sag * (1 + reach / vehicle.turning_radius), quad_segs=16)


def _raster(rng: np.random.Generator, vehicle: Vehicle, keep: shapely.Geometry) -> tuple[GridMap, np.ndarray]:
    """Return an all-occupied grid around what must stay free, and (rows, columns) bool: its squares that meet that."""
    resolution = vehicle.turning_radius * float(rng.choice([0.05, 0.1, 0.2]))
    x0, y0, x1, y1 = keep.buffer(vehicle.turning_radius * float(rng.uniform(0.2, 1.0))).bounds
    columns, rows = math.ceil((x1 - x0) / resolution), math.ceil((y1 - y0) / resolution)
    left, low = np.meshgrid(x0 + resolution * np.arange(columns), y0 + resolution * np.arange(rows))
    shapely.prepare(keep)
    meets = shapely.intersects(keep, shapely.box(left, low, left + resolution, low + resolution))
    return GridMap(np.full((rows, columns), OCCUPIED, np.int8), resolution, (x0, y0, 0.0)), meets


def _tunnel(rng: np.random.Generator, vehicle: Vehicle, curves: tuple[DubinsCurve, ...], spare: float) -> Map:
    """Make a map that is occupied but for the cells that the vehicle needs."""
    solid, meets = _raster(rng, vehicle, _swept(vehicle, curves, spare))
    return GridMap(np.where(meets, FREE, OCCUPIED).astype(np.int8), solid.resolution, solid.origin)


def _clutter(rng: np.random.Generator, vehicle: Vehicle, curves: tuple[DubinsCurve, ...], spare: float) -> Map:
    """Make a map of random occupied cells and blocks, but for those that the vehicle needs."""
    solid, meets = _raster(rng, vehicle, _swept(vehicle, curves, spare))
    taken = rng.random(meets.shape) < float(rng.uniform(0.05, 0.4))
    if rng.random() < 0.5:
        block = np.kron(rng.random((meets.shape[0] // 3 + 1, meets.shape[1] // 3 + 1)) < 0.3, np.ones((3, 3), bool))
        taken |= block[:meets.shape[0], :meets.shape[1]]
    return GridMap(np.where(taken & ~meets, OCCUPIED, FREE).astype(np.int8), solid.resolution, solid.origin)


def _tube(rng: np.random.Generator, vehicle: Vehicle, curves: tuple[DubinsCurve, ...], spare: float) -> Map:
    """Make polygons of just what the vehicle sweeps, sometimes with a round place on the way."""
    free = _swept(vehicle, curves, spare)
    if rng.random() < 0.5:
        x, y, _ = curves[int(rng.integers(len(curves)))].start
        free = shapely.union(free, shapely.Point(x, y).buffer(vehicle.turning_radius * float(rng.uniform(0.5, 1.5))))
    return PolygonMap(free)


@dataclass(frozen=True)
class Family:
    """The functions that make the vehicles and the maps of a family."""

    vehicle: Callable[[np.random.Generator, float], Vehicle]
    map: Callable[[np.random.Generator, Vehicle, tuple[DubinsCurve, ...], float], Map]


#: The families by name; their order is part of the seed.
FAMILIES: dict[str, Family] = {
    "tunnel": Family(_disc, _tunnel), "clutter": Family(_disc, _clutter), "tube": Family(_disc, _tube),
    "footprint tunnel": Family(_outline, _tunnel), "footprint clutter": Family(_outline, _clutter),
}
