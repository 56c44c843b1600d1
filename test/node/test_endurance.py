"""The node after a thousand goals, and while it plans; figures are reported as properties of the tests, few are judged."""

import json
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from rcl_interfaces.srv import GetParameters
from support import ticking_planner
from support.conversation import Conversation
from support.ticking_planner import INTERVAL

START, GOALS = (1.5, 5.0, 0.0), [(8.5, 5.0, 0.5), (1.5, 2.0, -2.0)]
#: Of the package's maze.
MAZE_START, MAZE_GOAL = (1.5, 2.0, 1.57), (13.5, 10.5, 1.57)
#: How much memory may grow where nothing is kept [MB].
NOISE = 10.0
#: For how long the ticks are looked at, less than the planning takes [s].
WINDOW = 4.0


@pytest.fixture
def report(record_property):
    """Report the middle and the 99th percentile of times [s]."""
    def tell(what, times):
        for share in (50, 99):
            record_property(f"{what}, p{share} [ms]", round(1000 * float(np.percentile(times, share)), 2))
            print(f"{what}, p{share}: {1000 * np.percentile(times, share):.2f} ms")
    return tell


@pytest.mark.slow
def test_a_thousand_goals_leave_nothing_behind(lean_planners, map_yaml, record_property):
    process = lean_planners.start(map_file=str(map_yaml), planner="rrt", planning_time=15.0, path_spacing=0.5)
    talk = Conversation(process, lean_planners.client(listens_to_tree=True))
    talk.client.send("start_pose", START)
    for count in range(1, 1001):
        told = talk.goal(GOALS[count % len(GOALS)])
        assert (told["plan_id"], told["error_name"]) == (str(count), "NONE")
        talk.client.paths.clear()
        talk.client.trees.clear()
        if count == 100:
            memory, threads, descriptors = process.memory, process.threads, process.descriptors
    record_property("memory after 100 goals [MB]", memory)
    record_property("memory after 1000 goals [MB]", process.memory)
    assert process.memory - memory < NOISE
    # What is computed beside the search may still be about to end.
    talk.client.wait_for(lambda: process.threads <= threads and process.descriptors <= descriptors,
                         f"end of threads beyond {threads}, or of descriptors beyond {descriptors}")
    assert "Traceback" not in process.output


@pytest.mark.slow
def test_it_answers_while_it_plans(planners, map_yaml, tmp_path, report):
    script, file = Path(ticking_planner.__file__), tmp_path / "ticks.json"
    process = planners.start(command=[sys.executable, str(script), str(file)], map_file=str(map_yaml),
                             samples=10_000_000, planning_time=5.0)
    client = planners.client()
    client.send("start_pose", START)
    client.send("goal_pose", GOALS[0])
    client.status_of(1, error_name="NONE")
    begin, times = time.monotonic(), []
    for _ in range(100):
        called = time.monotonic()
        assert client.call(GetParameters, "get_parameters", names=["samples"]).values[0].integer_value == 10_000_000
        times.append(time.monotonic() - called)
    client.wait_for(lambda: "Path of" in process.output, "the end of the request")
    assert process.end(signal.SIGINT) == 0
    ticks = np.array(json.loads(file.read_text()))
    ticks = ticks[(begin <= ticks) & (ticks <= begin + WINDOW)]
    report("get_parameters while planning", times)
    report("time between ticks while planning", np.diff(ticks))
    assert len(ticks) > 0.1 * WINDOW / INTERVAL  # also where the machine is busy: with the GIL held there are hardly any


@pytest.mark.slow
def test_the_first_path_comes_soon(planners, report):
    talk = Conversation(planners.start(map_file="maze", planner="rrt", samples=100_000, planning_time=15.0), planners.client())
    client, times = talk.client, []
    client.send("start_pose", MAZE_START)
    talk.goal(MAZE_GOAL, revision="2")
    for _ in range(50):
        client.paths.clear()
        client.statuses.clear()
        sent = time.monotonic()
        client.send("goal_pose", MAZE_GOAL)
        client.wait_for(lambda: client.paths, "the first path")
        times.append(time.monotonic() - sent)
        assert client.paths[0].poses
        talk.asked += 1
        client.status_of(talk.asked, revision="2")
    report("from the goal to its first path in the maze", times)
