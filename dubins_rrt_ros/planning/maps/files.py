"""Map files: map_server's YAML and image, GeoJSON, WKT. Nothing else in the library reads or writes maps."""

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import yaml

from ..text import quoted
from .errors import MapError, MapMetadataError, MapNotFound
from .images import read_image
from .model import (
    FREE,
    FREE_UP_TO,
    OCCUPIED,
    OCCUPIED_FROM,
    UNKNOWN,
    GridMap,
    PolygonMap,
)
from .polygons import parse_geojson, parse_wkt
from .yaml import load_plain

#: The longest files that are read [bytes]; an image is limited by its cells.
MAX_YAML_BYTES = 16 * 2**10
MAX_POLYGON_BYTES = 64 * 2**20
#: How long polygon files may be however few cells a map may have, and how much longer for each: as much as a position takes.
_FEW_POLYGON_BYTES, _POLYGON_BYTES_PER_CELL = 64 * 2**10, 32

MODES = ("trinary", "scale", "raw")
_FLAGS = {**dict.fromkeys(("0", "false", "no", "off"), False), **dict.fromkeys(("1", "true", "yes", "on"), True)}
#: The brightness that trinary files have for free, occupied and unknown cells, and the thresholds that tell them apart.
_FREE_GREY, _OCCUPIED_GREY, _UNKNOWN_GREY = 254, 0, 205
_SAVED_OCCUPIED_THRESH, _SAVED_FREE_THRESH = 0.65, 0.196
#: Default maximum number of cells of a grid: ten kilometres square at a resolution of 1 m, half a kilometre at 5 cm.
MAX_MAP_CELLS = 100_000_000


def load_map(path: str | os.PathLike[str], *, max_map_cells: int = MAX_MAP_CELLS,
             map_directory: str = "") -> GridMap | PolygonMap:
    """Load a map file; its ending says what it is.

    `.yaml`, `.yml`: map_server's format, by the rules of ROS 2 Jazzy. `.geojson`, `.json`: see
    :func:`~dubins_rrt_ros.planning.maps.polygons.parse_geojson`. `.wkt`: one Polygon or MultiPolygon, the free space.

    Args:
        path: the file; a leading `~` is the home directory.
        max_map_cells: the most cells of a grid; judged before its image is read. Of polygons, 64 KiB and 32 bytes for each
            cell may be read, and 64 MiB at most.
        map_directory: the directory in which the file must be, and the image that it names, when links are followed; "" is any.

    Returns:
        A map in metres; its name is the file's.

    Raises:
        MapNotFound: the file, or the image that it names, is not there, cannot be opened or is outside `map_directory`.
        MapMetadataError: the YAML file is none, or a field in it is missing or wrong.
        MapError: anything else in the files cannot be used. The message names file, field, value and remedy.
    """
    path = expand_home(path)
    try:
        return _load(path, max_map_cells, map_directory)
    except MapError as error:
        raise _located(path, error) from None


def save_map(grid: GridMap, yaml_path: str | os.PathLike[str]) -> None:
    """Write a grid as a map_server pair: the YAML file, and a binary PGM of the same name beside it.

    The mode is trinary: cells up to 25 become free, from 65 on occupied, all others unknown.

    Raises:
        MapError: the name has another ending, or a file cannot be written.
    """
    path = Path(yaml_path)
    image = path.with_suffix(".pgm")
    fields = {"image": image.name, "mode": "trinary", "resolution": grid.resolution, "origin": list(grid.origin),
              "negate": 0, "occupied_thresh": _SAVED_OCCUPIED_THRESH, "free_thresh": _SAVED_FREE_THRESH}
    grey = np.full(grid.data.shape, _UNKNOWN_GREY, np.uint8)
    grey[(grid.data >= 0) & (grid.data <= FREE_UP_TO)] = _FREE_GREY
    grey[grid.data >= OCCUPIED_FROM] = _OCCUPIED_GREY
    height, width = grid.data.shape
    try:
        if path.suffix not in (".yaml", ".yml"):
            raise MapError(f"the ending {path.suffix!r} is not a map_server file's; name it .yaml")
        image.write_bytes(b"P5\n%d %d\n255\n" % (width, height) + grey[::-1].tobytes())
        path.write_text(yaml.safe_dump(fields, sort_keys=False, default_flow_style=None, allow_unicode=True), "utf-8")
    except OSError as error:
        raise MapError(f"{path}: cannot be written ({error.strerror}); choose a directory that is writable") from None
    except MapError as error:
        raise _located(path, error) from None


def _located(path: Path, error: MapError) -> MapError:
    """Return the error, of the same class, with the file's name in front."""
    return type(error)(f"{path}: {error}")


def expand_home(path: str | os.PathLike[str]) -> Path:
    """Return a path with a leading `~` replaced by the home directory."""
    try:
        return Path(os.path.expanduser(path))
    except ValueError:  # a home directory of nobody that there can be
        return Path(path)


def _load(path: Path, max_map_cells: int, directory: str) -> GridMap | PolygonMap:
    _check_inside(path, directory)
    ending = path.suffix.lower()
    reader = READERS.get(OTHER_ENDINGS.get(ending, ending))
    if reader is None:
        *most, last = MAP_ENDINGS
        raise MapError(f"the ending {ending!r} is of no known kind of map; give a {', '.join(most)} or {last} file")
    return reader.read(path, max_map_cells, directory)


def _check_inside(path: Path, directory: str) -> None:
    """Refuse a file that is not in a directory, once all links are followed; "" is any."""
    try:
        is_inside = not directory or Path(os.path.realpath(path)).is_relative_to(os.path.realpath(expand_home(directory)))
    except ValueError:  # one of them is no possible name
        is_inside = False
    if not is_inside:
        raise MapNotFound(f"is outside of map_directory = {directory}; name a file in there, or set another directory")


def _open(path: Path) -> BinaryIO:
    # A pipe would wait for its other end.
    if os.path.exists(path) and not os.path.isfile(path):
        raise MapNotFound("is a directory, pipe or device; name a regular file")
    try:
        return path.open("rb")
    except OSError as error:
        raise MapNotFound(f"cannot be read ({error.strerror}); correct the name or the file's permissions") from None
    except ValueError as error:
        raise MapNotFound(f"is no possible file name ({error}); correct the name") from None


def _read_text(path: Path, max_bytes: int, refusal: type[MapError] = MapError) -> str:
    """Return the text of a file; raise a `refusal` if it is too large, empty or not UTF-8."""
    with _open(path) as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise refusal(f"is larger than {max_bytes} bytes; split or simplify it")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refusal(f"is not UTF-8 at byte {error.start}; save it as UTF-8") from None
    if not text.strip():
        raise refusal("is empty; give a file with a map in it")
    return text


def _load_grid(path: Path, max_map_cells: int, directory: str) -> GridMap:
    fields = _parse_yaml(_read_text(path, MAX_YAML_BYTES, MapMetadataError))
    image = _field(fields, "image", _text, "give the name of a PGM, PNG or BMP file")
    resolution = _field(fields, "resolution", _positive, "give the side of a cell in metres, above 0")
    origin = _field(fields, "origin", _pose, "give [x, y, yaw], three finite numbers in metres and radians")
    negate = _field(fields, "negate", lambda value: _FLAGS[value.lower()], "give 0 or 1")
    occupied = _field(fields, "occupied_thresh", _fraction, "give a number from 0 to 1")
    free = _field(fields, "free_thresh", _fraction, "give a number from 0 to 1")
    mode = _field({"mode": "trinary", **fields}, "mode", _mode, f"give one of {', '.join(MODES)}")
    if free >= occupied:
        raise MapMetadataError(f"free_thresh is {free} and occupied_thresh {occupied}; make free_thresh the smaller one")
    try:
        _check_inside(path.parent / image, directory)
        with _open(path.parent / image) as file:
            grey, transparent = read_image(file, max_map_cells)
    except MapError as error:
        raise type(error)(f"image {image!r} {error}") from None
    # Row 0 of an image is the top, of a grid the bottom.
    data = _cell_values(mode, negate, occupied, free)[grey[::-1]]
    if transparent is not None and mode != "raw":
        data[transparent[::-1]] = UNKNOWN
    return GridMap(data, resolution, origin, path.name, percent=True)


def _parse_yaml(text: str) -> dict[str, Any]:
    try:
        document = load_plain(text, aliases=True)  # as map_server's parser does it
    except RecursionError:
        raise MapMetadataError("YAML is nested too deep; give the fields of a map_server map") from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise MapMetadataError(f"is no valid YAML ({error}); correct the text") from None
    if not isinstance(document, dict):
        raise MapMetadataError(f"YAML is {quoted(document)}; give the fields of a map_server map")
    return document


def _field(fields: dict[str, Any], name: str, convert: Callable[[Any], Any], remedy: str) -> Any:
    if name not in fields:
        raise MapMetadataError(f"{name} is missing; {remedy}")
    try:
        return convert(fields[name])
    except (ValueError, TypeError, LookupError, AttributeError):
        raise MapMetadataError(f"{name} is {quoted(fields[name])}; {remedy}") from None


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    if not value:
        raise ValueError
    return value


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError
    return number


def _positive(value: Any) -> float:
    number = _finite(value)
    if number <= 0:
        raise ValueError
    return number


def _fraction(value: Any) -> float:
    number = _finite(value)
    if not 0 <= number <= 1:
        raise ValueError
    return number


def _pose(value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list):
        raise TypeError
    x, y, yaw = map(_finite, value)
    return x, y, yaw


def _mode(value: Any) -> str:
    return MODES[MODES.index(value.lower())]


def _cell_values(mode: str, negate: bool, occupied: float, free: float) -> np.ndarray:
    """(256,) int8: the cell that each brightness stands for.

    Jazzy compares in single precision, both thresholds inclusive, and rounds halves away from zero; raw knows neither
    `negate` nor thresholds.
    """
    grey = np.arange(256)
    if mode == "raw":
        return np.where(grey <= OCCUPIED, grey, UNKNOWN).astype(np.int8)
    shade = grey.astype(np.float32) / np.float32(255)
    occupancy = shade if negate else np.float32(1) - shade
    between: np.ndarray | int = UNKNOWN
    if mode == "scale":
        scaled = (occupancy - np.float32(free)) / np.float32(occupied - free) * np.float32(100)
        between = np.floor(scaled.astype(float) + 0.5)
    values = np.where(occupancy >= np.float32(occupied), OCCUPIED, between)
    return np.where(occupancy <= np.float32(free), FREE, values).astype(np.int8)


def _polygon_reader(parse: Callable[[str, str], PolygonMap]) -> "Reader":
    def read(path: Path, max_map_cells: int, _directory: str) -> PolygonMap:
        max_bytes = min(MAX_POLYGON_BYTES, _FEW_POLYGON_BYTES + _POLYGON_BYTES_PER_CELL * max_map_cells)
        return parse(_read_text(path, max_bytes), path.name)

    return Reader(read, is_grid=False)


class Reader(NamedTuple):
    """A reader of one kind of map file.

    Attributes:
        read: takes the path, the maximum number of cells and the map directory ("" is any), and returns the map.
        is_grid: whether its maps are grids; all others are polygons.
    """

    read: Callable[[Path, int, str], GridMap | PolygonMap]
    is_grid: bool


#: The readers by the ending of their files. Help, completion, installed maps and errors follow from this table.
READERS = {
    ".yaml": Reader(_load_grid, is_grid=True),
    ".geojson": _polygon_reader(parse_geojson),
    ".wkt": _polygon_reader(parse_wkt),
}
#: The endings of map files, and those that stand for one of them.
MAP_ENDINGS: tuple[str, ...] = tuple(READERS)
OTHER_ENDINGS = {".yml": ".yaml", ".json": ".geojson"}
#: The endings of polygon maps.
POLYGON_ENDINGS = tuple(ending for ending, reader in READERS.items() if not reader.is_grid)
