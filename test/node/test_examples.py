"""The examples: each does what it says, with planners of their own, and a controller that is a process of its own too."""

import importlib.util
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from support.harness import DEADLINE
from support.yard import BEHIND, GOAL, IN_THE_BOX, QUICK, START

SOURCE = Path(__file__).resolve().parent.parent.parent
EXAMPLES = SOURCE / "examples"
FOLLOWER = SOURCE / "test/support/follower.py"


def needs_messages(test):
    """Mark a test of an example that speaks with Nav2."""
    missing = importlib.util.find_spec("nav2_msgs") is None
    skips = pytest.mark.skipif(missing, reason="nav2_msgs is not here; .ci/messages builds it")
    return pytest.mark.slow(pytest.mark.messages(skips(test)))


def numbers(*poses):
    return [str(value) for pose in poses for value in pose]


def in_namespace(process):
    return ["--ros-args", "-r", f"__ns:={process.name.removesuffix('/planner')}"]


def run(name, *arguments):
    """The exit status of an example and what it says."""
    done = subprocess.run([sys.executable, EXAMPLES / name, *arguments], capture_output=True, text=True, timeout=DEADLINE)
    return done.returncode, done.stdout, done.stderr


def test_the_ackermann_robot_s_parameters_are_taken_and_plan(planners):
    process = planners.start("--params-file", str(EXAMPLES / "ackermann.yaml"), map_file="parking.geojson")
    client = planners.client()
    path, told = client.plan((3.0, 7.0, 0.0), (15.0, 7.0, 0.0))
    assert told["error_name"] == "NONE", told["message"]
    assert path.poses
    assert "Turning radius 1.19 m" in process.output
    assert "Unknown parameter" not in process.output and "is ignored" not in process.output


@needs_messages
def test_waypoints_are_passed_and_a_failure_is_told(planners, map_file):
    process = planners.start(map_file=map_file, **QUICK)
    planners.client()
    status, output, _ = run("waypoints.py", *numbers(START, BEHIND, GOAL), *in_namespace(process))
    assert status == 0
    assert output.startswith("2 goals, ")
    status, _, error = run("waypoints.py", *numbers(START, IN_THE_BOX, GOAL), *in_namespace(process))
    assert status == 1
    assert error.startswith("306: ") and "aypoint 1" in error


@needs_messages
def test_a_fleet_is_asked_at_once(planners):
    namespaces = [planners.start(map_file="maze", **QUICK).name.removesuffix("/planner") for _ in range(2)]
    planners.client()
    status, output, error = run("fleet.py", *namespaces)
    assert status == 0, error
    assert [line.partition(": Path of")[0] for line in output.splitlines()] == namespaces


@pytest.fixture
def follower(planners, map_file):
    """A function that starts a planner and a controller that follows paths in a way; what the example needs to find them."""
    processes = []

    def start(way):
        process = planners.start(map_file=map_file, **QUICK)
        client = planners.client()
        client.send("start_pose", START)
        client.wait_for_word("Took a map")
        namespace = process.name.removesuffix("/planner")
        processes.append(subprocess.Popen([sys.executable, FOLLOWER, namespace, way],
                                          env={**os.environ, "PYTHONPATH": os.environ.get("PYTHONPATH", "")}))
        return in_namespace(process)

    yield start
    for process in processes:
        process.terminate()
        process.wait(DEADLINE)


@needs_messages
@pytest.mark.parametrize(("way", "status", "says"), [
    ("drive", 0, "arrived"), ("reject", 1, "follow_path rejected the goal"),
    ("abort", 1, "follow_path failed, 105: it is stuck")])
def test_a_path_is_handed_to_the_controller(follower, way, status, says):
    found = run("follow_path.py", *numbers(GOAL), *follower(way))
    assert found[0] == status, found
    assert says in found[1] + found[2]
    assert found[1].startswith("Path of ")


@needs_messages
@pytest.mark.parametrize(("way", "at"), [("wait", "to go"), ("late", "Path of ")])
def test_ctrl_c_stops_the_robot(follower, way, at):
    """Also one that has yet to accept the path."""
    command = [sys.executable, "-u", EXAMPLES / "follow_path.py", *numbers(GOAL), *follower(way)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while at not in process.stdout.readline():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1
    assert error.strip() == "follow_path was cancelled"
