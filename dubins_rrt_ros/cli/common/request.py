"""Where the command line gets its requests from: map files, and plans to be planned again."""

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from dubins_rrt_ros.planning import Map, MapNotFound, Problem, Settings, load_map
from dubins_rrt_ros.planning.curves.path import Path as DrivenPath
from dubins_rrt_ros.planning.maps.locate import find_map as locate_map
from dubins_rrt_ros.planning.maps.locate import maps_directory
from dubins_rrt_ros.planning.plan_file import PlanFileError, read_path, read_request

from .parser import near_miss

MAX_MAP_CELLS = 100_000_000


class Request(NamedTuple):
    """What to plan.

    Attributes:
        map_name: the map as the user named it.
        problem, settings: for plan().
        load_time: what reading the map took [s].
        source: the file of a plan that is planned again, or "".
        path: the path that was planned then.
    """

    map_name: str
    problem: Problem
    settings: Settings
    load_time: float
    source: str = ""
    path: DrivenPath | None = None


def find_map(name: str) -> Path:
    """The file of a map.

    Raises:
        MapNotFound: there is none; the message names an installed one with a like name.
    """
    try:
        return locate_map(name)
    except MapNotFound as error:
        own = {file.stem: file.name for ending in ("wkt", "geojson") for file in maps_directory().glob(f"*.{ending}")}
        own |= {file.stem: file.stem for file in maps_directory().glob("*.yaml")}
        raise MapNotFound(f"{error}{near_miss(Path(name).stem, own.values())}") from None


def read_map(name: str, max_map_cells: int) -> tuple[Map, float]:
    """The map of a file or an installed map's name, and how long the reading took [s]."""
    begin = time.perf_counter()
    return load_map(find_map(name), max_map_cells=max_map_cells), time.perf_counter() - begin


def read_replay(file: str, max_map_cells: int) -> Request:
    """The request of a file that `dubins_rrt plan --json` wrote.

    Raises:
        PlanFileError: it is no such file, or its map is not there or another than then.
    """
    document = _read_json(file)
    map, load_time = _same_map(file, document, max_map_cells)
    try:
        problem, settings = read_request(document, map)
        path = read_path(document)
    except PlanFileError as error:
        raise PlanFileError(f"{file}: {error}") from error
    return Request(document["map"], problem, settings, load_time, file, path)


def _read_json(file: str) -> dict[str, Any]:
    try:
        document = json.loads(Path(file).read_text(encoding="utf-8"))
    except OSError as error:
        raise PlanFileError(f"{file} cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise PlanFileError(f"{file} is no JSON file: {error}") from error
    if not (isinstance(document, dict) and all(isinstance(document.get(name), str) for name in ("map", "map_id"))):
        raise PlanFileError(f"{file} names no map; give a file that `dubins_rrt plan --json` wrote")
    return document


def _same_map(file: str, document: dict[str, Any], max_map_cells: int) -> tuple[Map, float]:
    """The first map with the name and the content of the document's."""
    others = []
    for candidate in _candidates(file, document["map"]):
        map, load_time = read_map(str(candidate), max_map_cells)
        if map.id == document["map_id"]:
            return map, load_time
        others.append(f"{candidate} has the id {map.id}")
    raise PlanFileError(f"{file} was planned on {document['map']} with the map_id {document['map_id']}, but "
                        f"{' and '.join(others) or 'no such map is here'}; bring back the map of then, or plan anew")


def _candidates(file: str, name: str) -> Iterator[Path]:
    """Where the map of a document may be: as it was named then, beside the document, among the installed maps."""
    base, beside, own = Path(name).name, Path(file).parent, maps_directory()
    places = (*_named(name), beside / name, beside / base, own / base, own / f"{base}.yaml")
    return (place for place in dict.fromkeys(places) if os.path.isfile(place))


def _named(name: str) -> list[Path]:
    try:
        return [find_map(name)]
    except MapNotFound:
        return []
