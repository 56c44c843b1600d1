"""Whatever comes in, the node says what is wrong with it and what to do, and answers the next good goal."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from support.conversation import Conversation
from support.harness import assert_says, occupancy

from dubins_rrt_ros.node.conversions import pose_message
from dubins_rrt_ros.planning import OCCUPIED, UNKNOWN, GridMap, save_map

#: On a map of 10 m x 10 m with a box of 2 m in its middle.
START, GOAL = (1.5, 5.0, 0.0), (8.5, 5.0, 0.5)
IN_THE_BOX, IN_THE_UNKNOWN = (5.0, 5.0, 0.0), (9.0, 9.0, 0.0)
QUICK = {"planner": "rrt", "samples": 3000, "planning_time": 15.0, "seed": 1}
NAN, INF = math.nan, math.inf


def box():
    """A grid with a box in its middle and a corner that is unknown."""
    cells = np.zeros((100, 100), np.int8)
    cells[40:60, 40:60] = OCCUPIED
    cells[80:, 80:] = UNKNOWN
    return GridMap(cells, 0.1)


@pytest.fixture(scope="module")
def on_a_file(module_planners, tmp_path_factory):
    """A planner on a map file, for all tests."""
    file = tmp_path_factory.mktemp("maps") / "box.yaml"
    save_map(box(), file)
    process = module_planners.start(map_file=str(file), **QUICK)
    return Conversation(process, module_planners.client())


@pytest.fixture
def talk(on_a_file):
    with on_a_file.going_on(START, GOAL, box().id):
        yield on_a_file


# Poses

def at(**coordinates):
    """A pose that is not turned, at these coordinates."""
    return Pose(position=Point(**{"x": 2.0, "y": 2.0, **coordinates}))


def turned(**components):
    """A pose whose quaternion has these components, and else zeros."""
    return Pose(position=Point(x=2.0, y=2.0), orientation=Quaternion(**{"w": 0.0, **components}))


POSITIONS = [(at(**{axis: value}), [f"{axis} {value}", "finite"]) for axis in "xyz" for value in (NAN, INF, -INF)]
ROTATIONS = [(turned(**components), ["no rotation", "norm", "normalise"]) for components in (
    {}, {"w": 9e-4}, {"z": 5e-4, "w": 5e-4}, {"w": 1e-300}, {"z": 1.7e308, "w": 1.7e308}, {"w": NAN}, {"w": INF}, {"w": -INF},
    {"z": NAN, "w": 1.0}, {"x": NAN, "w": 1.0}, {"y": INF, "w": 1.0})]
VERTICAL = [(turned(y=math.sin(angle / 2), w=math.cos(angle / 2)), ["x axis is vertical", "no yaw"])
            for angle in (math.pi / 2, -math.pi / 2, math.radians(89.5))]


def said_of(talk, way, pose, frame="map"):
    """The status after a pose that came in one of the node's ways."""
    if way in ("start_pose", "initialpose"):
        return talk.refused_start(pose, frame, way)
    if way == "goal_pose":
        talk.start(START)
        # The start has come now: a megabyte right after it can push it out of the transport's buffer, to come seconds later.
        assert talk.goal(START)["error_name"] == "NONE"
        return talk.goal(pose, frame)
    bad = PoseStamped(pose=pose)
    bad.header.frame_id = frame
    told, poses = talk.plan(bad, GOAL) if way == "start of get_plan" else talk.plan(START, bad)
    assert poses == []
    return told


WAYS = {"start_pose": "start", "initialpose": "start", "goal_pose": "goal", "start of get_plan": "start",
        "goal of get_plan": "goal"}


@pytest.mark.parametrize(("pose", "words"), POSITIONS + ROTATIONS + VERTICAL)
def test_a_pose_that_is_none_is_refused_whichever_way_it_comes(talk, pose, words):
    for way, name in WAYS.items():
        assert_says(said_of(talk, way, pose), "212", "INVALID_POSE", f"The {name} pose", *words)


@pytest.mark.parametrize("frame", ["odom", "/map", "map ", "Map", "a" * 200])
def test_a_pose_in_a_frame_that_nobody_knows_is_refused_whichever_way_it_comes(talk, frame):
    for way, name in WAYS.items():
        assert_says(said_of(talk, way, at(), frame), "202", "TF_ERROR", f"The {name} pose", f"'{frame}'", "'map'")


def test_for_slash_map_it_is_the_slash_that_is_to_be_left_out_whichever_way_the_pose_comes(talk):
    for way in WAYS:
        told = said_of(talk, way, at(), "/map")
        assert_says(told, "202", "TF_ERROR", "in frame '/map'", "leading slash; leave it out")
        assert "publish that transform" not in told["message"]


#: Names that would forge lines of the log, clear the screen, or fill the disk.
FORGED = ["map\n[ERROR] [1.0] [planner]: forged", "\x1b[2J\x1b[31mred\x1b[0m", "a\rb\u2028c\u202ed", "x" * 1_000_000]


@pytest.mark.parametrize("frame", FORGED, ids=["lines", "escapes", "separators", "long"])
def test_a_frame_from_outside_is_told_quoted_on_one_line_and_cut(talk, frame):
    said = len(talk.process.output)
    for way, name in WAYS.items():
        told = said_of(talk, way, at(), frame)
        assert_says(told, "202", "TF_ERROR", f"The {name} pose is in frame '", "'map'")
        assert told["message"].isprintable() and len(told["message"]) < 600
    lines = talk.process.output[said:].splitlines()
    assert [line for line in lines if not line.isprintable() or line.startswith("[ERROR] [1.0]") or len(line) > 800] == []


@pytest.mark.parametrize("pose", [
    at(x=8.5, z=1e300), turned(w=-1.0), turned(w=1.0005), turned(z=-0.70711, w=0.70711), turned(x=0.004, w=1.0), turned(w=0.9),
    turned(w=2.0), turned(w=1e300), turned(z=0.5, w=0.5), turned(z=0.7, w=0.7), turned(x=1.0, y=1.0, z=1.0, w=1.0),
    turned(x=math.sin(0.25), w=math.cos(0.25)), turned(y=math.sin(0.05), w=math.cos(0.05)), turned(x=1.0), turned(y=-1.0)])
def test_a_pose_that_is_rounded_leans_or_is_in_the_air_is_taken(talk, pose):
    talk.start(START)
    assert talk.goal(pose)["error_name"] == "NONE"
    assert talk.plan(pose, GOAL)[0]["error_name"] == "NONE"


@pytest.mark.parametrize(("components", "words"), [
    ({"y": math.sin(0.1), "w": math.cos(0.1)}, "leans by 11.5 degrees"), ({"w": 2.0}, "norm 2")])
def test_what_is_unusual_about_a_pose_is_warned_of_once(module_planners, talk, components, words):
    process = module_planners.start(**QUICK)
    client = module_planners.client()
    client.publish_map(occupancy(box().data))
    client.wait_for_word("The map is ready")
    fresh = Conversation(process, client)
    for _ in range(3):
        fresh.plan(turned(**components), GOAL)
        fresh.plan(START, turned(**components))
    client.wait_for_word(f"The goal pose {'leans' if 'y' in components else 'has'}")
    warnings = [line for line in process.output.splitlines() if words in line]
    assert [line for line in warnings if "WARN" in line] == warnings
    assert len(warnings) == 2, "one for the start and one for the goal"


def test_a_goal_without_a_rotation_is_taken_where_any_heading_will_do(talk):
    talk.client.set_parameters(any_goal_heading=True)
    try:
        talk.start(START)
        for told in (talk.goal(turned()), talk.plan(START, turned())[0]):
            assert (told["error_name"], told["level"]) == ("NONE", DiagnosticStatus.OK), told["message"]
            assert "rad from the goal" not in told["message"]
        assert_says(talk.plan(turned(), GOAL)[0], "212", "INVALID_POSE", "no rotation")
    finally:
        talk.client.set_parameters(any_goal_heading=False)


def said_of_start(talk, way, start):
    if way == "get_plan":
        return talk.plan(start, GOAL)[0]
    talk.start(start, way)
    return talk.goal(GOAL)


def said_of_goal(talk, way, goal):
    if way == "get_plan":
        return talk.plan(START, goal)[0]
    talk.start(START)
    return talk.goal(goal)


UNUSABLE = [
    *[((x, y, 0.0), "OUTSIDE_MAP", [f"({x:.6g}, {y:.6g}) is {far}", "m outside the map"]) for x, y, far in (
        (-0.01, 5.0, "0.01"), (10.01, 5.0, "0.01"), (5.0, -3.0, "3"), (5.0, 12.5, "2.5"), (1e9, -1e9, "1"), (1e300, 5.0, "1"),
        (5.0, -1e300, "1"), (1.7e308, -1.7e308, ""))],
    ((0.0, 0.0, 0.0), "OCCUPIED", ["occupied", "clearance 0", "needed 0.2"]),
    (IN_THE_BOX, "OCCUPIED", ["occupied", "clearance 0", "needed 0.2"]),
    ((3.9, 5.0, 0.0), "OCCUPIED", ["occupied", "clearance 0.1", "needed 0.2"]),
    (IN_THE_UNKNOWN, "OCCUPIED", ["unknown", "allow_unknown", "needed 0.2"]),
]


@pytest.mark.parametrize(("pose", "kind", "words"), UNUSABLE)
def test_a_start_or_goal_that_cannot_be_driven_to_is_refused_with_figures(talk, pose, kind, words):
    start, goal = {"OUTSIDE_MAP": ("203", "204"), "OCCUPIED": ("205", "206")}[kind]
    told = [(said_of_start(talk, way, pose), start, f"START_{kind}") for way in ("start_pose", "initialpose", "get_plan")]
    told += [(said_of_goal(talk, way, pose), goal, f"GOAL_{kind}") for way in ("goal_pose", "get_plan")]
    for status, code, name in told:
        assert_says(status, code, name, *words)
        assert len(status["message"]) < 300  # also where its figures are large


@pytest.mark.parametrize("way", ["goal_pose", "get_plan"])
@pytest.mark.parametrize("start", [START, (2.0, 2.0, 3.0), (8.0, 3.0, -math.pi)])
def test_a_start_equal_to_the_goal_is_one_pose(talk, way, start):
    if way == "get_plan":
        told, poses = talk.plan(start, start)
    else:
        talk.start(start)
        talk.client.paths.clear()
        told = talk.goal(start)
        poses = talk.client.wait_for(lambda: talk.client.paths and talk.client.paths[-1].poses, "the path")
    assert_says(told, "0", "NONE", "Path of 0.00 m")
    assert [item.pose for item in poses] == [pose_message(start)]


@pytest.mark.parametrize("offset", [
    (1e-12, 0.0, 0.0), (1e-6, 0.0, 0.0), (0.0, 1e-6, 0.0), (0.0, 0.0, 1e-6), (0.0, 0.0, -1e-6), (0.01, 0.0, 0.0),
    (-0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.01), (0.0, 0.0, math.pi)])
def test_a_goal_right_beside_the_start_ends_in_a_path_or_in_advice(talk, offset):
    start = (2.5, 2.5, 0.3)
    goal = tuple(np.add(start, offset).tolist())
    told, poses = talk.plan(start, goal)
    if told["error_name"] == "NONE":
        assert told["audit"] == "ok"
        ends = [(pose.pose.position.x, pose.pose.position.y) for pose in (poses[0], poses[-1])]
        assert ends == [start[:2], pytest.approx(goal[:2], abs=1e-9)]
    else:
        assert_says(told, "207", "TIMEOUT", "time", "goal_tolerance")
        assert poses == []


@pytest.mark.parametrize("tolerance", [NAN, INF, -INF, -0.1, 1e7, 3e38])
def test_a_tolerance_that_is_none_is_refused(talk, tolerance):
    told, poses = talk.plan(START, GOAL, tolerance=tolerance)
    assert_says(told, "212", "INVALID_POSE", "tolerance", "from 0 to 1e+06")
    assert poses == []


# Parameters

REFUSED = [
    *[(name, value) for name, bad in {
        "planner": ("dijkstra", "", "RRT"), "samples": (0, -1, 10_000_001, 2**63 - 1), "planning_time": (0.0, -1.0, 3601.0, NAN),
        "turning_radius": (0.0, -1.0, 1e5, NAN, -INF), "robot_radius": (-0.1, 1e4, NAN), "goal_bias": (-0.1, 1.1, NAN),
        "step_size": (-1.0, 1e7), "heading_sampling": ("north",), "goal_tolerance_xy": (-1.0, INF),
        "goal_tolerance_yaw": (-0.1, 4.0), "path_spacing": (-0.1, 0.0005, 1e4), "seed": (-2, 2**31),
        "max_map_cells": (0, -5)}.items() for value in bad],
    ("samples", 300.0), ("samples", "300"), ("samples", True), ("samples", [300]), ("samples", None), ("planner", 1),
    ("planner", ["rrt"]), ("planner", None), ("turning_radius", "1.0"), ("turning_radius", True), ("turning_radius", [1.0]),
    ("turning_radius", None), ("publish_tree", "yes"), ("publish_tree", 1), ("publish_tree", None), ("any_goal_heading", 0),
    ("wheelbase", 2.0), ("max_steering_angle", 0.5), ("map_file", "maze"), ("global_frame", "world"), ("global_frame", ""),
    ("map_transient_local", False),
]


def read(client, name):
    """A parameter's value, as the message that get_parameters gives."""
    return client.call(GetParameters, "get_parameters", names=[name]).values[0]


@pytest.mark.parametrize(("name", "value"), REFUSED)
def test_a_bad_parameter_is_refused_with_the_reason_and_the_old_value_holds(talk, name, value):
    client, before = talk.client, str(read(talk.client, name))
    message = Parameter(name, value=value).to_parameter_msg()
    alone = client.call(SetParameters, "set_parameters", parameters=[message]).results[0]
    with_a_good_one = client.set_parameters(**{"publish_tree": False, name: value})
    for result in (alone, with_a_good_one):
        assert not result.successful
        assert name in result.reason
    assert str(read(client, name)) == before
    assert read(client, "publish_tree").bool_value


def test_parameters_that_are_set_one_by_one_are_taken_one_by_one(talk):
    messages = [Parameter(name, value=value).to_parameter_msg()
                for name, value in (("goal_bias", 0.1), ("samples", -1), ("no_such", 1), ("goal_bias", 0.05))]
    results = talk.client.call(SetParameters, "set_parameters", parameters=messages).results
    assert [result.successful for result in results] == [True, False, False, True]
    assert results[2].reason == "There is no parameter 'no_such'; planner --help lists the parameters"
    assert "did you mean 'turning_radius'?" in talk.client.set_parameters(goal_bias=0.2, turnig_radius=1.0).reason
    assert read(talk.client, "goal_bias").double_value == 0.05


def test_a_value_in_whose_place_another_one_is_used_is_told_when_it_is_set(talk):
    said = len(talk.process.output)
    try:
        assert talk.client.set_parameters(footprint="[[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]").successful
        assert talk.client.set_parameters(robot_radius=0.2, turning_radius=1.5).successful  # the first stays as it was
        assert talk.client.set_parameters(robot_radius=0.25).successful
        talk.client.wait_for_word("robot_radius has no effect, as footprint takes its place")
        assert talk.client.set_parameters(any_goal_heading=True).successful
        assert talk.client.set_parameters(goal_tolerance_yaw=0.1).successful
        talk.client.wait_for_word("goal_tolerance_yaw has no effect, as any_goal_heading takes its place")
    finally:
        assert talk.client.set_parameters(footprint="", robot_radius=0.2, turning_radius=1.0, any_goal_heading=False,
                                          goal_tolerance_yaw=0.0).successful
    assert talk.process.output[said:].count("has no effect") == 2
