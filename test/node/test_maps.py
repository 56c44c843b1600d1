"""Maps that change while the node plans or shows a path, by topic, through the executable."""

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.srv import GetMap, LoadMap
from std_srvs.srv import Trigger
from support.harness import occupancy, poses_of, values_of
from support.walls import (
    CLOSED,
    DETOUR,
    FREE,
    HARMLESS,
    end_of_goal,
    id_of,
    publish,
    show_path,
    statuses_of,
    wait_for_path_around,
)
from support.yard import ENDLESS, GOAL, QUICK, START

from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, plan


@pytest.fixture(scope="module")
def replanning(module_planners):
    process = module_planners.start(replan_on_map_change=True, **QUICK)
    return process, module_planners.client()


@pytest.fixture(scope="module")
def plain(module_planners):
    process = module_planners.start(**QUICK)
    return process, module_planners.client()


def test_a_map_that_comes_again_each_second_writes_no_line(plain):
    process, client = plain
    publish(client, process, DETOUR)
    said = len(process.output)
    for second in range(10):
        message = occupancy(DETOUR)
        message.header.stamp.sec = message.info.map_load_time.sec = second
        client.publish_map(message)
        client.call(Trigger, "cancel")
    publish(client, process, HARMLESS)
    took, ready = process.output[said:].splitlines()
    assert "Took a map" in took and "The map is ready" in ready


def test_a_map_that_comes_again_after_a_refused_one_ends_the_remark_on_an_older_map(plain):
    process, client = plain
    client.set_parameters(**QUICK)
    publish(client, process, FREE)
    client.publish_map(occupancy(FREE, frame="odom"))
    client.wait_for(lambda: "on an older map" in client.plan(START, GOAL)[1]["message"], "the remark")
    client.publish_map(occupancy(FREE))
    client.wait_for(lambda: "on an older map" not in client.plan(START, GOAL)[1]["message"], "an answer without the remark")


def test_a_request_keeps_the_map_that_it_began_with_and_the_next_has_the_new_one(plain):
    process, client = plain
    show_path(client, process)
    client.set_parameters(**ENDLESS)
    plan_id = client.next_id
    client.send("goal_pose", GOAL)
    client.status_of(plan_id, error_name="NONE")
    publish(client, process, DETOUR)
    message = client.call(Trigger, "cancel").message
    client.wait_for(lambda: client.statuses[-1].message == message, "the end of the request")
    assert {told["map_id"] for told in statuses_of(client, plan_id)} == {id_of(FREE)}

    client.set_parameters(**QUICK)
    client.send("goal_pose", GOAL)
    told = client.status_of(plan_id + 1, samples=str(QUICK["samples"]))
    assert (told["error_name"], told["map_id"]) == ("NONE", id_of(DETOUR))
    wait_for_path_around(client, DETOUR)


def test_on_a_map_that_changed_paths_are_the_same_as_on_one_that_is_new(plain):
    process, client = plain
    client.set_parameters(**QUICK)
    for cells in (FREE, DETOUR, DETOUR | HARMLESS, HARMLESS, CLOSED, DETOUR, FREE):
        publish(client, process, cells)
        path, told = client.plan(START, GOAL)
        expected = plan(Problem(GridMap(cells, 0.1), Vehicle(), START, GOAL), Settings(**QUICK))
        assert (told["error_name"], told["map_id"]) == (expected.status.name, id_of(cells))
        if expected.path:
            wanted = expected.poses()
            assert poses_of(path)[:, :2] == pytest.approx(wanted[:, :2], abs=1e-9)


def test_a_path_that_a_new_map_blocks_is_told_at_once_and_stays_until_it_is_replaced(replanning):
    process, client = replanning
    plan_id = show_path(client, process)
    shown = len(client.paths)
    publish(client, process, DETOUR)
    told = client.status_of(plan_id + 1, samples=str(QUICK["samples"]))
    assert (told["error_name"], told["map_id"]) == ("NONE", id_of(DETOUR))
    client.wait_for_word("The map changed, and the published path is not free on it")
    wait_for_path_around(client, DETOUR)
    assert all(path.poses for path in client.paths[shown:])
    *_, broken = statuses_of(client, plan_id)
    assert (broken["error_name"], broken["request"], broken["map_id"]) == ("NO_VALID_PATH", "goal", id_of(DETOUR))
    path = poses_of(client.paths[-1])
    assert path[0].tolist() == list(START)
    assert path[-1] == pytest.approx(GOAL, abs=1e-9)


def test_a_cancelled_goal_s_path_is_withdrawn_and_not_planned_again(replanning):
    process, client = replanning
    plan_id = show_path(client, process)
    assert client.call(Trigger, "cancel").success
    publish(client, process, DETOUR)
    assert "its goal was cancelled" in client.status_of(plan_id, error_name="NO_VALID_PATH")["message"]
    client.wait_for(lambda: not client.paths[-1].poses, "the empty path")
    publish(client, process, FREE)
    assert end_of_goal(client) == plan_id + 1


def test_a_path_that_a_new_map_leaves_free_is_left_alone(replanning):
    process, client = replanning
    show_path(client, process)
    told, shown, checked = len(client.statuses), len(client.paths), process.output.count("is free on it too")
    publish(client, process, HARMLESS)
    client.wait_for(lambda: process.output.count("is free on it too") > checked, "the check in the log")
    client.call(GetMap, "get_map")
    assert (len(client.statuses), len(client.paths)) == (told, shown)


def test_a_path_that_was_left_alone_is_checked_against_the_map_after_it_too(replanning):
    process, client = replanning
    plan_id = show_path(client, process)
    checked = process.output.count("is free on it too")
    publish(client, process, HARMLESS)
    client.wait_for(lambda: process.output.count("is free on it too") > checked, "the check in the log")
    publish(client, process, DETOUR)
    assert client.status_of(plan_id + 1, samples=str(QUICK["samples"]))["map_id"] == id_of(DETOUR)


def test_a_map_that_leaves_no_way_ends_in_an_error_and_an_empty_path(replanning):
    process, client = replanning
    plan_id = show_path(client, process)
    publish(client, process, CLOSED)
    told = client.status_of(plan_id + 1, error_code="208")
    assert (told["level"], told["error_name"], told["map_id"]) == (DiagnosticStatus.ERROR, "NO_VALID_PATH", id_of(CLOSED))
    client.wait_for(lambda: not client.paths[-1].poses, "an empty path")
    assert client.paths[-1].header.frame_id == "map"


def test_after_an_error_the_goal_is_planned_again_as_soon_as_a_map_allows_it(replanning):
    process, client = replanning
    plan_id = show_path(client, process)
    publish(client, process, CLOSED)
    client.status_of(plan_id + 1, error_code="208")
    publish(client, process, FREE)
    client.status_of(plan_id + 1, samples=str(QUICK["samples"]), error_name="NONE")
    assert end_of_goal(client) == plan_id + 2


def test_a_map_that_changes_during_a_request_is_checked_when_it_ends(replanning):
    process, client = replanning
    show_path(client, process)
    client.set_parameters(samples=ENDLESS["samples"], planning_time=1.0)
    plan_id = client.next_id
    client.send("goal_pose", GOAL)
    client.status_of(plan_id, error_name="NONE")
    publish(client, process, DETOUR)
    told = client.status_of(plan_id + 1, error_name="NONE")
    assert told["map_id"] == id_of(DETOUR)
    *planned, broken = statuses_of(client, plan_id)
    assert {(told["error_name"], told["map_id"]) for told in planned} == {("NONE", id_of(FREE))}
    assert (broken["error_name"], broken["map_id"]) == ("NO_VALID_PATH", id_of(DETOUR))
    assert "the published path is not free on it" in process.output
    wait_for_path_around(client, DETOUR)


def test_a_refused_map_leaves_the_path_alone_and_is_told_once(replanning):
    process, client = replanning
    show_path(client, process)
    still_free = "The map changed; the published path is free on it too"
    checks = process.output.count(still_free)
    publish(client, process, HARMLESS)
    client.wait_for(lambda: process.output.count(still_free) > checks, "the check of the path on the map before")
    told, shown = len(client.statuses), len(client.paths)
    for _ in range(3):  # as a map that is published at 1 Hz comes
        client.publish_map(occupancy(CLOSED, frame="odom"))
        client.wait_for_word("in frame 'odom', not in 'map'")
    client.call(LoadMap, "load_map", map_url="nowhere")  # what follows a refusal comes before the next answer
    client.call(GetMap, "get_map")
    warnings = client.wait_for(lambda: client.statuses[told + 1:] and client.statuses[told:], "the two refusals")
    assert [(status.level, values_of(status)["plan_id"]) for status in warnings] == [(DiagnosticStatus.WARN, "0")] * 2
    for status, reason in zip(warnings, ("in frame 'odom', not in 'map'", "nowhere: no such map file"), strict=True):
        assert status.message.startswith("Planning goes on on an older map. The last one was refused: ")
        assert reason in status.message
        assert values_of(status)["map_id"] == id_of(HARMLESS)
    assert len(client.paths) == shown
    assert process.output.split("in frame 'odom'")[1].count("The map changed") == 0

    path, told = client.plan(START, GOAL)
    assert path.poses and "This is on an older map. The last one was refused: nowhere" in told["message"]
    publish(client, process, FREE)
    client.wait_for(lambda: client.statuses[-1].message == "The newest map is planned on.", "the end of the warning")
    assert "older map" not in client.plan(START, GOAL)[1]["message"]


def test_without_the_parameter_a_new_map_leaves_the_path_alone(plain):
    process, client = plain
    plan_id = show_path(client, process)
    told, shown = len(client.statuses), len(client.paths)
    publish(client, process, CLOSED)
    client.call(GetMap, "get_map")
    assert (len(client.statuses), len(client.paths)) == (told, shown)
    assert "The map changed" not in process.output
    client.send("goal_pose", GOAL)
    assert client.status_of(plan_id + 1)["error_name"] == "NO_VALID_PATH"


def test_the_parameter_may_be_set_while_the_node_runs(plain):
    process, client = plain
    plan_id = show_path(client, process)
    client.set_parameters(replan_on_map_change=True)
    try:
        publish(client, process, DETOUR)
        assert client.status_of(plan_id + 1, samples=str(QUICK["samples"]))["map_id"] == id_of(DETOUR)
    finally:
        client.set_parameters(replan_on_map_change=False)
