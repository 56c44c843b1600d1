"""Problems in random buildings with several ways round: offices, blocks of houses, depots and clutter.

The shortest way is often hardly shorter than another one through other doors, or cannot be driven by a car; a planner that
keeps to its first way is some percent longer, or a quarter. A kind of building, a seed and a number give the same problem always.
"""

import math
from collections.abc import Callable

import numpy as np
from scipy import ndimage

from dubins_rrt_ros.planning import FREE, OCCUPIED, GridMap, Problem, Vehicle

#: Side of a cell [m].
RESOLUTION = 0.05
#: Ranges of the turning radius, log-uniform, and of the robot's radius [m].
TURNING_RADII, ROBOT_RADII = (0.4, 2.0), (0.15, 0.3)
#: Room that start and goal have beyond the robot's radius, and least distance between them as a share of the diagonal.
ROOM, LEAST_DISTANCE = 0.3, 0.4


def building(kind: str, seed: int, number: int) -> Problem:
    """Return problem `number` in a kind of building.

    Raises:
        KeyError: there is no such kind.
    """
    rng = np.random.default_rng((list(BUILDINGS).index(kind), seed, number, 14))
    occupied = BUILDINGS[kind](rng)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    radius = float(np.exp(rng.uniform(*np.log(TURNING_RADII))))
    vehicle = Vehicle(turning_radius=radius, robot_radius=float(rng.uniform(*ROBOT_RADII)))
    start, goal = _ends(rng, occupied, vehicle)
    return Problem(GridMap(np.where(occupied, OCCUPIED, FREE).astype(np.int8), RESOLUTION, (0.0, 0.0, 0.0)), vehicle, start, goal)


def _ends(rng: np.random.Generator, occupied: np.ndarray, vehicle: Vehicle) -> list[tuple[float, float, float]]:
    """Draw two poses that are far apart, in the largest connected part of where there is room."""
    clearance = RESOLUTION * ndimage.distance_transform_edt(~occupied)
    labels, _ = ndimage.label(clearance > vehicle.robot_radius + 2 * RESOLUTION)
    largest = np.argmax(np.bincount(labels.ravel())[1:]) + 1
    cells = np.argwhere((labels == largest) & (clearance > vehicle.robot_radius + ROOM))
    diagonal = math.hypot(*occupied.shape)
    pairs = cells[rng.integers(len(cells), size=(256, 2))]
    distances = np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1)
    pair = pairs[np.argmax(distances >= LEAST_DISTANCE * diagonal)]
    return [(RESOLUTION * (column + 0.5), RESOLUTION * (row + 0.5), float(rng.uniform(-math.pi, math.pi)))
            for row, column in pair]


def _cells(*metres: float) -> tuple[int, ...]:
    return tuple(round(length / RESOLUTION) for length in metres)


def _office(rng: np.random.Generator) -> np.ndarray:
    """Make rooms with doors in three of four walls, or so."""
    rows, columns = rng.integers(4, 9, size=2)
    room, wall = _cells(rng.uniform(2.5, 5.0), 0.1)
    occupied = np.zeros((rows * room + wall, columns * room + wall), bool)
    for i in range(rows + 1):
        occupied[i * room:i * room + wall] = True
    for j in range(columns + 1):
        occupied[:, j * room:j * room + wall] = True
    share, narrow = rng.uniform(0.5, 0.9), rng.uniform(0.9, 1.4)
    for i in range(rows):
        for j in range(columns):
            door, = _cells(rng.uniform(narrow, 1.6))
            low, left = rng.integers(i * room + wall, (i + 1) * room - door), rng.integers(j * room + wall, (j + 1) * room - door)
            if i + 1 < rows and rng.random() < share:
                occupied[(i + 1) * room:(i + 1) * room + wall, left:left + door] = False
            if j + 1 < columns and rng.random() < share:
                occupied[low:low + door, (j + 1) * room:(j + 1) * room + wall] = False
    return occupied


def _blocks(rng: np.random.Generator) -> np.ndarray:
    """Make blocks of houses with streets between them, some of which are closed."""
    occupied = np.ones(_cells(*rng.uniform(25.0, 45.0, size=2)), bool)
    for axis in range(2):
        lanes = occupied if axis == 0 else occupied.T
        at, = _cells(1.0)
        while at < len(lanes):
            street, house = _cells(rng.uniform(0.8, 2.5), rng.uniform(2.0, 8.0))
            lanes[at:at + street] = False
            at += street + house
    for _ in range(int(rng.integers(2, 12))):
        _put_block(rng, occupied, 0.5, 2.5)
    return occupied


def _depot(rng: np.random.Generator) -> np.ndarray:
    """Make rows of racks with gaps, and things that stand about."""
    occupied = np.zeros(_cells(*rng.uniform(20.0, 40.0, size=2)), bool)
    aisle, depth, margin = _cells(rng.uniform(1.2, 2.5), rng.uniform(0.6, 1.6), 1.5)
    for low in range(margin, len(occupied) - margin - depth, aisle + depth):
        left = margin
        while left < occupied.shape[1] - margin:
            rack, gap = _cells(rng.uniform(2.0, 9.0), rng.uniform(0.8, 1.8))
            occupied[low:low + depth, left:min(left + rack, occupied.shape[1] - margin)] = True
            left += rack + gap
    for _ in range(int(rng.integers(5, 25))):
        _put_block(rng, occupied, 0.2, 0.8)
    return occupied


def _clutter(rng: np.random.Generator) -> np.ndarray:
    """Make a hall full of blocks."""
    occupied = np.zeros(_cells(*rng.uniform(20.0, 45.0, size=2)), bool)
    share = rng.uniform(0.1, 0.3)
    while occupied.mean() < share:
        _put_block(rng, occupied, 0.2, 2.0)
    return occupied


def _put_block(rng: np.random.Generator, occupied: np.ndarray, least: float, most: float) -> None:
    """Put a block anywhere, with sides of `least` to `most` [m]."""
    height, width = _cells(*rng.uniform(least, most, size=2))
    row, column = rng.integers(occupied.shape[0]), rng.integers(occupied.shape[1])
    occupied[row:row + height, column:column + width] = True


#: The kinds of buildings; their order is part of the seed.
BUILDINGS: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "office": _office, "blocks": _blocks, "depot": _depot, "clutter": _clutter,
}
