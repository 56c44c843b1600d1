"""`dubins_rrt audit`: judge a path, whoever planned it, by the audit alone, which shares no algorithm with the planner."""

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from dubins_rrt_ros import __version__
from dubins_rrt_ros.planning import Audit, InvalidPose, Map, Path, Problem, Settings, Vehicle, audit_path, values
from dubins_rrt_ros.planning.audit import cost_of, roomy_share_of
from dubins_rrt_ros.planning.audit.document import CostFigures, document_findings, pose_findings, unjudged_fields
from dubins_rrt_ros.planning.audit.poses import audit_poses, driven_length
from dubins_rrt_ros.planning.maps.frame import LARGEST_YAW
from dubins_rrt_ros.planning.maps.free_space import MAX_COORDINATE
from dubins_rrt_ros.planning.plan_file import HOOKS, PlanFileError, read_path, read_request
from dubins_rrt_ros.planning.result import pose_spacing
from dubins_rrt_ros.planning.text import fixed, one_line, quoted
from dubins_rrt_ros.planning.vehicle import without_overridden
from dubins_rrt_ros.planning.world import problem_with_costs

from .common.documents import read_poses_or_json
from .common.example import ENDS, MAP
from .common.flags import add_option_flags, checked_options
from .common.output import check_folder, finite, words_for, write_document
from .common.parser import Parser, UsageError, add_json_flag, describe
from .common.request import add_map_arguments, map_options, read_map

#: Default tolerances of poses [m, rad]: ample for four digits behind the point.
TOLERANCE_XY, TOLERANCE_YAW = 1e-3, 1e-3
#: Largest absolute numbers of a pose (x [m], y [m], yaw [rad]) that are taken.
LARGEST = (MAX_COORDINATE, MAX_COORDINATE, LARGEST_YAW)
#: Options of a plan's vehicle that a flag overrides, and their values then.
_OVERRIDES: Mapping[str, Mapping[str, Any]] = {
    "turning_radius": {"wheelbase": 0.0, "max_steering_angle": 0.0}, "robot_radius": {"footprint": ""}}


class Verdict(NamedTuple):
    """The verdict on a path.

    Attributes:
        problem: the problem that the path should solve.
        length: the length of the path [m].
        audit: what the audit found.
        not_judged: the fields of the document that nothing was compared with.
    """

    problem: Problem
    length: float
    audit: Audit
    not_judged: tuple[str, ...] = ()


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="PATH.json MAP [options]",
        description="Judges a path by code that shares nothing with the planner: whether a car can drive it, no tighter than "
                    "its turning radius, and whether all that the vehicle sweeps, between poses too, is clear of the obstacles.",
        notes="A file of `dubins_rrt plan --json` brings its vehicle, start and goal along; flags replace them. Poses of "
              "another planner, [[x, y, yaw], ...] or {\"poses\": [[x, y, yaw], ...]}, in m and rad, are judged along the arcs "
              "of constant curvature from each to the next, with the vehicle that the flags describe; where poses lie so far "
              "apart that the curvature changes between them, --tolerance-xy allows for it. All that a plan's file "
              "says is compared with its curves and the map, its poses too; what cannot be is named as not judged.",
        examples=[f"dubins_rrt plan {MAP} {ENDS} --json plan.json", f"dubins_rrt audit plan.json {MAP}",
                  "echo '[[1.5, 2, 1.5708], [1.5, 3, 1.5708], [1.5, 4, 1.5708]]' > theirs.json",
                  f"dubins_rrt audit theirs.json {MAP} --turning-radius 1 --footprint "
                  "'[[0.9, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.9, -0.3]]'"],
        exit_status="0 it passes, 1 there are findings, one a line after the verdict, 2 wrong usage")
    parser.argument_default = argparse.SUPPRESS
    parser.add_argument("path", metavar="PATH.json",
                        help="a plan, or poses: JSON, the CSV of plan --csv, or an echoed nav_msgs/Path")
    add_map_arguments(parser)
    parser.add_argument("--any-map", action="store_true", default=False,
                        help="judge a plan on another map than that on which it was planned")
    add_json_flag(parser, "the verdict")
    for name, text in (("--start", "pose at which the path must begin"), ("--goal", "pose at which it must end")):
        parser.add_argument(name, nargs=3, type=float, metavar=("X", "Y", "YAW"), help=f"{text} [m, m, rad]; default: the plan's")
    _add_tolerances(parser.add_argument_group("poses"))
    for title, cls in (("vehicle", Vehicle), ("request", Problem)):
        add_option_flags(parser, title, cls)


def _add_tolerances(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--tolerance-xy", metavar="m", type=float, default=TOLERANCE_XY,
                       help="distance by which poses may deviate sideways or backwards from an arc, in addition to what "
                            "--tolerance-yaw allows; the deviation is added to the required clearance [m]; "
                            f"default {TOLERANCE_XY:g}")
    group.add_argument("--tolerance-yaw", metavar="rad", type=float, default=TOLERANCE_YAW,
                       help="angle by which poses may turn more than the turning radius allows, and by which they may run "
                            f"sideways [rad]; default {TOLERANCE_YAW:g}")


def run(arguments: argparse.Namespace) -> int:
    """Judge the path, report, and return the exit status."""
    check_folder(arguments.json, sources=[arguments.path])
    for name in ("tolerance_xy", "tolerance_yaw"):
        if not 0 <= getattr(arguments, name) < math.inf:
            raise UsageError(f"--{name.replace('_', '-')} is {getattr(arguments, name):g}; give 0 or more")
    verdict = _judge(arguments)
    if arguments.json:
        write_document(arguments.json, finite(_document(verdict, arguments.map)))
    print(_sentence(arguments.path, verdict), *verdict.audit.findings, sep="\n", file=words_for(arguments.json))
    return 0 if verdict.audit.ok else 1


def _judge(arguments: argparse.Namespace) -> Verdict:
    document = read_poses_or_json(arguments.path)
    world_map, _ = read_map(arguments.map, **map_options(arguments))
    try:
        if isinstance(document, Mapping) and "curves" in document:
            return _judge_plan(document, world_map, arguments)
        return _judge_poses(document, world_map, arguments)
    except (PlanFileError, InvalidPose) as error:
        raise UsageError(f"{arguments.path}: {error}") from error


def _judge_plan(document: Mapping[str, Any], world_map: Map, arguments: argparse.Namespace) -> Verdict:
    # Where a function took part, it is named as not judged.
    problem, settings = read_request({key: value for key, value in document.items() if key not in HOOKS}, world_map)
    spacing = settings.path_spacing if arguments.any_map else pose_spacing(problem, settings)
    path = read_path(document)
    if path is None:
        raise PlanFileError(f"it holds no path but {quoted(document.get('error_name'))}; there is nothing to judge")
    given, of_request = (checked_options(arguments, cls) for cls in (Vehicle, Problem))
    replaced = {name: value for flag in given for name, value in _OVERRIDES.get(flag, {}).items()}
    vehicle = Vehicle(**without_overridden(values(problem.vehicle) | replaced | given))
    problem = replace(problem, vehicle=vehicle, **_ends(arguments), **of_request)
    problem = problem_with_costs(problem, settings)
    found = audit_path(path, problem)
    # With other things than it was planned with its clearance is another.
    others = ["min_clearance"] if given or of_request or arguments.any_map else []
    others += ["map_id"] if arguments.any_map else []
    others += ["cost", "cost_lower_bound", "cost_gap", "roomy_share"] if others else []
    findings = document_findings({name: value for name, value in document.items() if name not in others}, path, found,
                                 world_map.id, None if others or not found.ok else _costs(path, problem, settings))
    along = () if math.isinf(found.max_curvature) else pose_findings(_poses(document), path, spacing)
    return Verdict(problem, path.length, replace(found, findings=(*found.findings, *along, *findings)),
                   tuple(unjudged_fields(document, others)))


def _costs(path: Path, problem: Problem, settings: Settings) -> CostFigures:
    return CostFigures(cost_of(path, problem, settings), roomy_share_of(path, problem, settings))


def _judge_poses(document: Any, world_map: Map, arguments: argparse.Namespace) -> Verdict:
    poses = _poses(document)
    ends = {"start": poses[0], "goal": poses[-1]} | _ends(arguments)
    vehicle, request = Vehicle(**without_overridden(checked_options(arguments, Vehicle))), checked_options(arguments, Problem)
    problem = Problem(world_map, vehicle, **ends, **request)
    others = tuple(name for name in document if name != "poses") if isinstance(document, Mapping) else ()
    found = audit_poses(poses, problem, arguments.tolerance_xy, arguments.tolerance_yaw)
    return Verdict(problem, driven_length(poses), found, others)


def _ends(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the start and the goal, where they were given."""
    return {name: getattr(arguments, name) for name in ("start", "goal") if name in arguments}


def _poses(document: Any) -> np.ndarray:
    """Read the (n, 3) poses of a document."""
    poses = document.get("poses") if isinstance(document, Mapping) else document
    if not (isinstance(poses, list) and poses):
        raise PlanFileError('it holds no poses; give [[x, y, yaw], ...] or {"poses": [[x, y, yaw], ...]}, one pose at least')
    for i, pose in enumerate(poses):
        if not (isinstance(pose, list) and len(pose) == 3
                and all(type(n) in (int, float) and abs(n) <= most for n, most in zip(pose, LARGEST, strict=True))):
            raise PlanFileError(f"pose {i} is {quoted(pose)}; give three numbers, x [m] and y [m], none beyond {LARGEST[0]:g}, "
                                f"and yaw [rad], none beyond {LARGEST[2]:g}")
    return np.array(poses, dtype=float)


def _sentence(file: str, verdict: Verdict) -> str:
    """Say the verdict, with its figures, in a sentence."""
    found = verdict.audit
    count = f"fails with {len(found.findings)} finding{'s' * (len(found.findings) > 1)}"
    vehicle = verdict.problem.vehicle
    required = "of its footprint" if vehicle.footprint else f"for a robot radius of {vehicle.robot_radius:g} m"
    not_judged = f" Not judged: {one_line(', '.join(verdict.not_judged))}." if verdict.not_judged else ""
    return (f"{file} {'passes' if found.ok else count}: length {fixed(verdict.length, 3)} m, least clearance "
            f"{fixed(found.min_clearance, 4)} m {required}, greatest curvature {fixed(found.max_curvature, 4)} 1/m for a turning "
            f"radius of {vehicle.turning_radius:g} m.{not_judged}")


def _document(verdict: Verdict, map_name: str) -> dict[str, Any]:
    """Return the verdict as JSON holds it."""
    problem, found = verdict.problem, verdict.audit
    return {"ok": found.ok, "findings": list(found.findings), "not_judged": list(verdict.not_judged),
            "length": verdict.length,
            "min_clearance": found.min_clearance, "max_curvature": found.max_curvature,
            "map": map_name, "map_id": problem.map.id, "start": list(problem.start), "goal": list(problem.goal),
            "vehicle": values(problem.vehicle), "request": values(problem), "version": __version__}
