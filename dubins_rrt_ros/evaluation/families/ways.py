"""Paths in buildings with several ways round, compared with the best that is known."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from dubins_rrt_ros.planning import OCCUPIED, GridMap, Path, Problem, Settings, plan, prepare

from .buildings import BUILDINGS, RESOLUTION, building

#: Number of seeds with which each problem is planned, and of samples of the two runs that the reference is from.
SEEDS, REFERENCE_SAMPLES = 5, 50_000
#: Number of places of the best path that are closed, one at a time, to plan other corridors by themselves; limit of each [s].
CLOSED_PLACES, CLOSED_TIME = 14, 0.5
#: Excesses over the reference whose share is reported.
CLOSE, FAR = 0.005, 0.05


def measured(number: int, settings: Settings) -> dict[str, Any]:
    """Plan problem `number` with several seeds; return by how much the paths are longer than the reference, in a line of JSON.

    The reference is the shortest of long runs, of corridors planned by themselves, and of these paths.
    """
    kind = list(BUILDINGS)[number % len(BUILDINGS)]
    problem = building(kind, settings.seed, number // len(BUILDINGS))
    problem = Problem(prepare(problem.map, problem.vehicle), start=problem.start, goal=problem.goal)
    answers = [plan(problem, replace(settings, seed=seed)) for seed in range(SEEDS)]
    lengths = [answer.length for answer in answers if answer.length is not None]
    longer = [length / _reference(problem, lengths) - 1 for length in lengths]
    return {"family": "ways", "kind": kind, "number": number, "solved": len(lengths), "longer": longer}


def _reference(problem: Problem, lengths: list[float]) -> float:
    long_runs = [plan(problem, Settings(samples=REFERENCE_SAMPLES, planning_time=60.0, seed=100 + seed, preferred_clearance=0.0))
                 for seed in range(2)]
    paths = [answer.path for answer in long_runs if answer.path]
    best = min(paths, key=lambda path: path.length, default=None)
    others = _lengths_around(best, problem) if best else ()
    return min([*lengths, *(path.length for path in paths), *others])


def _lengths_around(path: Path, problem: Problem) -> Iterator[float]:
    """Yield the lengths of paths around places of a path, each of which is closed as far as the nearest obstacle."""
    assert isinstance(problem.map, GridMap)
    data = problem.map.data
    x, y = (RESOLUTION * (np.arange(size) + 0.5) for size in data.shape[::-1])
    field = prepare(problem.map, problem.vehicle).field
    for place in path.at(np.linspace(0, 1, CLOSED_PLACES + 2)[1:-1])[:, :2]:
        near = np.hypot(x - place[0], y[:, None] - place[1]) <= float(field.at(place)) + RESOLUTION
        closed = GridMap(np.where(near, OCCUPIED, data).astype(np.int8), RESOLUTION)
        answer = plan(Problem(closed, problem.vehicle, problem.start, problem.goal),
                      Settings(planning_time=CLOSED_TIME, seed=0, preferred_clearance=0.0))
        if answer.length is not None:
            yield answer.length


def report(lines: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the rows of a table: one for each kind of building."""
    yield f"{'ways':<20}{'runs':>10}{f'above {100 * CLOSE:g} %':>14}{f'above {100 * FAR:g} %':>14}{'worst':>10}"
    for kind in BUILDINGS:
        longer = [excess for line in lines if line["kind"] == kind for excess in line["longer"]]
        counts = [sum(excess > limit for excess in longer) for limit in (CLOSE, FAR)]
        yield f"{kind:<20}{len(longer):>10}{counts[0]:>14}{counts[1]:>14}{100 * max(longer, default=math.nan):>8.2f} %"
