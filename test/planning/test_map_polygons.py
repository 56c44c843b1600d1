"""GeoJSON and WKT: what is free, and that every bad ring is named and refused."""

import json

import numpy as np
import pytest
import shapely

from dubins_rrt_ros.planning.maps.errors import MapError
from dubins_rrt_ros.planning.maps.model import PolygonMap
from dubins_rrt_ros.planning.maps.polygons import parse_geojson, parse_wkt

SQUARE = [[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]]
POST = [[4, 4], [6, 4], [6, 6], [4, 6], [4, 4]]


def feature(rings, kind="Polygon", **properties):
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": rings}}


BOUNDS = feature([SQUARE], role="bounds", name="yard")


def collection(*features):
    return json.dumps({"type": "FeatureCollection", "features": features})


def free_space(*features):
    return parse_geojson(collection(*features), "yard.geojson").free


def test_free_space_is_the_bounds_less_the_obstacles():
    corner = [[9, 9], [12, 9], [12, 12], [9, 12], [9, 9]]
    yard = parse_geojson(collection(feature([POST], name="post"), BOUNDS, feature([corner])), "yard.geojson")
    assert isinstance(yard, PolygonMap)
    assert yard.name == "yard.geojson"
    assert yard.free.area == pytest.approx(100 - 4 - 1)
    assert not shapely.intersects_xy(yard.free, 5, 5)


def test_a_hole_in_an_obstacle_is_free():
    hole = [[4.5, 4.5], [5.5, 4.5], [5.5, 5.5], [4.5, 5.5], [4.5, 4.5]]
    free = free_space(BOUNDS, feature([POST, hole]))
    assert free.area == pytest.approx(100 - 4 + 1)
    assert shapely.intersects_xy(free, 5, 5)


def test_a_hole_in_the_bounds_is_occupied():
    assert free_space(feature([SQUARE, POST], role="bounds")).area == pytest.approx(96)


def test_multipolygons_overlaps_and_heights():
    far = [[x + 20, y, 7.5] for x, y in SQUARE]
    bounds = feature([[SQUARE], [far]], "MultiPolygon", role="bounds")
    shifted = [[x + 1, y] for x, y in POST]
    assert free_space(bounds, feature([POST]), feature([shifted])).area == pytest.approx(194)


def test_a_lone_feature_and_unknown_members():
    assert parse_geojson(json.dumps({**BOUNDS, "start": [1, 2, 3], "bbox": None}), "m").free.area == pytest.approx(100)


def test_any_other_role_and_missing_properties_are_obstacles():
    bare = {"type": "Feature", "properties": None, "geometry": feature([POST])["geometry"]}
    assert free_space(BOUNDS, bare).area == free_space(BOUNDS, feature([POST], role="Bounds")).area == pytest.approx(96)


TIE = [[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]


def triangle(second):
    return feature([[[0, 0], second, [1, 1], [0, 0]]])


@pytest.mark.parametrize("text, words", [
    ("{", ["JSON"]), ("[" * 100000, ["JSON"]), ("1" * 5000, ["JSON"]), ("[]", ["type"]), ("null", ["type"]),
    ('{"type": "Polygon", "coordinates": []}', ["type", "Polygon"]),
    ('{"type": "FeatureCollection"}', ["features"]), ('{"type": "FeatureCollection", "features": {}}', ["features"]),
    (collection(), ["0 features", "bounds"]), (collection(feature([POST])), ["0 features", "bounds"]),
    (collection(BOUNDS, BOUNDS), ["2 features", "bounds", "feature 1 ('yard'), feature 2 ('yard')"]),
])
def test_bad_collection(text, words):
    check_refusal(text, words)


@pytest.mark.parametrize("second, words", [
    (7, ["feature 2"]), ({"type": "Polygon"}, ["feature 2", "Feature"]),
    ({"type": "Feature", "id": "t9", "geometry": None}, ["feature 2 ('t9')", "geometry"]),
    (feature([0, 0], "Point", name="lamp"), ["feature 2 ('lamp')", "Point"]),
    (feature([], name="tree"), ["feature 2 ('tree')", "coordinates"]),
    (feature(5), ["coordinates"]), (feature({}), ["coordinates"]),
    (feature([[]]), ["feature 2, ring 1", "0 positions"]),
    (feature([POST[:3]]), ["ring 1", "3 positions"]), (feature(["abcde"]), ["ring 1", "abcde"]),
    (feature([POST[:-1]], id=4), ["feature 2 (4), ring 1", "not closed"]),
    (feature([TIE], name="tie"), ["feature 2 ('tie'), ring 1", "Self-intersection"]),
    (feature([[[1, 1]] * 5]), ["ring 1", "not valid"]), (feature([SQUARE, POST[:-1]]), ["ring 2", "not closed"]),
    (feature([SQUARE, TIE]), ["ring 2", "Self-intersection"]), (feature([POST, SQUARE]), ["feature 2", "not valid"]),
    (feature([[SQUARE], [POST]], "MultiPolygon"), ["feature 2", "not valid"]),
    (feature([[POST], [SQUARE[:2]]], "MultiPolygon"), ["polygon 2, ring 1", "2 positions"]),
    (feature([[POST], 3], "MultiPolygon"), ["polygon 2", "coordinates"]),
    (triangle([1, float("nan")]), ["feature 2, ring 1: position 2", "nan"]),
    (triangle([1, float("inf")]), ["position 2", "inf"]), (triangle([1, -1e10]), ["position 2", "-10000000000.0"]),
    (triangle([1, "2"]), ["position 2", "'2'"]), (triangle([1, True]), ["position 2", "True"]),
    (triangle([1]), ["position 2"]),
    (triangle([1, 10**400]), ["position 2"]), (triangle(None), ["position 2", "None"]),
    (feature([SQUARE]), ["features", "no free space"]),
])
def test_bad_feature(second, words):
    check_refusal(collection(BOUNDS, second), words)


@pytest.mark.parametrize(("meant", "said"), [
    (feature([SQUARE], role="Bounds", name="yard"), "(feature 1 ('yard') has 'role': 'Bounds')"),
    (feature([SQUARE], Role="boundary"), "(feature 1 has 'Role': 'boundary')"),
    ({**feature([SQUARE]), "role": "bounds"}, "(feature 1 has 'role': 'bounds')"), (feature([SQUARE]), "(none)")])
def test_bounds_that_were_marked_otherwise_are_named(meant, said):
    check_refusal(collection(meant, feature([POST])), ["0 features", said])


@pytest.mark.parametrize(("crs", "said"), [
    ("EPSG:4326", "are degrees"), ({"properties": {"name": "urn:ogc:def:crs:EPSG::4326"}}, "are degrees"),
    ("EPSG:3857", "1 / cos(latitude)"), ({"properties": {"name": "urn:ogc:def:crs:EPSG::900913"}}, "1 / cos(latitude)"),
    ("EPSG:32632", ""), ({"properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}, ""), (None, ""), (4326, "")])
def test_a_crs_that_is_not_in_metres_is_doubted(crs, said):
    document = {"type": "FeatureCollection", "crs": crs, "features": [BOUNDS]}
    warnings = parse_geojson(json.dumps(document), "yard.geojson").warnings
    assert len(warnings) == bool(said) and said in "".join(warnings)


def check_refusal(text, words):
    with pytest.raises(MapError) as caught:
        parse_geojson(text, "bad.geojson")
    message = str(caught.value)
    assert [word for word in words if word not in message] == []
    assert any(remedy in message.split("; ")[-1] for remedy in ("give", "correct", "mend", "mark", "repeat", "move", "unite"))


def bars(count, upright):
    """As many obstacles, each across all of the others way."""
    rings = [[[i, -1], [i + 0.5, -1], [i + 0.5, count], [i, count], [i, -1]] for i in range(count)]
    return [feature([ring if upright else [[y, x] for x, y in ring]]) for ring in rings]


def test_obstacles_that_cross_often_are_united_up_to_a_limit():
    far = feature([[[-9, -9], [900, -9], [900, 900], [-9, 900], [-9, -9]]], role="bounds")
    crossed = free_space(far, *bars(90, True), *bars(90, False))
    assert crossed.area == pytest.approx(909**2 - 2 * 90 * 45.5 + 90**2 / 4)
    check_refusal(collection(far, *bars(400, True), *bars(400, False)), ["features: more than", "edges may cross; unite"])


@pytest.mark.parametrize("text, area", [
    ("POLYGON ((0 0, 10 0, 10 10, 0 10, 0 0), (4 4, 6 4, 6 6, 4 6, 4 4))", 96),
    ("\n multipolygon z (((0 0 1, 1 0 1, 1 1 1, 0 0 1)), ((2 0 1, 3 0 1, 3 1 1, 2 0 1)))\n", 1),
])
def test_wkt(text, area):
    yard = parse_wkt(text, "yard.wkt")
    assert (yard.name, yard.free.area, shapely.has_z(yard.free)) == ("yard.wkt", area, False)


@pytest.mark.parametrize("text, word", [
    ("POINT (0 0)", "POINT"), ("hello", "hello"), ("LINESTRING (0 0, 1 1)", "POLYGON"),
    ("GEOMETRYCOLLECTION (" * 9000, "POLYGON"), ("POLYGON", "valid"), ("POLYGON EMPTY", "empty"),
    ("MULTIPOLYGON EMPTY", "empty"), ("POLYGON ((0 0, 1 0, 1 1))", "valid"),
    ("POLYGON ((0 0, 1 0, 1 1, 0 1))", "closed"), ("POLYGON ((0 0, 2e9 0, 1 1, 0 0))", "2000000000.0"),
    ("POLYGON ((0 0, 1 0", "valid"), ("POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))", "Self-intersection"),
    ("POLYGON ((0 0, nan 0, 1 1, 0 0))", "nan"), ("POLYGON ((0 0, inf 0, 1 1, 0 0))", "inf"),
    ("POLYGON ((0 0, 1 x, 1 1, 0 0))", "valid"),
    ("POLYGON ((0 0, 9 0, 9 9, 0 0)) POLYGON ((0 0, 9 0, 9 9, 0 0))", "followed by 'POLYGON"),
    ("POLYGON ((0 0, 9 0, 9 9, 0 0)) ((0 0, 9 0, 9 9, 0 0))", "followed by '(("),
    ("POLYGON ((0 0, 9 0, 9 9, 0 0));", "followed by ';'"),
    ("MULTIPOLYGON (((0 0, 9 0, 9 9, 0 0)), ((0 0, 9 0, 9 9, 0 0)))", "not valid"),
])
def test_bad_wkt(text, word):
    with pytest.raises(MapError) as caught:
        parse_wkt(text, "bad.wkt")
    message = str(caught.value)
    assert message.startswith("geometry ")
    assert word in message
    assert any(remedy in message.split("; ")[-1] for remedy in ("give", "correct", "mend"))


def garden(x, y, width, height):
    return [[x, y], [x + width, y], [x + width, y + height], [x, y + height], [x, y]]


@pytest.mark.parametrize("ring", [
    garden(8.6, 50.1, 0.0003, 0.0002), garden(-122.42, 37.77, 0.01, 0.3), garden(151.2, -33.9, 0.4, 0.4)])
def test_coordinates_in_degrees_are_refused(ring):
    wkt = f"POLYGON (({', '.join(f'{x} {y}' for x, y in ring)}))"
    for read in (lambda: free_space(feature([ring], role="bounds", name="garden")), lambda: parse_wkt(wkt, "garden.wkt")):
        with pytest.raises(MapError, match="these look like degrees; give metres"):
            read()


@pytest.mark.parametrize("ring", [
    garden(0, 0, 0.3, 0.3), garden(-0.1, -0.1, 0.2, 0.2), garden(8.6, 50.1, 0.6, 0.4), garden(476000, 5550000, 0.2, 0.2)])
def test_small_maps_and_far_ones_in_metres_are_taken(ring):
    assert free_space(feature([ring], role="bounds")).area > 0


@pytest.mark.parametrize("height", ["1e-300", "1e-9", "9e-4"])
def test_a_sliver_is_refused(height):
    with pytest.raises(MapError, match="sliver.wkt: the free space is 20 m x .* too thin for any vehicle; give metres"):
        parse_wkt(f"POLYGON ((0 0, 20 0, 20 {height}, 0 {height}, 0 0))", "sliver.wkt")


def test_polygons_of_too_many_vertices_are_refused_before_they_are_checked():
    angle = np.linspace(0, 2 * np.pi, 500_000, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    with pytest.raises(MapError, match="vertices; simplify the polygons to 500000"):
        PolygonMap(shapely.Polygon(ring))


@pytest.mark.parametrize("old, new, key", [
    ('"coordinates": [[[4', '"coordinates": [[[1, 1], [2, 1], [2, 2], [1, 1]]], "coordinates": [[[4', "coordinates"),
    ('"role": "bounds"', '"role": "obstacle", "role": "bounds"', "role"),
    ('"features"', '"features": [], "features"', "features")],
    ids=["coordinates", "role", "features"])
def test_a_key_that_an_object_has_twice_is_refused(old, new, key):
    text = collection(BOUNDS, feature([POST]))
    assert text.count(old) == 1
    with pytest.raises(MapError, match=f'an object has "{key}" 2 times; give it once'):
        parse_geojson(text.replace(old, new), "yard.geojson")
