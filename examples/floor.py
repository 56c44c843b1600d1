"""A floor for simulated cars, which `drive.py` drives on: walls, people who walk, and the maps that a car makes of them."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import distance_transform_edt

from dubins_rrt_ros.planning import GridMap

#: Radius of a car's body [m].
BODY = 0.2
#: Of people: their number, radius [m], speed [m/s], how near to a car they turn back, and how far a car sees them [m].
PEOPLE, PERSON, WALK, SHY, SIGHT = 3, 0.2, 0.6, 1.2, 6.0
#: What is said of a map without place for cars and people.
NO_ROOM = "there is hardly room to drive on this map"
#: Number of wrong cells in each map.
SPECKLE = 2


@dataclass
class Floor:
    """What is really there: walls, and people who walk.

    Attributes:
        grid: the walls.
        distance: of each cell to the nearest wall [m].
        people: (n, 4) x, y [m] and their velocity [m/s].
    """

    grid: GridMap
    rng: np.random.Generator
    distance: np.ndarray = field(init=False)
    people: np.ndarray = field(init=False)

    def __post_init__(self):
        free = self.grid.data < 25
        self.distance = distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * self.grid.resolution
        self.people = np.array([[*self.random_place(0.5), 0.0, 0.0] for _ in range(PEOPLE)])

    def random_place(self, room: float) -> tuple[float, float]:
        """Return a place that is so far from all walls [m]; SystemExit where there is none."""
        rows, columns = np.nonzero(self.distance >= room)
        if not len(rows):
            raise SystemExit(NO_ROOM)
        pick = self.rng.integers(len(rows))
        x, y = self.grid.origin[:2]
        return x + (columns[pick] + 0.5) * self.grid.resolution, y + (rows[pick] + 0.5) * self.grid.resolution

    def room(self, x: float, y: float) -> float:
        """Return the distance of a point to the nearest wall, to within a cell [m]."""
        column, row = (int((a - b) / self.grid.resolution) for a, b in zip((x, y), self.grid.origin[:2], strict=True))
        height, width = self.distance.shape
        return self.distance[row, column] if 0 <= row < height and 0 <= column < width else 0.0

    def walk(self, seconds: float, cars: list[np.ndarray]) -> None:
        """Let people walk on; they turn at walls, and away from cars."""
        for person in self.people:
            near = [car for car in cars if math.dist(car[:2], person[:2]) < SHY]
            if not self._step(person, seconds, near) or not person[2:].any():
                away = math.atan2(*(person[:2] - near[0][:2])[::-1]) if near else self.rng.uniform(-math.pi, math.pi)
                angle = away + self.rng.uniform(-1.0, 1.0)
                person[2:] = WALK * math.cos(angle), WALK * math.sin(angle)

    def _step(self, person: np.ndarray, seconds: float, near: list[np.ndarray]) -> bool:
        """Let a person take a step where no wall is, and no car comes nearer by it; return True if so."""
        x, y = person[:2] + seconds * person[2:]
        if self.room(x, y) < 0.35 or any(math.dist(car[:2], (x, y)) < math.dist(car[:2], person[:2]) for car in near):
            return False
        person[:2] = x, y
        return True

    def seen(self, car: np.ndarray, others: list[np.ndarray]) -> GridMap:
        """Return the map as a car has it: walls, people and other cars in sight, and wrong cells."""
        cells = self.grid.data.copy()
        height, width = cells.shape
        x = self.grid.origin[0] + (np.arange(width) + 0.5) * self.grid.resolution
        y = self.grid.origin[1] + (np.arange(height) + 0.5) * self.grid.resolution
        reach = self.grid.resolution * math.sqrt(0.5)  # to whose middle a cell that is touched reaches
        discs = [(*person[:2], PERSON + reach) for person in self.people] + [(*other[:2], BODY + reach) for other in others]
        for px, py, radius in discs:
            if math.dist((px, py), car[:2]) < SIGHT:
                cells[np.hypot(x[None, :] - px, y[:, None] - py) < radius] = 100
        cells[self.rng.integers(height, size=SPECKLE), self.rng.integers(width, size=SPECKLE)] = 100
        return GridMap(cells, self.grid.resolution, self.grid.origin, self.grid.name, percent=True)
