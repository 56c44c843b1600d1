"""Files that commands read: text and JSON, refused in one line where they are none."""

import math
import os
import re
import stat
from typing import Any

import yaml

from dubins_rrt_ros.planning.maps.json import RepeatedKey, load_unique
from dubins_rrt_ros.planning.maps.yaml import RepeatedKey as RepeatedKeyOfYaml
from dubins_rrt_ros.planning.maps.yaml import load_plain
from dubins_rrt_ros.planning.option import plain_float
from dubins_rrt_ros.planning.text import one_line, quoted

from .parser import UsageError

#: The header of poses as CSV.
CSV_HEADER = ("x", "y", "theta")
#: Maximum length of what is read from a pipe or device [bytes], which may have no end.
MAX_STREAM_BYTES = 64 * 2**20
#: What `ros2 topic echo` prints in place of the poses that it leaves out.
LEFT_OUT = "..."
#: What is said of a file of poses without any.
NO_POSES = "holds a path without poses, as that of a planner that found none; there is nothing to judge"
#: Minimum norm of a quaternion that is a rotation, and of the part of its x axis that lies in the plane.
LEAST_NORM, LEAST_IN_PLANE = 1e-3, math.sin(math.radians(1))


def read_json(file: str) -> Any:
    """Read a JSON file.

    Raises:
        UsageError: it cannot be read, is no JSON, or has an object with a key twice.
    """
    try:
        return load_unique(read_text(file))
    except RepeatedKey as error:
        raise UsageError(f"{file}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{file} is no JSON file: {error}") from error


def read_poses_or_json(file: str) -> Any:
    """Read a JSON file; or [[x, y, yaw], ...] from the CSV of `plan --csv`, or from the YAML in which a nav_msgs/Path is echoed.

    Raises:
        UsageError: it cannot be read, is none of these, has an object with a key twice, or a pose that is none.
    """
    text = read_text(file)
    try:
        return load_unique(text)
    except RepeatedKey as error:
        raise UsageError(f"{file}: {error}") from error
    except (ValueError, RecursionError) as error:
        poses = _poses_in(file, text)
        if not poses:
            raise UsageError(f"{file} is no JSON file: {error}; nor is it CSV with the header {','.join(CSV_HEADER)}, nor an "
                             "echoed nav_msgs/Path") from error
        return poses


def _poses_in(file: str, text: str) -> list[list[float]]:
    """Return the poses of a CSV or an echoed message; none where the text is neither.

    Raises:
        UsageError: it is one of them, and a pose in it is none.
    """
    try:
        return _csv_poses(text) or _echoed_poses(text)
    except _NoPose as error:
        raise UsageError(one_line(f"{file}: {error}")) from None


class _NoPose(ValueError):
    """A row or a message that is no pose; its text says where it is and what to do."""


def _csv_poses(text: str) -> list[list[float]]:
    lines = [(number, line) for number, line in enumerate(text.split("\n"), 1) if line.strip()]
    rows = [(number, [word.strip() for word in line.split(",")]) for number, line in lines]
    if not rows or tuple(rows[0][1][:3]) != CSV_HEADER:
        return []
    if not rows[1:]:
        raise _NoPose(NO_POSES)
    return [_csv_pose(number, row[:3]) for number, row in rows[1:]]


def _csv_pose(number: int, row: list[str]) -> list[float]:
    try:
        x, y, yaw = map(plain_float, row)
    except ValueError:
        raise _NoPose(f"line {number} is {quoted(','.join(row))}; give three numbers, {','.join(CSV_HEADER)}") from None
    return [x, y, yaw]


def _echoed_poses(text: str) -> list[list[float]]:
    first, *others = re.split(r"^---[ \t]*\n", text.removeprefix("---\n") + "\n", flags=re.MULTILINE)
    try:
        document = load_plain(first, aliases=False, unique_keys=True)
        poses = document["poses"]
        listed = isinstance(poses, list)
    except RepeatedKeyOfYaml as error:
        raise _NoPose(f"{error}; give it once") from None
    except (yaml.YAMLError, RecursionError, OverflowError, ValueError, TypeError, LookupError):
        return []
    if not listed:
        return []
    if more := sum(bool(other.strip()) for other in others):
        raise _NoPose(f"holds {more + 1} messages; give one, as `ros2 topic echo --once` writes it")
    if not poses:
        raise _NoPose(NO_POSES)
    return [_planar(number, pose) for number, pose in enumerate(poses)]


def _planar(number: int, stamped: Any) -> list[float]:
    """Return x, y and the yaw, the direction of the x axis in the plane, of an echoed geometry_msgs/PoseStamped."""
    if stamped == LEFT_OUT:
        raise _NoPose(f"the poses from {number} on are left out; echo the message with --full-length")
    try:
        position, orientation = stamped["pose"]["position"], stamped["pose"]["orientation"]
        px, py = (plain_float(position[name]) for name in "xy")
        x, y, z, w = (plain_float(orientation[name]) for name in "xyzw")
    except (ValueError, TypeError, LookupError):
        raise _NoPose(f"pose {number} is {quoted(stamped)}; give a geometry_msgs/PoseStamped of finite numbers") from None
    if (yaw := _yaw(x, y, z, w)) is None:
        raise _NoPose(f"pose {number} has the quaternion x {x:g}, y {y:g}, z {z:g}, w {w:g}, from which no yaw follows; "
                      "give a rotation about z (no rotation is w 1)")
    return [px, py, yaw]


def _yaw(*quaternion: float) -> float | None:
    """Return the yaw of a quaternion x, y, z, w; None where it is no rotation, or one that sets the x axis upright."""
    norm = math.hypot(*quaternion)
    if not LEAST_NORM <= norm < math.inf:  # written so that NaN is refused too
        return None
    x, y, z, w = (component / norm for component in quaternion)
    along, across = w * w + x * x - y * y - z * z, 2 * (w * z + x * y)
    return math.atan2(across, along) if math.hypot(along, across) >= LEAST_IN_PLANE else None


def read_text(file: str) -> str:
    """Read a text file.

    Raises:
        UsageError: it cannot be read, is no text, or is a pipe or device that gives nothing, or too much.
    """
    if not file:
        raise UsageError("the name of a file to read is empty; give one")
    try:
        with open(file, encoding="utf-8-sig", opener=_open_at_once) as opened:
            text = opened.read(-1 if stat.S_ISREG(os.fstat(opened.fileno()).st_mode) else MAX_STREAM_BYTES + 1)
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{file} is no text file: {error}") from error
    if len(text) > MAX_STREAM_BYTES and not os.path.isfile(file):
        raise UsageError(f"{file} is a pipe or device that gives more than {MAX_STREAM_BYTES} bytes; name a regular file")
    return text


def _open_at_once(file: str, flags: int) -> int:
    """Open a file; a pipe that nobody writes to is empty, and not waited for."""
    descriptor = os.open(file, flags | os.O_NONBLOCK)
    os.set_blocking(descriptor, True)
    return descriptor
