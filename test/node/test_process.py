"""The node as a process: its command line, its configuration, its signals, and the end of those whom it talks to."""

import signal
import subprocess
import sys

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from nav_msgs.srv import LoadMap
from rcl_interfaces.srv import GetParameters
from std_srvs.srv import Trigger
from support import client_to_kill
from support.conversation import Conversation

from dubins_rrt_ros.node.conversions import grid_message
from dubins_rrt_ros.node.parameters import OPTIONS
from dubins_rrt_ros.planning import OCCUPIED, GridMap, save_map

START, GOAL = (1.5, 5.0, 0.0), (8.5, 5.0, 0.5)
QUICK = {"planner": "rrt", "planning_time": 15.0}
LONG = {"samples": 10_000_000, "planning_time": 60.0}
#: The cells of a large map along a side.
LARGE = 4000


# The command line

def test_the_help_lists_every_parameter(installed_planners):
    process = installed_planners.start("--", "--help")
    assert process.wait() == 0
    assert process.output.startswith("usage: planner")
    for item in OPTIONS.values():
        assert f"{item.name} (default {item.default!r}): {item.describe()}" in process.output


@pytest.mark.slow
def test_the_defaults_are_printed_as_a_parameter_file_that_the_node_takes(planners, tmp_path):
    process = planners.start("--", "--print-parameters")
    assert process.wait() == 0
    printed = yaml.safe_load(process.output)["/**"]["ros__parameters"]
    assert printed == {item.name: item.default for item in OPTIONS.values()}
    (tmp_path / "defaults.yaml").write_text(process.output)
    process = planners.start("--params-file", str(tmp_path / "defaults.yaml"))
    planners.client().status_of(0, error_name="NO_MAP")
    assert process.end(signal.SIGINT) == 0
    assert "arameter" not in process.output


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [["--fast"], ["maze.yaml"], ["--help-me"], ["-p", "samples:=3"]])
def test_an_unknown_argument_ends_it_with_the_usage(planners, arguments):
    process = planners.start("--", *arguments)
    assert process.wait() == 2
    assert process.output.startswith("usage: planner")
    assert arguments[0] in process.output.splitlines()[-1]


# The configuration

@pytest.mark.slow
@pytest.mark.parametrize(("parameters", "words"), [
    ({"turning_radius": -1.0}, ["turning_radius is -1.0", "from 0.001"]),
    ({"turning_radius": "wide"}, ["turning_radius is 'wide'", "a number"]),
    ({"samples": 0}, ["samples is 0", "from 1 to"]), ({"samples": 300.5}, ["samples is 300.5", "an integer"]),
    ({"planner": "dijkstra"}, ["planner is 'dijkstra'", "one of rrt, rrt_star"]), ({"planner": 3}, ["planner is 3", "one of"]),
    ({"planning_time": 0.0}, ["planning_time is 0.0", "from 0.001 to 3600"]),
    ({"goal_bias": 2}, ["goal_bias is 2", "from 0 to 1"]), ({"robot_radius": -0.1}, ["robot_radius is -0.1", "from 0"]),
    ({"heading_sampling": "north"}, ["heading_sampling is 'north'", "one of uniform"]),
    ({"publish_tree": "often"}, ["publish_tree is 'often'", "true or false"]),
    ({"goal_tolerance_yaw": 4.0}, ["goal_tolerance_yaw is 4.0", "to 3.14"]), ({"seed": -2}, ["seed is -2", "from -1"]),
    ({"wheelbase": 2.0}, ["wheelbase is 2 m", "set both"]), ({"max_steering_angle": 0.5}, ["0.5 rad", "set both"]),
    ({"wheelbase": 1000.0, "max_steering_angle": 0.001}, ["wheelbase 1000 m and max_steering_angle 0.001 rad", "to 10000"]),
    ({"global_frame": ""}, ["global_frame is ''", "give the name"]), ({"max_map_cells": 0}, ["max_map_cells is 0", "from 1"]),
    ({"use_sim_time": "abc"}, ["use_sim_time"]),
    ({"map_file": "nowhere.yaml"}, ["map_file", "nowhere.yaml", "no such map file", "maze.yaml"]),
    ({"map_file": "http://example.org/maze.yaml"}, ["http://", "file://"]),
    ({"map_file": "maze", "max_map_cells": 100}, ["maze", "max_map_cells = 100", "crop it"]),
])
def test_a_bad_configuration_ends_it_with_one_line(planners, parameters, words):
    assert_ends_with_one_line(planners.start(**parameters), words)


def assert_ends_with_one_line(process, words):
    assert process.wait() == 1, process.output
    lines = process.output.splitlines()
    assert len(lines) == 1, process.output
    assert lines[0].startswith("planner: ")
    assert [word for word in words if word not in lines[0]] == [], lines[0]


@pytest.mark.slow
def test_a_broken_map_file_ends_it_with_one_line(installed_planners, map_yaml):
    broken = map_yaml.with_name("broken.yaml")
    broken.write_text(map_yaml.read_text().replace("resolution: 0.1", "resolution: -0.1"))
    assert_ends_with_one_line(installed_planners.start(map_file=str(broken)), ["broken.yaml", "resolution", "-0.1", "above 0"])


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "words"), [
    (["-r", "__node:=no-name"], ["no-name"]), (["-r", "__node:=2fast"], ["2fast"]), (["-r", "__ns:=/2fast"], ["2fast"]),
    (["-r", "plan:=no//name"], ["no//name"]), (["-r", "plan:="], ["plan:="]), (["-p", "samples"], ["samples"]),
    (["-p", "samples:=[1, a"], ["samples"]), (["--params-file", "nowhere.yaml"], ["nowhere.yaml"]),
    (["--log-level", "loud"], ["loud"]), (["--fast"], ["ROS knows none of the arguments ['--fast']"]),
    (["-p", "samples=3"], ["'-p samples=3'", "give -p NAME:=VALUE"]), (["-p"], ["give -p NAME:=VALUE"]),
    (["--params-file", "/"], ["planner --print-parameters"]),
])
def test_a_bad_ros_argument_is_named(planners, arguments, words):
    assert_names(planners.start(*arguments), words)


def assert_names(process, words):
    """It ends with a last line that has these words; before it, ROS may say something too."""
    assert process.wait() == 1, process.output
    assert "Traceback" not in process.output
    line = process.output.splitlines()[-1]
    assert line.startswith("planner: ")
    assert [word for word in words if word not in line] == [], line


@pytest.mark.slow
@pytest.mark.parametrize("content", ["a: [", "\x00\x01", "planner:\n  samples: 3\n",
                                     "planner:\n  ros__parameters:\n    samples: [1, a]\n"])
def test_a_broken_parameter_file_is_named(planners, tmp_path, content):
    file = tmp_path / "broken.yaml"
    file.write_text(content)
    assert_names(planners.start("--params-file", str(file)), ["broken.yaml"])


@pytest.mark.slow
@pytest.mark.parametrize("content", ["just text", "another:\n  ros__parameters:\n    samples: 3\n"])
def test_a_parameter_file_that_has_nothing_for_the_node_gets_a_warning(planners, tmp_path, content):
    file = tmp_path / "useless.yaml"
    file.write_text(content)
    process = planners.start("--params-file", str(file))
    planners.client().wait_for(lambda: f"Parameter file '{file}' is ignored" in process.output, "the warning")


@pytest.mark.slow
def test_what_ros_takes_nothing_of_is_told_by_the_node(planners, tmp_path):
    file = tmp_path / "twice.yaml"
    file.write_text("/**:\n  ros__parameters:\n    samples: 3\n    samples: 4\n")
    process = planners.start("--params-file", str(file), "-p", "planer:seed:=1", "-p", "seed:=2", "-p", "seed:=3")
    client = planners.client()
    for words in ("samples is given twice, in lines 3 and 4; the last one counts", "seed is given to the node planer, and not to",
                  "-p seed is given 2 times; the last one counts"):
        client.wait_for(lambda words=words: words in process.output, "the warning")


def test_a_parameter_that_there_is_not_gets_a_warning_with_a_suggestion(planners, map_yaml, tmp_path):
    file = tmp_path / "parameters.yaml"
    file.write_text("/**:\n  ros__parameters:\n    planing_time: 3.0\n    colour: red\n")
    process = planners.start("--params-file", str(file), map_file=str(map_yaml), turn_radius=2.0)
    client = planners.client()
    for words in ("'planing_time' is ignored; did you mean 'planning_time'?", "'colour' is ignored; planner --help",
                  "'turn_radius' is ignored; did you mean 'turning_radius'?"):
        client.wait_for(lambda words=words: f"Unknown parameter {words}" in process.output, "the warning")
    assert process.output.count("Unknown parameter") == 3


# Its end by a signal

@pytest.fixture(scope="module")
def noise_yaml(tmp_path_factory):
    """A map of 16 million cells whose obstacles are noise."""
    file = tmp_path_factory.mktemp("noise") / "noise.yaml"
    save_map(noise(), file)
    return file


def noise():
    data = (np.random.default_rng(1).random((LARGE, LARGE)) < 0.05).astype(np.int8) * OCCUPIED
    return GridMap(data, 0.05)


def waits_for_a_map(planners, map_yaml, noise_yaml):
    process = planners.start()
    planners.client().status_of(0, error_name="NO_MAP")
    return process


def waits_for_a_start(planners, map_yaml, noise_yaml):
    process = planners.start(map_file=str(map_yaml))
    planners.client().wait_for(lambda: "Waiting for a start" in process.output, "its word")
    return process


def is_idle(planners, map_yaml, noise_yaml):
    process = planners.start(map_file=str(map_yaml), **QUICK)
    talk = Conversation(process, planners.client())
    talk.start(START)
    talk.goal(GOAL, revision="2")
    return process


def plans_to_a_goal(planners, map_yaml, noise_yaml):
    process = planners.start(map_file=str(map_yaml), **LONG)
    talk = Conversation(process, planners.client(listens_to_tree=True))
    talk.start(START)
    talk.goal(GOAL, error_name="NONE")
    return process


def serves_requests(planners, map_yaml, noise_yaml):
    process = planners.start(map_file=str(map_yaml), **LONG)
    client = planners.client()
    for _ in range(3):
        client.request_plan(START, GOAL)
    for _ in range(3):
        client.call(GetParameters, "get_parameters", names=["samples"])
    return process


def loads_its_map_file(planners, map_yaml, noise_yaml):
    process = planners.start(map_file=str(noise_yaml))
    process.wait_until_ready()
    return process


def loads_a_large_map(planners, map_yaml, noise_yaml):
    process = planners.start(map_file=str(map_yaml))
    client = planners.client()
    client.request(LoadMap, "load_map", map_url=str(noise_yaml))
    client.call(GetParameters, "get_parameters", names=["samples"])
    return process


def prepares_a_large_map(planners, map_yaml, noise_yaml):
    process = planners.start(map_file=str(map_yaml))
    client = planners.client()
    client.request(LoadMap, "load_map", map_url=str(noise_yaml))
    client.wait_for(lambda: f"Took a map of {LARGE}" in process.output, "the map to be taken")
    return process


def prepares_a_large_map_of_the_topic(planners, map_yaml, noise_yaml):
    process = planners.start()
    client = planners.client()
    client.publish_map(grid_message(noise(), "map", Time()))
    client.wait_for(lambda: f"Took a map of {LARGE}" in process.output, "the map to be taken")
    return process


STATES = [waits_for_a_map, waits_for_a_start, is_idle, plans_to_a_goal, serves_requests, loads_a_large_map,
          prepares_a_large_map, prepares_a_large_map_of_the_topic]


@pytest.mark.slow
@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("state", STATES)
def test_a_signal_ends_it_whatever_it_does(installed_planners, map_yaml, noise_yaml, state, by):
    process = state(installed_planners, map_yaml, noise_yaml)
    assert_ended(process, process.end(by))


@pytest.mark.slow
@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("state", [is_idle, plans_to_a_goal, prepares_a_large_map])
def test_a_second_signal_does_not_break_off_the_end(installed_planners, map_yaml, noise_yaml, state, by):
    process = state(installed_planners, map_yaml, noise_yaml)
    assert_ended(process, process.end(by, again_after=0.01))


def assert_ended(process, status):
    assert status == 0, process.output
    assert "Traceback" not in process.output


# The end of others

@pytest.mark.slow
@pytest.mark.parametrize("what", ["get_plan", "goals"])
def test_a_client_that_is_killed_leaves_the_node_to_the_next(planners, map_yaml, what):
    process = planners.start(map_file=str(map_yaml), **QUICK)
    client = planners.client()
    client.set_parameters(planner="rrt_star", **LONG)
    namespace = process.name.removesuffix("/planner")
    doomed = subprocess.Popen([sys.executable, client_to_kill.__file__, namespace, what])
    try:
        if what == "get_plan":
            client.wait_for(lambda: client.node.count_clients(f"{process.name}/get_plan"), "the other client")
            client.call(GetParameters, "get_parameters", names=["samples"])
        else:
            client.wait_for(lambda: client.statuses and "Path of" in client.statuses[-1].message, "a path of the other client")
    finally:
        doomed.kill()
        doomed.wait()
    client.call(Trigger, "cancel")
    client.set_parameters(**QUICK)
    future = client.request_plan(START, GOAL)
    assert client.wait_for(lambda: future.done() and future.result(), "a plan").plan.poses
    assert "Traceback" not in process.output


@pytest.mark.slow
def test_a_node_that_is_killed_leaves_its_client_to_the_next(planners, map_yaml):
    first = planners.start(map_file=str(map_yaml), **LONG)
    client = planners.client()
    lost = client.request_plan(START, GOAL)
    client.call(GetParameters, "get_parameters", names=["samples"])
    first.kill()
    second = planners.restart(map_file=str(map_yaml), **QUICK)
    client.follow(second)
    second.wait_until_ready()
    futures = []

    def answered():
        """Ask again where there is no answer: at first the service may still seem to be that of the dead."""
        futures.append(client.request_plan(START, GOAL))
        client.spin_until_done(futures[-1], 1.0)
        return next((future.result() for future in futures if future.done()), None)

    assert client.wait_for(answered, "a plan").plan.poses
    assert not lost.done()
    assert "Traceback" not in second.output


@pytest.mark.slow
def test_two_planners_in_two_namespaces_do_not_hear_each_other(planners, map_yaml):
    talks = [Conversation(planners.start(map_file=str(map_yaml), **QUICK), planners.client()) for _ in range(2)]
    for talk, goal in zip(talks, [GOAL, (8.5, 2.0, 0.0)], strict=True):
        talk.start(START)
        told = talk.goal(goal, revision="2")
        assert (told["error_name"], told["name"]) == ("NONE", f"{talk.process.name}: planner")
    for talk, goal in zip(talks, [GOAL, (8.5, 2.0, 0.0)], strict=True):
        assert talk.plan(START, goal)[0]["plan_id"] == "2"
        ends = {(path.poses[-1].pose.position.x, path.poses[-1].pose.position.y) for path in talk.client.paths}
        assert ends == {goal[:2]}
        assert "Traceback" not in talk.process.output
