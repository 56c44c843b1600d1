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


class UnreadableMap(ValueError):
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
        x, y, yaw = self.origin
        c, s = math.cos(yaw), math.sin(yaw)
        return (c * (pose[0] - x) + s * (pose[1] - y), c * (pose[1] - y) - s * (pose[0] - x), pose[2] - yaw)

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
        (index, _), distance = self.parts.query_nearest(shapely.points(points), max_distance=most, return_distance=True,
                                                        all_matches=False)
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
    rules: dict[str, Any] = {"mode": str(fields.get("mode", "trinary")).lower(),
                             "negate": str(fields["negate"]).lower() in ("1", "true"),
                             "occupied_thresh": float(fields["occupied_thresh"]), "free_thresh": float(fields["free_thresh"])}
    cells = _occupancies(*_pixels(folder / fields["image"]), **rules)[::-1]  # a picture begins with the row at the top
    blocked = cells >= OCCUPIED_FROM if allow_unknown else (cells > FREE_UP_TO) | (cells == UNKNOWN)
    side, (x, y, yaw) = float(fields["resolution"]), map(float, fields["origin"])
    description = {"sha256": digest_of_cells(cells.astype(np.int8)),
                   "width": cells.shape[1], "height": cells.shape[0], "resolution": side,
                   "origin": [x, y, yaw], **rules}
    size = side * max(cells.shape)
    return World(description, (x, y, yaw), size + abs(x) + abs(y), shapely.STRtree(_rectangles(blocked, side)), None)


def digest_of_cells(cells: np.ndarray) -> str:
    """Return the SHA-256 of the int8 occupancies of a grid, the lowest row first."""
    return hashlib.sha256(repr(cells.shape).encode() + cells.tobytes()).hexdigest()


def _pixels(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return brightness (0 to 255) and transparency of the pixels of an image."""
    with Image.open(path) as image:
        if image.mode not in ("1", "L", "LA", "P", "RGB", "RGBA"):
            raise UnreadableMap(f"{path} has pixels of the mode {image.mode}; save it with 8 bits")
        clear = np.asarray(image.convert("RGBA").getchannel("A")) < 255
        flat = image.convert("RGBA" if image.mode in ("P", "RGBA") else "RGB") if image.mode in ("P", "RGB", "RGBA") else image
        return np.asarray(flat.convert("L"), dtype=np.int32), clear


def _occupancies(grey: np.ndarray, clear: np.ndarray, mode: str, negate: bool, occupied_thresh: float,
                 free_thresh: float) -> np.ndarray:
    """Return the occupancy [%] of pixels, -1 where it is unknown, by the rules of map_server."""
    if mode == "raw":
        return np.where(grey <= 100, grey, UNKNOWN)
    if mode not in ("trinary", "scale"):
        raise UnreadableMap(f"the mode {mode} is not known")
    shade = grey.astype(np.float32) / np.float32(255)
    dark, low, high = shade if negate else 1 - shade, np.float32(free_thresh), np.float32(occupied_thresh)
    between = np.floor((dark - low) / np.float32(occupied_thresh - free_thresh) * np.float32(100) + 0.5)
    cells = np.where(dark >= high, 100, between if mode == "scale" else UNKNOWN)
    return np.where(clear, UNKNOWN, np.where(dark <= low, 0, cells)).astype(np.int32)


def _rectangles(blocked: np.ndarray, side: float) -> np.ndarray:
    """Return rectangles that cover the blocked cells, one for each run in a row, and the outside of the map."""
    edges = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (rows, begins), (_, ends) = np.nonzero(edges == 1), np.nonzero(edges == -1)
    runs = shapely.box(begins * side, rows * side, ends * side, (rows + 1) * side)
    height, width = (side * count for count in blocked.shape)
    far = 10 * (width + height)
    outside = shapely.box([-far, width, -far, -far], [-far, -far, -far, height], [0, far, far, far], [far, far, 0, far])
    return np.concatenate([runs, outside])


def _free_space(path: Path) -> shapely.Geometry:
    """Return the free space of polygons: those of a WKT file, or the bounds of a GeoJSON file less its obstacles."""
    text = path.read_text("utf-8")
    if path.suffix == ".wkt":
        return shapely.force_2d(shapely.from_wkt(text))
    document = json.loads(text)
    features = document["features"] if document["type"] == "FeatureCollection" else [document]
    shapes = [shapely.force_2d(shapely.from_geojson(json.dumps(feature["geometry"]))) for feature in features]
    is_bounds = [(feature.get("properties") or {}).get("role") == "bounds" for feature in features]
    if sum(is_bounds) != 1:
        raise UnreadableMap(f"{path} has not one feature with the role bounds")
    obstacles = [shape for shape, bounds in zip(shapes, is_bounds, strict=True) if not bounds]
    return shapely.difference(shapes[is_bounds.index(True)], shapely.union_all(obstacles))


def _polygons(free: shapely.Geometry) -> World:
    if not shapely.is_valid(free) or shapely.is_empty(free) or shapely.get_type_id(free) not in (3, 6):
        raise UnreadableMap("the free space is no valid polygon")
    ends, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(free)), return_index=True)
    edges = shapely.linestrings(np.stack([ends[:-1], ends[1:]], axis=1)[ring[:-1] == ring[1:]])
    shapely.prepare(free)
    description = {"sha256": hashlib.sha256(shapely.to_wkb(shapely.normalize(free), byte_order=1)).hexdigest()}
    return World(description, (0.0, 0.0, 0.0), float(np.abs(ends).max()), shapely.STRtree(edges), free)
