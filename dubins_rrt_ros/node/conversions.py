"""Pure functions from messages to the library's types and back."""

import array
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped, Quaternion, Transform
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from std_msgs.msg import Header

from dubins_rrt_ros.planning import (
    OCCUPIED,
    UNKNOWN,
    GridMap,
    InvalidPose,
    MapError,
    Plan,
    PolygonMap,
    Status,
    Thresholds,
    rasterise,
)
from dubins_rrt_ros.planning.maps.model import DEFAULT_THRESHOLDS
from dubins_rrt_ros.planning.problem import Pose
from dubins_rrt_ros.planning.text import one_line, quoted_name

from .rigid import Rigid, Rotation

#: Minimum norm of a quaternion that is taken, and the deviation from 1 beyond which it is doubtful.
LEAST_NORM, DOUBTFUL_NORM = 1e-3, 0.1
#: Minimum angle between a pose's x axis and the vertical [rad]: nearer it has no heading in the plane.
LEAST_ANGLE_TO_VERTICAL = math.radians(1)
#: Maximum difference between two poses that count as equal [m, and of a quaternion's components].
EQUAL_POSES = 1e-6
#: Angle between a pose's z axis and the vertical beyond which it is doubtful [rad].
DOUBTFUL_TILT = math.radians(10)
#: Maximum angle between the z axis of a map and the vertical [rad]: further, distances would be wrong.
MAP_TILT = 0.01
#: Minimum size of the cells of a polygon map that is published as a grid, for display [m].
RASTER_RESOLUTION = 0.05
#: Maximum number of those cells: they take a second with simple polygons, and five with thousands of round ones.
RASTER_CELLS = 200_000


def bare_pose(message: PoseMessage | PoseStamped | PoseWithCovarianceStamped) -> PoseMessage:
    """Return the pose in a message, without its header."""
    while not isinstance(message, PoseMessage):
        message = message.pose
    return message


def has_rotation(pose: PoseMessage) -> bool:
    """Return False if the quaternion is all zero, as that of a pose is to which only a position was given."""
    q = pose.orientation
    return any((q.x, q.y, q.z, q.w))


def pose_from(name: str, message: PoseMessage | PoseStamped | PoseWithCovarianceStamped) -> Pose:
    """Return the (x [m], y [m], yaw [rad]) of a pose, yaw in (-pi, pi]; its height and its tilt are ignored.

    Raises:
        InvalidPose: it is not finite, not a rotation, or its x axis is vertical; `name` is in the message.
    """
    pose = bare_pose(message)
    p = pose.position
    if not all(map(math.isfinite, (p.x, p.y, p.z))):
        raise InvalidPose(f"The {name} pose is at x {p.x}, y {p.y}, z {p.z}; give finite metres.")
    return p.x, p.y, _yaw(f"The {name} pose", pose.orientation, InvalidPose)


def doubts_about(name: str, message: PoseMessage) -> dict[str, str]:
    """Return what is unusual about the rotation of a pose that is taken nevertheless: sentences by the kind of doubt."""
    q = message.orientation
    norm, tilt = _norm(q), _tilt(q)
    doubts = {}
    if abs(norm - 1) > DOUBTFUL_NORM:
        doubts["norm"] = f"The {name} pose has a quaternion of norm {norm:.3g}, which is normalised; see what publishes it."
    if tilt > DOUBTFUL_TILT:
        doubts["tilt"] = (f"The {name} pose leans by {math.degrees(tilt):.3g} degrees; the direction of its x axis in the plane "
                          "is taken as its yaw.")
    return doubts


def are_equal(one: PoseStamped, other: PoseStamped) -> bool:
    """Return True if two poses are the same in the same frame, but for rounding."""
    numbers = [[getattr(part, axis) for part in (message.pose.position, message.pose.orientation)
                for axis in part.get_fields_and_field_types()] for message in (one, other)]
    return one.header.frame_id == other.header.frame_id and all(
        abs(a - b) <= EQUAL_POSES for a, b in zip(*numbers, strict=True))


def pose_message(pose: Pose) -> PoseMessage:
    """Return an (x, y, yaw) as a message, with w >= 0 in its quaternion."""
    message = PoseMessage()
    _fill(message, *planar_rows(np.array([pose]))[0].tolist())
    return message


def transformed(pose: PoseMessage, transform: Rigid) -> PoseMessage:
    """Return a pose in a transform's parent frame, as tf2 does: rotate, then translate."""
    p, q = pose.position, pose.orientation
    moved = transform.after(Rigid(p.x, p.y, p.z, Rotation(q.w, q.x, q.y, q.z)))
    w, i, j, k = moved.rotation
    return PoseMessage(position=Point(x=moved.x, y=moved.y, z=moved.z), orientation=Quaternion(w=w, x=i, y=j, z=k))


def nanoseconds(stamp: Time) -> int:
    """Return a time as a number [ns]."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def rigid_from(transform: Transform) -> Rigid | None:
    """Return the transform of a message, its quaternion normalised; None where it is none, as tf2 ignores it."""
    t, q = transform.translation, transform.rotation
    norm = _norm(q)
    if not all(map(math.isfinite, (t.x, t.y, t.z))) or not LEAST_NORM <= norm < math.inf:
        return None
    return Rigid(t.x, t.y, t.z, Rotation(q.w / norm, q.x / norm, q.y / norm, q.z / norm))


def poses_of(plan: Plan | None) -> np.ndarray:
    """Return the (n, 3) poses of a plan's path, (0, 3) without a plan or a path."""
    return np.empty((0, 3)) if plan is None else plan.poses()


def path_message(poses: np.ndarray, frame: str, stamp: Time) -> PathMessage:
    """Return (n, 3) poses as a path message; an empty one says that there is no path."""
    message = PathMessage(header=Header(stamp=stamp, frame_id=frame))
    for row in planar_rows(poses).tolist():
        stamped = PoseStamped()
        stamped.header = message.header
        _fill(stamped.pose, *row)
        message.poses.append(stamped)
    return message


def path_poses(message: PathMessage) -> np.ndarray:
    """Return the (n, 3) poses of a path message, as x [m], y [m] and yaw [rad]; each as `pose_from` takes it.

    Raises:
        InvalidPose: as `pose_from` does; the pose's index is in the message.
    """
    stated = [(p.position.x, p.position.y, p.position.z, p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w)
              for p in map(bare_pose, message.poses)]
    px, py, pz, x, y, z, w = np.array(stated, dtype=float).reshape(-1, 7).T
    with np.errstate(over="ignore", invalid="ignore"):
        square = w * w + x * x + y * y + z * z
        along, across = w * w + x * x - y * y - z * z, 2 * (w * z + x * y)
        level = np.hypot(along, across) >= 1.01 * math.sin(LEAST_ANGLE_TO_VERTICAL) * square
        plain = np.isfinite(px + py + pz) & (square > 1.01 * LEAST_NORM**2) & (square < math.inf) & level
        poses = np.column_stack([px, py, np.arctan2(across, along)])
    for index in np.flatnonzero(~plain).tolist():
        poses[index] = pose_from(f"path's index {index}", message.poses[index])
    return poses


def planar_rows(poses: np.ndarray) -> np.ndarray:
    """Return x, y and the quaternion's z, w of each pose, (n, 4); a message's fields take them as Python floats alone."""
    x, y, yaw = np.asarray(poses, dtype=float).reshape(-1, 3).T
    half = (yaw - 2 * math.pi * np.round(yaw / (2 * math.pi))) / 2
    return np.stack([x, y, np.sin(half), np.cos(half)], axis=1)


def _fill(message: PoseMessage, x: float, y: float, z: float, w: float) -> None:
    # Filling existing fields takes half the time of making new ones, which counts with hundreds of poses.
    message.position.x, message.position.y = x, y
    message.orientation.z, message.orientation.w = z, w


def grid_from(message: OccupancyGrid, frame: str, max_map_cells: int, thresholds: Thresholds = DEFAULT_THRESHOLDS) -> GridMap:
    """Return the map of a message.

    Args:
        message: an occupancy grid.
        frame: the global frame.
        max_map_cells: maximum number of cells.
        thresholds: which values are free, and which occupied.

    Raises:
        MapError: it is in another frame, has no cells or too many, or its fields contradict each other.
    """
    info, name = message.info, "the map message"
    if message.header.frame_id not in ("", frame):
        raise MapError(f"{name} is in frame {quoted_name(message.header.frame_id)}, not in '{frame}'; publish it in '{frame}' "
                       "or set global_frame")
    cells = info.width * info.height
    if cells > max_map_cells:
        raise MapError(f"{name} has {info.width} x {info.height} cells, more than max_map_cells ({max_map_cells}); "
                       "publish a smaller map or raise max_map_cells")
    if len(message.data) != cells or cells == 0:
        raise MapError(f"{name} has {len(message.data)} values for {info.width} x {info.height} cells; "
                       "give width times height values, at least one")
    rotation, origin = info.origin.orientation, info.origin.position
    if not math.isfinite(origin.z):
        raise MapError(f"{name}: its origin is at x {origin.x}, y {origin.y}, z {origin.z}; give finite metres")
    yaw = _yaw(f"{name}: its origin", rotation, MapError)
    if (tilt := _tilt(rotation)) > MAP_TILT:
        raise MapError(f"{name}: its origin has {_written(rotation)}, which leans by {tilt:.3g} rad; turn it about z only "
                       "(x and y 0)")
    data = np.frombuffer(message.data, dtype=np.int8).reshape(info.height, info.width)
    # The field is a float32; the decimal it stands for gives the same map as the file that was published.
    resolution = float(str(np.float32(info.resolution)))
    return GridMap(data, resolution, (origin.x, origin.y, yaw), name, percent=True, thresholds=thresholds,
                   warnings=tuple(_doubts_about_cells(data)))


def _doubts_about_cells(data: np.ndarray) -> Iterator[str]:
    """Yield what is doubtful about the cells of a message, which are percent whatever they hold."""
    least, highest = int(data.min()), int(data.max())
    if highest == 1:
        yield "The map message holds no value above 1, which stands for 1 % and is free; publish 100 for an obstacle."
    if least < UNKNOWN or highest > OCCUPIED:
        yield (f"The map message holds values from {least} to {highest}; those above 100 are taken as occupied, those below -1 "
               "as unknown; publish -1, or 0 to 100.")


def updated_grid(grid: GridMap, message: Any, frame: str) -> GridMap:
    """Return a map with the cells of a map_msgs/OccupancyGridUpdate in place of its own; the map itself where these are the same.

    Args:
        grid: the map; it stays as it is.
        message: the window that changed.
        frame: the global frame.

    Raises:
        MapError: the update is in another frame, reaches beyond the map, or its fields contradict each other.
    """
    height, width = grid.data.shape
    if message.header.frame_id not in ("", frame):
        raise MapError(f"the map update is in frame {quoted_name(message.header.frame_id)}, not in '{frame}'; publish it in "
                       f"'{frame}' or set global_frame")
    if len(message.data) != message.width * message.height:
        raise MapError(f"the map update has {len(message.data)} values for {message.width} x {message.height} cells; give width "
                       "times height values")
    if not (0 <= message.x <= width - message.width and 0 <= message.y <= height - message.height):
        raise MapError(f"the map update, {message.width} x {message.height} cells at ({message.x}, {message.y}), reaches beyond "
                       f"the map of {width} x {height} cells; give a part of the map")
    window = np.frombuffer(message.data, dtype=np.int8).reshape(message.height, message.width)
    place = np.s_[message.y:message.y + message.height, message.x:message.x + message.width]
    if np.array_equal(grid.data[place], window):
        return grid
    cells = grid.data.copy()
    cells[place] = window
    return GridMap(cells, grid.resolution, grid.origin, grid.name, percent=True, thresholds=grid.thresholds,
                   warnings=tuple(_doubts_about_cells(cells)))


def is_same_grid(one: GridMap, other: GridMap) -> bool:
    """Return True if two grids have the same cells at the same places, which are taken alike."""
    return ((one.resolution, one.origin, one.thresholds) == (other.resolution, other.origin, other.thresholds)
            and np.array_equal(one.data, other.data))


def grid_message(grid: GridMap, frame: str, stamp: Time) -> OccupancyGrid:
    """Return a grid map as a message."""
    message = OccupancyGrid(header=Header(stamp=stamp, frame_id=frame))
    message.info.map_load_time = stamp
    message.info.height, message.info.width = grid.data.shape
    message.info.resolution = grid.resolution
    message.info.origin = pose_message(grid.origin)
    # An array of bytes is taken as it is; a list of four million numbers takes 190 ms.
    message.data = array.array("b", grid.data.tobytes())
    return message


def as_grid(loaded: GridMap | PolygonMap) -> GridMap:
    """Return a map as a grid, which can be published."""
    if isinstance(loaded, GridMap):
        return loaded
    width, height = np.ptp(loaded.corners(), axis=0)
    # The last term is for long and thin maps, where the ring of cells around counts.
    return rasterise(loaded, max(RASTER_RESOLUTION, math.sqrt(width * height / RASTER_CELLS),
                                 6 * max(width, height) / RASTER_CELLS))


def duration_message(seconds: float) -> Duration:
    """Return a time that has passed as a message."""
    return Duration(sec=int(seconds), nanosec=int(seconds % 1 * 1e9))


def filled(message: Any, **fields: Any) -> Any:
    """Return a message with those of the fields filled that it has: other releases have others."""
    for name, value in fields.items():
        if hasattr(message, name):
            setattr(message, name, value)
    return message


def status_message(node: str, status: Status, message: str, *, request: str = "", plan_id: int = 0, revision: int = 0,
                   plan: Plan | None = None, map_id: str = "", stamp: Time | None = None,
                   is_warning: bool = False) -> DiagnosticStatus:
    """Return a planning event as a message, for a person and for a program.

    Args:
        node: the fully qualified name of the node.
        status: the state of the request.
        message: one sentence on it.
        request: how the request came: goal, get_plan; "" where the event belongs to none.
        plan_id, revision: number of the request and of the answer to it; 0 where the event belongs to no request.
        plan: the answer, where a planner ran; figures that do not exist stay empty.
        map_id: id of the map that it is about.
        stamp: in the header of the path that was published or answered with it, if there was one.
        is_warning: True if the level is WARN whatever the state.
    """
    values = {"plan_id": plan_id, "revision": revision, "error_code": int(status), "error_name": status.name, "request": request}
    values |= _figures(plan) | {"map_id": map_id, "stamp": None if stamp is None else f"{stamp.sec}.{stamp.nanosec:09}"}
    level = DiagnosticStatus.WARN if is_warning else _level(status, plan, plan_id)
    return DiagnosticStatus(level=level, name=f"{node}: planner", message=one_line(message),
                            values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()])


def _figures(plan: Plan | None) -> dict[str, object]:
    # The length goes by its name here and by that in files and in the library, too.
    names = ("found_by", "planner", "samples", "tree_nodes", "path_length", "length", "lower_bound", "gap", "cost",
             "cost_lower_bound", "cost_gap", "roomy_share", "time_to_first", "time_to_found", "planning_time", "min_clearance",
             "max_curvature", "audit", "seed")
    if plan is None:
        return dict.fromkeys(names)
    return dict(zip(names, (
        plan.found_by, plan.settings.planner, plan.samples, len(plan.tree.poses), plan.length, plan.length,
        plan.lower_bound, plan.gap, plan.cost, plan.cost_lower_bound, plan.cost_gap, plan.roomy_share,
        plan.time_to_first, plan.time_to_found, plan.planning_time,
        plan.min_clearance, plan.max_curvature, plan.audit, plan.settings.seed,
    ), strict=True))


def _text(value: object) -> str:
    """Return a value as text, a number with all digits, so that it reads back unchanged."""
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)


def _level(status: Status, plan: Plan | None, plan_id: int) -> bytes:
    if status is Status.NO_MAP:
        return DiagnosticStatus.STALE
    if status is Status.CANCELLED or (status is Status.NO_START and plan_id == 0):  # no goal waits for the start yet
        return DiagnosticStatus.WARN
    if status is not Status.NONE:
        return DiagnosticStatus.ERROR
    if plan is None or plan.path is None:
        return DiagnosticStatus.OK
    compared = 2 if plan.problem.any_goal_heading else 3
    approximate = not plan.problem.exact_goal and plan.path.end[:compared] != plan.problem.goal[:compared]
    return DiagnosticStatus.WARN if approximate or plan.cancelled or plan.start_too_near else DiagnosticStatus.OK


def _yaw(what: str, q: Quaternion, error: type[ValueError]) -> float:
    """Return the direction of a rotation's x axis in the plane [rad], in (-pi, pi]."""
    norm = _norm(q)
    if not LEAST_NORM <= norm < math.inf:  # written so that NaN is refused too
        raise error(f"{what} has {_written(q)}, which is no rotation: its norm is {norm:.6g}; "
                    "normalise it (no rotation is w 1).")
    if q.x == q.y == 0:  # then exact
        return math.remainder(2 * math.atan2(q.z, q.w), 2 * math.pi)
    w, x, y, z = (component / norm for component in (q.w, q.x, q.y, q.z))
    along, across = w * w + x * x - y * y - z * z, 2 * (w * z + x * y)
    if math.hypot(along, across) < math.sin(LEAST_ANGLE_TO_VERTICAL):
        raise error(f"{what} has {_written(q)}, whose x axis is vertical to within "
                    f"{math.degrees(LEAST_ANGLE_TO_VERTICAL):g} degree, so that it has no yaw; turn it about z (x and y 0).")
    return math.atan2(across, along)


def _written(q: Quaternion) -> str:
    return f"the quaternion x {q.x}, y {q.y}, z {q.z}, w {q.w}"


def _norm(q: Quaternion) -> float:
    return math.hypot(q.x, q.y, q.z, q.w)


def _tilt(q: Quaternion) -> float:
    """Return the angle between a rotation's z axis and the vertical [rad]."""
    return 2 * math.atan2(math.hypot(q.x, q.y), math.hypot(q.z, q.w))
