"""Where maps are found: by path, by URL, and the package's own by name."""

from pathlib import Path

import pytest

from dubins_rrt_ros.planning import load_map
from dubins_rrt_ros.planning.maps.errors import MapNotFound
from dubins_rrt_ros.planning.maps.locate import find_map, maps_directory


def refusal(name):
    """The message of a refusal, that must be one printable line with a remedy."""
    with pytest.raises(MapNotFound) as caught:
        find_map(name)
    message = str(caught.value)
    assert message.isprintable()
    assert "; give " in message or "; correct " in message
    return message


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A prefix of the ament index with a map."""
    folder = tmp_path / "prefix" / "share" / "dubins_rrt_ros" / "maps"
    folder.mkdir(parents=True)
    (folder.parent / "package.xml").write_text("<package/>")
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


@pytest.mark.parametrize("name", ["lost", "lost.yaml", "maps", "/no/such/folder/lost.yaml", "~/lost.yaml", "n" * 5000,
                                  "package://dubins_rrt_ros/maps/lost.yaml", "file:///lost.yaml", "file:///%00"])
def test_an_unknown_name_is_answered_with_the_known_ones(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    message = refusal(name)
    assert message.startswith(f"{name}: no such map file; give a path, a file:// or package:// URL, or one of the package's own")
    for own in ("block.yaml", "block.geojson", "maze.yaml", "maze.geojson", "forest.yaml", "forest.geojson"):
        assert own in message


@pytest.mark.parametrize("name", [".", "/", "plans", "./plans", "plans.yaml", "file:///tmp", "package://dubins_rrt_ros/maps"])
def test_a_folder_is_called_one_and_its_files_are_not_told(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("plans", "plans.yaml"):
        Path(folder).mkdir()
        Path(folder, "secret.yaml").touch()
    assert refusal(name) == f"{name}: is a directory; give the map file in it (.yaml, .geojson, .wkt)"


def test_an_empty_name_is_called_so():
    assert refusal("").startswith("the name of the map is empty; give a path, ")


@pytest.mark.parametrize("name", ["two\nlines.yaml", "\x1b[31m", "\ud800", "nul\0.yaml", "file://\n/x", "http://\x1b/",
                                  "file:///\ud800", "package://dubins_rrt_ros/%ff%0a"])
def test_odd_names_give_one_line(name):
    refusal(name)


def test_a_path_in_the_home_directory_and_one_from_here(tmp_path, monkeypatch):
    file = tmp_path / "yards" / "my.wkt"
    file.parent.mkdir()
    file.write_text("POLYGON ((0 0, 4 0, 4 4, 0 4, 0 0))")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert find_map("~/yards/my.wkt") == file
    assert find_map("yards/my.wkt").resolve() == find_map("./yards/../yards/my.wkt").resolve() == file.resolve()


@pytest.mark.parametrize("start", ["file://", "file://localhost", "FILE://LOCALHOST"])
def test_a_file_s_url(start, tmp_path):
    file = tmp_path / "my ärd #1?.wkt"
    file.write_text("POLYGON ((0 0, 4 0, 4 4, 0 4, 0 0))")
    assert find_map(f"{start}{tmp_path}/my%20%C3%A4rd%20%231%3f.wkt") == file
    assert find_map(f"{start}{file}") == file


@pytest.mark.parametrize("url", ["package://dubins_rrt_ros/maps/maze.yaml", "Package://dubins_rrt_ros/maps%2Fmaze%2eyaml"])
def test_an_own_map_s_url(url):
    assert find_map(url) == maps_directory() / "maze.yaml"


def test_a_package_s_url_goes_to_the_first_prefix_that_has_it(installed, tmp_path, monkeypatch):
    assert find_map("package://dubins_rrt_ros/maps/yard.wkt") == installed / "yard.wkt"
    for prefix in ("over", "under"):
        share = tmp_path / prefix / "share" / "other"
        share.mkdir(parents=True)
        (share / "package.xml").write_text("<package/>")
        (share / f"{prefix}.wkt").write_text("POLYGON ((0 0, 4 0, 4 4, 0 4, 0 0))")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'no'}:{tmp_path / 'over'}:{tmp_path / 'under'}")
    assert find_map("package://other/over.wkt") == tmp_path / "over" / "share" / "other" / "over.wkt"
    assert "no such map file" in refusal("package://other/under.wkt")


@pytest.mark.parametrize("url", [
    "package://other/../dubins_rrt_ros/maps/maze.yaml", "package://other/%2e%2e/x.yaml", "package://other/a/..%2F..%2Fx.yaml",
    "package://other//etc/passwd", "package://../x.yaml", "package:///x.yaml", "package://a b/x.yaml", "package://%2e%2e/x"])
def test_a_package_s_url_stays_in_its_share_folder(url):
    assert "give package://PACKAGE/PATH" in refusal(url)


@pytest.mark.parametrize("prefixes", ["", "/no/such/prefix"])
def test_a_package_that_is_not_there_is_named(prefixes, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", prefixes)
    assert "no package other in AMENT_PREFIX_PATH; correct its name, or source" in refusal("package://other/x.yaml")


@pytest.mark.parametrize("url", ["http://host/maze.yaml", "https://host/maze.yaml", "s3://bucket", "model://maze"])
def test_other_schemes_are_refused_with_those_that_there_are(url):
    message = refusal(url)
    assert message.startswith(f"{url}: ")
    assert "give a file:// or package:// URL" in message


@pytest.mark.parametrize("url", ["file://host/maze.yaml", "file://maze.yaml", "file://~/maze.yaml"])
def test_files_of_other_hosts_are_refused(url):
    assert "host" in refusal(url)
    assert "file:///PATH, with three slashes" in refusal(url)


def test_a_path_may_hold_a_colon(tmp_path, monkeypatch):
    (tmp_path / "file:yard.wkt").write_text("POLYGON ((0 0, 4 0, 4 4, 0 4, 0 0))")
    monkeypatch.chdir(tmp_path)
    assert find_map("file:yard.wkt") == Path("file:yard.wkt")


def test_the_ament_index_comes_first(installed):
    assert maps_directory() == installed
    assert find_map("yard.wkt") == installed / "yard.wkt"
    assert find_map("lawn") == installed / "lawn.yaml"
    assert refusal("maze").endswith("own maps: lawn.yaml, yard.wkt")


@pytest.mark.parametrize("prefixes", ["", "/no/such/prefix", ":"])
def test_without_an_ament_index(prefixes, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", prefixes)
    assert (maps_directory() / "maze.yaml").is_file()
    assert maps_directory() == Path(find_map("maze")).parent
