"""`dubins_rrt paper`: run the paper's experiments again with many seeds, and answer its open question in a report."""

import argparse
import contextlib
import json
import os
import time
from collections.abc import Generator
from pathlib import Path

from dubins_rrt_ros.cli.common.cluster import add_jobs_flags
from dubins_rrt_ros.cli.common.extras import require_matplotlib
from dubins_rrt_ros.cli.common.output import check_folder, finite, words_for, write_document
from dubins_rrt_ros.cli.common.parser import Parser, UsageError, add_json_flag, describe
from dubins_rrt_ros.cli.common.progress import with_bar

from .runs import Measured, Outcome, PaperRun, RunOutcome, all_runs, outcomes, outcomes_on_cluster

SEEDS = 30
REPORT, LINES = "report.md", "runs.jsonl"


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="[options]",
        description="Runs what the paper ran - RRT and RRT* in block, maze and forest, and its table of the maze - over many "
                    "seeds, and answers its open question: what if steps have no limit, and headings point towards the goal? "
                    f"Writes {REPORT} with tables and figures (.png and .svg), and {LINES}, a line of JSON for each run.",
        notes="Samples end the runs, not the time, so that the same seeds give the same lengths. The first example takes some "
              "seconds; then open quick/report.md.",
        examples=["dubins_rrt paper --seeds 2 --out quick", "dubins_rrt paper --json answer.json"],
        exit_status="0 done, 2 wrong usage, 130 interrupted")
    parser.add_argument("--out", metavar="DIR", default="paper_results", help="folder to write to; default paper_results")
    parser.add_argument("--seeds", metavar="N", type=int, default=SEEDS, help=f"number of seeds, from 0 to N-1; default {SEEDS}")
    add_jobs_flags(parser.add_mutually_exclusive_group(), "number of processes; default: the number of cores")
    add_json_flag(parser, "the report's tables and its answer")


def run(arguments: argparse.Namespace) -> int:
    """Measure, draw, write the report, and return the exit status."""
    for name in ("seeds", "jobs"):
        given = getattr(arguments, name)
        if given is not None and given < 1:
            raise UsageError(f"--{name} is {given}; give 1 or more")
    arguments.jobs = arguments.jobs or os.cpu_count() or 1
    check_folder(arguments.json)
    require_matplotlib("evaluation")
    folder, begin = Path(arguments.out), time.perf_counter()
    folder.mkdir(parents=True, exist_ok=True)
    runs = all_runs(arguments.seeds)
    running = outcomes(runs, arguments.jobs) if arguments.scheduler is None else outcomes_on_cluster(runs, arguments.scheduler)
    measured = Measured(_written(folder / LINES, running, len(runs)), arguments.seeds)
    _report(folder, measured, arguments, begin)
    return 0


def _written(file: Path, running: Generator[Outcome, None, None], count: int) -> dict[PaperRun, RunOutcome]:
    """Make all runs, each written to the file as soon as it is done; return their outcomes."""
    done: dict[PaperRun, RunOutcome] = {}
    with file.open("w", 1, encoding="utf-8") as out, contextlib.closing(running):
        for run, outcome, where in with_bar(running, count, " runs"):
            done[run] = outcome.without_times() if where else outcome
            out.write(json.dumps(run._asdict() | finite(outcome._asdict()) | where, allow_nan=False) + "\n")
    return done


def _report(folder: Path, measured: Measured, arguments: argparse.Namespace, begin: float) -> None:
    """Draw the figures and write the report of a measurement that began at `begin`."""
    from .figures import drawn_figures, figure_count  # here, since matplotlib is slow to import
    from .report import headline, to_document, to_markdown
    for _ in with_bar(drawn_figures(folder, measured), figure_count(), " figures"):
        pass
    seconds = time.perf_counter() - begin
    jobs = None if arguments.scheduler else arguments.jobs
    (folder / REPORT).write_text(to_markdown(measured, jobs, seconds), encoding="utf-8")
    if arguments.json:
        write_document(arguments.json, finite({"report": str(folder / REPORT), "seconds": seconds, **to_document(measured)}))
    print(f"{headline(measured)}\n{folder / REPORT}: {len(measured.outcomes)} runs in {seconds:.0f} s",
          file=words_for(arguments.json))
