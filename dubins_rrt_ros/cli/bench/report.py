"""The report of `dubins_rrt bench`: statistics of runs, as tables of text and as a document for JSON.

Medians and quartiles are the smallest value that at least this share of the runs does not exceed: each is a measured value.
Runs without a path that passed its check count as infinite.
"""

import math
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from .records import Best, RunRecord, Runs

#: Times at which costs are compared [s], and excesses over the best known cost whose times are.
MARKS, EXCESSES = (0.05, 0.1, 0.3, 1.0, 5.0), (0.05, 0.02, 0.01)

TITLE = "Planners compared"
EXPLANATION = """\
Lengths are in metres; times count from the request on, with the map prepared. Each figure is the lower median over all runs of a
planner, in brackets the quartiles: values that were measured. A run is solved where its path passed its check; the others count
as infinite. A dash is an infinite figure, one at a mark that the runs were cut short before, or a time on a cluster.
"""


def quantile(values: Iterable[float], share: float) -> float:
    """Return the smallest value that at least this share of the values does not exceed."""
    ordered = sorted(values)
    return ordered[max(math.ceil(share * len(ordered)) - 1, 0)]


def quartiles(values: Iterable[float]) -> dict[str, float]:
    """Return the median and the quartiles by name."""
    ordered = sorted(values)
    names = {"lower_quartile": 0.25, "median": 0.5, "upper_quartile": 0.75}
    return {name: quantile(ordered, share) for name, share in names.items()}


def median(values: Iterable[float]) -> float:
    """Return the lower median."""
    return quantile(values, 0.5)


def marks_of(runs: Runs) -> list[float]:
    """Return the marks within the time of the longest run [s], and the first in any case."""
    longest = max(run.total for planners in runs.values() for group in planners.values() for run in group)
    return [mark for mark in MARKS if mark <= max(longest, MARKS[0])]


def ratio(cost: float, best: Best) -> float:
    """Divide a cost by the best known one; infinite without a path."""
    if math.isinf(cost):
        return math.inf
    return cost / best.cost if best.cost > 0 else 1.0  # a start that is the goal: all lengths are 0


def summary(runs: Runs) -> str:
    """Write a line for each problem: number of solved runs, and medians; and why a run is not solved, for each error once."""
    return "\n".join(line for problem, planners in runs.items() for group in planners.values()
                     for line in (_summary_line(problem, group), *_reasons(group)))


def _summary_line(problem: str, group: list[RunRecord]) -> str:
    return (f"{problem}: {sum(run.solved for run in group)}/{len(group)} solved, "
            f"first path {milliseconds(median(run.first[0] for run in group))} ms, {metres(median(run.cost for run in group))} m")


def _reasons(group: list[RunRecord]) -> list[str]:
    """Return a line for each error among the runs, with the sentence of the first that has it."""
    first = {run.reason.partition(":")[0]: run.reason for run in reversed(group) if run.reason}
    return [f"  {reason}" for reason in reversed(first.values())]


class Section(NamedTuple):
    """A section of the report: a text, and a table whose first column has names."""

    title: str
    text: str
    head: list[str]
    rows: list[list[str]]


def sections(runs: Runs, best: Mapping[str, Best]) -> Iterator[Section]:
    """Yield the sections of the report: all problems in one table, then a table for each."""
    marks = marks_of(runs)
    yield _overview(runs, best, marks)
    for problem, planners in runs.items():
        known = f"Best known: {metres(best[problem].cost, 4)} m, {best[problem].source}."
        yield Section(problem, known, *_problem_table(planners, best[problem], marks))


def to_markdown(runs: Runs, best: Mapping[str, Best]) -> str:
    """Write the report in Markdown."""
    parts = [f"# {TITLE}", EXPLANATION.strip()]
    for section in sections(runs, best):
        parts += [f"## {section.title}", section.text, table(section.head, section.rows)]
    return "\n\n".join(parts) + "\n"


def to_document(runs: Runs, best: Mapping[str, Best]) -> dict[str, Any]:
    """Return the figures of the report for JSON, infinite ones included; times in seconds, lengths in metres."""
    marks = marks_of(runs)
    names = dict.fromkeys(planner for planners in runs.values() for planner in planners)
    results = [{"problem": problem, "planner": planner, "best_known": best[problem].cost, **_figures(group, best[problem], marks)}
               for problem, planners in runs.items() for planner, group in planners.items()]
    return {"planners": [{"planner": name} | _overall(name, runs, best, marks) for name in names], "results": results}


def _figures(group: list[RunRecord], best: Best, marks: list[float]) -> dict[str, Any]:
    """Return the figures of a planner's runs on a problem."""
    return {"runs": len(group), "solved": sum(run.solved for run in group),
            "time_to_first": quartiles(run.first[0] for run in group), "first_cost": quartiles(run.first[1] for run in group),
            "final_cost": quartiles(run.cost for run in group), "final_cost_of_solved": _moments(run.cost for run in group),
            "cost_at": {f"{mark:g}": quartiles(run.cost_at(mark) for run in group) for mark in marks},
            "time_to_within": {f"{share:g}": median(run.time_to((1 + share) * best.cost) for run in group) for share in EXCESSES}}


def _moments(values: Iterable[float]) -> dict[str, float]:
    """Return the mean of the finite values and their standard deviation, each infinite where there are too few for it."""
    solved = [value for value in values if math.isfinite(value)]
    return {"mean": statistics.fmean(solved) if solved else math.inf,
            "standard_deviation": statistics.stdev(solved) if len(solved) > 1 else math.inf}


def _overall(planner: str, runs: Runs, best: Mapping[str, Best], marks: list[float]) -> dict[str, Any]:
    """Return the figures of a planner's runs on all problems: means of medians, and the number of problems in each."""
    groups = {problem: planners[planner] for problem, planners in runs.items() if planner in planners}
    everything = [run for group in groups.values() for run in group]
    ratios = {mark: [ratio(median(run.cost_at(mark) for run in group), best[problem]) for problem, group in groups.items()]
              for mark in marks}
    return {"runs": len(everything), "solved": sum(run.solved for run in everything), "problems": len(runs),
            "problems_solved": sum(math.isfinite(median(run.cost for run in group)) for group in groups.values()),
            "time_to_first": _mean(median(run.first[0] for run in group) for group in groups.values()),
            "cost_over_best_known": {f"{mark:g}": _mean(values) for mark, values in ratios.items()}}


def _mean(values: Iterable[float]) -> dict[str, float]:
    """Return the geometric mean of the finite values, and their number."""
    finite = [value for value in values if math.isfinite(value)]
    mean = math.prod(value ** (1 / len(finite)) for value in finite) if finite else math.inf
    return {"geometric_mean": mean, "problems": len(finite)}


def _overview(runs: Runs, best: Mapping[str, Best], marks: list[float]) -> Section:
    names = dict.fromkeys(planner for planners in runs.values() for planner in planners)
    head = ["planner", "solved runs", "problems solved in the median", "first path [ms]",
            *(f"cost / best known at {mark:g} s" for mark in marks)]
    note = "The last columns are geometric means over the problems, of medians; (k/n): only k of the n problems have one."
    return Section("All problems", note, head, [_overview_row(name, runs, best, marks) for name in names])


def _overview_row(planner: str, runs: Runs, best: Mapping[str, Best], marks: list[float]) -> list[str]:
    overall = _overall(planner, runs, best, marks)
    return [planner, _share(overall), f"{overall['problems_solved']}/{overall['problems']}",
            _shown(overall["time_to_first"], len(runs), milliseconds),
            *(_shown(mean, len(runs), "{:.4f}".format) for mean in overall["cost_over_best_known"].values())]


def _shown(mean: Mapping[str, float], problems: int, show: Callable[[float], str]) -> str:
    """Write a mean, with the number of its values unless there is one for each problem."""
    if not mean["problems"]:
        return "-"
    text = show(mean["geometric_mean"])
    return text if mean["problems"] == problems else f"{text} ({mean['problems']}/{problems})"


def _problem_table(planners: Mapping[str, list[RunRecord]], best: Best, marks: list[float]
                   ) -> tuple[list[str], list[list[str]]]:
    head = ["planner", "solved", "first path [ms]", "its cost", *(f"cost at {mark:g} s" for mark in marks), "final cost",
            *(f"{100 * share:g} % above best [ms]" for share in EXCESSES)]
    return head, [_problem_row(planner, _figures(group, best, marks)) for planner, group in planners.items()]


def _problem_row(planner: str, figures: Mapping[str, Any]) -> list[str]:
    *early, last = figures["cost_at"].values()
    return [planner, _share(figures), _with_quartiles(figures["time_to_first"], milliseconds),
            metres(figures["first_cost"]["median"]),
            *(metres(costs["median"]) for costs in early), _with_quartiles(last, metres),
            _with_quartiles(figures["final_cost"], metres), *map(milliseconds, figures["time_to_within"].values())]


def with_quartiles(values: list[float], show: Callable[[float], str]) -> str:
    """Write the median with the quartiles in brackets."""
    return _with_quartiles(quartiles(values), show)


def _with_quartiles(values: Mapping[str, float], show: Callable[[float], str]) -> str:
    low, middle, high = map(show, values.values())
    return middle if low == high == "-" else f"{middle} [{low}, {high}]"


def _share(figures: Mapping[str, Any]) -> str:
    return f"{figures['solved']}/{figures['runs']}"


def metres(value: float, digits: int = 2) -> str:
    """Write metres with this many decimals, or a dash."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def milliseconds(seconds: float) -> str:
    """Write a time in milliseconds with three significant digits, from a second on with all."""
    if math.isinf(seconds):
        return "-"
    return f"{1000 * seconds:.3g}" if seconds < 0.9995 else f"{1000 * seconds:.0f}"


def table(head: list[str], rows: list[list[str]]) -> str:
    """Write a table in Markdown."""
    lines = [[cell.replace("|", "\\|") for cell in row] for row in (head, *rows)]
    lines.insert(1, ["---"] * len(head))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
