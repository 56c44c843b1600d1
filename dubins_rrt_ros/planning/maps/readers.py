"""The table of the readers of map files."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from .grids import load_grid
from .model import GridMap, PolygonMap
from .opening import ReadOptions, read_text
from .polygons import parse_geojson, parse_wkt

#: Longest polygon file that is read [bytes].
MAX_POLYGON_BYTES = 64 * 2**20
#: Length of polygon files that is allowed however few cells a map may have, and the length for each cell: that of a position.
_FEW_POLYGON_BYTES, _POLYGON_BYTES_PER_CELL = 64 * 2**10, 32

Read = Callable[[Path, ReadOptions], GridMap | PolygonMap]


class Reader(NamedTuple):
    """A reader of one kind of map file.

    Attributes:
        read: takes the path and what a caller wants, and returns the map.
        is_grid: True if its maps are grids; all others are polygons.
    """

    read: Read
    is_grid: bool


def _polygon_reader(parse: Callable[[str, str], PolygonMap]) -> Reader:
    def read(path: Path, options: ReadOptions) -> PolygonMap:
        max_bytes = min(MAX_POLYGON_BYTES, _FEW_POLYGON_BYTES + _POLYGON_BYTES_PER_CELL * options.max_map_cells)
        return parse(read_text(path, max_bytes), path.name)

    return Reader(read, is_grid=False)


#: The readers by the ending of their files. Help, completion, installed maps and errors follow from this table.
READERS = {
    ".yaml": Reader(load_grid, is_grid=True),
    ".geojson": _polygon_reader(parse_geojson),
    ".wkt": _polygon_reader(parse_wkt),
}
#: The endings of map files, and those that stand for one of them.
MAP_ENDINGS: tuple[str, ...] = tuple(READERS)
OTHER_ENDINGS = {".yml": ".yaml", ".json": ".geojson"}
#: The endings of polygon maps.
POLYGON_ENDINGS = tuple(ending for ending, reader in READERS.items() if not reader.is_grid)
