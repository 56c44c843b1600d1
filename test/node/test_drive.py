"""Seconds and a minute of driving with the node, on a map that changes: examples/drive.py, as a user starts it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from dubins_rrt_ros.planning import kernels_compiled

DRIVE = Path(__file__).resolve().parents[2] / "examples" / "drive.py"


@pytest.mark.skipif(not kernels_compiled, reason="too slow to drive with interpreted kernels")
@pytest.mark.parametrize("minutes", [0.05, pytest.param(1, marks=[pytest.mark.slow, pytest.mark.minute])])
def test_a_car_drives_reaches_goals_and_touches_nothing(record_property, minutes):
    command = [sys.executable, str(DRIVE), "--minutes", str(minutes), "--seed", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == (minutes < 1), done.stdout + done.stderr  # no goal is reached in seconds
    *goals, summary = map(json.loads, done.stdout.splitlines())
    for name, value in summary.items():
        record_property(name, value)
    assert summary["touched"] == 0
    assert summary["reached"] >= (minutes >= 1)
    assert all(goal["least_room"] >= 0 for goal in goals)
