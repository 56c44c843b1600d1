"""`dubins_rrt families`: plan problems that are solvable by construction, and count how many are solved, and how soon."""

import argparse
import contextlib
import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from dubins_rrt_ros.cli.common.output import check_folder
from dubins_rrt_ros.cli.common.parser import Parser, UsageError, describe
from dubins_rrt_ros.cli.common.progress import with_bar
from dubins_rrt_ros.planning import Settings, plan

from .problems import FAMILIES, constructed
from .ways import measured
from .ways import report as ways_report

#: Name of the family of buildings with several ways round, which is measured otherwise than the others.
WAYS = "ways"

#: Lower limits of the bands of room to spare that are counted apart [m].
BANDS = 0.001, 0.005, 0.01
#: Length beyond that of the constructed path, relative to it, that counts as too long.
TOO_LONG = 0.01


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="[options]",
        description="Plans problems around random Dubins paths - tunnels carved around them, clutter and tubes of polygons that "
                    "leave the vehicle a millimetre to ten centimetres - and reports for each family and room to spare how many "
                    "are solved, how soon, and how many paths are longer than the constructed one. The family ways, which takes "
                    "long, is of buildings with several ways round, and how much longer paths are than the best that is known.",
        notes="A family, a number and a seed always give the same problem.",
        examples=["dubins_rrt families --problems 5 --families tunnel --time 0.2"],
        exit_status="0 all are solved, 1 some are not, 2 wrong usage, 130 interrupted")
    parser.add_argument("--families", metavar="NAME[,NAME]",
                        help=f"only these; default all but {WAYS}: {', '.join((*FAMILIES, WAYS))}")
    parser.add_argument("--problems", metavar="N", type=int, default=200, help="number of problems of each family; default 200")
    parser.add_argument("--seed", metavar="S", type=int, default=0, help="seed of the problems and of the search; default 0")
    parser.add_argument("--time", metavar="s", type=float, default=1.0, help="time limit of a problem [s]; default 1")
    parser.add_argument("--out", metavar="FILE", help="write a line of JSON for each problem")


def run(arguments: argparse.Namespace) -> int:
    """Plan, report, and return the exit status."""
    if arguments.problems < 1:
        raise UsageError(f"--problems is {arguments.problems}; give 1 or more")
    check_folder(arguments.out)
    names = arguments.families.split(",") if arguments.families else list(FAMILIES)
    for name in names:
        if name not in (*FAMILIES, WAYS):
            raise UsageError(f"there is no family {name!r}; there are {', '.join((*FAMILIES, WAYS))}")
    settings = Settings(planning_time=arguments.time, seed=arguments.seed, preferred_clearance=0.0)
    tasks = [(name, number) for name in names for number in range(arguments.problems)]
    planned = with_bar((_line(name, number, settings) for name, number in tasks), len(tasks), " problems")
    lines = list(_written(planned, arguments.out))
    ways = [line for line in lines if line["family"] == WAYS]
    others = [line for line in lines if line["family"] != WAYS]
    print("\n".join([*(_report(names, others) if others else ()), *(ways_report(ways) if ways else ())]))
    return 0 if all(line["solved"] for line in others) else 1


def _line(family: str, number: int, settings: Settings) -> dict[str, Any]:
    """Plan a problem; return what there is to say of it."""
    if family == WAYS:
        return measured(number, settings)
    problem = constructed(family, settings.seed, number)
    answer = plan(problem.problem, settings)
    longer = answer.length / problem.length - 1 if answer.length is not None else None
    return {"family": family, "number": number, "seed": settings.seed, "spare": problem.spare, "solved": answer.solved,
            "error_name": answer.status.name, "time_to_first": answer.time_to_first, "longer": longer}


def _written(lines: Iterable[dict[str, Any]], file: str | None) -> Iterator[dict[str, Any]]:
    """Yield the lines, each written to the file as soon as it is there."""
    with contextlib.ExitStack() as stack:
        out = stack.enter_context(Path(file).open("w", encoding="utf-8")) if file else None
        for line in lines:
            if out:
                out.write(json.dumps(line) + "\n")
                out.flush()
            yield line


def _report(names: Iterable[str], lines: list[dict[str, Any]]) -> Iterator[str]:
    """Yield the rows of a table: one for each family and band of room to spare."""
    yield f"{'family':<20}{'spare [mm]':>14}{'solved':>10}{'first path [ms], median':>26}{'90 %':>8}{'too long':>10}"
    for name in names:
        for low, high in zip(BANDS, (*BANDS[1:], math.inf), strict=True):
            band = [line for line in lines if line["family"] == name and low <= line["spare"] < high]
            if band:
                yield _row(name, f"{1e3 * low:g} to {1e3 * high:g}" if high < math.inf else f"from {1e3 * low:g}", band)


def _row(name: str, spare: str, lines: list[dict[str, Any]]) -> str:
    times = [1e3 * line["time_to_first"] for line in lines if line["solved"]]
    middle = f"{median(times):.1f}" if times else "-"
    late = f"{quantiles(times, n=10)[-1]:.0f}" if len(times) > 1 else middle
    too_long = sum(line["longer"] > TOO_LONG for line in lines if line["solved"])
    return f"{name:<20}{spare:>14}{len(times):>6}/{len(lines):<3}{middle:>26}{late:>8}{too_long:>10}"
