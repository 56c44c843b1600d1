"""Starts and goals by tf, from another process: whichever keeps the transforms, tf2_ros or our own buffer, answers alike."""

import importlib.util
import math
import time

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("tf2_msgs", reason="tf2_msgs is not here; .ci/messages builds it")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Quaternion, TransformStamped
from nav_msgs.srv import GetMap, GetPlan
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger
from support.harness import poses_of, stamped, values_of
from support.yard import GOAL, START
from tf2_msgs.msg import TFMessage

from dubins_rrt_ros.node.conversions import pose_message

pytestmark = pytest.mark.messages
QUICK = {"samples": 300, "planning_time": 2.0, "seed": 1}


class Broadcaster:
    """Publishes transforms as a robot does; names are of the client's namespace, as all nodes of a domain share /tf."""

    def __init__(self, client):
        self.client = client
        self._suffix = client.node.get_namespace().strip("/")
        self._tf = client.node.create_publisher(TFMessage, "/tf", 100)
        self._static = client.node.create_publisher(
            TFMessage, "/tf_static", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        client.wait_for(lambda: self._tf.get_subscription_count() and self._static.get_subscription_count(), "a listener")

    def name(self, frame):
        return frame if frame in ("map", "/map") else f"{frame}_{self._suffix}"

    def now(self, ago=0.0):
        return self.client.node.get_clock().now().nanoseconds - round(ago * 1e9)

    def send(self, parent, child, pose, stamp=None, static=False, roll=0.0):
        """Publish a transform: first a roll around x, then the yaw of `pose`."""
        stamp = self.now() if stamp is None else stamp
        transform = TransformStamped(child_frame_id=self.name(child))
        transform.header.frame_id, transform.header.stamp = self.name(parent), time_of(stamp)
        placed = pose_message(pose)
        transform.transform.translation.x, transform.transform.translation.y = placed.position.x, placed.position.y
        c, s, yaw = math.cos(roll / 2), math.sin(roll / 2), placed.orientation
        transform.transform.rotation = Quaternion(x=yaw.w * s, y=yaw.z * s, z=yaw.z * c, w=yaw.w * c)
        (self._static if static else self._tf).publish(TFMessage(transforms=[transform]))

    def goal(self, pose, frame, stamp=0):
        message = stamped(pose, self.name(frame))
        message.header.stamp = time_of(stamp)
        return message


def time_of(nanoseconds):
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


@pytest.fixture
def drive(planners, map_file):
    """A planner whose start is a frame, its client, and what publishes transforms."""
    def begin(**parameters):
        process = planners.start(map_file=map_file, **QUICK | parameters)
        client = planners.client()
        return client, Broadcaster(client), process
    return begin


def follow(client, tf):
    client.set_parameters(robot_base_frame=tf.name("base"))


def goal_told(client, goal, **wanted):
    plan_id = client.next_id
    client._publishers["goal_pose"].publish(goal)
    return client.status_of(plan_id, **wanted)


def test_the_start_is_the_vehicle_s_frame_at_the_moment_of_planning(drive):
    client, tf, process = drive()
    follow(client, tf)
    tf.send("map", "odom", (1.0, 2.0, math.pi / 2), static=True)
    for start, in_odom in ((START, (3.0, -0.5, -math.pi / 2)), ((1.6, 5.0, 0.0), (3.0, -0.6, -math.pi / 2))):
        tf.send("odom", "base", in_odom)
        client.call(GetMap, "get_map")
        client.paths.clear()
        goal_told(client, tf.goal(GOAL, "map"), samples="300")
        client.wait_for(lambda: client.paths, "the path")
        assert poses_of(client.paths[0])[0] == pytest.approx(start, abs=1e-9)
    assert "Waiting for a start" not in process.output.rpartition("The map is ready")[2].rpartition("Path of")[0][200:]


def test_the_slash_that_names_of_frames_had_in_ros_1_is_left_out(drive):
    client, tf, _ = drive()
    follow(client, tf)
    tf.send("/map", "/base", START)
    goal_told(client, tf.goal(GOAL, "map"), samples="300")


@pytest.mark.skipif(importlib.util.find_spec("tf2_ros") is not None, reason="tf2 itself tells then")
@pytest.mark.parametrize(("child", "x"), [("base", math.nan), ("map", 1.5)])
def test_a_transform_that_is_none_is_ignored_and_the_log_says_why(drive, child, x):
    client, tf, _ = drive()
    tf.send("map", child, (x, 5.0, 0.0))
    client.wait_for_word(f"A transform from 'map' to '{tf.name(child)}' is ignored: ")


def test_starts_by_topic_are_not_taken_then(drive):
    client, tf, _ = drive()
    follow(client, tf)
    tf.send("map", "base", START)
    client.send("start_pose", (1.5, 2.0, 0.0))
    client.wait_for_word("Starts by topic are not taken")
    goal_told(client, tf.goal(GOAL, "map"), samples="300")
    client.wait_for(lambda: client.paths, "the path")
    assert poses_of(client.paths[-1])[0] == pytest.approx(START, abs=1e-9)


def test_a_transform_that_comes_late_is_waited_for(drive):
    client, tf, _ = drive(transform_tolerance=10.0)
    follow(client, tf)
    plan_id = client.next_id
    client._publishers["goal_pose"].publish(tf.goal(GOAL, "map"))
    future = client.request(GetPlan, "get_plan", start=stamped(START), goal=tf.goal(GOAL, "odom"))
    client.call(GetMap, "get_map")
    time.sleep(0.15)
    tf.send("map", "odom", (0.0, 0.0, 0.0), static=True)
    tf.send("map", "base", START)
    assert client.status_of(plan_id, error_name="NONE")["level"] == DiagnosticStatus.OK
    assert client.response(future).plan.poses
    assert "TF_ERROR" not in {values_of(status)["error_name"] for status in client.statuses}


def test_one_that_does_not_come_is_told_and_the_goal_is_planned_when_it_comes(drive):
    client, tf, _ = drive(transform_tolerance=0.1)
    follow(client, tf)
    told = goal_told(client, tf.goal(GOAL, "map"), error_name="TF_ERROR")
    assert tf.name("base") in told["message"] and told["level"] == DiagnosticStatus.ERROR
    assert "leave robot_base_frame empty and publish start_pose" in told["message"]  # where it is set no start by topic is taken
    client.wait_for(lambda: client.statuses[-1].message.startswith("Waiting for a transform: "), "what it waits for")

    def planned():
        tf.send("map", "base", START)
        return any(values_of(status)["error_name"] == "NONE" and values_of(status)["plan_id"] == told["plan_id"]
                   for status in client.statuses)

    client.wait_for(planned, "the path")


def test_frames_that_are_not_known_at_one_time_yet_are_waited_for(drive):
    client, tf, _ = drive(transform_tolerance=0.1)
    follow(client, tf)
    tf.send("map", "odom", (0.0, 0.0, 0.0), stamp=tf.now(ago=5.0))
    tf.send("odom", "base", START)
    client.call(GetMap, "get_map")
    told = goal_told(client, tf.goal(GOAL, "map"), error_name="TF_ERROR")
    client.wait_for(lambda: client.statuses[-1].message.startswith("Waiting for a transform: "), "what it waits for")
    now = tf.now()
    for parent, child, pose in (("map", "odom", (0.0, 0.0, 0.0)), ("odom", "base", START)):
        tf.send(parent, child, pose, stamp=now)
    client.status_of(int(told["plan_id"]), error_name="NONE")


def test_a_transform_of_the_vehicle_that_is_too_old_is_an_error_with_its_age(drive):
    client, tf, _ = drive(transform_tolerance=0.1)
    follow(client, tf)
    tf.send("map", "base", START, stamp=tf.now(ago=3600))
    told = goal_told(client, tf.goal(GOAL, "map"), error_name="TF_ERROR")
    assert "3600." in told["message"] and "transform_max_age (1 s); publish it more often, raise" in told["message"]


def test_a_goal_is_transformed_at_its_stamp_and_at_the_latest_time_where_that_is_zero(drive):
    client, tf, _ = drive()
    begin = tf.now(ago=2.0)
    client.send("start_pose", START)
    for ago, x in ((0.0, 2.0), (1.0, 3.0), (1.5, 3.5)):
        tf.send("map", "base", (x, 5.0, 0.0), stamp=begin + round(ago * 1e9))
    client.call(GetMap, "get_map")
    for stamp, x in ((begin, 2.0), (begin + 500_000_000, 2.5), (begin + 1_250_000_000, 3.25), (0, 3.5)):
        client.paths.clear()
        goal_told(client, tf.goal((5.0, -3.0, 0.0), "base", stamp), samples="300")
        client.wait_for(lambda: client.paths, "the path")
        assert poses_of(client.paths[-1])[-1] == pytest.approx((x + 5.0, 2.0, 0.0), abs=1e-6)


def test_what_leans_after_its_transform_is_taken_by_its_yaw(drive):
    """A slope of 8 degrees is nothing, one of 20 is told once."""
    client, tf, process = drive()
    client.send("start_pose", START)
    client.call(GetMap, "get_map")
    for roll, told in ((math.radians(8), 0), (math.radians(20), 1), (math.radians(20), 1)):
        tf.send("map", "slope", (2.0, 2.0, 0.5), roll=roll)
        client.paths.clear()
        goal_told(client, tf.goal((6.0, 0.0, 0.0), "slope"), samples="300")
        client.wait_for(lambda: client.paths, "the path")
        expected = 2 + 6 * math.cos(0.5), 2 + 6 * math.sin(0.5), 0.5
        assert poses_of(client.paths[-1])[-1] == pytest.approx(expected, abs=1e-6)
        assert process.output.count("leans by") == told


def test_a_goal_from_before_all_transforms_is_an_error_that_is_not_waited_for(drive):
    client, tf, _ = drive()
    client.send("start_pose", START)
    tf.send("map", "base", START)
    told = goal_told(client, tf.goal(GOAL, "base", tf.now(ago=60.0)), error_name="TF_ERROR")
    client.call(Trigger, "cancel")
    assert not [status for status in client.statuses if status.message.startswith("Waiting for a transform")], told


def test_a_start_in_another_frame_waits_for_its_transform_too(drive):
    client, tf, _ = drive(transform_tolerance=10.0)
    client._publishers["start_pose"].publish(tf.goal((0.5, 0.0, 0.0), "odom"))
    client.call(GetMap, "get_map")
    tf.send("map", "odom", (1.0, 5.0, 0.0), static=True)
    goal_told(client, tf.goal(GOAL, "map"), samples="300")
    client.wait_for(lambda: client.paths, "the path")
    assert poses_of(client.paths[-1])[0] == pytest.approx((1.5, 5.0, 0.0), abs=1e-9)


def test_when_the_clock_is_set_back_what_was_heard_before_is_forgotten(drive):
    """As a simulation that begins again does."""
    client, tf, _ = drive(use_sim_time=True)
    clock = client.node.create_publisher(Clock, "/clock", 10)
    client.wait_for(clock.get_subscription_count, "the planner to hear the clock")
    follow(client, tf)
    for seconds, start in ((100, (1.5, 2.0, 0.0)), (5, START)):
        clock.publish(Clock(clock=Time(sec=seconds)))
        client.call(GetMap, "get_map")
        tf.send("map", "base", start, stamp=seconds * 10**9)
        client.call(GetMap, "get_map")
        client.paths.clear()
        goal_told(client, tf.goal(GOAL, "map"), samples="300")
        client.wait_for(lambda: client.paths, "the path")
        assert poses_of(client.paths[-1])[0] == pytest.approx(start, abs=1e-9)
        client.call(Trigger, "cancel")
