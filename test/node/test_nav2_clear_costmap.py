"""The service that Nav2's default behaviour trees ask for: there is nothing to clear, and it answers."""

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("nav2_msgs", reason="nav2_msgs is not here; .ci/messages builds it")

from nav2_msgs.srv import ClearEntireCostmap
from support.yard import GOAL, QUICK, START

pytestmark = pytest.mark.messages


def test_it_answers_where_it_is_asked_for_and_nothing_is_cleared(planners, map_file):
    planners.start(map_file=map_file, clear_costmap_service=True, **QUICK)
    client = planners.client()
    caller = client.node.create_client(ClearEntireCostmap, "global_costmap/clear_entirely_global_costmap")
    client.wait_for(caller.service_is_ready, "the service that clears the costmap")
    assert isinstance(client.ask(caller, ClearEntireCostmap.Request()), ClearEntireCostmap.Response)
    assert client.plan(START, GOAL)[1]["error_name"] == "NONE"
