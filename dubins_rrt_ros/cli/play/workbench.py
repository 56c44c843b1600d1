"""The map that the page shows: loaded and saved below one folder, drawn on and erased."""

import json
import os
import threading
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import shapely

from dubins_rrt_ros.planning import GridMap, Map, MapError, PolygonMap, Vehicle, World, load_map, prepare, save_map
from dubins_rrt_ros.planning.maps.cells import FREE, OCCUPIED
from dubins_rrt_ros.planning.maps.free_space import MAX_COORDINATE
from dubins_rrt_ros.planning.maps.grids import PICTURE_ENDINGS
from dubins_rrt_ros.planning.maps.locate import find_map, installed_maps
from dubins_rrt_ros.planning.maps.opening import check_inside
from dubins_rrt_ros.planning.maps.readers import MAP_ENDINGS, OTHER_ENDINGS
from dubins_rrt_ros.planning.text import quoted_name

#: Maximum size of a map file that is read or written [bytes], and maximum number of cells of a grid.
MAX_BYTES = 64 * 2**20
#: Maximum number of files that the page offers, and of folders in which they are sought: a home folder has too many.
MOST_FILES, MOST_FOLDERS = 500, 2000


class Workbench:
    """A map that changes, with the folder that its files are in.

    Attributes:
        folder: maps are loaded and saved in there and below alone; the package's own maps may be loaded too.
        map: the map as it is now.
        name, options: the map as it was loaded or saved, and what `load_map` took beside its name, for commands.
        changed: True if it was drawn on since.
        lock: held by a page that reads or changes it.
    """

    def __init__(self, world_map: Map, name: str, folder: str, options: Mapping[str, Any] = MappingProxyType({})):
        self.folder = os.path.realpath(folder)
        self.map, self.name, self.options, self.changed = world_map, name, dict(options), False
        self.lock = threading.Lock()
        self._world: World | None = None
        self._erasable = shapely.envelope(world_map.free) if isinstance(world_map, PolygonMap) else None

    def files(self) -> list[str]:
        """List the names of the package's own maps and of the map files below the folder, as far as it is looked through."""
        endings = {*MAP_ENDINGS, *OTHER_ENDINGS, *PICTURE_ENDINGS}
        found = []
        for place, folders, names in islice(os.walk(self.folder), MOST_FOLDERS):
            folders[:] = sorted(name for name in folders if not name.startswith("."))
            found += [os.path.relpath(os.path.join(place, name), self.folder) for name in sorted(names)
                      if Path(name).suffix.lower() in endings]
            if len(found) >= MOST_FILES:
                break
        return [file.name for file in installed_maps()] + found[:MOST_FILES]

    def load(self, name: str, resolution: float | None = None) -> None:
        """Load a map by its name in the folder, or one of the package's own.

        Raises:
            MapError: it is outside of the folder, too large, or no map.
        """
        if name in {file.name for file in installed_maps()}:
            loaded: Map = load_map(find_map(name))
        else:
            file = self._inside(name)
            if os.path.isfile(file) and file.stat().st_size > MAX_BYTES:
                raise MapError(f"{name} is larger than {MAX_BYTES >> 20} MB")
            loaded = load_map(file, max_map_cells=MAX_BYTES, map_directory=self.folder, resolution=resolution)
            name = str(file)
        self._replace(loaded)
        self.name, self.changed = name, False
        self.options = {} if resolution is None else {"resolution": resolution}
        self._erasable = shapely.envelope(loaded.free) if isinstance(loaded, PolygonMap) else None

    def save(self, name: str) -> None:
        """Save the map below the folder; the ending selects the format: .yaml of a grid, .geojson or .wkt of polygons.

        Raises:
            MapError: it is outside of the folder, the ending is of the other kind of map, or the file cannot be written.
        """
        file, ending = self._inside(name), Path(name).suffix.lower()
        if isinstance(self.map, GridMap):
            if ending != ".yaml":
                raise MapError(f"{name}: a grid is saved as .yaml with its image; let the name end with .yaml")
            self._inside(str(Path(name).with_suffix(".pgm")))
            if self.map.data.size > MAX_BYTES:
                raise MapError(f"{name} would be larger than {MAX_BYTES >> 20} MB")
            save_map(self.map, file)
        else:
            self._save_polygons(file, ending)
        self.name, self.options, self.changed = str(file), {}, False

    def _save_polygons(self, file: Path, ending: str) -> None:
        free = self.map.free if isinstance(self.map, PolygonMap) else None
        if ending not in (".geojson", ".wkt"):
            raise MapError(f"{file.name}: polygons are saved as .geojson or .wkt; let the name end with one of them")
        text = shapely.to_wkt(free, rounding_precision=-1) if ending == ".wkt" else _geojson(free)
        if len(text) > MAX_BYTES:
            raise MapError(f"{file.name} would be larger than {MAX_BYTES >> 20} MB")
        try:
            file.write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            raise MapError(f"{file.name} cannot be written: {error.strerror}") from None

    def _inside(self, name: str) -> Path:
        """Return the file of a name; refuse it outside of the folder, once all links are followed."""
        if not name or "\0" in name:
            raise MapError("the name of the map is empty, or none")
        file = Path(self.folder, name)
        try:
            check_inside(file, self.folder)
        except MapError:
            raise MapError(f"{quoted_name(name)} is outside of {self.folder}; name a file in there or below") from None
        return file

    def draw(self, points: list[tuple[float, float]], radius: float, is_obstacle: bool) -> None:
        """Draw, or erase, what lies within a radius of a line through points [m].

        Raises:
            MapError: it would leave no free space, or has no points, or numbers that are none on a map.
        """
        if not points or radius < 0 or not (np.abs([*points, (radius, 0.0)]) <= MAX_COORDINATE).all():
            raise MapError(f"what is drawn has points and a radius in metres, up to {MAX_COORDINATE:g}")
        line = shapely.LineString(points) if len(points) > 1 else shapely.Point(points[0])
        drawn = self._draw_cells if isinstance(self.map, GridMap) else self._draw_polygons
        drawn(line, radius, is_obstacle)
        self.changed = True

    def _draw_cells(self, line: shapely.Geometry, radius: float, is_obstacle: bool) -> None:
        assert isinstance(self.map, GridMap)
        grid, side = self.map, self.map.resolution
        local = shapely.transform(line, grid.to_grid_frame)
        x0, y0, x1, y1 = np.array(local.bounds) / side
        reach, (rows, columns) = radius / side, grid.data.shape
        left, right = (int(np.clip(value, 0, columns)) for value in (x0 - reach, x1 + reach + 1))
        low, high = (int(np.clip(value, 0, rows)) for value in (y0 - reach, y1 + reach + 1))
        if left >= right or low >= high:
            return
        x, y = np.meshgrid((np.arange(left, right) + 0.5) * side, (np.arange(low, high) + 0.5) * side)
        is_hit = shapely.distance(shapely.points(x, y), local) <= radius
        data = grid.data.copy()
        data[low:high, left:right][is_hit] = OCCUPIED if is_obstacle else FREE
        self._replace(GridMap(data, side, grid.origin, grid.name, percent=True, thresholds=grid.thresholds))

    def _draw_polygons(self, line: shapely.Geometry, radius: float, is_obstacle: bool) -> None:
        assert isinstance(self.map, PolygonMap)
        brush = line.buffer(radius, quad_segs=4)
        free = self.map.free
        free = free.difference(brush) if is_obstacle else free.union(brush.intersection(self._erasable))
        polygons = [part for part in shapely.get_parts(free) if part.geom_type == "Polygon"]
        self._replace(PolygonMap(shapely.MultiPolygon(polygons) if len(polygons) != 1 else polygons[0], name=self.map.name))

    def _replace(self, changed: Map) -> None:
        """Take another map; what the two have in common need not be computed again."""
        world, self.map = self._world, changed
        self._world = world.updated(changed) if world and type(world.map) is type(changed) else None

    def world(self, vehicle: Vehicle, allow_unknown: bool) -> World:
        """Return the map, prepared for a vehicle."""
        known = self._world
        if known is None or known.allow_unknown != allow_unknown:
            self._world = prepare(self.map, vehicle, allow_unknown)
        elif known.vehicle != vehicle:
            self._world = known.for_vehicle(vehicle)
        assert self._world is not None
        return self._world


def _geojson(free: shapely.Geometry | None) -> str:
    """Return the free space as the bounds of a GeoJSON document; its holes are the obstacles."""
    feature = {"type": "Feature", "properties": {"role": "bounds"}, "geometry": json.loads(shapely.to_geojson(free))}
    return json.dumps({"type": "FeatureCollection", "features": [feature]})
