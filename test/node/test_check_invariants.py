"""check_invariants: an answer that breaks an invariant is told as a defect, and not published. The planner here is broken."""

import sys

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from support.conversation import Conversation
from support.harness import assert_says
from support.yard import GOAL, QUICK, START

#: The node's own main, but whatever plan() gives back has a lower bound above the length of its path.
FAULTY = """
import sys
from dataclasses import replace
from dubins_rrt_ros.node import main, request

plan = request.plan

def broken(*args, **kwargs):
    answer = plan(*args, **kwargs)
    return replace(answer, lower_bound=2 * answer.length)

request.plan = broken
sys.exit(main.main())
"""


@pytest.fixture
def talk(planners, map_file):
    process = planners.start(command=[sys.executable, "-c", FAULTY], map_file=map_file, **QUICK)
    return Conversation(process, planners.client())


def test_it_can_be_switched_while_the_node_runs(talk):
    talk.start(START)
    assert_says(talk.goal(GOAL), "0", "NONE", "Path of")
    assert talk.client.set_parameters(check_invariants=True).successful
    talk.client.paths.clear()
    assert_says(talk.goal(GOAL, error_code="200"), "200", "UNKNOWN", "PlanError: the path is", "less than the lower bound")
    talk.client.wait_for(lambda: talk.client.paths and talk.client.paths[-1].poses == [], "an empty path")
    told, poses = talk.plan(START, GOAL)
    assert_says(told, "200", "UNKNOWN", "PlanError")
    assert poses == []
    talk.client.wait_for_word("Traceback")
    assert talk.client.set_parameters(check_invariants=False).successful
    assert_says(talk.goal(GOAL), "0", "NONE", "Path of")
    assert talk.process.running
