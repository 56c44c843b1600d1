"""Certificates of small problems, and claims made false, for the tests of the checker and for `test/checker/spoil.py`."""

import copy
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dubins_rrt_ros.checker.maps import read_map
from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, plan, save_map
from dubins_rrt_ros.planning.certificate.certificate import certify, checked_map
from support.cases import boxes_grid, maze_grid

#: A path is planned with so many samples, and proved to be so near to the shortest.
SETTINGS = Settings(samples=300, seed=1, preferred_clearance=0.0, planning_time=1.0)


class Certified(NamedTuple):
    """A certificate with its map."""

    document: dict
    grid: GridMap
    path: object
    file: Path


def certified(grid, vehicle, start, goal, folder, gap=0.05, seconds=20.0, **request):
    """Plan on a grid that is written to a folder; None where there is no path."""
    folder.mkdir(parents=True, exist_ok=True)
    save_map(grid, folder / "map.yaml")
    problem = Problem(grid, vehicle, start, goal, **request)
    answer = plan(problem, SETTINGS)
    if answer.path is None:
        return None
    document = certify(problem, answer.path, checked_map(problem, folder / "map.yaml"), gap, seconds)
    return Certified(document, grid, answer.path, folder / "map.yaml")


def hall():
    """A hall with a wall across that leaves a way on one side."""
    data = np.zeros((40, 50), np.int8)
    data[:28, 24:26] = 100
    return GridMap(data, 0.1, (3.0, -2.0, 0.4), "hall")


def hall_pose(x, y, yaw):
    """A pose in the hall by its place in the grid's own frame."""
    grid = hall()
    return (*grid.to_map_frame(np.array([x, y])).tolist(), yaw + grid.origin[2])


def random_certified(rng, folder):
    """The certificate of a random small problem; None where there is no path."""
    grid = (boxes_grid, maze_grid)[rng.integers(2)](rng, side=24)
    vehicle = Vehicle(turning_radius=float(rng.uniform(0.3, 1.2)), robot_radius=float(rng.uniform(0.15, 0.4)))
    side = 24 * grid.resolution
    places = rng.uniform(0.1 * side, 0.9 * side, (2, 2))
    start, goal = ((*grid.to_map_frame(place).tolist(), float(rng.uniform(-math.pi, math.pi))) for place in places)
    request = [{}, {}, {"goal_tolerance_xy": 0.2, "goal_tolerance_yaw": 0.3}, {"any_goal_heading": True}][rng.integers(4)]
    return certified(grid, vehicle, start, goal, folder, gap=0.05, seconds=2.0, **request)


def written(certified, document, folder, data=None):
    """Write a map with other cells, and let a document be for it; return the map's file."""
    grid = certified.grid
    folder.mkdir(parents=True, exist_ok=True)
    save_map(GridMap(grid.data if data is None else data, grid.resolution, grid.origin, percent=True), folder / "map.yaml")
    document["map"] = read_map(folder / "map.yaml", False).description | {"allow_unknown": False}
    return folder / "map.yaml"


def _raised_bound(certified, document, rng):
    document["bound"] *= 1.0001
    document["limit"] *= 1.0001


def _bound_above_the_path(certified, document, rng):
    document["bound"] = 1.0001 * document["length"]
    document["limit"] *= 1.1


def _raised_potential(certified, document, rng):
    level = document["boxes"][rng.integers(len(document["boxes"]))][2]
    for row in document["boxes"]:
        if row[2] == level and row[8] is not None:
            row[8] += 0.001 * document["bound"]


def _dropped_box(certified, document, rng):
    del document["boxes"][rng.integers(len(document["boxes"]))]


def _leak(certified, document, rng):
    free = document["squares"]["free"]
    row = document["boxes"][rng.integers(len(document["boxes"]))]
    up, across = divmod(int(row[0]), len(free[0]))
    free[up] = free[up][:across] + "0" + free[up][across + 1:]


def _swapped_levels(certified, document, rng):
    levels = document["levels"]
    levels[0], levels[-1] = levels[-1], levels[0]


def _wider(certified, document, rng):
    document["request"]["turning_radius"] *= 1.001


def _steeper(certified, document, rng):
    document["from_start"] = [[None if cost is None else 1.01 * cost for cost in row] for row in document["from_start"]]


#: What makes a claim false, by name.
SPOILS = {"bound above the path": _bound_above_the_path, "bound + 0.01 %": _raised_bound,
          "a potential raised": _raised_potential, "a box dropped": _dropped_box,
          "a square left out": _leak, "two levels swapped": _swapped_levels, "R + 0.1 %": _wider, "costs too steep": _steeper}
#: Spoils that can leave a claim true.
MAY_HOLD = ("bound + 0.01 %", "a potential raised", "a box dropped", "a square left out", "walls removed", "R + 0.1 %")


def spoiled(certified, name, rng):
    """A copy of a certificate's document with a false claim."""
    document = copy.deepcopy(certified.document)
    SPOILS[name](certified, document, rng)
    return document


def too_near(certified):
    """A copy for a vehicle that comes 2 mm too near to an obstacle."""
    document = copy.deepcopy(certified.document)
    world = read_map(certified.file, False)
    points = np.array([world.own(pose)[:2] for pose in certified.path.poses(0.01)])
    document["request"]["robot_radius"] = float(world.clearances(points, np.inf).min()) + 0.002
    return document


def walled(certified, folder):
    """A copy for a map with a wall on the path, and its file."""
    document, data = copy.deepcopy(certified.document), certified.grid.data.copy()
    x, y, _ = certified.path.poses(0.01)[len(certified.path.poses(0.01)) // 2]
    column, row = (certified.grid.to_grid_frame(np.array([x, y])) / certified.grid.resolution).astype(int)
    data[row, column] = 100
    return document, written(certified, document, folder, data)


def opened(certified, folder):
    """A copy for a map without obstacles, and its file."""
    document = copy.deepcopy(certified.document)
    return document, written(certified, document, folder, np.zeros_like(certified.grid.data))
