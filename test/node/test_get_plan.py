"""The service get_plan, through the executable."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Pose
from nav_msgs.srv import GetMap, GetPlan, LoadMap
from rcl_interfaces.srv import GetParameters
from std_srvs.srv import Trigger
from support.harness import poses_of, stamped, values_of
from support.yard import BEHIND, ENDLESS, GOAL, IN_THE_BOX, ON_THE_WAY_OUT, QUICK, START, yard

from dubins_rrt_ros.node.qos import SERVICE
from dubins_rrt_ros.planning import GridMap, save_map


@pytest.fixture(scope="module")
def running(module_planners, tmp_path_factory):
    file = tmp_path_factory.mktemp("maps") / "yard.yaml"
    save_map(GridMap(yard(), 0.1), file)
    process = module_planners.start(map_file=str(file))
    return process, module_planners.client()


@pytest.fixture
def planner(running):
    """The process and its client, with quick settings and nothing to do."""
    process, client = running
    client.cancel()
    client.set_parameters(**QUICK)
    return process, client


def test_get_plan_gives_a_path_from_start_to_goal_in_the_frame_and_does_not_publish_it(planner):
    _, client = planner
    published = len(client.paths)
    path, told = client.plan(START, GOAL)
    found = poses_of(path)
    assert found[0].tolist() == list(START)
    assert found[-1] == pytest.approx(GOAL, abs=1e-12)
    assert found[-1, :2].tolist() == list(GOAL[:2])
    assert {pose.header.frame_id for pose in path.poses} == {path.header.frame_id} == {"map"}
    assert path.header.stamp.sec > 0
    steps = np.linalg.norm(np.diff(found[:, :2], axis=0), axis=1)
    assert steps.max() <= 0.1 + 1e-9
    assert steps.sum() == pytest.approx(float(told["path_length"]), rel=1e-3)
    assert (told["level"], told["error_name"], told["revision"], told["audit"]) == (DiagnosticStatus.OK, "NONE", "1", "ok")
    client.wait_for_word(told["message"])
    client.call(GetMap, "get_map")
    assert len(client.paths) == published


def test_get_plan_needs_no_start_from_a_topic_and_leaves_that_one_alone(planner):
    _, client = planner
    client.send("start_pose", BEHIND)
    client.wait_for(lambda: plans_from(client, BEHIND), "the start of the topic to be taken")
    client.plan(START, GOAL)
    assert plans_from(client, BEHIND)


def plans_from(client, start):
    """Whether a goal is planned to from there."""
    plan_id, published = client.next_id, len(client.paths)
    client.send("goal_pose", GOAL)
    if client.status_of(plan_id, samples="300")["error_name"] != "NONE":
        return False
    path = client.wait_for(lambda: client.paths[published:], "the path of the topic")[0]
    return poses_of(path)[0] == pytest.approx(start, abs=1e-12)


def test_get_plan_takes_its_tolerance_for_how_far_from_the_goal_the_path_may_end(planner):
    _, client = planner
    beside = (5.0, 3.9, 0.0)  # 0.1 m from the box, with a radius of 0.2 m
    path, told = client.plan(START, beside)
    assert (told["error_name"], path.poses) == ("GOAL_OCCUPIED", [])
    path, told = client.plan(START, beside, tolerance=0.5)
    assert told["error_name"] == "NONE"
    assert told["level"] == DiagnosticStatus.WARN
    end = poses_of(path)[-1]
    off = math.dist(end[:2], beside[:2])
    assert 0.1 - 1e-3 <= off <= 0.5
    assert end[2] == pytest.approx(0.0, abs=1e-9)
    assert f"{off:.3f} m" in told["message"]


def test_a_goal_in_a_box_is_not_reached_with_a_tolerance_that_ends_in_it(planner):
    _, client = planner
    path, told = client.plan(START, IN_THE_BOX, tolerance=0.5)
    assert path.poses == []
    assert told["level"] == DiagnosticStatus.ERROR
    path, told = client.plan(START, IN_THE_BOX, tolerance=1.5)
    assert told["error_name"] == "NONE"
    assert 1.2 <= math.dist(poses_of(path)[-1, :2], IN_THE_BOX[:2]) <= 1.5


def test_tolerance_zero_is_that_of_the_parameter(planner):
    _, client = planner
    client.set_parameters(goal_tolerance_xy=0.5)
    try:
        path, told = client.plan(START, (5.0, 3.9, 0.0))
    finally:
        client.set_parameters(goal_tolerance_xy=0.0)
    assert told["error_name"] == "NONE"
    assert 0.1 - 1e-3 <= math.dist(poses_of(path)[-1, :2], (5.0, 3.9)) <= 0.5


@pytest.mark.parametrize("tolerance", [math.nan, math.inf, -0.5])
def test_a_tolerance_that_is_none_is_refused_with_a_sentence(planner, tolerance):
    _, client = planner
    path, told = client.plan(START, GOAL, tolerance=tolerance)
    assert (path.header.frame_id, path.poses) == ("map", [])
    assert told["error_name"] == "INVALID_POSE"
    assert told["level"] == DiagnosticStatus.ERROR
    assert str(tolerance) in told["message"] and "tolerance" in told["message"]
    client.wait_for_word(told["message"])


@pytest.mark.parametrize(("start", "goal", "name", "words"), [
    (START, IN_THE_BOX, "GOAL_OCCUPIED", ["clearance 0", "needed 0.2"]),
    (IN_THE_BOX, GOAL, "START_OCCUPIED", ["clearance 0", "needed 0.2"]),
    ((-1.0, 5.0, 0.0), GOAL, "START_OUTSIDE_MAP", ["-1", "10.00"]),
    (START, (5.0, 10.5, 0.0), "GOAL_OUTSIDE_MAP", ["10.5", "10.00"]),
    (START, ON_THE_WAY_OUT, "TIMEOUT", ["planning_time 0.5 s"]),
])
def test_get_plan_answers_a_failure_with_an_empty_path_and_tells_the_reason(planner, start, goal, name, words):
    _, client = planner
    client.set_parameters(planning_time=0.5)
    path, told = client.plan(start, goal)
    assert (path.header.frame_id, path.poses) == ("map", [])
    assert path.header.stamp.sec > 0
    assert (told["level"], told["error_name"]) == (DiagnosticStatus.ERROR, name)
    assert all(word in told["message"] for word in words)
    client.wait_for_word(told["message"])


@pytest.mark.parametrize("which", ["start", "goal"])
def test_get_plan_refuses_a_pose_that_is_none_and_names_it(planner, which):
    _, client = planner
    poses = {"start": START, "goal": GOAL, which: Pose()}
    poses[which].orientation.w = 0.0
    path, told = client.plan(poses["start"], poses["goal"])
    assert (path.header.frame_id, path.poses) == ("map", [])
    assert told["error_name"] == "INVALID_POSE"
    assert f"The {which} pose" in told["message"]


def test_several_requests_at_once_are_all_answered_in_their_order(planner):
    _, client = planner
    first = client.next_id
    goals = [GOAL, BEHIND, IN_THE_BOX, (7.0, 7.0, 1.0), START]
    futures = [client.request_plan(START, goal) for goal in goals]
    ends = [poses_of(client.response(future).plan) for future in futures]
    for goal, end in zip(goals, ends, strict=True):
        assert len(end) == 0 if goal is IN_THE_BOX else end[-1] == pytest.approx(goal, abs=1e-9)
    client.status_of(first + len(goals) - 1)
    ids = [int(values_of(status)["plan_id"]) for status in client.statuses]
    assert [number for number in ids if number >= first] == list(range(first, first + len(goals)))


def test_two_hundred_calls_at_once_of_twenty_five_clients_get_their_answers_in_order(planner):
    _, client = planner
    first = client.next_id
    # The middleware hands the answers to all clients to each of them, which would lose its own in the queue of ten that is usual.
    callers = [client.node.create_client(GetPlan, "planner/get_plan", qos_profile=SERVICE) for _ in range(25)]
    client.wait_for(lambda: all(caller.service_is_ready() for caller in callers), "the service for all of them")
    request, refused = (GetPlan.Request(start=stamped(START), goal=stamped(goal)) for goal in (START, IN_THE_BOX))
    answered = [[] for _ in callers]
    for number, (caller, order) in enumerate(zip(callers * 8, answered * 8, strict=True)):
        future = caller.call_async(refused if number // 25 % 3 == 1 else request)
        future.add_done_callback(lambda done, number=number, order=order: order.append((number, len(done.result().plan.poses))))
    client.wait_for(lambda: all(len(order) == 8 for order in answered), "200 answers")
    for which, order in enumerate(answered):
        assert order == [(which + 25 * turn, 0 if turn % 3 == 1 else 1) for turn in range(8)]
    client.status_of(first + 199)


def test_a_refused_request_is_answered_in_its_turn(planner):
    _, client = planner
    first = client.next_id
    planned, unusable = client.request_plan(START, GOAL), client.request_plan(START, (math.nan, 0.0, 0.0))
    client.response(unusable)
    assert planned.done()
    assert client.status_of(first)["error_name"] == "NONE"
    assert client.status_of(first + 1)["error_name"] == "INVALID_POSE"


@pytest.mark.parametrize("goal", [GOAL, IN_THE_BOX])
def test_the_reason_of_an_answer_is_found_by_its_stamp(planner, goal):
    _, client = planner
    path, told = client.plan(START, goal)
    assert told["request"] == "get_plan"
    assert told["stamp"] == f"{path.header.stamp.sec}.{path.header.stamp.nanosec:09}"


def test_a_goal_and_a_request_at_the_same_time_are_both_answered_and_neither_ends_the_other(planner):
    process, client = planner
    client.set_parameters(samples=ENDLESS["samples"], planning_time=1.0)
    client.send("start_pose", START)
    goal_id, published = client.next_id, len(client.paths)
    client.send("goal_pose", GOAL)
    client.status_of(goal_id)
    path, told = client.plan(START, BEHIND)
    assert poses_of(path)[-1] == pytest.approx(BEHIND, abs=1e-9)
    assert (told["plan_id"], told["level"], told["error_name"]) == (str(goal_id + 1), DiagnosticStatus.OK, "NONE")

    def of_goal():
        return [status for status in client.statuses if values_of(status)["plan_id"] == str(goal_id)]

    client.wait_for(lambda: any(status.message in process.output for status in of_goal()), "the end of the goal in the log")
    assert {status.level for status in of_goal()} == {DiagnosticStatus.OK}
    assert {tuple(poses_of(path)[-1, :2]) for path in client.paths[published:]} == {GOAL[:2]}


def test_a_goal_is_answered_while_get_plan_plans(planner):
    _, client = planner
    client.set_parameters(**ENDLESS)
    future, _ = client.begin_plan(START, ON_THE_WAY_OUT)
    client.set_parameters(**QUICK)
    client.send("start_pose", START)
    plan_id = client.next_id
    client.send("goal_pose", GOAL)
    assert client.status_of(plan_id, samples="300")["error_name"] == "NONE"
    assert not future.done()


def test_other_services_are_answered_while_get_plan_plans(planner):
    _, client = planner
    client.set_parameters(**ENDLESS)
    future, _ = client.begin_plan(START, ON_THE_WAY_OUT)
    assert client.call(GetMap, "get_map").map.info.width == 100
    assert client.call(GetParameters, "get_parameters", names=["samples"]).values[0].integer_value == ENDLESS["samples"]
    assert client.call(LoadMap, "load_map", map_url="nowhere").result == LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST
    assert not future.done()
    assert client.call(Trigger, "cancel").success
    assert client.response(future).plan.poses == []
