"""Map files: map_server's fields by Jazzy's rules, pictures and polygons, saving, and the shipped maps."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image
from support.images import pgm, row_of
from support.map_files import FIELDS, image_named, refusal, write_grid, yaml_of

from dubins_rrt_ros.planning import OptionError
from dubins_rrt_ros.planning.maps.errors import MapError, MapMetadataError, MapNotFound
from dubins_rrt_ros.planning.maps.files import load_map
from dubins_rrt_ros.planning.maps.grids import save_map
from dubins_rrt_ros.planning.maps.model import GridMap, PolygonMap, Thresholds, rasterise

MAPS = Path(__file__).parents[2] / "maps"
RED, BLUE, GREEN, YELLOW, WHITE = (255, 0, 0), (0, 0, 255), (0, 255, 0), (255, 255, 0), (255, 255, 255)


def test_first_image_row_is_the_top_of_the_map(tmp_path):
    grid = load_map(write_grid(tmp_path, [[254, 254, 0], [205, 254, 254]]))
    assert isinstance(grid, GridMap)
    assert grid.data.tolist() == [[-1, 0, 0], [0, 0, 100]]
    assert (grid.name, grid.resolution, grid.origin) == ("m.yaml", 0.05, (0, 0, 0))


@pytest.mark.parametrize(("rows", "fields", "said"), [
    ([[0, 1], [1, 1]], {}, "no cell is free: the pixels have a brightness of 0 to 1, of 0 (black) to 255 (white)"),
    ([[0, 100]], {}, "0 to 100"), ([[254, 254]], {"negate": 1}, "negate: 1"), ([[254, 254]], {"mode": "raw"}, "mode raw"),
    ([[0, 254]], {}, ""), ([[0, 100]], {"mode": "raw"}, "")])
def test_a_picture_without_a_free_cell_is_told(rows, fields, said, tmp_path):
    warnings = load_map(write_grid(tmp_path, rows, **fields)).warnings
    assert len(warnings) == bool(said) and said in "".join(warnings)


def test_origin_with_yaw_places_the_cells(tmp_path):
    grid = load_map(write_grid(tmp_path, resolution="1e-1", origin=f"[1, 2, {np.pi / 2!r}]"))
    assert grid.origin == (1, 2, np.pi / 2)
    assert grid.resolution == 0.1
    np.testing.assert_allclose(grid.to_map_frame(np.array([0.3, 0.1])), [0.9, 2.3])


@pytest.mark.parametrize("name", ["maze", "parking.geojson"])
@pytest.mark.parametrize("value", ["9", None, 9.5, 1e6, True, 0, -1, 2**31, float("nan"), [9]])
def test_a_number_of_cells_that_is_none_is_refused(name, value):
    with pytest.raises(OptionError, match=r"^max_map_cells is .*; it takes an integer from 1 to 2147483647: "):
        load_map(name, max_map_cells=value)


def test_a_map_may_be_named_by_a_url(tmp_path):
    file = write_grid(tmp_path)
    assert load_map(f"file://{file}").id == load_map(file).id
    for url, says in (("file://elsewhere/m.yaml", "'elsewhere'"), ("http://example.org/m.yaml", "http://"),
                      (f"file://{tmp_path}/n.yaml", "n.yaml: cannot be read")):
        with pytest.raises(MapNotFound, match=says):
            load_map(url)
    with pytest.raises(MapNotFound, match="is outside of map_directory"):
        load_map(f"file://{file}", map_directory=tmp_path / "maps")


def test_other_arguments_of_the_wrong_type_are_refused_by_name():
    for path in (3, None, b"maze", ["maze"]):
        with pytest.raises(TypeError, match=r"^path is .*; give a text or a pathlib\.Path$"):
            load_map(path)
    for directory in (3, b"maps"):
        with pytest.raises(TypeError, match="^map_directory is "):
            load_map("maze", map_directory=directory)
    with pytest.raises(MapError, match="resolution is '0.1'; leave that out"):
        load_map("maze", resolution="0.1")


def test_a_folder_or_no_name_at_all_is_no_map(tmp_path):
    with pytest.raises(MapNotFound, match=r"is a directory; give the map file in it \(\.yaml, \.geojson, \.wkt\)$"):
        load_map(tmp_path)
    with pytest.raises(MapNotFound, match="^the name of the map is empty; give "):
        load_map("")


@pytest.mark.parametrize(("name", "remedy"), [
    ("m.jpg", "other pictures have to be converted to PNG"), ("m.png", "convert it as one of them"),
    ("m.yaml", "image 'm.jpg' has not the content of a PGM")], ids=["by name", "by content", "in a YAML file"])
def test_a_jpeg_is_to_be_converted(tmp_path, name, remedy):
    Image.new("L", (20, 20), 255).save(tmp_path / "m.jpg")
    if name == "m.png":
        (tmp_path / "m.jpg").rename(tmp_path / name)
    image_named(tmp_path, "m.jpg")
    message = refusal(tmp_path / name, resolution=None if name == "m.yaml" else 0.05)
    assert remedy in message and "give the side of its cells" not in message


@pytest.mark.parametrize("thresh, expected", [("0.25", 0), ("0.196", -1)])
def test_grey_205_is_free_above_its_threshold(tmp_path, thresh, expected):
    assert load_map(write_grid(tmp_path, [[205]], free_thresh=thresh)).data[0, 0] == expected


def test_both_thresholds_are_inclusive(tmp_path):
    path = write_grid(tmp_path, [[0, 1, 254, 255]], occupied_thresh="1.0", free_thresh="0.0")
    assert load_map(path).data.tolist() == [[100, -1, -1, 0]]


@pytest.mark.parametrize("negate, expected", [
    ("0", [100, 0]), ("1", [0, 100]), ("true", [0, 100]), ("False", [100, 0]), ("yes", [0, 100]), ("off", [100, 0])])
def test_negate(tmp_path, negate, expected):
    assert load_map(write_grid(tmp_path, [[0, 255]], negate=negate)).data.tolist() == [expected]


def test_scale_at_values_worked_out_by_hand(tmp_path):
    # 1 - 102/255 = 0.6 is (0.6 - 0.2) / 0.6 = 66.7 % of the way between the thresholds, 1 - 153/255 = 0.4 is 33.3 %.
    path = write_grid(tmp_path, [[0, 40, 102, 153, 215, 255]], mode="Scale", occupied_thresh="0.8", free_thresh="0.2")
    assert load_map(path).data.tolist() == [[100, 100, 67, 33, 0, 0]]


def test_scale_of_every_brightness(tmp_path):
    grey = np.arange(256)
    path = write_grid(tmp_path, [grey], mode="scale", negate="1", occupied_thresh="0.9", free_thresh="0.1")
    expected = np.clip(np.floor((grey / 255 - 0.1) / 0.8 * 100 + 0.5), 0, 100)
    off = np.abs(load_map(path).data[0] - expected)
    # Single precision may round a value that lies on a half to the other side.
    assert off.max() <= 1
    assert (off > 0).sum() <= 5


def test_raw_takes_the_value_and_ignores_negate_and_thresholds(tmp_path):
    path = write_grid(tmp_path, [[0, 1, 65, 100, 101, 127, 128, 205, 255]], mode="RAW", negate="1")
    assert load_map(path).data.tolist() == [[0, 1, 65, 100, -1, -1, -1, -1, -1]]


def test_one_in_a_raw_image_is_one_percent(tmp_path):
    assert load_map(write_grid(tmp_path, [[0, 1, 255]], mode="raw")).data.tolist() == [[0, 1, -1]]


def picture(folder, *colours, mode="RGB"):
    row_of(mode, *colours).save(folder / "m.png")
    return folder / "m.png"


def test_what_the_colours_of_a_picture_became_is_told(tmp_path):
    path = write_grid(tmp_path, name="m.png")
    picture(tmp_path, RED, BLUE, BLUE, GREEN, YELLOW, WHITE, (0, 0, 0), (200, 205, 210))
    grid = load_map(path)
    assert grid.data.tolist() == [[100, 100, 100, -1, 0, 0, 100, -1]]
    assert len(grid.warnings) == 1
    for part in ("(0, 0, 255) became occupied, ", "(255, 0, 0) became occupied", "(0, 255, 0) became unknown",
                 "(255, 255, 0) became free", "draw obstacles black"):
        assert part in grid.warnings[0]
    assert "200" not in grid.warnings[0]


def test_what_is_transparent_has_no_colour(tmp_path):
    path = write_grid(tmp_path, name="m.png")
    picture(tmp_path, (*RED, 0), (*WHITE, 255), mode="RGBA")
    assert load_map(path).warnings == () and load_map(path).data.tolist() == [[-1, 0]]


def test_of_many_colours_the_most_frequent_are_told(tmp_path):
    path = write_grid(tmp_path, name="m.png")
    picture(tmp_path, *((40 * (n % 6), 255, 60 * (n // 6)) for n in range(20)), *[BLUE] * 3)
    assert load_map(path).warnings[0].count("became") == 6 and "(0, 0, 255) became" in load_map(path).warnings[0]


def test_shades_of_a_smooth_edge_are_told_as_one_colour(tmp_path):
    path = write_grid(tmp_path, name="m.png")
    picture(tmp_path, *((200 + n, 30 + n, 30 - n) for n in range(20)), *[BLUE] * 3)
    assert load_map(path).warnings[0].count("became") == 2


def test_a_picture_is_a_map_where_its_resolution_is_given(tmp_path):
    path = picture(tmp_path, 0, 89, 90, 204, 205, 206, 254, mode="L")
    grid = load_map(path, resolution=0.05)
    assert grid.data.tolist() == [[100, 100, -1, -1, -1, 0, 0]]
    assert (grid.resolution, grid.origin, grid.name) == (0.05, (0, 0, 0), "m.png")
    assert load_map(path, resolution=np.float32(0.5)).size == (3.5, 0.5)
    assert "give the side of its cells in metres, such as resolution=0.05" in refusal(path)
    assert "resolution is -1" in refusal(path, MapMetadataError, resolution=-1)
    assert "max_map_cells = 3" in refusal(path, resolution=0.05, max_map_cells=3)
    (tmp_path / "m.PGM").write_bytes(pgm([[0, 254]]))
    assert load_map(tmp_path / "m.PGM", resolution=1).data.tolist() == [[100, 0]]


@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_unknown_space_that_is_free_by_its_threshold_is_told(tmp_path, mode):
    path = write_grid(tmp_path, [[205, 0, 254, 254]], free_thresh="0.25", mode=mode)
    grid = load_map(path)
    assert grid.data.tolist() == [[0, 100, 0, 0]] and len(grid.warnings) == 1
    for part in ("25.00%", "grey 205", "free_thresh: 0.25", "set free_thresh: 0.196", "--unknown-grey 205"):
        assert part in grid.warnings[0]
    assert grid.describe_cells() == "75.0% free, 25.0% occupied, 0.0% unknown"
    for again in (pickle.loads(pickle.dumps(grid)), grid.with_thresholds(Thresholds(10, 90))):
        assert again.warnings == grid.warnings
    taken = load_map(path, unknown_grey=205)
    assert taken.data.tolist() == [[-1, 100, 0, 0]] and taken.warnings == ()
    assert taken.describe_cells() == "50.0% free, 25.0% occupied, 25.0% unknown"


@pytest.mark.parametrize("changes, doubt", [
    ({"origin": "[0, 0, 45]"}, "the origin has the yaw 45 rad; did you mean 0.7854?"),
    ({"mod": "scale"}, "the field 'mod' is passed over; did you mean mode?"),
    ({"Resolution": "0.2"}, "the field 'Resolution' is passed over; did you mean resolution?"),
    ({"occupied_threshold": "0.5"}, "the field 'occupied_threshold' is passed over; did you mean occupied_thresh?"),
    ({"unknown_grey": "205"}, "unknown_grey is no field of map files and is passed over; give it as a parameter, or by "
     "--unknown-grey"),
    ({"frame_id": "odom"}, None)], ids=lambda value: None if isinstance(value, str | None) else next(iter(value)))
def test_what_is_likely_a_slip_in_a_map_file_is_told(tmp_path, changes, doubt):
    assert load_map(write_grid(tmp_path, **changes)).warnings == ((doubt,) if doubt else ())


@pytest.mark.parametrize("rows, changes", [
    ([[205, 0, 254]], {}), ([[204, 0, 254]], {"free_thresh": "0.25"}), ([[205, 100, 0]], {"mode": "raw", "free_thresh": "0.25"}),
    ([[205, 0]], {"negate": "1", "free_thresh": "0.25"}), ([[50, 255, 0]], {"negate": "1"})])
def test_unknown_space_that_is_not_free_is_not_told(tmp_path, rows, changes):
    assert load_map(write_grid(tmp_path, rows, **changes)).warnings == ()


def test_the_unknown_space_of_an_inverted_picture_that_is_free_is_told(tmp_path):
    path = write_grid(tmp_path, [[50, 255, 0, 0]], negate="1", free_thresh="0.25")
    warning, = load_map(path).warnings
    for part in ("25.00%", "grey 50", "set free_thresh: 0.196", "--unknown-grey 50"):
        assert part in warning
    assert load_map(path, unknown_grey=50).data.tolist() == [[-1, 100, 0, 0]]


def test_the_grey_of_unknown_space_holds_in_all_modes(tmp_path):
    for mode, expected in (("trinary", [-1, 0]), ("scale", [-1, 0]), ("raw", [-1, -1])):
        assert load_map(write_grid(tmp_path, [[7, 254]], mode=mode), unknown_grey=7).data.tolist() == [expected]


def test_a_drawing_without_a_background_is_doubted(tmp_path):
    pixels = np.zeros((10, 10, 4), np.uint8)
    pixels[:4, :, 3] = 255
    Image.fromarray(pixels).save(tmp_path / "m.png")
    warning, = load_map(tmp_path / "m.png", resolution=0.1).warnings
    assert warning.startswith("60.00% of the pixels are transparent, and so unknown")
    pixels[4] = 255
    Image.fromarray(pixels).save(tmp_path / "m.png")
    assert load_map(tmp_path / "m.png", resolution=0.1).warnings == ()


@pytest.mark.parametrize("mode, expected", [
    ("trinary", [100, -1, -1]), ("scale", [100, -1, 0]), ("raw", [0, 50, -1])])
def test_transparency_is_unknown_but_in_raw(tmp_path, mode, expected):
    path = write_grid(tmp_path, name="m.png", mode=mode, free_thresh="0.1")
    image = Image.new("LA", (3, 1))
    image.putdata([(0, 255), (50, 254), (254, 255 if mode == "scale" else 0)])
    image.save(tmp_path / "m.png")
    assert load_map(path).data.tolist() == [expected]


def test_scalars_are_read_as_map_server_reads_them(tmp_path):
    # YAML 1.1 would read text, a number, eight, and nothing that map_server knows.
    path = write_grid(tmp_path, name="2024", resolution="5e-2", origin="['-1e1', +2, 010]", negate="'0'", other="[]")
    grid = load_map(path)
    assert (grid.resolution, grid.origin) == (0.05, (-10, 2, 10))


def test_image_by_absolute_name(tmp_path):
    (tmp_path / "images").mkdir()
    (tmp_path / "images/a b.pgm").write_bytes(pgm([[0]]))
    (tmp_path / "m.yml").write_text("\ufeff" + yaml_of({**FIELDS, "image": f'"{tmp_path}/images/a b.pgm"'}), "utf-8")
    assert load_map(str(tmp_path / "m.yml")).data.tolist() == [[100]]


def test_home_directory(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    write_grid(tmp_path)
    assert load_map("~/m.yaml").data.shape == (1, 3)


@pytest.mark.parametrize("ending", ["geojson", "json", "GeoJSON", "wkt", "WKT"])
def test_polygons_by_their_ending(tmp_path, ending):
    path = tmp_path / f"yard.{ending}"
    ring = [[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]]
    geometry = {"type": "Polygon", "coordinates": [ring]}
    text = json.dumps({"type": "Feature", "properties": {"role": "bounds"}, "geometry": geometry})
    path.write_text("POLYGON ((0 0, 2 0, 2 2, 0 2, 0 0))" if ending.lower() == "wkt" else text)
    yard = load_map(path)
    assert isinstance(yard, PolygonMap)
    assert (yard.name, yard.free.area) == (path.name, 4)


@pytest.mark.parametrize("name", ["maze", "maze.yaml", "maps/maze.yaml", "block.geojson", Path("maze")])
def test_own_maps_by_name(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    assert load_map(name).id == load_map(MAPS / Path(name if Path(name).suffix else f"{name}.yaml").name).id
    (tmp_path / "maze").mkdir()
    write_grid(tmp_path).rename(tmp_path / "maze.yaml")
    assert load_map("maze.yaml").data.shape == (1, 3)


def test_save_and_load_give_the_same_map(tmp_path):
    data = np.random.default_rng(3).choice([0, 100, -1], (7, 5)).astype(np.int8)
    grid = GridMap(data, 1 / 30, (-1e-7, 12345.678901234567, 0.1), "any")
    save_map(grid, tmp_path / "näme: 1.yaml")
    assert load_map(tmp_path / "näme: 1.yaml").id == grid.id
    assert (tmp_path / "näme: 1.pgm").read_bytes().startswith(b"P5\n5 7\n255\n")


def test_saved_cells_keep_what_they_mean(tmp_path):
    grid = GridMap(np.array([[0, 25, 26, 64, 65, 100, -1]]), 1.0)
    save_map(grid, tmp_path / "m.yml")
    again = load_map(tmp_path / "m.yml")
    assert again.data.tolist() == [[0, 0, -1, -1, 100, 100, -1]]
    for allow_unknown in (False, True):
        assert (again.blocked(allow_unknown) == grid.blocked(allow_unknown)).all()


@pytest.mark.parametrize("name", ["m.pgm", "m", "no/m.yaml"])
def test_save_refuses_a_bad_name(tmp_path, name):
    with pytest.raises(MapError, match="choose|name it") as caught:
        save_map(GridMap(np.zeros((1, 1)), 1.0), tmp_path / name)
    assert name in str(caught.value)


@pytest.mark.parametrize("name", ["block", "maze", "forest"])
def test_shipped_pair_is_the_rendering_of_the_polygons(name, tmp_path):
    grid = rasterise(load_map(MAPS / f"{name}.geojson"), 0.05)
    assert load_map(MAPS / f"{name}.yaml").id == grid.id
    save_map(grid, tmp_path / f"{name}.yaml")
    for file in (f"{name}.yaml", f"{name}.pgm"):
        assert (tmp_path / file).read_bytes() == (MAPS / file).read_bytes()


@pytest.mark.parametrize("name", ["block", "maze", "forest"])
def test_shipped_start_and_goal_fit_a_robot_and_have_no_straight_way(name):
    members = json.loads((MAPS / f"{name}.geojson").read_text("utf-8"))
    start, goal = members["start"], members["goal"]
    room = load_map(MAPS / f"{name}.geojson").free.buffer(-0.2)
    assert room.geom_type == "Polygon"
    assert all(shapely.intersects_xy(room, *pose[:2]) for pose in (start, goal))
    assert not shapely.covers(room, shapely.linestrings([start[:2], goal[:2]]))
    assert all(item["properties"]["name"] for item in members["features"])
