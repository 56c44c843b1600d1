"""The deadlines of `dubins_rrt bench --deadlines`: by how much answers exceed the planning time, in wall time and in CPU time."""

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from dubins_rrt_ros.planning import GridMap, Map, Pose, Problem, Settings, Vehicle, World, load_map, plan, prepare

from .report import table

#: Planning times that are tried [s].
LIMITS = 0.05, 0.1, 0.3, 1.0
#: Number of requests for each problem and limit, unless told.
REQUESTS = 20
#: Overruns that are told apart, as quantiles.
QUANTILES = {"p50": 0.5, "p99": 0.99, "max": 1.0}
#: Number of poses that are drawn at most to find one that is free.
DRAWS = 10_000

DISC = Vehicle(turning_radius=1.0, robot_radius=0.2)
STAR = Vehicle(turning_radius=0.5, footprint=tuple(((0.4 + 0.25 * (i % 2)) * math.cos(math.tau * i / 100) + 0.1,
                                               (0.4 + 0.25 * (i % 2)) * math.sin(math.tau * i / 100)) for i in range(100)))
TRUCK = Vehicle(turning_radius=12.0, footprint=((10.5, 1.25), (-1.5, 1.25), (-1.5, -1.25), (10.5, -1.25)))
#: The vehicles, by name, that drive on each of the maps.
VEHICLES: Mapping[str, Mapping[str, Vehicle]] = {
    "maze": {"disc": DISC, "star": STAR}, "halls": {"truck": TRUCK}, "blocks": {"disc": DISC, "star": STAR, "truck": TRUCK}}
#: The kinds of goals: one that can most likely be reached, one behind a wall, and one that the vehicle is too long or turns too
#: wide to reach, which is not proved.
GOALS = "open", "walled", "tight"


class Request(NamedTuple):
    """A request whose answer is timed: the name of its problem, the problem and the settings."""

    name: str
    problem: Problem
    settings: Settings


def requests(count: int, settings: Settings) -> Iterator[Request]:
    """Yield `count` requests for each map, vehicle, kind of goal and limit."""
    for map_name, vehicles in VEHICLES.items():
        for vehicle_name, vehicle in vehicles.items():
            for kind in GOALS:
                name = f"{map_name} {vehicle_name} {kind}"
                yield from _of_problem(name, map_name, vehicle, kind, count, settings)


def number_of_requests(count: int) -> int:
    """Return how many requests `requests` yields."""
    return count * len(LIMITS) * len(GOALS) * sum(map(len, VEHICLES.values()))


def _of_problem(name: str, map_name: str, vehicle: Vehicle, kind: str, count: int, settings: Settings) -> Iterator[Request]:
    rng = np.random.default_rng(sum(map(ord, name)))
    room = _room(vehicle, kind)
    world = prepare(_with_room(_MAPS[map_name](), room), vehicle)
    goal = _goal(world.map, room)
    for seed in range(count):
        start = _free_pose(world, rng)
        for limit in LIMITS:
            end = _free_pose(world, rng) if kind == "open" else goal
            yield Request(name, Problem(world, start=start, goal=end), replace(settings, seed=seed, planning_time=limit))


def _free_pose(world: World, rng: np.random.Generator) -> Pose:
    """Draw a pose at which the vehicle is free."""
    corners = world.map.corners()
    low, high = corners.min(axis=0), corners.max(axis=0)
    for _ in range(DRAWS):
        (x, y), theta = rng.uniform(low, high).tolist(), float(rng.uniform(-math.pi, math.pi))
        if world.field.pose_is_free((x, y, theta), world.vehicle):
            return x, y, theta
    raise ValueError(f"no free pose on {world.map}")


def _room(vehicle: Vehicle, kind: str) -> tuple[float, float]:
    """Return the inner side of the room around the goal and the width of its door, 0 where it has none [m]; 0 without a room."""
    if kind == "open":
        return 0.0, 0.0
    side = 2.4 * vehicle.circumscribed_radius
    return side, 0.0 if kind == "walled" else 2.1 * vehicle.inscribed_radius


def _with_room(world_map: GridMap, room: tuple[float, float]) -> GridMap:
    """Return a map with a room whose door is in a corner, across the heading of its goal, in the upper right of the map."""
    side, door = (math.ceil(length / world_map.resolution) for length in room)
    if not side:
        return world_map
    data = world_map.data.copy()
    top, right = data.shape
    data[top - side - 3:, right - side - 3:] = 100
    data[top - side - 1:top - 1, right - side - 1:right - 1] = 0
    data[top - side - 3:top - side - 1, right - side - 1:right - side - 1 + door] = 0
    data[max(0, top - 2 * side - 3):top - side - 3, right - side - 1:] = 0  # what was in front of the door
    return GridMap(data, world_map.resolution, world_map.origin)


def _goal(world_map: Map, room: tuple[float, float]) -> Pose:
    """Return the middle of the room, facing the door's wall."""
    x, y = world_map.corners().max(axis=0).tolist()
    return x - room[0] / 2 - 0.05, y - room[0] / 2 - 0.05, -math.pi / 2


@cache
def _maze() -> GridMap:
    found = load_map("maze")
    assert isinstance(found, GridMap)
    return found


@cache
def _halls() -> GridMap:
    """Return four halls of 150 m by 37 m, with passages of 30 m at alternate ends."""
    data = np.zeros((3000, 3000), np.int8)
    for number, row in enumerate((750, 1500, 2250)):
        data[row:row + 4, 600:] = 100
        if number % 2:
            data[row:row + 4] = data[row:row + 4, ::-1]
    return GridMap(data, 0.05)


@cache
def _blocks() -> GridMap:
    """Return 200 m by 200 m with blocks of 6 m to 9 m, 20 m from one to the next."""
    data, rng = np.zeros((4000, 4000), np.int8), np.random.default_rng(1)
    for row in range(100, 4000, 400):
        for column in range(100, 4000, 400):
            height, width = rng.integers(120, 180, 2)
            data[row:row + height, column:column + width] = 100
    return GridMap(data, 0.05)


_MAPS: Mapping[str, Callable[[], GridMap]] = {"maze": _maze, "halls": _halls, "blocks": _blocks}


def measure(asked: Iterable[Request]) -> Generator[dict[str, Any], None, None]:
    """Plan each request, and yield by how much it took longer than its limit, in wall time and in CPU time of this thread [s]."""
    for name, problem, settings in asked:
        wall, cpu = time.perf_counter(), time.thread_time()
        answer = plan(problem, settings)
        wall, cpu = time.perf_counter() - wall, time.thread_time() - cpu
        yield {"problem": name, "seed": settings.seed, "time_limit": settings.planning_time, "solved": answer.solved,
               "error_name": answer.status.name, "message": answer.message, "time_to_found": answer.time_to_found,
               "time_to_first": answer.time_to_first, "total_s": wall, "cpu_s": cpu,
               "over_s": wall - settings.planning_time, "cpu_over_s": cpu - settings.planning_time}


def overruns(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return a table in Markdown of the overruns of each problem and limit, and of all."""
    head = ["problem", "limit [s]", "solved", *(f"{name} over, {clock} [ms]" for clock in ("wall", "CPU") for name in QUANTILES)]
    groups: dict[tuple[str, float], list[Mapping[str, Any]]] = {}
    for line in lines:
        groups.setdefault((line["problem"], line["time_limit"]), []).append(line)
    rows = [[name, f"{limit:g}", *_figures(group)] for (name, limit), group in groups.items()]
    return table(head, [*rows, ["all", "", *_figures(lines)]])


def _figures(lines: Sequence[Mapping[str, Any]]) -> list[str]:
    solved = sum(line["solved"] for line in lines)
    return [f"{solved}/{len(lines)}",
            *(f"{1e3 * max(0.0, float(np.quantile([line[clock] for line in lines], share))):.1f}"
              for clock in ("over_s", "cpu_over_s") for share in QUANTILES.values())]
