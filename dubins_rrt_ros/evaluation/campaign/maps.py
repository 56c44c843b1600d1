"""Random maps for `dubins_rrt campaign`: grids of any resolution, polygons and mazes, some rotated, some far from the origin."""

import math
from collections.abc import Callable

import numpy as np
import shapely
from shapely import affinity

from dubins_rrt_ros.planning import FREE, OCCUPIED, UNKNOWN, GridMap, Map, PolygonMap, Pose

#: Range of resolutions of grids [m].
RESOLUTIONS = 0.02, 2.0
#: Range of sides of polygon maps [m].
SIDES = 2.0, 200.0
#: Maximum distance of a map from the origin [m].
FAR = 1e6


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def random_origin(rng: np.random.Generator) -> Pose:
    """Draw the pose of a map (x [m], y [m], yaw [rad]): some are rotated, some by right angles, some far away."""
    far = 5.0 if rng.random() < 0.8 else log_uniform(rng, 100.0, FAR)
    yaw = rng.choice([0.0, math.pi / 2 * rng.integers(-2, 3), rng.uniform(-math.pi, math.pi)], p=[0.3, 0.1, 0.6])
    x, y = rng.uniform(-far, far, 2).tolist()
    return x, y, float(yaw)


def boxes_grid(rng: np.random.Generator) -> GridMap:
    """Draw boxes of obstacles and of unknown space."""
    data = np.zeros(rng.integers(8, 100, 2), np.int8)
    for value in [OCCUPIED] * rng.integers(0, 12) + [UNKNOWN] * rng.integers(0, 6):
        row, column = (rng.integers(0, size) for size in data.shape)
        height, width = rng.integers(1, max(2, min(data.shape) // 4), 2)
        data[row:row + height, column:column + width] = value
    return _grid(rng, data)


def noise_grid(rng: np.random.Generator) -> GridMap:
    """Draw single cells, of all values that a grid can hold."""
    shape, density = rng.integers(1, 80, 2), log_uniform(rng, 0.001, 0.15)
    data = np.where(rng.random(shape) < density, rng.integers(UNKNOWN, OCCUPIED + 1, shape), FREE)
    return _grid(rng, data.astype(np.int8))


def maze_grid(rng: np.random.Generator) -> GridMap:
    """Draw a maze whose walls are one cell thick."""
    width = int(rng.integers(2, 9))
    open_ = _maze(rng, *rng.integers(2, 9, 2))
    sizes = [np.where(np.arange(side) % 2, width, 1) for side in open_.shape]
    return _grid(rng, np.where(np.repeat(np.repeat(open_, sizes[0], axis=0), sizes[1], axis=1), FREE, OCCUPIED).astype(np.int8))


def maze_polygons(rng: np.random.Generator) -> PolygonMap:
    """Draw a maze whose walls are thin."""
    open_ = _maze(rng, *rng.integers(2, 6, 2))
    corridor, wall = log_uniform(rng, 0.5, 5.0), log_uniform(rng, 0.001, 0.2)
    across, along = (np.cumsum([0.0, *np.where(np.arange(side) % 2, corridor, wall)]) for side in open_.shape)
    rows, columns = np.nonzero(open_)
    return _placed(rng, shapely.union_all(shapely.box(along[columns], across[rows], along[columns + 1], across[rows + 1])))


def holed_polygons(rng: np.random.Generator) -> PolygonMap:
    """Draw a square with boxes, circles, thin walls and triangles taken out."""
    side, count = log_uniform(rng, *SIDES), int(rng.integers(1, 15))
    holes = [_hole(rng, side) for _ in range(count)]
    return _placed(rng, shapely.box(0, 0, side, side) - shapely.union_all(holes))


def touching_polygons(rng: np.random.Generator) -> PolygonMap:
    """Draw obstacles that share corners and edges with each other and with the border."""
    side, count = log_uniform(rng, *SIDES), int(rng.integers(4, 12))
    taken = np.argwhere(rng.random((count, count)) < rng.uniform(0.05, 0.35))
    step = side / count
    squares = shapely.box(*(step * np.column_stack([taken, taken + 1]).T)) if len(taken) else []
    return _placed(rng, shapely.box(0, 0, side, side) - shapely.union_all(squares))


def several_parts(rng: np.random.Generator) -> PolygonMap:
    """Draw parts of free space that do not meet."""
    side, gap = log_uniform(rng, *SIDES), log_uniform(rng, 1e-6, 1.0)
    parts = [affinity.translate(_room(rng, side), i * (side + gap), 0) for i in range(rng.integers(2, 4))]
    return _placed(rng, shapely.union_all(parts))


#: Functions that draw maps, by name.
MAPS: dict[str, Callable[[np.random.Generator], Map]] = {
    "boxes grid": boxes_grid, "noise grid": noise_grid, "maze grid": maze_grid, "maze polygons": maze_polygons,
    "holed polygons": holed_polygons, "touching polygons": touching_polygons, "several parts": several_parts,
}


def placed(free: shapely.Geometry, origin: Pose) -> PolygonMap:
    """Rotate polygons about (0, 0) and move them to the origin; repair what rounding makes invalid; nothing becomes a square."""
    x, y, yaw = origin
    c, s = math.cos(yaw), math.sin(yaw)
    free = affinity.affine_transform(free, [c, -s, s, c, x, y])
    if not free.is_valid:
        parts = shapely.get_parts(shapely.make_valid(free, method="structure", keep_collapsed=False))
        free = shapely.union_all(parts[shapely.area(parts) > 0])
    return PolygonMap(free if free.area > 0 else shapely.box(x, y, x + 1, y + 1))


def _grid(rng: np.random.Generator, data: np.ndarray) -> GridMap:
    return GridMap(data, log_uniform(rng, *RESOLUTIONS), random_origin(rng), percent=True)


def _placed(rng: np.random.Generator, free: shapely.Geometry) -> PolygonMap:
    return placed(free, random_origin(rng))


def _room(rng: np.random.Generator, side: float) -> shapely.Geometry:
    return shapely.box(0, 0, side, side) - shapely.union_all([_hole(rng, side) for _ in range(3)])


def _hole(rng: np.random.Generator, side: float) -> shapely.Geometry:
    kind, (x, y), size = rng.integers(4), rng.uniform(0, side, 2), side * log_uniform(rng, 0.01, 0.2)
    if kind == 0:
        return shapely.Point(x, y).buffer(size / 2, quad_segs=int(rng.integers(1, 6)))
    if kind == 1:
        return shapely.box(x, y, x + size, y + size * rng.uniform(0.2, 2))
    if kind == 2:
        wall = shapely.box(x, y, x + 4 * size, y + side * log_uniform(rng, 1e-6, 1e-2))
        return affinity.rotate(wall, rng.choice([0, 90, rng.uniform(0, 180)]), origin=(x, y))
    return shapely.Polygon(np.array([x, y]) + rng.uniform(-size, size, (3, 2)))


def _maze(rng: np.random.Generator, rows: int, columns: int) -> np.ndarray:
    """Draw a connected maze; return (2 rows + 1, 2 columns + 1) bool, True where it is open."""
    open_ = np.zeros((2 * rows + 1, 2 * columns + 1), bool)
    stack = [(0, 0)]
    open_[1, 1] = True
    while stack:
        row, column = stack[-1]
        steps = [(a, b) for a, b in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1))
                 if 0 <= a < rows and 0 <= b < columns and not open_[2 * a + 1, 2 * b + 1]]
        if not steps:
            stack.pop()
            continue
        a, b = steps[rng.integers(len(steps))]
        open_[2 * a + 1, 2 * b + 1] = open_[row + a + 1, column + b + 1] = True
        stack.append((a, b))
    return open_
