"""The contract's parameters, one by one: type, default, description, range, and what a change does. Through the executable."""

import re

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.parameter import parameter_value_to_python
from rosgraph_msgs.msg import Clock
from support.harness import poses_of
from support.yard import GOAL, IN_UNKNOWN, QUICK, START

#: Of each parameter the type, the default where the contract has one, and a value that is refused.
DOUBLE, INTEGER, BOOL, STRING = (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_BOOL,
                                 ParameterType.PARAMETER_STRING)
STRINGS = ParameterType.PARAMETER_STRING_ARRAY
PARAMETERS = {
    "map_file": (STRING, None, "other.yaml"),
    "map_directory": (STRING, "", "/"),
    "global_frame": (STRING, "map", ""),
    "planner": (STRING, "rrt_star", "dijkstra"),
    "turning_radius": (DOUBLE, 1.0, -1.0),
    "wheelbase": (DOUBLE, None, -1.0),
    "max_steering_angle": (DOUBLE, None, 2.0),
    "robot_radius": (DOUBLE, 0.2, -0.1),
    "footprint": (STRING, None, "a box"),
    "allow_unknown": (BOOL, False, "no"),
    "start_slack": (DOUBLE, 0.0, -0.1),
    "samples": (INTEGER, 3000, 0),
    "planning_time": (DOUBLE, 1.0, 0.0),
    "goal_bias": (DOUBLE, None, 1.5),
    "step_size": (DOUBLE, 0.0, -1.0),
    "heading_sampling": (STRING, "mixed", "random"),
    "informed": (BOOL, True, 1),
    "shortcut": (BOOL, True, 1),
    "goal_tolerance_xy": (DOUBLE, None, -0.1),
    "goal_tolerance_yaw": (DOUBLE, None, 4.0),
    "any_goal_heading": (BOOL, None, "no"),
    "path_spacing": (DOUBLE, 0.0, 0.0005),
    "seed": (INTEGER, -1, -2),
    "unknown_grey": (INTEGER, -1, 256),
    "occupied_thresh": (DOUBLE, 0.65, 1.5),
    "free_thresh": (DOUBLE, 0.25, -0.1),
    "publish_tree": (BOOL, None, "no"),
    "replan_on_map_change": (BOOL, None, "no"),
    "map_transient_local": (BOOL, None, "no"),
    "managed": (BOOL, False, "no"),
    "clear_costmap_service": (BOOL, False, "no"),
    "planner_ids": (STRINGS, ["GridBased"], "GridBased"),
    "max_map_cells": (INTEGER, None, 0),
}
CHOICES = {"planner": ["rrt", "rrt_star"], "heading_sampling": ["uniform", "goal", "field", "mixed"]}


@pytest.fixture(scope="module")
def defaults(module_planners):
    """The client of a planner that was given no parameters."""
    module_planners.start()
    return module_planners.client()


@pytest.fixture(scope="module")
def on_the_yard(module_planners, defaults, map_file):
    """The client of a planner with a map."""
    module_planners.start(map_file=map_file)
    return module_planners.client()


def changed(client, **values):
    """Set what is wanted, all else that these tests change as in QUICK and by default."""
    usual = {"planner": "rrt_star", "path_spacing": 0.05, "turning_radius": 1.0, "allow_unknown": False, "informed": True,
             "shortcut": True, "heading_sampling": "mixed"}
    assert client.set_parameters(**usual | QUICK | values).successful


def longest_step(path):
    return np.linalg.norm(np.diff(poses_of(path)[:, :2], axis=0), axis=1).max()


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_parameter_has_its_type_default_description_and_range(defaults, name):
    kind, default, _ = PARAMETERS[name]
    described, = defaults.call(DescribeParameters, "describe_parameters", names=[name]).descriptors
    assert described.type == kind, f"{name} is not declared, or of another type"
    assert len(described.description.split()) >= 3
    if kind in (DOUBLE, INTEGER):
        allowed, = described.floating_point_range if kind == DOUBLE else described.integer_range
        assert allowed.from_value < allowed.to_value
        assert default is None or allowed.from_value <= default <= allowed.to_value
    for choice in CHOICES.get(name, ()):
        assert re.search(rf"\b{choice}\b", described.additional_constraints)


def test_a_double_that_is_set_as_an_integer_stays_a_double(defaults):
    assert defaults.set_parameters(turning_radius=2).successful
    value, = defaults.call(GetParameters, "get_parameters", names=["turning_radius"]).values
    assert (value.type, value.double_value) == (DOUBLE, 2.0)
    assert defaults.set_parameters(turning_radius=1.0).successful


def test_a_double_that_is_an_integer_at_start_up_is_a_double(planners):
    planners.start("-p", "turning_radius:=2")
    value, = planners.client().call(GetParameters, "get_parameters", names=["turning_radius"]).values
    assert (value.type, value.double_value) == (DOUBLE, 2.0)


def test_the_turning_radius_that_results_is_logged_with_what_has_no_effect(planners):
    process = planners.start(wheelbase=0.3, max_steering_angle=0.5, turning_radius=2.0)
    client = planners.client()
    client.wait_for_word("Turning radius 0.5491 m, by wheelbase and max_steering_angle")
    client.wait_for_word("turning_radius has no effect, as wheelbase takes its place")
    assert client.set_parameters(wheelbase=0.6, max_steering_angle=0.5).successful
    client.wait_for_word("Turning radius 1.098 m")
    assert "robot_radius has no effect" not in process.output


def test_a_dump_of_all_parameters_can_be_loaded_again(on_the_yard):
    """As `ros2 param load` does it: one by one, the read-only ones too; only rclpy's own one is refused, by rclpy."""
    names = on_the_yard.call(ListParameters, "list_parameters").result.names
    values = on_the_yard.call(GetParameters, "get_parameters", names=names).values
    messages = [ParameterMessage(name=name, value=value) for name, value in zip(names, values, strict=True)]
    results = on_the_yard.call(SetParameters, "set_parameters", parameters=messages).results
    refused = [name for name, result in zip(names, results, strict=True) if not result.successful]
    assert set(PARAMETERS) <= set(names) and refused == ["start_type_description_service"]
    changed = on_the_yard.set_parameters(map_file="other.yaml")
    assert not changed.successful and "read-only while the node runs" in changed.reason


@pytest.mark.parametrize("name", [name for name, (_, default, _) in PARAMETERS.items() if default is not None])
def test_a_parameter_has_its_default(defaults, name):
    value, = defaults.call(GetParameters, "get_parameters", names=[name]).values
    assert parameter_value_to_python(value) == PARAMETERS[name][1]


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_bad_value_of_a_parameter_is_refused_with_the_reason_while_the_node_runs(defaults, name):
    before, = defaults.call(GetParameters, "get_parameters", names=[name]).values
    result = defaults.set_parameters(**{name: PARAMETERS[name][2]})
    assert not result.successful
    assert len(result.reason.split()) >= 3
    after, = defaults.call(GetParameters, "get_parameters", names=[name]).values
    assert after == before


def test_a_change_holds_from_the_next_request_on(on_the_yard):
    changed(on_the_yard)
    path, told = on_the_yard.plan(START, GOAL)
    assert told["planner"] == "rrt_star"
    assert longest_step(path) <= 0.05 + 1e-9
    assert float(told["max_curvature"]) <= 1.0 + 1e-6
    changed(on_the_yard, planner="rrt", path_spacing=0.5, turning_radius=0.5, seed=7)
    path, told = on_the_yard.plan(START, GOAL)
    assert (told["planner"], told["seed"]) == ("rrt", "7")
    assert 0.05 < longest_step(path) <= 0.5 + 1e-9
    assert float(told["max_curvature"]) == pytest.approx(2.0)


def test_the_plain_algorithm_needs_samples_for_its_first_path_and_comes_less_far(on_the_yard):
    plain = {"informed": False, "shortcut": False, "heading_sampling": "uniform"}
    for planner in ("rrt", "rrt_star"):
        changed(on_the_yard, planner=planner)
        _, told = on_the_yard.plan(START, GOAL)
        changed(on_the_yard, planner=planner, **plain)
        _, told_plain = on_the_yard.plan(START, GOAL)
        assert told["samples"] == {"rrt": "0", "rrt_star": "300"}[planner]
        assert 0 < int(told_plain["samples"]) <= 300
        assert float(told["path_length"]) < float(told_plain["path_length"])


def test_allow_unknown_lets_it_drive_there(on_the_yard):
    changed(on_the_yard, allow_unknown=True)
    path, told = on_the_yard.plan(START, IN_UNKNOWN)
    assert told["error_name"] == "NONE"
    assert poses_of(path)[-1, :2].tolist() == list(IN_UNKNOWN[:2])


def test_seed_minus_one_is_fresh_each_time_and_reported(on_the_yard):
    changed(on_the_yard, seed=-1)
    seeds = {int(on_the_yard.plan(START, GOAL)[1]["seed"]) for _ in range(3)}
    assert len(seeds) == 3
    assert min(seeds) >= 0


def test_the_same_seed_and_sample_budget_give_the_same_path(on_the_yard):
    changed(on_the_yard)
    first, second = (poses_of(on_the_yard.plan(START, GOAL)[0]).tolist() for _ in range(2))
    assert first == second


@pytest.mark.slow
def test_use_sim_time_stamps_by_the_clock(planners, map_file):
    planners.start(map_file=map_file, use_sim_time=True, **QUICK)
    client = planners.client()
    clock = client.node.create_publisher(Clock, "/clock", 10)
    message = Clock()
    message.clock.sec = 12345

    def stamped():
        clock.publish(message)
        path, _ = client.plan(START, GOAL)
        return path if path.header.stamp.sec else None

    path = client.wait_for(stamped, "a path stamped by the clock")
    assert {pose.header.stamp.sec for pose in path.poses} == {path.header.stamp.sec} == {12345}
