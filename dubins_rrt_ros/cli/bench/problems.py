"""The problems that `dubins_rrt bench` measures on, from its file."""

import json
import os
from collections import Counter
from collections.abc import Collection
from pathlib import Path
from typing import Any, NamedTuple

from dubins_rrt_ros.planning import InvalidPose, OptionError, Pose, Vehicle, checked_pose
from dubins_rrt_ros.planning.text import one_line, quoted

from ..common.parser import UsageError

KEYS = ("name", "map", "start", "goal", "turning_radius", "robot_radius")


class Case(NamedTuple):
    """A problem whose map is still a file.

    Attributes:
        name: no other case of the file has it.
        map: the map's file.
        vehicle: turning radius and size.
        start, goal: (x [m], y [m], theta [rad]).
    """

    name: str
    map: Path
    vehicle: Vehicle
    start: Pose
    goal: Pose


def read_cases(file: str) -> list[Case]:
    """The problems of a file; keys that are not known are ignored.

    Raises:
        UsageError: the file or one of its problems is not what it must be, or a map is not there.
    """
    entries = read_json(file)
    if not (isinstance(entries, list) and entries):
        raise UsageError(f"{file} is no list of problems; give [{{\"name\": ..., \"map\": ..., ...}}, ...]")
    cases = [_case(entry, Path(file).parent, f"{file}: problem {number}") for number, entry in enumerate(entries, 1)]
    twice = [name for name, count in Counter(case.name for case in cases).items() if count > 1]
    if twice:
        raise UsageError(one_line(f"{file}: several problems have the name {twice[0]}; give each its own"))
    return cases


def read_json(file: str) -> Any:
    """What a JSON file holds.

    Raises:
        UsageError: it cannot be read, or is no JSON.
    """
    try:
        return json.loads(read_text(file))
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{file} is no JSON file: {error}") from error


def read_text(file: str) -> str:
    """The text of a file.

    Raises:
        UsageError: it cannot be read, or is no text.
    """
    try:
        return Path(file).read_text(encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{file} is no text file: {error}") from error


def chosen(cases: list[Case], names: Collection[str]) -> list[Case]:
    """The cases of these names, in the file's order.

    Raises:
        UsageError: there is none of a name.
    """
    unknown = [name for name in names if name not in {case.name for case in cases}]
    if unknown:
        raise UsageError(f"there is no problem {unknown[0]!r}; there are {', '.join(case.name for case in cases)}")
    return [case for case in cases if case.name in names]


def _case(entry: Any, folder: Path, where: str) -> Case:
    if not isinstance(entry, dict):
        raise UsageError(f"{where} is no object; give one with {', '.join(KEYS)}")
    missing = [key for key in KEYS if key not in entry]
    if missing:
        raise UsageError(f"{where} lacks {', '.join(missing)}")
    for key in ("name", "map"):
        if not (isinstance(entry[key], str) and entry[key]):
            raise UsageError(f"{where}: its {key} is {quoted(entry[key])}; give a text")
    where, map = f"{where}, {entry['name']}", folder / entry["map"]
    if not os.path.isfile(map):  # pathlib's is_file() raises for a name that is too long
        raise UsageError(one_line(f"{where}: there is no map file {map}"))
    try:
        vehicle = Vehicle(turning_radius=entry["turning_radius"], robot_radius=entry["robot_radius"])
        return Case(entry["name"], map, vehicle, *(_pose(key, entry[key]) for key in ("start", "goal")))
    except (OptionError, InvalidPose) as error:
        raise UsageError(one_line(f"{where}: {error}")) from error


def _pose(name: str, numbers: Any) -> Pose:
    """A pose of numbers, not of texts that could be read as such."""
    if not (isinstance(numbers, list) and all(type(number) in (int, float) for number in numbers)):
        raise InvalidPose(f"The {name} pose is {quoted(numbers)}; give three numbers: [x [m], y [m], yaw [rad]].")
    return checked_pose(name, numbers)
