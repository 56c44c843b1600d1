"""Read and write grids as map_server does: a YAML file, and the image that it names."""

import difflib
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..option import plain_float
from ..text import quoted
from .brightness import FREE_GREY, MODES, OCCUPIED_GREY, UNKNOWN_GREY, Rules, cells_of
from .errors import MapError, MapMetadataError
from .frame import doubt_about_yaw
from .images import Picture, read_image
from .model import GridMap
from .opening import ReadOptions, check_inside, located, opened, read_text
from .yaml import RepeatedKey, load_plain

#: The endings of pictures, which may come without a YAML file.
PICTURE_ENDINGS = (".png", ".pgm", ".bmp")
#: Longest YAML file that is read [bytes].
MAX_YAML_BYTES = 16 * 2**10

#: The fields that are read; map_server passes over others, too.
FIELDS = "image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode", "unknown_grey"

#: How alike the name of another field must be to one of these, from 0 to 1, to be taken for a slip.
LEAST_ALIKE = 0.75

_FLAGS = {**dict.fromkeys(("0", "false", "no", "off"), False), **dict.fromkeys(("1", "true", "yes", "on"), True)}


def save_map(grid: GridMap, yaml_path: str | os.PathLike[str]) -> None:
    """Write a grid as a map_server pair: the YAML file, and a binary PGM of the same name beside it.

    The mode is trinary, by the thresholds of the grid.

    Raises:
        MapError: the name has another ending, or a file cannot be written.
        TypeError: grid is no grid.
    """
    if not isinstance(grid, GridMap):
        raise TypeError(f"the map is {quoted(grid)}; give a GridMap, such as rasterise makes of polygons")
    path, rules = Path(yaml_path), Rules()
    image = path.with_suffix(".pgm")
    fields = {"image": image.name, "mode": rules.mode, "resolution": grid.resolution, "origin": list(grid.origin),
              "negate": int(rules.negate), "occupied_thresh": rules.occupied_thresh, "free_thresh": rules.free_thresh}
    grey = np.full(grid.data.shape, UNKNOWN_GREY, np.uint8)
    grey[(grid.data >= 0) & (grid.data <= grid.thresholds.free_up_to)] = FREE_GREY
    grey[grid.data >= grid.thresholds.occupied_from] = OCCUPIED_GREY
    height, width = grid.data.shape
    try:
        if path.suffix not in (".yaml", ".yml"):
            raise MapError(f"the ending {path.suffix!r} is not a map_server file's; name it .yaml")
        image.write_bytes(b"P5\n%d %d\n255\n" % (width, height) + grey[::-1].tobytes())
        path.write_text(yaml.safe_dump(fields, sort_keys=False, default_flow_style=None, allow_unicode=True), "utf-8")
    except OSError as error:
        raise MapError(f"{path}: cannot be written ({error.strerror}); choose a directory that is writable") from None
    except MapError as error:
        raise located(path, error) from None


def load_grid(path: Path, options: ReadOptions) -> GridMap:
    """Load a map_server map by its YAML file.

    Raises:
        MapError: see :func:`~dubins_rrt_ros.planning.maps.files.load_map`.
    """
    fields = _parse_yaml(read_text(path, MAX_YAML_BYTES, MapMetadataError))
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
        check_inside(path.parent / image, options.directory)
        picture = _read_picture(path.parent / image, options)
    except MapError as error:
        raise type(error)(f"image {image!r} {error}") from None
    cells, warnings = cells_of(picture, Rules(mode, negate, occupied, free), options.unknown_grey)
    return GridMap(cells, resolution, origin, path.name, percent=True, warnings=(*_doubts(fields, origin[2]), *warnings))


def _doubts(fields: dict[str, Any], yaw: float) -> Iterator[str]:
    """Yield what was most likely meant otherwise than it is taken."""
    if doubt := doubt_about_yaw(yaw):
        yield f"the origin has {doubt}"
    if "unknown_grey" in fields:
        yield "unknown_grey is no field of map files and is passed over; give it as a parameter, or by --unknown-grey"
    for name in fields:
        near = difflib.get_close_matches(str(name).lower(), FIELDS, 1, LEAST_ALIKE)
        if near and name not in FIELDS:
            yield f"the field {quoted(str(name))} is passed over; did you mean {near[0]}?"


def load_picture(path: Path, options: ReadOptions) -> GridMap:
    """Load a picture that comes without a YAML file: by the default rules, its lower left corner at (0, 0).

    Raises:
        MapMetadataError: the resolution is out of range.
        MapError: there is no resolution, or the picture cannot be used.
    """
    if options.resolution is None:
        raise MapError(f"the ending {path.suffix!r} is a picture's; give the side of its cells in metres, such as "
                       "resolution=0.05 (--resolution 0.05), or the .yaml file that names it")
    cells, warnings = cells_of(_read_picture(path, options), Rules(), options.unknown_grey)
    return GridMap(cells, options.resolution, name=path.name, percent=True, warnings=warnings)


def _read_picture(path: Path, options: ReadOptions) -> Picture:
    with opened(path) as file:
        return read_image(file, options.max_map_cells)


def _parse_yaml(text: str) -> dict[str, Any]:
    try:
        document = load_plain(text, aliases=True, unique_keys=True)  # aliases as map_server's parser has them
    except RecursionError:
        raise MapMetadataError("YAML is nested too deep; give the fields of a map_server map") from None
    except RepeatedKey as error:  # of which map_server takes the first, and others the last
        raise MapMetadataError(f"{error}; give it once") from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise MapMetadataError(f"is no valid YAML ({error}); correct the text") from None
    if document is None:
        raise MapMetadataError("has no fields but comments alone; give the fields of a map_server map")
    if not isinstance(document, dict):
        raise MapMetadataError(f"YAML is {quoted(document)}; give the fields of a map_server map")
    return document


def _instead_of(name: str, fields: dict[str, Any]) -> str:
    """Return which of the fields that are there was likely meant, in words; "" where none is alike."""
    others = {str(other).lower(): other for other in fields if other not in FIELDS}
    near = difflib.get_close_matches(name, others, 1, LEAST_ALIKE)
    return f" (there is {quoted(str(others[near[0]]))})" if near else ""


def _field(fields: dict[str, Any], name: str, convert: Callable[[Any], Any], remedy: str) -> Any:
    if name not in fields:
        raise MapMetadataError(f"{name} is missing{_instead_of(name, fields)}; {remedy}")
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
    number = plain_float(value)
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
