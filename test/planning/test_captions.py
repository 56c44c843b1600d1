"""What pictures say in words: titles, legends, and what is drawn where any heading will do."""

import math

import pytest
from support.cases import empty_map, needs_compiled

from dubins_rrt_ros.planning import Problem, Settings, Vehicle, plan, plan_through
from dubins_rrt_ros.planning.pictures import drawing
from dubins_rrt_ros.planning.pictures.animation import _DriveScreen

#: What is written of a path does not depend on the kernels that found it.
pytestmark = needs_compiled

QUICK = {"samples": 20, "planning_time": 60.0, "seed": 1}


def answer(waypoints=(), any_goal_heading=False, goal=(8.0, 3.0, 0.0), **settings):
    problem = Problem(empty_map(), Vehicle(), (-8.0, 0.0, 0.0), goal, any_goal_heading=any_goal_heading)
    how = Settings(**QUICK, **settings)
    return plan_through(problem, waypoints, how) if waypoints else plan(problem, how)


def legend(result):
    figure, _ = drawing._canvas(drawing.of_plan(result))
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_gaps_of_length_and_cost_are_named_apart():
    result = answer(preferred_clearance=9.0)
    contents = drawing.of_plan(result)
    assert result.cost_gap > result.gap
    assert contents.title == f"RRT*: {result.length:.2f} m, at most {100 * result.gap:.1f} % above the shortest"
    of_cost = f"at most {100 * result.cost_gap:.1f} % above the least possible"
    assert of_cost in result.message and contents.subtitle.startswith(f"cost {result.cost:.2f} m, {of_cost}; ")


def test_where_the_length_is_minimised_a_picture_has_one_gap():
    contents = drawing.of_plan(answer(preferred_clearance=0.0))
    assert "%" in contents.title and "%" not in contents.subtitle


def test_over_waypoints_the_title_has_the_gap_of_the_length_too():
    result = answer([(0.0, 4.0)], preferred_clearance=9.0)
    contents = drawing.of_plan(result)
    assert contents.title.endswith(f" m over 1 waypoint, gap at most {100 * result.gap:.1f} %")
    assert f"cost {result.cost:.2f} m, at most {100 * result.cost_gap:.1f} % above the least possible; " in contents.subtitle


def test_a_picture_in_a_file_explains_its_colours():
    paths = ["path without room", "path with preferred room"]
    assert legend(answer()) == ["free", "obstacle", "tree", *paths, "swept by the vehicle"]
    assert legend(answer(preferred_clearance=0.0)) == ["free", "obstacle", "tree", "path", "swept by the vehicle"]
    assert legend(answer(goal=(9.95, 3.0, 0.0))) == ["free", "obstacle", "why there is no path"]


def test_where_any_heading_will_do_the_goal_is_drawn_as_it_is_reached():
    result = answer(any_goal_heading=True, goal=(8.0, 3.0, math.pi))
    reached = drawing.of_plan(result).goal
    assert reached == (8.0, 3.0, result.path.end[2]) and abs(reached[2]) < 1.0
    assert drawing.of_plan(answer(goal=(8.0, 3.0, math.pi))).goal == (8.0, 3.0, math.pi)


def test_the_length_that_is_driven_is_that_of_the_path():
    result = answer(goal=(-8.0, 1.0, math.pi))
    assert _DriveScreen(result).driven[-1] == pytest.approx(result.length, abs=1e-9)


def test_a_name_of_a_file_is_no_axes():
    result = answer()
    for shown in (result, result.tree, result.problem.map):
        with pytest.raises(TypeError, match=r"not on 'tree.png'; plot\(\).figure.savefig"):
            shown.plot("tree.png")


def test_a_tree_is_told_in_a_few_words():
    result = answer()
    assert repr(result.tree) == f"Tree({len(result.tree)} nodes, radius=1)"
