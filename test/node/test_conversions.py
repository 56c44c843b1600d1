"""Messages to the library's types and back, through the wire format."""

import array
import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

import shapely
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped, Quaternion, Transform, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from scipy.spatial.transform import Rotation

from dubins_rrt_ros.node.conversions import (
    RASTER_CELLS,
    as_grid,
    bare_pose,
    doubts_about,
    grid_from,
    grid_message,
    path_message,
    path_poses,
    pose_from,
    pose_message,
    rigid_from,
    status_message,
    transformed,
)
from dubins_rrt_ros.planning import GridMap, InvalidPose, MapError, PolygonMap, Status

STAMP = Time(sec=12, nanosec=34)
NAN, INF = math.nan, math.inf


def stamped(x=1.0, y=2.0, z=0.0, q=(0.0, 0.0, 0.0, 1.0)):
    pose = PoseMessage(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=q[0], y=q[1], z=q[2], w=q[3]))
    return PoseStamped(pose=pose)


@pytest.mark.parametrize("yaw", [0.0, 1e-12, 0.5, -0.5, math.pi / 2, -3.0, 3.14159, math.pi])
def test_a_pose_survives_the_way_there_and_back(over_the_wire, yaw):
    message = over_the_wire(PoseStamped(pose=pose_message((-3.25, 7.125, yaw))))
    x, y, back = pose_from("start", message)
    assert (x, y) == (-3.25, 7.125)
    assert back == pytest.approx(yaw, abs=1e-15)


@pytest.mark.parametrize(("yaw", "wrapped"), [
    (2 * math.pi, 0.0), (1.5 * math.pi, -math.pi / 2), (-7.0, 2 * math.pi - 7.0),
])
def test_a_yaw_outside_pi_is_wrapped(yaw, wrapped):
    message = pose_message((0.0, 0.0, yaw))
    assert message.orientation.w >= 0
    assert pose_from("start", PoseStamped(pose=message))[2] == pytest.approx(wrapped, abs=1e-14)


def test_a_quaternion_and_its_negative_are_one_pose():
    half = 0.4
    for sign in (1, -1):
        q = (0.0, 0.0, sign * math.sin(half), sign * math.cos(half))
        assert pose_from("goal", stamped(q=q))[2] == pytest.approx(0.8, abs=1e-15)


def test_a_pose_with_covariance_is_a_pose(over_the_wire):
    message = PoseWithCovarianceStamped()
    message.pose.pose = pose_message((1.0, 2.0, 0.5))
    assert pose_from("start", over_the_wire(message)) == pytest.approx((1.0, 2.0, 0.5), abs=1e-15)


def test_the_bare_pose_is_the_one_in_every_kind_of_message(over_the_wire):
    pose = stamped(x=3.0, q=(0.0, 0.0, 0.6, 0.8)).pose
    with_covariance = PoseWithCovarianceStamped()
    with_covariance.pose.pose = pose
    for message in (pose, PoseStamped(pose=pose), with_covariance):
        assert bare_pose(over_the_wire(message)) == pose


def quaternion(rotation):
    x, y, z, w = rotation.as_quat().tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def numbers(message, axes):
    return [getattr(message, axis) for axis in axes]


@pytest.mark.parametrize("seed", range(20))
def test_a_transformed_pose_is_rotated_then_translated(over_the_wire, seed):
    draw = np.random.default_rng(seed)
    turn, facing = (Rotation.from_quat(draw.normal(size=4)) for _ in range(2))
    at, by = draw.normal(scale=100.0, size=(2, 3))
    transform = Transform(translation=Vector3(**dict(zip("xyz", by.tolist(), strict=True))), rotation=quaternion(turn))
    pose = PoseMessage(position=Point(**dict(zip("xyz", at.tolist(), strict=True))), orientation=quaternion(facing))
    there = over_the_wire(transformed(over_the_wire(pose), rigid_from(over_the_wire(transform))))
    assert numbers(there.position, "xyz") == pytest.approx(turn.apply(at) + by, abs=1e-11)
    found = Rotation.from_quat(numbers(there.orientation, "xyzw"))
    assert (found * (turn * facing).inv()).magnitude() < 1e-14


def test_a_pose_is_not_changed_by_no_transform():
    pose = stamped(x=3.0, y=-4.0, z=5.0, q=(0.0, 0.0, 0.6, 0.8)).pose
    assert transformed(pose, rigid_from(Transform())) == pose


def test_a_transform_in_the_plane_adds_its_yaw():
    transform = Transform(translation=Vector3(x=1.0, y=2.0, z=0.0), rotation=quaternion(Rotation.from_euler("z", math.pi / 2)))
    there = transformed(pose_message((3.0, 0.5, 2.0)), rigid_from(transform))
    assert pose_from("goal", there) == pytest.approx((0.5, 5.0, 2.0 + math.pi / 2 - 2 * math.pi), abs=1e-12)


def test_what_is_wrong_with_a_pose_is_still_wrong_in_another_frame():
    transform = Transform(rotation=quaternion(Rotation.from_euler("z", 0.5)))
    for message, reason in ((stamped(x=NAN), "finite"), (stamped(q=(0.0, 0.0, 0.0, 9e-4)), "norm is 0.0009"),
                            (stamped(q=(0.0, 0.5**0.5, 0.0, 0.5**0.5)), "x axis is vertical")):
        with pytest.raises(InvalidPose, match=reason):
            pose_from("goal", transformed(message.pose, rigid_from(transform)))


@pytest.mark.parametrize("scale", [0.5, 0.99, 2.0, 1e-2, 1e100])
@pytest.mark.parametrize("seed", range(10))
def test_the_yaw_is_the_direction_of_the_x_axis_in_the_plane(seed, scale):
    rotation = Rotation.from_quat(np.random.default_rng(seed).normal(size=4))
    x, y, _ = rotation.apply((1.0, 0.0, 0.0))
    q = (scale * rotation.as_quat()).tolist()
    assert pose_from("start", stamped(q=q, z=4.0)) == (1.0, 2.0, pytest.approx(math.atan2(y, x), abs=1e-14))


def test_the_yaw_of_a_pose_that_leans_is_taken_after_a_transform_too():
    transform = Transform(rotation=quaternion(Rotation.from_euler("xyz", (0.3, -0.2, 1.0))))
    pose = PoseMessage(orientation=quaternion(Rotation.from_euler("zyx", (0.5, 0.1, 0.2))))
    x, y, _ = (Rotation.from_euler("xyz", (0.3, -0.2, 1.0)) * Rotation.from_euler("zyx", (0.5, 0.1, 0.2))).apply((1, 0, 0))
    assert pose_from("goal", transformed(pose, rigid_from(transform)))[2] == pytest.approx(math.atan2(y, x), abs=1e-14)


@pytest.mark.parametrize(("degrees", "taken"), [(0.5, True), (89.0 - 1e-6, True), (89.0 + 1e-6, False), (90.0, False)])
def test_an_x_axis_is_vertical_within_a_degree(degrees, taken):
    message = PoseMessage(orientation=quaternion(Rotation.from_euler("y", degrees, degrees=True)))
    if taken:
        assert pose_from("start", message)[2] == pytest.approx(0.0, abs=1e-12)
    else:
        with pytest.raises(InvalidPose, match="vertical to within 1 degree"):
            pose_from("start", message)


@pytest.mark.parametrize(("q", "kinds"), [
    ((0.0, 0.0, 0.707, 0.707), []), ((0.0, 0.0, 0.7, 0.7), []), ((0.0, 0.0, 0.0, 1.09), []), ((0.0, 0.0, 0.0, 0.89), ["norm"]),
    ((math.sin(0.08), 0.0, 0.0, math.cos(0.08)), []), ((math.sin(0.09), 0.0, 0.0, math.cos(0.09)), ["tilt"]),
    ((2.0, 0.0, 0.0, 0.0), ["norm", "tilt"]),
])
def test_what_is_unusual_about_a_rotation_that_is_taken_is_said(q, kinds):
    doubts = doubts_about("start", stamped(q=q).pose)
    assert list(doubts) == kinds
    assert all(doubt.startswith("The start pose ") for doubt in doubts.values())


@pytest.mark.parametrize(("message", "reason"), [
    (stamped(x=NAN), "finite"),
    (stamped(y=INF), "finite"),
    (stamped(z=-INF), "finite"),
    (stamped(q=(0.0, 0.0, 0.0, 0.0)), "norm is 0"),
    (stamped(q=(0.0, 0.0, 0.0, 9.9e-4)), "norm is 0.00099"),
    (stamped(q=(0.0, 0.0, NAN, 1.0)), "norm is nan"),
    (stamped(q=(0.0, 0.0, INF, 1.0)), "norm is inf"),
    (stamped(q=(0.0, 0.5**0.5, 0.0, 0.5**0.5)), "x axis is vertical"),
])
def test_a_pose_that_is_none_is_refused_with_its_name_and_the_reason(message, reason):
    with pytest.raises(InvalidPose, match=reason) as refusal:
        pose_from("goal", message)
    assert str(refusal.value).startswith("The goal pose ")
    with pytest.raises(InvalidPose, match=reason) as refusal:
        path_poses(PathMessage(poses=[stamped(), message]))
    assert str(refusal.value).startswith("The path's index 1 pose ")


def test_a_path_message_has_all_poses_in_the_frame(over_the_wire):
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.75], [2.0, -1.0, -3.0]])
    message = over_the_wire(path_message(poses, "map", STAMP))
    assert {(h.frame_id, h.stamp.sec, h.stamp.nanosec) for h in (message.header, *(p.header for p in message.poses))} \
        == {("map", 12, 34)}
    assert np.array([pose_from("any", pose) for pose in message.poses]) == pytest.approx(poses, abs=1e-15)


@pytest.mark.parametrize("scale", [1.1e-3, 1.0, 50.0, 1e200])
@pytest.mark.parametrize("seed", range(5))
def test_the_poses_of_a_path_are_taken_as_each_alone_is(seed, scale):
    rng = np.random.default_rng(seed)
    rotations = Rotation.random(100, random_state=rng).as_quat() * scale
    poses = [stamped(*rng.uniform(-9, 9, 2).tolist(), q=q) for q in rotations.tolist()]
    expected = np.array([pose_from("goal", pose) for pose in poses])
    assert path_poses(PathMessage(poses=poses)) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("nothing", [(), np.empty((0, 3))])
def test_no_path_is_an_empty_path_with_its_header(over_the_wire, nothing):
    message = over_the_wire(path_message(nothing, "map", STAMP))
    assert isinstance(message, PathMessage)
    assert (message.header.frame_id, message.header.stamp, message.poses) == ("map", STAMP, [])


@pytest.mark.parametrize("resolution", [0.05, 0.1, 0.3, 1.0, 0.025])
def test_a_grid_survives_the_way_there_and_back(over_the_wire, resolution):
    cells = np.array([[-1, 0, 100], [25, 65, 50]], dtype=np.int8)
    grid = GridMap(cells, resolution, (-1.5, 2.0, 0.7))
    back = grid_from(over_the_wire(grid_message(grid, "map", STAMP)), "map", 6)
    assert (back.data == cells).all()
    assert back.resolution == resolution
    assert back.origin == pytest.approx(grid.origin, abs=1e-15)


def test_a_grid_message_says_where_and_when(over_the_wire):
    message = over_the_wire(grid_message(GridMap(np.zeros((2, 3), dtype=np.int8), 0.5), "world", STAMP))
    assert (message.header.frame_id, message.header.stamp, message.info.map_load_time) == ("world", STAMP, STAMP)
    assert (message.info.width, message.info.height, message.info.resolution) == (3, 2, 0.5)


def test_a_map_is_the_same_by_file_and_by_topic(over_the_wire):
    grid = GridMap(np.zeros((4, 4), dtype=np.int8), 0.05, (-1.0, -2.0, 0.0))
    assert grid_from(over_the_wire(grid_message(grid, "map", STAMP)), "map", 16).id == grid.id


def test_the_cells_of_a_message_are_always_percent(over_the_wire):
    message = occupancy()
    message.data = array.array("b", [0, 1, -1, 1])
    assert grid_from(over_the_wire(message), "map", 4).data.tolist() == [[0, 1], [-1, 1]]


def occupancy(width=2, height=2, resolution=0.1, values=4, frame="map", q=(0.0, 0.0, 0.0, 1.0), x=0.0):
    message = OccupancyGrid(data=array.array("b", [0] * values))
    message.header.frame_id = frame
    message.info.width, message.info.height, message.info.resolution = width, height, resolution
    message.info.origin = stamped(x=x, q=q).pose
    return message


@pytest.mark.parametrize(("message", "reason"), [
    (occupancy(values=3), "has 3 values for 2 x 2 cells"),
    (occupancy(values=5), "has 5 values for 2 x 2 cells"),
    (occupancy(width=0, values=0), "has 0 values for 0 x 2 cells"),
    (occupancy(width=0, height=0, values=0), "at least one"),
    (occupancy(resolution=0.0), "resolution is 0.0"),
    (occupancy(resolution=-0.5), "resolution is -0.5"),
    (occupancy(resolution=NAN), "resolution is nan"),
    (occupancy(x=NAN), "origin is"),
    (occupancy(q=(0.0, 0.0, 0.0, 0.0)), "no rotation"),
    (occupancy(q=(1.0, 0.0, 0.0, 0.0)), "leans"),
    (occupancy(frame="odom"), "in frame 'odom', not in 'map'"),
    (occupancy(width=4_000_000_000, height=4_000_000_000), "raise max_map_cells"),
    (occupancy(width=3, height=2, values=6), r"more than max_map_cells \(4\)"),
])
def test_a_map_that_cannot_be_used_is_refused_with_the_reason(message, reason):
    with pytest.raises(MapError, match=reason):
        grid_from(message, "map", 4)


def test_a_map_without_a_frame_is_in_the_global_one():
    assert grid_from(occupancy(frame=""), "map", 4).data.shape == (2, 2)


def test_a_grid_is_published_as_it_is():
    grid = GridMap(np.zeros((1, 1), dtype=np.int8), 1.0)
    assert as_grid(grid) is grid


def test_a_polygon_map_is_published_as_a_fine_grid():
    grid = as_grid(PolygonMap(shapely.box(0, 0, 2, 1)))
    assert grid.resolution == 0.05
    assert (grid.data == 0).sum() == 40 * 20


def test_a_large_polygon_map_is_published_coarser():
    coarse = as_grid(PolygonMap(shapely.box(0, 0, 1e5, 1e4)))
    assert 0.9 * RASTER_CELLS < coarse.data.size < 1.1 * RASTER_CELLS


@pytest.mark.parametrize("size", [(9e7, 1.0), (0.002, 9e7)])
def test_a_long_and_thin_polygon_map_is_published_with_no_more_cells(size):
    assert as_grid(PolygonMap(shapely.box(0, 0, *size))).data.size <= 2 * RASTER_CELLS


KEYS = ["plan_id", "revision", "error_code", "error_name", "request", "found_by", "planner", "samples", "tree_nodes",
        "path_length", "length",
        "lower_bound", "gap", "cost", "cost_lower_bound", "cost_gap", "roomy_share",
        "time_to_first", "time_to_found", "planning_time",
        "min_clearance", "max_curvature", "audit",
        "seed", "map_id", "stamp"]


def values(message):
    return {item.key: item.value for item in message.values}


def test_the_status_of_a_path_has_all_its_figures(over_the_wire, plans):
    plan = plans["solved"]
    message = over_the_wire(status_message("/ns/planner", plan.status, plan.message, plan=plan, plan_id=7, revision=3,
                                           map_id=plan.problem.map.id))
    told = values(message)
    assert (message.name, message.level, message.message) == ("/ns/planner: planner", DiagnosticStatus.OK, plan.message)
    assert list(told) == KEYS
    assert (told["plan_id"], told["revision"], told["error_code"], told["error_name"]) == ("7", "3", "0", "NONE")
    assert (told["planner"], told["audit"], told["seed"]) == ("rrt_star", "ok", "1")
    assert told["map_id"] == plan.problem.map.id
    assert (int(told["samples"]), int(told["tree_nodes"])) == (plan.samples, len(plan.tree.poses))
    for key, figure in {"path_length": plan.length, "length": plan.length, "lower_bound": plan.lower_bound, "gap": plan.gap,
                        "cost": plan.cost,
                        "cost_lower_bound": plan.cost_lower_bound, "cost_gap": plan.cost_gap,
                        "time_to_first": plan.time_to_first, "time_to_found": plan.time_to_found,
                        "planning_time": plan.planning_time,
                        "min_clearance": plan.min_clearance, "max_curvature": plan.max_curvature}.items():
        assert float(told[key]) == figure, key
    assert told["roomy_share"] == "", "no clearance is preferred"


def test_the_status_of_a_failure_has_all_keys_and_is_an_error(over_the_wire, plans):
    plan = plans["blocked"]
    message = over_the_wire(status_message("/planner", plan.status, plan.message, plan=plan, plan_id=1, revision=1))
    told = values(message)
    assert message.level == DiagnosticStatus.ERROR
    assert list(told) == KEYS
    assert (told["error_code"], told["error_name"]) == ("206", "GOAL_OCCUPIED")
    assert (told["path_length"], told["gap"]) == ("", "")


@pytest.mark.parametrize(("status", "level"), [
    (Status.NONE, DiagnosticStatus.OK), (Status.UNKNOWN, DiagnosticStatus.ERROR),
    (Status.TF_ERROR, DiagnosticStatus.ERROR), (Status.TIMEOUT, DiagnosticStatus.ERROR),
    (Status.NO_VALID_PATH, DiagnosticStatus.ERROR),
    (Status.NO_MAP, DiagnosticStatus.STALE), (Status.NO_START, DiagnosticStatus.ERROR),
    (Status.INVALID_POSE, DiagnosticStatus.ERROR), (Status.CANCELLED, DiagnosticStatus.WARN),
])
def test_the_level_follows_from_the_status(over_the_wire, status, level):
    message = over_the_wire(status_message("/planner", status, "A sentence.", plan_id=1))
    assert message.level == level
    assert list(values(message)) == KEYS
    assert values(message)["error_name"] == status.name


def test_a_start_that_no_goal_waits_for_is_no_error(over_the_wire):
    assert over_the_wire(status_message("/planner", Status.NO_START, "A sentence.")).level == DiagnosticStatus.WARN


def test_an_approximate_or_cancelled_path_is_a_warning(plans):
    from dataclasses import replace

    plan = plans["solved"]
    cancelled = replace(plan, cancelled=True)
    waypoints = np.vstack([plan.path.waypoints[:-1], (8.4, 5.0, 0.5)])
    approximate = replace(plan, problem=replace(plan.problem, goal_tolerance_xy=0.2),
                          path=replace(plan.path, waypoints=waypoints))
    any_heading = replace(approximate, problem=replace(plan.problem, any_goal_heading=True),
                          path=replace(plan.path, waypoints=np.vstack([plan.path.waypoints[:-1], (8.5, 5.0, 1.7)])))
    assert status_message("/planner", Status.NONE, "", plan=any_heading).level == DiagnosticStatus.OK
    for doubtful in (cancelled, approximate):
        assert status_message("/planner", Status.NONE, "", plan=doubtful).level == DiagnosticStatus.WARN
