"""Map files that are none, or not good enough: each is refused with a helpful line that names what is wrong."""

import json

import pytest
from support.images import pgm
from support.map_files import image_named, refusal, write_grid

from dubins_rrt_ros.planning.maps.errors import MapError, MapMetadataError, MapNotFound
from dubins_rrt_ros.planning.maps.files import load_map
from dubins_rrt_ros.planning.option import OptionError
from dubins_rrt_ros.planning.text import LONGEST


def test_a_resolution_for_a_file_that_has_its_own_is_refused(tmp_path):
    message = "says itself how large its cells are, and resolution is 0.1; leave that out"
    with pytest.raises(MapError, match=message):
        load_map(write_grid(tmp_path), resolution=0.1)


@pytest.mark.parametrize("value", [256, -2, 1.5, "205", True])
def test_a_grey_that_is_none_is_refused(tmp_path, value):
    with pytest.raises(OptionError, match="unknown_grey is .*; it takes an integer from -1 to 255"):
        load_map(write_grid(tmp_path), unknown_grey=value)


def test_an_image_that_cannot_be_read_is_refused(tmp_path):
    path = image_named(tmp_path, "/proc/self/mem")
    with pytest.raises(MapError, match=r"m.yaml: image '/proc/self/mem' cannot be read \(.*\); give a regular file"):
        load_map(path)
    (tmp_path / "mem.wkt").symlink_to("/proc/self/mem")
    with pytest.raises(MapError, match="mem.wkt: cannot be read"):
        load_map(tmp_path / "mem.wkt")


NO_FILES = ["no.pgm", ".", '"a\\0b.pgm"', '"\\ud800.pgm"', '"' + 300 * "n" + '"']


@pytest.mark.parametrize("field, values", [
    ("image", [None, "", "[a]", "m.yaml", *NO_FILES]),
    ("resolution", [None, "", "0", "-0.05", ".nan", "nan", "inf", "1e999", "five", "1_0", "[0.05]"]),
    ("origin", [None, "", "0", "000", "[0, 0]", "[0, 0, 0, 0]", "[0, nan, 0]",
                "[0, 0, x]", "[0, 0, 1e300]", "[[0], 0, 0]", "{x: 1}"]),
    ("negate", [None, "2", "maybe", "[]", ""]),
    ("occupied_thresh", [None, "1.1", "65", "nan", "0.1", "[]"]),
    ("free_thresh", [None, "-0.1", "low", "0.65", "0.9"]),
    ("mode", ["binary", '""', "[raw]", "{}"]),
])
def test_bad_field(tmp_path, field, values):
    for value in values:
        kind = MapNotFound if value in NO_FILES else MapError if value == "m.yaml" else MapMetadataError
        path = write_grid(tmp_path, **{field: value}) if field != "image" else image_named(tmp_path, value)
        assert field in refusal(path, kind), value


@pytest.mark.parametrize("content, word", [
    (b"", "empty"), (b" \n", "empty"), (b"\xff\xfe", "UTF-8"), (b"# a map\n\n# of nothing\n", "has no fields but comments"),
    (b"a: [", "YAML"), (b"- 1\n- 2\n", "YAML"),
    (b"text", "YAML"), (b"a: 1\n---\nb: 2\n", "YAML"), (b"a: \x01", "YAML"), (b"*x", "YAML"), (b"? [a]\n: 1", "YAML"),
    (b"[" * 5000, "YAML"), (b'a: "\\U7fffffff"', "YAML"), (b"!!python/object/apply:os.getcwd []", "YAML"),
    (b"#" * 2**21, "bytes"), (b"&a [*a]", "YAML"), (b"origin: &a [*a, *a, *a]\nimage: m.pgm\nresolution: 1", "origin"),
])
def test_bad_yaml(tmp_path, content, word):
    (tmp_path / "bad.yaml").write_bytes(content)
    assert word in refusal(tmp_path / "bad.yaml", MapMetadataError)


@pytest.mark.parametrize("written", ["Image", "imgae", "IMAGE"])
def test_a_field_that_is_missing_but_for_its_spelling_is_told(tmp_path, written):
    path = write_grid(tmp_path)
    path.write_text(path.read_text().replace("image:", f"{written}:"))
    assert f"m.yaml: image is missing (there is '{written}'); give the name" in refusal(path, MapMetadataError)


@pytest.mark.parametrize("again", ["resolution: 0.2", "image: n.pgm", '"resolution": 0.05', "other: {a: 1, b: 2, a: 3}"])
def test_a_key_that_is_given_twice_is_refused(tmp_path, again):
    path = write_grid(tmp_path)
    path.write_text(f"{path.read_text()}{again}\n")
    assert "is given twice, in line" in refusal(path, MapMetadataError)


def test_one_line_may_give_a_key_twice_nowhere(tmp_path):
    (tmp_path / "m.yaml").write_text("{image: a.pgm, image: b.pgm}")
    assert "image is given twice" in refusal(tmp_path / "m.yaml", MapMetadataError)


@pytest.mark.parametrize("old, new", [
    (": 0.05", ":\t0.05"), ("0.05\n", "0.05\t# metres\n"), ("0.05\n", "0.05 \t \n"), (": 0.05", ": \t 0.05"),
    ("[0, 0, 0]", "[0,\t0,\t0\t]"), ("image", "\t# a comment\n\t\nimage"), (": m.pgm", ":\tm.pgm\t")])
def test_tabs_are_taken_where_map_server_takes_them(tmp_path, old, new):
    path = write_grid(tmp_path)
    expected, text = load_map(path), path.read_text().replace(old, new, 1)
    assert "\t" in text
    path.write_text(text)
    assert load_map(path).id == expected.id


def test_a_tab_is_no_indentation(tmp_path):
    path = write_grid(tmp_path)
    path.write_text("\t" + path.read_text())
    assert "no valid YAML" in refusal(path, MapMetadataError)


@pytest.mark.parametrize("field, value", [("resolution", "1e-9"), ("origin", "[1e9, 0, 0]")])
def test_cells_that_cannot_be_planned_on(tmp_path, field, value):
    message = refusal(write_grid(tmp_path, **{field: value}), MapMetadataError)
    assert "cannot be planned on" in message and message.count("m.yaml") == 1


@pytest.mark.parametrize("content, word", [
    (b"", "empty"), (b"hello", "PGM"), (pgm([[1, 2]])[:-1], "truncated"), (b"P5 30000 30000 255\n", "max_map_cells"),
    (b"\x89PNG\r\n\x1a\n", "damaged")])
def test_bad_image_names_the_field_and_the_image(tmp_path, content, word):
    path = write_grid(tmp_path)
    (tmp_path / "m.pgm").write_bytes(content)
    message = refusal(path)
    assert "image 'm.pgm' " in message
    assert word in message


def test_size_limit_is_inclusive(tmp_path):
    path = write_grid(tmp_path)
    assert load_map(path, max_map_cells=3).data.shape == (1, 3)
    assert "3 x 1 = 3 cells, above max_map_cells = 2; crop it" in refusal(path, max_map_cells=2)


def test_bad_polygons_name_the_file(tmp_path):
    (tmp_path / "bad.wkt").write_text("POLYGON ((0 0, 1 1))")
    assert "geometry" in refusal(tmp_path / "bad.wkt")
    name = "a\nb\u2028\x1b[31m\ud800"
    feature = {"type": "Feature", "properties": {"name": name}, "geometry": None}
    (tmp_path / "bad.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    assert "feature 1 ('a" in refusal(tmp_path / "bad.geojson")


def test_polygon_files_may_be_as_long_as_the_cells_of_a_map_allow(tmp_path):
    path = tmp_path / "m.wkt"
    path.write_text("POLYGON ((0 0, 2 0, 2 2, 0 2, 0 0))" + " " * 2**17)
    assert load_map(path, max_map_cells=10_000)
    assert "larger than 68736 bytes" in refusal(path, max_map_cells=100)


def test_messages_of_long_and_deep_values_are_short(tmp_path):
    values = ["[" + "[[[x, y], [x, y]], [[x, y], [x, y]]], " * 99 + "]", "n" * 5000, "'" + "\\u0007" * 999 + "'"]
    for value in values:
        assert len(refusal(write_grid(tmp_path, origin=value), MapMetadataError)) < 400
    (tmp_path / "m.yaml").write_text("*" + "a" * 9000)
    message = refusal(tmp_path / "m.yaml", MapMetadataError)
    assert len(message) <= LONGEST and " ... " in message


def test_long_polygon_files_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.maps.readers.MAX_POLYGON_BYTES", 50)
    (tmp_path / "m.geojson").write_text(" " * 51)
    assert "larger than 50 bytes" in refusal(tmp_path / "m.geojson")


@pytest.mark.parametrize("name, word, kind", [
    ("no.yaml", "No such file", MapNotFound), ("folder.yaml", "directory", MapNotFound),
    ("m.pgm/m.wkt", "Not a directory", MapNotFound), ("n" * 300 + ".wkt", "too long", MapNotFound),
    ("map.txt", "ending", MapError), ("map", "ending", MapError)])
def test_files_that_are_none(tmp_path, name, word, kind):
    write_grid(tmp_path)
    (tmp_path / "folder.yaml").mkdir()
    assert word in refusal(tmp_path / name, kind)


@pytest.mark.parametrize("name", ["nul\0.wkt", "~\0/m.wkt", "two\nlines\x1b[0m.yaml", "\ud800.json", ""])
def test_odd_names_give_one_line(name):
    with pytest.raises(MapError, match="correct|give") as caught:
        load_map(name)
    assert str(caught.value).isprintable()
