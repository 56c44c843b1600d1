"""The node as a process of its own, over real topics."""

import array
import math
import signal

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Pose
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import Marker

START, GOAL, BEHIND, OCCUPIED = (1.5, 5.0, 0.0), (8.5, 5.0, 0.5), (1.5, 2.0, -2.0), (5.0, 5.0, 0.0)
QUICK = {"samples": 300, "planning_time": 15.0, "seed": 1}
LONG = {"samples": 10_000_000, "planning_time": 60.0}


def poses(path):
    return np.array([(p.pose.position.x, p.pose.position.y, 2 * math.atan2(p.pose.orientation.z, p.pose.orientation.w))
                     for p in path.poses])


def ask(client, start, goal):
    """Send a start and a goal; they are other topics, so the start has to be seen first."""
    client.send("start_pose", start)
    client.send("goal_pose", goal)


@pytest.fixture
def asked(planners, map_yaml):
    """A planner on the map with a start, and its client."""
    def start(tree=False, **parameters):
        process = planners.start(map_file=str(map_yaml), **parameters)
        client = planners.client(listens_to_tree=tree)
        client.send("start_pose", START)
        return process, client
    return start


def test_a_goal_is_answered_with_a_path_from_the_start_to_exactly_there(asked):
    _, client = asked(path_spacing=0.1, **QUICK)
    client.send("goal_pose", GOAL)
    told = client.status_of(1, samples="300")
    path = client.wait_for(lambda: client.paths and client.paths[-1], "a path")
    found = poses(path)
    assert found[0].tolist() == list(START)
    assert found[-1, :2].tolist() == list(GOAL[:2])
    assert found[-1, 2] == pytest.approx(GOAL[2], abs=1e-12)
    steps = np.linalg.norm(np.diff(found[:, :2], axis=0), axis=1)
    assert steps.max() <= 0.1 + 1e-9
    assert steps.sum() == pytest.approx(float(told["path_length"]), rel=1e-3)
    assert {p.header.frame_id for p in path.poses} == {path.header.frame_id} == {"map"}
    assert {(p.header.stamp.sec, p.header.stamp.nanosec) for p in path.poses} \
        == {(path.header.stamp.sec, path.header.stamp.nanosec)}
    now = client.node.get_clock().now().nanoseconds * 1e-9
    assert 0 <= now - (path.header.stamp.sec + path.header.stamp.nanosec * 1e-9) < 60


def test_the_status_of_a_path_tells_all_figures(asked):
    process, client = asked(**QUICK)
    client.send("goal_pose", GOAL)
    told = client.status_of(1, samples="300")
    assert told["level"] == DiagnosticStatus.OK
    assert told["name"] == f"{process.name}: planner"
    assert (told["error_code"], told["error_name"], told["planner"], told["audit"], told["seed"]) \
        == ("0", "NONE", "rrt_star", "ok", "1")
    assert float(told["path_length"]) >= float(told["lower_bound"]) > 0
    assert float(told["gap"]) == pytest.approx(float(told["path_length"]) / float(told["lower_bound"]) - 1)
    assert float(told["min_clearance"]) >= 0.2
    assert float(told["max_curvature"]) <= 1.0 + 1e-6
    assert 0 <= float(told["time_to_first"]) <= float(told["planning_time"])
    assert int(told["tree_nodes"]) > 1
    assert told["map_id"]
    assert told["message"]


def test_improvements_have_the_same_plan_id_and_rising_revisions(asked):
    _, client = asked(**QUICK)
    client.send("goal_pose", GOAL)
    client.status_of(1, samples="300")
    values = [{item.key: item.value for item in status.values} for status in client.statuses]
    assert {told["plan_id"] for told in values} == {"1"}
    assert [int(told["revision"]) for told in values] == list(range(1, len(values) + 1))
    lengths = [float(told["path_length"]) for told in values]
    assert lengths == sorted(lengths, reverse=True)


def test_rrt_ends_with_its_first_path_and_a_fresh_seed_is_reported(asked):
    _, client = asked(planner="rrt", samples=100_000, planning_time=15.0)
    client.send("goal_pose", GOAL)
    told = client.status_of(1, error_name="NONE", planner="rrt")
    assert int(told["samples"]) < 100_000
    assert int(told["seed"]) >= 0


def test_start_equal_to_goal_is_one_pose(asked):
    _, client = asked(**QUICK)
    client.send("goal_pose", START)
    told = client.status_of(1, error_name="NONE")
    path = client.wait_for(lambda: client.paths and client.paths[-1], "a path")
    assert poses(path).tolist() == [list(START)]
    assert float(told["path_length"]) == 0.0


def test_an_occupied_goal_empties_the_path_and_a_good_goal_is_answered_after_it(asked):
    _, client = asked(**QUICK)
    client.send("goal_pose", OCCUPIED)
    told = client.status_of(1, error_code="206", error_name="GOAL_OCCUPIED")
    assert told["level"] == DiagnosticStatus.ERROR
    path = client.wait_for(lambda: client.paths and client.paths[-1], "an empty path")
    assert (path.header.frame_id, len(path.poses)) == ("map", 0)
    client.send("goal_pose", GOAL)
    client.status_of(2, error_name="NONE")
    assert len(client.wait_for(lambda: client.paths[1:], "a path")[0].poses) > 1


def test_a_goal_before_any_start_says_so(planners, map_yaml):
    planners.start(map_file=str(map_yaml))
    client = planners.client()
    client.send("goal_pose", GOAL)
    told = client.status_of(1)
    assert (told["error_code"], told["error_name"]) == ("211", "NO_START")
    assert "start_pose" in told["message"] and "initialpose" in told["message"]


def test_initialpose_is_a_start(planners, map_yaml):
    planners.start(map_file=str(map_yaml), **QUICK)
    client = planners.client()
    client.send("initialpose", START)
    client.send("goal_pose", GOAL)
    client.status_of(1, error_name="NONE")
    assert poses(client.wait_for(lambda: client.paths, "a path")[0])[0].tolist() == list(START)


def invalid(**fields):
    pose = Pose()
    pose.orientation.w = fields.pop("w", 1.0)
    for name, value in fields.items():
        setattr(pose.position, name, value)
    return pose


@pytest.mark.parametrize("topic", ["start_pose", "initialpose", "goal_pose"])
@pytest.mark.parametrize(("pose", "frame", "code", "name", "words"), [
    (invalid(x=math.nan), "map", "212", "INVALID_POSE", ["finite"]),
    (invalid(w=0.0), "map", "212", "INVALID_POSE", ["no rotation"]),
    (invalid(), "odom", "202", "TF_ERROR", ["'odom'", "'map'"]),
])
def test_a_pose_that_cannot_be_used_is_refused_and_the_node_goes_on(asked, topic, pose, frame, code, name, words):
    _, client = asked(**QUICK)
    client.send("goal_pose", GOAL)
    client.status_of(1, error_name="NONE")
    client.send(topic, pose, frame)
    plan_id = 2 if topic == "goal_pose" else 0
    told = client.status_of(plan_id, error_code=code, error_name=name)
    assert told["level"] == DiagnosticStatus.ERROR
    assert all(word in told["message"] for word in words)
    if topic != "goal_pose":  # the vehicle is no longer where the start before said
        client.send("goal_pose", BEHIND)
        told = client.status_of(2, error_name="NO_START")
        assert all(word in told["message"] for word in words)
        client.send("start_pose", START)
    client.send("goal_pose", BEHIND)
    client.status_of(3, error_name="NONE")


def test_a_pose_without_a_frame_is_in_the_global_frame(asked):
    _, client = asked(global_frame="world", **QUICK)
    client.send("start_pose", START, frame="")
    client.send("goal_pose", GOAL, frame="")
    client.status_of(1, error_name="NONE")
    assert client.wait_for(lambda: client.paths, "a path")[0].header.frame_id == "world"


def occupancy(occupied=False, width=100, frame="map"):
    message = OccupancyGrid(data=array.array("b", [100 if occupied else 0] * 100 * 100))
    message.header.frame_id = frame
    message.info.width, message.info.height, message.info.resolution = width, 100, 0.1
    return message


def test_without_a_map_it_waits_for_one_and_plans_once_it_is_there(planners):
    process = planners.start(**QUICK)
    client = planners.client()
    told = client.status_of(0)
    assert (told["level"], told["error_code"], told["error_name"]) == (DiagnosticStatus.STALE, "210", "NO_MAP")
    assert process.name.replace("/planner", "/map") in told["message"]
    ask(client, START, GOAL)
    told = client.status_of(1)
    assert (told["level"], told["error_code"]) == (DiagnosticStatus.STALE, "210")
    client.publish_map(occupancy())
    client.wait_for(lambda: "Took a map" in process.output, "the map to be taken")
    client.send("goal_pose", GOAL)
    assert client.status_of(2, error_name="NONE")["map_id"]


def test_a_map_that_came_before_the_node_is_taken(planners):
    first = planners.start(**QUICK)
    client = planners.client()
    client.publish_map(occupancy())
    client.wait_for(lambda: "Took a map" in first.output, "the map to be taken")
    assert first.end(signal.SIGINT)[0] == 0
    second = planners.restart(**QUICK)
    client.follow(second)
    client.wait_for(lambda: "Took a map" in second.output, "the latched map to be taken")


def test_a_bad_first_map_is_told_in_the_status(planners):
    planners.start(**QUICK)
    client = planners.client()
    client.publish_map(occupancy(width=7))
    told = client.wait_for(lambda: next((s for s in client.statuses if "7 x 100" in s.message), None), "the refusal")
    assert told.level == DiagnosticStatus.STALE
    assert "no map yet" in told.message


def test_a_bad_map_is_refused_and_the_one_before_stays(planners):
    process = planners.start(**QUICK)
    client = planners.client()
    client.publish_map(occupancy())
    client.wait_for(lambda: "Took a map" in process.output, "the map to be taken")
    client.publish_map(occupancy(width=7))
    client.wait_for(lambda: "has 10000 values for 7 x 100 cells" in process.output, "the map to be refused")
    ask(client, START, GOAL)
    assert client.status_of(1, error_name="NONE")["map_id"]


def test_a_volatile_map_is_taken_where_the_parameter_says_so(planners):
    process = planners.start(map_transient_local=False)
    client = planners.client()
    client.publish_map(occupancy(), QoSProfile(depth=1, durability=DurabilityPolicy.VOLATILE))
    assert client.wait_for(lambda: "Took a map of 100 x 100" in process.output, "the map to be taken")


def test_the_map_file_is_published(asked):
    _, client = asked()
    client.listen_to_map()
    grid = client.wait_for(lambda: client.maps, "the map")[0]
    assert (grid.info.width, grid.info.height, grid.header.frame_id) == (100, 100, "map")
    assert np.array(grid.data).reshape(100, 100)[50, 50] == 100
    assert sum(grid.data) == 100 * 20 * 20


def test_the_newest_goal_wins_and_nothing_of_the_old_one_comes_after(asked):
    _, client = asked(**LONG)
    client.send("goal_pose", GOAL)
    client.status_of(1, error_name="NONE")
    client.send("goal_pose", BEHIND)
    client.status_of(2, error_name="NONE")
    client.send("goal_pose", OCCUPIED)
    client.status_of(3)
    client.wait_for(lambda: not client.paths[-1].poses, "the empty path")
    ids = [next(item.value for item in status.values if item.key == "plan_id") for status in client.statuses]
    assert ids == sorted(ids)
    ends = [tuple(poses(path)[-1, :2]) if path.poses else None for path in client.paths]
    order = [GOAL[:2], BEHIND[:2], None]
    assert set(ends) == set(order)
    assert ends == sorted(ends, key=order.index)


def test_a_goal_that_is_refused_replaces_the_old_one_too(asked):
    _, client = asked(**LONG)
    client.send("goal_pose", GOAL)
    client.status_of(1, error_name="NONE")
    client.send("goal_pose", OCCUPIED)
    client.status_of(2, error_code="206")
    client.send("goal_pose", invalid(x=math.nan))
    assert client.status_of(3, error_code="212")["level"] == DiagnosticStatus.ERROR
    client.wait_for(lambda: client.paths and not client.paths[-1].poses, "an empty path")


def test_who_comes_late_gets_the_last_path_status_and_tree(asked, planners):
    _, client = asked(**QUICK)
    client.send("goal_pose", GOAL)
    told = client.status_of(1, samples="300")
    late = planners.client(listens_to_tree=True)
    assert late.status_of(1)["revision"] == told["revision"]
    assert late.wait_for(lambda: late.paths, "the latched path")[0] == client.wait_for(lambda: client.paths, "it")[-1]
    assert len(late.wait_for(lambda: late.trees, "the tree")[0].markers) == 5


def test_the_tree_is_shown_and_cleared_by_the_next_request(asked):
    _, client = asked(tree=True, **QUICK)
    client.send("goal_pose", GOAL)
    client.status_of(1, samples="300")
    markers = client.wait_for(lambda: client.trees, "markers")[0].markers
    assert markers[0].action == Marker.DELETEALL
    assert {marker.ns for marker in markers[1:]} == {"tree", "start", "goal", "path"}
    client.send("goal_pose", invalid(x=math.nan))
    client.wait_for(lambda: len(client.trees[-1].markers) == 1, "the clearing")
    assert client.trees[-1].markers[0].action == Marker.DELETEALL


def test_no_tree_is_shown_where_it_is_not_wanted(asked):
    _, client = asked(tree=True, publish_tree=False, **QUICK)
    client.send("goal_pose", GOAL)
    client.status_of(1, samples="300")
    client.send("goal_pose", OCCUPIED)
    client.status_of(2)
    assert client.trees == []


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_idle_node(asked, by):
    process, _ = asked()
    assert_ends(process, by)


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_planning_node(asked, by):
    process, client = asked(**LONG)
    client.send("goal_pose", GOAL)
    client.status_of(1, error_name="NONE")
    assert_ends(process, by)


def assert_ends(process, by):
    status, took = process.end(by)
    assert status == 0, process.output
    assert took < 1.0
    assert "Traceback" not in process.output
    assert "did not stop" not in process.output


@pytest.mark.parametrize(("parameters", "words"), [
    ({"turning_radius": -1.0}, ["turning_radius is -1.0", "from 0.001"]),
    ({"planner": "dijkstra"}, ["planner is 'dijkstra'", "one of rrt, rrt_star"]),
    ({"wheelbase": 2.0}, ["wheelbase is 2 m", "set both"]),
    ({"map_file": "nowhere.yaml"}, ["nowhere.yaml"]),
])
def test_a_bad_configuration_ends_it_with_one_line(planners, parameters, words):
    process = planners.start(**parameters)
    assert process.wait() == 1
    lines = process.output.splitlines()
    assert len(lines) == 1, process.output
    assert lines[0].startswith("planner: ")
    assert all(word in lines[0] for word in words)


def test_a_parameter_file_that_is_not_there_is_named(planners):
    process = planners.start("--params-file", "nowhere.yaml")
    assert process.wait() == 1
    assert "Traceback" not in process.output
    assert "nowhere.yaml" in process.output.splitlines()[-1]
