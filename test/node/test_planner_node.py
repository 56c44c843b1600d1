"""The node as a process of its own, over real topics: a start and a goal become a path, a status and a tree."""

import array
import math
import signal

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile
from support.conversation import Conversation
from support.harness import assert_says, poses_of
from visualization_msgs.msg import Marker

from dubins_rrt_ros.planning import OCCUPIED as OCCUPIED_CELL
from dubins_rrt_ros.planning import GridMap, save_map

START, GOAL, BEHIND, OCCUPIED = (1.5, 5.0, 0.0), (8.5, 5.0, 0.5), (1.5, 2.0, -2.0), (5.0, 5.0, 0.0)
QUICK = {"planner": "rrt_star", "samples": 300, "planning_time": 15.0, "seed": 1}
NOWHERE = Pose(position=Point(x=math.nan))


@pytest.fixture(scope="module")
def at_work(module_planners, tmp_path_factory):
    """A planner on a map of 10 m x 10 m with a box of 2 m in its middle, and its client, for many tests."""
    cells = np.zeros((100, 100), np.int8)
    cells[40:60, 40:60] = OCCUPIED_CELL
    file = tmp_path_factory.mktemp("map") / "box.yaml"
    save_map(GridMap(cells, 0.1), file)
    process = module_planners.start(map_file=str(file), path_spacing=0.1, **QUICK)
    return Conversation(process, module_planners.client(listens_to_tree=True))


@pytest.fixture
def talk(at_work):
    """The same, with a start."""
    at_work.start(START)
    at_work.client.paths.clear()
    at_work.client.trees.clear()
    return at_work


def path_to(talk, goal):
    """The last path, once it is one to this goal."""
    def find():
        path = talk.client.paths[-1] if talk.client.paths else None
        return path if path and path.poses and tuple(poses_of(path)[-1, :2]) == goal[:2] else None
    return talk.client.wait_for(find, "the path")


def test_a_goal_is_answered_with_a_path_from_the_start_to_exactly_there(talk):
    told = talk.goal(GOAL, samples="300")
    path = talk.client.wait_for(lambda: is_of(told, talk.client.paths[-1]) and talk.client.paths[-1], "its path")
    found = poses_of(path)
    assert found[0].tolist() == list(START)
    assert found[-1, :2].tolist() == list(GOAL[:2])
    assert found[-1, 2] == pytest.approx(GOAL[2], abs=1e-12)
    assert np.linalg.norm(np.diff(found[:, :2], axis=0), axis=1).max() <= 0.1 + 1e-9
    assert {p.header.frame_id for p in path.poses} == {path.header.frame_id} == {"map"}
    assert {(p.header.stamp.sec, p.header.stamp.nanosec) for p in path.poses} \
        == {(path.header.stamp.sec, path.header.stamp.nanosec)}
    now = talk.client.node.get_clock().now().nanoseconds * 1e-9
    assert 0 <= now - (path.header.stamp.sec + path.header.stamp.nanosec * 1e-9) < 60


def is_of(told, path):
    """Whether a path has the length that was told."""
    steps = np.linalg.norm(np.diff(poses_of(path)[:, :2], axis=0), axis=1)
    return steps.sum() == pytest.approx(float(told["path_length"]), rel=1e-3)


def test_the_status_of_a_path_tells_all_figures(talk):
    told = talk.goal(GOAL, samples="300")
    assert told["level"] == DiagnosticStatus.OK
    assert told["name"] == f"{talk.process.name}: planner"
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


def test_rrt_ends_with_its_first_path_and_a_fresh_seed_is_reported(talk):
    talk.client.set_parameters(planner="rrt", samples=100_000, seed=-1)
    told = talk.goal(GOAL, revision="2")
    talk.client.set_parameters(**QUICK)
    assert (told["error_name"], told["planner"]) == ("NONE", "rrt")
    assert told["samples"] == "0"  # hybrid A* found it
    assert int(told["seed"]) >= 0


def test_start_equal_to_goal_is_one_pose(talk):
    told = talk.goal(START, error_name="NONE")
    assert poses_of(path_to(talk, START)).tolist() == [list(START)]
    assert float(told["path_length"]) == 0.0


def test_an_occupied_goal_empties_the_path_and_a_good_goal_is_answered_after_it(talk):
    told = talk.goal(OCCUPIED)
    assert_says(told, "206", "GOAL_OCCUPIED", "needed 0.2")
    assert told["level"] == DiagnosticStatus.ERROR
    path = talk.client.wait_for(lambda: talk.client.paths and talk.client.paths[-1], "an empty path")
    assert (path.header.frame_id, len(path.poses)) == ("map", 0)
    assert talk.goal(GOAL)["error_name"] == "NONE"
    assert len(path_to(talk, GOAL).poses) > 1


def test_a_goal_before_any_start_says_so(at_work):
    told = at_work.refused_start(NOWHERE)
    assert_says(told, "212", "INVALID_POSE", "finite")
    assert told["level"] == DiagnosticStatus.ERROR
    assert_says(at_work.goal(GOAL), "211", "NO_START", "start_pose", "initialpose", "finite")


def test_initialpose_is_a_start(talk):
    talk.start(BEHIND, "initialpose")
    assert talk.goal(GOAL)["error_name"] == "NONE"
    assert poses_of(path_to(talk, GOAL))[0] == pytest.approx(BEHIND)


def test_a_pose_without_a_frame_is_in_the_global_frame(planners, map_yaml):
    planners.start(map_file=str(map_yaml), global_frame="world", **QUICK)
    client = planners.client()
    client.send("start_pose", START, frame="")
    client.send("goal_pose", GOAL, frame="")
    client.status_of(1, error_name="NONE")
    assert client.wait_for(lambda: client.paths, "a path")[0].header.frame_id == "world"


def test_who_comes_late_gets_the_last_path_status_and_tree(talk, module_planners):
    talk.goal(GOAL, samples="300")
    late = module_planners.client(listens_to_tree=True)
    latched = late.status_of(talk.asked, samples="300")
    assert latched == talk.client.status_of(talk.asked, revision=latched["revision"])
    assert late.wait_for(lambda: late.paths, "the latched path")[0] == path_to(talk, GOAL)
    assert len(late.wait_for(lambda: late.trees, "the tree")[0].markers) == 5


def test_the_tree_is_shown_and_cleared_by_the_next_request(talk):
    trees = talk.client.trees
    talk.goal(GOAL, samples="300")
    markers = talk.client.wait_for(lambda: trees and len(trees[-1].markers) == 5 and trees[-1].markers, "markers")
    assert markers[0].action == Marker.DELETEALL
    assert {marker.ns for marker in markers[1:]} == {"tree", "start", "goal", "path"}
    talk.goal(NOWHERE)
    talk.client.wait_for(lambda: len(trees[-1].markers) == 1, "the clearing")
    assert trees[-1].markers[0].action == Marker.DELETEALL


def test_no_tree_is_shown_where_it_is_not_wanted(talk):
    trees = talk.client.trees
    talk.goal(GOAL, samples="300")
    talk.client.wait_for(lambda: trees and len(trees[-1].markers) == 5, "the tree")
    talk.client.set_parameters(publish_tree=False)
    trees.clear()
    talk.goal(GOAL, samples="300")
    talk.client.wait_for(lambda: trees, "the clearing")
    talk.goal(OCCUPIED)
    talk.client.set_parameters(publish_tree=True)
    assert [len(tree.markers) for tree in trees] == [1]


def test_nothing_that_was_asked_was_a_defect(at_work):
    assert "Traceback" not in at_work.process.output


# The map

def occupancy(width=100):
    message = OccupancyGrid(data=array.array("b", bytes(100 * 100)))
    message.header.frame_id = "map"
    message.info.width, message.info.height, message.info.resolution = width, 100, 0.1
    return message


@pytest.mark.slow
def test_without_a_map_it_waits_for_one_and_plans_once_it_is_there(planners):
    talk = Conversation(planners.start(**QUICK), planners.client())
    client = talk.client
    told = client.status_of(0)
    assert_says(told, "210", "NO_MAP", talk.process.name.replace("/planner", "/map"))
    assert told["level"] == DiagnosticStatus.STALE
    client.send("start_pose", START)
    told = talk.goal(GOAL)
    assert (told["level"], told["error_code"]) == (DiagnosticStatus.STALE, "210")
    client.publish_map(occupancy(width=7))
    told = client.wait_for(lambda: next((s for s in client.statuses if "7 x 100" in s.message), None), "the refusal")
    assert told.level == DiagnosticStatus.STALE
    assert "no map yet" in told.message
    client.publish_map(occupancy())
    client.wait_for(lambda: "Took a map" in talk.process.output, "the map to be taken")
    assert talk.goal(GOAL, error_name="NONE")["map_id"]


@pytest.mark.slow
def test_a_map_that_came_before_the_node_is_taken(planners):
    first = planners.start(**QUICK)
    client = planners.client()
    client.publish_map(occupancy())
    client.wait_for(lambda: "Took a map" in first.output, "the map to be taken")
    assert first.end(signal.SIGINT) == 0
    second = planners.restart(**QUICK)
    client.follow(second)
    client.wait_for(lambda: "Took a map" in second.output, "the latched map to be taken")


@pytest.mark.slow
def test_a_volatile_map_is_taken_where_the_parameter_says_so(planners):
    process = planners.start(map_transient_local=False)
    client = planners.client()
    client.publish_map(occupancy(), QoSProfile(depth=1, durability=DurabilityPolicy.VOLATILE))
    assert client.wait_for(lambda: "Took a map of 100 x 100" in process.output, "the map to be taken")


def test_the_map_file_is_published(at_work):
    at_work.client.listen_to_map()
    grid = at_work.client.wait_for(lambda: at_work.client.maps, "the map")[0]
    assert (grid.info.width, grid.info.height, grid.header.frame_id) == (100, 100, "map")
    assert np.array(grid.data).reshape(100, 100)[50, 50] == 100
    assert sum(grid.data) == 100 * 20 * 20
