"""The requests of the command line: maps by file or name, and plans that are planned again (`plan --replay`)."""

import argparse
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from dubins_rrt_ros.planning import GridMap, InvalidPose, Map, MapNotFound, OptionError, Problem, Settings, load_map
from dubins_rrt_ros.planning.curves.path import Path as DrivenPath
from dubins_rrt_ros.planning.maps.files import MAX_CELLS, UNKNOWN_GREY
from dubins_rrt_ros.planning.maps.grids import PICTURE_ENDINGS
from dubins_rrt_ros.planning.maps.locate import OMITTED_ENDING, find_map, installed_maps, maps_directory
from dubins_rrt_ros.planning.maps.readers import MAP_ENDINGS, OTHER_ENDINGS
from dubins_rrt_ros.planning.plan_file import PlanFileError, read_path, read_request, read_waypoints
from dubins_rrt_ros.planning.problem import Waypoint
from dubins_rrt_ros.planning.text import one_line

from .documents import read_json
from .parser import near_miss

#: The arguments of load_map that have flags, with their defaults.
MAP_FLAGS: dict[str, Any] = {"max_map_cells": MAX_CELLS.default, "resolution": None, "unknown_grey": UNKNOWN_GREY.default}


class LoadedRequest(NamedTuple):
    """A request whose map is loaded.

    Attributes:
        map_name: the map as the user named it.
        problem, settings: the arguments of plan().
        load_time: time that reading the map took [s].
        source: the file of a plan that is planned again, or "".
        path: the path of that plan.
        waypoints: what the path passes between start and goal.
    """

    map_name: str
    problem: Problem
    settings: Settings
    load_time: float
    source: str = ""
    path: DrivenPath | None = None
    waypoints: tuple[Waypoint, ...] = ()


def add_map_arguments(parser: argparse.ArgumentParser, pictures: bool = True) -> argparse.Action:
    """Give `parser` the argument MAP, which is returned, and the flags for it, those for pictures too if they are wanted."""
    action = parser.add_argument("map", metavar="MAP", default=argparse.SUPPRESS,
                                 help=f"a map file ({', '.join(MAP_ENDINGS)}){', a picture with --resolution,' * pictures} "
                                      "or an installed map's name, such as maze")
    parser.add_argument("--max-map-cells", metavar="N", type=int, default=MAX_CELLS.default,
                        help=f"{MAX_CELLS.describe()}; default {MAX_CELLS.default}")
    if not pictures:
        return action
    parser.add_argument("--resolution", metavar="m", type=float, default=None,
                        help=f"side of a cell of a picture ({', '.join(PICTURE_ENDINGS)}) that is the map, without a YAML file "
                             "[m]: white is free, black occupied, grey unknown, and its lower left corner at (0, 0)")
    parser.add_argument("--unknown-grey", metavar="N", type=int, default=UNKNOWN_GREY.default,
                        help=f"{UNKNOWN_GREY.describe()}; default {UNKNOWN_GREY.default}")
    return action


def map_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the keyword arguments of load_map that the flags of `add_map_arguments` give."""
    return {name: getattr(arguments, name) for name in MAP_FLAGS if name in arguments}


def given_map_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return those of `map_options` that are not the defaults."""
    return {name: value for name, value in map_options(arguments).items() if value != MAP_FLAGS[name]}


def find_map_or_suggest(name: str) -> Path:
    """Find the file of a map.

    Raises:
        MapNotFound: there is none; the message suggests an installed map of a similar name, unless a picture or folder is named.
    """
    try:
        return find_map(name)
    except MapNotFound as error:
        if os.path.isdir(name) or Path(name).suffix.lower() not in ("", *MAP_ENDINGS, *OTHER_ENDINGS):
            raise
        files = sorted(installed_maps(), key=lambda file: file.suffix == OMITTED_ENDING)  # the last of a stem counts
        own = {file.stem: file.stem if file.suffix == OMITTED_ENDING else file.name for file in files}
        raise MapNotFound(f"{error}{near_miss(Path(name).stem, own.values())}") from None


def read_map(name: str, **options: Any) -> tuple[Map, float]:
    """Load the map of a file or of an installed map's name; return it with the time that this took [s].

    What a person should know of how it was understood goes to standard error.

    Args:
        name: as `find_map` takes it.
        **options: those of `load_map`.
    """
    begin = time.perf_counter()
    loaded = load_map(find_map_or_suggest(name), **options)
    took = time.perf_counter() - begin
    no_pixels = () if isinstance(loaded, GridMap) or options.get("unknown_grey", -1) < 0 else (
        "--unknown-grey has no effect on polygons",)
    for warning in (*loaded.warnings, *no_pixels):
        print(f"dubins_rrt: warning: {one_line(name)}: {warning}", file=sys.stderr)
    return loaded, took


def read_replay(file: str, **options: Any) -> LoadedRequest:
    """Read the request of a file that `dubins_rrt plan --json` wrote.

    Raises:
        UsageError: it cannot be read, or is no JSON.
        PlanFileError: it is no such file, or its map is missing or has changed.
    """
    document = _read_document(file)
    world_map, load_time = _same_map(file, document, options)
    try:
        problem, settings = read_request(document, world_map)
        path, waypoints = read_path(document), read_waypoints(document)
    except (PlanFileError, OptionError, InvalidPose) as error:
        raise PlanFileError(f"{file}: {error}") from error
    return LoadedRequest(document["map"], problem, settings, load_time, file, path, waypoints)


def _read_document(file: str) -> dict[str, Any]:
    document = read_json(file)
    if not (isinstance(document, dict) and all(isinstance(document.get(name), str) for name in ("map", "map_id"))):
        raise PlanFileError(f"{file} names no map; give a file that `dubins_rrt plan --json` wrote")
    return document


def _same_map(file: str, document: dict[str, Any], options: dict[str, Any]) -> tuple[Map, float]:
    """Load the first map that has the name and the content of the document's."""
    others = []
    for candidate in _candidates(file, document["map"]):
        world_map, load_time = read_map(str(candidate), **options)
        if world_map.id == document["map_id"]:
            return world_map, load_time
        others.append(f"{candidate} has the id {world_map.id}")
    raise PlanFileError(f"{file} was planned on {document['map']} with the map_id {document['map_id']}, but "
                        f"{' and '.join(others) or 'no such map is here'}; bring back the map of then, or plan anew")


def _candidates(file: str, name: str) -> Iterator[Path]:
    """Yield where the map of a document may be: as it was named then, next to the document, among the installed maps."""
    base, folder, own = Path(name).name, Path(file).parent, maps_directory()
    places = (*_named(name), folder / name, folder / base, own / base, own / f"{base}{OMITTED_ENDING}")
    return (place for place in dict.fromkeys(places) if os.path.isfile(place))


def _named(name: str) -> list[Path]:
    try:
        return [find_map(name)]
    except MapNotFound:
        return []
