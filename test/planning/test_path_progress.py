"""Progress along a path: it never falls, and what is left of a path is driven as before."""

import math

import numpy as np
import pytest

from dubins_rrt_ros.planning import DubinsCurve, Path
from dubins_rrt_ros.planning.curves.progress import PathProgress

R = 1.0


def looping_path():
    """5 m ahead, a full loop to the left, and 5 m on: it crosses itself at (5, 0)."""
    begin, turn, end = (0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (10.0, 0.0, 0.0)
    curves = [DubinsCurve(begin, R, "LSL", (0.0, 5.0, 0.0)), DubinsCurve(turn, R, "LSL", (2 * math.pi, 5.0, 0.0))]
    return Path.of_curves(begin, end, curves)


def beside(pose, offset):
    x, y, yaw = pose
    return x - offset * math.sin(yaw), y + offset * math.cos(yaw), yaw


@pytest.mark.parametrize("offset", [0.0, 0.05, -0.05])
@pytest.mark.parametrize("step", [0.02, 0.1, 0.5])
def test_progress_never_falls_on_a_path_with_a_loop_also_for_a_vehicle_beside_it(offset, step):
    path = looping_path()
    progress, reached = PathProgress(path), []
    arc_lengths = np.append(np.arange(0.0, path.length, step), path.length)
    for pose in path.at(arc_lengths / path.length).tolist():
        progress.advance(beside(pose, offset))
        reached.append(progress.arc_length)
    assert (np.diff(reached) >= 0).all()
    assert reached == pytest.approx(arc_lengths.tolist(), abs=0.15)
    assert progress.left == pytest.approx(0.0, abs=0.1)


def test_a_vehicle_that_stands_or_goes_back_makes_no_progress():
    progress = PathProgress(looping_path())
    progress.advance((3.0, 0.0, 0.0))
    assert progress.arc_length == pytest.approx(3.0, abs=0.01)
    for x in (3.0, 2.0, 0.0):
        progress.advance((x, 0.0, 0.0))
        assert progress.arc_length == pytest.approx(3.0, abs=0.01)
    assert progress.distance == pytest.approx(3.0, abs=0.01)


def test_the_nearest_pose_is_sought_within_twice_the_distance_driven_since():
    progress = PathProgress(looping_path())
    progress.advance((1.0, 0.0, 0.0))
    progress.advance((2.0, 0.0, 0.0))
    before = progress.arc_length
    progress.advance((2.0, 0.05, 0.0))  # a jump of 5 cm: the end of the path, where it comes by again, is out of reach
    assert before <= progress.arc_length <= before + 0.1


def test_what_is_ahead_is_the_same_path_without_what_was_driven():
    path = looping_path()
    progress = PathProgress(path)
    for x in np.arange(0.1, 4.05, 0.1).tolist():
        progress.advance((x, 0.0, 0.0))
    ahead = progress.ahead
    ahead.check()
    assert ahead.length == pytest.approx(progress.left, abs=1e-9)
    assert ahead.start == pytest.approx((4.0, 0.0, 0.0), abs=0.01)
    assert ahead.end == path.end


def test_a_path_of_one_pose_and_a_vehicle_far_out_are_no_trouble():
    progress = PathProgress(Path.of_pose((1.0, 2.0, 0.5)))
    progress.advance((1.0, 2.5, 0.5))
    assert (progress.left, progress.arc_length, progress.distance) == (0.0, 0.0, pytest.approx(0.5))
    progress = PathProgress(looping_path())
    progress.advance((1e308, -1e308, 0.0))
    assert 0 <= progress.arc_length <= progress.left + progress.arc_length
