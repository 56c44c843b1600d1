"""Pictures of a plan for files: map, tree and path, to scale, with titles."""

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Polygon
from matplotlib.path import Path as Contour
from matplotlib.transforms import Affine2D

from ..maps.model import GridMap, Map
from ..problem import Waypoint
from ..vehicle import Vehicle
from .names import HALF_WIDTH, Names
from .outlines import body, contour, swept

if TYPE_CHECKING:
    from ..result import Plan

#: The strong colours are of Okabe and Ito's palette, which all kinds of colour vision tell apart.
FREE, UNKNOWN, OBSTACLE = "#ffffff", "#c4c8ce", "#454b54"
TREE, PATH, START, GOAL, FAILURE = "#a9c8e4", "#d55e00", "#009e73", "#0072b2", "#e69f00"
#: Colours of a path by its room: none, and as much as preferred, which is darker than the tree.
TIGHT, ROOMY = PATH, GOAL
ROOM_COLOURS = LinearSegmentedColormap.from_list("room", [TIGHT, ROOMY])
DPI = 160
#: Longer side of the map in the picture, margins for the labels around it, and minimum width, for the title [inch].
MAP_SIDE, LEFT, RIGHT, BOTTOM, TOP, WIDTH = 6.4, 0.62, 0.18, 0.56, 0.52, 5.6
#: Colour of waypoints, and length of the line along the heading of one, from its middle [pt].
WAYPOINT, POINTER = "#8a4f7d", 20.0
#: Least and greatest length of the arrows of start and goal, in longer sides of the view.
SHORTEST, LONGEST = 0.045, 0.09
#: Opacity of the area that the vehicle sweeps.
SWEPT = 0.18
#: Height of a line below the title [inch], and number of its letters to the inch.
LINE, LETTERS = 0.19, 13.5
#: Columns of the legend below the map, and height of a row [inch].
COLUMNS, ROW = 3, 0.2


class Drawing(NamedTuple):
    """The contents of a picture.

    Attributes:
        map: free and occupied space.
        start, goal: (x [m], y [m], theta [rad]).
        vehicle: the vehicle, drawn at the start, at the goal and along the path.
        tree: (m, 2, 2) line segments of the tree's edges [m].
        path: (n, 3) poses of the path, close together; none where there is no path.
        title: the most important figures, in one sentence.
        subtitle: the other figures.
        location: (x, y) of what keeps a path from being there [m], or None.
        rooms: (n,) room at the poses of the path, in preferred clearances, which colours it; None for one colour.
        waypoints: (x, y, theta) of each waypoint, theta None where the path passes it with any heading and there is no path.
    """

    map: Map
    start: Sequence[float]
    goal: Sequence[float]
    vehicle: Vehicle
    tree: np.ndarray
    path: np.ndarray
    title: str
    subtitle: str
    location: tuple[float, float] | None = None
    rooms: np.ndarray | None = None
    waypoints: Sequence[Waypoint] = ()


def draw_plan(file: str, plan: "Plan") -> None:
    """Draw a plan to a file, whose ending selects the format."""
    draw(file, of_plan(plan))


def of_plan(plan: "Plan") -> Drawing:
    """Return what the picture of a plan holds."""
    problem, size = plan.problem, np.ptp(plan.problem.map.corners(), axis=0).max()
    title, subtitle = _captions(plan)
    return Drawing(problem.map, problem.start, _reached(plan), problem.vehicle,
                   plan.tree.segments(size / 400), plan.poses(), title, subtitle, plan.location,
                   plan.rooms(), _passed(plan))


def _reached(plan: "Plan") -> Sequence[float]:
    """Return the goal, with the heading in which a path reaches it where any will do."""
    goal = plan.problem.goal
    return goal if plan.path is None or not plan.problem.any_goal_heading else (*goal[:2], plan.path.end[2])


def _passed(plan: "Plan") -> list[Waypoint]:
    """Return the waypoints, with the headings in which a path passes them."""
    if plan.path is None:
        return list(plan.waypoints)
    thetas = plan.poses()[list(plan.waypoint_indices), 2].tolist()
    return [(x, y, theta) for (x, y, _), theta in zip(plan.waypoints, thetas, strict=True)]


def _captions(plan: "Plan") -> tuple[str, str]:
    name = planner_title(plan.settings.planner)
    if plan.length is None or plan.gap is None or plan.time_to_first is None:
        return f"{name}: no path, {plan.status.name}", plan.message
    return (path_title(plan.settings.planner, plan.length, plan.gap, len(plan.waypoints)),
            f"{_cost_title(plan)}{figures_title(plan.samples, plan.time_to_first, plan.planning_time)}")


def _cost_title(plan: "Plan") -> str:
    """Return the figures of the cost, where they are not those of the length, which the title has."""
    if plan.cost is None or plan.cost_gap is None or plan.length is None or plan.gap is None:
        return ""
    of_cost, of_length = (f"{value:.2f} m, {_above(gap, 'the least possible')}; "
                          for value, gap in ((plan.cost, plan.cost_gap), (plan.length, plan.gap)))
    return f"cost {of_cost}" if of_cost != of_length else ""


def planner_title(planner: str) -> str:
    """Return the literature's name of a planner."""
    return {"rrt": "RRT", "rrt_star": "RRT*"}[planner]


def path_title(planner: str, length: float, gap: float, waypoints: int = 0) -> str:
    """Return the title of a picture of a path over so many waypoints."""
    if waypoints:  # in no more letters, for which there is room
        return (f"{planner_title(planner)}: {length:.2f} m over {waypoints} waypoint{'' if waypoints == 1 else 's'}, "
                f"gap at most {100 * gap:.1f} %")
    return f"{planner_title(planner)}: {length:.2f} m, {_above(gap, 'the shortest')}"


def _above(gap: float, least: str) -> str:
    return f"at most {100 * gap:.1f} % above {least}"


def figures_title(samples: int, time_to_first: float, planning_time: float) -> str:
    """Return the line of figures below the title."""
    return f"{samples} samples, first path after {_duration(time_to_first)}, planned in {_duration(planning_time)}"


def _duration(seconds: float) -> str:
    return f"{seconds:.2f}\xa0s" if seconds >= 1 else f"{1000 * seconds:.3g}\xa0ms"  # on one line


def draw(file: str, drawing: Drawing) -> None:
    """Draw to a file, whose ending selects the format."""
    figure, axes = _canvas(drawing)
    draw_on(axes, drawing)
    figure.savefig(file, dpi=DPI)


def draw_on(axes: Axes, drawing: Drawing) -> None:
    """Draw all but the titles on axes that `frame` has fitted to the map."""
    draw_map(axes, drawing.map)
    draw_tree(axes, drawing.tree)
    draw_path(axes, drawing.vehicle, drawing.path, drawing.rooms)
    draw_poses(axes, drawing)
    if drawing.location is not None:
        axes.add_line(_failure_mark(*drawing.location, zorder=8, clip_on=False))


def _failure_mark(x: float | None = None, y: float | None = None, **style: Any) -> Line2D:
    """Return a ring around what keeps a path from being there, which stays in sight; or that of a legend."""
    xs, ys = ([], []) if x is None or y is None else ([x], [y])
    return Line2D(xs, ys, marker="o", linestyle="", color=FAILURE, markerfacecolor="none", markersize=13, markeredgewidth=3,
                  **style)


def legend_entries(drawing: Drawing, tree: str = "tree") -> list[Artist]:
    """Return what explains the colours of a picture, and of its tree by a name."""
    entries = map_entries(drawing.map)
    if len(drawing.tree):
        entries.append(tree_entry(tree))
    if len(drawing.path):
        kinds = [(PATH, "path")] if drawing.rooms is None else [(TIGHT, "path without room"), (ROOMY, "path with preferred room")]
        entries += [Line2D([], [], color=colour, linewidth=2.4, label=label) for colour, label in kinds]
        entries.append(Patch(color=PATH, alpha=SWEPT, label="swept by the vehicle"))
    if drawing.location is not None:
        entries.append(_failure_mark(label="why there is no path"))
    return entries


def map_entries(world_map: Map) -> list[Artist]:
    """Return what explains the colours of a map."""
    has_unknown = isinstance(world_map, GridMap) and bool(
        (world_map.blocked(allow_unknown=False) != world_map.blocked(allow_unknown=True)).any())
    kinds = [(FREE, "free"), (OBSTACLE, "obstacle"), *([(UNKNOWN, "unknown")] if has_unknown else [])]
    return [Patch(facecolor=colour, edgecolor=OBSTACLE, linewidth=0.6, label=label) for colour, label in kinds]


def tree_entry(name: str) -> Artist:
    """Return what explains the colour of a tree."""
    return Line2D([], [], color=TREE, label=name)


def frame(axes: Axes, world_map: Map) -> None:
    """Fit axes to a map, with equal scales and a rim of the obstacle around it."""
    low, high = view(world_map)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="y [m]", aspect="equal", facecolor=OBSTACLE)
    axes.ticklabel_format(useOffset=False, style="plain")


def draw_poses(axes: Axes, drawing: Drawing) -> None:
    """Draw start and goal, each with the vehicle, an arrow and its name, and the waypoints, on axes that `frame` has fitted."""
    side = max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))
    arrow = float(np.clip(2.2 * drawing.vehicle.inscribed_radius, SHORTEST * side, LONGEST * side))
    for pose, colour in ((drawing.start, START), (drawing.goal, GOAL)):
        draw_vehicle(axes, pose, colour, drawing.vehicle)
        _draw_arrow(axes, pose, colour, arrow)
    _draw_waypoints(axes, drawing.waypoints)
    names = Names(axes, drawing, arrow)
    # Behind the start and ahead of the goal no path runs.
    names.draw("start", drawing.start, START, math.pi)
    names.draw("goal", drawing.goal, GOAL, 0.0)


def _draw_waypoints(axes: Axes, waypoints: Sequence[Waypoint]) -> None:
    """Draw a numbered disc at each waypoint, and a line along its heading; those at one place share a disc."""
    numbers: dict[tuple[float, float], list[str]] = {}
    for number, (x, y, theta) in enumerate(waypoints, 1):
        numbers.setdefault((x, y), []).append(str(number))
        if theta is not None:
            tip = (POINTER * math.cos(theta), POINTER * math.sin(theta))
            axes.annotate("", (x, y), tip, textcoords="offset points", zorder=7,
                          arrowprops={"arrowstyle": "<|-", "color": WAYPOINT, "shrinkA": 0, "shrinkB": 0})
    for (x, y), names in numbers.items():
        axes.annotate(", ".join(names), (x, y), color="white", fontsize=9, weight="bold", ha="center", va="center", zorder=8,
                      bbox={"boxstyle": "circle,pad=0.25", "facecolor": WAYPOINT, "edgecolor": "white"})


def decorate(axes: Axes) -> None:
    """Give axes of curves their font sizes and their grid."""
    axes.tick_params(labelsize=12)
    axes.xaxis.label.set_fontsize(13)
    axes.yaxis.label.set_fontsize(13)
    axes.grid(color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def view(world_map: Map) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the view: the map and a rim of the obstacle around it."""
    corners = world_map.corners()
    low, high = corners.min(axis=0), corners.max(axis=0)
    rim = 0.01 * (high - low).max()
    return low - rim, high + rim


def _canvas(drawing: Drawing) -> tuple[Figure, Axes]:
    """Make a figure, with its title, in the shape of the view, so that equal axes leave no blank."""
    low, high = view(drawing.map)
    width, height = MAP_SIDE * (high - low) / (high - low).max()
    across = max(width + LEFT + RIGHT, WIDTH)
    lines = textwrap.wrap(drawing.subtitle, int(LETTERS * (across - LEFT)))
    entries = legend_entries(drawing)
    below = BOTTOM + ROW * math.ceil(len(entries) / COLUMNS)
    up = height + below + TOP + LINE * len(lines)
    figure = Figure(figsize=(across, up))
    axes = figure.add_axes((LEFT / across, below / up, width / across, height / up))
    figure.legend(handles=entries, loc="lower left", bbox_to_anchor=(LEFT / across, 0), ncols=COLUMNS, fontsize=9, frameon=False,
                  borderaxespad=0.2, borderpad=0.2)
    frame(axes, drawing.map)
    axes.tick_params(labelsize=9)
    figure.text(LEFT / across, 1 - 0.16 / up, drawing.title, fontsize=13, weight="bold", va="top")
    figure.text(LEFT / across, 1 - 0.42 / up, "\n".join(lines), fontsize=10, color="#444444", va="top")
    return figure, axes


def draw_map(axes: Axes, world_map: Map, free: str = FREE) -> None:
    """Draw free space, in a colour, and unknown space on axes that `frame` has fitted to the map."""
    if isinstance(world_map, GridMap):
        _draw_grid(axes, world_map, free)
    else:
        axes.add_patch(PathPatch(contour(world_map.free), facecolor=free, edgecolor="none", zorder=1))


def _draw_grid(axes: Axes, grid: GridMap, free: str) -> None:
    classes = np.where(grid.blocked(allow_unknown=True), 2, grid.blocked(allow_unknown=False).astype(int))
    colours = np.array([list(bytes.fromhex(colour[1:])) for colour in (free, UNKNOWN, OBSTACLE)], dtype=np.uint8)
    x, y, yaw = grid.origin
    view = axes.axis()
    axes.imshow(colours[classes], origin="lower", extent=(0, grid.size[0], 0, grid.size[1]), zorder=1,
                transform=Affine2D().rotate(yaw).translate(x, y) + axes.transData)
    axes.axis(view)


def draw_tree(axes: Axes, segments: np.ndarray) -> None:
    """Draw (m, 2, 2) line segments of the edges of a tree."""
    # As pixels in vector formats too, where a hundred thousand lines would be slow to open.
    edges = Contour(segments.reshape(-1, 2), np.tile([Contour.MOVETO, Contour.LINETO], len(segments)))
    # One path of all edges, in a collection, whose extent is found soonest.
    axes.add_collection(PathCollection([edges], facecolors="none", edgecolors=TREE, linewidths=0.5, rasterized=True, zorder=2))


def draw_path(axes: Axes, vehicle: Vehicle, path: np.ndarray, rooms: np.ndarray | None = None) -> None:
    """Draw (n, 3) poses close together, if any, and the area that the vehicle sweeps along them.

    With (n,) `rooms`, in preferred clearances, the path goes from one colour, where there is none, to another, where there is as
    much as preferred.
    """
    if len(path) == 0:
        return
    axes.add_patch(PathPatch(swept(vehicle, path), facecolor=PATH, alpha=SWEPT, edgecolor="none", zorder=3))
    axes.plot(path[:, 0], path[:, 1], color=PATH, linewidth=2.4, solid_capstyle="round", solid_joinstyle="round", zorder=4)
    if rooms is not None and len(path) > 1:
        pieces = np.stack([path[:-1, :2], path[1:, :2]], axis=1)
        axes.add_collection(LineCollection(list(pieces), array=(rooms[:-1] + rooms[1:]) / 2, cmap=ROOM_COLOURS, clim=(0.0, 1.0),
                                           linewidths=2.4, capstyle="round", zorder=4))


def draw_vehicle(axes: Axes, pose: Sequence[float], colour: str, vehicle: Vehicle) -> None:
    """Draw the area that the vehicle covers at a pose."""
    area = body(vehicle, pose)
    axes.add_patch(PathPatch(area, facecolor=colour, alpha=0.3, edgecolor="none", zorder=5))
    axes.add_patch(PathPatch(area, fill=False, edgecolor=colour, linewidth=1.2, zorder=5))


def _draw_arrow(axes: Axes, pose: Sequence[float], colour: str, length: float) -> None:
    x, y, theta = pose
    arrow = length * np.array([
        [0, 0.07], [0.55, 0.07], [0.5, HALF_WIDTH], [1, 0], [0.5, -HALF_WIDTH], [0.55, -0.07], [0, -0.07]])
    place = Affine2D().rotate(theta).translate(x, y)
    axes.add_patch(Polygon(place.transform(arrow), facecolor=colour, edgecolor="white", linewidth=0.7, zorder=6))
