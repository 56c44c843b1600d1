"""The node without nav2_msgs, which PyPI does not have."""

import sys

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

#: The node's own main, where nav2_msgs cannot be imported.
WITHOUT = "import sys; sys.modules['nav2_msgs'] = None; from dubins_rrt_ros.node.main import main; sys.exit(main())"


def test_without_nav2_msgs_the_log_says_once_what_is_missing(planners):
    process = planners.start(command=[sys.executable, "-c", WITHOUT])
    client = planners.client()
    client.wait_for_word("ros-jazzy-nav2-msgs")
    client.status_of(0)
    assert process.output.count("nav2_msgs") == 1
