"""`dubins_rrt demo` for real: the node as its own process, real topics, a picture."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from matplotlib.image import imread

from dubins_rrt_ros.cli.demo import process as planner_process
from dubins_rrt_ros.cli.main import main


@pytest.fixture
def environment(monkeypatch):
    """Has restored what the command sets."""
    for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.setenv(name, "")


def run_demo(folder):
    return subprocess.run([sys.executable, "-m", "dubins_rrt_ros", "demo"], cwd=folder, capture_output=True, text=True,
                          timeout=120)


@pytest.mark.slow
def test_the_demo_plans_over_real_topics_and_draws(tmp_path):
    pytest.importorskip("rclpy")
    ended = run_demo(tmp_path)
    assert ended.returncode == 0, ended.stderr
    for figure in ("path", "lower bound", "%", "first path", "planning time", "tree nodes"):
        assert figure in ended.stdout
    assert "exit status 0" in ended.stdout and ended.stderr == ""
    pixels = np.round(imread(tmp_path / "demo.png")[..., :3] * 255)
    assert (np.abs(pixels - [0xd5, 0x5e, 0x00]) < 3).all(axis=2).sum() > 2000


def test_a_node_that_dies_is_told_in_one_line(tmp_path, monkeypatch, environment, capsys):
    pytest.importorskip("rclpy")
    dying = [sys.executable, "-c", "print('No engine.'); raise SystemExit(3)"]
    monkeypatch.setattr(planner_process, "planner_command", lambda: dying)
    assert main(["demo", "--plot", str(tmp_path / "demo.png")]) == 1
    error = capsys.readouterr().err
    assert "exit status 3" in error and "No engine." in error and error.count("\n") == 1
    assert not (tmp_path / "demo.png").exists()


def test_without_ros_the_remedy_is_told_in_one_line(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(planner_process.importlib.util, "find_spec", lambda name: None)
    assert main(["demo", "--plot", str(tmp_path / "demo.png")]) == 1
    error = capsys.readouterr().err
    assert "pip install 'dubins_rrt_ros[ros]'" in error and error.count("\n") == 1


def test_an_interrupted_demo_leaves_no_node_behind(tmp_path, monkeypatch, environment, capsys):
    """The node is replaced by a process that interrupts the demonstration and then waits for its own end."""
    assert_interrupted(tmp_path, monkeypatch, capsys, "os.kill(os.getppid(), signal.SIGTERM)")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_demo_that_is_interrupted_while_the_node_starts_leaves_none_behind(tmp_path, monkeypatch, environment, capsys, number):
    class Interrupted(subprocess.Popen):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            while not (tmp_path / "id").exists():
                time.sleep(0.01)
            os.kill(os.getpid(), number)

    monkeypatch.setattr(planner_process.subprocess, "Popen", Interrupted)
    assert_interrupted(tmp_path, monkeypatch, capsys, "pass")


def assert_interrupted(tmp_path, monkeypatch, capsys, doing):
    pytest.importorskip("rclpy")
    program = (f"import os, signal; open({str(tmp_path / 'new')!r}, 'w').write(str(os.getpid())); "
               f"os.rename({str(tmp_path / 'new')!r}, {str(tmp_path / 'id')!r}); {doing}; signal.pause()")
    monkeypatch.setattr(planner_process, "planner_command", lambda: [sys.executable, "-c", program])
    assert main(["demo", "--plot", str(tmp_path / "demo.png")]) == 130
    assert "interrupted" in capsys.readouterr().err
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "id").read_text()), 0)
