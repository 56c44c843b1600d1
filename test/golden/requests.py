"""The requests of the golden record: every planner, sampler and kind of vehicle, on our maps and on other projects'."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

Pose = tuple[float, float, float]


@dataclass(frozen=True)
class Request:
    """One request.

    Attributes:
        name: no other has it.
        map: `own:FILE` of maps/, or `peers:FILE`.
        vehicle, problem, settings: keyword arguments beyond map, start and goal.
    """

    name: str
    map: str
    start: Pose
    goal: Pose
    vehicle: dict[str, Any]
    problem: dict[str, Any] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)


PLAIN = {"informed": False, "shortcut": False, "heading_sampling": "uniform"}
CAR = {"footprint": "[[0.7, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.7, -0.2]]", "turning_radius": 1.0}
L_SHAPE = {"footprint": "[[0.4, 0.3], [0.1, 0.3], [0.1, 0.1], [-0.3, 0.1], [-0.3, -0.2], [0.4, -0.2]]", "turning_radius": 0.8}
LARGE_CAR = {"footprint": "[[3.6, 0.9], [-0.9, 0.9], [-0.9, -0.9], [3.6, -0.9]]", "turning_radius": 5.0}
DISC = {"turning_radius": 1.0, "robot_radius": 0.2}

#: Start and goal on the three maps of the paper, as grids and as polygons.
PAPER: dict[str, tuple[Pose, Pose]] = {
    "block": ((1.5, 1.5, 1.57), (14.5, 10.5, 0.0)), "maze": ((1.5, 2.0, 1.57), (13.5, 10.5, 1.57)),
    "forest": ((1.2, 1.2, 0.79), (18.8, 16.8, 0.79)),
}
#: Problems on other projects' maps, which are not part of this repository: map, start, goal, turning radius, robot radius.
PEERS: dict[str, tuple[str, Pose, Pose, float, float]] = {
    "depot_a": ("depot", (12.36, -6.5, 1.5707963267948966), (20.9, 4.9, 3.141592653589793), 0.8, 0.295),
    "smoothers_a": ("smoothers_world", (2.35, 6.75, -1.5707963267948966), (13.5, 1.75, 0.0), 0.5, 0.195),
    "sandbox": ("tb3_sandbox", (-2.0, -0.5, 0.0), (1.65, 0.55, 0.0), 0.4, 0.185),
    "berlin_a": ("Berlin_0_256", (48.5, 34.5, 0.5), (240.5, 204.5, -1.5707963267948966), 5.0, 0.7),
    "berlin_b": ("Berlin_0_256", (18.5, 146.5, 0.0), (214.5, 189.5, 2.4), 4.0, 0.7),
    "boston_a": ("Boston_1_1024", (64.5, 946.5, 0.0), (958.5, 76.5, -0.7853981633974483), 6.0, 0.7),
}


def _requests() -> Iterator[Request]:
    for name, (start, goal) in PAPER.items():
        yield from _on_paper_map(name, start, goal)
    yield from _in_the_maze(*PAPER["maze"])
    for name, (world_map, start, goal, turning_radius, robot_radius) in PEERS.items():
        vehicle = {"turning_radius": turning_radius, "robot_radius": robot_radius}
        file = f"peers:maps/{world_map}.yaml"
        yield Request(f"{name} informed", file, start, goal, vehicle, settings={"samples": 3000, "seed": 1})
        yield Request(f"{name} rrt", file, start, goal, vehicle, settings={"planner": "rrt", "seed": 2})
    for seed in range(3):
        yield Request(f"parking {seed}", "own:parking.geojson", (2.5, 8.75, 0.0), (22.0, 4.1, -1.5708), LARGE_CAR,
                      settings={"samples": 300, "seed": seed})


def _on_paper_map(name: str, start: Pose, goal: Pose) -> Iterator[Request]:
    """What is asked of each map of the paper, as a grid and as polygons."""
    for kind, ending in (("grid", "yaml"), ("polygons", "geojson")):
        file = f"own:{name}.{ending}"
        yield Request(f"{name} {kind} informed", file, start, goal, DISC, settings={"samples": 3000, "seed": 1})
        yield Request(f"{name} {kind} rrt", file, start, goal, DISC, settings={"planner": "rrt", "seed": 3})
        yield Request(f"{name} {kind} plain rrt", file, start, goal, DISC,
                      settings={"planner": "rrt", "seed": 3, "samples": 5000, **PLAIN})
        yield Request(f"{name} {kind} plain rrt_star", file, start, goal, DISC, settings={"samples": 1500, "seed": 4, **PLAIN})
        yield Request(f"{name} {kind} car", file, start, goal, CAR, settings={"samples": 400, "seed": 5})
        yield Request(f"{name} {kind} L", file, start, goal, L_SHAPE, settings={"samples": 400, "seed": 6})
    yield Request(f"{name} steps", f"own:{name}.yaml", start, goal, DISC, settings={"samples": 1500, "seed": 7, "step_size": 1.5})
    yield Request(f"{name} plain steps", f"own:{name}.yaml", start, goal, DISC,
                  settings={"samples": 1500, "seed": 8, "step_size": 2.0, **PLAIN})


def _in_the_maze(start: Pose, goal: Pose) -> Iterator[Request]:
    """Every option that the others leave at its default, and requests that fail."""
    file = "own:maze.yaml"
    for sampling in ("uniform", "goal", "field", "mixed"):
        yield Request(f"maze headings {sampling}", file, start, goal, DISC,
                      settings={"samples": 800, "seed": 9, "heading_sampling": sampling, "informed": False})
    tolerances: dict[str, dict[str, Any]] = {
        "position": {"goal_tolerance_xy": 0.3}, "heading": {"goal_tolerance_yaw": 0.5}, "any heading": {"any_goal_heading": True},
        "all": {"goal_tolerance_xy": 0.2, "goal_tolerance_yaw": 0.3}, "unknown": {"allow_unknown": True}}
    for what, options in tolerances.items():
        yield Request(f"maze {what}", file, start, goal, DISC, options, {"samples": 800, "seed": 10})
    yield Request("maze no shortcut", file, start, goal, DISC, settings={"samples": 1500, "seed": 11, "shortcut": False})
    yield Request("maze not informed", file, start, goal, DISC, settings={"samples": 1500, "seed": 12, "informed": False})
    yield Request("maze bias", file, start, goal, DISC, settings={"samples": 1500, "seed": 13, "goal_bias": 0.3})
    yield Request("maze too wide", file, start, goal, {"turning_radius": 1.0, "robot_radius": 0.9},
                  settings={"samples": 200, "seed": 14})
    yield Request("maze start occupied", file, (0.0, 0.0, 0.0), goal, DISC, settings={"samples": 200, "seed": 15})
    yield Request("maze goal outside", file, start, (100.0, 0.0, 0.0), DISC, settings={"samples": 200, "seed": 16})
    yield Request("maze at the goal", file, start, start, DISC, settings={"samples": 200, "seed": 17})
    yield Request("maze few samples", file, start, goal, DISC, settings={"samples": 20, "seed": 18, "informed": False})


REQUESTS = tuple(_requests())
