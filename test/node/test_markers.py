"""A plan as markers, through the wire format."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from visualization_msgs.msg import Marker

from dubins_rrt_ros.node.markers import tree_markers

STAMP = Time(sec=12, nanosec=34)


@pytest.fixture
def markers(plans, over_the_wire):
    return over_the_wire(tree_markers(plans["solved"], "map", STAMP)).markers


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
    # Turns are drawn by short chords, which are at most 0.2 % shorter, and straight arcs as they are.
    drawn, driven = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum(), plan.tree.lengths.sum()
    assert 0.998 * driven < drawn <= driven
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
    assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(plans["solved"].length, rel=1e-3)


def test_without_a_path_start_and_goal_are_shown_and_no_empty_lines(plans, over_the_wire):
    shown = by_namespace(over_the_wire(tree_markers(plans["blocked"], "map", STAMP)).markers)
    assert {"start", "goal"} <= set(shown)
    assert "path" not in shown
    assert all(marker.points for marker in shown.values() if marker.type != Marker.ARROW)


def test_without_a_plan_everything_is_cleared(over_the_wire):
    markers = over_the_wire(tree_markers(None, "map", STAMP)).markers
    assert [marker.action for marker in markers] == [Marker.DELETEALL]
