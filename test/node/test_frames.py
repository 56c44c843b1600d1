"""Poses in other frames than the global one, through the executable: with tf2_ros, and without."""

import importlib.util
import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.srv import GetPlan
from support.harness import poses_of, values_of
from support.yard import GOAL, QUICK, START

from dubins_rrt_ros.node.conversions import pose_message
from dubins_rrt_ros.planning import GridMap, save_map

HAS_TF = any(importlib.util.find_spec(name) for name in ("tf2_ros", "tf2_msgs"))
without_tf2 = pytest.mark.skipif(HAS_TF, reason="tf2_ros or tf2_msgs is installed")


def stamped(pose, frame):
    message = PoseStamped(pose=pose_message(pose))
    message.header.frame_id = frame
    return message


@pytest.fixture(scope="module")
def planner(module_planners, tmp_path_factory):
    """A client of a planner whose global frame is `world`, on a free map."""
    file = tmp_path_factory.mktemp("maps") / "free.yaml"
    save_map(GridMap(np.zeros((100, 100), dtype=np.int8), 0.1), file)
    module_planners.start(map_file=str(file), global_frame="world", **QUICK)
    return module_planners.client()


def tf_error(planner, request):
    """The status of a request of this kind that is about a transform."""
    wanted = {"error_name": "TF_ERROR", "request": request}
    return planner.wait_for(lambda: next((status for status in planner.statuses if wanted.items() <= values_of(status).items()),
                                         None), f"a status with {wanted}")


def assert_says_what_to_do(status):
    told = values_of(status)
    assert (status.level, told["error_code"], told["error_name"]) == (DiagnosticStatus.ERROR, "202", "TF_ERROR")
    for word in ("'odom'", "'world'", "tf2_ros", "ros-jazzy-tf2-ros"):
        assert word in status.message


@without_tf2
@pytest.mark.parametrize(("topic", "name"), [("start_pose", "start"), ("initialpose", "start"), ("goal_pose", "goal")])
def test_without_tf2_a_pose_in_another_frame_is_refused_with_both_names_and_what_to_install(planner, topic, name):
    planner.send("start_pose", START, frame="world")
    planner.statuses.clear()
    planner.send(topic, GOAL, frame="odom")
    status = tf_error(planner, "goal" if name == "goal" else "")
    assert_says_what_to_do(status)
    assert f"The {name} pose" in status.message
    assert (values_of(status)["plan_id"] == "0") == (name == "start")


@without_tf2
@pytest.mark.parametrize("foreign", ["start", "goal"])
def test_without_tf2_get_plan_refuses_a_pose_in_another_frame_likewise(planner, foreign):
    poses = {"start": stamped(START, "world"), "goal": stamped(GOAL, "world")}
    poses[foreign].header.frame_id = "odom"
    planner.statuses.clear()
    path = planner.call(GetPlan, "get_plan", **poses).plan
    assert (path.header.frame_id, path.poses) == ("world", [])
    status = tf_error(planner, "get_plan")
    assert_says_what_to_do(status)
    assert f"The {foreign} pose" in status.message


def test_poses_in_the_global_frame_and_without_a_frame_need_no_transform(planner):
    path = planner.call(GetPlan, "get_plan", start=stamped(START, "world"), goal=stamped(GOAL, "")).plan
    assert {pose.header.frame_id for pose in path.poses} == {path.header.frame_id} == {"world"}
    assert poses_of(path)[-1] == pytest.approx(GOAL, abs=1e-9)


def test_with_tf2_a_pose_in_another_frame_is_planned_to_in_the_global_one(planner):
    tf2_ros = pytest.importorskip("tf2_ros", reason="tf2_ros is not installed")
    # All nodes of a domain share /tf_static, whatever their namespace: hence a name that is nobody else's.
    frame = f"odom_of_{planner.node.get_namespace().strip('/')}"
    broadcaster = tf2_ros.StaticTransformBroadcaster(planner.node)
    transform = TransformStamped()
    transform.header.frame_id, transform.child_frame_id = "world", frame
    transform.transform.translation.x, transform.transform.translation.y = 8.5, 2.0
    transform.transform.rotation = pose_message((0.0, 0.0, math.pi / 2)).orientation
    broadcaster.sendTransform(transform)
    goal = stamped((3.0, 0.0, 0.5 - math.pi / 2), frame)  # which is GOAL in the global frame

    def planned():
        path = planner.call(GetPlan, "get_plan", start=stamped(START, "world"), goal=goal).plan
        return path if path.poses else None

    path = planner.wait_for(planned, "the transform to be known")
    assert {pose.header.frame_id for pose in path.poses} == {path.header.frame_id} == {"world"}
    assert poses_of(path)[-1] == pytest.approx(GOAL, abs=1e-9)

    plan_id = planner.next_id
    planner.send("start_pose", START, frame="world")
    planner.send("goal_pose", goal.pose, frame=frame)
    assert planner.status_of(plan_id, samples="300")["error_name"] == "NONE"
    path = planner.wait_for(lambda: planner.paths and planner.paths[-1], "the path of the topic")
    assert poses_of(path)[-1] == pytest.approx(GOAL, abs=1e-9)


def test_with_tf2_a_transform_that_nobody_publishes_is_told(planner):
    pytest.importorskip("tf2_ros", reason="tf2_ros is not installed")
    plan_id = planner.next_id
    path = planner.call(GetPlan, "get_plan", start=stamped(START, "world"), goal=stamped(GOAL, "nowhere")).plan
    assert path.poses == []
    told = planner.status_of(plan_id)
    assert (told["level"], told["error_name"]) == (DiagnosticStatus.ERROR, "TF_ERROR")
    assert "'nowhere'" in told["message"] and "'world'" in told["message"]
    assert "publish" in told["message"]
