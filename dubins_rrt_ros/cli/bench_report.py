"""What runs of planners amount to: statistics, and the report in Markdown.

A median is the lower one and a quartile its like: the least value that at least this share of the runs does not exceed, so that
each is a value that was measured. Runs without a path that passed its check count, as infinite.
"""

import math
from collections.abc import Callable, Iterable, Mapping

from .bench_lines import Best, Run, Runs

#: When costs are looked at [s], and above the best known by which shares.
MARKS, SHARES = (0.05, 0.1, 0.3, 1.0, 5.0), (0.05, 0.02, 0.01)

EXPLANATION = """\
Lengths are in metres; times count from the request on, with the map prepared. Each figure is the lower median over all runs of a
planner, in brackets the quartiles: values that were measured. A run is solved where its path passed its check; the others count
as infinite. A dash is an infinite figure, or one at a mark that the runs were cut short before.
"""


def quantile(values: Iterable[float], share: float) -> float:
    """The least value that at least this share of the values does not exceed."""
    ordered = sorted(values)
    return ordered[max(math.ceil(share * len(ordered)) - 1, 0)]


def median(values: Iterable[float]) -> float:
    """The lower median."""
    return quantile(values, 0.5)


def marks_of(runs: Runs) -> list[float]:
    """The marks within the time of the longest run [s]; the first in any case."""
    longest = max(run.total for planners in runs.values() for group in planners.values() for run in group)
    return [mark for mark in MARKS if mark <= max(longest, MARKS[0])]


def ratio(cost: float, best: Best) -> float:
    """A cost by the best known one; infinite where there is none of either."""
    if math.isinf(cost):
        return math.inf
    return cost / best.cost if best.cost > 0 else 1.0  # a start that is the goal: all lengths are 0


def summary(runs: Runs) -> str:
    """A line for each problem: how many runs are solved, and the medians."""
    return "\n".join(f"{problem}: {_solved(group)} solved, "
                     f"first path {milliseconds(median(run.first[0] for run in group))} ms, "
                     f"{metres(median(run.cost for run in group))} m"
                     for problem, planners in runs.items() for group in planners.values())


def to_markdown(runs: Runs, best: Mapping[str, Best]) -> str:
    """The report: all problems in one table, then a table for each."""
    marks = marks_of(runs)
    parts = ["# Planners compared", EXPLANATION.strip(), "## All problems", _overview(runs, best, marks)]
    for problem, planners in runs.items():
        parts += [f"## {problem}", f"Best known: {metres(best[problem].cost, 4)} m, {best[problem].source}.",
                  _problem_table(planners, best[problem], marks)]
    return "\n\n".join(parts) + "\n"


def _overview(runs: Runs, best: Mapping[str, Best], marks: list[float]) -> str:
    names = dict.fromkeys(planner for planners in runs.values() for planner in planners)
    head = ["planner", "solved runs", "problems solved in the median", "first path [ms]",
            *(f"cost / best known at {mark:g} s" for mark in marks)]
    note = "The last columns are geometric means over the problems, of medians; (k/n): only k of the n problems have one."
    return note + "\n\n" + table(head, [_overview_row(name, runs, best, marks) for name in names])


def _overview_row(planner: str, runs: Runs, best: Mapping[str, Best], marks: list[float]) -> list[str]:
    groups = {problem: planners[planner] for problem, planners in runs.items() if planner in planners}
    solved = sum(math.isfinite(median(run.cost for run in group)) for group in groups.values())
    first = [median(run.first[0] for run in group) for group in groups.values()]
    at_marks = ([ratio(median(run.cost_at(mark) for run in group), best[problem]) for problem, group in groups.items()]
                for mark in marks)
    return [planner, _solved([run for group in groups.values() for run in group]), f"{solved}/{len(runs)}",
            _mean(first, len(runs), milliseconds), *(_mean(ratios, len(runs), "{:.4f}".format) for ratios in at_marks)]


def _mean(values: list[float], problems: int, show: Callable[[float], str]) -> str:
    """The geometric mean of those that are finite, and how many they are unless it is one for each problem."""
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return "-"
    mean = show(math.prod(value ** (1 / len(finite)) for value in finite))
    return mean if len(finite) == problems else f"{mean} ({len(finite)}/{problems})"


def _problem_table(planners: Mapping[str, list[Run]], best: Best, marks: list[float]) -> str:
    head = ["planner", "solved", "first path [ms]", "its cost", *(f"cost at {mark:g} s" for mark in marks),
            *(f"{100 * share:g} % above best [ms]" for share in SHARES)]
    return table(head, [_problem_row(planner, group, best, marks) for planner, group in planners.items()])


def _problem_row(planner: str, group: list[Run], best: Best, marks: list[float]) -> list[str]:
    *early, last = ([run.cost_at(mark) for run in group] for mark in marks)
    reach = ((1 + share) * best.cost for share in SHARES)
    return [planner, _solved(group), spread([run.first[0] for run in group], milliseconds),
            metres(median(run.first[1] for run in group)), *(metres(median(costs)) for costs in early), spread(last, metres),
            *(milliseconds(median(run.time_to(cost) for run in group)) for cost in reach)]


def spread(values: list[float], show: Callable[[float], str]) -> str:
    """Median and quartiles."""
    low, middle, high = (show(quantile(values, share)) for share in (0.25, 0.5, 0.75))
    return middle if low == high == "-" else f"{middle} [{low}, {high}]"


def _solved(group: list[Run]) -> str:
    return f"{sum(run.solved for run in group)}/{len(group)}"


def metres(value: float, digits: int = 2) -> str:
    """Digits after the point, or a dash."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def milliseconds(seconds: float) -> str:
    """Milliseconds with three digits, or all where there are more."""
    if math.isinf(seconds):
        return "-"
    return f"{1000 * seconds:.3g}" if seconds < 0.9995 else f"{1000 * seconds:.0f}"


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [[cell.replace("|", "\\|") for cell in row] for row in (head, *rows)]
    lines.insert(1, ["---"] * len(head))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
