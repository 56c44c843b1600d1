"""Free space as polygons from the text of a GeoJSON or WKT file."""

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import shapely

from ..text import quoted
from .errors import MapError
from .free_space import MAX_COORDINATE, check_size, doubt_about_outside, free_space, valid
from .json import RepeatedKey, load_unique
from .model import PolygonMap

#: Size of a map below which its coordinates may be degrees, and how many times further from (0, 0) it is then, at least.
_SIZE_IN_DEGREES, _TIMES_FURTHER = 0.5, 20
_POLYGONS = ("Polygon", "MultiPolygon")
#: The names of coordinate reference systems that drawing programs write: what is odd about coordinates in them.
_ODD_CRS = {re.compile(rf"\b({names})\b", re.IGNORECASE): odd for names, odd in (
    (r"CRS:?84|EPSG:.*\b4326", "whose coordinates are degrees"),
    (r"EPSG:.*\b(3857|3785|900913)", "in which a metre on the ground is 1 / cos(latitude) long"))}


def parse_geojson(text: str, name: str) -> PolygonMap:
    """Read the free space of a GeoJSON FeatureCollection in metres: the bounds less the union of the obstacles.

    The one feature with the property `"role": "bounds"` is the bounds, every other an obstacle; a hole of an obstacle
    is free. A lone Feature is a collection of one. Members that GeoJSON does not define are ignored. Coordinates
    that look like degrees are refused; obstacles outside of the bounds and a crs that is not in metres are doubted.

    Raises:
        MapError: the text is no such collection, or a ring is not valid; names the feature and the ring.
    """
    bounds: list[tuple[str, shapely.Geometry]] = []
    obstacles: list[tuple[str, shapely.Geometry]] = []
    document = _parse_json(text)
    for number, feature in enumerate(_features(document), 1):
        label = _label(number, feature)
        geometry = _geometry(feature, label)
        is_bounds = _properties(feature).get("role") == "bounds"
        (bounds if is_bounds else obstacles).append((label, geometry))
    if len(bounds) != 1:
        found = ", ".join(label for label, _ in bounds[:5]) or _likely_bounds(document) or "none"
        raise MapError(f'{len(bounds)} features have the property "role": "bounds" ({found}); mark exactly one so')
    _refuse_degrees(bounds[0][1], bounds[0][0])
    labels, shapes = [label for label, _ in obstacles], [geometry for _, geometry in obstacles]
    doubts = doubt_about_outside(bounds[0][1], shapes, labels), _doubt_about_crs(document)
    return PolygonMap(free_space(bounds[0][1], shapes, "features"), name=name, known_valid=True,
                      warnings=tuple(filter(None, doubts)))


def parse_wkt(text: str, name: str) -> PolygonMap:
    """Read the free space of a WKT file: one Polygon or MultiPolygon in metres; heights are dropped.

    Raises:
        MapError: the text is no such geometry, or the geometry is not valid.
    """
    # GEOS recurses into nested collections without a limit, so they must not get there.
    if not re.match(r"\s*(MULTI)?POLYGON\b", text, re.IGNORECASE):
        start = quoted(text.strip())
        raise MapError(f"geometry begins with {start}; give one POLYGON or MULTIPOLYGON, the free space")
    # GEOS 3.11 ignores what follows the geometry.
    rest = re.search(r"\)\s*([^\s,)].*)", text)
    if rest:
        raise MapError(f"geometry is followed by {quoted(rest[1])}; give one only, as a MULTIPOLYGON if need be")
    try:
        with np.errstate(all="ignore"):
            free = shapely.force_2d(shapely.from_wkt(text))
    except shapely.GEOSException as error:
        raise MapError(f"geometry is no valid WKT ({error}); correct the text") from None
    coordinates = shapely.get_coordinates(free)
    bad = coordinates[~(np.abs(coordinates) <= MAX_COORDINATE)]
    if bad.size:
        allowed = f"metres from {-MAX_COORDINATE:g} to {MAX_COORDINATE:g}"
        raise MapError(f"geometry has the coordinate {bad[0]}; give {allowed}")
    if shapely.is_empty(valid(free, "geometry")):
        raise MapError("geometry is empty; give a polygon with an area")
    _refuse_degrees(free, "geometry")
    return PolygonMap(free, name=name, known_valid=True)


def _refuse_degrees(bounds: shapely.Geometry, label: str) -> None:
    """Refuse bounds that are those of a place on the globe, in degrees: small, and far from (0, 0)."""
    west, south, east, north = shapely.bounds(bounds).tolist()
    size = max(east - west, north - south)
    on_globe = max(abs(west), abs(east)) <= 180 and max(abs(south), abs(north)) <= 90
    if on_globe and size < _SIZE_IN_DEGREES and math.hypot(west, south) > _TIMES_FURTHER * size:
        raise MapError(f"{label} is {east - west:.2g} x {north - south:.2g} large and around ({(west + east) / 2:.6g}, "
                       f"{(south + north) / 2:.6g}): these look like degrees; give metres, as of a projection such as UTM")


def _likely_bounds(document: Any) -> str:
    """Return which feature was likely meant as the bounds and what it has, in words; "" where there is none."""
    for number, feature in enumerate(_features(document), 1):
        for key, value in {**feature, **_properties(feature)}.items():
            if key != "properties" and (key.strip().lower() == "role" or "bound" in f"{key} {value}".lower()):
                return f"{_label(number, feature)} has {quoted(key)}: {quoted(value)}"
    return ""


def _doubt_about_crs(document: Any) -> str:
    """Return that the coordinates are no metres by what the file says of them, in words; "" where it does not."""
    crs = document.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else crs
    odd = [words for pattern, words in _ODD_CRS.items() if isinstance(name, str) and pattern.search(name)]
    return f"its crs is {quoted(name)}, {odd[0]}, and they are taken as metres; leave crs out if they are" if odd else ""


def _parse_json(text: str) -> Any:
    try:
        return load_unique(text)
    except RecursionError:
        raise MapError("JSON is nested too deep; give a FeatureCollection of polygons") from None
    except RepeatedKey as error:
        raise MapError(str(error)) from None
    except ValueError as error:
        raise MapError(f"is no valid JSON ({error}); correct the text") from None


def _features(document: Any) -> list[Any]:
    kind = document.get("type") if isinstance(document, dict) else None
    if kind == "Feature":
        return [document]
    if kind != "FeatureCollection":
        raise MapError(f"type is {quoted(kind)}; give a FeatureCollection")
    features = document.get("features")
    if not isinstance(features, list):
        raise MapError(f"features is {quoted(features)}; give a list of features")
    return features


def _properties(feature: Any) -> dict[str, Any]:
    properties = feature.get("properties") if isinstance(feature, dict) else None
    return properties if isinstance(properties, dict) else {}


def _label(number: int, feature: Any) -> str:
    properties = _properties(feature)
    outer = feature.get("id") if isinstance(feature, dict) else None
    candidates = (properties.get("name"), properties.get("id"), outer)
    name = next((c for c in candidates if isinstance(c, str | int | float)), None)
    return f"feature {number}" if name is None else f"feature {number} ({quoted(name)})"


def _geometry(feature: Any, label: str) -> shapely.Geometry:
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise MapError(f"{label} is {quoted(feature)}; give an object with the type Feature")
    geometry = feature.get("geometry")
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(geometry, dict) or kind not in _POLYGONS:
        raise MapError(f"{label}: geometry has the type {quoted(kind)}; give a Polygon or MultiPolygon")
    coordinates = geometry.get("coordinates")
    if not isinstance(coordinates, list) or not coordinates:
        raise MapError(f"{label}: coordinates is {quoted(coordinates)}; give a list of rings")
    if kind == "Polygon":
        return _polygon(coordinates, label)
    polygons = [_polygon(rings, f"{label}, polygon {i}") for i, rings in enumerate(coordinates, 1)]
    return valid(shapely.MultiPolygon(polygons), label)


def _polygon(rings: Any, label: str) -> shapely.Polygon:
    if not isinstance(rings, list) or not rings:
        raise MapError(f"{label}: coordinates is {quoted(rings)}; give a list of rings")
    named = {f"{label}, ring {i}": ring for i, ring in enumerate(rings, 1)}
    shell, *holes = made = [_ring(ring, name) for name, ring in named.items()]
    polygon = shapely.Polygon(shell, holes)
    if not shapely.is_valid(polygon):  # which looks at the rings too, and may take seconds for each
        for name, ring in zip(named, made, strict=True):
            valid(ring, name)
        valid(polygon, label)
    return polygon


def _ring(ring: Any, label: str) -> shapely.LinearRing:
    if not isinstance(ring, list) or len(ring) < 4:
        count = f"has {len(ring)} positions" if isinstance(ring, list) else f"is {quoted(ring)}"
        raise MapError(f"{label} {count}; give at least 4, the last like the first")
    positions = list(_positions(ring, label))
    if positions[0] != positions[-1]:
        ends = f"{positions[0]} to {positions[-1]}"
        raise MapError(f"{label} is not closed ({ends}); repeat its first position as the last")
    made = shapely.LinearRing(positions)
    check_size(made, label)
    return made


def _positions(ring: list[Any], label: str) -> Iterator[tuple[float, float]]:
    for number, position in enumerate(ring, 1):
        if not isinstance(position, list) or len(position) < 2 or not all(map(_is_coordinate, position[:2])):
            allowed = f"two numbers of metres from {-MAX_COORDINATE:g} to {MAX_COORDINATE:g}"
            raise MapError(f"{label}: position {number} is {quoted(position)}; give {allowed}")
        yield float(position[0]), float(position[1])


def _is_coordinate(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= MAX_COORDINATE
