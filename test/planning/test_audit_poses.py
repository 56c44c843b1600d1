"""The audit of poses alone: those of a car pass, also rounded, and what no car drives is found."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_rrt_ros.planning import DubinsCurve, Path, PolygonMap, Problem, Vehicle, audit_path
from dubins_rrt_ros.planning.audit.poses import audit_poses, driven_length
from dubins_rrt_ros.planning.curves.dubins import shortest

YARD = PolygonMap(shapely.box(0, 0, 20, 20))
LONG = Vehicle(turning_radius=1.0, footprint="[[0.9, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.9, -0.3]]")
DISC = Vehicle(turning_radius=1.0, robot_radius=0.3)
POSES = st.tuples(st.floats(4, 16), st.floats(4, 16), st.floats(-3, 3))


def judged(poses, vehicle=LONG, map=YARD, **tolerances):
    poses = np.asarray(poses, dtype=float)
    return audit_poses(poses, Problem(map, vehicle, poses[0], poses[-1]), **tolerances)


def findings(*arguments, **keywords):
    return "; ".join(judged(*arguments, **keywords).findings)


def bend(radius=1.0, spacing=0.05):
    """A straight line, half a circle to the left, and back."""
    return DubinsCurve((5.0, 5.0, 0.0), radius, "LSL", (0.0, 3.0, math.pi * radius)).poses(spacing)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(POSES, min_size=2, max_size=4), st.sampled_from([0.01, 0.05, 0.3]), st.sampled_from([LONG, DISC]))
def test_the_poses_of_curves_are_judged_as_the_curves_are(ends, spacing, vehicle):
    path = Path.of_curves(ends[0], ends[-1], tuple(shortest(a, b, 1.0) for a, b in pairwise(ends)))
    poses = path.poses(spacing)
    verdict, known = judged(poses, vehicle), audit_path(path, Problem(YARD, vehicle, path.start, path.end))
    assert verdict.ok and known.ok
    assert verdict.min_clearance == pytest.approx(known.min_clearance, rel=0.021, abs=0.001)
    assert driven_length(poses) == pytest.approx(path.length, abs=1e-6)


@pytest.mark.parametrize("vehicle", [LONG, DISC])
@pytest.mark.parametrize("digits, tolerance", [(3, 3e-3), (4, 1e-3), (6, 1e-5)])
def test_a_few_digits_are_enough(vehicle, digits, tolerance):
    for poses in (shortest((5.0, 5.0, 0.3), (9.0, 9.0, -2.0), 1.0).poses(0.05), bend()):
        assert not findings(np.round(poses, digits), vehicle, tolerance_xy=tolerance, tolerance_yaw=tolerance)


def test_yaw_may_wrap_and_poses_may_come_twice():
    poses = DubinsCurve((8.0, 8.0, 2.5), 1.0, "LSL", (0.0, 3.0, math.pi)).poses(0.05)
    poses[:, 2] = np.remainder(poses[:, 2] + math.pi, math.tau) - math.pi
    assert np.ptp(poses[:, 2]) > 6
    poses = np.repeat(poses, 2, axis=0)
    assert not findings(poses) and driven_length(poses) == pytest.approx(3 + math.pi)
    poses[::3, 2] += math.tau
    assert not findings(poses) and driven_length(poses) == pytest.approx(3 + math.pi)


def test_one_pose_is_a_path_of_no_length():
    verdict = judged([(5.0, 5.0, 1.0)])
    assert verdict.ok and verdict.max_curvature == 0 and driven_length(np.array([(5.0, 5.0, 1.0)])) == 0
    assert not judged([(0.2, 5.0, 1.0)]).ok


@pytest.mark.parametrize("spacing", [0.005, 0.05, 0.3])
@pytest.mark.parametrize("tighter", [0.01, 0.1])
def test_a_turn_too_tight_is_found_however_short_the_steps(spacing, tighter):
    found = findings(bend(1 - tighter, spacing))
    assert "turns left" in found and "a radius of 1 m allows" in found
    mirrored = bend(1 - tighter, spacing) * (1, -1, -1) + (0, 15, 0)
    assert "turns right" in findings(mirrored)
    assert not findings(bend(1 - 1e-9, spacing))


def test_turning_on_the_spot_is_found():
    poses = np.insert(bend(), 20, bend()[20] - (0, 0, 0.4), axis=0)
    assert "turns left" in findings(poses) and "from pose 20" in findings(poses)


@pytest.mark.parametrize("spacing", [0.004, 0.05])
@pytest.mark.parametrize("angle, side", [(0.02, "right"), (-0.02, "left")])
def test_slipping_is_found_however_short_the_steps(spacing, angle, side):
    """A steady yaw that is off the way it goes."""
    x = np.arange(4, 9, spacing)
    found = findings(np.column_stack([x, np.full(len(x), 5.0), np.full(len(x), angle)]))
    assert f"more to the {side} than its yaw allows" in found
    assert not findings(np.column_stack([x, np.full(len(x), 5.0), np.full(len(x), angle / 50)]))


@pytest.mark.parametrize("spacing", [8e-4, 0.05])
def test_driving_backward_is_found_however_short_the_steps(spacing):
    poses = bend(spacing=spacing)
    there_and_back = np.vstack([poses, poses[-2:-max(3, int(0.1 / spacing)):-1]])
    assert "backward" in findings(there_and_back)
    assert "backward" in findings(poses[::-1])
    assert not findings(poses[::-1] + np.array([0, 0, math.pi]))


def test_a_jump_is_found():
    poses = bend()
    poses[30:, 1] += 0.002
    assert "more to the left" in findings(poses)
    assert not findings(poses, tolerance_xy=0.003)


def test_the_ends_count():
    poses = bend()
    problem = Problem(YARD, LONG, poses[0], poses[-1])
    for axis in range(3):
        off = np.zeros(3)
        off[axis] = 0.01
        start = Problem(YARD, LONG, poses[0] + off, poses[-1])
        goal = Problem(YARD, LONG, poses[0], poses[-1] + off)
        assert audit_poses(poses, problem).ok
        assert "from the start" in str(audit_poses(poses, start).findings)
        assert "from the goal" in str(audit_poses(poses, goal).findings)
        assert audit_poses(poses, start, 0.02, 0.02).ok and audit_poses(poses, goal, 0.02, 0.02).ok


@pytest.mark.parametrize("vehicle, widest, ahead", [(LONG, math.hypot(1.3, 0.9), math.atan2(0.9, 1.3)), (DISC, 1.3, 0.0)])
def test_contact_between_poses_is_found(vehicle, widest, ahead):
    """Of a turn to the right around (8, 4), on its widest circle, by a hair; the next poses are more than 0.01 m away."""
    poses = DubinsCurve((8.0, 5.0, 0.0), 1.0, "RSR", (math.pi / 2, 0.0, 0.0)).poses(0.3)
    at = math.pi / 2 - ahead - 0.65
    away, along = np.array([math.cos(at), math.sin(at)]), np.array([-math.sin(at), math.cos(at)])
    for gap in (1e-5, -1e-5):
        tip = (8.0, 4.0) + (widest + gap) * away
        post = shapely.Polygon([tip, tip + 0.01 * away + 0.003 * along, tip + 0.01 * away - 0.003 * along])
        assert judged(poses, vehicle, PolygonMap(shapely.box(0, 0, 20, 20) - post)).ok == (gap > 0)


@pytest.mark.parametrize("vehicle", [LONG, DISC])
def test_what_poses_are_off_is_added_to_the_clearance_needed(vehicle):
    """Along a wall, with one pose 0.8 mm aside."""
    for gap, off, free in ((1e-4, 0.0, True), (1e-4, 8e-4, False), (9e-4, 8e-4, True)):
        x = np.arange(4, 9, 0.1)
        poses = np.column_stack([x, np.full(len(x), 0.3 + gap), np.zeros(len(x))])
        poses[25, 1] += off
        verdict = judged(poses, vehicle)
        assert verdict.ok == free
        assert free or "0.000800 m that the poses are off their arcs" in str(verdict.findings)


def test_the_room_for_a_little_turn_on_the_spot_is_needed_too():
    """Of 0.8 mrad, by which the corners move 0.76 mm."""
    for gap, turn, free in ((5e-4, 0.0, True), (5e-4, 8e-4, False), (1.6e-3, 8e-4, True)):
        poses = [(4.0, 0.3 + gap, 0.0), (5.0, 0.3 + gap, 0.0), (5.0, 0.3 + gap, turn)]
        assert judged(poses).ok == free


def test_obstacles_are_found_along_with_what_no_car_drives():
    found = judged(bend(0.9), map=PolygonMap(shapely.box(3, 3, 8, 8))).findings
    assert len(found) == 2 and "turns left" in found[0] and "contact" in found[1]
