"""`dubins_rrt campaign`: plan random problems, and report every answer that the audit or a second plan proves wrong."""

import argparse
import contextlib
import json
import time
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from dubins_rrt_ros import __version__
from dubins_rrt_ros.cli.common.cluster import add_jobs_flags, connected, place
from dubins_rrt_ros.cli.common.output import check_folder, words_for, write_document
from dubins_rrt_ros.cli.common.parser import Parser, UsageError, add_json_flag, describe
from dubins_rrt_ros.cli.common.progress import with_bar

from ..processes import run_in_processes
from .judge import TrialNumber, judge

#: Time after which a problem is taken to hang [s]: it is planned at most twice, for a minute each.
LIMIT = 300.0
#: Columns of the table, and the statuses that each counts.
_COLUMNS = {"path": ("NONE",), "no path": ("NO_VALID_PATH",), "occupied": ("START_OCCUPIED", "GOAL_OCCUPIED"),
            "outside": ("START_OUTSIDE_MAP", "GOAL_OUTSIDE_MAP"), "time limit": ("TIMEOUT",)}
#: Additions to a row's name by what is known of the vehicle.
_KNOWN = {True: ", passes", False: ", does not pass", None: ""}


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="[options]",
        description="Plans random problems - grids of many resolutions, polygons, mazes, gaps that just pass and that just fail, "
                    "starts and goals that touch obstacles, discs and polygons as vehicles, all planners and samplers - and "
                    "judges each answer by the audit: the path, all edges of the tree, and what the status claims.",
        notes="A number and a seed always give the same problem. Each disagreement is reported with the command that repeats it. "
              "Where it is interrupted, what was done by then is reported.",
        examples=["dubins_rrt campaign --problems 20", "dubins_rrt campaign --problems 10000 --seed 5 --jobs 2 --json -"],
        exit_status="0 all is right, 1 something is not, 2 wrong usage, 130 interrupted")
    parser.add_argument("--problems", metavar="N", type=int, default=1000, help="number of problems; default 1000")
    parser.add_argument("--seed", metavar="S", type=int, default=0, help="seed of the problems; default 0")
    parser.add_argument("--first", metavar="K", type=int, default=0, help="number of the first problem; default 0")
    add_jobs_flags(parser.add_mutually_exclusive_group(),
                   f"number of processes; with more than one, crashes and problems that take over {LIMIT:g} s are reported too; "
                   "default 1, this process")
    parser.add_argument("--out", metavar="FILE", help="write a line of JSON for each problem")
    add_json_flag(parser, "the counts, and all disagreements,")


def run(arguments: argparse.Namespace) -> int:
    """Plan and judge, report, and return the exit status."""
    for name, least in (("problems", 1), ("seed", 0), ("first", 0), ("jobs", 1)):
        given = getattr(arguments, name)
        if given is not None and given < least:
            raise UsageError(f"--{name} is {given}; give {least} or more")
    check_folder(arguments.out, arguments.json)
    tasks = [TrialNumber(arguments.seed, arguments.first + i) for i in range(arguments.problems)]
    lines: list[dict[str, Any]] = []
    begin = time.perf_counter()
    try:
        with contextlib.closing(_judged(tasks, arguments.jobs or 1, arguments.scheduler)) as judged:
            lines.extend(_written(judged, len(tasks), arguments.out))
    except KeyboardInterrupt:
        _report(_counts(lines, arguments.seed, time.perf_counter() - begin), arguments.json)
        raise
    _report(_counts(lines, arguments.seed, time.perf_counter() - begin), arguments.json)
    return 1 if any(line["findings"] for line in lines) else 0


def _judged(tasks: list[TrialNumber], jobs: int, scheduler: str | None) -> Generator[dict[str, Any], None, None]:
    """Yield the line of each task, in any order, by processes of this machine or by the workers of a cluster."""
    if scheduler is None:
        yield from map(judge, tasks) if jobs == 1 else run_in_processes(judge, tasks, jobs, LIMIT, _lost)
        return
    with connected(scheduler) as cluster:
        yield from cluster.run(_judge_on_host, ((task,) for task in tasks), lambda call, what: _lost(call[0], what))


def _judge_on_host(task: TrialNumber) -> dict[str, Any]:
    return judge(task) | place()


def _written(running: Iterable[dict[str, Any]], count: int, file: str | None) -> Iterator[dict[str, Any]]:
    """Yield the lines, each written to the file as soon as it is there."""
    with contextlib.ExitStack() as stack:
        out = stack.enter_context(Path(file).open("w", encoding="utf-8")) if file else None
        for line in with_bar(running, count, " problems"):
            if out:
                out.write(json.dumps(line) + "\n")
                out.flush()
            yield line


def _lost(task: TrialNumber, what: str) -> dict[str, Any]:
    """Return the line of a problem without an answer."""
    return {"seed": task.seed, "number": task.number, "kind": "lost", "status": "", "edges": 0, "curves": 0, "paths": 0,
            "seconds": LIMIT, "findings": [what]}


def _report(counts: dict[str, Any], json_file: str | None) -> None:
    if json_file:
        write_document(json_file, counts)
    print(_summary(counts), file=words_for(json_file))


def _counts(lines: list[dict[str, Any]], seed: int, seconds: float) -> dict[str, Any]:
    """Count how the problems of each kind ended, and list each disagreement with the command that repeats it."""
    labels = [line["kind"] + _KNOWN[line.get("fits")] for line in lines]
    kinds = {label: dict(Counter(line["status"] for line, its in zip(lines, labels, strict=True) if its == label))
             for label in sorted(set(labels))}
    wrong = sorted((line for line in lines if line["findings"]), key=lambda line: line["number"])
    disagreements = [{name: line[name] for name in ("number", "kind", "findings")} | {"repeat": _repeat(line)} for line in wrong]
    return {"problems": len(lines), "seed": seed, "seconds": seconds,
            **{name: sum(line[name] for line in lines) for name in ("paths", "edges", "curves")},
            "kinds": kinds, "disagreements": disagreements, "version": __version__}


def _repeat(line: dict[str, Any]) -> str:
    """Return the command that repeats a problem."""
    return f"dubins_rrt campaign --seed {line['seed']} --first {line['number']} --problems 1"


def _summary(counts: dict[str, Any]) -> str:
    """Write the counts in words."""
    problems, wrong = counts["problems"], counts["disagreements"]
    parts = [*_table(counts["kinds"]),
             f"{problems} problem{'s' * (problems != 1)} of seed {counts['seed']} in {counts['seconds']:.0f} s: "
             f"{counts['paths']} paths, {counts['edges']} edges of trees and {counts['curves']} other curves judged; "
             f"{len(wrong)} disagreement{'s' * (len(wrong) != 1)}"]
    for each in wrong:
        parts += [f"problem {each['number']}, {each['kind']}; repeat it with `{each['repeat']}`:",
                  *(f"  {finding}" for finding in each["findings"])]
    return "\n".join(parts)


def _table(kinds: Mapping[str, Mapping[str, int]]) -> Iterator[str]:
    """Yield the rows of the table: how many problems of each kind ended how."""
    yield _row("", "problems", *_COLUMNS, "other")
    for kind, ends in {**kinds, "all": sum(map(Counter, kinds.values()), Counter())}.items():
        counts = [sum(ends.get(name, 0) for name in names) for names in _COLUMNS.values()]
        yield _row(kind, sum(ends.values()), *counts, sum(ends.values()) - sum(counts))


def _row(first: str, *others: Any) -> str:
    return f"{first:<20}" + "".join(f"{other:>11}" for other in others)
