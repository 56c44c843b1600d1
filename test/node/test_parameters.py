"""Parameters: declared from the dataclasses, checked one by one and together."""

import math
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

import rclpy
from rclpy.parameter import Parameter

from dubins_rrt_ros.node.parameters import OPTIONS, READ_ONLY, Parameters
from dubins_rrt_ros.planning import OptionError, Problem, Settings, Vehicle, options

CONTRACT = {
    "map_file", "global_frame", "planner", "turning_radius", "wheelbase", "max_steering_angle", "robot_radius",
    "allow_unknown", "samples", "planning_time", "goal_bias", "step_size", "heading_sampling", "goal_tolerance_xy",
    "goal_tolerance_yaw", "any_goal_heading", "path_spacing", "seed", "publish_tree", "map_transient_local",
    "max_map_cells",
}


@pytest.fixture(scope="module")
def context():
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()


@pytest.fixture
def declared(context):
    """A function that declares the parameters on a new node with these overrides."""
    nodes = []

    def declare(**overrides):
        given = [Parameter(name, value=value) for name, value in overrides.items()]
        nodes.append(rclpy.create_node("holder", context=context, parameter_overrides=given))
        return SimpleNamespace(node=nodes[-1], parameters=Parameters(nodes[-1]))

    yield declare
    for node in nodes:
        node.destroy_node()


def change(declared, **values):
    return declared.node.set_parameters_atomically([Parameter(name, value=value) for name, value in values.items()])


def test_the_contract_s_parameters_are_declared(declared):
    assert set(OPTIONS) >= CONTRACT
    assert all(declared().node.has_parameter(name) for name in OPTIONS)


def test_the_defaults_are_the_dataclasses_own(declared):
    now = declared().parameters.read()
    assert now.vehicle == Vehicle()
    assert now.settings == Settings()
    assert now.problem == {item.name: item.default for item in options(Problem)}
    assert (now.node.global_frame, now.node.publish_tree, now.node.map_transient_local) == ("map", True, True)


def test_values_given_at_start_up_are_taken(declared):
    given = {"planner": "rrt", "samples": 10, "robot_radius": 0.5, "allow_unknown": True, "global_frame": "world"}
    now = declared(**given).parameters.read()
    assert (now.settings.planner, now.settings.samples, now.vehicle.robot_radius) == ("rrt", 10, 0.5)
    assert (now.problem["allow_unknown"], now.node.global_frame) == (True, "world")


def test_an_int_is_taken_for_a_double(declared):
    node = declared(turning_radius=2)
    assert node.parameters.read().vehicle.turning_radius == 2.0
    assert change(node, turning_radius=3).successful
    value = node.parameters.read().vehicle.turning_radius
    assert (value, type(value)) == (3.0, float)


@pytest.mark.parametrize("name", sorted(OPTIONS))
def test_every_parameter_says_what_it_is_and_takes(declared, name):
    item, described = OPTIONS[name], declared().node.describe_parameter(name)
    assert item.help in described.description
    assert f"[{item.unit}]" in described.description or not item.unit
    assert described.read_only == (name in READ_ONLY)
    for kind, ranges in ((float, described.floating_point_range), (int, described.integer_range)):
        assert [(r.from_value, r.to_value) for r in ranges] == ([(item.low, item.high)] if item.type is kind else [])
    assert all(choice in described.additional_constraints for choice in item.choices)


@pytest.mark.parametrize(("name", "value"), [
    ("turning_radius", -1.0), ("turning_radius", 0), ("turning_radius", "1.0"), ("turning_radius", math.nan),
    ("turning_radius", math.inf), ("samples", 0), ("samples", 3000.0), ("planner", "dijkstra"), ("planner", 3),
    ("allow_unknown", "yes"), ("allow_unknown", 1), ("seed", -2), ("goal_bias", 1.5), ("goal_bias", 2),
    ("path_spacing", 0.0), ("robot_radius", [0.2]), ("planning_time", None),
])
def test_a_bad_value_is_refused_at_run_time_with_the_reason_and_nothing_changes(declared, name, value):
    node = declared()
    before = node.parameters.read()
    result = change(node, **{name: value})
    assert not result.successful
    assert name in result.reason
    assert node.parameters.read() == before


@pytest.mark.parametrize(("name", "value"), [
    ("turning_radius", -1.0), ("turning_radius", -1), ("turning_radius", "1.0"), ("samples", 0), ("samples", 10.0),
    ("planner", "dijkstra"), ("allow_unknown", "yes"), ("global_frame", ""), ("max_map_cells", 0),
])
def test_a_bad_value_at_start_up_is_refused_with_name_value_and_remedy(declared, name, value):
    with pytest.raises(OptionError) as refusal:
        declared(**{name: value})
    assert str(refusal.value).startswith(f"{name} is {value!r}")
    assert ";" in str(refusal.value)


def test_values_that_belong_together_are_taken_together_at_start_up(declared):
    now = declared(wheelbase=2.0, max_steering_angle=0.5).parameters.read()
    assert now.vehicle.turning_radius == pytest.approx(2.0 / math.tan(0.5))


def test_half_of_what_belongs_together_is_refused_at_start_up(declared):
    with pytest.raises(OptionError, match="set both"):
        declared(wheelbase=2.0)


def test_values_that_belong_together_are_taken_together_at_run_time(declared):
    node = declared()
    half = change(node, wheelbase=2.0)
    assert not half.successful and "set both" in half.reason
    assert change(node, wheelbase=2.0, max_steering_angle=0.5).successful
    assert node.parameters.read().vehicle.turning_radius == pytest.approx(2.0 / math.tan(0.5))


def test_a_change_is_taken_whole_or_not_at_all(declared):
    node = declared()
    assert not change(node, samples=10, goal_bias=7).successful
    assert node.parameters.read().settings.samples == Settings().samples


@pytest.mark.parametrize("name", sorted(READ_ONLY))
def test_what_shapes_the_topics_cannot_change_at_run_time(declared, name):
    node = declared()
    result = change(node, **{name: node.node.get_parameter(name).value})
    assert not result.successful
    assert "read-only" in result.reason


def test_a_parameter_of_somebody_else_is_none_of_our_business(declared):
    node = declared()
    node.node.declare_parameter("other", 1)
    assert change(node, other=2).successful
    assert change(node, use_sim_time=True).successful


def test_what_was_read_does_not_change_later(declared):
    node = declared()
    now = node.parameters.read()
    assert change(node, samples=10, robot_radius=0.3).successful
    assert (now.settings.samples, now.vehicle.robot_radius) == (3000, 0.2)
    later = node.parameters.read()
    assert (later.settings.samples, later.vehicle.robot_radius) == (10, 0.3)
