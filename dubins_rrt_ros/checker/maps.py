"""Read maps and decide from pixels and polygons what is an obstacle, by the checker's own code."""

import hashlib
import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
import yaml
from PIL import Image

#: Occupancy [%] up to which a cell is free, and from which it is occupied; between them it is unknown, as -1 is.
FREE_UP_TO, OCCUPIED_FROM, UNKNOWN = 25, 65, -1


class UnreadableMap(Exception):
    """A map that the checker cannot read."""


class World(NamedTuple):
    """The obstacles of a map, in its own frame; all that is outside of the map is an obstacle, too.

    Attributes:
        description: what a certificate says of the map.
        origin: x, y [m] and yaw [rad] of the map's own frame in that of the poses.
        size: the largest coordinate [m], by which rounding is judged.
        parts: rectangles of occupied cells, or the edges of polygons.
        free: the free space, of polygons alone.
    """

    description: dict[str, Any]
    origin: tuple[float, float, float]
    size: float
    parts: shapely.STRtree
    free: shapely.Geometry | None

    def own(self, pose: Any) -> tuple[float, float, float]:
        """Return a pose (x, y, heading) in the map's own frame."""
        x, y, yaw = (at - own for at, own in zip(pose, self.origin, strict=True))
        c, s = math.cos(self.origin[2]), math.sin(self.origin[2])
        return (c * x + s * y, c * y - s * x, yaw)

    def touched(self, shapes: np.ndarray, distance: np.ndarray | float) -> np.ndarray:
        """Return the indices of shapes that come nearer than a distance [m] to an obstacle, or begin in one."""
        found = self.parts.query(shapes, "dwithin", distance)[0]
        if self.free is not None:
            first = shapely.get_coordinates(shapely.get_geometry(shapely.extract_unique_points(shapes), 0))
            found = np.union1d(found, np.flatnonzero(~shapely.contains_xy(self.free, first)))
        return np.asarray(found)

    def clearances(self, points: np.ndarray, most: float) -> np.ndarray:
        """Return the distances [m] of (n, 2) points to the obstacles; infinite beyond `most`."""
        found = np.full(len(points), np.inf)
        (index, _), distance = self.parts.query_nearest(shapely.points(points), most, return_distance=True)
        found[index] = distance
        if self.free is not None:
            found[~shapely.contains_xy(self.free, points)] = 0
        return found


def read_map(path: str | Path, allow_unknown: bool) -> World:
    """Read a map: a map_server YAML file, or polygons as GeoJSON or WKT.

    Raises:
        UnreadableMap, OSError: it cannot be read.
    """
    path = Path(path)
    try:
        if path.suffix in (".yaml", ".yml"):
            return _grid(yaml.safe_load(path.read_text("utf-8")), path.parent, allow_unknown)
        if path.suffix in (".json", ".geojson", ".wkt"):
            return _polygons(_free_space(path))
    except (KeyError, TypeError, ValueError, AttributeError, yaml.YAMLError, shapely.GEOSException) as error:
        raise UnreadableMap(f"{path}: {type(error).__name__}: {error}") from None
    raise UnreadableMap(f"{path} states no thresholds; give a map_server YAML file of it, or polygons as GeoJSON or WKT")


def _grid(fields: dict[str, Any], folder: Path, allow_unknown: bool) -> World:
    rules: dict[str, Any] = {name: float(fields[name]) for name in ("occupied_thresh", "free_thresh")}
    rules |= {"mode": str(fields.get("mode", "trinary")).lower(), "negate": str(fields["negate"]).lower() in ("1", "true")}
    cells = _occupancies(*_pixels(folder / fields["image"]), **rules)[::-1]  # a picture begins with the row at the top
    blocked = cells >= OCCUPIED_FROM if allow_unknown else (cells > FREE_UP_TO) | (cells == UNKNOWN)
    (height, width), side, (x, y, yaw) = cells.shape, float(fields["resolution"]), map(float, fields["origin"])
    description = {"sha256": digest_of_cells(cells.astype(np.int8)), "width": width, "height": height, "resolution": side,
                   "origin": [x, y, yaw], **rules}
    size = side * max(height, width) + abs(x) + abs(y)
    return World(description, (x, y, yaw), size, shapely.STRtree(_rectangles(blocked, side)), None)


def digest_of_cells(cells: np.ndarray) -> str:
    """Return the SHA-256 of the int8 occupancies of a grid, the lowest row first."""
    return hashlib.sha256(repr(cells.shape).encode() + cells.tobytes()).hexdigest()


def _pixels(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return brightness (0 to 255) and transparency of the pixels of an image."""
    with Image.open(path) as image:
        if image.mode not in ("1", "L", "LA", "P", "RGB", "RGBA"):
            raise ValueError(f"{path.name} has pixels of the mode {image.mode}; save it with 8 bits")
        clear = np.asarray(image.convert("RGBA").getchannel("A")) < 255
        return np.asarray((image.convert("RGBA") if image.mode == "P" else image).convert("L"), dtype=np.int32), clear


def _occupancies(grey: np.ndarray, clear: np.ndarray, mode: str, negate: bool, occupied_thresh: float,
                 free_thresh: float) -> np.ndarray:
    """Return the occupancy [%] of pixels, -1 where it is unknown, by the rules of map_server."""
    if mode == "raw":
        return np.where(grey <= 100, grey, UNKNOWN)
    if mode not in ("trinary", "scale"):
        raise ValueError(f"the mode {mode} is not known")
    shade = grey.astype(np.float32) / np.float32(255)
    dark, low, high = shade if negate else 1 - shade, np.float32(free_thresh), np.float32(occupied_thresh)
    between = np.floor((dark - low) / np.float32(occupied_thresh - free_thresh) * np.float32(100) + 0.5)
    cells = np.where(dark >= high, 100, between if mode == "scale" else UNKNOWN)
    return np.where(clear, UNKNOWN, np.where(dark <= low, 0, cells)).astype(np.int32)


def _rectangles(blocked: np.ndarray, side: float) -> np.ndarray:
    """Return rectangles that cover the blocked cells, one for each run in a row, and the outside of the map."""
    edges = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (rows, begins), (_, ends) = np.nonzero(edges == 1), np.nonzero(edges == -1)
    height, width, far = *blocked.shape, 10 * sum(blocked.shape)
    outside = [[-far, width, -far, -far], [-far, -far, -far, height], [0, far, far, far], [far, far, 0, far]]
    return np.asarray(shapely.box(*(side * np.hstack([outside, [begins, rows, ends, rows + 1]]))))


def _free_space(path: Path) -> shapely.Geometry:
    """Return the free space of polygons: those of a WKT file, or the bounds of a GeoJSON file less its obstacles."""
    if path.suffix == ".wkt":
        return shapely.force_2d(shapely.from_wkt(path.read_text("utf-8")))
    document = json.loads(path.read_text("utf-8"))
    shapes: dict[bool, list[shapely.Geometry]] = {True: [], False: []}
    for feature in document["features"] if document["type"] == "FeatureCollection" else [document]:
        is_bounds = (feature.get("properties") or {}).get("role") == "bounds"
        shapes[is_bounds].append(shapely.force_2d(shapely.from_geojson(json.dumps(feature["geometry"]))))
    if len(shapes[True]) != 1:
        raise ValueError("it has not one feature with the role bounds")
    return shapely.difference(shapes[True][0], shapely.union_all(shapes[False]))


def _polygons(free: shapely.Geometry) -> World:
    if not shapely.is_valid(free) or shapely.is_empty(free) or shapely.get_type_id(free) not in (3, 6):
        raise ValueError("the free space is no valid polygon")
    ends, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(free)), return_index=True)
    edges = shapely.linestrings(np.stack([ends[:-1], ends[1:]], axis=1)[ring[:-1] == ring[1:]])
    shapely.prepare(free)
    digest = hashlib.sha256(shapely.to_wkb(shapely.normalize(free), byte_order=1)).hexdigest()
    return World({"sha256": digest}, (0.0, 0.0, 0.0), float(np.abs(ends).max()), shapely.STRtree(edges), free)
