"""The launch files: what they start is there. They are read, not run: PyPI has no launch."""

import ast
import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
FILES = sorted(ROOT.glob("launch/*.py"))
#: The nodes of Nav2's navigation that a lifecycle manager brings up, in the order in which it does.
NAVIGATION = ["controller_server", "smoother_server", "planner_server", "behavior_server", "bt_navigator", "waypoint_follower",
              "velocity_smoother"]


def constants(file):
    """What a file assigns to names in capitals, as far as these are made of literals and of each other."""
    found = {}
    for statement in ast.parse(file.read_text("utf-8")).body:
        if isinstance(statement, ast.Assign) and (name := statement.targets[0].id) in ("SERVERS", "PACKAGES", "MANAGED"):
            exec(compile(ast.Module([statement], []), file.name, "exec"), found)
            assert name in found
    return found


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_launch_file_has_its_function_and_starts_the_planner(file):
    tree = ast.parse(file.read_text("utf-8"))
    assert "generate_launch_description" in [part.name for part in tree.body if isinstance(part, ast.FunctionDef)]
    assert re.search('"dubins_rrt_ros"(, executable=)?.*"planner"', file.read_text("utf-8"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_the_files_that_it_names_are_installed(file):
    named = re.findall(r'"([\w.]+\.(?:yaml|rviz))"', file.read_text("utf-8"))
    assert named
    assert [name for name in named if not (ROOT / "config" / name).exists()] == []


def test_nav2_s_nodes_are_all_there_and_managed_in_its_order():
    found = constants(ROOT / "launch/nav2.launch.py")
    assert found["MANAGED"] == NAVIGATION
    assert {*found["SERVERS"], "planner_server"} == {*NAVIGATION}
    assert found["PACKAGES"] == {
        "controller_server": "nav2_controller", "smoother_server": "nav2_smoother", "behavior_server": "nav2_behaviors",
        "bt_navigator": "nav2_bt_navigator", "waypoint_follower": "nav2_waypoint_follower",
        "velocity_smoother": "nav2_velocity_smoother"}


def test_the_parameters_for_nav2_are_ours():
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from dubins_rrt_ros.node.parameters import OPTIONS, configuration

    given = yaml.safe_load((ROOT / "config/nav2_params.yaml").read_text("utf-8"))
    ours = given["planner_server"]["ros__parameters"]
    read = configuration({name: item.default for name, item in OPTIONS.items()} | ours)
    assert set(ours) <= set(OPTIONS)
    assert read.node.managed and read.node.clear_costmap_service and read.node.planner_ids == ("GridBased",)
    assert given["lifecycle_manager_navigation"]["ros__parameters"]["bond_timeout"] == 0.0
    controller = given["controller_server"]["ros__parameters"]["FollowPath"]
    assert controller["regulated_linear_scaling_min_radius"] > read.vehicle.turning_radius
