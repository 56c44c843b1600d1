"""`dubins_rrt render`: rasterise a polygon map into the pair of files that map_server reads."""

import argparse
import math
from pathlib import Path

from dubins_rrt_ros.planning import PolygonMap, load_map, rasterise, save_map
from dubins_rrt_ros.planning.maps.readers import POLYGON_ENDINGS

from .common.example import ENDS, MAP
from .common.output import check_folder, words_for, write_document
from .common.parser import Parser, UsageError, add_json_flag, describe
from .common.request import find_map_or_suggest

#: Maximum number of cells: each is a polygon of a few hundred bytes while it is tested.
MAX_CELLS = 4_000_000


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="MAP [options]",
        description="Rasterises a polygon map and writes the grid as map_server's YAML and image. A cell is occupied if "
                    "any part of it, even a corner, touches an obstacle.",
        examples=[f"dubins_rrt render {MAP}.geojson --resolution 0.1 --out grids", f"dubins_rrt plan grids/{MAP}.yaml {ENDS}"],
        exit_status="0 done, 2 wrong usage")
    parser.add_argument("map", metavar="MAP", help=f"a polygon map ({', '.join(POLYGON_ENDINGS)}), or an installed one's name")
    parser.add_argument("--resolution", metavar="m", type=float, default=0.05,
                        help="side of a cell [m]; default 0.05")
    parser.add_argument("--out", metavar="DIR", help="folder to write to; default: that of the polygon map, or the current "
                                                     "one for an installed map")
    add_json_flag(parser, "the files' names, and the grid's measures,")


def run(arguments: argparse.Namespace) -> int:
    """Write the pair, report, and return the exit status."""
    check_folder(arguments.json)
    source = find_map_or_suggest(arguments.map)
    folder = Path(arguments.out or (source.parent if Path(arguments.map).is_file() else "."))
    grid = rasterise(_polygons(source, arguments.resolution), arguments.resolution)
    folder.mkdir(parents=True, exist_ok=True)
    written = folder / f"{source.stem}.yaml"
    save_map(grid, written)
    rows, columns = grid.data.shape
    occupied = float((grid.data > 0).mean())
    if arguments.json:
        write_document(arguments.json, {"files": [str(written), str(written.with_suffix(".pgm"))], "width": columns,
                                        "height": rows, "resolution": grid.resolution, "origin": list(grid.origin),
                                        "occupied": occupied, "map_id": grid.id})
    print(f"{written} and its image: {columns} x {rows} cells of {grid.resolution:g} m, {occupied:.0%} of them occupied",
          file=words_for(arguments.json))
    return 0


def _polygons(source: Path, resolution: float) -> PolygonMap:
    """Load the polygon map, unless its grid would be too large."""
    if not (math.isfinite(resolution) and resolution > 0):
        raise UsageError(f"--resolution is {resolution:g}; it must be a positive number of metres")
    polygon_map = load_map(source)
    if not isinstance(polygon_map, PolygonMap):
        raise UsageError(f"{source} is a grid already; give a polygon map ({' or '.join(POLYGON_ENDINGS)})")
    low, high = polygon_map.corners()[[0, 2]]
    cells = math.prod(float(side) / resolution + 2 for side in high - low)
    if cells > MAX_CELLS:
        raise UsageError(f"--resolution {resolution:g} makes a grid of {cells:.2g} cells from {source}; at most "
                         f"{MAX_CELLS:g} are made, so give a coarser one")
    return polygon_map
