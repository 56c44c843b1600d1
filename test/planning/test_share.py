"""Where the package's own maps are found."""

from pathlib import Path

import pytest

from dubins_rrt_ros.planning import MapError, load_map
from dubins_rrt_ros.share import find_map, maps_directory


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A prefix of the ament index with a map."""
    folder = tmp_path / "prefix" / "share" / "dubins_rrt_ros" / "maps"
    folder.mkdir(parents=True)
    (folder / "yard.wkt").write_text("POLYGON ((0 0, 4 0, 4 4, 0 4, 0 0))")
    (folder / "lawn.yaml").write_text("image: lawn.pgm")
    (folder / "lawn.pgm").write_bytes(b"")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'other'}:{tmp_path / 'prefix'}")
    return folder


def test_a_path_is_taken_as_it_is(tmp_path):
    file = tmp_path / "my.wkt"
    file.write_text("POLYGON ((0 0, 4 0, 4 4, 0 4, 0 0))")
    assert find_map(str(file)) == file


def test_a_file_comes_before_an_own_map(tmp_path, monkeypatch):
    (tmp_path / "maze.yaml").write_text("mine")
    monkeypatch.chdir(tmp_path)
    assert find_map("maze.yaml").resolve() == tmp_path / "maze.yaml"


@pytest.mark.parametrize("name, file", [
    ("maze", "maze.yaml"), ("maze.yaml", "maze.yaml"), ("maze.geojson", "maze.geojson"), ("block", "block.yaml"),
    ("forest.geojson", "forest.geojson")])
def test_own_maps_by_name(name, file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = find_map(name)
    assert found == maps_directory() / file
    assert load_map(found).corners().shape == (4, 2)


@pytest.mark.parametrize("name", ["lost", "lost.yaml", "", "maps", "/no/such/folder/lost.yaml"])
def test_an_unknown_name_is_answered_with_the_known_ones(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MapError) as refusal:
        find_map(name)
    assert str(refusal.value).startswith(f"{name}: no such map file; give a path or one of the package's own maps: ")
    for own in ("block.yaml", "block.geojson", "maze.yaml", "maze.geojson", "forest.yaml", "forest.geojson"):
        assert own in str(refusal.value)


def test_the_ament_index_comes_first(installed):
    assert maps_directory() == installed
    assert find_map("yard.wkt") == installed / "yard.wkt"
    assert find_map("lawn") == installed / "lawn.yaml"
    with pytest.raises(MapError, match=r"own maps: lawn.yaml, yard.wkt$"):
        find_map("maze")


@pytest.mark.parametrize("prefixes", ["", "/no/such/prefix", ":"])
def test_without_an_ament_index(prefixes, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", prefixes)
    assert (maps_directory() / "maze.yaml").is_file()
    assert maps_directory() == Path(find_map("maze")).parent
