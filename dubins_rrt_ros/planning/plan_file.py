"""A Plan as a JSON document and back; its numbers read back bit for bit."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dubins_rrt_ros import __version__

from .curves.dubins import WORDS, DubinsCurve
from .curves.path import Path, PathError
from .errors import PlanningError
from .hooks import IsFree, Sampler, name_of
from .maps.model import Map
from .option import is_number, options, values
from .problem import Problem, Waypoint, checked_pose, checked_waypoint
from .result import Plan
from .settings import MAX_PLANNING_TIME, Settings
from .text import quoted, quoted_name
from .vehicle import Vehicle
from .work import WorkDone

#: Settings that a document of an earlier version lacks, as that version planned.
BEFORE = {"preferred_clearance": 0.0, "clearance_weight": 0.0, "cost_weight": 0.0, "stop_gap": 0.0, "length_proof": False}

#: Keys of the functions that a document names.
HOOKS = ("is_free", "sampler")


class PlanFileError(PlanningError, ValueError):
    """A document that holds no plan; the message says what is wrong with it."""


def to_document(plan: Plan, map_name: str) -> dict[str, Any]:
    """Return a plan as what JSON can hold.

    Args:
        plan: with a path or without: then length and its like are None, curves and poses empty.
        map_name: the map as the user named it, to be found again when the request is planned again.
    """
    problem, settings, path = plan.problem, plan.settings, plan.path
    return {
        "error_code": int(plan.status), "error_name": plan.status.name, "message": plan.message,
        "found_by": plan.found_by,
        "planner": settings.planner, "seed": settings.seed, "samples": int(plan.samples), "tree_nodes": len(plan.tree),
        "time_to_first": _number(plan.time_to_first), "time_to_found": _number(plan.time_to_found),
        "planning_time": _number(plan.planning_time),
        "map_time": _number(plan.map_time), "length": _number(plan.length), "path_length": _number(plan.length),
        "lower_bound": _number(plan.lower_bound),
        "gap": _number(plan.gap), "cost": _number(plan.cost), "cost_lower_bound": _number(plan.cost_lower_bound),
        "cost_gap": _number(plan.cost_gap), "roomy_share": _number(plan.roomy_share),
        "min_clearance": _number(plan.min_clearance),
        "max_curvature": _number(plan.max_curvature), "audit": str(plan.audit or ""),
        "work": plan.work and list(plan.work),
        "curves": [_curve_document(curve) for curve in path.curves] if path else [],
        "poses": plan.poses().tolist(),
        **_waypoints_document(plan), **_hooks_document(plan),
        "map": map_name, "map_id": problem.map.id, "start": list(problem.start), "goal": list(problem.goal),
        "vehicle": values(problem.vehicle), "settings": values(problem) | values(settings), "version": __version__,
    }


def _number(value: float | None) -> float | None:
    """Return a float; None also for the infinite lower bound of an unreachable goal, which JSON cannot hold."""
    return float(value) if value is not None and math.isfinite(value) else None


def _waypoints_document(plan: Plan) -> dict[str, Any]:
    """Return the waypoints as they were asked for, with null for a heading that is free, and where among the poses they are."""
    if not plan.waypoints:
        return {}
    return {"waypoints": [list(waypoint) for waypoint in plan.waypoints], "waypoint_indices": list(plan.waypoint_indices)}


def _hooks_document(plan: Plan) -> dict[str, Any]:
    """Return the names of the user's functions that took part."""
    functions = (plan.problem.is_free, plan.settings.sampler)
    return {key: name_of(function) for key, function in zip(HOOKS, functions, strict=True) if function}


def _curve_document(curve: DubinsCurve) -> dict[str, Any]:
    return {"start": [float(c) for c in curve.start], "radius": float(curve.radius), "word": curve.word,
            "lengths": [float(length) for length in curve.lengths]}


def read_request(document: Mapping[str, Any], world_map: Map, *, is_free: IsFree | None = None, sampler: Sampler | None = None
                 ) -> tuple[Problem, Settings]:
    """Return the request that a document answers, for planning it again on a map.

    The time limit is lifted to the largest allowed, and the work ends where it ended: a deadline, a cancellation and a proof,
    which is not made again, only cut it short, so that the path is the same on a machine of any speed. Over waypoints, and
    where a document of an earlier version tells no work, the samples that were drawn are the budget.

    Args:
        is_free, sampler: the functions that the plan was made with; a document has their names alone.

    Raises:
        PlanFileError: something is missing, or is of another type, such a function among it.
        OptionError, InvalidPose: a value is out of range.
    """
    for key, function in zip(HOOKS, (is_free, sampler), strict=True):
        if key in document and function is None:
            raise PlanFileError(f"it was planned with {key} {quoted_name(str(document[key]))}, a function, which no file holds; "
                                f"plan it again in Python, by read_request(document, map, {key}=...)")
    fields = dict(_field(document, "settings", Mapping))
    vehicle = Vehicle(**_known(Vehicle, _field(document, "vehicle", Mapping), "vehicle"))
    request = {item.name: fields.pop(item.name) for item in options(Problem) if item.name in fields}
    start, goal = (checked_pose(name, _triple(_field(document, name, list), name)) for name in ("start", "goal"))
    problem = Problem(world_map, vehicle, start, goal, **request, is_free=is_free)
    fields = _known(Settings, BEFORE | fields, "settings")
    settings = Settings(**fields | {"sampler": sampler})
    drawn = _field(document, "samples", int)
    if document.get("work") is not None:
        return problem, repeating(settings, _work(document["work"]))
    return problem, replace(_untimed(settings), samples=drawn or settings.samples)


def repeating(settings: Settings, work: WorkDone) -> Settings:
    """Return the settings with which the same work is done again, whatever time it takes."""
    return replace(_untimed(settings), work_limits=work)


def _untimed(settings: Settings) -> Settings:
    return replace(settings, planning_time=MAX_PLANNING_TIME, stop_gap=0.0)


def _work(units: Any) -> WorkDone:
    if not (isinstance(units, list) and len(units) == 3 and all(type(count) is int and count >= 0 for count in units)):
        raise PlanFileError(f"work holds {quoted(units)} where three numbers of units are due")
    return WorkDone(*units)


def read_waypoints(document: Mapping[str, Any]) -> tuple[Waypoint, ...]:
    """Return the waypoints of the request that a document answers.

    Raises:
        PlanFileError: they are no list.
        InvalidPose: one of them is no waypoint.
    """
    if "waypoints" not in document:
        return ()
    return tuple(checked_waypoint("waypoint", waypoint) for waypoint in _field(document, "waypoints", list))


def read_path(document: Mapping[str, Any]) -> Path | None:
    """Return the path in a document, or None where there is none.

    Raises:
        PlanFileError: something is missing, or is of another type.
    """
    poses = _field(document, "poses", list)
    if not poses:
        return None
    curves = tuple(_read_curve(curve) for curve in _field(document, "curves", list))
    try:
        return Path.of_curves(_triple(poses[0], "poses"), _triple(poses[-1], "poses"), curves)
    except PathError as error:
        raise PlanFileError(f"its curves do not form a path: {error}") from None


def _read_curve(curve: Any) -> DubinsCurve:
    if not isinstance(curve, Mapping):
        raise PlanFileError("one of its curves is no object")
    word = _field(curve, "word", str)
    if word not in WORDS:
        raise PlanFileError(f"one of its curves has the word {quoted(word)}; there are {', '.join(WORDS)}")
    start, lengths = (_triple(_field(curve, name, list), name) for name in ("start", "lengths"))
    radius = _field(curve, "radius", float)
    if not (0 < radius < math.inf and min(lengths) >= 0):
        raise PlanFileError(f"one of its curves has the radius {radius:g} and the lengths {lengths}; the radius must be above 0, "
                            "and no length below")
    return DubinsCurve(start, radius, word, lengths)


def _triple(numbers: Any, name: str) -> tuple[float, float, float]:
    if not (isinstance(numbers, list) and len(numbers) == 3 and all(map(is_number, numbers))):
        raise PlanFileError(f"{name} holds {quoted(numbers)} where three finite numbers are due")
    x, y, z = map(float, numbers)
    return x, y, z


def _field(document: Mapping[str, Any], name: str, kind: type) -> Any:
    if not isinstance(document.get(name), kind):
        raise PlanFileError(f"its field {name} is missing or not of type {kind.__name__}; give a file that "
                            "`dubins_rrt plan --json` wrote")
    return document[name]


def _known(cls: type, fields: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the fields as a dict; they must be exactly the options of `cls`."""
    difference = {item.name for item in options(cls)} ^ set(fields)
    if difference:
        raise PlanFileError(f"its field {name} differs from what version {__version__} knows, in "
                            f"{', '.join(sorted(difference))}; plan anew")
    return dict(fields)
