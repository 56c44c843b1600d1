"""The managed node, brought up and taken down in the order in which Nav2's lifecycle manager does it."""

import importlib.util
import signal

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from support.harness import poses_of
from support.yard import ENDLESS, GOAL, ON_THE_WAY_OUT, QUICK, START, yard

from dubins_rrt_ros.planning import GridMap, save_map

UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = (State.PRIMARY_STATE_UNCONFIGURED, State.PRIMARY_STATE_INACTIVE,
                                             State.PRIMARY_STATE_ACTIVE, State.PRIMARY_STATE_FINALIZED)
CONFIGURE, ACTIVATE, DEACTIVATE, CLEANUP, SHUTDOWN = (
    Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE,
    Transition.TRANSITION_CLEANUP, Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
SHUTDOWN_WHILE_ACTIVE = Transition.TRANSITION_ACTIVE_SHUTDOWN


class Manager:
    """A lifecycle manager of one node, without bonds."""

    def __init__(self, planners, *arguments, name="planner", **parameters):
        planners.start()
        self._client = planners.client()  # of another node, in whose process it is
        self.process = planners.start(*arguments, managed=True, **parameters)
        self._client.follow(self.process)
        namespace = self.process.name.removesuffix("/planner")
        self._change, self._get = (self._client.node.create_client(kind, f"{namespace}/{name}/{service}") for kind, service in (
            (ChangeState, "change_state"), (GetState, "get_state")))
        self._client.wait_for(lambda: self._change.service_is_ready() and self._get.service_is_ready(), "a managed node")
        assert self.state  # so that the node has found this client

    def change(self, transition: int) -> bool:
        """Ask for a transition; whether it succeeded."""
        return self.succeeded(self.request(transition))

    def succeeded(self, requested) -> bool:
        """Wait for a transition that was asked for; whether it succeeded."""
        return self._client.response(requested).success

    def request(self, transition: int):
        """Ask for a transition without waiting for it."""
        return self._change.call_async(ChangeState.Request(transition=Transition(id=transition)))

    @property
    def state(self) -> int:
        return self._client.ask(self._get, GetState.Request()).current_state.id


@pytest.mark.slow
def test_it_is_brought_up_and_taken_down_twice_and_plans_while_it_is_active(planners, map_file):
    manager = Manager(planners, map_file=map_file, **QUICK)
    for _ in range(2):
        assert manager.state == UNCONFIGURED
        assert manager.change(CONFIGURE) and manager.state == INACTIVE
        assert manager.change(ACTIVATE) and manager.state == ACTIVE
        client = planners.client()
        path, told = client.plan(START, GOAL)
        assert told["error_name"] == "NONE"
        assert poses_of(path)[-1] == pytest.approx(GOAL, abs=1e-9)
        assert manager.change(DEACTIVATE) and manager.state == INACTIVE
        path, told = client.plan(START, GOAL)
        assert path.poses == [] and "not active" in told["message"]
        assert manager.change(ACTIVATE) and client.plan(START, GOAL)[1]["error_name"] == "NONE"
        assert manager.change(DEACTIVATE) and manager.change(CLEANUP)
        plan = client.node.resolve_topic_name("plan")
        client.wait_for(lambda client=client, plan=plan: not client.node.get_publishers_info_by_topic(plan), "no topics")
        client.close()
    assert manager.change(SHUTDOWN) and manager.state == FINALIZED
    assert "Traceback" not in manager.process.output


def test_with_a_missing_map_it_is_not_configured_and_may_be_once_the_map_is_there(planners, tmp_path):
    file = tmp_path / "later.yaml"
    manager = Manager(planners, map_file=str(file), **QUICK)
    for _ in range(2):
        assert not manager.change(CONFIGURE)
        assert manager.state == UNCONFIGURED
    assert "Not configured: " in manager.process.output and "later.yaml" in manager.process.output
    save_map(GridMap(yard(), 0.1), file)
    assert manager.change(CONFIGURE) and manager.change(ACTIVATE)
    assert planners.client().plan(START, GOAL)[1]["error_name"] == "NONE"


def test_a_parameter_file_may_say_that_it_is_managed_by_namespace_and_wildcard(planners, tmp_path, map_file):
    file = tmp_path / "parameters.yaml"
    file.write_text(f"/**/planner_server:\n  ros__parameters:\n    managed: true\n    map_file: {map_file}\n")
    manager = Manager(planners, "-r", "__node:=planner_server", "--params-file", str(file), name="planner_server")
    assert manager.state == UNCONFIGURED
    assert manager.change(CONFIGURE) and manager.change(ACTIVATE) and manager.state == ACTIVE


@pytest.mark.slow
@pytest.mark.messages
@pytest.mark.skipif(importlib.util.find_spec("nav2_msgs") is None, reason="nav2_msgs is not here; .ci/messages builds it")
def test_goals_of_actions_are_rejected_while_it_is_inactive(planners, map_file):
    from nav2_msgs.action import ComputePathToPose
    from support.harness import stamped
    from support.nav2_client import SUCCEEDED, PathClient

    manager = Manager(planners, map_file=map_file, **QUICK)
    assert manager.change(CONFIGURE) and manager.change(ACTIVATE)
    action = PathClient(planners.client(), ComputePathToPose, "compute_path_to_pose")
    assert manager.change(DEACTIVATE)
    goal = ComputePathToPose.Goal(start=stamped(START), goal=stamped(GOAL), use_start=True)
    assert not action.handle(goal).accepted
    assert manager.change(ACTIVATE)
    assert action.path(GOAL, START)[0] == SUCCEEDED


@pytest.mark.messages
@pytest.mark.skipif(importlib.util.find_spec("nav2_msgs") is None, reason="nav2_msgs is not here; .ci/messages builds it")
@pytest.mark.parametrize("transitions", [(DEACTIVATE, CLEANUP), (SHUTDOWN_WHILE_ACTIVE,)])
def test_requests_under_way_are_answered_before_it_is_taken_down(planners, map_file, transitions):
    from nav2_msgs.action import ComputePathToPose
    from support.nav2_client import PathClient

    manager = Manager(planners, map_file=map_file, **ENDLESS)
    assert manager.change(CONFIGURE) and manager.change(ACTIVATE)
    client = planners.client()
    action = PathClient(client, ComputePathToPose, "compute_path_to_pose")
    result = action.send(ON_THE_WAY_OUT, START).get_result_async()
    future, _ = client.begin_plan(START, ON_THE_WAY_OUT)
    at_once = [manager.request(transition) for transition in transitions]
    assert all(map(manager.succeeded, at_once))
    assert client.response(future).plan.poses == []
    assert "CANCELLED" in action.answer(result).result.error_msg


@pytest.mark.slow
def test_a_signal_ends_it_in_every_state(installed_planners, map_file):
    for transitions in ([], [CONFIGURE], [CONFIGURE, ACTIVATE], [CONFIGURE, CLEANUP], [SHUTDOWN]):
        manager = Manager(installed_planners, map_file=map_file)
        assert all(map(manager.change, transitions))
        assert manager.process.end(signal.SIGINT) == 0, manager.process.output


def test_a_transition_that_the_state_does_not_have_is_refused(planners):
    manager = Manager(planners)
    for state, transitions in ((UNCONFIGURED, (ACTIVATE, DEACTIVATE, CLEANUP, 77)), (INACTIVE, (CONFIGURE, DEACTIVATE)),
                               (ACTIVE, (CONFIGURE, ACTIVATE, CLEANUP))):
        assert not any(map(manager.change, transitions))
        assert manager.state == state
        assert manager.change(CONFIGURE if state == UNCONFIGURED else ACTIVATE) == (state != ACTIVE)
    assert "defect" not in manager.process.output


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM], ids=lambda by: by.name)
def test_a_signal_ends_it_while_it_is_configured_and_cleaned_up_again_and_again(planners, by):
    manager = Manager(planners)
    assert manager.change(CONFIGURE)
    for _ in range(5):
        manager.request(CLEANUP)
        manager.request(CONFIGURE)
    assert manager.process.end(by) == 0, manager.process.output
    assert "Traceback" not in manager.process.output
