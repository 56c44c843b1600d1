"""Parameters: declared from the dataclasses, checked one by one and together, and told of where they are of no effect."""

import array
import json
import math
import os
import re
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

import rclpy
import yaml
from rclpy.parameter import Parameter

from dubins_rrt_ros.node.parameter_files import WIDTH, as_yaml, doubtful_rules, unused_files
from dubins_rrt_ros.node.parameters import OPTIONS, READ_ONLY, Parameters, configuration
from dubins_rrt_ros.planning import OptionError, Problem, Settings, Vehicle, options
from dubins_rrt_ros.planning.text import LONGEST

CONTRACT = {
    "map_file", "global_frame", "planner", "turning_radius", "wheelbase", "max_steering_angle", "robot_radius",
    "allow_unknown", "samples", "planning_time", "goal_bias", "step_size", "heading_sampling", "goal_tolerance_xy",
    "goal_tolerance_yaw", "any_goal_heading", "path_spacing", "seed", "publish_tree", "map_transient_local",
    "max_map_cells", "map_directory", "replan_on_map_change",
}
CONFIG = Path(__file__).parents[2] / "config" / "planner.yaml"
ONE_OF_EACH_TYPE = {OPTIONS[name].type: name for name in sorted(OPTIONS)}.values()


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


@pytest.fixture
def started():
    """A function that starts a node with these ROS arguments and ends the one before."""
    running = ExitStack()

    def start(*arguments):
        running.close()
        context = rclpy.Context()
        rclpy.init(args=["planner", "--ros-args", *map(str, arguments)], context=context)
        running.callback(context.try_shutdown)
        node = rclpy.create_node("planner", context=context)
        running.callback(node.destroy_node)
        return node

    yield start
    running.close()


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
    ("path_spacing", 0.0005), ("robot_radius", [0.2]), ("planning_time", None),
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
    assert half.reason.endswith("change what belongs together in one call of /holder/set_parameters_atomically")
    assert change(node, wheelbase=2.0, max_steering_angle=0.5).successful
    assert node.parameters.read().vehicle.turning_radius == pytest.approx(2.0 / math.tan(0.5))


def test_what_was_changed_together_and_does_not_fit_is_not_told_to_change_together(declared):
    result = change(declared(), wheelbase=2.0, max_steering_angle=0.0)
    assert not result.successful
    assert "set_parameters_atomically" not in result.reason


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
    reason = node.parameters.check([Parameter(name, value="x")]).reason
    assert reason.startswith(f"{name} is read-only while the node runs: ")
    assert "start the node again" in reason
    assert ("~/load_map" in reason) == (name == "map_file")


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=() if name in ONE_OF_EACH_TYPE else pytest.mark.slow) for name in sorted(OPTIONS)])
def test_every_value_of_another_type_is_refused_in_one_line(declared, name):
    kind, node = OPTIONS[name].type, declared()
    for value in [None, [], [b"a"], [True], [1, 2], [0.5], ["two\nlines"], array.array("q", [1]), "two\nlines", True, 7, 0.5]:
        if type(value) is kind or (type(value), kind) == (int, float) or (name, value) == ("footprint", []):
            continue  # no corners are no footprint
        with pytest.raises(OptionError) as refusal:
            declared(**{name: value})
        for message in (str(refusal.value), node.parameters.check([Parameter(name, value=value)]).reason):
            assert message.startswith(f"{name} is ")
            assert message.isprintable()


@pytest.mark.parametrize(("argument", "found"), [
    ("samples:=[1, 2]", "[1, 2]"), ("map_file:=[a]", "['a']"), ("planner:=''", "''"), ("allow_unknown:=1", "1"),
    ("seed:=[]", "None"), ("turning_radius:=[0.5]", "[0.5]"), ("goal_bias:=[true]", "[True]"), ("global_frame:=''", "''")])
def test_a_wrong_value_on_the_command_line_is_refused(started, argument, found):
    with pytest.raises(OptionError) as refusal:
        Parameters(started("-p", argument))
    assert str(refusal.value).startswith(f"{argument.partition(':=')[0]} is {found}; ")


@pytest.mark.parametrize(("given", "says"), [
    ({"footprint": "[[1000000, 1], [-1, 1], [-1, -1]]"}, "footprint has its farthest corner at 1e+06 m; that may be "),
    ({"wheelbase": 2.0, "max_steering_angle": 1e-9},
     "wheelbase 2 m and max_steering_angle 1e-09 rad make a turning radius of 2e+09 m; that may be a number from 0.001 to 10000"),
    ({"wheelbase": 0.001, "max_steering_angle": 1.57}, "wheelbase 0.001 m and max_steering_angle 1.57 rad make a turning")])
def test_what_follows_from_a_value_is_refused_by_the_value_s_name(declared, given, says):
    with pytest.raises(OptionError) as refusal:
        declared(**given)
    assert str(refusal.value).startswith(says)


@pytest.mark.parametrize("name", ["global_frame", "robot_base_frame"])
@pytest.mark.parametrize(("frame", "remedy"), [
    ("/map", "give 'map'"), ("//a/b", "give 'a/b'"), (" map", "blanks"), ("map\n[ERROR] x", "line breaks"),
    ("\x1b[2Jmap", "control")])
def test_a_frame_that_tf2_does_not_know_is_refused(declared, name, frame, remedy):
    with pytest.raises(OptionError, match=re.escape(f"{name} is {frame!r}; ")) as refusal:
        declared(**{name: frame})
    assert remedy in str(refusal.value) and str(refusal.value).isprintable()


def test_a_vehicle_s_frame_that_is_the_map_s_is_refused(declared):
    assert "would never move" in change(declared(global_frame="world"), robot_base_frame="world").reason


def test_a_refusal_names_the_other_values_only_where_they_matter(declared):
    node, together = declared(), "change what belongs together in one call of /holder/set_parameters_atomically"
    assert together in change(node, wheelbase=2.0).reason and together in change(node, free_thresh=0.9).reason
    assert change(node, path_spacing=0.0005).reason == "path_spacing is 0.0005; give 0 or at least 0.001 [m]"
    assert together not in change(node, preferred_clearance=-0.5).reason
    assert together not in change(node, footprint="[[1000000, 1], [-1, 1], [-1, -1]]").reason
    assert change(node, turning_radius=[1.0]).reason.startswith("turning_radius is [1.0]; ")


@pytest.mark.parametrize("namespace", ["", "/ns"])
def test_rules_are_warned_of_exactly_where_ros_takes_nothing_from_them(started, namespace):
    for node_name in ("", "planner:", "other:", "planer:"):  # ROS refuses all but plain names
        rule = f"{node_name}samples:=10"
        node = started("-r", f"__ns:={namespace or '/'}", "-p", rule)
        is_used = Parameters(node).read().settings.samples == 10
        warnings = doubtful_rules(["planner", "-p", "x:y:=1", "--ros-args", "-p", rule], node.get_fully_qualified_name())
        assert warnings == ([] if is_used else [
            f"samples is given to the node {node_name[:-1]}, and not to {namespace}/planner"]), rule


def test_of_a_value_that_is_given_twice_the_last_one_counts_and_that_is_told(started, tmp_path):
    arguments = ["-p", "samples:=5", "-p", "seed:=1", "--param", "samples:=6"]
    assert Parameters(started(*arguments)).read().settings.samples == 6
    assert doubtful_rules(["--ros-args", *arguments], "/planner") == ["-p samples is given 2 times; the last one counts"]
    file = tmp_path / "p.yaml"
    file.write_text("/**:\n  ros__parameters:\n    samples: 5\n    seed: 1\n    samples: 6\n")
    assert Parameters(started("--params-file", file)).read().settings.samples == 6
    assert doubtful_rules(["--ros-args", "--params-file", str(file)], "/planner") == [
        f"{file}: samples is given twice, in lines 3 and 5; the last one counts"]
    file.write_text("planner: {ros__parameters: {samples: 5}}\nplanner: {ros__parameters: {seed: 1, a: {b: 1, b: 2}}}\n")
    assert doubtful_rules(["--ros-args", "--params-file", str(file)], "/planner") == []


@pytest.mark.parametrize(("name", "remedy"), [
    ("turn_radius", "did you mean 'turning_radius'?"), ("Planning_Time", "did you mean 'planning_time'?"),
    ("planner.ros__parameters.samples", "did you mean 'samples'?"), ("xyz", "planner --help lists the parameters")])
def test_a_parameter_that_there_is_not_gets_a_warning(started, name, remedy):
    node = started("-p", f"{name}:=1", "-p", "samples:=10", "-p", "use_sim_time:=true",
                   "-p", "start_type_description_service:=false", "-p", "qos_overrides./plan.publisher.depth:=2")
    assert Parameters(node).unknown() == [f"Unknown parameter {name!r} is ignored; {remedy}"]


def test_a_parameter_that_another_part_of_the_node_declares_is_known(started):
    node = started("-p", "other:=1")
    parameters = Parameters(node)
    node.declare_parameter("other", 0)
    assert parameters.unknown() == []


SAMPLES = {"ros__parameters": {"samples": 10}}


@pytest.mark.parametrize("namespace", ["", "/ns", "/ns/deep"])
def test_a_file_is_warned_of_exactly_where_ros_takes_nothing_from_it(started, tmp_path, namespace):
    file = tmp_path / "parameters.yaml"
    names = ["/**", "/*", "**", "*", "/**/planner", "/*/planner", "*/planner", "planner", "/planner", "/planner/**", "ns/planner",
             "/ns/planner", "/ns/*", "/ns/**", "/*/*", "/**/ns/**", "/ns/*/planner", "ns", "/other", "planner2", "a_planner"]
    nested = [{"ns": {"planner": SAMPLES}}, {"/ns/": {"deep": {"*": SAMPLES}}}, {"other": SAMPLES, "/ns": {"**": SAMPLES}}]
    for sections in (*({name: SAMPLES} for name in names), *nested):
        file.write_text(json.dumps(sections))
        node = started("-r", f"__ns:={namespace or '/'}", "--params-file", file)
        is_used = Parameters(node).read().settings.samples == 10
        warnings = unused_files(["planner", "--ros-args", "--params-file", str(file)], node.get_fully_qualified_name())
        assert len(warnings) == (0 if is_used else 1), sections


def test_the_warning_of_a_file_has_the_names_that_it_has(tmp_path):
    file, empty, fine = (tmp_path / name for name in ("other.yaml", "empty.yaml", "fine.yaml"))
    file.write_text(json.dumps({"ns": {"planner": SAMPLES}, "other": SAMPLES}))
    empty.write_text("")
    fine.write_text(json.dumps({"planner": SAMPLES}))
    arguments = ["planner", "--params-file", "no.yaml", "--ros-args", "-p", "a:=1", "--params-file", str(file), "--params-file",
                 str(fine), "--", "--params-file", "no.yaml", "--ros-args", "--params-file", str(empty), "--params-file"]
    assert unused_files(arguments, "/planner") == [
        f"Parameter file '{file}' is ignored, as it names /ns/planner, /other; name /planner or /** in it",
        f"Parameter file '{empty}' is ignored, as it has no ros__parameters; name /planner or /** in it"]


@pytest.mark.parametrize("content", [None, b"\xff", b"a: [", b"&a {b: *a}", b"a: &a {}\nb: *a\n", b"#" * 2**20,
                                     b'a: "\\U7fffffff"'])
def test_a_file_that_cannot_be_read_gives_no_warning(tmp_path, content):
    if content is not None:
        (tmp_path / "p.yaml").write_bytes(content)
    assert unused_files(["--ros-args", "--params-file", str(tmp_path / "p.yaml")], "/planner") == []


def test_a_pipe_is_not_read_again_after_ros(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert unused_files(["--ros-args", "--params-file", str(tmp_path / "pipe")], "/planner") == []


def test_many_wildcards_do_not_take_for_ever(tmp_path):
    (tmp_path / "p.yaml").write_text(json.dumps({"/**" * 330: SAMPLES}))
    arguments = ["--ros-args", "--params-file", str(tmp_path / "p.yaml")]
    assert unused_files(arguments, "/a/b/c/planner") == []
    (tmp_path / "p.yaml").write_text(json.dumps({"/**" * 330 + "/other": SAMPLES}))
    assert len(unused_files(arguments, "/a/b/c/planner")) == 1


def test_the_warning_of_a_file_with_odd_names_is_one_line(tmp_path):
    (tmp_path / "p.yaml").write_text(json.dumps({f"two\nlines\x07{number}": SAMPLES for number in range(400)}))
    warning, = unused_files(["--ros-args", "--params-file", str(tmp_path / "p.yaml")], "/planner")
    assert warning.isprintable() and len(warning) <= LONGEST


def test_the_parameter_file_of_the_package_is_the_one_that_is_printed():
    assert CONFIG.read_text("utf-8") == as_yaml()
    assert max(map(len, as_yaml().splitlines())) <= WIDTH


def test_the_parameter_file_holds_every_default_and_says_what_each_is():
    values = yaml.safe_load(as_yaml())["/**"]["ros__parameters"]
    assert values == {item.name: item.default for item in OPTIONS.values()}
    assert all(type(values[item.name]) is item.type for item in OPTIONS.values())
    assert configuration(values) == configuration({item.name: item.default for item in OPTIONS.values()})
    text = " ".join(line.strip("# ") for line in as_yaml().splitlines())
    assert all(item.describe() in text for item in OPTIONS.values())


@pytest.mark.parametrize("namespace", ["/", "/ns"])
def test_a_node_takes_the_parameter_file_and_has_the_defaults(started, declared, namespace):
    node = started("-r", f"__ns:={namespace}", "--params-file", CONFIG)
    parameters = Parameters(node)
    assert parameters.read() == declared().parameters.read()
    assert parameters.unknown() == []
    assert unused_files(["--ros-args", "--params-file", str(CONFIG)], node.get_fully_qualified_name()) == []


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


def test_values_are_converted_once_and_between_two_that_belong_together_those_before_hold(declared):
    holder = declared()
    before = holder.parameters.read()
    assert holder.parameters.read() is before
    holder.node.remove_on_set_parameters_callback(holder.parameters.check)  # rclpy sets one after the other after it
    change(holder, free_thresh=0.8)
    assert holder.parameters.read() is before
    change(holder, occupied_thresh=0.9)
    options = holder.parameters.read().node
    assert (options.free_thresh, options.occupied_thresh) == (0.8, 0.9)
