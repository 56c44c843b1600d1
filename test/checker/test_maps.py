"""The checker's own reading of maps gives the same obstacles as the library's, whose code it does not share."""

import math

import numpy as np
import pytest
import shapely
from PIL import Image
from support.images import saved
from support.map_files import yaml_of

from dubins_rrt_ros.checker.maps import UnreadableMap, digest_of_cells, read_map
from dubins_rrt_ros.planning import load_map

FIELDS = {"image": "map.png", "resolution": 0.5, "origin": "[1, -2, 0.5]", "negate": 0, "occupied_thresh": 0.65,
          "free_thresh": 0.196}
RAMP = np.add.outer(np.arange(0, 252, 21), np.arange(0, 18, 3)).astype(np.uint8)
PLOT = ('{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"role": "bounds"}, "geometry": '
        '{"type": "Polygon", "coordinates": [[[0, 0], [9, 0], [9, 6], [0, 6], [0, 0]]]}}, '
        '{"type": "Feature", "properties": null, "geometry": '
        '{"type": "Polygon", "coordinates": [[[4, 2], [6, 2], [6, 4], [4, 4], [4, 2]]]}}]}')


def colours(mode):
    """An image of a mode, with greys or colours, and a clear part where there can be one."""
    red, green, blue = RAMP, RAMP[::-1], np.roll(RAMP, 3, axis=0)
    alpha = np.where(np.arange(len(RAMP)) < 9, 255, 90)[:, None] * np.ones(RAMP.shape, int)
    layers = {"L": [RAMP], "LA": [RAMP, alpha], "RGB": [red, green, blue], "RGBA": [red, green, blue, alpha]}.get(mode)
    if layers:
        return Image.merge(mode, [Image.fromarray(layer.astype(np.uint8)) for layer in layers])
    if mode == "1":
        return Image.fromarray(RAMP).convert("1")
    image = Image.fromarray(RAMP % 4)
    image.putpalette([0, 0, 0, 255, 255, 255, 205, 205, 205, 90, 180, 20])
    image.info["transparency"] = 3
    return image


def written(folder, image, **changes):
    (folder / "map.png").write_bytes(saved(image))
    (folder / "map.yaml").write_text(yaml_of({**FIELDS, **changes}))
    return folder / "map.yaml"


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "1"])
@pytest.mark.parametrize("rules", [{}, {"mode": "scale"}, {"mode": "raw"}, {"negate": 1}, {"negate": 1, "mode": "Scale"},
                                   {"occupied_thresh": 0.9, "free_thresh": 0.4}], ids=str)
def test_cells_are_those_of_the_library(mode, rules, tmp_path):
    file = written(tmp_path, colours(mode), **rules)
    grid, world = load_map(file), read_map(file, False)
    description = world.description
    assert description["sha256"] == digest_of_cells(grid.data) and description["origin"] == list(grid.origin)
    assert (description["height"], description["width"], description["resolution"]) == (*grid.data.shape, grid.resolution)
    assert (description["mode"], description["negate"]) == (str(rules.get("mode", "trinary")).lower(), rules.get("negate") == 1)
    assert [description[name] for name in ("occupied_thresh", "free_thresh")] == [
        rules.get(name, FIELDS[name]) for name in ("occupied_thresh", "free_thresh")]
    assert world.size == 0.5 * 12 + 3
    for allowed in (False, True):
        data = grid.data.astype(int)
        judge_obstacles(read_map(file, allowed), data >= 65 if allowed else (data > 25) | (data < 0), 0.5)


def judge_obstacles(world, blocked, side):
    """The world's clearances are those of the blocked cells, and of what is outside of the map."""
    points = np.random.default_rng(0).uniform(-1, 7, (60, 2))
    padded = np.pad(blocked, 40, constant_values=True)
    y, x = (np.argwhere(padded) - 40).T * side
    off = [np.maximum(0, np.maximum(low - points[:, [axis]], points[:, [axis]] - low - side)) for axis, low in ((0, x), (1, y))]
    least = np.hypot(*off).min(axis=1)
    assert world.clearances(points, np.inf) == pytest.approx(least)
    near = world.clearances(points, 0.3)
    assert (near == np.where(least <= 0.3, near, np.inf)).all() and (least[near < np.inf] <= 0.3).all()
    hit = world.touched(shapely.points(points), 0.2)
    assert set(hit.tolist()) == set(np.flatnonzero(least < 0.2).tolist())


def test_polygons_are_those_of_the_library(tmp_path):
    (tmp_path / "plot.geojson").write_text(PLOT)
    (tmp_path / "plot.wkt").write_text("POLYGON Z ((0 0 1, 9 0 1, 9 6 1, 0 6 1, 0 0 1), (4 2 1, 6 2 1, 6 4 1, 4 4 1, 4 2 1))")
    worlds = [read_map(tmp_path / name, False) for name in ("plot.geojson", "plot.wkt")]
    assert worlds[0].description == worlds[1].description and len(worlds[0].description["sha256"]) == 64
    points = np.random.default_rng(1).uniform(-1, 10, (200, 2))
    for world in worlds:
        assert shapely.equals(world.free, load_map(tmp_path / "plot.geojson").free)
        assert world.size == 9 and world.origin == (0, 0, 0) and len(world.parts) == 8
        free = shapely.contains_xy(world.free, points)
        least = np.where(free, shapely.distance(world.free.boundary, shapely.points(points)), 0)
        assert world.clearances(points, np.inf) == pytest.approx(least)
        assert set(world.touched(shapely.points(points), 0.5).tolist()) == set(np.flatnonzero(~free | (least < 0.5)).tolist())


def test_poses_are_taken_into_the_map_s_own_frame(tmp_path):
    world = read_map(written(tmp_path, colours("L")), False)
    x, y, heading = world.own((1 + 2 * math.cos(0.5) - math.sin(0.5), -2 + 2 * math.sin(0.5) + math.cos(0.5), 0.7))
    assert (x, y, heading) == pytest.approx((2, 1, 0.2))


@pytest.mark.parametrize(("name", "content", "said"), [
    ("map.png", "", "states no thresholds"), ("map.wkt", "POINT (1 1)", "no valid polygon"),
    ("map.wkt", "POLYGON EMPTY", "no valid polygon"), ("map.wkt", "POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))", "no valid polygon"),
    ("map.wkt", "nonsense", "map.wkt"), ("map.json", "{}", "KeyError"),
    ("map.geojson", PLOT.replace("bounds", "wall"), "has not one feature with the role bounds"),
    ("map.geojson", PLOT.replace("null", '{"role": "bounds"}'), "has not one feature with the role bounds"),
    ("map.yaml", "{}", "KeyError")], ids=["picture", "point", "empty", "crossed", "no WKT", "no GeoJSON",
                                                                  "no bounds", "two bounds", "no fields"])
def test_what_is_no_map_is_refused(name, content, said, tmp_path):
    (tmp_path / name).write_text(content)
    with pytest.raises(UnreadableMap, match=said):
        read_map(tmp_path / name, False)


def test_images_and_modes_that_are_not_known_are_refused(tmp_path):
    with pytest.raises(UnreadableMap, match="save it with 8 bits"):
        read_map(written(tmp_path, Image.new("I;16", (3, 3))), False)
    with pytest.raises(UnreadableMap, match="the mode odd is not known"):
        read_map(written(tmp_path, colours("L"), mode="odd"), False)
