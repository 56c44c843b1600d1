"""The problems of `dubins_rrt bench`, read from its file and checked before the first run."""

import os
from collections import Counter
from collections.abc import Collection
from pathlib import Path
from typing import Any, NamedTuple

from dubins_rrt_ros.planning import InvalidPose, OptionError, Pose, Vehicle, checked_pose
from dubins_rrt_ros.planning.text import one_line, quoted

from ..common.documents import read_json
from ..common.parser import UsageError

KEYS = ("name", "map", "start", "goal", "turning_radius", "robot_radius")


class Case(NamedTuple):
    """A problem whose map is not loaded yet.

    Attributes:
        name: a name that no other case of the file has.
        map: the file of the map.
        vehicle: turning radius and size.
        start, goal: (x [m], y [m], theta [rad]).
    """

    name: str
    map: Path
    vehicle: Vehicle
    start: Pose
    goal: Pose


def read_cases(file: str) -> list[Case]:
    """Read the problems of a file; unknown keys are ignored.

    Raises:
        UsageError: the file or one of its problems is malformed, or a map is missing.
    """
    entries = read_json(file)
    if not (isinstance(entries, list) and entries):
        raise UsageError(f"{file} is no list of problems; give [{{\"name\": ..., \"map\": ..., ...}}, ...]")
    cases = [_case(entry, Path(file).parent, f"{file}: problem {number}") for number, entry in enumerate(entries, 1)]
    twice = [name for name, count in Counter(case.name for case in cases).items() if count > 1]
    if twice:
        raise UsageError(one_line(f"{file}: several problems have the name {twice[0]}; give each its own"))
    return cases


def chosen(cases: list[Case], names: Collection[str]) -> list[Case]:
    """Select the cases of these names, in the order of the file.

    Raises:
        UsageError: a name is unknown.
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
    where, map_file = f"{where}, {entry['name']}", folder / entry["map"]
    if not os.path.isfile(map_file):  # pathlib's is_file() raises for a name that is too long
        raise UsageError(one_line(f"{where}: there is no map file {map_file}"))
    try:
        vehicle = Vehicle(turning_radius=entry["turning_radius"], robot_radius=entry["robot_radius"])
        return Case(entry["name"], map_file, vehicle, _pose("start", entry["start"]), _pose("goal", entry["goal"]))
    except (OptionError, InvalidPose) as error:
        raise UsageError(one_line(f"{where}: {error}")) from error


def _pose(name: str, numbers: Any) -> Pose:
    """Check a pose; numbers written as text are refused."""
    if not (isinstance(numbers, list) and all(type(number) in (int, float) for number in numbers)):
        raise InvalidPose(f"The {name} pose is {quoted(numbers)}; give three numbers: [x [m], y [m], yaw [rad]].")
    return checked_pose(name, numbers)
