"""`dubins_rrt campaign`: random problems that try to prove the planner wrong."""

import argparse
import contextlib
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tqdm import tqdm

from .campaign_judge import Task, judged
from .campaign_runs import results
from .flags import UsageError
from .output import check_folder

#: A problem that takes longer hangs [s]: it is planned twice at most, for a minute each.
LIMIT = 300.0
#: How an answer without a path ends, in the table.
_COLUMNS = {"path": ("NONE",), "no path": ("NO_VALID_PATH",), "occupied": ("START_OCCUPIED", "GOAL_OCCUPIED"),
            "outside": ("START_OUTSIDE_MAP", "GOAL_OUTSIDE_MAP"), "time limit": ("TIMEOUT",)}
#: What is known of the vehicle, in the table.
_KNOWN = {True: ", passes", False: ", does not pass", None: ""}


def add_to(subparsers: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "campaign", help="try to prove the planner wrong with random problems",
        description="Plans random problems - grids of many resolutions, polygons, mazes, gaps that just pass and that just fail, "
                    "starts and goals that touch obstacles, discs and polygons as vehicles, all planners and samplers - and "
                    "judges each answer by the audit: the path, all edges of the tree, and what the status claims.",
        epilog="A number and a seed always give the same problem. Whatever is wrong is told with the command that repeats it. "
               "Example: `dubins_rrt campaign --problems 10000 --seed 5 --jobs 2 --out campaign.jsonl`. Exit status: 0 all is "
               "right, 1 something is not, 2 wrong usage, 130 interrupted; what was done by then is reported.")
    parser.add_argument("--problems", metavar="N", type=int, default=1000, help="how many; default 1000")
    parser.add_argument("--seed", metavar="S", type=int, default=0, help="of the problems; default 0")
    parser.add_argument("--first", metavar="K", type=int, default=0, help="the number of the first problem; default 0")
    parser.add_argument("--jobs", metavar="J", type=int, default=1,
                        help=f"work in J processes, where crashes and problems that take more than {LIMIT:g} s are told too; "
                             "default 1, this process")
    parser.add_argument("--out", metavar="FILE", help="write a line of JSON for each problem")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Plan and judge, report, and return the exit status."""
    for name, least in (("problems", 1), ("seed", 0), ("first", 0), ("jobs", 1)):
        if getattr(arguments, name) < least:
            raise UsageError(f"--{name} is {getattr(arguments, name)}; give {least} or more")
    check_folder(arguments.out)
    tasks = [Task(arguments.seed, arguments.first + i) for i in range(arguments.problems)]
    lines, begin = [], time.perf_counter()
    try:
        lines.extend(_lines(tasks, arguments.jobs, arguments.out))
    except KeyboardInterrupt:
        print(_report(lines, arguments.seed, time.perf_counter() - begin))
        raise
    print(_report(lines, arguments.seed, time.perf_counter() - begin))
    return 1 if any(line["findings"] for line in lines) else 0


def _lines(tasks: list[Task], jobs: int, file: str | None) -> Iterator[dict[str, Any]]:
    """The lines of all tasks, each written to the file as soon as it is there."""
    running = map(judged, tasks) if jobs == 1 else results(judged, tasks, jobs, LIMIT, _lost)
    with contextlib.ExitStack() as stack:
        out = stack.enter_context(Path(file).open("w", encoding="utf-8")) if file else None
        for line in tqdm(running, total=len(tasks), unit=" problems", file=sys.stderr, disable=None, leave=False):
            if out:
                out.write(json.dumps(line) + "\n")
                out.flush()
            yield line


def _lost(task: Task, what: str) -> dict[str, Any]:
    """The line of a problem that no answer came to."""
    return {"seed": task.seed, "number": task.number, "kind": "lost", "status": "", "edges": 0, "curves": 0, "paths": 0,
            "seconds": LIMIT, "findings": [what]}


def _report(lines: list[dict[str, Any]], seed: int, seconds: float) -> str:
    """The counts, and each disagreement with the command that repeats it."""
    wrong = sorted((line for line in lines if line["findings"]), key=lambda line: line["number"])
    edges, paths, curves = (sum(line[name] for line in lines) for name in ("edges", "paths", "curves"))
    parts = [*_table(lines), f"{len(lines)} problem{'s' * (len(lines) != 1)} of seed {seed} in {seconds:.0f} s: {paths} paths, "
                             f"{edges} edges of trees and {curves} other curves judged; "
                             f"{len(wrong)} disagreement{'s' * (len(wrong) != 1)}"]
    for line in wrong:
        repeat = f"dubins_rrt campaign --seed {line['seed']} --first {line['number']} --problems 1"
        parts += [f"problem {line['number']}, {line['kind']}; repeat it with `{repeat}`:",
                  *(f"  {finding}" for finding in line["findings"])]
    return "\n".join(parts)


def _table(lines: list[dict[str, Any]]) -> Iterator[str]:
    """How many problems of each kind ended how."""
    yield _row("", "problems", *_COLUMNS, "other")
    labels = [line["kind"] + _KNOWN[line.get("fits")] for line in lines]
    groups = {label: [line for line, its in zip(lines, labels, strict=True) if its == label] for label in sorted(set(labels))}
    for kind, some in (groups | {"all": lines}).items():
        ends = Counter(line["status"] for line in some)
        counts = [sum(ends[name] for name in names) for names in _COLUMNS.values()]
        yield _row(kind, len(some), *counts, len(some) - sum(counts))


def _row(first: str, *others: Any) -> str:
    return f"{first:<20}" + "".join(f"{other:>11}" for other in others)
