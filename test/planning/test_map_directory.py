"""`map_directory`, the only folder from which maps are read where it is set: names, links and images that lead out of it."""

from pathlib import Path

import pytest
from support.map_files import image_named, refusal, write_grid

from dubins_rrt_ros.planning.maps.errors import MapNotFound
from dubins_rrt_ros.planning.maps.files import load_map


@pytest.fixture
def maps(tmp_path):
    """A folder with a map, and beside it others and links to and fro."""
    inside, outside = tmp_path / "maps", tmp_path / "other"
    for folder in (inside, inside / "deep", outside):
        folder.mkdir()
        write_grid(folder)
        (folder / "yard.wkt").write_text("POLYGON ((0 0, 2 0, 2 2, 0 2, 0 0))")
    links = {"out": "../other", "out.yaml": "../other/m.yaml", "out.wkt": "../other/yard.wkt", "out.pgm": "../other/m.pgm",
             "loop.yaml": "loop.yaml", "in.yaml": "deep/m.yaml"}
    for name, target in links.items():
        (inside / name).symlink_to(target)
    (outside / "in").symlink_to("../maps")
    (tmp_path / "mapsack.wkt").write_text("POLYGON ((0 0, 2 0, 2 2, 0 2, 0 0))")
    return inside


@pytest.mark.parametrize("name", [
    "m.yaml", "yard.wkt", "deep/m.yaml", "deep/../yard.wkt", "in.yaml", "../other/in/m.yaml", "../maps/yard.wkt",
    "deep/../../maps/m.yaml"])
@pytest.mark.parametrize("directory", ["maps", "maps/", "other/in", "."])
def test_files_inside_the_map_directory_are_read(maps, name, directory):
    assert load_map(maps / name, map_directory=str(maps.parent / directory))


@pytest.mark.parametrize("name", [
    "out.yaml", "out.wkt", "out/m.yaml", "../other/yard.wkt", "deep/../../other/m.yaml", "../mapsack.wkt", "../maps",
    "../other/x.txt", "/etc/passwd", "/dev/zero", "..", "../gone.yaml"])
def test_files_outside_the_map_directory_are_refused(maps, name):
    path = maps / name
    with pytest.raises(MapNotFound, match="is outside of map_directory = .*; name a file in there") as caught:
        load_map(path, map_directory=str(maps / "deep" if name == "../maps" else maps))
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("name", ["../other/m.pgm", "{}/m.pgm", "out.pgm", "out/m.pgm", "deep/../../other/m.pgm", "/dev/zero"])
def test_an_image_outside_the_map_directory_is_refused(maps, name):
    name = name.format(maps.parent / "other")
    path = image_named(maps, name)
    message = refusal(path, MapNotFound, map_directory=str(maps))
    assert f"image {name!r} is outside of map_directory = {maps}" in message
    if name.endswith("m.pgm"):
        assert load_map(path)


@pytest.mark.parametrize("name", ["deep/m.pgm", "{}/m.pgm", "../maps/m.pgm", "out/in/m.pgm"])
def test_an_image_inside_the_map_directory_is_read(maps, name):
    assert load_map(image_named(maps, name.format(maps)), map_directory=str(maps))


@pytest.mark.parametrize("name", ["loop.yaml", "nul\0.yaml", "\ud800.wkt", "n" * 300 + ".yaml", "gone.yaml"])
def test_no_possible_file_of_the_map_directory_is_refused(maps, name):
    with pytest.raises(MapNotFound):
        load_map(maps / name, map_directory=str(maps))


@pytest.mark.parametrize("directory", ["/nowhere", "\0", "m.yaml"])
def test_with_a_map_directory_that_is_none_nothing_is_read(maps, directory):
    refusal(maps / "m.yaml", MapNotFound, map_directory=directory)


def test_the_map_directory_may_be_in_the_home_directory_or_the_present_one(maps, monkeypatch):
    monkeypatch.setenv("HOME", str(maps.parent))
    monkeypatch.chdir(maps)
    for directory in ("~/maps", ".", "../maps"):
        assert load_map("~/maps/m.yaml", map_directory=directory)
        assert load_map("m.yaml", map_directory=directory)
        refusal(Path("../other/m.yaml"), MapNotFound, map_directory=directory)
