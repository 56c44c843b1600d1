"""The node where no compiler was at hand: it is slow, says so once, and plans."""

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from dubins_rrt_ros.planning import kernels_compiled

pytestmark = pytest.mark.skipif(kernels_compiled, reason="the kernels are compiled")


def test_the_node_warns_once_and_plans(installed_planners, map_yaml):
    process = installed_planners.start(map_file=str(map_yaml), samples=60, planning_time=120.0, seed=1)
    client = installed_planners.client()
    client.send("start_pose", (1.5, 5.0, 0.0))
    for plan_id in (1, 2):
        client.send("goal_pose", (3.5, 5.0, 0.0))
        assert client.status_of(plan_id, samples="60")["error_name"] == "NONE"
    assert process.output.count("not compiled") == 1
