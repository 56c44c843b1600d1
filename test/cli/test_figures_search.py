"""The figures of the search show what they say: the trees of one seed, bounds that bound, and paths that become shorter."""

import re
from functools import cache

import numpy as np
import pytest
import shapely
from support.cases import needs_compiled

from dubins_rrt_ros.evaluation.figures import search as figures_search
from dubins_rrt_ros.planning import ClearanceField, Settings, plan
from dubins_rrt_ros.planning.pictures.drawing import PATH

pytestmark = needs_compiled  # interpreted, they take minutes


@cache
def plans():
    return figures_search.first_and_final()


def lines_of(axes, colour):
    """(n, 2) points of each line of a colour."""
    return [line.get_xydata() for line in axes.lines if line.get_color() == colour]


def lengths_in(text):
    return [float(length) for length in re.findall(r"[\d.]+(?= m)", text)]


def test_rrt_and_rrt_star_are_drawn_with_the_same_samples_and_their_own_lengths():
    titles, notes = [], []
    figure = figures_search.rrt_and_rrt_star()
    for axes in figure.axes:
        titles.append(axes.get_title(loc="left"))
        notes.append(re.findall(r"\d+", axes.texts[0].get_text()))
        path, = lines_of(axes, PATH)
        drawn = np.hypot(*np.diff(path, axis=0).T).sum()
        assert lengths_in(titles[-1]) == pytest.approx([drawn], rel=0.005)
        assert path[[0, -1]] == pytest.approx(np.array([[1.5, 2.0], [13.5, 10.5]]))
    assert [title.split(":")[0] for title in titles] == ["RRT", "RRT*"]
    assert lengths_in(titles[1]) < lengths_in(titles[0])
    assert notes[0][0] == notes[1][0] and int(notes[0][1]) < int(notes[1][1])


def test_in_two_pictures_side_by_side_no_name_is_written_over_a_wall_and_nothing_is_cut_off():
    figure = figures_search.rrt_and_rrt_star()
    figure.draw_without_rendering()
    box = figure.get_tightbbox()
    assert (box.min >= 0).all() and (box.max <= figure.get_size_inches()).all()
    maze = figures_search.problem_in(figures_search.MAZE).map
    for axes in figure.axes:
        for name in (text for text in axes.texts if text.get_text() in ("start", "goal")):
            (x0, y0), (x1, y1) = axes.transData.inverted().transform(name.get_window_extent())
            assert maze.free.covers(shapely.box(x0, y0, x1, y1)), name.get_text()


def test_the_informed_search_is_drawn_with_its_first_path_its_final_one_and_its_tree_within_the_bounds():
    first, final = plans()
    bounds = figures_search.bounds_of(final.problem)
    axes, = figures_search.informed_search().axes
    assert first.samples == 0 and final.samples == final.settings.samples
    assert lengths_in(axes.get_title(loc="left")) == pytest.approx([first.length, final.length], abs=0.005)
    drawn = {colour: line for colour in (figures_search.FIRST, PATH) for line in lines_of(axes, colour)}
    for colour, answer in ((figures_search.FIRST, first), (PATH, final)):
        assert drawn[colour] == pytest.approx(answer.path.poses(figures_search.SPACING)[:, :2])
    tree = np.concatenate([path.vertices for path in axes.collections[0].get_paths()]).reshape(-1, 2, 2)  # segments
    # But for what hybrid A* drove before its path was smoothed.
    assert len(tree) > 100 and (bounds.over(tree.mean(axis=1)) < first.length).mean() > 0.9


def test_the_bounds_that_are_drawn_bound_both_paths():
    """What is left of a path is no shorter than the cost-to-go, and the path is no shorter than what leads over its places."""
    for answer in plans():
        bounds = figures_search.bounds_of(answer.problem)
        poses = answer.path.poses(0.01)
        gone = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])  # chords: never longer
        assert (bounds.to_goal.at(poses[:, :2].copy()) <= answer.length - gone + 1e-9).all()
        assert (bounds.over(poses[:, :2].copy()) <= answer.length + 1e-9).all()
    assert bounds.least <= answer.lower_bound <= answer.length
    unproved = plan(answer.problem, Settings(samples=1, seed=1, length_proof=False))
    assert bounds.least == pytest.approx(unproved.lower_bound)


def test_the_cost_to_go_is_drawn_where_the_vehicle_fits_in_the_colours_of_its_bar():
    problem = plans()[1].problem
    axes, = (axes for axes in figures_search.bounds().axes if axes.images)
    image, = axes.images
    left, right, low, high = image.get_extent()
    rows, columns = image.get_array().shape
    assert (left, right, low, high) == pytest.approx((0, 15, 0, 12))
    x, y = np.meshgrid(left + (np.arange(columns) + 0.5) * right / columns, low + (np.arange(rows) + 0.5) * high / rows)
    clearance = ClearanceField(problem.map).at(np.stack([x, y], axis=-1))
    hidden = np.ma.getmaskarray(image.get_array())
    assert not hidden[clearance >= problem.vehicle.robot_radius].any() and hidden[clearance == 0].all()
    straight = np.hypot(x - problem.goal[0], y - problem.goal[1])
    assert (image.get_array() >= 0.95 * straight - 0.3).all() and image.get_array().max() > 1.2 * straight.max()


@pytest.mark.slow
def test_more_samples_never_make_a_path_longer(monkeypatch):
    monkeypatch.setattr(figures_search, "SEEDS", range(2))
    axes, = figures_search.convergence().axes
    curves = {line.get_label(): line.get_xydata() for line in axes.lines if line.get_label() in figures_search.COMPARED}
    assert list(curves) == list(figures_search.COMPARED)
    assert all((np.diff(curve[:, 1]) <= 1e-9).all() and curve[-1, 0] == 3000 for curve in curves.values())
    plain, informed, shortened = (curve[-1, 1] for curve in curves.values())
    assert plain > informed > shortened > 0
