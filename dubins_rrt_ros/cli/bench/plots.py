"""Pictures of `dubins_rrt bench`: cost above the best known over time, and time per sample over the size of the tree."""

import math
from collections.abc import Collection, Mapping
from itertools import cycle, product
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from dubins_rrt_ros.planning.pictures.drawing import DPI, FAILURE, GOAL, PATH, START

from ..common.parser import UsageError
from .records import Best, RunRecord, Runs
from .report import quantile, ratio

#: Colours of Okabe and Ito's palette, without the yellow, which is too pale; after the last colour the next line style follows.
COLOURS = (PATH, GOAL, START, FAILURE, "#cc79a7", "#56b4e9", "#000000")
LINES: tuple[Literal["-", "--", ":"], ...] = ("-", "--", ":")
#: Number of panels side by side; width and height of one, and height of a row of the legend [inch].
COLUMNS, WIDTH, HEIGHT, ROW = 3, 3.3, 2.4, 0.3
#: Ranges of the axes: the earliest time [s], and cost / best known - 1, below which costs are drawn at LEAST.
EARLIEST, LEAST, MOST = 1e-3, 1e-3, 2.0
TIMES = {0.001: "1 ms", 0.01: "10 ms", 0.1: "100 ms", 1: "1 s", 10: "10 s", 100: "100 s", 1000: "1000 s"}
COSTS = {LEAST: "≤ 0.1 %", 0.01: "1 %", 0.1: "10 %", 1: "100 %"}
INSTANTS = 400


def draw_runs(file: str, runs: Runs, best: Mapping[str, Best]) -> None:
    """Draw medians and quartiles of the planners' costs, a panel for each problem; the file's ending selects the format."""
    names = dict.fromkeys(planner for planners in runs.values() for planner in planners)
    styles = [(colour, line) for line, colour in product(LINES, COLOURS)]
    style_of = {name: styles[i % len(styles)] for i, name in enumerate(names)}
    longest = max(run.total for planners in runs.values() for group in planners.values() for run in group)
    times = np.geomspace(EARLIEST, max(longest, 10 * EARLIEST), INSTANTS)
    figure, panels = _panels(list(runs), times, len(names))
    for problem, axes in panels.items():
        for planner, group in runs[problem].items():
            _draw(axes, times, group, best[problem], *style_of[planner])
    samples = [Line2D([], [], color=colour, linestyle=line, linewidth=2.5) for colour, line in style_of.values()]
    figure.legend(samples, list(names), loc="outside upper center", ncols=_columns(panels), fontsize=12, frameon=False)
    figure.savefig(file, dpi=DPI)


def draw_sample_costs(file: str, runs: Runs) -> None:
    """Draw the time per sample over the size of the tree, and a logarithm through its minimum for comparison.

    Each problem has a line with a point for each label, which is meant to be one planner with different budgets.

    Raises:
        UsageError: no run says its number of samples and of nodes.
    """
    figure = Figure(figsize=(2 * WIDTH, 1.7 * HEIGHT), layout="constrained")
    axes = figure.subplots()
    axes.set(xscale="log", xlabel="nodes of the tree", ylabel="time for each sample [µs]")
    axes.grid(color="#dddddd", linewidth=0.6)
    for (problem, planners), colour in zip(runs.items(), cycle(COLOURS), strict=False):
        counted = [group for group in planners.values() if all(run.samples and run.nodes and run.total for run in group)]
        if counted:
            nodes, costs = np.array(sorted(map(sample_cost, counted))).T
            _draw_costs(axes, problem, nodes, costs, colour)
    if not axes.lines:
        raise UsageError("--plot-samples: no run says its samples and vertices; give files that `dubins_rrt bench --out` wrote")
    axes.plot([], [], "--", color="#777777", label="logarithm of the tree")
    axes.set_ylim(0)
    axes.legend(frameon=False)
    figure.savefig(file, dpi=DPI)


def sample_cost(group: list[RunRecord]) -> tuple[float, float]:
    """Return the medians of the number of nodes of a planner's runs, and of their times per sample [µs]."""
    return quantile([run.nodes for run in group], 0.5), quantile([1e6 * run.total / run.samples for run in group], 0.5)


def _draw_costs(axes: Axes, problem: str, nodes: np.ndarray, costs: np.ndarray, colour: str) -> None:
    lowest = np.argmin(costs)
    onward = np.geomspace(nodes[lowest], nodes[-1], INSTANTS)
    axes.plot(nodes, costs, "o-", color=colour, linewidth=1.8, label=problem)
    axes.plot(onward, costs[lowest] * np.log1p(onward) / np.log1p(onward[0]), "--", color=colour, linewidth=1)


def _columns(panels: Collection[str]) -> int:
    return min(COLUMNS, len(panels))


def _panels(problems: list[str], times: np.ndarray, planners: int) -> tuple[Figure, dict[str, Axes]]:
    """Make a figure with an empty panel for each problem, and room for the legend."""
    columns = _columns(problems)
    rows = math.ceil(len(problems) / columns)
    height = HEIGHT * rows + ROW * math.ceil(planners / columns)
    figure = Figure(figsize=(WIDTH * columns, height), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes in grid[len(problems):]:
        axes.remove()
    panels = dict(zip(problems, grid, strict=False))
    for problem, axes in panels.items():
        axes.set(xscale="log", yscale="log")
        axes.set_xticks(list(TIMES), list(TIMES.values()))
        axes.set_yticks(list(COSTS), list(COSTS.values()))
        for axis in (axes.xaxis, axes.yaxis):  # whose other marks have names too, over each other, where few decades are shown
            axis.set_minor_formatter(NullFormatter())
        axes.set(xlim=(times[0], times[-1]), ylim=(0.85 * LEAST, MOST))  # the ticks beyond would widen them
        axes.set_title(problem, fontsize=12, weight="bold", loc="left")
        axes.tick_params(labelsize=10, which="both", labelbottom=True)
        axes.grid(color="#dddddd", linewidth=0.6)
    figure.supxlabel("time since the request", fontsize=12)
    figure.supylabel("cost above the best known", fontsize=12)
    return figure, panels


def _draw(axes: Axes, times: np.ndarray, group: list[RunRecord], best: Best, colour: str,
          line: Literal["-", "--", ":"]) -> None:
    """Draw the median of a planner's runs over time and the band between their quartiles, where they are finite."""
    above = np.array([[ratio(run.cost_at(time), best) - 1 for run in group] for time in times])
    low, middle, high = (np.array([max(quantile(costs, share), LEAST) for costs in above]) for share in (0.25, 0.5, 0.75))
    axes.fill_between(times, low, high, where=np.isfinite(high), step="post", color=colour, alpha=0.2, linewidth=0)
    axes.step(times, np.where(np.isfinite(middle), middle, np.nan), where="post", color=colour, linestyle=line, linewidth=1.8)
