"""Boxes without room: none is left out that a free path crosses."""

import math

import numpy as np
import pytest
import shapely
from support.cases import random_map, scaled

from dubins_rrt_ros.planning import ClearanceField, PolygonMap
from dubins_rrt_ros.planning.proof.box_room import LOOKS, BoxRoom, look_ahead


def random_path(rng, poses, arc_length, steps=28):
    """Positions after (n, steps) arc lengths of random curves of radius 1 from (n, 3) poses, most of them with few switches."""
    switches = np.sort(rng.uniform(0, arc_length, (len(poses), 2)), axis=1)
    at = np.linspace(0, arc_length, steps + 1)
    middles = (at[1:] + at[:-1]) / 2
    piece = (middles > switches[:, :1]).astype(int) + (middles > switches[:, 1:])
    curvatures = np.take_along_axis(rng.choice([-1, 0, 1, 0.3], (len(poses), 3)), piece, axis=1)
    headings = poses[:, 2:] + np.cumsum(curvatures, axis=1) * np.diff(at)
    middle_headings = headings - curvatures * np.diff(at) / 2
    chords = np.diff(at) * np.sinc(curvatures * np.diff(at) / math.tau)  # 2 sin(k s / 2) / k
    steps_taken = chords[..., None] * np.stack([np.cos(middle_headings), np.sin(middle_headings)], axis=2)
    return poses[:, None, :2] + np.cumsum(steps_taken, axis=1)


@pytest.mark.parametrize(("arc_length", "count"), LOOKS)
def test_paths_are_in_the_discs_ahead(arc_length, count):
    look, rng = look_ahead(arc_length, count), np.random.default_rng(1)
    ends = random_path(rng, np.zeros((20000, 3)), arc_length)[:, -1]
    distances = np.hypot(ends[:, :1] - look.x, ends[:, 1:] - look.y)
    assert (distances <= look.radii).any(axis=1).all()


def test_ends_of_boxes_are_moved_to_where_there_is_room():
    field = ClearanceField(PolygonMap(shapely.box(0, 0, 4, 4)))
    boxes = np.array([[1.0, 2.0, 1.0, 0.0, 0.9, 0.0, 0.0, 1.0], [0.1, 2.0, 0.0, 1.0, 0.5, 0.0, 0.0, 1.0]])
    trimmed = BoxRoom(field, 0.3, 1.0).trim(boxes)
    assert trimmed[0, :5] == pytest.approx([1.1, 2.0, 1.0, 0.0, 0.8])
    assert trimmed[1, 4] < 0 and boxes[0, 4] == 0.9


def test_trimmed_boxes_hold_all_places_with_room():
    rng = np.random.default_rng(2)
    for _ in range(scaled(30, least=3)):
        field, required = ClearanceField(random_map(rng)), rng.uniform(0.05, 0.4)
        boxes = random_boxes(rng, 200)
        trimmed = BoxRoom(field, required, 1.0).trim(boxes)
        shares = rng.uniform(-1, 1, len(boxes))
        points = boxes[:, :2] + (shares * boxes[:, 4])[:, None] * boxes[:, 2:4]
        along = np.sum((points - trimmed[:, :2]) * boxes[:, 2:4], axis=1)
        assert (np.abs(along) <= trimmed[:, 4] + 1e-9)[field.at(points) >= required].all()


def test_no_box_that_a_free_path_crosses_is_left_out():
    rng, left_out = np.random.default_rng(3), 0
    for _ in range(scaled(40, least=3)):
        field, required, radius = ClearanceField(random_map(rng)), rng.uniform(0.05, 0.4), rng.uniform(0.3, 1.5)
        boxes = random_boxes(rng, 300)
        may = BoxRoom(field, required, radius).may_be_crossed(boxes, 9.0, np.full(300, 9.0))
        shares = rng.uniform(-1, 1, (2, len(boxes)))
        poses = np.column_stack([(boxes[:, :2] + (shares[0] * boxes[:, 4])[:, None] * boxes[:, 2:4]) / radius,
                                 boxes[:, 6] + shares[1] * boxes[:, 7]])
        ahead = random_path(rng, poses, 1.4)
        behind = random_path(rng, poses + np.array([0, 0, math.pi]), 1.4)
        is_free = (field.at(radius * np.concatenate([ahead, behind], axis=1)) >= required).all(axis=1)
        assert may[is_free].all()
        left_out += np.count_nonzero(~may & (field.at(boxes[:, :2]) >= required))
    assert left_out > 0


def test_where_paths_may_begin_or_end_nothing_is_asked_of_the_room_beyond():
    field = ClearanceField(PolygonMap(shapely.box(0, 0, 4, 4)))
    box = np.array([[3.5, 2.0, 0.0, 1.0, 0.01, 0.0, 0.0, 0.01]])
    room = BoxRoom(field, 0.3, 1.0)
    assert not room.may_be_crossed(box, 9.0, np.array([9.0]))[0]
    assert room.may_be_crossed(box, 9.0, np.array([0.2]))[0]
    box[0, 6] = math.pi
    assert not room.may_be_crossed(box, 9.0, np.array([9.0]))[0]
    assert room.may_be_crossed(box, 0.2, np.array([9.0]))[0]


def random_boxes(rng, count):
    """Boxes of random sizes."""
    direction = rng.uniform(-math.pi, math.pi, count)
    return np.column_stack([rng.uniform(0, 10, (count, 2)), np.cos(direction), np.sin(direction), rng.uniform(0, 0.3, count),
                            np.zeros(count), rng.uniform(-math.pi, math.pi, count), rng.uniform(0, 0.3, count)])
