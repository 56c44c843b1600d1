"""Plots of maps, trees and plans on axes that may hold more: `plot()` of the library, with legends."""

import io
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from ..maps.model import Map
from ..text import quoted
from . import drawing

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
    axes = _checked(ax)
    drawing.frame(axes, world_map)
    drawing.draw_map(axes, world_map)
    _add_legend(axes, drawing.map_entries(world_map))
    return axes


def plot_tree(tree: "Tree", ax: Axes | None = None) -> Axes:
    """Draw all edges; axes that show something already keep their limits."""
    axes = _checked(ax)
    is_alone = not axes.has_data()
    drawing.draw_tree(axes, tree.segments(2 * np.pi * tree.radius / PIECES))
    if is_alone:
        axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
        axes.margins(0.05)
        axes.autoscale_view()
        _add_legend(axes, [drawing.tree_entry(_tree_name(tree))])
    return axes


def plot_plan(plan: "Plan", ax: Axes | None = None) -> Axes:
    """Draw the map, the tree, the path with what the vehicle sweeps, start and goal, and the cause where there is no path."""
    axes = _checked(ax)
    drawing.frame(axes, plan.problem.map)
    contents = drawing.of_plan(plan)
    drawing.draw_on(axes, contents)
    axes.set_title(contents.title, fontsize=11)
    _add_legend(axes, drawing.legend_entries(contents, _tree_name(plan.tree)))
    return axes


def png_of(plot: Callable[[Axes], Axes]) -> bytes:
    """Return what a function draws on axes as PNG; pyplot knows nothing of it."""
    figure = Figure(figsize=(SIDE, SIDE))
    plot(figure.add_subplot())
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DPI, bbox_inches="tight")
    return picture.getvalue()


def _checked(ax: Axes | None) -> Axes:
    """Return the axes that were given, or new ones."""
    if ax is None:
        return _new_axes()
    if not isinstance(ax, Axes):
        raise TypeError(f"plot() draws on axes of matplotlib, not on {quoted(ax)}; plot().figure.savefig(FILE) writes a picture")
    return ax


def _tree_name(tree: "Tree") -> str:
    return f"tree of {len(tree)} nodes"


def _new_axes() -> Axes:
    """Return the axes of a new figure that pyplot shows."""
    from matplotlib import pyplot  # here, for it picks a window system, which a picture in a file needs not
    _, axes = pyplot.subplots(figsize=(SIDE, SIDE), layout="constrained")
    return axes


def _add_legend(axes: Axes, handles: list[Artist]) -> None:
    """Explain the colours below the axes, where nothing is covered."""
    figure = axes.get_figure()
    assert figure is not None  # axes are made by a figure
    below = axes.transAxes + ScaledTranslation(0, -BELOW, figure.dpi_scale_trans)
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0), bbox_transform=below, ncols=3, fontsize=9,
                frameon=False)
