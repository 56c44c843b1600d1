"""Nav2's service is_path_valid, as its behaviour trees call it."""

import sys

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("nav2_msgs", reason="nav2_msgs is not here; .ci/messages builds it")

from builtin_interfaces.msg import Time
from nav2_msgs.srv import IsPathValid
from nav2_msgs_shapes.srv import LaterIsPathValid
from std_msgs.msg import Header
from support.harness import Client
from support.yard import ENDLESS, GOAL, ON_THE_WAY_OUT, QUICK, START

from dubins_rrt_ros.node.conversions import path_message

pytestmark = pytest.mark.messages

#: Through the yard's box, whose edges are at 4 and 6 m: the poses from 3.8 to 6.2 m touch it.
THROUGH_THE_BOX = np.column_stack([np.arange(0.5, 9.51, 0.5), np.full(19, 5.0), np.zeros(19)])
BLOCKED = [7, 8, 9, 10, 11]


@pytest.fixture(scope="module")
def running(module_planners, map_file):
    module_planners.start(map_file=map_file)
    return module_planners.client()


@pytest.fixture
def client(running):
    running.cancel()
    running.set_parameters(**QUICK)
    return running


def ask(client: Client, path, kind=IsPathValid):
    caller = client.node.create_client(kind, "is_path_valid")
    client.wait_for(caller.service_is_ready, "the service is_path_valid")
    return client.ask(caller, kind.Request(path=path))


def message(poses, frame="map"):
    return path_message(poses, frame, Time())


def test_the_poses_that_touch_an_obstacle_are_named(client):
    response = ask(client, message(THROUGH_THE_BOX))
    assert (response.is_valid, response.invalid_pose_indices.tolist()) == (False, BLOCKED)


def test_a_path_of_the_planner_is_valid(client):
    path, _ = client.plan(START, GOAL)
    assert ask(client, path) == IsPathValid.Response(is_valid=True)


def test_what_is_between_two_poses_counts(client):
    response = ask(client, message(np.array([[2.0, 5.0, 0.0], [3.0, 5.0, 0.0], [7.0, 5.0, 0.0], [8.0, 5.0, 0.0]])))
    assert (response.is_valid, response.invalid_pose_indices.tolist()) == (False, [1])


def test_neither_turns_nor_ends_are_judged(client):
    zigzag = np.array([[2.0, 3.0, 0.0], [3.0, 3.0, 3.0], [2.0, 3.2, -1.5], [3.0, 3.2, 0.5]])
    assert ask(client, message(zigzag)).is_valid


def test_the_footprint_is_judged(client):
    along_the_wall = np.array([[2.0, 3.5, 0.0], [8.0, 3.5, 0.0]])
    assert ask(client, message(along_the_wall)).is_valid
    client.set_parameters(footprint="[[1.0, 0.6], [-0.2, 0.6], [-0.2, -0.6], [1.0, -0.6]]")
    try:
        assert not ask(client, message(along_the_wall)).is_valid
    finally:
        client.set_parameters(footprint="")


@pytest.mark.parametrize(("path", "reason"), [
    (np.empty((0, 3)), "empty"), (np.array([[3.0, 3.0, 0.0], [np.nan, 5.0, 0.0]]), "path's index 1 pose is at x nan")])
def test_a_path_that_cannot_be_judged_is_false_and_the_log_says_why(client, path, reason):
    assert ask(client, message(path)) == IsPathValid.Response(is_valid=False)
    client.wait_for_word(reason)


def test_a_path_in_another_frame_is_false_and_the_log_says_why(client):
    assert not ask(client, message(THROUGH_THE_BOX[:3], frame="odom")).is_valid
    client.wait_for_word("'odom'")


def test_a_path_whose_poses_alone_have_another_frame_is_false(client):
    path = message(THROUGH_THE_BOX[:3])
    path.header = Header()
    path.poses[2].header = Header(frame_id="base_link")
    assert not ask(client, path).is_valid
    client.wait_for_word("'base_link'")


def test_only_what_is_ahead_of_the_vehicle_counts(module_planners, map_file, running):
    module_planners.start(map_file=map_file)
    client = module_planners.client()
    client.send("start_pose", (7.0, 5.2, 0.0))
    client.wait_for(lambda: ask(client, message(THROUGH_THE_BOX)).is_valid, "the start to be known")
    client.send("start_pose", (4.9, 3.5, 0.0))

    def some():
        return ask(client, message(THROUGH_THE_BOX)).invalid_pose_indices.tolist()

    assert client.wait_for(some, "the start to be another one") == [9, 10, 11]


def test_it_answers_while_a_search_is_under_way(client):
    client.set_parameters(**ENDLESS)
    future, _ = client.begin_plan(START, ON_THE_WAY_OUT)
    assert ask(client, message(THROUGH_THE_BOX)).invalid_pose_indices.tolist() == BLOCKED
    assert not future.done()


def test_without_a_map_it_is_false(module_planners, running):
    module_planners.start()
    client = module_planners.client()
    assert not ask(client, message(THROUGH_THE_BOX[:3])).is_valid
    client.wait_for_word("is_path_valid answers false: There is no map")


#: The node's own main, with the messages of another release.
LATER_RELEASE = """
import sys
import nav2_msgs.srv
from nav2_msgs_shapes.srv import LaterIsPathValid
nav2_msgs.srv.IsPathValid = LaterIsPathValid
from dubins_rrt_ros.node.main import main
sys.exit(main())
"""


@pytest.mark.slow
def test_the_message_of_a_later_release(planners, map_file):
    planners.start(command=[sys.executable, "-c", LATER_RELEASE], map_file=map_file, **QUICK)
    response = ask(planners.client(), message(THROUGH_THE_BOX), LaterIsPathValid)
    assert (response.success, response.is_valid, response.invalid_pose_indices.tolist()) == (True, False, BLOCKED)
