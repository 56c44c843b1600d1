"""The path that is published as bytes is the message."""

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message

from dubins_rrt_ros.node.cdr import serialized_path
from dubins_rrt_ros.node.conversions import path_message

STAMP = Time(sec=12, nanosec=34)


# Names of all lengths modulo the 8 bytes to which numbers are aligned, and one of more bytes than letters.
@pytest.mark.parametrize("frame", ["", "m", "ma", "map", "maps", "odom1", "odom12", "odom123", "odom1234", "carte_é"])
@pytest.mark.parametrize("n", [0, 1, 2, 3, 100])
def test_the_bytes_of_a_path_are_those_of_its_message(frame, n):
    poses = np.random.default_rng(n).normal(size=(n, 3)) * [10, 10, 3]
    received = deserialize_message(serialized_path(poses, frame, STAMP), Path)
    assert received == path_message(poses, frame, STAMP)
    assert len(received.poses) == n
