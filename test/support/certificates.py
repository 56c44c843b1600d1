"""Certificates of small problems, planned or recorded, for the tests of the checker and for `test/checker/spoil.py`."""

import gzip
import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from dubins_rrt_ros.checker.check import Refused, check
from dubins_rrt_ros.cli.common.certificates import read_certificate
from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, plan, save_map
from dubins_rrt_ros.planning.certificate.certificate import certify, checked_map, write_certificate
from support.cases import boxes_grid, maze_grid

#: A path is planned with so many samples.
SETTINGS = Settings(samples=300, seed=1, preferred_clearance=0.0, planning_time=1.0)
#: Ratio of a random problem's path to the Dubins curve, from which on its certificate is to have boxes.
LEAST_RATIO = 1.02
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
        check(read_certificate(folder / "path.cert"), certified.file)
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
    """The certificate of a random small problem, mostly of up to sixty boxes; None where there is no path, or no need for boxes.

    It is to halve the gap of the Dubins curve without obstacles, which takes few boxes.
    """
    grid = (boxes_grid, maze_grid)[rng.integers(2)](rng, side=18)
    vehicle = Vehicle(turning_radius=float(rng.uniform(0.2, 0.5)), robot_radius=float(rng.uniform(0.1, 0.35)))
    side, heading = 18 * grid.resolution, rng.uniform(-0.8, 0.8)  # far from each other, so that obstacles lie between
    start, goal = (pose_in(grid, side * (share + rng.uniform(-0.1, 0.1)), side * rng.uniform(0.1, 0.9), heading)
                   for share in (0.2, 0.8))
    request = [{}, {}, {"goal_tolerance_xy": 0.2, "goal_tolerance_yaw": 0.3}, {"any_goal_heading": True}][rng.integers(4)]
    problem, file = Problem(grid, vehicle, start, goal, **request), saved(grid, folder)
    answer = plan(problem, SETTINGS)
    if answer.path is None:
        return None
    world = checked_map(problem, file)
    bound = certify(problem, answer.path, world, math.inf, 0.0)["bound"]
    if bound == 0 or answer.path.length < LEAST_RATIO * bound:
        return None
    return Certified(certify(problem, answer.path, world, (answer.path.length / bound - 1) / 2, seconds), file)
