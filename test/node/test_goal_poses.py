"""Waypoints by the topic goal_poses, through the executable."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from geometry_msgs.msg import PoseArray, Quaternion
from support.harness import poses_of, stamped, values_of
from support.walls import FREE, publish, walled
from support.yard import GOAL, START

QUICK = {"samples": 300, "planning_time": 5.0, "seed": 1}
FIRST, SECOND = (4.0, 8.0, 0.0), (6.0, 2.0, -1.0)


@pytest.fixture
def drive(planners):
    def begin(cells=FREE, **parameters):
        process = planners.start(**QUICK | parameters)
        client = planners.client()
        publish(client, process, cells)
        client.send("start_pose", START)
        topic = client.node.create_publisher(PoseArray, "goal_poses", 1)
        client.wait_for(topic.get_subscription_count, "the planner to subscribe")
        return client, topic, process
    return begin


def over(*poses):
    """A message of (x, y, yaw), or (x, y) for any heading."""
    message = PoseArray()
    message.header.frame_id = "map"
    for pose in poses:
        placed = stamped((*pose[:2], pose[2] if len(pose) > 2 else 0.0)).pose
        if len(pose) == 2:
            placed.orientation = Quaternion(w=0.0)
        message.poses.append(placed)
    return message


def distance_to(path, pose):
    """How near a path comes to a pose [m, and the half of the difference in heading]."""
    poses = poses_of(path)
    off = np.hypot(poses[:, 0] - pose[0], poses[:, 1] - pose[1])
    if len(pose) > 2:
        off += np.abs(np.sin((poses[:, 2] - pose[2]) / 2))
    return off.min()


def shown(client, plan_id, **wanted):
    client.status_of(plan_id, **wanted)
    return client.wait_for(lambda: client.paths and client.paths[-1].poses and client.paths[-1], "the path")


@pytest.mark.parametrize("waypoints", [(FIRST, SECOND), (FIRST[:2], SECOND[:2])], ids=["headings given", "any heading"])
def test_the_path_passes_the_waypoints_in_order_and_ends_at_the_last_pose(drive, waypoints):
    client, topic, _ = drive()
    topic.publish(over(*waypoints, GOAL))
    path = shown(client, 1, error_name="NONE")
    assert poses_of(path)[0] == pytest.approx(START, abs=1e-9)
    assert poses_of(path)[-1] == pytest.approx(GOAL, abs=1e-9)
    for waypoint in waypoints:
        assert distance_to(path, waypoint) < 1e-6
    assert len({values_of(status)["plan_id"] for status in client.statuses} - {"0"}) == 1


def test_a_waypoint_that_cannot_be_passed_is_named(drive):
    client, topic, _ = drive(walled(np.s_[78:83, 38:43]))
    topic.publish(over(FIRST, GOAL))
    told = client.status_of(1)
    assert told["error_name"] != "NONE" and "aypoint 1" in told["message"]


def test_no_poses_are_refused_and_one_is_a_goal(drive):
    client, topic, _ = drive()
    topic.publish(over())
    assert "goal_poses" in client.status_of(1, error_name="INVALID_POSE")["message"]
    topic.publish(over(GOAL))
    assert poses_of(shown(client, 2, error_name="NONE"))[-1] == pytest.approx(GOAL, abs=1e-9)


def nearest(poses, place):
    """The index of the pose that is nearest to a place."""
    return int(np.argmin(np.hypot(*(poses[:, :2] - place[:2]).T)))


def drive_past(client, poses, place):
    """Send starts along a path until a place is passed; the index of the last one."""
    beyond = nearest(poses, place) + 10
    for pose in [*poses[:beyond:3].tolist(), poses[beyond].tolist()]:
        client.send("start_pose", tuple(pose))
        client.spin_once()
    return beyond


def planned_again_around(client, process, place, *walls):
    """The path by which the one on display is replaced, once a new map has a wall there."""
    before, row, column = client.paths[-1], int(place[1] * 10), int(place[0] * 10)
    publish(client, process, walled(np.s_[row - 1:row + 2, column - 1:column + 2], *walls))
    client.status_of(2, error_name="NONE")
    return client.wait_for(lambda: client.paths[-1] is not before and client.paths[-1].poses and client.paths[-1], "another path")


def test_a_waypoint_that_was_passed_is_left_out_when_it_is_planned_again(drive):
    client, topic, process = drive(replan_on_map_change=True)
    topic.publish(over(FIRST, GOAL))
    client.wait_for_word("over 1 waypoint")
    poses = poses_of(shown(client, 1, error_name="NONE"))
    beyond = drive_past(client, poses, FIRST)
    again = planned_again_around(client, process, poses[(beyond + len(poses)) // 2])
    assert distance_to(again, FIRST[:2]) > 0.3
    assert math.dist(poses_of(again)[-1, :2], GOAL[:2]) < 1e-9


@pytest.mark.slow
def test_a_waypoint_that_was_passed_while_a_better_path_was_sought_does_not_count_for_the_next(drive):
    box = np.s_[42:58, 46:54]  # without which the first path is proved to be the shortest, and none is sought
    client, topic, process = drive(walled(box), replan_on_map_change=True, samples=10_000_000, planning_time=3.0)
    topic.publish(over(FIRST, SECOND, GOAL))
    path = shown(client, 1, error_name="NONE")
    drive_past(client, poses_of(path), FIRST)
    assert "over 2 waypoints" not in process.output
    client.wait_for_word("over 2 waypoints")
    poses = poses_of(client.wait_for(lambda: client.paths[-1] is not path and client.paths[-1], "the last path"))
    again = planned_again_around(client, process, poses[(nearest(poses, FIRST) + nearest(poses, SECOND)) // 2], box)
    assert distance_to(again, FIRST[:2]) > 0.3
    assert distance_to(again, SECOND) < 1e-6


def test_a_waypoint_that_is_the_goal_too_does_not_keep_it_from_being_reached(drive):
    client, topic, _ = drive(replan_rate=20.0)
    topic.publish(over(FIRST, GOAL, GOAL))
    client.wait_for_word("over 2 waypoints")
    poses = poses_of(shown(client, 1, error_name="NONE"))
    drive_past(client, poses[:-1], poses[-12])
    client.send("start_pose", tuple(poses[-1] - (0.02, 0.0, 0.0)))
    client.plan(START, GOAL)
    client.mark()  # what was published until the goal was reached is heard
    shown_before = len(client.paths)
    client.send("start_pose", (2.0, 8.0, 0.0))  # once the goal is reached, nothing is planned from there
    assert client.plan(START, GOAL)[1]["error_name"] == "NONE"
    client.mark()
    assert len(client.paths) == shown_before
