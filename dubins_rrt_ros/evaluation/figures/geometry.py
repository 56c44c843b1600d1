"""Figures of docs/dubins_curves.md, collisions.md and howto/reference_point.md, drawn from what the planner itself computes."""

import math
from collections.abc import Callable
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon
from numpy.typing import ArrayLike

from dubins_rrt_ros.planning import ClearanceField, DubinsCurve, PolygonMap, Pose, Vehicle, rasterise
from dubins_rrt_ros.planning.collision.footprint import cover
from dubins_rrt_ros.planning.collision.raster import CLEARANCE_MARGIN
from dubins_rrt_ros.planning.curves.dubins import SIDES, candidates, shortest
from dubins_rrt_ros.planning.pictures.drawing import (
    FAILURE,
    FREE,
    GOAL,
    OBSTACLE,
    PATH,
    START,
    TREE,
    UNKNOWN,
    Drawing,
    draw_on,
    frame,
)

#: Width of a figure [inch], and font sizes.
WIDTH, TITLE, LABEL = 7.2, 13, 12
#: Distance between the poses of a drawn curve [m]: 2 mm off it at most.
SPACING = 0.1
#: Poses so close that all six words have a curve, which LRL and RLR have for close poses only; the radius is 1 m.
FROM, TO = (0.0, 0.0, math.radians(30)), (3.0, 1.0, math.radians(180))
#: A room with obstacles, and a curve of a disc that passes between them [m].
ROOM = PolygonMap(shapely.difference(shapely.box(0, 0, 12, 6), shapely.union_all([shapely.Polygon(corners) for corners in (
    [(3.4, 6.0), (3.2, 3.5), (4.6, 2.9), (5.6, 4.2), (5.2, 6.0)], [(5.2, 0.0), (5.5, 1.9), (6.9, 2.4), (7.4, 0.0)],
    [(8.9, 2.5), (9.9, 1.2), (10.5, 2.0), (9.8, 3.0)])])))
CURVE, DISC = shortest((1.0, 2.4, -1.1), (11.1, 3.4, -1.2), 1.5), Vehicle(turning_radius=1.5, robot_radius=0.4)
#: Footprint of a car whose rear axle is 0.9 m from its rear; margin, turning radius and length of a straight arc [m].
CAR, WIDER, TIGHT, STRAIGHT = ((3.6, 0.9), (-0.9, 0.9), (-0.9, -0.9), (3.6, -0.9)), 0.3, 5.0, 1.5
#: Wheelbase, half the track, and length and width of a wheel of that car [m].
WHEELBASE, HALF_TRACK, WHEEL = 2.7, 0.62, (0.6, 0.2)


class Query(NamedTuple):
    """A query of the clearance on the way along a curve.

    Attributes:
        point: (x, y) [m].
        clearance: the exact clearance [m], or a lower bound of it where that suffices.
        is_exact: True if the bound of the raster did not suffice.
    """

    point: tuple[float, float]
    clearance: float
    is_exact: bool


def six_words() -> Figure:
    """Draw the curve of each word between the same two poses."""
    curves = candidates(FROM, TO, 1.0)
    best = min(curves.values(), key=lambda curve: curve.length)
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    for axes, (word, curve) in zip(figure.subplots(2, 3, sharex=True, sharey=True).flat, curves.items(), strict=True):
        is_best = curve is best
        axes.set_title(f"{word}  {curve.length:.2f} m" + (", shortest" if is_best else ""), fontsize=TITLE,
                       weight="bold" if is_best else "normal", color=PATH if is_best else OBSTACLE)
        _draw_word(axes, curve, PATH if is_best else OBSTACLE)
        axes.set(aspect="equal")
        axes.axis("off")
    ends = (Line2D([], [], color=colour, linewidth=3, label=name) for name, colour in (("start", START), ("goal", GOAL)))
    _add_legend(figure, [*ends, Line2D([], [], color=UNKNOWN, linestyle="--", label="circle of the turning radius")])
    return figure


def _add_legend(figure: Figure, handles: list[Artist]) -> None:
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=LABEL, frameon=False,
                  handletextpad=0.4, columnspacing=1.2)


def _draw_word(axes: Axes, curve: DubinsCurve, colour: str) -> None:
    """Draw a curve, the circles of its turns, and their letters."""
    for turn, begin, length in zip(curve.word, accumulate(curve.lengths, initial=0.0), curve.lengths, strict=False):
        side = SIDES[turn]
        if side:
            axes.add_patch(Circle(_left_of(curve.pose_at(begin), side * curve.radius), curve.radius, fill=False, color=UNKNOWN,
                                  linewidth=1, linestyle="--"))
        axes.text(*_left_of(curve.pose_at(begin + length / 2), -0.3 * (side or 1)), turn, fontsize=LABEL, weight="bold",
                  color=colour, ha="center", va="center")
    poses = curve.poses(SPACING)
    axes.plot(poses[:, 0], poses[:, 1], color=colour, linewidth=2.6, solid_capstyle="round")
    joints = np.array([curve.pose_at(s) for s in accumulate(curve.lengths[:2])])
    axes.plot(joints[:, 0], joints[:, 1], "o", color=colour, markerfacecolor=FREE, markersize=5)
    # The one ends where the curve begins, so that neither hides it.
    _draw_arrow(axes, _ahead(curve.start, -0.9), curve.start[:2], START)
    _draw_arrow(axes, curve.end[:2], _ahead(curve.end, 0.9), GOAL)


def _left_of(pose: Pose, distance: float) -> tuple[float, float]:
    """Return the point at a distance to the left of a pose."""
    x, y, theta = pose
    return x - distance * math.sin(theta), y + distance * math.cos(theta)


def _ahead(pose: Pose, distance: float) -> tuple[float, float]:
    """Return the point at a distance ahead of a pose."""
    x, y, theta = pose
    return x + distance * math.cos(theta), y + distance * math.sin(theta)


def _draw_arrow(axes: Axes, tail: tuple[float, float], tip: tuple[float, float], colour: str) -> None:
    axes.annotate("", tip, tail, zorder=5, arrowprops={"color": colour, "width": 2, "headwidth": 8, "headlength": 8, "shrink": 0})


def collision_walk() -> Figure:
    """Draw conservative advancement along a curve."""
    # On a grid whose cells are large enough to see: few looks on polygons need the exact distance.
    queries = advance(ClearanceField(rasterise(ROOM, 0.1)), CURVE, DISC.robot_radius)
    exact = sum(query.is_exact for query in queries)
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    axes = figure.add_subplot()
    frame(axes, ROOM)
    axes.set_title(f"{len(queries)} looks find {CURVE.length:.1f} m of curve free; {exact} need the exact distance",
                   fontsize=TITLE, weight="bold", loc="left")
    for is_exact, colour in ((False, GOAL), (True, FAILURE)):
        _draw_queries(axes, [query for query in queries if query.is_exact == is_exact], colour)
    draw_on(axes, Drawing(ROOM, CURVE.start, CURVE.end, DISC, np.empty((0, 2, 2)), CURVE.poses(SPACING), "", ""))
    discs: dict[str, Any] = {"marker": "o", "markersize": 13, "linestyle": "none"}
    _add_legend(figure, [Line2D([], [], color=PATH, linewidth=2.2, label="curve"),
                         Patch(facecolor=PATH, alpha=0.3, label="vehicle"),
                         Line2D([], [], color=GOAL, markerfacecolor=TREE, **discs, label="bound from the raster"),
                         Line2D([], [], color=FAILURE, markerfacecolor=FREE, **discs, label="exact distance")])
    return figure


def _draw_queries(axes: Axes, queries: list[Query], colour: str) -> None:
    """Draw the discs that hold no obstacle, under the path, and their centres on it."""
    for query in queries:
        _draw_disc(axes, query.point, query.clearance, colour)
    x, y = np.transpose([query.point for query in queries])
    axes.plot(x, y, "o", color=colour, markeredgecolor=FREE, markersize=6, zorder=5)


def _draw_disc(axes: Axes, middle: tuple[float, float], radius: float, colour: str) -> None:
    axes.add_patch(Circle(middle, radius, facecolor=to_rgba(colour, 0.12), edgecolor=colour, linewidth=1.2, zorder=2))


def advance(field: ClearanceField, curve: DubinsCurve, required_clearance: float) -> list[Query]:
    """List the queries of the conservative advancement in `planning/_kernels/clearance.py` along a curve.

    It ends with a query that finds less than the required clearance [m] and the margin, or at the end of the curve.
    """
    queries: list[Query] = []
    s = 0.0
    while s <= curve.length:
        queries.append(_query(field, curve.pose_at(s), required_clearance))
        if queries[-1].clearance < required_clearance + CLEARANCE_MARGIN:
            return queries
        s += queries[-1].clearance - required_clearance + CLEARANCE_MARGIN / 2
    return [*queries, _query(field, curve.end, required_clearance)]


def _query(field: ClearanceField, pose: Pose, required_clearance: float) -> Query:
    point = np.array(pose[:2])
    bound = float(np.asarray(field.kernel.field)[field.cells(point)])
    is_exact = bound < required_clearance + CLEARANCE_MARGIN + field.kernel.resolution
    return Query(pose[:2], float(field.at(point)) if is_exact else bound, is_exact)


def footprint_cover() -> Figure:
    """Draw the collision checks of a car: approximate and exact, in a turn and straight on."""
    figure = Figure(figsize=(WIDTH, 4.0), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True).flat
    for axes, draw in zip(panels, (_draw_discs, _draw_wider, _draw_turn, _draw_sweep), strict=True):
        axes.set_title(draw(axes), fontsize=LABEL, weight="bold", loc="left")
        axes.set(aspect="equal", xlim=(-1.5, 5.3), ylim=(-1.5, 1.7))
        axes.axis("off")
        _draw_shape(axes, CAR, PATH)
        axes.plot(0, 0, "o", color=PATH, markersize=6, zorder=4)
    return figure


def _draw_discs(axes: Axes) -> str:
    """Draw the discs that cover the car."""
    found = cover(CAR)
    for x, y, radius, _ in found.discs:
        _draw_disc(axes, (x, y), radius, GOAL)
    return f"{len(found.discs)} discs, {100 * found.excess:.0f} cm beyond it"


def _draw_wider(axes: Axes) -> str:
    """Draw the car with a margin around it."""
    corners = cover(CAR).corners
    _draw_shape(axes, corners[:, :2] + WIDER * corners[:, 2:], GOAL)
    return f"{100 * WIDER:.0f} cm wider, corners cut off"


def _draw_turn(axes: Axes) -> str:
    """Draw the motion of its corners per metre of the reference point."""
    moves = [(1 - y / TIGHT, x / TIGHT) for x, y in CAR]
    for (x, y), (along, across) in zip(CAR, moves, strict=True):
        _draw_arrow(axes, (x, y), (x + along, y + across), GOAL)
    return f"turning: at most {max(math.hypot(*move) for move in moves):.2f} m per metre"


def _draw_sweep(axes: Axes) -> str:
    """Draw the area that it sweeps on a straight arc."""
    last = [(x + STRAIGHT, y) for x, y in CAR]
    _draw_shape(axes, shapely.get_coordinates(shapely.MultiPoint([*CAR, *last]).convex_hull), GOAL)
    return "straight on: all at once"


def _draw_shape(axes: Axes, corners: ArrayLike, colour: str) -> None:
    axes.add_patch(Polygon(corners, facecolor=to_rgba(colour, 0.2), edgecolor=colour, linewidth=1.8, zorder=3))


def reference_point() -> Figure:
    """Draw a car that turns left as tightly as it can, with its reference point and what is measured from there."""
    figure = Figure(figsize=(WIDTH, 5.4), layout="constrained")
    axes = figure.subplots()
    axes.set(aspect="equal", xlim=(-3.6, 6.0), ylim=(-1.5, 5.3))
    axes.axis("off")
    _draw_shape(axes, CAR, PATH)
    for x in (0.0, WHEELBASE):
        for y in (-HALF_TRACK, HALF_TRACK):
            # Each front wheel stands at right angles to the line to the centre of the turn.
            _draw_wheel(axes, x, y, math.atan2(x, TIGHT - y))
    for x, y in ((0.0, 0.0), (WHEELBASE, 0.0)):
        axes.plot((x, 0), (y, TIGHT), color=UNKNOWN, linewidth=1.2, linestyle="--")
    axes.plot((0, WHEELBASE), (0, 0), color=PATH, linewidth=1.2)
    circle = np.linspace(-0.45, 0.75, 60)
    axes.plot(TIGHT * np.sin(circle), TIGHT * (1 - np.cos(circle)), color=GOAL, linewidth=2.2, zorder=4)
    _draw_arrow(axes, (0, 0), (1.7, 0), START)
    axes.plot(0, 0, "o", color=START, markersize=8, zorder=6)
    axes.plot(0, TIGHT, "+", color=OBSTACLE, markersize=12, markeredgewidth=2)
    for place, text, side in (
            ((-0.15, TIGHT / 2), "R", "right"), ((0.18, TIGHT - 1.1), "φ", "left"), ((WHEELBASE - 0.55, -0.25), "L", "center"),
            ((0.3, TIGHT - 0.05), "centre of the turn: R = L / tan φ", "left"), ((3.5, 1.75), "path", "left"),
            ((3.7, 0.95), "corner (3.6, 0.9)", "left"), ((-1.0, -0.95), "corner (-0.9, -0.9)", "right"),
            ((0.0, -1.25), "reference point (0, 0): the middle of the rear axle", "left")):
        axes.text(*place, text, fontsize=LABEL, ha=side, va="center", zorder=6)
    return figure


def _draw_wheel(axes: Axes, x: float, y: float, angle: float) -> None:
    length, width = WHEEL
    corners = np.array([(length, width), (-length, width), (-length, -width), (length, -width)]) / 2
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    axes.add_patch(Polygon(corners @ turn + (x, y), color=OBSTACLE, zorder=4))


def proof_curve() -> Figure:
    """Draw a turn, a straight line and a turn with the vectors of the proof of its length."""
    curve = shortest((0.0, 0.0, math.radians(100)), (6.0, 0.6, math.radians(-70)), 1.0)
    poses = curve.poses(SPACING / 4)
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = figure.add_subplot()
    axes.set(aspect="equal")
    axes.axis("off")
    side = [SIDES[letter] for letter in (curve.word[0], curve.word[2])]
    centres = [(x - turn * math.sin(theta), y + turn * math.cos(theta))
               for turn, (x, y, theta) in zip(side, (curve.start, curve.end), strict=True)]
    for centre in centres:
        axes.add_patch(Circle(centre, 1.0, fill=False, linestyle=":", edgecolor=OBSTACLE))
    axes.plot(poses[:, 0], poses[:, 1], color=PATH, linewidth=2.6)
    phi = curve.pose_at(curve.lengths[0])[2]
    x, y, _ = curve.pose_at(curve.lengths[0] + curve.lengths[1] / 2)
    for angle, name, colour in ((phi, "e(\u03c6)", PATH), (phi - 0.35, "e(\u03c8)", FAILURE)):
        _arrow(axes, (x, y), (x + 1.2 * math.cos(angle), y + 1.2 * math.sin(angle)), name, colour)
    _arrow(axes, centres[0], centres[1], "V", GOAL)
    for name, (px, py, _) in (("p", curve.start), ("q", curve.end)):
        axes.plot(px, py, "o", color=START)
        axes.annotate(name, (px, py), xytext=(-14, -4), textcoords="offset points", fontsize=LABEL)
    axes.autoscale_view()
    return figure


def _arrow(axes: Axes, tail: tuple[float, float], head: tuple[float, float], name: str, colour: str) -> None:
    axes.annotate("", head, xytext=tail, arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.8})
    axes.annotate(name, ((tail[0] + 2 * head[0]) / 3, (tail[1] + 2 * head[1]) / 3), xytext=(4, 6), textcoords="offset points",
                  color=colour, fontsize=LABEL)


FIGURES: dict[str, Callable[[], Figure]] = {figure.__name__: figure for figure in (
    six_words, collision_walk, footprint_cover, reference_point, proof_curve)}
