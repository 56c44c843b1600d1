"""Files that commands read: text and JSON, refused in one line where they are none."""

import math
from pathlib import Path
from typing import Any

import yaml

from dubins_rrt_ros.planning.maps.json import RepeatedKey, load_unique
from dubins_rrt_ros.planning.maps.yaml import load_plain

from .parser import UsageError

#: The header of poses as CSV.
CSV_HEADER = ("x", "y", "theta")


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
        UsageError: it cannot be read, is none of these, or has an object with a key twice.
    """
    text = read_text(file)
    try:
        return load_unique(text)
    except RepeatedKey as error:
        raise UsageError(f"{file}: {error}") from error
    except (ValueError, RecursionError) as error:
        poses = _csv_poses(text) or _echoed_poses(text)
        if not poses:
            raise UsageError(f"{file} is no JSON file: {error}; nor is it CSV with the header {','.join(CSV_HEADER)}, nor an "
                             "echoed nav_msgs/Path") from error
        return poses


def _csv_poses(text: str) -> list[list[float]]:
    header, *rows = [tuple(word.strip() for word in line.split(",")) for line in text.split("\n") if line.strip()] or [()]
    if header[:3] != CSV_HEADER:
        return []
    try:
        return [[float(number) for number in row[:3]] for row in rows]
    except ValueError:
        return []


def _echoed_poses(text: str) -> list[list[float]]:
    try:
        document = load_plain(text.split("\n---")[0], aliases=False)
        return [_planar(pose["pose"]) for pose in document["poses"]]
    except (yaml.YAMLError, RecursionError, OverflowError, ValueError, TypeError, LookupError):
        return []


def _planar(pose: Any) -> list[float]:
    """Return x, y and the yaw, the direction of the x axis in the plane, of a geometry_msgs/Pose."""
    x, y, z, w = (float(pose["orientation"][name]) for name in "xyzw")
    yaw = math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return [float(pose["position"]["x"]), float(pose["position"]["y"]), yaw]


def read_text(file: str) -> str:
    """Read a text file.

    Raises:
        UsageError: it cannot be read, or is no text.
    """
    try:
        return Path(file).read_text(encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{file} is no text file: {error}") from error
