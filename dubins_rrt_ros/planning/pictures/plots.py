"""Plots of maps, trees and plans on axes that may hold more: `plot()` of the library, with legends."""

import io
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import ScaledTranslation

from ..maps.model import GridMap, Map
from . import drawing
from .drawing import FAILURE, FREE, OBSTACLE, PATH, ROOMY, SWEPT, TIGHT, TREE, UNKNOWN

if TYPE_CHECKING:
    from ..result import Plan
    from ..search.tree import Tree

#: Number of straight pieces in which a turn is drawn that goes once around.
PIECES = 48
#: Side of the picture in a notebook [inch], and its resolution [1/inch].
SIDE, DPI = 6.0, 110
#: Distance from the axes to the legend below them, where the label of x is [inch].
BELOW = 0.4


def plot_map(world_map: Map, ax: Axes | None = None) -> Axes:
    """Draw free, occupied and unknown space."""
    axes = ax or _new_axes()
    drawing.frame(axes, world_map)
    drawing.draw_map(axes, world_map)
    _add_legend(axes, _map_handles(world_map))
    return axes


def plot_tree(tree: "Tree", ax: Axes | None = None) -> Axes:
    """Draw all edges; axes that show something already keep their limits."""
    axes = ax or _new_axes()
    is_alone = not axes.has_data()
    drawing.draw_tree(axes, tree.segments(2 * np.pi * tree.radius / PIECES))
    if is_alone:
        axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
        axes.margins(0.05)
        axes.autoscale_view()
        _add_legend(axes, _tree_handles(tree))
    return axes


def plot_plan(plan: "Plan", ax: Axes | None = None) -> Axes:
    """Draw the map, the tree, the path with what the vehicle sweeps, start and goal, and the cause where there is no path."""
    axes, problem = ax or _new_axes(), plan.problem
    drawing.frame(axes, problem.map)
    contents = drawing.of_plan(plan)
    drawing.draw_on(axes, contents)
    axes.set_title(contents.title, fontsize=11)
    handles = [*_map_handles(problem.map), *(_tree_handles(plan.tree) if len(plan.tree) > 1 else ())]
    if plan.path is not None:
        handles += [*_path_handles(contents.rooms is not None),
                    Patch(color=PATH, alpha=SWEPT, label="swept by the vehicle")]
    if plan.location is not None:
        handles.append(Line2D([], [], color=FAILURE, marker="x", linestyle="", markeredgewidth=3, label="why there is no path"))
    _add_legend(axes, handles)
    return axes


def png_of(plot: Callable[[Axes], Axes]) -> bytes:
    """Return what a function draws on axes as PNG; pyplot knows nothing of it."""
    figure = Figure(figsize=(SIDE, SIDE))
    plot(figure.add_subplot())
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DPI, bbox_inches="tight")
    return picture.getvalue()


def _new_axes() -> Axes:
    """Return the axes of a new figure that pyplot shows."""
    from matplotlib import pyplot  # here, for it picks a window system, which a picture in a file needs not
    _, axes = pyplot.subplots(figsize=(SIDE, SIDE), layout="constrained")
    return axes


def _map_handles(world_map: Map) -> list[Artist]:
    has_unknown = isinstance(world_map, GridMap) and bool(
        (world_map.blocked(allow_unknown=False) != world_map.blocked(allow_unknown=True)).any())
    kinds = [(FREE, "free"), (OBSTACLE, "obstacle"), *([(UNKNOWN, "unknown")] if has_unknown else [])]
    return [Patch(facecolor=colour, edgecolor=OBSTACLE, linewidth=0.6, label=label) for colour, label in kinds]


def _tree_handles(tree: "Tree") -> list[Artist]:
    return [Line2D([], [], color=TREE, label=f"tree of {len(tree)} nodes")]


def _path_handles(is_by_room: bool) -> list[Artist]:
    kinds = [(TIGHT, "path without room"), (ROOMY, "with the preferred clearance")] if is_by_room else [(PATH, "path")]
    return [Line2D([], [], color=colour, linewidth=2.4, label=label) for colour, label in kinds]


def _add_legend(axes: Axes, handles: list[Artist]) -> None:
    """Explain the colours below the axes, where nothing is covered."""
    figure = axes.get_figure()
    assert figure is not None  # axes are made by a figure
    below = axes.transAxes + ScaledTranslation(0, -BELOW, figure.dpi_scale_trans)
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0), bbox_transform=below, ncols=3, fontsize=9,
                frameon=False)
