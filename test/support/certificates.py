"""Certificates of small problems, planned or recorded, for the tests of the checker and for `test/checker/spoil.py`."""

import gzip
import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from dubins_rrt_ros.checker.check import Refused, check
from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, plan, save_map
from dubins_rrt_ros.planning.certificate.certificate import certify, checked_map, write_certificate
from support.cases import boxes_grid, maze_grid

#: A path is planned with so many samples.
SETTINGS = Settings(samples=300, seed=1, preferred_clearance=0.0, planning_time=1.0)
RECORDED = Path(__file__).resolve().parents[1] / "checker" / "recorded"


@dataclass(frozen=True, eq=False)
class Certified:
    """A certificate with the file of its map."""

    document: dict
    file: Path


def certified(problem, map_file, gap=0.05, seconds=20.0, settings=SETTINGS):
    """Plan and prove; None where there is no path."""
    answer = plan(problem, settings)
    if answer.path is None:
        return None
    return Certified(certify(problem, answer.path, checked_map(problem, map_file), gap, seconds), map_file)


def saved(grid, folder):
    """A grid's map file in a folder, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    save_map(grid, folder / "map.yaml")
    return folder / "map.yaml"


@cache
def recorded(name):
    """A recorded certificate, with the file of its map; `test/checker/record.py` made them."""
    file = next(file for file in RECORDED.glob(f"{name}.*") if file.suffix in (".yaml", ".geojson"))
    return Certified(json.loads(gzip.decompress((RECORDED / f"{name}.cert").read_bytes())), file)


def recorded_names():
    """The names of what is recorded."""
    return sorted(file.stem for file in RECORDED.glob("*.cert"))


def refusal(certified, folder):
    """The checker's sentence about a document, "" where it holds."""
    write_certificate(folder / "path.cert", certified.document)
    try:
        check(folder / "path.cert", certified.file)
    except Refused as refused:
        return str(refused)
    return ""


def hall():
    """A hall with a wall across that leaves a way on one side."""
    data = np.zeros((40, 50), np.int8)
    data[:28, 24:26] = 100
    return GridMap(data, 0.1, (3.0, -2.0, 0.4), "hall")


def pose_in(grid, x, y, yaw):
    """A pose of a grid by its place in the grid's own frame."""
    return (*grid.to_map_frame(np.array([x, y])).tolist(), yaw + grid.origin[2])


def random_certified(rng, folder, seconds):
    """The certificate of a random small problem, mostly of up to sixty boxes after 0.2 s; None where there is no path."""
    grid = (boxes_grid, maze_grid)[rng.integers(2)](rng, side=18)
    vehicle = Vehicle(turning_radius=float(rng.uniform(0.3, 1.0)), robot_radius=float(rng.uniform(0.15, 0.4)))
    side = 18 * grid.resolution
    start, goal = (pose_in(grid, *rng.uniform(0.1 * side, 0.9 * side, 2), float(rng.uniform(-math.pi, math.pi)))
                   for _ in range(2))
    request = [{}, {}, {"goal_tolerance_xy": 0.2, "goal_tolerance_yaw": 0.3}, {"any_goal_heading": True}][rng.integers(4)]
    return certified(Problem(grid, vehicle, start, goal, **request), saved(grid, folder), gap=0.1, seconds=seconds)
