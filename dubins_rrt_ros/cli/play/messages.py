"""The messages between page and server: requests as the page sends them, maps and answers as it shows them."""

import base64
import io
import math
import shlex
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import shapely
from PIL import Image

from dubins_rrt_ros.planning import GridMap, Map, Plan, Pose, Problem, Settings, Vehicle, checked_pose, options, values
from dubins_rrt_ros.planning.option import Option, OptionError
from dubins_rrt_ros.planning.problem import Waypoint, checked_waypoints
from dubins_rrt_ros.planning.text import quoted

from ..common.example import GOAL, START
from ..common.flags import flag

#: Longer side of the picture of a map [pixel], and maximum number of the pieces of a tree that are shown.
PICTURE_SIDE, MOST_PIECES = 2048, 40_000
#: Number of pieces across the map in which paths and trees are shown.
PIECES = 500
#: Brightness of free, unknown and occupied cells.
FREE, UNKNOWN, OCCUPIED = 255, 200, 70


class PlanRequest(NamedTuple):
    """A request of the page.

    Attributes:
        id: the number that the answers to it have.
        start, goal: (x [m], y [m], theta [rad]).
        via: the waypoints between them, in order, as `plan_through` takes them.
        vehicle, settings: as the library has them.
        problem: the options of the problem by name.
        is_quick: True while the mouse drags something: then the first path that is shortened and audited ends the search.
    """

    id: int
    start: Pose
    goal: Pose
    via: tuple[Waypoint, ...]
    vehicle: Vehicle
    settings: Settings
    problem: dict[str, Any]
    is_quick: bool


def read_request(document: Mapping[str, Any]) -> PlanRequest:
    """Read a request.

    Raises:
        InvalidPose, OptionError: a pose is none, or an option is unknown or out of range.
    """
    vehicle, settings = Vehicle(**_known(Vehicle, document)), Settings(**_known(Settings, document))
    problem = _known(Problem, document)
    number = document.get("id")
    start, goal = (checked_pose(name, document.get(name, ())) for name in ("start", "goal"))
    via = checked_waypoints(document.get("via", ()))
    return PlanRequest(number if isinstance(number, int) else 0, start, goal, via, vehicle, settings, problem,
                       document.get("quick") is True)


def _known(cls: type, document: Mapping[str, Any]) -> dict[str, Any]:
    name = cls.__name__.lower()
    given = document.get(name, {})
    if not isinstance(given, dict):
        raise OptionError(f"{name} is {quoted(given)}; give an object of options")
    names = {item.name for item in options(cls)}
    if unknown := sorted(map(str, given.keys() - names)):
        raise OptionError(f"there is no option {unknown[0]}")
    return given


def option_documents() -> dict[str, Any]:
    """Return the options of vehicle, problem and settings, from which the page makes its form."""
    return {name: [_option_document(item) for item in options(cls)]
            for name, cls in (("vehicle", Vehicle), ("problem", Problem), ("settings", Settings))}


def _option_document(item: Option) -> dict[str, Any]:
    return {"name": item.name, "type": item.type.__name__, "default": item.default, "unit": item.unit, "low": item.low,
            "high": item.high, "choices": item.choices, "help": item.help}


def map_document(world_map: Map, name: str, is_new: bool) -> dict[str, Any]:
    """Return a map as the page draws it: rings of polygons, or the picture of a grid.

    Args:
        world_map: the map.
        name: how the user named it.
        is_new: True if it was loaded, and not drawn on: then the poses on it begin anew.
    """
    corners = world_map.corners()
    start, goal = first_poses(world_map)
    shape = _picture(world_map) if isinstance(world_map, GridMap) else {"rings": _rings(world_map.free)}
    return {"type": "map", "name": name, "new": is_new, "low": corners.min(axis=0).tolist(), "high": corners.max(axis=0).tolist(),
            "start": start, "goal": goal, **shape}


def _picture(grid: GridMap) -> dict[str, Any]:
    """Return the picture of a grid, its size [m] and its origin; where it has too many cells the darkest of several is shown."""
    shades: np.ndarray = np.full(grid.data.shape, FREE, np.uint8)
    shades[grid.blocked(allow_unknown=False)] = UNKNOWN
    shades[grid.blocked(allow_unknown=True)] = OCCUPIED
    factor = math.ceil(max(shades.shape) / PICTURE_SIDE)
    shades = np.minimum.reduceat(np.minimum.reduceat(shades, np.arange(0, len(shades), factor)),
                                 np.arange(0, shades.shape[1], factor), axis=1)
    png = io.BytesIO()
    Image.fromarray(shades[::-1]).save(png, "png", compress_level=1)
    rows, columns = shades.shape
    size = [columns * factor * grid.resolution, rows * factor * grid.resolution]
    return {"picture": "data:image/png;base64," + base64.b64encode(png.getvalue()).decode(), "size": size,
            "origin": list(grid.origin)}


def _rings(free: shapely.Geometry) -> list[list[float]]:
    rings = [ring for part in shapely.get_parts(free) for ring in (part.exterior, *part.interiors)]
    return [np.round(shapely.get_coordinates(ring), 4).ravel().tolist() for ring in rings]


def first_poses(world_map: Map) -> tuple[Pose, Pose]:
    """Return a start and a goal to begin with: those of the maze's examples where it is as large, or the ends of a diagonal."""
    corners = world_map.corners()
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    if np.allclose([*low, *size], [0, 0, 15, 12], atol=0.2):
        return START, GOAL
    (x0, y0), (x1, y1) = (low + 0.12 * size).tolist(), (low + 0.88 * size).tolist()
    heading = math.atan2(y1 - y0, x1 - x0)
    return (x0, y0, heading), (x1, y1, heading)


def answer_document(request: PlanRequest, plan: Plan, is_final: bool, first_length: float | None) -> dict[str, Any]:
    """Return a plan as the page shows it.

    Args:
        request: what it answers.
        plan: the plan, or the plan so far.
        is_final: True if no better one follows.
        first_length: the length of the first path [m], or None.
    """
    spacing = _spacing(plan)
    poses = plan.path.poses(spacing) if plan.path else np.empty((0, 3))
    return {"type": "answer", "id": request.id, "quick": request.is_quick, "final": is_final, "status": plan.status.name,
            "message": plan.message, "path": np.round(poses, 4).ravel().tolist(), "length": plan.length,
            "first_length": first_length, "lower_bound": _finite(plan.lower_bound), "gap": _finite(plan.gap),
            "samples": int(plan.samples), "tree_nodes": len(plan.tree), "time_to_first": plan.time_to_first,
            "planning_time": plan.planning_time, "min_clearance": plan.min_clearance, "location": plan.location,
            "footprint": plan.problem.vehicle.footprint, "radius": plan.problem.vehicle.robot_radius}


def tree_bytes(request: PlanRequest, plan: Plan) -> bytes:
    """Return the tree as float32: the number of the request, and x, y of both ends of each piece."""
    pieces = plan.tree.segments(_spacing(plan), MOST_PIECES).astype("<f4")
    return np.float32(request.id).astype("<f4").tobytes() + pieces.tobytes()


def _spacing(plan: Plan) -> float:
    """Return the length of the pieces in which curves are shown [m]: as fine as they are seen."""
    return max(plan.path_spacing, float(np.ptp(plan.problem.map.corners(), axis=0).max()) / PIECES)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def as_command(request: PlanRequest, map_name: str, map_options: Mapping[str, Any]) -> str:
    """Return the command line that plans a request, on a map that was loaded with options of `load_map`."""
    words = ["dubins_rrt", "plan", map_name, "--start", *map(repr, request.start), "--goal", *map(repr, request.goal)]
    for waypoint in request.via:
        words += ["--via", *(repr(number) for number in waypoint if number is not None)]
    for name, value in {**map_options, **_given(request)}.items():
        words += [flag(name if value is not False else f"no_{name}"), *([] if isinstance(value, bool) else [str(value)])]
    return shlex.join(words)


def as_python(request: PlanRequest, map_name: str, map_options: Mapping[str, Any]) -> str:
    """Return the program that plans a request, on a map that was loaded with options of `load_map`."""
    parts = {"Vehicle": _differing(request.vehicle), "Problem": request.problem, "Settings": _differing(request.settings)}
    keywords = {name: ", ".join(f"{key}={value!r}" for key, value in given.items()) for name, given in parts.items()}
    more = f", {keywords['Problem']}" if keywords["Problem"] else ""
    of_map = "".join(f", {key}={value!r}" for key, value in map_options.items())
    verb, waypoints = ("plan_through", f"{list(request.via)!r}, ") if request.via else ("plan", "")
    return (f"from dubins_rrt_ros.planning import Problem, Settings, Vehicle, load_map, {verb}\n\n"
            f"problem = Problem(load_map({map_name!r}{of_map}), Vehicle({keywords['Vehicle']}),\n"
            f"                  start={request.start!r}, goal={request.goal!r}{more})\n"
            f"result = {verb}(problem, {waypoints}Settings({keywords['Settings']}))\n"
            "print(result.message)\n")


def _given(request: PlanRequest) -> dict[str, Any]:
    return {**_differing(request.vehicle), **request.problem, **_differing(request.settings)}


def _differing(instance: Vehicle | Settings) -> dict[str, Any]:
    """Return the options that differ from their defaults; of those that derive from others only these."""
    given = {item.name: value for item in options(type(instance)) if (value := values(instance)[item.name]) != item.default}
    if given.get("footprint"):
        given.pop("robot_radius", None)
    if given.get("wheelbase"):
        given.pop("turning_radius", None)
    return given
