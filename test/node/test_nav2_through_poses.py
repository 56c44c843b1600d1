"""Nav2's action compute_path_through_poses, by a client that calls it as BasicNavigator's getPathThroughPoses does."""

import math
import sys

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("nav2_msgs", reason="nav2_msgs is not here; .ci/messages builds it")

from nav2_msgs.action import ComputePathThroughPoses
from nav2_msgs_shapes.action import LaterThroughPoses
from nav2_msgs_shapes.msg import Goals
from support.harness import poses_of, stamped
from support.nav2_client import ABORTED, CANCELED, SUCCEEDED, PathClient
from support.yard import BEHIND, ENDLESS, GOAL, IN_THE_BOX, IN_THE_CHAMBER, ON_THE_WAY_OUT, QUICK, START

pytestmark = pytest.mark.messages

NAME = "compute_path_through_poses"
ABOVE = (5.0, 7.5, 0.0)
#: Of each error code the start, the goals, and what the message says.
ERRORS = [
    (303, (-1.0, 5.0, 0.0), [ABOVE, GOAL], ["Start", "outside the map"]),
    (304, START, [ABOVE, (5.0, 10.5, 0.0)], ["outside the map"]),
    (304, START, [(5.0, 10.5, 0.0), GOAL], ["outside the map", "aypoint 1"]),
    (305, IN_THE_BOX, [ABOVE, GOAL], ["Start", "needed 0.2"]),
    (306, START, [IN_THE_BOX, GOAL], ["aypoint 1", "needed 0.2"]),
    (306, START, [ABOVE, IN_THE_BOX], ["needed 0.2"]),
    (308, START, [ABOVE, IN_THE_CHAMBER, GOAL], ["aypoint 2"]),
    (300, START, [ABOVE, (math.nan, 5.0, 0.0), GOAL], ["INVALID_POSE (212): ", "waypoint 2"]),
    (309, START, [], ["no goals"]),
]


@pytest.fixture(scope="module")
def running(module_planners, map_file):
    module_planners.start(map_file=map_file)
    return PathClient(module_planners.client(), ComputePathThroughPoses, NAME)


@pytest.fixture
def action(running):
    """The action of a planner with quick settings and nothing to do."""
    running.client.cancel()
    running.client.set_parameters(**QUICK)
    return running


def test_the_path_passes_the_goals_in_their_order_each_once(action):
    published = len(action.client.paths)
    status, result = action.path(goals=[ABOVE, BEHIND, GOAL], start=START)
    assert (status, result.error_code) == (SUCCEEDED, 0)
    found = poses_of(result.path)
    assert found[0].tolist() == list(START)
    assert found[-1] == pytest.approx(GOAL, abs=1e-9)
    passed = [np.flatnonzero(np.abs(found - pose).max(axis=1) < 1e-6).tolist() for pose in (START, ABOVE, BEHIND, GOAL)]
    assert [len(indices) for indices in passed] == [1, 1, 1, 1]
    assert passed == sorted(passed)
    assert action.client.wait_for(lambda: action.client.paths[published:], "the path on plan") == [result.path]


def test_a_single_goal_is_planned_to_as_ever(action):
    status, result = action.path(goals=[GOAL], start=START)
    assert (status, result.error_code) == (SUCCEEDED, 0)
    assert poses_of(result.path)[-1] == pytest.approx(GOAL, abs=1e-9)


@pytest.mark.parametrize(("code", "start", "goals", "words"), ERRORS, ids=[f"{row[0]} {len(row[2])}" for row in ERRORS])
def test_a_failure_aborts_the_goal_with_its_code_and_names_the_waypoint(action, code, start, goals, words):
    status, result = action.path(goals=goals, start=start)
    assert (status, result.error_code, result.path.poses) == (ABORTED, code, [])
    assert [word for word in words if word not in result.error_msg] == [], result.error_msg
    assert result.planning_time.sec + result.planning_time.nanosec > 0


def test_another_frame_and_another_planner(action):
    goal = ComputePathThroughPoses.Goal(start=stamped(START), goals=[stamped(GOAL, "nowhere"), stamped(GOAL)], use_start=True)
    assert action.result(action.accepted(goal))[1].error_code == 302
    assert action.path(goals=[ABOVE, GOAL], start=START, planner_id="Smac")[1].error_code == 301
    assert action.path(goals=[ABOVE, GOAL], start=START, planner_id="GridBased")[1].error_code == 0


def test_a_cancel_and_a_newer_goal_end_the_one_that_runs(action):
    action.client.set_parameters(**ENDLESS)
    first = action.send(goals=[ABOVE, ON_THE_WAY_OUT], start=START)
    second = action.send(goals=[ABOVE, ON_THE_WAY_OUT], start=START)
    assert action.result(first) == (ABORTED, ComputePathThroughPoses.Result())
    assert len(action.cancel(second)) == 1
    assert action.result(second)[0] == CANCELED


#: The node's own main, with the messages of another release.
LATER_RELEASE = """
import sys
import nav2_msgs.action
from nav2_msgs_shapes.action import LaterThroughPoses
nav2_msgs.action.ComputePathThroughPoses = LaterThroughPoses
from dubins_rrt_ros.node.main import main
sys.exit(main())
"""


@pytest.mark.slow
def test_the_message_of_a_later_release(planners, map_file):
    planners.start(command=[sys.executable, "-c", LATER_RELEASE], map_file=map_file, **QUICK)
    action = PathClient(planners.client(), LaterThroughPoses, NAME)
    goals = Goals(goals=[stamped(ABOVE), stamped(GOAL)])
    handle = action.accepted(LaterThroughPoses.Goal(start=stamped(START), goals=goals, use_start=True))
    status, result = action.result(handle)
    assert (status, result.error_code) == (SUCCEEDED, 0)
    assert poses_of(result.path)[-1] == pytest.approx(GOAL, abs=1e-9)
