"""The problems of `dubins_rrt bench`, read from its file and checked before the first run."""

import os
import warnings
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from dubins_rrt_ros.planning import InvalidPose, OptionError, Pose, Problem, Settings, Vehicle, checked_pose, options
from dubins_rrt_ros.planning.maps.frame import doubt_about_yaw
from dubins_rrt_ros.planning.maps.locate import installed_map, no_folder
from dubins_rrt_ros.planning.text import one_line, quoted
from dubins_rrt_ros.planning.vehicle import overridden, without_overridden

from ..common.documents import read_json
from ..common.parser import UsageError, near_miss

KEYS = ("name", "map", "start", "goal", "turning_radius", "robot_radius")
#: Keys that may be there in place of one of these.
_IN_PLACE_OF = {"turning_radius": "wheelbase", "robot_radius": "footprint"}
#: Keys that are notes, as all that begin with an underscore.
NOTES = ("set", "check_step")

#: Maximum length of a problem's name, which is part of lines and tables [characters].
LONGEST_NAME = 200

_Options = tuple[tuple[str, Any], ...]


class DoubtfulProblem(UserWarning):
    """A warning: what a file of problems says is taken, but was likely meant otherwise."""


class Case(NamedTuple):
    """A problem whose map is not loaded yet.

    Attributes:
        name: a name that no other case of the file has.
        map: the file of the map.
        vehicle: turning radius and size.
        start, goal: (x [m], y [m], theta [rad]).
        request, settings: the options of `Problem` and of `Settings` that the file gives, as pairs of name and value.
    """

    name: str
    map: Path
    vehicle: Vehicle
    start: Pose
    goal: Pose
    request: _Options = ()
    settings: _Options = ()

    @property
    def allow_unknown(self) -> bool:
        """True if unknown space is free."""
        return bool(dict(self.request).get("allow_unknown", False))


def read_cases(file: str) -> list[Case]:
    """Read the problems of a file: every option of vehicle, request and settings may be a key; notes are passed over.

    Raises:
        UsageError: the file or one of its problems is malformed, a key is unknown, or a map is missing.
    """
    entries = read_json(file)
    if not (isinstance(entries, list) and entries):
        raise UsageError(f"{file} is no list of problems; give [{{\"name\": ..., \"map\": ..., ...}}, ...]")
    cases = [_case(entry, Path(file).parent, f"{file}: problem {number}") for number, entry in enumerate(entries, 1)]
    for doubt in _doubts(entries, cases):
        warnings.warn(one_line(f"{file}: {doubt}"), DoubtfulProblem, stacklevel=2)
    twice = [name for name, count in Counter(case.name for case in cases).items() if count > 1]
    if twice:
        raise UsageError(one_line(f"{file}: several problems have the name {twice[0]}; give each its own"))
    return cases


def _doubts(entries: list[dict[str, Any]], cases: list[Case]) -> Iterator[str]:
    """Say of which keys nothing comes, as others take their place, and which yaws were likely meant in degrees."""
    counts = Counter(item for entry in entries for item in overridden(entry).items())
    for (name, by), count in counts.items():
        yield f"{name} has no effect, as {by} takes its place, in {count} problem{'' if count == 1 else 's'}"
    for case in cases:
        for name, pose in (("start", case.start), ("goal", case.goal)):
            if doubt := doubt_about_yaw(pose[2]):
                yield f"problem {case.name}: its {name} has {doubt}"


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
    missing = [key for key in KEYS if key not in entry and _IN_PLACE_OF.get(key) not in entry]
    if missing:
        raise UsageError(f"{where} lacks {', '.join(missing)}")
    for key in ("name", "map"):
        if not (isinstance(entry[key], str) and entry[key]):
            raise UsageError(f"{where}: its {key} is {quoted(entry[key])}; give a text")
    if not entry["name"].isprintable() or len(entry["name"]) > LONGEST_NAME:
        raise UsageError(f"{where}: its name is {quoted(entry['name'])}; give one of {LONGEST_NAME} printable characters at most")
    where, map_file = f"{where}, {entry['name']}", folder / entry["map"]
    if not os.path.exists(map_file):
        map_file = installed_map(entry["map"]) or map_file
    if not os.path.isfile(map_file):  # pathlib's is_file() raises for a name that is too long
        what = no_folder(map_file)
        raise UsageError(one_line(f"{where}: its map {map_file} {what}" if what else f"{where}: there is no map file {map_file}; "
                                  "its name is relative to the file of problems, or that of an installed map, such as maze"))
    _check_keys(entry, where)
    try:
        vehicle = Vehicle(**without_overridden(dict(_given(Vehicle, entry))))
        return Case(entry["name"], map_file, vehicle, _pose("start", entry["start"]), _pose("goal", entry["goal"]),
                    _given(Problem, entry), _given(Settings, entry))
    except (OptionError, InvalidPose) as error:
        raise UsageError(one_line(f"{where}: {error}")) from error


def _check_keys(entry: dict[str, Any], where: str) -> None:
    """Refuse a key of which nothing would come."""
    known = dict.fromkeys((*KEYS, *(item.name for cls in (Vehicle, Problem, Settings) for item in options(cls)), *NOTES))
    for key in entry:
        if key not in known and not key.startswith("_"):
            remedy = near_miss(key, known) or f"; give none but {', '.join(known)}, or begin a note with _"
            raise UsageError(one_line(f"{where}: there is no key {quoted(key)}{remedy}"))


def _given(cls: type, entry: dict[str, Any]) -> _Options:
    """Return the options of a dataclass that an entry gives, as their fields hold them.

    Raises:
        OptionError: a value is of another type or out of range.
    """
    return tuple((item.name, item.convert(entry[item.name])) for item in options(cls) if item.name in entry)


def _pose(name: str, numbers: Any) -> Pose:
    """Check a pose; numbers written as text are refused."""
    if not (isinstance(numbers, list) and all(type(number) in (int, float) for number in numbers)):
        raise InvalidPose(f"The {name} pose is {quoted(numbers)}; give three numbers: [x [m], y [m], yaw [rad]].")
    return checked_pose(name, numbers)
