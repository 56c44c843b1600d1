"""Whatever is given for a parameter, or in a file of them, there is a configuration or a sentence.

`test_maps.py` says how to run more of them.
"""

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from hypothesis import given, settings
from hypothesis import strategies as st
from support.bounded import Bounds, read_or_refused
from support.mutations import json_of, odd_values, spoiled

from dubins_rrt_ros.node.parameter_files import as_yaml, unused_files
from dubins_rrt_ros.node.parameters import OPTIONS, configuration
from dubins_rrt_ros.planning import OptionError
from dubins_rrt_ros.planning.text import LONGEST

DEFAULTS = {item.name: item.default for item in OPTIONS.values()}
FILES = [{"/**": {"ros__parameters": {"samples": 10}}}, {"ns": {"planner": {"ros__parameters": {"seed": 1}}, "other": {}}}]
fuzz = settings.get_profile("fuzz")


@fuzz
@given(st.fixed_dictionaries({}, optional=dict.fromkeys(DEFAULTS, odd_values)))
def test_parameters(given):
    read_or_refused(lambda: configuration(DEFAULTS | given), OptionError)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("parameters") / "p.yaml"


def warnings_of(file):
    return unused_files(["--ros-args", "--params-file", str(file)], "/planner")


@fuzz
@given(content=json_of(FILES) | spoiled([as_yaml().encode()[:300], b"planner:\n  ros__parameters:\n    seed: 1\n",
                                         b"a: &a {b: {ros__parameters: {}}}\nc: *a\n"]))
def test_parameter_file(file, content):
    file.write_bytes(content)
    warnings = read_or_refused(lambda: warnings_of(file))
    assert all(warning.isprintable() and len(warning) <= LONGEST for warning in warnings)


def test_a_parameter_file_of_aliases_is_passed_over(file):
    levels = ["a0: &a0 {x: y}", *(f"a{i}: &a{i} {{{', '.join(f'k{k}: *a{i - 1}' for k in range(9))}}}" for i in range(1, 20))]
    file.write_text("\n".join(levels))
    with Bounds():
        assert warnings_of(file) == []
