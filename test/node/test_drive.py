"""Seconds and a minute of driving with the node, on a map that changes: examples/drive.py, as a user starts it."""

import importlib
import itertools
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time

from dubins_rrt_ros.node.conversions import path_message, status_message
from dubins_rrt_ros.planning import GridMap, Status, kernels_compiled

DRIVE = Path(__file__).resolve().parents[2] / "examples" / "drive.py"
#: As a user starts it, so that it finds the file beside it; in another folder, so that it finds the package that is installed.
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}


@pytest.mark.skipif(not kernels_compiled, reason="too slow to drive with interpreted kernels")
@pytest.mark.slow
@pytest.mark.parametrize("minutes", [0.05, pytest.param(1, marks=pytest.mark.minute)])
def test_a_car_drives_reaches_goals_and_touches_nothing(record_property, tmp_path, minutes):
    command = [sys.executable, str(DRIVE), "--minutes", str(minutes), "--seed", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=ENVIRONMENT, cwd=tmp_path)
    assert done.returncode == (minutes < 1), done.stdout + done.stderr  # no goal is reached in seconds
    *lines, summary = map(json.loads, done.stdout.splitlines())
    for name, value in summary.items():
        record_property(name, value)
    assert summary["touched"] == 0
    assert summary["reached"] >= (minutes >= 1)
    assert all(line["least_room"] >= 0 for line in lines if "goal" in line)  # others tell of long times without a path


def test_a_car_that_cannot_be_placed_leaves_no_planner_behind(tmp_path):
    (tmp_path / "narrow.pgm").write_bytes(b"P5 10 10 255\n" + bytes([254] * 100))
    (tmp_path / "narrow.yaml").write_text("image: narrow.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n"
                                          "occupied_thresh: 0.65\nfree_thresh: 0.25\n")
    command = [sys.executable, str(DRIVE), "--map", str(tmp_path / "narrow.yaml")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT, cwd=tmp_path,
                          start_new_session=True) as process:
        _, errors = process.communicate(timeout=120)
        assert process.returncode == 1
        assert errors.endswith("there is hardly room to drive on this map\n")
        with pytest.raises(ProcessLookupError):
            os.killpg(process.pid, 0)


@pytest.fixture
def drive(monkeypatch):
    """Return the example as a module."""
    monkeypatch.syspath_prepend(str(DRIVE.parent))
    return importlib.import_module("drive")


def corridor(person: float | None = None) -> GridMap:
    """Return a map of a corridor that is 20 m long and 1.5 m wide, with somebody in the middle of it at x [m]."""
    cells = np.zeros((30, 400), np.int8)
    if person is not None:
        middle = int(person / 0.05)
        cells[10:20, middle - 5:middle + 5] = 100
    return GridMap(cells, 0.05, (0.0, 0.0, 0.0), percent=True)


@pytest.mark.slow
def test_a_planner_is_not_blamed_for_somebody_in_the_only_way_far_ahead(drive):
    start, goal = (1.0, 0.75, 0.0), (19.0, 0.75, 0.0)
    views = [(0.0, corridor()), (0.3, corridor(person=12.0)), (2.0, corridor()), (2.4, corridor()), (3.2, corridor(person=15.0))]
    wait = drive.Wait({"car": "/car1"}, seconds=5.0, views=[drive.View(begin, grid, start, [goal]) for begin, grid in views])
    judged = wait.judged()
    assert judged["without_path"] == 5.0
    assert judged["standstill"] == pytest.approx(1.2)
    assert judged["pose"] == list(start) and judged["places"] == [list(goal)]


def test_a_home_is_found_on_a_busy_machine(drive, monkeypatch):
    """By a clock that goes on by 10 ms with each look at it, so that a path takes a second."""
    looks = itertools.count()
    open_floor = GridMap(np.zeros((200, 200), np.int8), 0.05, (0.0, 0.0, 0.0), percent=True)
    places = drive.Places(drive.Floor(open_floor, np.random.default_rng(0)), np.random.default_rng(1))
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: 0.01 * next(looks))
    home = places.home()
    assert places.after(home, home) == home  # goals are given up sooner
    monkeypatch.undo()
    assert places.after(home, home) != home


@pytest.fixture
def course(monkeypatch):
    """Return the path of a car, as the example has it, before one has come."""
    monkeypatch.syspath_prepend(str(DRIVE.parent))
    return importlib.import_module("course").Course()


def test_a_path_is_not_driven_on_once_it_is_broken_until_another_one_has_come(course):
    first, second = (path_message(np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]), "map", Time(sec=n)) for n in (1, 2))
    nothing = path_message(np.empty((0, 3)), "map", Time(sec=3))
    broken = status_message("/planner", Status.NO_VALID_PATH, "The map changed.", plan_id=1, is_warning=True)
    there = status_message("/planner", Status.NONE, "Path of 1.00 m.", plan_id=2, stamp=second.header.stamp)
    assert not course.is_free
    course.take(first)
    assert course.is_free
    course.hear(broken)
    assert not course.is_free
    course.take(second)
    assert course.is_free
    course.hear(broken)  # came later than what is in its place
    course.hear(there)
    assert course.is_free
    course.take(nothing)
    assert not course.is_free


def test_a_car_is_steered_towards_the_path_ahead_of_it_and_straight_on_beyond_its_end(course):
    course.take(path_message(np.array([(0.1 * n, 0.0, 0.0) for n in range(11)]), "map", Time()))
    assert course.length == pytest.approx(1.0)
    assert course.point_ahead(0.32, 0.1, 0.45) == pytest.approx((0.8, 0.0))
    assert course.ahead[0, 0] == pytest.approx(0.3)
    assert course.point_ahead(0.8, -0.1, 0.5) == pytest.approx((1.3, 0.0))
