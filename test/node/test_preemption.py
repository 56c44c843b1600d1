"""The newest goal counts alone, improvements replace the path, and requests of others are not disturbed by it."""

import math
import time

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from geometry_msgs.msg import Point, Pose
from rcl_interfaces.srv import GetParameters
from std_srvs.srv import Trigger
from support.conversation import Conversation
from support.harness import poses_of, values_of
from visualization_msgs.msg import Marker

START, GOAL, BEHIND, OCCUPIED = (1.5, 5.0, 0.0), (8.5, 5.0, 0.5), (1.5, 2.0, -2.0), (5.0, 5.0, 0.0)
NOWHERE = Pose(position=Point(x=math.nan))
LONG = {"samples": 10_000_000, "planning_time": 60.0}
#: Goals in a burst, and how many come in a second.
BURST, RATE = 10_000, 1000
#: How much memory may grow where nothing is kept [MB].
NOISE = 10.0


@pytest.fixture
def talk(planners, map_yaml):
    """A planner on the map that knows a start, and its client, which sees the tree."""
    return lambda **parameters: begin(planners, map_file=str(map_yaml), **parameters)


def begin(planners, **parameters):
    talk = Conversation(planners.start(**parameters), planners.client(listens_to_tree=True))
    talk.client.send("start_pose", START)
    return talk


def plan_ids(client):
    return [int(values_of(status)["plan_id"]) for status in client.statuses]


def goals_of_paths(client):
    """Where each path ended, None for an empty one."""
    ends = [path.poses[-1].pose.position if path.poses else None for path in client.paths]
    return [end and (end.x, end.y) for end in ends]


def goals_of_trees(client):
    """The goal that each tree was shown with, None where it was cleared."""
    arrows = [next((m.pose.position for m in tree.markers if m.ns == "goal" and m.action == Marker.ADD), None)
              for tree in client.trees]
    return [arrow and (arrow.x, arrow.y) for arrow in arrows]


def in_order(found, wanted):
    """Whether all that is wanted was found, in that order and nothing else; repetitions do not matter."""
    return [item for item, before in zip(found, [(), *found], strict=False) if item != before] == wanted


def is_of(status, path):
    """Whether a status tells of a path: by its length."""
    steps = np.diff(poses_of(path)[:, :2], axis=0)
    return float(values_of(status)["path_length"]) == pytest.approx(np.linalg.norm(steps, axis=1).sum(), rel=1e-3)


def test_the_newest_goal_wins_and_nothing_of_the_old_one_comes_after(talk):
    talk = talk(**LONG)
    client = talk.client
    for plan_id, goal in enumerate((GOAL, BEHIND, GOAL, BEHIND), start=1):
        client.send("goal_pose", goal)
        client.status_of(plan_id, error_name="NONE")
    client.send("goal_pose", OCCUPIED)
    client.status_of(5, error_name="GOAL_OCCUPIED")
    client.send("goal_pose", NOWHERE)
    client.status_of(6, error_name="INVALID_POSE")
    order = [GOAL[:2], BEHIND[:2], GOAL[:2], BEHIND[:2]]
    client.wait_for(lambda: in_order(goals_of_paths(client), [*order, None]), "the empty path")
    client.wait_for(lambda: in_order(goals_of_trees(client), [*order, OCCUPIED[:2], None]), "the clearing")
    told = [plan_id for plan_id in plan_ids(client) if plan_id]  # the client may still have heard that no start is there
    assert in_order(told, [1, 2, 3, 4, 5, 6])


def test_a_goal_that_is_refused_replaces_the_one_before(talk):
    talk = talk(**LONG)
    for bad, name in ((OCCUPIED, "GOAL_OCCUPIED"), ((50.0, 5.0, 0.0), "GOAL_OUTSIDE_MAP"), (NOWHERE, "INVALID_POSE")):
        talk.goal(GOAL, error_name="NONE")
        talk.client.paths.clear()
        talk.goal(bad, error_name=name)
        talk.client.wait_for(lambda: talk.client.paths and not talk.client.paths[-1].poses, "the empty path")
        refused = talk.asked
        # A request of another kind answers after everything that the goal could still have said.
        assert talk.plan(START, START)[0]["error_name"] == "NONE"
        assert plan_ids(talk.client)[-1] == talk.asked > refused
        assert not talk.client.paths[-1].poses


def test_improvements_have_one_plan_id_and_rising_revisions_and_the_last_is_told(talk):
    talk = talk(samples=4000, planning_time=15.0, seed=1, preferred_clearance=0.0)
    talk.goal(GOAL, samples="4000")
    told = [values for values in map(values_of, talk.client.statuses) if values["plan_id"] != "0"]  # or: no start is there yet
    assert {item["plan_id"] for item in told} == {"1"}
    assert [int(item["revision"]) for item in told] == list(range(1, len(told) + 1))
    lengths = [float(item["path_length"]) for item in told]
    assert len(told) > 1
    assert lengths == sorted(lengths, reverse=True)
    talk.client.wait_for(lambda: len(talk.client.paths) == len(told), "a path with every status")
    assert is_of(talk.client.statuses[-1], talk.client.paths[-1])


@pytest.mark.slow
def test_goals_do_not_disturb_get_plan(talk):
    talk = talk(**LONG)
    client = talk.client
    future = client.request_plan(START, GOAL)
    for count in range(30):
        client.send("goal_pose", (BEHIND, OCCUPIED, NOWHERE)[count % 3])
        client.wait_for(lambda count=count: len(set(plan_ids(client)) - {0}) > count, "an answer")
    assert not future.done()
    client.call(Trigger, "cancel")
    poses = client.wait_for(lambda: future.done() and future.result(), "the plan").plan.poses
    assert (poses[-1].pose.position.x, poses[-1].pose.position.y) == GOAL[:2]


def test_get_plan_does_not_disturb_a_goal(talk):
    talk = talk(**LONG)
    client = talk.client
    client.send("goal_pose", GOAL)
    client.status_of(1, error_name="NONE")
    for plan_id, goal, name in ((2, START, "NONE"), (3, OCCUPIED, "GOAL_OCCUPIED"), (4, NOWHERE, "INVALID_POSE")):
        client.wait_for(client.request_plan(START, goal).done, "an answer")
        client.status_of(plan_id, error_name=name)
    client.call(Trigger, "cancel")
    client.wait_for(lambda: plan_ids(client)[-1] == 1 and "cancelled" in client.statuses[-1].message, "the goal's end")
    assert set(goals_of_paths(client)) == {GOAL[:2]}
    assert set(goals_of_trees(client)) == {GOAL[:2]}


@pytest.mark.slow
def test_a_burst_of_goals_ends_with_the_last_one_and_leaves_nothing_behind(lean_planners, map_yaml, record_property):
    talk = begin(lean_planners, map_file=str(map_yaml), planner="rrt", planning_time=15.0)
    client, process = talk.client, talk.process
    client.statuses.clear()
    answered, memory, began = 0, 0.0, time.monotonic()
    for count in range(1, BURST + 1):
        client.send("goal_pose", GOAL if count % 2 else BEHIND)
        if count % (BURST // 10) == 0:
            answered += len(client.call(GetParameters, "get_parameters", names=["samples"]).values)
            memory = memory or process.memory
        while time.monotonic() < began + count / RATE:
            client.spin_once()
    client.send("goal_pose", (8.5, 2.0, 0.0))
    client.wait_for(lambda: goals_of_paths(client)[-1:] == [(8.5, 2.0)], "the path to the last goal")
    client.wait_for(lambda: client.statuses and is_of(client.statuses[-1], client.paths[-1]), "its status")
    told = values_of(client.statuses[-1])
    assert plan_ids(client) == sorted(plan_ids(client))
    assert plan_ids(client)[-1] <= BURST + 1
    assert answered == 10
    grown = process.memory - memory
    record_property("memory grown [MB]", grown)
    record_property("goals planned", int(told["plan_id"]))
    assert grown < NOISE
    talk.asked = int(told["plan_id"])
    assert talk.goal(GOAL)["error_name"] == "NONE"
