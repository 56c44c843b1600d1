"""Paths over two free waypoints, against legs planned between many headings: `python -m dubins_rrt_ros.evaluation.waypoints`.

The reference plans every leg between HEADINGS headings at either end and joins the cheapest chain of them; leg by leg takes at
each waypoint the heading that is best for the leg that leads there. A line of JSON for each problem, and a last one of all.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from dubins_rrt_ros.planning import Plan, Pose, Problem, Settings, Vehicle, World, load_map, plan, plan_through, prepare
from dubins_rrt_ros.planning.search.legs import cheapest_chain

from .families.buildings import building

#: Number of headings at each waypoint of the reference.
HEADINGS = 36
#: A path that is longer than the reference by no more than this share is as short.
CLOSE = 0.005
#: Lengths that differ by less [m] are equal.
SAME = 1e-3
VEHICLE = Vehicle(turning_radius=1.0, robot_radius=0.3)
#: The maps, by name.
MAPS = {"maze": lambda: load_map("maze"), "office": lambda: building("office", 1, 0).map}
#: How the legs of the reference are planned, and the paths that are compared.
LEG = Settings(samples=100, planning_time=0.3, seed=1, length_proof=False, preferred_clearance=0.0)
WHOLE = Settings(samples=1000, planning_time=10.0, seed=1, length_proof=False, preferred_clearance=0.0)


def main() -> int:
    """Compare, and return the exit status: 1 where a path is not as short as the reference."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--number", type=int, default=10, help="number of problems on each map")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them, to go on where another run ended")
    parser.add_argument("--maps", nargs="+", choices=MAPS, default=list(MAPS))
    parser.add_argument("--headings", type=int, default=HEADINGS)
    arguments = parser.parse_args()
    lines: list[dict[str, Any]] = []
    for name in arguments.maps:
        world = prepare(MAPS[name](), VEHICLE)
        for number in range(arguments.first, arguments.first + arguments.number):
            lines.append({"map": name, "number": number, **compare(world, number, arguments.headings)})
            print(json.dumps(lines[-1]), flush=True)
    differing = [line for line in lines if line["leg_by_leg"] - line["reference"] > SAME]
    summary = {"problems": len(lines), "close": sum(line["length"] <= (1 + CLOSE) * line["reference"] for line in lines),
               "worst": max(line["length"] / line["reference"] - 1 for line in lines),
               "differing": len(differing), "shorter": sum(line["length"] < line["leg_by_leg"] for line in differing)}
    print(json.dumps(summary))
    return 0 if summary["close"] == len(lines) else 1


def compare(world: World, seed: int, headings: int = HEADINGS) -> dict[str, float]:
    """Return the length of a path over two random waypoints, that of the reference, that of leg by leg [m], and its time [s]."""
    start, *places, goal = _random_poses(world, np.random.default_rng(seed))
    answer = plan_through(Problem(world, start=start, goal=goal), [place[:2] for place in places], WHOLE)
    turns = (np.arange(headings) * math.tau / headings - math.pi).tolist()
    stops = [[start], *([(x, y, turn) for turn in turns] for x, y, _ in places), [goal]]
    legs = [_lengths(world, here, there) for here, there in pairwise(stops)]
    chain = cheapest_chain(legs)
    at, by_legs = 0, 0.0
    for leg in legs:
        there = int(np.argmin(leg[at]))
        by_legs, at = by_legs + leg[at, there], there
    return {"length": _length_of(answer),
            "reference": sum(float(leg[i, j]) for leg, (i, j) in zip(legs, pairwise(chain), strict=True)),
            "leg_by_leg": float(by_legs),
            "time_to_first": answer.time_to_first or math.inf, "planning_time": answer.planning_time}


def _random_poses(world: World, rng: np.random.Generator) -> list[Pose]:
    """Draw four free poses of which each can be reached from the one before."""
    corners = world.map.corners()
    poses: list[Pose] = []
    while len(poses) < 4:
        x, y = rng.uniform(corners.min(axis=0), corners.max(axis=0)).tolist()
        pose = x, y, float(rng.uniform(-math.pi, math.pi))
        if world.field.pose_is_free(pose, VEHICLE) and (not poses or _length(world, poses[-1], pose) < math.inf):
            poses.append(pose)
    return poses


def _lengths(world: World, starts: list[Pose], ends: list[Pose]) -> np.ndarray:
    """Return the (starts, ends) lengths of planned legs [m], infinite where none is found."""
    return np.array([[_length(world, start, end) for end in _free(world, ends)] for start in _free(world, starts)])


def _free(world: World, poses: list[Pose]) -> Iterator[Pose]:
    return (pose for pose in poses if world.field.pose_is_free(pose, VEHICLE))


def _length(world: World, start: Pose, goal: Pose) -> float:
    return _length_of(plan(Problem(world, start=start, goal=goal), LEG))


def _length_of(answer: Plan) -> float:
    return math.inf if answer.length is None else answer.length


if __name__ == "__main__":
    sys.exit(main())
