"""Paths over two free waypoints, against legs planned between many headings: `python -m dubins_rrt_ros.evaluation.waypoints`.

The reference plans legs between HEADINGS headings at either end and joins the cheapest chain of them; leg by leg takes at each
waypoint the heading that is best for the leg that leads there. Of all legs the first paths are sought, and those legs are planned
to the end that would be in the cheapest chain if that made them shorter by DRAFT_EXCESS. A line of JSON for each problem, and a
last one of all.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from dubins_rrt_ros.planning import Plan, Pose, Problem, Settings, Vehicle, World, load_map, plan, plan_through, prepare
from dubins_rrt_ros.planning.curves import dubins
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
#: How the legs of the reference are planned, at first and to the end, and the paths that are compared.
DRAFT = Settings(planner="rrt", planning_time=0.3, seed=1, preferred_clearance=0.0)
LEG = Settings(samples=300, planning_time=1.0, seed=1, length_proof=False, preferred_clearance=0.0)
WHOLE = Settings(samples=3000, planning_time=3.0, seed=1, length_proof=False, preferred_clearance=0.0)
#: A first path of a leg is assumed to be longer than the planned one by no more than this share.
DRAFT_EXCESS = 0.1
#: How the poses of a problem are tried. With the time of a draft they would depend on how busy the machine is.
DRAW = replace(DRAFT, planning_time=3.0)
#: Number of poses in a row that cannot be reached after which a pose is taken to lead nowhere.
MOST_TRIES = 20


def main() -> int:
    """Compare, and return the exit status: 1 where a path is not as short as the reference."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--number", type=int, default=10, help="number of problems on each map")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them, to go on where another run ended")
    parser.add_argument("--maps", nargs="+", choices=MAPS, default=list(MAPS))
    parser.add_argument("--headings", type=int, default=HEADINGS)
    parser.add_argument("--planning-time", type=float, default=WHOLE.planning_time, help="of the paths that are compared [s]")
    arguments = parser.parse_args()
    lines: list[dict[str, Any]] = []
    for name in arguments.maps:
        world = prepare(MAPS[name](), VEHICLE)
        for number in range(arguments.first, arguments.first + arguments.number):
            lines.append({"map": name, "number": number, **compare(world, number, arguments.headings, arguments.planning_time)})
            print(json.dumps(lines[-1]), flush=True)
    differing = [line for line in lines if line["leg_by_leg"] - line["reference"] > SAME]
    summary = {"problems": len(lines), "close": sum(line["length"] <= (1 + CLOSE) * line["reference"] for line in lines),
               "worst": max(line["length"] / line["reference"] - 1 for line in lines),
               "differing": len(differing), "shorter": sum(line["length"] < line["leg_by_leg"] for line in differing)}
    print(json.dumps(summary))
    return 0 if summary["close"] == len(lines) else 1


def compare(world: World, seed: int, headings: int, planning_time: float) -> dict[str, float]:
    """Return the length of a path over two random waypoints, that of the reference, that of leg by leg [m], and its time [s]."""
    start, *places, goal = random_poses(world, np.random.default_rng(seed))
    answer = plan_through(Problem(world, start=start, goal=goal), [place[:2] for place in places],
                          replace(WHOLE, planning_time=planning_time))
    turns = (np.arange(headings) * math.tau / headings - math.pi).tolist()
    stops = [[start], *([(x, y, turn) for turn in turns] for x, y, _ in places), [goal]]
    legs = [_Leg(world, list(_free(world, here)), list(_free(world, there))) for here, there in pairwise(stops)]
    chain = _decided_chain(legs)
    by_legs = [0]
    for leg in legs:
        by_legs.append(_decided_chain([leg], by_legs[-1])[-1])
    return {"length": _length_of(answer), "reference": _sum(legs, chain), "leg_by_leg": _sum(legs, by_legs),
            "planned_legs": sum(int(leg.is_planned.sum()) for leg in legs),
            "time_to_first": answer.time_to_first or math.inf, "planning_time": answer.planning_time}


class _Leg:
    """The planned lengths of a leg between headings, of which those are planned that are asked for.

    Attributes:
        lengths: (starts, ends) float64 [m]: planned, or what they may be at least; infinite where no path is found.
        is_planned: (starts, ends) bool.
    """

    def __init__(self, world: World, starts: list[Pose], ends: list[Pose]):
        self._world, self._starts, self._ends = world, starts, ends
        curves = dubins.lengths(np.array(starts)[:, None], np.array(ends)[None], VEHICLE.turning_radius)
        drafts = np.array([[_length(world, start, end, DRAFT) for end in ends] for start in starts])
        self.lengths = np.maximum(curves, drafts / (1 + DRAFT_EXCESS))
        self.is_planned = np.isinf(drafts)

    def plan(self, i: int, j: int) -> bool:
        """Plan the leg between two headings; return True if it has been planned before."""
        if self.is_planned[i, j]:
            return True
        self.lengths[i, j] = _length(self._world, self._starts[i], self._ends[j], LEG)
        self.is_planned[i, j] = True
        return False


def _decided_chain(legs: list[_Leg], first: int | None = None) -> list[int]:
    """Return the indices of the headings with which the planned legs are shortest together, from one of the first or from any."""
    rows = slice(None) if first is None else slice(first, first + 1)
    while True:
        chain = cheapest_chain([legs[0].lengths[rows], *(leg.lengths for leg in legs[1:])])
        chain[0] += first or 0
        if all(leg.plan(i, j) for leg, (i, j) in zip(legs, pairwise(chain), strict=True)):
            return chain


def _sum(legs: list[_Leg], chain: list[int]) -> float:
    return sum(float(leg.lengths[i, j]) for leg, (i, j) in zip(legs, pairwise(chain), strict=True))


def random_poses(world: World, rng: np.random.Generator) -> list[Pose]:
    """Draw four free poses of which each can be reached from the one before; others where one leads nowhere."""
    corners = world.map.corners()
    poses: list[Pose] = []
    tries = 0
    while len(poses) < 4:
        x, y = rng.uniform(corners.min(axis=0), corners.max(axis=0)).tolist()
        pose = x, y, float(rng.uniform(-math.pi, math.pi))
        if not world.field.pose_is_free(pose, VEHICLE):
            continue
        tries += 1
        if not poses or _length(world, poses[-1], pose, DRAW) < math.inf:
            poses.append(pose)
            tries = 0
        elif tries == MOST_TRIES:
            poses.clear()
            tries = 0
    return poses


def _free(world: World, poses: list[Pose]) -> Iterator[Pose]:
    return (pose for pose in poses if world.field.pose_is_free(pose, VEHICLE))


def _length(world: World, start: Pose, goal: Pose, settings: Settings) -> float:
    return _length_of(plan(Problem(world, start=start, goal=goal), settings))


def _length_of(answer: Plan) -> float:
    return math.inf if answer.length is None else answer.length


if __name__ == "__main__":
    sys.exit(main())
