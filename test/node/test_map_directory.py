"""With map_directory set, load_map reads no file outside it, whatever the name or the map's YAML says. Through the executable."""

import os

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from nav_msgs.srv import GetMap, LoadMap
from support.yard import GOAL, QUICK, START, yard

from dubins_rrt_ros.planning import GridMap, save_map

FIELDS = "resolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
SMALL = b"P5\n2 2\n255\n" + bytes([254]) * 4


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """maps/ with maps, its own and links to others, and beside it the yard and a map and an image that are not to be read."""
    folder = tmp_path_factory.mktemp("limited")
    maps = folder / "maps"
    (maps / "deep").mkdir(parents=True)
    save_map(GridMap(yard(), 0.1), folder / "yard.yaml")
    for place in (folder, maps, maps / "deep"):
        (place / "small.pgm").write_bytes(SMALL)
        (place / "small.yaml").write_text("image: small.pgm\n" + FIELDS)
    images = {"by_name": "deep/small.pgm", "up_and_down": "../maps/small.pgm", "absolute": maps / "deep/small.pgm",
              "outside": "../small.pgm", "outside_absolute": folder / "small.pgm", "outside_by_link": "link.pgm"}
    for name, image in images.items():
        (maps / f"{name}.yaml").write_text(f"image: {image}\n{FIELDS}")
    (maps / "link.pgm").symlink_to(folder / "small.pgm")
    (maps / "link.yaml").symlink_to(folder / "small.yaml")
    (maps / "link").symlink_to(folder)
    (folder / "back").symlink_to(maps)
    return folder


@pytest.fixture(scope="module")
def limited(module_planners, folder):
    """The process and the client of a planner that is limited to maps/, by a link to it, and begins with a map from elsewhere."""
    process = module_planners.start(map_file=str(folder / "yard.yaml"), map_directory=str(folder / "back"), **QUICK)
    return process, module_planners.client()


def load(client, url):
    return client.call(LoadMap, "load_map", map_url=url)


@pytest.mark.parametrize("name", ["maps/small.yaml", "maps/deep/small.yaml", "maps/deep/../small.yaml", "back/small.yaml",
                                  "maps/link/maps/small.yaml", "maps/by_name.yaml", "maps/up_and_down.yaml",
                                  "maps/absolute.yaml"])
def test_maps_and_images_in_the_directory_are_loaded(limited, folder, name):
    _, client = limited
    for url in (str(folder / name), f"file://{folder / name}", os.path.relpath(folder / name)):
        response = load(client, url)
        assert (response.result, response.map.info.width) == (LoadMap.Response.RESULT_SUCCESS, 2)


@pytest.mark.parametrize(("url", "named"), [
    ("{}/small.yaml", "{}/small.yaml"), ("file://{}/small.yaml", "{}/small.yaml"), ("{}/yard.yaml", "{}/yard.yaml"),
    ("{}/maps/../small.yaml", "{}/maps/../small.yaml"), ("{}/maps/link.yaml", "{}/maps/link.yaml"),
    ("{}/maps/link/small.yaml", "{}/maps/link/small.yaml"), ("maze", "maze.yaml"), ("/etc/passwd", "/etc/passwd"),
    ("package://dubins_rrt_ros/maps/block.geojson", "block.geojson"),
    ("{}/maps/outside.yaml", "image '../small.pgm'"), ("{}/maps/outside_absolute.yaml", "image '{}/small.pgm'"),
    ("{}/maps/outside_by_link.yaml", "image 'link.pgm'")])
def test_whatever_is_elsewhere_is_refused_and_the_map_stays(limited, folder, url, named):
    process, client = limited
    assert load(client, str(folder / "maps/small.yaml")).result == LoadMap.Response.RESULT_SUCCESS
    said = len(process.output)
    response = load(client, url.format(folder))
    assert (response.result, len(response.map.data)) == (LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST, 0)
    wanted = f"{named.format(folder)} is outside of", f"{named.format(folder)}: is outside of"
    client.wait_for(lambda: any(words in process.output[said:] for words in wanted), "the reason in the log")
    assert f"map_directory = {folder / 'back'}" in process.output[said:]
    assert client.call(GetMap, "get_map").map.info.width == 2


def test_the_operator_s_map_file_is_not_limited(limited, module_planners, folder):
    module_planners.start(map_file=str(folder / "yard.yaml"), map_directory=str(folder / "maps"), **QUICK)
    client = module_planners.client()
    assert np.array(client.call(GetMap, "get_map").map.data).reshape(100, 100).tolist() == yard().tolist()
    assert len(client.plan(START, GOAL)[0].poses) > 1


def test_nobody_on_the_network_can_change_the_directory(limited, folder):
    _, client = limited
    for value in ("", "/", str(folder)):
        result = client.set_parameters(map_directory=value)
        assert not result.successful
        assert "map_directory is read-only while the node runs" in result.reason
    assert load(client, str(folder / "small.yaml")).result == LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST


@pytest.mark.slow
def test_with_a_directory_that_is_not_there_no_map_is_loaded(limited, module_planners, folder):
    module_planners.start(map_directory=str(folder / "nowhere"))
    client = module_planners.client()
    assert load(client, str(folder / "maps/small.yaml")).result == LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST
    client.wait_for_word(f"is outside of map_directory = {folder / 'nowhere'}")


def test_the_home_directory_is_found_in_map_file_and_in_load_map(planners, folder, monkeypatch):
    monkeypatch.setenv("HOME", str(folder))
    process = planners.start(map_file="~/yard.yaml", map_directory="~/maps", **QUICK)
    client = planners.client()
    client.wait_for_word("Took a map of 100 x 100 cells: yard.yaml")
    assert load(client, "~/maps/small.yaml").result == 0
    assert load(client, "~/small.yaml").result != 0
    assert process.running
