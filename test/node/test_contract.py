"""The contract with the node's users, row by row: names, types, quality of service, status codes.

Through the executable and from another process, as its users see it.
"""

import itertools
import math
import re
import sys

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_srvs.srv import Trigger
from support.harness import poses_of, values_of
from support.yard import ENDLESS, GOAL, IN_THE_BOX, IN_THE_CHAMBER, IN_UNKNOWN, ON_THE_WAY_OUT, QUICK, START

LATCHED, VOLATILE = DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE
#: Of each topic the direction, the name after the namespace, the type and the durability; all are reliable.
TOPICS = [
    ("in", "start_pose", "geometry_msgs/msg/PoseStamped", VOLATILE),
    ("in", "initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped", VOLATILE),
    ("in", "goal_pose", "geometry_msgs/msg/PoseStamped", VOLATILE),
    ("in", "goal_poses", "geometry_msgs/msg/PoseArray", VOLATILE),
    ("in", "map", "nav_msgs/msg/OccupancyGrid", LATCHED),
    ("out", "plan", "nav_msgs/msg/Path", LATCHED),
    ("out", "map", "nav_msgs/msg/OccupancyGrid", LATCHED),
    ("out", "planner/tree", "visualization_msgs/msg/MarkerArray", LATCHED),
    ("out", "planner/status", "diagnostic_msgs/msg/DiagnosticStatus", LATCHED),
    ("out", "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", VOLATILE),
]
SERVICES = [
    ("planner/get_plan", "nav_msgs/srv/GetPlan"),
    ("planner/load_map", "nav_msgs/srv/LoadMap"),
    ("planner/get_map", "nav_msgs/srv/GetMap"),
    ("planner/cancel", "std_srvs/srv/Trigger"),
]
KEYS = ["plan_id", "revision", "error_code", "error_name", "request", "found_by", "planner", "samples", "tree_nodes",
        "path_length", "length",
        "lower_bound", "gap", "cost", "cost_lower_bound", "cost_gap", "roomy_share",
        "time_to_first", "time_to_found", "planning_time",
        "min_clearance", "max_curvature", "audit",
        "seed", "map_id", "stamp"]

OK, WARN, ERROR, STALE = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE)
#: Of each status that get_plan can end in the code, the name, the level, the start and goal (with their frame) and the
#: settings that lead to it, and what its message says.
STATUSES = [
    (0, "NONE", OK, START, GOAL, "map", QUICK, ["Path of"]),
    (202, "TF_ERROR", ERROR, START, GOAL, "nowhere", QUICK, ["'nowhere'", "'map'"]),
    (203, "START_OUTSIDE_MAP", ERROR, (-1.0, 5.0, 0.0), GOAL, "map", QUICK, ["-1", "10.00"]),
    (204, "GOAL_OUTSIDE_MAP", ERROR, START, (5.0, 10.5, 0.0), "map", QUICK, ["10.5", "10.00"]),
    (205, "START_OCCUPIED", ERROR, IN_THE_BOX, GOAL, "map", QUICK, ["clearance 0", "needed 0.2"]),
    (205, "START_OCCUPIED", ERROR, IN_UNKNOWN, GOAL, "map", QUICK, ["clearance 0", "needed 0.2", "unknown"]),
    (206, "GOAL_OCCUPIED", ERROR, START, IN_THE_BOX, "map", QUICK, ["clearance 0", "needed 0.2"]),
    (206, "GOAL_OCCUPIED", ERROR, START, IN_UNKNOWN, "map", QUICK, ["clearance 0", "needed 0.2", "unknown"]),
    (207, "TIMEOUT", ERROR, START, ON_THE_WAY_OUT, "map", ENDLESS | {"planning_time": 0.05}, ["planning_time", "0.05"]),
    (207, "TIMEOUT", ERROR, START, ON_THE_WAY_OUT, "map", QUICK | {"informed": False}, ["300 of 300"]),
    (208, "NO_VALID_PATH", ERROR, START, IN_THE_CHAMBER, "map", QUICK, ["No path"]),
    (212, "INVALID_POSE", ERROR, START, (math.nan, 5.0, 0.0), "map", QUICK, ["finite"]),
    (212, "INVALID_POSE", ERROR, (math.inf, 5.0, 0.0), GOAL, "map", QUICK, ["finite"]),
]


@pytest.fixture(scope="module")
def with_file(module_planners, map_file):
    """A planner with a map file, all else by default, and its client."""
    process = module_planners.start(map_file=map_file)
    client = module_planners.client()
    client.listen_to_diagnostics()
    return process, client


@pytest.fixture(scope="module")
def without_file(module_planners, with_file):
    """The client of a planner that waits for a map on its topic."""
    module_planners.start(**QUICK)
    return module_planners.client()


@pytest.fixture(scope="module")
def volatile(module_planners, with_file):
    """The client of a planner with map_transient_local false."""
    module_planners.start(map_transient_local=False)
    return module_planners.client()


def endpoints(client, direction, topic):
    """What the planner in the client's namespace has on a topic, as this process sees it."""
    look = client.node.get_subscriptions_info_by_topic if direction == "in" else client.node.get_publishers_info_by_topic
    return [found for found in look(client.node.resolve_topic_name(topic))
            if (found.node_name, found.node_namespace) == ("planner", client.node.get_namespace())]


# Topics

@pytest.mark.parametrize(("direction", "topic", "kind", "durability"), TOPICS, ids=[f"{row[0]} {row[1]}" for row in TOPICS])
def test_a_topic_has_its_name_type_and_quality(with_file, without_file, direction, topic, kind, durability):
    client = without_file if (direction, topic) == ("in", "map") else with_file[1]
    found, = client.wait_for(lambda: endpoints(client, direction, topic), f"{topic} of the planner")
    assert found.topic_type == kind
    assert (found.qos_profile.reliability, found.qos_profile.durability) == (ReliabilityPolicy.RELIABLE, durability)


def test_the_map_s_topic_is_volatile_where_the_parameter_says_so(volatile):
    found, = volatile.wait_for(lambda: endpoints(volatile, "in", "map"), "map of the planner")
    assert (found.qos_profile.reliability, found.qos_profile.durability) == (ReliabilityPolicy.RELIABLE, VOLATILE)


def test_the_map_is_published_or_subscribed_to_and_not_both(with_file, without_file):
    client = with_file[1]
    client.wait_for(lambda: endpoints(client, "out", "map"), "map of the planner")
    without_file.wait_for(lambda: endpoints(without_file, "in", "map"), "map of the planner")
    assert endpoints(client, "in", "map") == endpoints(without_file, "out", "map") == []


@pytest.mark.parametrize(("name", "kind"), SERVICES, ids=[row[0] for row in SERVICES])
def test_a_service_has_its_name_and_type(with_file, name, kind):
    _, client = with_file
    namespace = client.node.get_namespace()

    def kinds():
        try:
            found = client.node.get_service_names_and_types_by_node("planner", namespace)
        except NodeNameNonExistentError:  # not yet
            return None
        return dict(found).get(f"{namespace}/{name}")

    assert client.wait_for(kinds, f"the service {name}") == [kind]


def test_every_name_is_relative_and_can_be_remapped(module_planners, with_file):
    """Also the node's own names, which stand below its name."""
    _, client = with_file
    outputs = ["plan", "map", "~/tree", "~/status"]
    inputs = ["start_pose", "initialpose", "goal_pose", "goal_poses"]
    services = [f"~/{name.removeprefix('planner/')}" for name, _ in SERVICES]
    names = [*outputs, *inputs, *services, "/diagnostics"]
    others = {name: f"elsewhere/{name.strip('~/')}" for name in names}
    rules = [part for name, other in others.items() for part in ("-r", f"{name}:={other}")]
    process = module_planners.start(*rules, "-r", "__node:=chauffeur", map_file="block")
    namespace = process.name.removesuffix("/planner")

    def has(look, wanted):
        try:
            found = {name for name, _ in look("chauffeur", namespace)}
        except NodeNameNonExistentError:  # not yet
            return False
        return found >= {f"{namespace}/{others[name]}" for name in wanted} and not found & {f"{namespace}/{n}" for n in wanted}

    node = client.node
    client.wait_for(lambda: has(node.get_publisher_names_and_types_by_node, [*outputs, "/diagnostics"]), "the outputs elsewhere")
    client.wait_for(lambda: has(node.get_subscriber_names_and_types_by_node, inputs), "the inputs elsewhere")
    client.wait_for(lambda: has(node.get_service_names_and_types_by_node, services), "the services elsewhere")


# Status

@pytest.mark.parametrize(("code", "name", "level", "start", "goal", "frame", "settings", "words"), STATUSES,
                         ids=[f"{row[0]} {row[1]} {' '.join(row[-1])}" for row in STATUSES])
def test_a_status_has_its_code_name_and_level(with_file, code, name, level, start, goal, frame, settings, words):
    process, client = with_file
    client.set_parameters(**settings)
    path, told = client.plan(start, goal, frame=frame)
    assert (told["error_code"], told["error_name"], told["level"]) == (str(code), name, level)
    assert told["name"] == f"{process.name}: planner"
    assert all(word in told["message"] for word in words)
    assert told["message"].endswith(".") and told["message"].isprintable()
    assert (len(path.poses) > 0) == (code == 0)
    assert path.header.frame_id == "map"


def test_210_no_map_says_what_is_waited_for(without_file):
    told = without_file.status_of(0)
    assert (told["error_code"], told["error_name"], told["level"]) == ("210", "NO_MAP", STALE)
    assert without_file.node.resolve_topic_name("map") in told["message"]


def test_211_no_start_names_the_topics_of_a_start(module_planners, with_file, map_file):
    module_planners.start(map_file=map_file)
    client = module_planners.client()
    client.send("goal_pose", GOAL)
    told = client.status_of(1)
    assert (told["error_code"], told["error_name"], told["level"]) == ("211", "NO_START", ERROR)
    for topic in ("start_pose", "initialpose"):
        assert client.node.resolve_topic_name(topic) in told["message"]


def test_213_cancelled_before_a_first_path(with_file):
    _, client = with_file
    client.set_parameters(**ENDLESS)
    future, plan_id = client.begin_plan(START, ON_THE_WAY_OUT)
    client.call(Trigger, "cancel")
    told = client.status_of(plan_id)
    assert (told["error_code"], told["error_name"], told["level"]) == ("213", "CANCELLED", WARN)
    assert client.response(future).plan.poses == []


#: The node's own main, but the first call of plan() raises: a defect that nobody foresaw.
FAULTY = """
import sys
from dubins_rrt_ros.node import main, request

plan, calls = request.plan, []

def fail_once(*args, **kwargs):
    calls.append(args)
    if len(calls) == 1:
        raise ZeroDivisionError("injected for the test")
    return plan(*args, **kwargs)

request.plan = fail_once
sys.exit(main.main())
"""


@pytest.mark.slow
@pytest.mark.parametrize("by", ["topic", "service"])
def test_200_a_defect_is_logged_with_its_trace_and_the_node_lives_on(planners, map_file, by):
    process = planners.start(command=[sys.executable, "-c", FAULTY], map_file=map_file, **QUICK)
    client = planners.client()
    if by == "topic":
        client.send("start_pose", START)
        client.send("goal_pose", GOAL)
        told = client.status_of(1)
        path = client.wait_for(lambda: client.paths, "an empty path")[0]
    else:
        path, told = client.plan(START, GOAL)
    assert (told["error_code"], told["error_name"], told["level"]) == ("200", "UNKNOWN", ERROR)
    assert "ZeroDivisionError: injected for the test" in told["message"]
    assert (path.header.frame_id, path.poses) == ("map", [])
    for words in ("Traceback (most recent call last)", "in fail_once", "ZeroDivisionError: injected for the test"):
        client.wait_for_word(words)
    path, told = client.plan(START, GOAL)
    assert (told["plan_id"], told["error_name"]) == ("2", "NONE")
    assert poses_of(path)[-1] == pytest.approx(GOAL, abs=1e-9)
    if by == "topic":
        client.send("goal_pose", GOAL)
        assert client.status_of(3, samples="300")["error_name"] == "NONE"
    assert process.running


def test_the_values_of_every_status_are_the_contract_s_in_its_order(with_file, without_file):
    _, client = with_file
    client.set_parameters(**QUICK)
    for start, goal in ((START, GOAL), (START, IN_THE_BOX)):
        client.plan(start, goal)
    without_file.status_of(0)
    for status in (*client.statuses, *without_file.statuses):
        assert [item.key for item in status.values] == KEYS


def test_the_values_are_numbers_where_there_is_a_path(with_file):
    _, client = with_file
    client.set_parameters(**QUICK)
    path, told = client.plan(START, GOAL)
    for key in KEYS:
        if key not in ("error_name", "request", "found_by", "roomy_share", "planner", "audit", "map_id"):
            assert math.isfinite(float(told[key])), key
    assert (told["planner"], told["audit"], told["seed"], told["samples"]) == ("rrt_star", "ok", "1", "300")
    assert float(told["gap"]) == pytest.approx(float(told["path_length"]) / float(told["lower_bound"]) - 1)
    assert float(told["min_clearance"]) >= 0.2
    assert float(told["max_curvature"]) <= 1.0 + 1e-6
    assert re.fullmatch(r"[0-9a-f]+", told["map_id"])
    steps = np.linalg.norm(np.diff(poses_of(path)[:, :2], axis=0), axis=1)
    assert steps.sum() == pytest.approx(float(told["path_length"]), rel=1e-3)


def test_a_start_that_comes_while_planning_takes_effect_for_the_next_request(with_file):
    _, client = with_file
    client.set_parameters(**ENDLESS)
    client.send("start_pose", START)
    plan_id = client.next_id
    client.send("goal_pose", GOAL)
    client.status_of(plan_id, error_name="NONE")
    client.wait_for(lambda: client.paths, "its path")
    client.send("start_pose", other := (1.5, 2.0, 0.0))
    client.call(Trigger, "cancel")
    assert {tuple(poses_of(path)[0]) for path in client.paths if path.poses} == {START}
    client.set_parameters(**QUICK)

    def starts_there():
        plan_id, published = client.next_id, len(client.paths)
        client.send("goal_pose", GOAL)
        client.status_of(plan_id, samples="300")
        return tuple(poses_of(client.wait_for(lambda: client.paths[published:], "a path")[0])[0]) == other

    client.wait_for(starts_there, "a path from the other start")


# Diagnostics

@pytest.mark.slow
def test_diagnostics_repeat_the_last_status_about_once_a_second(with_file):
    _, client = with_file
    client.set_parameters(**QUICK)
    _, told = client.plan(START, IN_THE_BOX)
    heard = []
    subscription = client.node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)

    def ours():
        return [message for message in heard if any(status.name == told["name"] for status in message.status)]

    client.wait_for(lambda: len(ours()) >= 4, "four diagnostics")
    client.node.destroy_subscription(subscription)
    assert {len(message.status) for message in ours()} == {1}
    for message in ours():
        assert (message.status[0].level, message.status[0].message) == (told["level"], told["message"])
        assert values_of(message.status[0]).items() <= told.items()
    stamps = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in ours()]
    assert 0.5 < np.mean([later - earlier for earlier, later in itertools.pairwise(stamps)]) < 2.0
    # A new event takes the place of the old one.
    _, told = client.plan(START, GOAL)
    client.wait_for(lambda: client.diagnostics[-1].message == told["message"], "the new status in the diagnostics")
