"""The figures of `dubins_rrt paper`: the paper's own, its table as curves, and the answer to its open question."""

import math
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dubins_rrt_ros.cli.bench.report import quantile
from dubins_rrt_ros.planning.pictures.drawing import DPI, GOAL, PATH, Drawing, decorate, draw, planner_title

from .runs import (
    CONVERGENCE,
    ENVIRONMENTS,
    HEADINGS,
    LIMITED,
    MARKS,
    MAZE,
    MOST,
    PICTURES,
    PLANNERS,
    QUESTION,
    STEPS,
    UNLIMITED,
    Measured,
    RunOutcome,
    picture_name,
    planned,
)

FORMATS = (".png", ".svg")
#: Two colours of Okabe and Ito's palette, and shapes for those who see neither.
COLOURS, SHAPES = {"rrt": GOAL, "rrt_star": PATH}, {"rrt": "o", "rrt_star": "s"}
#: Distance between the poses of a drawn path, and length of the segments of the tree's arcs, 1 mm off them at most [m].
SPACING, PIECE = 0.05, 0.1
#: Sides of the convergence plot, and of a panel of the question's figure [inch].
CURVES, PANEL = (7.2, 4.4), (3.6, 2.6)
TICKS, TIMES = (50, 100, 200, 500, 1000, 2000, 3000), (1, 10, 100)
HEADINGS_TICKS = ("uniform", "towards\nthe goal", "along\nthe field")
#: Offset from a tick to a limited step (right) and to an unlimited one (left), and between RRT and RRT*.
STEP_OFFSET, PLANNER_OFFSET = 0.09, 0.2


def figure_count() -> int:
    """Return the number of figures."""
    return len(PICTURES) + 2


def drawn_figures(folder: Path, measured: Measured) -> Iterator[str]:
    """Draw all figures to a folder in all formats, and yield the name of each as soon as it is there."""
    for environment, planner, samples in PICTURES:
        name = picture_name(environment, planner, samples)
        _draw_picture(folder / name, measured, environment, planner, samples)
        yield name
    for name, figure in ((CONVERGENCE, _convergence), (QUESTION, _question)):
        _save(figure(measured), folder / name)
        yield name


def _save(figure: Figure, path: Path) -> None:
    for ending in FORMATS:
        figure.savefig(path.with_suffix(ending), dpi=DPI)


def _draw_picture(path: Path, measured: Measured, environment: str, planner: str, samples: int) -> None:
    """Draw the tree and the path of the run of median length, planned once more."""
    run, solved = measured.median_run(environment, planner, samples)
    answer = planned(run)
    problem, tree = answer.problem, answer.tree.segments(PIECE)
    poses = answer.path.poses(SPACING) if answer.path else np.empty((0, 3))
    length = f"{answer.length:.2f} m" if answer.path else "no path"
    drawn = f"{answer.samples} of {samples}" if answer.samples < samples else f"{samples}"
    among = f"the median of {solved}" if solved == measured.seeds else f"the median of {solved} of {measured.seeds} with a path"
    drawing = Drawing(problem.map, problem.start, problem.goal, problem.vehicle, tree, poses,
                      f"{planner_title(planner)}, {environment}: {length}",
                      f"{drawn} samples, {len(answer.tree)} nodes; seed {run.seed}, {among}")
    for ending in FORMATS:
        draw(str(path.with_suffix(ending)), drawing)


def _convergence(measured: Measured) -> Figure:
    """Draw length over samples in the maze."""
    figure = Figure(figsize=CURVES, layout="constrained")
    axes = figure.add_subplot()
    decorate(axes)
    axes.set_title(f"Path length in the {MAZE}: median and quartiles of {measured.seeds} seeds", fontsize=13, weight="bold",
                   loc="left")
    axes.set(xscale="log", xlim=(MARKS[0], 1.6 * MARKS[-1]), xlabel="samples", ylabel="length [m]")
    axes.set_xticks(TICKS, map(str, TICKS))
    axes.locator_params(axis="y", integer=True)
    axes.set_xticks([], minor=True)
    for planner in PLANNERS:
        _draw_curve(axes, planner, [[run.length for run in measured.of(MAZE, planner, mark)] for mark in MARKS])
    return figure


def _draw_curve(axes: Axes, planner: str, lengths: list[list[float]]) -> None:
    """Draw a line and a band over MARKS, where they are finite, and the planner's name at their end."""
    low, middle, high = (np.array([quantile(values, share) for values in lengths]) for share in (0.25, 0.5, 0.75))
    colour, solved = COLOURS[planner], np.isfinite(middle)
    axes.fill_between(MARKS, low, high, where=np.isfinite(high), color=colour, alpha=0.2, linewidth=0)
    axes.plot(np.array(MARKS)[solved], middle[solved], SHAPES[planner] + "-", color=colour, linewidth=2.2, markersize=6)
    if solved[-1]:
        axes.annotate(planner_title(planner), (MARKS[-1], middle[-1]), (10, 0), textcoords="offset points", va="center",
                      color=colour, fontsize=13, weight="bold")


def _question(measured: Measured) -> Figure:
    """Draw a column of panels for each environment: time to the first path, and the lengths of RRT and RRT*."""
    rows: list[tuple[str, tuple[str, ...], Callable[[RunOutcome], float]]] = [
        ("first path [ms]", PLANNERS, lambda run: 1000 * run.time_to_first),
        ("RRT: length [m]", ("rrt",), lambda run: run.length),
        (f"RRT*, {MOST} samples:\nlength [m]", ("rrt_star",), lambda run: run.length)]
    figure = Figure(figsize=(PANEL[0] * len(ENVIRONMENTS), PANEL[1] * len(rows) + 0.5), layout="constrained")
    panels = figure.subplots(len(rows), len(ENVIRONMENTS), sharex=True)
    for (label, planners, figure_of), line in zip(rows, panels, strict=True):
        line[0].set_ylabel(label)
        for environment, axes in zip(ENVIRONMENTS, line, strict=True):
            _draw_panel(axes, measured, environment, planners, figure_of)
    _name_ticks(panels)
    figure.legend(handles=_legend(), loc="outside upper center", ncols=4, fontsize=13, frameon=False,
                  columnspacing=1.2, handletextpad=0.2)
    return figure


def _draw_panel(axes: Axes, measured: Measured, environment: str, planners: tuple[str, ...],
                figure_of: Callable[[RunOutcome], float]) -> None:
    decorate(axes)
    for planner, step_size in product(planners, STEPS):
        place = 0.0 if len(planners) == 1 else PLANNER_OFFSET if planner == "rrt_star" else -PLANNER_OFFSET
        _draw_kind(axes, measured, environment, planner, step_size, place, figure_of)
    axes.margins(y=0.2)


def _name_ticks(panels: np.ndarray) -> None:
    """Name the environments above the columns, the headings below, and the times, whose axes are the same."""
    panels[0][0].set_xticks(range(len(HEADINGS)), HEADINGS_TICKS)
    for environment, axes in zip(ENVIRONMENTS, panels[0], strict=True):
        axes.set_title(environment, fontsize=14, weight="bold", loc="left")
        axes.sharey(panels[0][0])
    panels[0][0].set(yscale="log")
    for axes in panels[0]:
        axes.set_yticks(TIMES, map(str, TIMES))
        axes.set_yticks([], minor=True)


def _draw_kind(axes: Axes, measured: Measured, environment: str, planner: str, step_size: float, place: float,
               figure_of: Callable[[RunOutcome], float]) -> None:
    """Draw medians and quartiles of the runs of a planner with a step size, and how many found a path if not all did."""
    for i, headings in enumerate(HEADINGS):
        runs = measured.of(environment, planner, headings=headings, step_size=step_size)
        x, solved = i + place + (STEP_OFFSET if step_size else -STEP_OFFSET), sum(run.solved for run in runs)
        low, middle, high = (quantile(map(figure_of, runs), share) for share in (0.25, 0.5, 0.75))
        if math.isfinite(high):
            axes.plot([x, x], [low, high], color=COLOURS[planner], linewidth=2)
        if math.isfinite(middle):
            axes.plot(x, middle, **_marker(planner, step_size))
        if solved < len(runs):
            axes.text(x, 0.97, f"{solved}/{len(runs)}", transform=axes.get_xaxis_transform(), color=COLOURS[planner],
                      fontsize=11, weight="bold", ha="center", va="top", rotation=90)


def _marker(planner: str, step_size: float) -> dict[str, Any]:
    """Return the style of a marker: filled for unlimited steps, hollow for limited ones."""
    return {"marker": SHAPES[planner], "color": COLOURS[planner], "markersize": 8, "markeredgewidth": 2, "linestyle": "none",
            "markerfacecolor": "white" if step_size else COLOURS[planner]}


def _legend() -> list[Line2D]:
    titles = {UNLIMITED: "no limit to the step", LIMITED: f"steps of {LIMITED:g} m"}
    return [Line2D([], [], **_marker(planner, step_size), label=f"{planner_title(planner)}, {titles[step_size]}")
            for planner in PLANNERS for step_size in STEPS]
