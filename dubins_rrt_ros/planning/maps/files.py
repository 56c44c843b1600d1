"""Load a map by the name of its file."""

import os

from ..option import Option
from ..text import quoted
from .errors import MapError, MapNotFound
from .grids import PICTURE_ENDINGS, load_picture
from .locate import find_own, no_folder
from .model import GridMap, PolygonMap
from .opening import MAX_MAP_CELLS, ReadOptions, check_inside, located
from .readers import MAP_ENDINGS, OTHER_ENDINGS, READERS, Read

#: The options of `load_map` that are numbers, for flags and parameters, too.
MAX_CELLS = Option("max_map_cells", int, MAX_MAP_CELLS, "cells", 1, 2**31 - 1, (), "maximum size of a map", None)
UNKNOWN_GREY = Option("unknown_grey", int, -1, "", -1, 255, (), "brightness of pixels that are unknown cells, whatever the "
                      "thresholds say, such as 205; -1 is none", None)


def load_map(path: str | os.PathLike[str], *, max_map_cells: int = MAX_MAP_CELLS,
             map_directory: str | os.PathLike[str] = "",
             resolution: float | None = None, unknown_grey: int = -1) -> GridMap | PolygonMap:
    """Load a map file; its ending says what it is.

    `.yaml`, `.yml`: map_server's format, by the rules of ROS 2 Jazzy. `.geojson`, `.json`: see
    :func:`~dubins_rrt_ros.planning.maps.polygons.parse_geojson`. `.wkt`: one Polygon or MultiPolygon, the free space.
    `.png`, `.pgm`, `.bmp`: a picture without a YAML file, with `resolution`; free from the grey 206 up, occupied up to 89, its
    lower left corner at (0, 0).

    Args:
        path: the file, whose leading `~` is the home directory; the name of one of the package's own maps, such as maze; or a
            URL, `file:///PATH` or `package://PACKAGE/PATH`.
        max_map_cells: maximum number of cells of a grid; judged before its image is read. Of polygons, 64 KiB and 32 bytes for
            each cell may be read, and 64 MiB at most.
        map_directory: the directory in which the file must be, and the image that it names, when links are followed; "" is any.
        resolution: the side of a cell of a picture without a YAML file [m]; None for all other files.
        unknown_grey: the brightness of pixels that are unknown cells, whatever the thresholds say, such as 205; -1 for none.

    Returns:
        A map in metres; its name is the file's. Its `warnings` have what a person should know of how it was understood.

    Raises:
        MapNotFound: the file, or the image that it names, is not there, cannot be opened or is outside `map_directory`.
        MapMetadataError: the YAML file is none, or a field in it is missing or wrong.
        OptionError: max_map_cells or unknown_grey is of another type or out of range.
        TypeError: path or map_directory is no name of a file.
        MapError: anything else in the files cannot be used. The message names file, field, value and remedy.
    """
    for argument, value in (("path", path), ("map_directory", map_directory or "")):
        if not isinstance(value, str | os.PathLike) or isinstance(os.fspath(value), bytes):
            raise TypeError(f"{argument} is {quoted(value)}; give a text or a pathlib.Path")
    options = ReadOptions(MAX_CELLS.convert(max_map_cells), os.fspath(map_directory or ""), UNKNOWN_GREY.convert(unknown_grey),
                          resolution)
    file = find_own(path)
    try:
        check_inside(file, options.directory)
        if what := no_folder(file):
            raise MapNotFound(what)
        return _reader_of(file.suffix.lower(), options)(file, options)
    except MapError as error:
        raise located(file, error) from None


def _reader_of(ending: str, options: ReadOptions) -> Read:
    if ending in PICTURE_ENDINGS:
        return load_picture
    reader = READERS.get(OTHER_ENDINGS.get(ending, ending))
    if reader is None:
        *most, last = MAP_ENDINGS
        raise MapError(f"the ending {ending!r} is of no known kind of map; give a {', '.join(most)} or {last} file, or a picture "
                       f"({', '.join(PICTURE_ENDINGS)}) with its resolution; other pictures have to be converted to PNG")
    if options.resolution is not None:
        raise MapError(f"a {ending} file says itself how large its cells are, and resolution is "
                       f"{quoted(options.resolution)}; leave that out")
    return reader.read
