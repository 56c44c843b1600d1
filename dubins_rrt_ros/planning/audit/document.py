"""The audit of a plan's document: of what it says of its path, and of the poses, which are what a follower drives."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..option import is_number
from ..problem import InvalidPose, checked_waypoint
from ..text import at, quoted
from .cost import COST_ERROR, SHARE_ERROR
from .sweep import PRECISION, SHARE, Arcs
from .verdict import TOLERANCE, Audit, driven_arcs, in_order, passing_findings

if TYPE_CHECKING:
    from ..curves.path import Path

#: What a document says of a path that was found, word for word.
_SAID_OF_A_PATH = {"error_code": 0, "error_name": "NONE", "audit": "ok"}
#: Relative difference of figures that are the same, computed otherwise.
_ROUNDING = 1e-9
#: The fields that the audit of the path judges it by, or judges.
_BASIS = ("curves", "start", "goal", "vehicle", "settings")
#: Settings that a document repeats.
_SETTINGS = ("planner", "seed")
#: Number of arcs ahead on which a pose is looked for before all others.
_AHEAD = 8


class CostFigures(NamedTuple):
    """The cost of a path by the settings of its document [m], and the share of its length with room, or None."""

    cost: float
    roomy_share: float | None


def document_findings(document: Mapping[str, Any], path: "Path", found: Audit, map_id: str, costs: CostFigures | None = None
                      ) -> Iterator[str]:
    """Yield a sentence for each field that does not agree with the path.

    Args:
        document: of a plan with a path.
        path: the path of its curves.
        found: what the audit found of that path, with the vehicle and on the map of the document.
        map_id: the id of the map; "" where another one may be taken.
        costs: the figures of its cost by the document's settings; None where they are not judged.
    """
    for name, expected in _SAID_OF_A_PATH.items():
        if name in document and (document[name] != expected or isinstance(document[name], bool)):
            yield f"{name} is {quoted(document[name])}, and of a path it is {expected!r}"
    settings = document.get("settings")
    for name in _SETTINGS:
        if name in document and isinstance(settings, Mapping) and document[name] != settings.get(name):
            yield f"{name} is {quoted(document[name])}, and among the settings {quoted(settings.get(name))}"
    if map_id and "map_id" in document and document["map_id"] != map_id:
        yield f"map_id is {quoted(document['map_id'])}, and this map's is {map_id}: it was planned on another one"
    yield from _waypoint_findings(document, path)
    length = path.length
    for name in ("length", "path_length"):
        yield from _figure(document, name, length, _ROUNDING * length)
    yield from _figure(document, "max_curvature", found.max_curvature, _ROUNDING * found.max_curvature)
    yield from _figure(document, "min_clearance", found.min_clearance, max(PRECISION, SHARE * found.min_clearance))
    yield from _bound_findings(document, length, "lower_bound", "gap", f"the path is {length:.6g} m long", _ROUNDING)
    if costs is not None:
        cost, roomy_share = costs
        tolerance = _ROUNDING if cost == length else COST_ERROR
        yield from _figure(document, "cost", cost, tolerance * cost)
        yield from _bound_findings(document, document.get("cost", cost), "cost_lower_bound", "cost_gap",
                                   f"the cost is {cost:.6g} m", tolerance)
        if roomy_share is not None:
            yield from _figure(document, "roomy_share", roomy_share, SHARE_ERROR)
        elif document.get("roomy_share") is not None:
            yield f"roomy_share is {quoted(document['roomy_share'])}, and no clearance is preferred"


def unjudged_fields(document: Mapping[str, Any], passed_over: Sequence[str] = ()) -> list[str]:
    """Return the fields of a plan's document that are not judged.

    Of the lower bounds it is judged that the path is not below them, but not that no other one is; and of the settings those
    that the cost and the poses depend on.
    """
    judged = {*_SAID_OF_A_PATH, *_BASIS, *_SETTINGS, "map_id", "length", "path_length", "max_curvature", "min_clearance", "gap",
              "cost", "cost_gap", "roomy_share", "poses", "waypoints", "waypoint_indices"}
    others = [name for name in document if name not in judged or name in passed_over or name == "settings"]
    said = {"settings": "settings (by which it was sought)", "lower_bound": "lower_bound (that no path is shorter)",
            "cost_lower_bound": "cost_lower_bound (that no path costs less)"}
    return [said.get(name, name) for name in others]


def pose_findings(poses: np.ndarray, path: "Path", spacing: float) -> list[str]:
    """Judge whether poses run along all of a path, with every joint among them.

    Args:
        poses: (n, 3) x [m], y [m], yaw [rad], finite; at least one.
        path: the path; its curves can be driven.
        spacing: maximum distance between two poses along the path [m]; 0 is any.
    """
    arcs = in_order(driven_arcs(path.curves, path.start)[2], len(path.curves))
    begins = np.append(0.0, np.cumsum(arcs.length))
    places, off = _places(poses, arcs, begins, TOLERANCE + 8 * np.finfo(float).eps * float(np.abs(poses[:, :2]).max()))
    if off:
        k, distance, turned = off[0]
        return [f"pose {k} at {at(poses[k][:2], 3)} is {distance:.6g} m and {turned:.6g} rad from what is ahead "
                f"on the curves; {len(off)} of {len(poses)} poses are off"]
    return list(_gap_findings(np.array(places), begins, arcs.curvature, spacing))


def _figure(document: Mapping[str, Any], name: str, value: float, tolerance: float) -> Iterator[str]:
    if name in document and not (is_number(document[name]) and abs(document[name] - value) <= tolerance):
        yield f"{name} is {quoted(document[name])}, and the path's is {value:.6g}"


def _waypoint_findings(document: Mapping[str, Any], path: "Path") -> Iterator[str]:
    """Yield a sentence for each waypoint that the path does not pass, or that is not where the document says."""
    waypoints, indices = (document.get(name, []) for name in ("waypoints", "waypoint_indices"))
    try:
        passed = [checked_waypoint("waypoint", waypoint) for waypoint in waypoints]
        poses = [document["poses"][index] for index in indices]
    except (InvalidPose, TypeError, LookupError):
        yield f"waypoints are {quoted(waypoints)}, and waypoint_indices {quoted(indices)}"
        return
    yield from passing_findings(path, passed)
    if list(indices) != sorted(indices) or len(indices) != len(passed) or any(
            not np.allclose(pose[:2], waypoint[:2], 0, TOLERANCE) for pose, waypoint in zip(poses, passed, strict=False)):
        yield f"waypoint_indices are {quoted(indices)}, which are not the poses at the waypoints"


def _bound_findings(document: Mapping[str, Any], value: Any, bound_name: str, gap_name: str, what: str, tolerance: float
                    ) -> Iterator[str]:
    bound = document.get(bound_name, 0.0)
    if not is_number(value):
        return
    if not (is_number(bound) and 0 <= bound <= value * (1 + tolerance)):
        yield f"{bound_name} is {quoted(bound)}, and {what}"
    elif gap_name in document:
        gap = value / bound - 1 if bound > 0 else 0.0 if value == 0 else None
        said = document[gap_name]
        if not (said is gap or (gap is not None and is_number(said) and abs(said - gap) <= _ROUNDING * (1 + gap))):
            of = "length" if gap_name == "gap" else "cost"
            yield f"{gap_name} is {quoted(said)}, and by {of} and {bound_name} it is {gap if gap is None else f'{gap:.6g}'}"


def _gap_findings(places: np.ndarray, begins: np.ndarray, curvature: np.ndarray, spacing: float) -> Iterator[str]:
    """Yield a sentence for what poses, by their arc lengths along the path, leave out of it."""
    if places[0] > TOLERANCE or places[-1] < begins[-1] - TOLERANCE:
        yield f"the poses run from {places[0]:.6g} m to {places[-1]:.6g} m of a path of {begins[-1]:.6g} m"
    steps = np.diff(places)
    if spacing > 0 and len(steps) and steps.max() > spacing + 2 * TOLERANCE:
        k = int(np.argmax(steps))
        yield f"from pose {k} to pose {k + 1} are {steps[k]:.6g} m, more than the {spacing:g} m of path_spacing"
    bends = np.flatnonzero(np.diff(curvature)) + 1
    nearest = np.abs(places - begins[bends][:, None]).min(axis=1) if len(bends) else np.empty(0)
    left_out = np.flatnonzero(nearest > 2 * TOLERANCE)
    if len(left_out):
        yield f"no pose is where the curvature changes, {begins[bends][left_out[0]]:.6g} m along the path"


def _places(poses: np.ndarray, arcs: Arcs, begins: np.ndarray, tolerance: float
            ) -> tuple[list[float], list[tuple[int, float, float]]]:
    """Find poses along arcs, each no further back than the one before.

    Returns:
        Their arc lengths [m]; and of those that are nowhere the index, and how far the nearest place ahead is [m, rad].
    """
    places, off = [], []
    first, least = 0, 0.0
    for k, pose in enumerate(poses):
        for some in (slice(first, first + _AHEAD), slice(first, None)):
            s, distance, turned = _offsets(pose, arcs, some)
            along = begins[:-1][some] + s
            fits = (distance <= tolerance) & (turned <= TOLERANCE) & (along >= least - tolerance)
            if fits.any():
                break
        else:
            nearest = int(np.argmin(np.hypot(distance, turned)))
            off.append((k, float(distance[nearest]), float(turned[nearest])))
            continue
        i = int(np.argmax(fits))
        first, least = first + i, float(along[i])
        places.append(least)
    return places, off


def _offsets(pose: np.ndarray, arcs: Arcs, some: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where on each of some arcs a pose is nearest [m], and how far off it is there [m, rad]."""
    index = np.arange(len(arcs.x))[some]
    curvature, length, theta = arcs.curvature[some], arcs.length[some], arcs.theta[some]
    local = (complex(pose[0], pose[1]) - (arcs.x[some] + 1j * arcs.y[some])) * np.exp(-1j * theta)
    # On a circle the point at an angle a is at (sin a, 1 - cos a) / curvature.
    angle = np.arctan2(curvature * local.real, 1 - curvature * local.imag)
    turning = curvature != 0
    s = np.where(turning, np.divide(angle, curvature, out=np.zeros(len(angle)), where=turning), local.real)
    full = np.divide(math.tau, np.abs(curvature), out=np.full(len(angle), np.inf), where=turning)
    behind = turning & (s < 0) & (s + full - length <= -s)  # nearer to the end than to the start
    s = np.clip(np.where(behind, s + full, s), 0.0, length)
    x, y, heading = arcs.at(index, s)
    turned = np.abs((heading - pose[2] + math.pi) % math.tau - math.pi)
    return s, np.hypot(pose[0] - x, pose[1] - y), turned
