"""`dubins_rrt plan`: plan one path, report it, write it to files and draw it."""

import argparse
import contextlib
import math
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import FrameType
from typing import TYPE_CHECKING, Any, TextIO

from dubins_rrt_ros.planning import GridMap, Plan, Problem, Progress, Settings, Vehicle, plan, plan_through
from dubins_rrt_ros.planning.maps.frame import DoubtfulYaw, doubt_about_yaw
from dubins_rrt_ros.planning.plan_file import repeating
from dubins_rrt_ros.planning.problem import Waypoint, checked_waypoint
from dubins_rrt_ros.planning.vehicle import without_overridden

from .common.certificates import UNCERTIFIED, add_certificate_flags, certifiable_map, proof_limits, write_proof
from .common.example import ENDS, EXAMPLE, MAP
from .common.flags import LengthSettings, add_option_flags, add_paper_flag, checked_options, flag, given_settings
from .common.output import ANIMATIONS, DRAWINGS, check_drawing, check_folder, is_animation, words_for, write_csv, write_json
from .common.parser import Parser, UsageError, add_json_flag, describe
from .common.progress import progress_bar
from .common.request import MAP_FLAGS, LoadedRequest, add_map_arguments, map_options, read_map, read_replay

if TYPE_CHECKING:
    from dubins_rrt_ros.planning.pictures.animation import Recording

#: Where the poses of a car are, for the help.
REFERENCE_POINT = ("Poses are of the vehicle's reference point; a car's is the middle of its rear axle, for which the turning "
                   "radius is wheelbase / tan(max_steering_angle). With another point nothing is guaranteed.")


class _Replay(argparse.Action):
    """The flag --replay, with which the arguments that its file contains are no longer required."""

    def __init__(self, *, contained: list[argparse.Action], **keywords: Any):
        super().__init__(**keywords)
        self.contained = contained

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any,
                 option_string: str | None = None) -> None:
        namespace.replay = values
        for action in self.contained:
            action.required = False


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="MAP --start X Y YAW --goal X Y YAW [options]",
        description="Plans a path on a map, prints its figures and writes it to files.",
        examples=[EXAMPLE, f"dubins_rrt plan {MAP} {ENDS} --planner rrt --json plan.json", "dubins_rrt plan --replay plan.json",
                  "dubins_rrt plan parking.geojson --start 2.5 8.75 0 --goal 22 4.1 -1.5708 --turning-radius 5 \\",
                  "    --footprint '[[3.6, 0.9], [-0.9, 0.9], [-0.9, -0.9], [3.6, -0.9]]'"],
        notes=f"{REFERENCE_POINT} The first Ctrl-C ends the search with the best path so far.",
        exit_status="0 a path, 1 none: its error_code and the reason are on standard error, 2 wrong usage, 130 interrupted")
    required = add_request_arguments(parser)
    add_json_flag(parser, "the plan, also without a path,")
    parser.add_argument("--csv", metavar="FILE", help="write the poses of the path as CSV: x, y, theta, clearance, curvature")
    parser.add_argument("--plot", metavar="FILE", help=f"draw map, tree and path ({', '.join(DRAWINGS)}), or an animation of the "
                                                         f"search, over waypoints of the drive ({', '.join(ANIMATIONS)})")
    parser.add_argument("--drive", metavar="FILE",
                        help=f"draw an animation of the vehicle that drives along the path ({', '.join(ANIMATIONS)})")
    parser.add_argument("--certificate", metavar="FILE",
                        help="write the path with a proof of how short it is, as `dubins_rrt certify` does")
    add_certificate_flags(parser)
    parser.add_argument("--replay", metavar="FILE", action=_Replay, contained=required,
                        help="plan the request of a file that --json wrote again, in place of all other options: with "
                             "its seed and as many samples as it drew, and no time limit, so that the path is the same")


def add_request_arguments(parser: Parser, certified: bool = False) -> list[argparse.Action]:
    """Give a parser the arguments of a request; return those that are required.

    Args:
        certified: leave those out with which a path has no certificate.
    """
    required = [add_map_arguments(parser, pictures=not certified)]
    for name, text in (("--start", "start pose of the vehicle"), ("--goal", "goal pose of the vehicle")):
        required.append(parser.add_argument(name, nargs=3, type=float, metavar=("X", "Y", "YAW"), required=True,
                                            default=argparse.SUPPRESS, help=f"{text} [m, m, rad]"))
    if not certified:
        parser.add_argument("--via", nargs="+", type=float, action="append", metavar=("X Y", "YAW"), default=argparse.SUPPRESS,
                            help="waypoint between start and goal [m, m, rad]; one flag for each, in their order; without YAW "
                                 "it is passed with the heading that makes the whole path shortest")
    parser.add_argument("--degrees", action="store_true", default=argparse.SUPPRESS,
                        help="take the yaws of all poses in degrees; what is written stays in radians")
    for title, cls in (("vehicle", Vehicle), ("request", Problem), ("settings", LengthSettings if certified else Settings)):
        add_option_flags(parser, title, cls, without=UNCERTIFIED if certified else ())
    add_paper_flag(parser)
    return required


def run(arguments: argparse.Namespace) -> int:
    """Plan, report, write the files, and return the exit status."""
    sources = [file for file in (getattr(arguments, "map", None), arguments.replay) if file]
    check_folder(arguments.json, arguments.csv, arguments.plot, arguments.drive, arguments.certificate, sources=sources)
    check_drawing(arguments.plot, DRAWINGS + ANIMATIONS)
    check_drawing(arguments.drive, ANIMATIONS)
    gap, seconds = proof_limits(arguments)
    request = _request(arguments)
    if arguments.certificate and request.waypoints:
        raise UsageError("a path through waypoints has no certificate; leave --via out")
    checked_map = certifiable_map(request.problem, request.map_name) if arguments.certificate else None
    with _interrupt() as cancel, _shown(request.settings) as on_progress:
        if request.waypoints:
            answer = plan_through(request.problem, request.waypoints, request.settings, cancel=cancel, on_progress=on_progress)
        else:
            answer = plan(request.problem, request.settings, cancel=cancel, on_progress=on_progress)
    answer = replace(answer, map_time=answer.map_time + request.load_time)
    _report(answer, request, words_for(arguments.json))
    _write(answer, request.map_name, arguments)
    if arguments.plot:
        _draw(arguments.plot, answer)
    if arguments.drive and answer.path:
        _draw_drive(arguments.drive, answer)
    if checked_map and answer.path:
        claim = write_proof(arguments.certificate, answer, checked_map, gap, seconds)
        print(claim, file=words_for(arguments.json))
    return 0 if answer.path else 1


def _request(arguments: argparse.Namespace) -> LoadedRequest:
    if arguments.replay is None:
        return new_request(arguments)
    written = {"json", "csv", "plot", "drive", "certificate", "gap", "seconds"}
    others = vars(arguments).keys() - {"command", "run", "replay", *written, *MAP_FLAGS}
    if others:
        raise UsageError(f"--replay takes the whole request from its file; leave out {', '.join(sorted(others))}")
    return read_replay(arguments.replay, **map_options(arguments))


def new_request(arguments: argparse.Namespace) -> LoadedRequest:
    """Read the request that the flags of `add_request_arguments` describe."""
    warnings.simplefilter("ignore", DoubtfulYaw)  # which `_pose` says, with the flag
    vehicle, settings = Vehicle(**without_overridden(checked_options(arguments, Vehicle))), Settings(**given_settings(arguments))
    world_map, load_time = read_map(arguments.map, **map_options(arguments))
    start, goal = (_pose(arguments, name, getattr(arguments, name)) for name in ("start", "goal"))
    problem = Problem(world_map, vehicle, start, goal, **checked_options(arguments, Problem))
    return LoadedRequest(arguments.map, problem, settings, load_time, waypoints=_waypoints(arguments))


def _waypoints(arguments: argparse.Namespace) -> tuple[Waypoint, ...]:
    """Return the waypoints as they were given, their yaws in radians."""
    given = getattr(arguments, "via", [])
    if wrong := next((numbers for numbers in given if len(numbers) not in (2, 3)), None):
        raise UsageError(f"--via has {len(wrong)} number{'' if len(wrong) == 1 else 's'}; give X Y or X Y YAW")
    poses = (_pose(arguments, "via", numbers) if len(numbers) == 3 else numbers for numbers in given)
    return tuple(checked_waypoint("--via", pose) for pose in poses)


def _pose(arguments: argparse.Namespace, name: str, numbers: Sequence[float]) -> list[float]:
    """Return a pose as it was given, its yaw in radians; a yaw beyond 2 pi is taken, with a warning."""
    x, y, yaw = numbers
    if "degrees" in arguments:
        return [x, y, math.radians(yaw)]
    if doubt := doubt_about_yaw(yaw):
        print(f"dubins_rrt plan: warning: {flag(name)} has {doubt} --degrees takes degrees", file=sys.stderr)
    return [x, y, yaw]


@contextlib.contextmanager
def _interrupt() -> Iterator[Callable[[], bool]]:
    """Let the first Ctrl-C end the search with the best path so far; the second interrupts the process."""
    interrupted = threading.Event()

    def interrupt(signum: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, before)
        interrupted.set()

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield interrupted.is_set
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _shown(settings: Settings) -> Iterator[Callable[[Progress], None]]:
    """Show on a terminal how many samples are drawn, with the best length and the time limit."""
    limit = f"limit {settings.planning_time:g} s"
    with progress_bar(settings.samples, " samples", limit) as move:
        def show(progress: Progress) -> None:
            best = "searching" if progress.length is None else f"path {progress.length:.2f} m"
            move(progress.samples, f"{best}, {limit}")

        yield show


def _draw(file: str, answer: Plan) -> None:
    """Draw the answer, or the search."""
    if not is_animation(file):
        from dubins_rrt_ros.planning.pictures.drawing import draw_plan  # here, since matplotlib takes longer than most plans
        draw_plan(file, answer)
        return
    if answer.path and answer.waypoints:  # whose search is one of many legs in many headings
        _draw_drive(file, answer)
        return
    recording = _recorded(answer)
    with progress_bar(recording.frames, " frames") as move:
        recording.save(file, answer, lambda done: move(done, ""))


def _draw_drive(file: str, answer: Plan) -> None:
    """Draw the vehicle on its path."""
    from dubins_rrt_ros.planning.pictures.animation import MOST_FRAMES, save_drive
    with progress_bar(MOST_FRAMES, " frames") as move:
        save_drive(file, answer, lambda done: move(done, ""))


def _recorded(answer: Plan) -> "Recording":
    """Return a recording of the search, which is done again up to where it ended: recording takes time, which would change it."""
    from dubins_rrt_ros.planning.pictures.animation import MOST_FRAMES, Recording
    samples = max(1, answer.samples // MOST_FRAMES)
    recording = Recording(samples)
    if answer.work:
        with _shown(answer.settings) as show:
            def follow(progress: Progress) -> None:
                show(progress)
                recording(progress)

            plan(answer.problem, repeating(answer.settings, answer.work), on_progress=follow, report_samples=samples)
    return recording


def _write(answer: Plan, map_name: str, arguments: argparse.Namespace) -> None:
    if arguments.json:
        write_json(arguments.json, answer, map_name)
    if arguments.csv:
        write_csv(arguments.csv, answer)


def _report(answer: Plan, request: LoadedRequest, out: TextIO) -> None:
    if answer.path is None:
        print(f"{int(answer.status)} {answer.status.name}: {answer.message}", file=sys.stderr)
        return
    if answer.start_too_near:
        print("dubins_rrt plan: warning: the start is nearer to an obstacle than allowed; start_slack lets it", file=sys.stderr)
    print(*filter(None, [answer.message, _more_figures(answer), _derived_figures(answer.problem.vehicle)]), file=out)
    if request.path is not None and request.path != answer.path:
        print(f"dubins_rrt plan: the path is not the one of {request.source}, which another version may have planned",
              file=sys.stderr)


def _derived_figures(vehicle: Vehicle) -> str:
    """Return the turning radius, where it was not given itself."""
    if not vehicle.wheelbase:
        return ""
    return f"Turning radius {vehicle.turning_radius:.4g} m, by wheelbase and steering angle."


def _more_figures(answer: Plan) -> str:
    """Return the figures that the message of a path leaves out: it has length, gap, samples and planning time."""
    grid = answer.problem.map
    gap = f", gap {100 * answer.gap:.1f} %" if answer.gap is not None and math.isfinite(answer.gap) else ""
    return (f"Lower bound of the length {answer.lower_bound:.2f} m{gap}, first path after {answer.time_to_first:.3g} s, "
            f"{len(answer.tree)} tree nodes, least clearance {answer.min_clearance:.3g} m, "
            f"seed {answer.settings.seed}." + (f" Cells: {grid.describe_cells()}." if isinstance(grid, GridMap) else ""))
