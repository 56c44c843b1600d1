"""Figures of the search for docs/, all in the maze: trees, bounds, and convergence.

Seeds and sample budgets are fixed, and no time limit ends a run, so that they are the same however fast the machine is.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps, patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from dubins_rrt_ros.planning import ClearanceField, Path, Plan, Problem, Progress, Settings, plan
from dubins_rrt_ros.planning.pictures.drawing import (
    FAILURE,
    FREE,
    GOAL,
    PATH,
    START,
    TREE,
    Drawing,
    decorate,
    draw_map,
    draw_on,
    draw_poses,
    frame,
    of_plan,
    planner_title,
)
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.lower_bound import lower_bound

from ..paper.runs import MAZE, MOST, NO_LIMIT, UNLIMITED, PaperRun, planned, problem_in

#: A seed with which RRT needs about as many samples as the paper draws for its pictures, 500.
SEED = 65
#: Distance between the poses of a drawn path, length of the segments of the tree's arcs, and distances between the points at
#: which colours and contours are computed [m].
SPACING, PIECE, PIXEL, STEP = 0.2, 0.1, 0.05, 0.1
#: Sides of a picture of the maze, of one with a colour bar, of two pictures, and of the convergence plot [inch].
PICTURE, COLOURED, PICTURES, CURVES = (6.6, 5.8), (6.6, 5.3), (10.6, 4.9), (7.2, 4.4)
#: Number of levels that are drawn.
LEVELS = 7
#: Font sizes.
TITLE, NOTE = 13, 11
#: Substitute for infinity where contours are drawn, which take none [m].
BEYOND = 1e3
#: Colours of where no shorter path leads, and of the first path, which the final one may hide.
RULED_OUT, FIRST = "#dfe2e6", "#000000"
#: Lines over the colours of the cost-to-go, with an edge that makes them visible on all of them.
EDGED: dict[str, Any] = {"linewidth": 2.2, "path_effects": [patheffects.withStroke(linewidth=4.4, foreground="black")]}
#: The planners compared: settings, number of samples to begin with, colour and marker.
COMPARED: dict[str, tuple[Settings, int, str, str]] = {
    "plain RRT*": (Settings(informed=False, shortcut=False, heading_sampling="uniform"), 300, START, "o"),
    "informed": (Settings(shortcut=False, preferred_clearance=0.0), 1, GOAL, "s"),
    "informed, with shortcuts": (Settings(preferred_clearance=0.0), 1, PATH, "^"),
}
MARKS, SEEDS = (1, 10, 100, 300, 1000, 3000), range(5)


class Bounds(NamedTuple):
    """The lower bounds of a problem.

    Attributes:
        to_goal, from_start: lower bounds of the length to the goal, and from the start.
        least: lower bound of the length of a path [m].
    """

    to_goal: CostToGo
    from_start: CostToGo
    least: float

    def over(self, points: np.ndarray) -> np.ndarray:
        """Return (n,) lower bounds of the length of a path through (n, 2) points [m]; infinite where there is none."""
        return self.from_start.at(points) + self.to_goal.at(points)

    def over_grid(self, problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return (rows, columns) x and y of points all over a map, and their lower bounds, at most BEYOND [m]."""
        points = _grid(problem, STEP)
        return points[..., 0], points[..., 1], np.minimum(self.over(points.reshape(-1, 2)), BEYOND).reshape(points.shape[:2])


def rrt_and_rrt_star() -> Figure:
    """Draw the trees and paths of Algorithms 1 and 2, grown from the same samples."""
    rrt = planned(PaperRun(MAZE, "rrt", MOST, "uniform", UNLIMITED, SEED))
    rrt_star = planned(PaperRun(MAZE, "rrt_star", rrt.samples, "uniform", UNLIMITED, SEED))
    figure = Figure(figsize=PICTURES, layout="constrained")
    drawn = list(zip(figure.subplots(1, 2, sharey=True), (rrt, rrt_star), strict=True))
    for axes, found in drawn:
        _frame(axes, f"{planner_title(found.settings.planner)}: {found.length:.2f} m",
               f"{found.samples} samples, {len(found.tree)} nodes")
        axes.label_outer()
    figure.draw_without_rendering()  # lays the axes out, by whose size the places of the names are chosen
    for axes, found in drawn:
        _draw_plan(axes, found)
    return figure


def informed_search() -> Figure:
    """Draw what the bounds leave of the maze to the search, with the first path and the last."""
    first, final = first_and_final()
    known = bounds_of(final.problem)
    figure, axes = _picture(PICTURE, f"Informed search: from {first.length:.2f} m to {final.length:.2f} m",
                            f"{final.samples} samples; no path is shorter than {known.least:.2f} m")
    _draw_plan(axes, final)
    draw_map(axes, final.problem.map, RULED_OUT)  # over the white of the plan
    axes.contourf(*known.over_grid(final.problem), levels=[0, final.length], colors=[FREE], zorder=1.5)
    poses = path_of(first).poses(SPACING)
    axes.plot(poses[:, 0], poses[:, 1], "--", color=FIRST, linewidth=1.6, zorder=4.5)
    figure.legend(handles=[
        Line2D([], [], color=FIRST, linestyle="--", linewidth=1.6, label="first path, of hybrid A*"),
        Line2D([], [], color=PATH, linewidth=2.4, label="final path"),
        Line2D([], [], color=TREE, linewidth=1.6, label="tree of RRT*"),
        Patch(color=RULED_OUT, label="ruled out by the bounds"),
    ], loc="outside lower center", ncols=2, fontsize=NOTE, frameon=False)
    return figure


def bounds() -> Figure:
    """Draw the cost-to-go over the maze, and the region through which a shorter path may lead."""
    _, final = first_and_final()
    problem, known = final.problem, bounds_of(final.problem)
    figure, axes = _picture(COLOURED, "Cost-to-go, and where a shorter path may lead",
                            f"best path {final.length:.2f} m, lower bound {known.least:.2f} m")
    draw_map(axes, problem.map)
    _draw_cost_to_go(axes, known, problem)
    region = axes.contour(*known.over_grid(problem), levels=[final.length], colors="white", zorder=3)
    region.set(**EDGED)
    poses = path_of(final).poses(SPACING)
    axes.plot(poses[:, 0], poses[:, 1], color=FAILURE, zorder=4, **EDGED)
    draw_poses(axes, of_plan(final))
    figure.legend(handles=[Line2D([], [], color=FAILURE, label="best path", **EDGED),
                           Line2D([], [], color="white", label="a shorter one leads within", **EDGED)],
                  loc="outside lower center", ncols=2, fontsize=NOTE, frameon=False)
    return figure


def proof() -> Figure:
    """Draw levels of the cost from the start, and where the best path leaves each for the last time."""
    _, final = first_and_final()
    problem, known = final.problem, bounds_of(final.problem)
    poses = path_of(final).poses(SPACING / 4)
    costs = known.from_start.at(poses[:, :2])
    levels = np.linspace(0, costs[-1], LEVELS + 2)[1:-1]
    figure, axes = _picture(PICTURE, "Levels of the cost from the start",
                            "the path is at least as long as the Dubins curves between them")
    draw_map(axes, problem.map)
    points = _grid(problem, STEP)
    over = known.from_start.at(points.reshape(-1, 2)).reshape(points.shape[:2])
    over[np.isinf(over)] = np.nan
    axes.contour(points[..., 0], points[..., 1], over, levels=levels, colors=GOAL, linewidths=1.6, zorder=3)
    axes.plot(poses[:, 0], poses[:, 1], color=PATH, linewidth=2.4, zorder=4)
    last = [np.flatnonzero(costs <= level)[-1] for level in levels]
    axes.plot(poses[last, 0], poses[last, 1], "o", color=FAILURE, markersize=7, zorder=5)
    draw_poses(axes, of_plan(final))
    figure.legend(handles=[
        Line2D([], [], color=GOAL, linewidth=1.6, label="levels"), Line2D([], [], color=PATH, linewidth=2.4, label="path"),
        Line2D([], [], color=FAILURE, marker="o", linestyle="none", label="crossings"),
    ], loc="outside lower center", ncols=3, fontsize=NOTE, frameon=False)
    return figure


def convergence() -> Figure:
    """Draw the excess of paths over the lower bound, over samples."""
    problem = problem_in(MAZE)
    least = bounds_of(problem).least
    figure = Figure(figsize=CURVES, layout="constrained")
    axes = figure.add_subplot()
    decorate(axes)
    axes.set_title(f"Paths in the {MAZE}: {len(SEEDS)} seeds and their medians", fontsize=TITLE, weight="bold", loc="left")
    axes.set(xscale="log", xlabel="samples", ylabel=f"length above {least:.2f} m [%]")
    for name, (settings, begin, colour, shape) in COMPARED.items():
        marks = [mark for mark in MARKS if mark >= begin]
        above = 100 * (lengths(problem, settings, marks) / least - 1)
        axes.plot(marks, above, color=colour, linewidth=0.8, alpha=0.5)
        axes.plot(marks, np.median(above, axis=1), shape + "-", color=colour, linewidth=2.2, markersize=7, label=name)
    axes.set_xticks(MARKS, map(str, MARKS))
    axes.set_xticks([], minor=True)
    axes.set_ylim(bottom=0)
    axes.legend(fontsize=12, frameon=False)
    return figure


#: Functions that draw the figures, by the names of their files without the ending.
FIGURES: dict[str, Callable[[], Figure]] = {
    drawn.__name__: drawn for drawn in (rrt_and_rrt_star, informed_search, bounds, proof, convergence)}


def first_and_final() -> tuple[Plan, Plan]:
    """Plan in the maze; return the plan when the first path was found, and the final one."""
    first: list[Plan] = []

    def keep_first(progress: Progress) -> None:
        if progress.improved and not first:
            first.append(progress.snapshot())

    final = plan(problem_in(MAZE), Settings(planning_time=NO_LIMIT, seed=SEED, length_proof=False, preferred_clearance=0.0),
                 on_progress=keep_first)
    return first[0], final


def path_of(found: Plan) -> Path:
    """Return the path of a plan that has one.

    Raises:
        ValueError: it has none.
    """
    if found.path is None:
        raise ValueError(found.message)
    return found.path


def bounds_of(problem: Problem) -> Bounds:
    """Compute the bounds of a problem without unknown space."""
    field = ClearanceField(problem.map)
    to_goal, from_start = (make(problem, field).make_bound() for make in (CostToGo.to_goal, CostToGo.from_start))
    return Bounds(to_goal, from_start, lower_bound(problem, to_goal))


def lengths(problem: Problem, settings: Settings, marks: Sequence[int]) -> np.ndarray:
    """Return (marks, seeds) lengths of the paths after these numbers of samples [m]; NaN where there is none.

    Each is planned from the beginning: progress is reported at certain times, not at certain samples.
    """
    def length(samples: int, seed: int) -> float:
        found = plan(problem, replace(settings, samples=samples, seed=seed, planning_time=NO_LIMIT))
        return math.nan if found.length is None else found.length

    return np.array([[length(mark, seed) for seed in SEEDS] for mark in marks])


def _grid(problem: Problem, step: float) -> np.ndarray:
    """Return (rows, columns, 2) points all over a map, a step apart [m]."""
    corners = problem.map.corners()
    x, y = (np.arange(low + step / 2, high, step) for low, high in zip(corners.min(axis=0), corners.max(axis=0), strict=True))
    return np.stack(np.meshgrid(x, y), axis=-1)


def _picture(sides: tuple[float, float], title: str, note: str) -> tuple[Figure, Axes]:
    """Make a figure with one picture of the maze."""
    figure = Figure(figsize=sides, layout="constrained")
    axes = figure.add_subplot()
    _frame(axes, title, note)
    return figure, axes


def _frame(axes: Axes, title: str, note: str) -> None:
    """Fit axes to the maze, and write a title and a note above."""
    frame(axes, problem_in(MAZE).map)
    axes.tick_params(labelsize=NOTE)
    axes.xaxis.label.set_fontsize(NOTE)
    axes.yaxis.label.set_fontsize(NOTE)
    axes.set_title(title, fontsize=TITLE, weight="bold", loc="left", pad=22)
    axes.text(0, 1.02, note, transform=axes.transAxes, fontsize=NOTE, color="#444444")


def _draw_plan(axes: Axes, found: Plan) -> None:
    """Draw map, tree and path."""
    problem, tree, path = found.problem, found.tree.segments(PIECE), path_of(found).poses(SPACING)
    draw_on(axes, Drawing(problem.map, problem.start, problem.goal, problem.vehicle, tree, path, "", ""))
    for lines in axes.collections:
        lines.set_antialiased(False)  # as pixels of one colour they take a fifth of the room in a file


def _draw_cost_to_go(axes: Axes, known: Bounds, problem: Problem) -> None:
    """Draw the cost-to-go in colours, one for each metre, with a colour bar."""
    points = _grid(problem, PIXEL)
    cost = np.ma.masked_invalid(known.to_goal.at(points.reshape(-1, 2)).reshape(points.shape[:2]))
    most = math.ceil(cost.max())
    left, low = points[0, 0] - PIXEL / 2
    right, high = points[-1, -1] + PIXEL / 2
    view = axes.axis()
    image = axes.imshow(cost, cmap=colormaps["cividis"].resampled(most), vmin=0, vmax=most, origin="lower",
                        extent=(left, right, low, high), interpolation="none", zorder=2)
    axes.axis(view)
    bar = axes.figure.colorbar(image, cax=axes.inset_axes((1.03, 0, 0.04, 1)))
    bar.set_label("way to the goal, at least [m]", fontsize=NOTE)
    bar.ax.tick_params(labelsize=NOTE)
