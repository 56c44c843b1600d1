"""Nav2's action compute_path_to_pose, by a client that calls it as BasicNavigator's getPath does."""

import math
import signal
import sys

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("nav2_msgs", reason="nav2_msgs is not here; .ci/messages builds it")

from geometry_msgs.msg import Quaternion, TransformStamped
from nav2_msgs.action import ComputePathToPose
from nav2_msgs_shapes.action import LaterToPose, OlderToPose
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from support.harness import poses_of, stamped, values_of
from support.nav2_client import ABORTED, CANCELED, SUCCEEDED, PathClient
from support.yard import BEHIND, ENDLESS, GOAL, IN_THE_BOX, IN_THE_CHAMBER, ON_THE_WAY_OUT, QUICK, START
from tf2_msgs.msg import TFMessage

pytestmark = pytest.mark.messages
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

NAME = "compute_path_to_pose"
#: Of each error code the start, the goal, the parameters, and what the message says.
ERRORS = [
    (203, (-1.0, 5.0, 0.0), GOAL, QUICK, ["outside the map"]),
    (204, START, (5.0, 10.5, 0.0), QUICK, ["outside the map"]),
    (205, IN_THE_BOX, GOAL, QUICK, ["clearance 0", "needed 0.2"]),
    (206, START, IN_THE_BOX, QUICK, ["clearance 0", "needed 0.2"]),
    (207, START, ON_THE_WAY_OUT, ENDLESS | {"planning_time": 0.05}, ["planning_time 0.05 s"]),
    (208, START, IN_THE_CHAMBER, QUICK, ["No path"]),
    (200, START, (math.nan, 5.0, 0.0), QUICK, ["INVALID_POSE (212): ", "finite"]),
]


@pytest.fixture(scope="module")
def running(module_planners, map_file):
    process = module_planners.start(map_file=map_file)
    return process, PathClient(module_planners.client(), ComputePathToPose, NAME)


@pytest.fixture
def action(running):
    """The action of a planner with quick settings and nothing to do."""
    _, action = running
    action.client.cancel()
    action.client.set_parameters(**QUICK)
    return action


def test_a_goal_gets_a_path_which_is_published_too(action):
    client, plan_id, published = action.client, action.client.next_id, len(action.client.paths)
    status, result = action.path(GOAL, START)
    found = poses_of(result.path)
    assert (status, result.error_code) == (SUCCEEDED, 0)
    assert found[0].tolist() == list(START)
    assert found[-1] == pytest.approx(GOAL, abs=1e-12)
    assert {pose.header.frame_id for pose in result.path.poses} == {result.path.header.frame_id} == {"map"}
    assert result.planning_time.sec + result.planning_time.nanosec > 0
    assert client.wait_for(lambda: client.paths[published:], "the path on plan") == [result.path]
    told = client.status_of(plan_id)
    assert (told["request"], told["error_name"], told["message"]) == ("action", "NONE", result.error_msg)
    assert told["stamp"] == f"{result.path.header.stamp.sec}.{result.path.header.stamp.nanosec:09}"


def test_a_goal_without_a_rotation_is_reached_with_any_heading_where_the_parameter_allows_it(action):
    goal = stamped(GOAL)
    goal.pose.orientation = Quaternion(w=0.0)
    asked = ComputePathToPose.Goal(start=stamped(START), goal=goal, use_start=True)
    assert action.result(action.accepted(asked))[1].error_code == 200
    action.client.set_parameters(any_goal_heading=True)
    try:
        status, result = action.result(action.accepted(asked))
    finally:
        action.client.set_parameters(any_goal_heading=False)
    assert (status, result.error_code) == (SUCCEEDED, 0)
    assert poses_of(result.path)[-1, :2] == pytest.approx(GOAL[:2], abs=1e-9)


@pytest.mark.parametrize(("code", "start", "goal", "parameters", "words"), ERRORS, ids=[str(row[0]) for row in ERRORS])
def test_a_failure_aborts_the_goal_with_its_code_and_a_sentence(action, code, start, goal, parameters, words):
    action.client.set_parameters(**parameters)
    published = len(action.client.paths)
    status, result = action.path(goal, start)
    assert (status, result.error_code) == (ABORTED, code)
    assert [word for word in words if word not in result.error_msg] == []
    assert (result.path.header.frame_id, result.path.poses) == ("map", [])
    assert result.planning_time.sec + result.planning_time.nanosec > 0
    _, result = action.path(GOAL, START)
    assert action.client.wait_for(lambda: action.client.paths[published:], "the path on plan") == [result.path]


def test_a_pose_in_a_frame_that_is_not_known_is_202(action):
    goal = ComputePathToPose.Goal(start=stamped(START), goal=stamped(GOAL, "nowhere"), use_start=True)
    status, result = action.result(action.accepted(goal))
    assert (status, result.error_code) == (ABORTED, 202)
    assert "'nowhere'" in result.error_msg


@pytest.mark.parametrize("planner_id", ["", "GridBased"])
def test_the_planner_has_the_name_of_nav2_s_default_and_none(action, planner_id):
    assert action.path(GOAL, START, planner_id=planner_id)[1].error_code == 0


def test_another_planner_is_201(action):
    status, result = action.path(GOAL, START, planner_id="Smac")
    assert (status, result.error_code) == (ABORTED, 201)
    assert "'Smac'" in result.error_msg and "GridBased" in result.error_msg
    action.client.set_parameters(planner_ids=["Smac", "Dubins"])
    try:
        assert action.path(GOAL, START, planner_id="Smac")[1].error_code == 0
        assert action.path(GOAL, START, planner_id="GridBased")[1].error_code == 201
    finally:
        action.client.set_parameters(planner_ids=["GridBased"])


@pytest.mark.parametrize(("names", "words"), [(["A", "b\nc"], "planner_ids: 'A', 'b\\nc', or leave it empty."),
                                              ([""], "leave it empty: planner_ids names none.")])
def test_the_names_of_the_planner_are_told_quoted_where_there_are_any(action, names, words):
    action.client.set_parameters(planner_ids=names)
    try:
        assert action.path(GOAL, START, planner_id="Smac")[1].error_msg.endswith(words)
    finally:
        action.client.set_parameters(planner_ids=["GridBased"])


def test_without_use_start_it_is_planned_from_where_the_vehicle_is(action):
    action.client.send("start_pose", BEHIND)

    def from_there():
        _, result = action.path(GOAL)
        return result.error_code == 0 and poses_of(result.path)[0].tolist() == pytest.approx(BEHIND)

    action.client.wait_for(from_there, "a path from the start of the topic")


def test_without_use_start_it_is_planned_from_the_vehicle_s_frame_or_202(action):
    client, frame = action.client, f"base_{action.client.node.get_namespace().strip('/')}"  # all nodes of a domain share /tf
    client.set_parameters(robot_base_frame=frame, transform_tolerance=0.1)
    try:
        status, result = action.path(GOAL)
        assert (status, result.error_code) == (ABORTED, 202)
        assert frame in result.error_msg
        publisher = client.node.create_publisher(TFMessage, "/tf_static", LATCHED)
        transform = TransformStamped(header=Header(frame_id="map"), child_frame_id=frame)
        transform.transform.translation.x, transform.transform.translation.y = BEHIND[:2]
        publisher.publish(TFMessage(transforms=[transform]))
        _, result = client.wait_for(lambda: (found := action.path(GOAL))[0] == SUCCEEDED and found, "a path from the frame")
        assert poses_of(result.path)[0].tolist() == [*BEHIND[:2], 0.0]
    finally:
        client.set_parameters(robot_base_frame="")


def test_states_that_nav2_has_no_code_for_are_200_and_named(module_planners, map_file, running):
    module_planners.start()
    action = PathClient(module_planners.client(), ComputePathToPose, NAME)
    status, result = action.path(GOAL, START)
    assert (status, result.error_code) == (ABORTED, 200)
    assert result.error_msg.startswith("NO_MAP (210): There is no map")
    module_planners.start(map_file=map_file)
    action = PathClient(module_planners.client(), ComputePathToPose, NAME)
    status, result = action.path(GOAL)
    assert (status, result.error_code) == (ABORTED, 200)
    assert result.error_msg.startswith("NO_START (211): There is no start")


def test_a_cancel_ends_the_goal_canceled(action):
    action.client.set_parameters(**ENDLESS)
    handle = action.send(ON_THE_WAY_OUT, START)
    assert len(action.cancel(handle)) == 1
    status, result = action.result(handle)
    assert (status, result.error_code, result.path.poses) == (CANCELED, 200, [])
    assert result.error_msg.startswith("CANCELLED (213): ")


def test_a_waiting_goal_can_be_cancelled_and_leaves_its_place(action):
    action.client.set_parameters(**ENDLESS)
    first = action.send(ON_THE_WAY_OUT, START)
    second, third = action.send(ON_THE_WAY_OUT, START), action.send(ON_THE_WAY_OUT, START)
    assert len(action.cancel(third)) == 1
    assert action.result(third)[0] == CANCELED
    assert action.result(first)[0] == action.result(second)[0] == ABORTED
    action.client.set_parameters(**QUICK)
    assert action.path(GOAL, START)[0] == SUCCEEDED


def test_a_newer_goal_replaces_the_one_that_runs_which_ends_aborted_and_empty(action):
    action.client.set_parameters(**ENDLESS)
    first = action.send(ON_THE_WAY_OUT, START)
    action.client.set_parameters(**QUICK)
    assert action.path(GOAL, START)[0] == SUCCEEDED
    assert action.result(first) == (ABORTED, ComputePathToPose.Result())


def test_of_twenty_goals_that_replace_each_other_none_is_lost(action):
    action.client.set_parameters(**ENDLESS)
    handles = [action.send(ON_THE_WAY_OUT, START) for _ in range(20)]
    action.client.set_parameters(**QUICK)
    assert action.path(GOAL, START)[0] == SUCCEEDED
    assert [action.result(handle) for handle in handles] == 20 * [(ABORTED, ComputePathToPose.Result())]


@pytest.mark.slow
def test_two_hundred_goals_in_a_row_get_their_paths(action):
    for number in range(200):
        goal = (GOAL, BEHIND)[number % 2]
        status, result = action.path(goal, START)
        assert (status, result.error_code) == (SUCCEEDED, 0)
        assert poses_of(result.path)[-1] == pytest.approx(goal, abs=1e-9)


def test_goals_of_the_action_and_of_the_topic_do_not_disturb_each_other(action):
    client = action.client
    client.set_parameters(samples=ENDLESS["samples"], planning_time=1.0)
    client.send("start_pose", START)
    plan_id = client.next_id
    client.send("goal_pose", BEHIND)
    client.status_of(plan_id)
    assert action.path(GOAL, START)[0] == SUCCEEDED
    client.wait_for(lambda: any(values_of(status)["plan_id"] == str(plan_id) and values_of(status)["error_name"] == "NONE"
                                for status in client.statuses), "the answer to the goal of the topic")
    assert not [status for status in client.statuses
                if values_of(status)["plan_id"] == str(plan_id) and values_of(status)["error_name"] != "NONE"]


def test_the_service_cancel_aborts_goals_too(action):
    action.client.set_parameters(**ENDLESS)
    handle = action.send(ON_THE_WAY_OUT, START)

    def cancelled():
        return "Nothing" not in action.client.call(Trigger, "cancel").message

    action.client.wait_for(cancelled, "the goal to be cancelled")
    status, result = action.result(handle)
    assert (status, result.error_code) == (ABORTED, 200)
    assert result.error_msg.startswith("CANCELLED (213): ")


#: The node's own main, with the messages of another release.
OTHER_RELEASE = """
import sys
import nav2_msgs.action
from nav2_msgs_shapes.action import {kind}
nav2_msgs.action.ComputePathToPose = {kind}
from dubins_rrt_ros.node.main import main
sys.exit(main())
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", [OlderToPose, LaterToPose])
def test_the_messages_of_other_releases_are_filled_as_far_as_they_go(planners, map_file, kind):
    planners.start(command=[sys.executable, "-c", OTHER_RELEASE.format(kind=kind.__name__)], map_file=map_file, **QUICK)
    action = PathClient(planners.client(), kind, NAME)
    status, result = action.path(GOAL, START)
    assert status == SUCCEEDED
    assert poses_of(result.path)[-1] == pytest.approx(GOAL, abs=1e-9)
    assert result.planning_time.sec + result.planning_time.nanosec > 0
    status, result = action.path(IN_THE_BOX, START)
    assert (status, result.path.poses, getattr(result, "error_code", 206)) == (ABORTED, [], 206)


@pytest.mark.slow
@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_node_while_goals_run_whose_client_is_gone(planners, map_file, by):
    process = planners.start(map_file=map_file, **ENDLESS)
    client = planners.client()
    action = PathClient(client, ComputePathToPose, NAME)
    for _ in range(2):
        action.send(ON_THE_WAY_OUT, START)
    client.close()
    assert process.end(by) == 0, process.output
    assert "Traceback" not in process.output
    assert "did not stop" not in process.output
