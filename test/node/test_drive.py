"""A minute of driving with the node, on a map that changes: examples/drive.py, as a user starts it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from dubins_rrt_ros.planning import kernels_compiled

DRIVE = Path(__file__).resolve().parents[2] / "examples" / "drive.py"


@pytest.mark.slow
@pytest.mark.skipif(not kernels_compiled, reason="too slow to drive with interpreted kernels")
def test_a_car_drives_for_a_minute_reaches_goals_and_touches_nothing(record_property):
    command = [sys.executable, str(DRIVE), "--minutes", "1", "--seed", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    *goals, summary = map(json.loads, done.stdout.splitlines())
    for name, value in summary.items():
        record_property(name, value)
    assert summary["touched"] == 0
    assert summary["reached"] >= 1
    assert all(goal["least_room"] >= 0 for goal in goals)
