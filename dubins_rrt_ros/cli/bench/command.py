"""`dubins_rrt bench`: plan a file of problems with many seeds, and compare the runs of several planners."""

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from dubins_rrt_ros.planning import Settings
from dubins_rrt_ros.planning.option import option
from dubins_rrt_ros.planning.settings import SHORTEST

from ..common.cluster import add_jobs_flags
from ..common.flags import LengthSettings, add_option_flags, add_paper_flag, given_settings, largest
from ..common.output import STDOUT, check_drawing, check_folder, finite, words_for, write_document
from ..common.parser import Parser, UsageError, add_json_flag, describe
from ..common.progress import with_bar
from ..demo.process import DemoError
from . import deadlines, latencies
from .formats import write_report
from .problems import Case, chosen, read_cases
from .records import Best, Runs, best_known, grouped, parse_record, read_best_known, read_runs
from .report import summary, to_document, to_markdown
from .runs import BenchRun, measure_all, measure_on_cluster

DEFAULT_TIME = 5.0
MAX_SAMPLES, MAX_TIME = largest(Settings, "samples"), largest(Settings, "planning_time")
#: Arguments of a report, and arguments of either use; all others are for measuring.
_OF_REPORT, _OF_BOTH = {"report", "best_known", "plot", "plot_samples"}, {"command", "run", "out", "json"}


@dataclass(frozen=True)
class _Flags(LengthSettings):
    """The settings that have flags here; those that are no option() are set by the bench in its own way."""

    samples: int = option(MAX_SAMPLES, "maximum number of samples", low=1, high=MAX_SAMPLES)
    planning_time: float = DEFAULT_TIME
    path_spacing: float = 0.0
    seed: int = 0


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="(PROBLEMS.json [--node] --out FILE | --deadlines --out FILE | --report FILE [FILE ...]) [options]",
        description="Plans every problem of a file with several seeds and writes a line of JSON for each run, as soon as it is "
                    "done; or, with --report, compares the runs in such files.",
        notes="Without --samples the time ends a run, with --samples alone the samples do, so that seed and budget determine "
              "the path; with both, whichever is used up first. Where it is interrupted, the lines written by then stay.",
        examples=["dubins_rrt render maze.geojson --out .",
                  'echo \'[{"name": "maze", "map": "maze.yaml", "start": [1.5, 2, 1.57], "goal": [13.5, 10.5, 1.57],\' \\',
                  "    '\"turning_radius\": 1, \"robot_radius\": 0.2}]' > problems.json",
                  "dubins_rrt bench problems.json --samples 1000 --seeds 3 --out ours.jsonl",
                  "dubins_rrt bench problems.json --samples 1000 --seeds 3 --no-informed --label plain --out plain.jsonl",
                  "dubins_rrt bench --report ours.jsonl plain.jsonl --plot report.png"],
        exit_status="0 all runs solved or a report, 1 some run unsolved, 2 wrong usage, 130 interrupted")
    parser.argument_default = argparse.SUPPRESS
    parser.add_argument("--out", metavar="FILE", help="where to write: the lines of JSON; with --report the report, as "
                                                      "Markdown, or as CSV or LaTeX where the name ends with .csv or .tex; "
                                                      "default of a report: Markdown to standard output")
    add_json_flag(parser, "what the runs amount to")
    _add_measuring(parser.add_argument_group("measuring"))
    add_option_flags(parser, "settings", _Flags)
    add_paper_flag(parser)
    _add_report(parser.add_argument_group("report"))


def _add_measuring(group: argparse._ArgumentGroup) -> None:
    group.add_argument("file", metavar="PROBLEMS.json", nargs="?",
                       help="a list of {name, map (relative to the file), start, goal, turning_radius, robot_radius}, with any "
                            "other option of vehicle, request or settings, and notes whose keys begin with _")
    group.add_argument("--problems", metavar="NAME[,NAME]", help="names of the problems to plan; default: all")
    group.add_argument("--seeds", metavar="N", type=int, help="number of seeds per problem, from 0 to N-1; default 1")
    group.add_argument("--time", metavar="s", type=float,
                       help=f"time limit of a run [s]; default {DEFAULT_TIME:g}, or none if --samples is given")
    add_jobs_flags(group.add_mutually_exclusive_group(),
                   "number of processes; default 1, since processes that share cores distort each other's timings")
    others = group.add_mutually_exclusive_group()
    others.add_argument("--node", action="store_true",
                        help="measure the node in place of the library, over real topics: goal to first path, get_plan, a start "
                             f"that moved, maps that change, and what it takes when idle; --seeds N requests each, default "
                             f"{latencies.REQUESTS}")
    others.add_argument("--deadlines", action="store_true",
                        help="measure in place of PROBLEMS.json by how much answers exceed planning times of 0.05 to 1 s: a "
                             "disc, a star of 100 corners and a truck in the maze, in halls and among blocks, with goals that "
                             "can be reached and goals that cannot; --seeds N requests each, default "
                             f"{deadlines.REQUESTS}")
    group.add_argument("--label", metavar="NAME", help="name of these runs in a report; default: the planner")


def _add_report(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--report", metavar="FILE", nargs="+", help="compare the runs in these files instead of measuring")
    group.add_argument("--best-known", metavar="FILE",
                       help="file of the shortest known lengths, {problem: m}; default: the best of the runs")
    group.add_argument("--plot", metavar="FILE", help="draw cost over time; .png, .svg or .pdf")
    group.add_argument("--plot-samples", metavar="FILE",
                       help="draw time per sample over the size of the tree, a point for each label; .png, .svg or .pdf")


def run(arguments: argparse.Namespace) -> int:
    """Measure or report, and return the exit status."""
    given = vars(arguments)
    if "report" in given and (measuring := given.keys() - _OF_BOTH - _OF_REPORT):
        raise UsageError(f"--report compares runs that are done and measures none; leave out {_flags(measuring)}")
    if "report" not in given and (reporting := given.keys() & _OF_REPORT):
        raise UsageError(f"{_flags(reporting)} goes with --report alone; leave it out to measure")
    _check_outputs(given)
    return _report(given) if "report" in given else _measure(arguments)


def _check_outputs(given: dict[str, Any]) -> None:
    """Refuse files that cannot be written, or that would be overwritten before they are read."""
    out, plots = given.get("out"), [given.get("plot"), given.get("plot_samples")]
    check_folder(out, *plots, given["json"])
    for plot in plots:
        check_drawing(plot)
    sources = given.get("report", [given["file"]] if "file" in given else [])
    if out and os.path.realpath(out) in map(os.path.realpath, sources):
        raise UsageError(f"--out {out} would overwrite what is read; name another file")


def _flags(names: Iterable[str]) -> str:
    return ", ".join(sorted("PROBLEMS.json" if name == "file" else "--" + name.replace("_", "-") for name in names))


def _measure(arguments: argparse.Namespace) -> int:
    if "scheduler" in arguments and ("deadlines" in arguments or "node" in arguments):
        raise UsageError("--deadlines and --node measure this machine; leave --scheduler out")
    if getattr(arguments, "deadlines", False):
        return _measure_deadlines(arguments)
    if getattr(arguments, "node", False):
        return _measure_node(arguments)
    planned, jobs = _planned_runs(arguments), _count(arguments, "jobs")
    measured = measure_on_cluster(planned, arguments.scheduler) if "scheduler" in arguments else measure_all(planned, jobs)
    lines = _written(arguments.out, measured, len(planned))
    runs = grouped(map(parse_record, lines))
    _write_json(arguments.json, runs, best_known(runs, {}))
    print(summary(runs), file=words_for(arguments.json))
    return 0 if all(line["solved"] for line in lines) else 1


def _measure_deadlines(arguments: argparse.Namespace) -> int:
    """Time the answers to requests on maps of its own, and print by how much they exceed the planning time."""
    if "out" not in arguments or "file" in arguments:
        raise UsageError("--deadlines has problems of its own, so leave PROBLEMS.json out; --out must be given")
    count = _count(arguments, "seeds", default=deadlines.REQUESTS)
    asked = deadlines.requests(count, _settings(arguments, {"samples": Settings.samples}))
    lines = _written(arguments.out, deadlines.measure(asked), deadlines.number_of_requests(count))
    if arguments.json:
        write_document(arguments.json, {"overruns": lines})
    print(deadlines.overruns(lines), file=words_for(arguments.json))
    return 0


def _measure_node(arguments: argparse.Namespace) -> int:
    """Time the answers of the node, and print how soon they come."""
    cases, count = _cases(arguments), _count(arguments, "seeds", default=latencies.REQUESTS)
    settings = Settings(**SHORTEST | given_settings(arguments, _Flags))
    if "time" in arguments:
        settings = replace(settings, planning_time=arguments.time)
    try:
        lines = _written(arguments.out, latencies.measure(cases, settings, count), latencies.number_of_lines(cases, count))
    except DemoError as error:
        print(f"dubins_rrt bench: error: {error}", file=sys.stderr)
        return 1
    if arguments.json:
        write_document(arguments.json, {"latencies": lines})
    print(latencies.latencies(lines), file=words_for(arguments.json))
    return 0


def _written(file: str, measured: Generator[dict[str, Any], None, None], count: int) -> list[dict[str, Any]]:
    """Write lines of JSON as they come, and return them. Until there is one the file stays as it was, or away."""
    lines: list[dict[str, Any]] = []
    is_new = not os.path.lexists(file)
    try:
        with open(file, "a", encoding="utf-8") as out, contextlib.closing(measured):
            for line in with_bar(measured, count, " requests"):
                if not lines and os.path.isfile(file):
                    out.truncate(0)
                out.write(json.dumps(line, allow_nan=False) + "\n")
                out.flush()
                lines.append(line)
    finally:
        if is_new and not lines:
            os.remove(file)
    return lines


def _planned_runs(arguments: argparse.Namespace) -> list[BenchRun]:
    """List the runs, those of a problem after each other."""
    return [run for case in _cases(arguments) for run in _runs_of(case, arguments)]


def _cases(arguments: argparse.Namespace) -> list[Case]:
    """Read the problems that are asked for."""
    missing = [name for name, key in (("PROBLEMS.json", "file"), ("--out", "out")) if key not in arguments]
    if missing:
        raise UsageError(f"{' and '.join(missing)} must be given, to measure; or --report, to compare")
    cases = read_cases(arguments.file)
    return chosen(cases, arguments.problems.split(",")) if "problems" in arguments else cases


def _runs_of(case: Case, arguments: argparse.Namespace) -> Iterator[BenchRun]:
    """Yield the runs of a problem, from its own seed on, or from 0."""
    settings, seeds = _settings(arguments, dict(case.settings)), _count(arguments, "seeds")
    first = max(settings.seed, 0)
    label = getattr(arguments, "label", settings.planner)
    return (BenchRun(case, replace(settings, seed=seed), label) for seed in range(first, first + seeds))


def _settings(arguments: argparse.Namespace, of_problem: Mapping[str, Any]) -> Settings:
    """Return the settings of a problem's runs: flags come before what its file gives, and that before the defaults."""
    given = dict(of_problem) | given_settings(arguments, _Flags)
    if "time" in arguments:
        given["planning_time"] = arguments.time
    default_time = MAX_TIME if "samples" in given else DEFAULT_TIME
    return Settings(**{"samples": MAX_SAMPLES, "planning_time": default_time, **SHORTEST, **given})


def _count(arguments: argparse.Namespace, name: str, default: int = 1) -> int:
    count = getattr(arguments, name, default)
    if count < 1:
        raise UsageError(f"--{name} is {count}; give 1 or more")
    return count


def _report(given: dict[str, Any]) -> int:
    runs = read_runs(given["report"])
    best = best_known(runs, read_best_known(given["best_known"]) if "best_known" in given else {})
    if "plot" in given:
        from .plots import draw_runs  # here, since matplotlib is slow to import
        draw_runs(given["plot"], runs, best)
    if "plot_samples" in given:
        from .plots import draw_sample_costs
        draw_sample_costs(given["plot_samples"], runs)
    _write_json(given["json"], runs, best)
    if given.get("out", STDOUT) == STDOUT:
        print(to_markdown(runs, best), end="", file=words_for(given["json"]))
    else:
        write_report(given["out"], runs, best)
    return 0


def _write_json(file: str | None, runs: Runs, best: Mapping[str, Best]) -> None:
    if file:
        write_document(file, finite(to_document(runs, best)))
