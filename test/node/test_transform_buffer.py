"""The buffer of transforms of our own: chains, interpolation, static and missing frames, beside scipy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Reference
from scipy.spatial.transform import Slerp

pytest.importorskip("rclpy", reason="rclpy is not installed")

from dubins_rrt_ros.node.rigid import Rigid, Rotation
from dubins_rrt_ros.node.transform_buffer import TransformBuffer, TransformUnknown

SECOND = 1_000_000_000


def random_rigid(rng):
    x, y, z, w = Reference.random(random_state=rng).as_quat()
    return Rigid(*rng.uniform(-5, 5, 3).tolist(), Rotation(float(w), float(x), float(y), float(z)))


def matrix(rigid):
    w, x, y, z = rigid.rotation
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = Reference.from_quat((x, y, z, w)).as_matrix(), rigid[:3]
    return found


def shifted(x):
    return Rigid(float(x), 0.0, 0.0, Rotation(1.0, 0.0, 0.0, 0.0))


@pytest.fixture
def buffer():
    return TransformBuffer()


def test_frames_are_joined_up_to_their_common_ancestor_and_down_again(buffer):
    rng = np.random.default_rng(1)
    poses = {name: random_rigid(rng) for name in ("odom", "base", "lidar", "dock", "camera")}
    tree = {"odom": "map", "base": "odom", "lidar": "base", "dock": "map", "camera": "dock"}
    for name, parent in tree.items():
        buffer.add(parent, name, 5 * SECOND, poses[name], is_static=name in ("dock", "lidar"))
    in_map = {"map": np.eye(4)}
    for name, parent in tree.items():
        in_map[name] = in_map[parent] @ matrix(poses[name])
    for target in in_map:
        for source in in_map:
            found, stamp = buffer.lookup(target, source)
            assert matrix(found) == pytest.approx(np.linalg.inv(in_map[target]) @ in_map[source], abs=1e-9)
            never_moves = target == source or {target, source} in ({"map", "dock"}, {"base", "lidar"})
            assert stamp == (None if never_moves else 5 * SECOND)


def test_a_pose_between_two_times_is_interpolated(buffer):
    rng = np.random.default_rng(2)
    first, second = random_rigid(rng), random_rigid(rng)
    buffer.add("map", "base", 10 * SECOND, first, is_static=False)
    buffer.add("map", "base", 12 * SECOND, second, is_static=False)
    turn = Slerp([10, 12], Reference.from_quat([[r.x, r.y, r.z, r.w] for r in (first.rotation, second.rotation)]))
    for time in (10.0, 10.5, 11.0, 11.9, 12.0):
        found, stamp = buffer.lookup("map", "base", round(time * SECOND))
        share = (time - 10) / 2
        assert found[:3] == pytest.approx([(1 - share) * a + share * b for a, b in zip(first[:3], second[:3], strict=True)])
        assert matrix(found)[:3, :3] == pytest.approx(turn(time).as_matrix(), abs=1e-9)
        assert stamp == round(time * SECOND)


def test_the_latest_time_is_the_newest_at_which_all_in_between_are_known(buffer):
    for stamp in (1, 2, 3):
        buffer.add("odom", "base", stamp * SECOND, shifted(stamp), is_static=False)
    for stamp in (1, 2):
        buffer.add("map", "odom", stamp * SECOND, shifted(10 * stamp), is_static=False)
    found, stamp = buffer.lookup("map", "base")
    assert (found.x, stamp) == (22.0, 2 * SECOND)


def test_a_time_before_the_oldest_transform_is_final_and_one_after_the_newest_may_come(buffer):
    for stamp in (5, 6):
        buffer.add("map", "base", stamp * SECOND, shifted(stamp), is_static=False)
    with pytest.raises(TransformUnknown, match=r"1\.000 s before the oldest transform from 'map' to 'base'") as early:
        buffer.lookup("map", "base", 4 * SECOND)
    with pytest.raises(TransformUnknown, match=r"0\.500 s after the newest transform from 'map' to 'base'") as late:
        buffer.lookup("map", "base", round(6.5 * SECOND))
    assert (early.value.is_final, late.value.is_final) == (True, False)


def test_transforms_are_kept_for_ten_seconds_and_taken_in_any_order(buffer):
    for stamp in (3, 1, 12, 2, 8):
        buffer.add("map", "base", stamp * SECOND, shifted(stamp), is_static=False)
    assert buffer.lookup("map", "base", round(2.5 * SECOND))[0].x == pytest.approx(2.5)
    buffer.add("map", "base", 13 * SECOND, shifted(13), is_static=False)
    with pytest.raises(TransformUnknown, match="before the oldest"):
        buffer.lookup("map", "base", round(2.5 * SECOND))
    assert buffer.lookup("map", "base", 10 * SECOND)[0].x == pytest.approx(10)


def test_a_frame_that_never_moves_is_known_at_all_times(buffer):
    buffer.add("map", "dock", 5 * SECOND, shifted(1), is_static=True)
    for stamp in (None, 0, 5 * SECOND, 10**19):
        assert buffer.lookup("map", "dock", stamp)[0] == shifted(1)


def test_once_the_clock_was_set_back_only_frames_that_never_move_are_known(buffer):
    buffer.add("map", "dock", 500 * SECOND, shifted(1), is_static=True)
    buffer.add("map", "base", 500 * SECOND, shifted(5), is_static=False)
    buffer.forget_moving()
    assert buffer.lookup("map", "dock")[0] == shifted(1)
    with pytest.raises(TransformUnknown, match="there is no frame 'base' yet"):
        buffer.lookup("map", "base")
    buffer.add("map", "base", SECOND, shifted(2), is_static=False)
    assert buffer.lookup("map", "base") == (shifted(2), SECOND)


def test_a_frame_that_gets_another_parent_is_known_there_alone(buffer):
    buffer.add("map", "base", SECOND, shifted(1), is_static=False)
    buffer.add("odom", "base", 2 * SECOND, shifted(2), is_static=False)
    assert buffer.lookup("odom", "base")[0] == shifted(2)
    with pytest.raises(TransformUnknown):
        buffer.lookup("map", "base")


@pytest.mark.parametrize(("target", "source", "words"), [
    ("map", "nowhere", "there is no frame 'nowhere' yet"), ("nowhere", "base", "there is no frame 'nowhere' yet"),
    ("map", "moon", "no transforms join 'moon' and 'map'")])
def test_what_is_missing_is_named(buffer, target, source, words):
    buffer.add("map", "base", SECOND, shifted(1), is_static=False)
    buffer.add("space", "moon", SECOND, shifted(1), is_static=False)
    with pytest.raises(TransformUnknown, match=words) as unknown:
        buffer.lookup(target, source)
    assert not unknown.value.is_final


def test_of_a_long_name_the_middle_is_left_out(buffer):
    buffer.add("map", "base", SECOND, shifted(1), is_static=False)
    with pytest.raises(TransformUnknown) as unknown:
        buffer.lookup("map", "x" * 1000)
    assert len(str(unknown.value)) < 300


def test_frames_that_go_round_in_a_circle_are_refused_and_end(buffer):
    buffer.add("a", "b", SECOND, shifted(1), is_static=False)
    buffer.add("b", "a", SECOND, shifted(1), is_static=False)
    with pytest.raises(TransformUnknown, match="its own ancestor") as unknown:
        buffer.lookup("a", "b")
    assert "in a circle" in unknown.value.remedy
