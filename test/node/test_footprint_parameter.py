"""A footprint as the node's parameter: a parked car, and a pose that a disc could take and the footprint cannot."""

from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from support.harness import poses_of

CAR = "[[3.6, 0.9], [-0.9, 0.9], [-0.9, -0.9], [3.6, -0.9]]"
ENTRY, BAY, ACROSS = (2.5, 8.75, 0.0), (22.0, 4.1, -1.5708), (5.0, 9.0, 1.5708)


@pytest.fixture(scope="module")
def running(module_planners):
    process = module_planners.start(map_file="parking.geojson", turning_radius=5.0, footprint=CAR, seed=1, planning_time=15.0,
                                    preferred_clearance=0.0)
    return process, module_planners.client()


def test_a_car_is_parked_over_the_network(running):
    process, client = running
    client.wait_for(lambda: "covered by 10 discs that reach 0.19 m beyond it" in process.output, "the cover to be told")
    path, told = client.plan(ENTRY, BAY)
    assert told["error_name"] == "NONE", told["message"]
    assert told["audit"] == "ok"
    assert 0 < float(told["min_clearance"]) < 0.1
    assert poses_of(path)[-1, :2].tolist() == list(BAY[:2])


def test_the_pose_must_hold_the_whole_car(running):
    """Its rear axle has room there, its front overlaps a parked car."""
    _, client = running
    _, told = client.plan(ACROSS, BAY)
    assert told["error_name"] == "START_OCCUPIED"
    assert told["message"].startswith("Start is occupied: the footprint touches an obstacle at (")
    client.set_parameters(footprint="", robot_radius=0.9, planning_time=0.5)
    _, told = client.plan(ACROSS, BAY)
    assert told["message"].startswith("No path exists: every forward arc from the start hits an obstacle"), told["message"]


@pytest.mark.parametrize("arguments", [
    ["-p", f"footprint:={CAR}"], ["-p", "footprint:=[3.6, 0.9, -0.9, 0.9, -0.9, -0.9]"], ["--params-file", "lists.yaml"]])
def test_a_footprint_as_lists_of_yaml_is_refused_with_the_advice_to_quote_it(planners, arguments, tmp_path, monkeypatch):
    """Of a list of lists on the command line ROS takes the last one."""
    monkeypatch.chdir(tmp_path)
    Path("lists.yaml").write_text(f"/**:\n  ros__parameters:\n    footprint: {CAR}\n")
    process = planners.start(*arguments)
    assert process.wait() == 1
    line = process.output.splitlines()[-1]
    assert line.startswith("planner: ") and "footprint" in line and "as text, in quotes" in line


def test_a_footprint_in_quotes_is_taken_as_nav2_writes_it(planners, tmp_path):
    file = tmp_path / "p.yaml"
    footprint = "[[.3, .2], [.3, -.2], [-.3, -.2], [-.3, .2], ]"
    file.write_text(f'/**:\n  ros__parameters:\n    map_file: maze\n    footprint: "{footprint}"\n')
    process = planners.start("--params-file", str(file))
    planners.client().wait_for_word("The map is ready")
    assert "for a footprint of 4 corners" in process.output
