"""A plan as markers, through the wire format."""

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from visualization_msgs.msg import Marker

from dubins_rrt_ros.node.markers import tree_markers

STAMP = Time(sec=12, nanosec=34)
MANY = 50_000
#: Turns are drawn by chords of 0.3 radii, which are sin(0.15) / 0.15 as long as their arcs.
LEAST_DRAWN = 0.996


@pytest.fixture
def markers(plans, over_the_wire):
    return over_the_wire(tree_markers(plans["solved"], "map", STAMP, MANY)).markers


def by_namespace(markers):
    return {marker.ns: marker for marker in markers if marker.action == Marker.ADD}


def xy(marker):
    return np.array([(point.x, point.y) for point in marker.points])


def test_what_was_shown_before_is_cleared_first(markers):
    assert markers[0].action == Marker.DELETEALL
    assert all(marker.action == Marker.ADD for marker in markers[1:])


def test_each_part_is_one_marker_in_the_frame(markers):
    shown = by_namespace(markers)
    assert {name: marker.type for name, marker in shown.items()} == {
        "tree": Marker.LINE_LIST, "start": Marker.ARROW, "goal": Marker.ARROW, "path": Marker.LINE_STRIP}
    assert len(markers) == 5
    assert {(marker.header.frame_id, marker.header.stamp.sec) for marker in markers} == {("map", 12)}
    assert all(marker.color.a > 0 and marker.scale.x > 0 for marker in shown.values())


def test_the_tree_is_drawn_as_the_true_curves_of_its_edges(markers, plans):
    plan = plans["solved"]
    lines = xy(by_namespace(markers)["tree"]).reshape(-1, 2, 2)
    drawn, driven = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum(), plan.tree.lengths.sum()
    assert LEAST_DRAWN * driven < drawn <= driven
    ends = lines.reshape(-1, 2)
    for node in plan.tree.poses:
        assert np.linalg.norm(ends - node[:2], axis=1).min() < 1e-9


def test_start_and_goal_are_arrows_where_they_were_asked_for(markers):
    shown = by_namespace(markers)
    for name, (x, y, yaw) in {"start": (1.5, 5.0, 0.0), "goal": (8.5, 5.0, 0.5)}.items():
        pose = shown[name].pose
        assert (pose.position.x, pose.position.y) == (x, y)
        assert 2 * math.atan2(pose.orientation.z, pose.orientation.w) == pytest.approx(yaw, abs=1e-12)


def test_the_path_is_drawn_from_start_to_goal(markers, plans):
    line = xy(by_namespace(markers)["path"])
    assert line[0].tolist() == [1.5, 5.0]
    assert line[-1].tolist() == [8.5, 5.0]
    assert LEAST_DRAWN * plans["solved"].length < np.linalg.norm(np.diff(line, axis=0), axis=1).sum() <= plans["solved"].length


def test_without_a_path_start_and_goal_are_shown_and_no_empty_lines(plans, over_the_wire):
    shown = by_namespace(over_the_wire(tree_markers(plans["blocked"], "map", STAMP, MANY)).markers)
    assert {"start", "goal"} <= set(shown)
    assert "path" not in shown
    assert all(marker.points for marker in shown.values() if marker.type in (Marker.LINE_LIST, Marker.LINE_STRIP))


@pytest.mark.parametrize("most", [1, 7, 100])
def test_of_a_large_tree_the_lines_of_its_oldest_nodes_are_shown(plans, over_the_wire, markers, most):
    shown = by_namespace(over_the_wire(tree_markers(plans["solved"], "map", STAMP, most)).markers)
    assert xy(shown["tree"]).tolist() == xy(by_namespace(markers)["tree"])[:2 * most].tolist()
    assert shown["path"] == by_namespace(markers)["path"]


def test_where_it_failed_is_a_disc_in_sight(plans, over_the_wire):
    plan = replace(plans["blocked"], location=(4.25, 6.5))
    culprit = by_namespace(over_the_wire(tree_markers(plan, "map", STAMP, MANY)).markers)["culprit"]
    assert culprit.type == Marker.CYLINDER
    assert (culprit.pose.position.x, culprit.pose.position.y) == (4.25, 6.5)
    assert culprit.pose.orientation.w == 1.0
    assert culprit.color.a > 0 and min(culprit.scale.x, culprit.scale.y, culprit.scale.z) > 0


def test_without_a_culprit_none_is_shown(markers):
    assert "culprit" not in by_namespace(markers)


def test_without_a_plan_everything_is_cleared(over_the_wire):
    markers = over_the_wire(tree_markers(None, "map", STAMP, MANY)).markers
    assert [marker.action for marker in markers] == [Marker.DELETEALL]
