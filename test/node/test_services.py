"""The services load_map, get_map and cancel, through the executable."""

import signal

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.srv import GetMap, LoadMap
from std_srvs.srv import Trigger
from support.harness import occupancy, poses_of, values_of
from support.yard import ENDLESS, GOAL, IN_THE_BOX, ON_THE_WAY_OUT, QUICK, START, yard

from dubins_rrt_ros.planning import GridMap, load_map, save_map
from dubins_rrt_ros.planning.maps.locate import maps_directory


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Map files: yard.yaml, and empty.yaml of 8 m x 8 m without obstacles."""
    folder = tmp_path_factory.mktemp("maps")
    save_map(GridMap(yard(), 0.1), folder / "yard.yaml")
    save_map(GridMap(np.zeros((80, 80), dtype=np.int8), 0.1), folder / "empty.yaml")
    return folder


@pytest.fixture(scope="module")
def running(module_planners, folder):
    process = module_planners.start(map_file=str(folder / "yard.yaml"))
    client = module_planners.client()
    client.listen_to_map()
    return process, client


@pytest.fixture
def planner(running, folder):
    """The process and its client, with quick settings, on the yard, with nothing to do."""
    process, client = running
    client.cancel()
    client.set_parameters(**QUICK)
    assert client.call(LoadMap, "load_map", map_url=str(folder / "yard.yaml")).result == 0
    return process, client


# load_map

@pytest.mark.parametrize("prefix", ["", "file://"])
def test_load_map_takes_a_path_and_its_url(planner, folder, prefix):
    _, client = planner
    heard = len(client.maps)
    response = client.call(LoadMap, "load_map", map_url=f"{prefix}{folder / 'empty.yaml'}")
    assert response.result == LoadMap.Response.RESULT_SUCCESS
    assert (response.map.info.width, response.map.header.frame_id) == (80, "map")
    published = client.wait_for(lambda: client.maps[heard:], "the new map")[-1]
    assert (published.info.width, published.info.height, published.data) == (80, 80, response.map.data)
    client.wait_for_word("Took a map of 80 x 80 cells: empty.yaml")
    path, told = client.plan(START, IN_THE_BOX)  # which is free on this one
    assert told["map_id"] == load_map(folder / "empty.yaml").id
    assert len(path.poses) > 1


@pytest.mark.parametrize("name", ["maze", "maze.yaml", "package://dubins_rrt_ros/maps/maze.yaml", "block.geojson"])
def test_load_map_knows_the_package_s_own_maps(planner, name):
    _, client = planner
    response = client.call(LoadMap, "load_map", map_url=name)
    assert response.result == LoadMap.Response.RESULT_SUCCESS
    _, told = client.plan((1.5, 2.0, 1.57), (1.5, 2.0, 1.57))
    file = name.rpartition("/")[2]
    assert told["map_id"] == load_map(maps_directory() / (file if "." in file else f"{file}.yaml")).id


YAML = "image: {image}\nresolution: {resolution}\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
BROKEN = {
    "nowhere.yaml": (None, LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST, "nowhere.yaml"),
    "no_image.yaml": (YAML.format(image="nowhere.pgm", resolution=0.1), LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST,
                      "nowhere.pgm"),
    "no_picture.yaml": (YAML.format(image="no_picture.yaml", resolution=0.1), LoadMap.Response.RESULT_INVALID_MAP_DATA,
                        "no_picture.yaml"),
    "ring.wkt": ("POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))", LoadMap.Response.RESULT_INVALID_MAP_DATA, "ring.wkt"),
    "letters.txt": ("a map?", LoadMap.Response.RESULT_INVALID_MAP_DATA, ".txt"),
    "no_yaml.yaml": ("image: [", LoadMap.Response.RESULT_INVALID_MAP_METADATA, "no_yaml.yaml"),
    "no_resolution.yaml": ("image: a.pgm\n", LoadMap.Response.RESULT_INVALID_MAP_METADATA, "resolution is missing"),
    "negative.yaml": (YAML.format(image="a.pgm", resolution=-0.1), LoadMap.Response.RESULT_INVALID_MAP_METADATA, "-0.1"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_load_map_refuses_a_file_with_the_code_of_the_cause_and_the_map_before_stays(planner, folder, name):
    process, client = planner
    text, code, words = BROKEN[name]
    if text is not None:
        (folder / name).write_text(text)
    published = len(client.maps)
    assert client.call(LoadMap, "load_map", map_url=str(folder / name)).result == code
    said = client.wait_for(lambda: [line for line in process.output.splitlines() if "refused" in line and name in line], "a word")
    assert words in said[0]
    grid = client.call(GetMap, "get_map").map
    assert np.array(grid.data).reshape(100, 100).tolist() == yard().tolist()
    _, told = client.plan(START, GOAL)
    assert (told["error_name"], told["map_id"]) == ("NONE", load_map(folder / "yard.yaml").id)
    assert len(client.maps) == published


@pytest.mark.parametrize("url", ["", "http://example.org/map.yaml", "package://no_such_package/maps/maze.yaml"])
def test_load_map_refuses_what_names_no_file(planner, url):
    _, client = planner
    response = client.call(LoadMap, "load_map", map_url=url)
    assert response.result == LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST
    assert len(response.map.data) == 0


def test_load_map_keeps_max_map_cells(planner, folder):
    _, client = planner
    assert client.set_parameters(max_map_cells=100).successful
    try:
        response = client.call(LoadMap, "load_map", map_url=str(folder / "empty.yaml"))
    finally:
        client.set_parameters(max_map_cells=100_000_000)
    assert response.result == LoadMap.Response.RESULT_INVALID_MAP_DATA


# get_map

def test_get_map_gives_the_file(planner):
    _, client = planner
    grid = client.call(GetMap, "get_map").map
    assert (grid.header.frame_id, grid.info.width, grid.info.height) == ("map", 100, 100)
    assert grid.info.resolution == pytest.approx(0.1)
    assert np.array(grid.data).reshape(100, 100).tolist() == yard().tolist()


def test_get_map_gives_a_polygon_map_as_a_grid(planner):
    _, client = planner
    assert client.call(LoadMap, "load_map", map_url="block.geojson").result == LoadMap.Response.RESULT_SUCCESS
    grid = client.call(GetMap, "get_map").map
    free = load_map(maps_directory() / "block.geojson").free
    assert (np.array(grid.data) == 0).sum() * grid.info.resolution**2 == pytest.approx(free.area, rel=0.05)


@pytest.fixture(scope="module")
def by_topic(module_planners, running):
    """A planner whose map comes by topic, and its client."""
    return module_planners.start(**QUICK), module_planners.client()


def test_without_a_map_services_answer_empty_and_by_topic_or_service_one_comes(by_topic, folder):
    _, client = by_topic
    grid = client.call(GetMap, "get_map").map
    assert (grid.header.frame_id, len(grid.data)) == ("map", 0)
    client.wait_for_word("get_map gives an empty map")
    path, told = client.plan(START, GOAL)
    assert (path.header.frame_id, path.poses) == ("map", [])
    assert (told["level"], told["error_name"]) == (DiagnosticStatus.STALE, "NO_MAP")

    assert client.call(LoadMap, "load_map", map_url=str(folder / "yard.yaml")).result == LoadMap.Response.RESULT_SUCCESS
    _, told = client.plan(START, GOAL)
    assert (told["error_name"], told["map_id"]) == ("NONE", load_map(folder / "yard.yaml").id)

    cells = np.zeros((50, 70), dtype=np.int8)
    cells[7, 11] = 100
    client.publish_map(occupancy(cells))
    client.wait_for_word("Took a map of 70 x 50 cells")
    grid = client.call(GetMap, "get_map").map
    assert np.array(grid.data).reshape(50, 70).tolist() == cells.tolist()
    assert client.plan((1.0, 3.0, 0.0), (6.0, 3.0, 0.0))[1]["map_id"] == GridMap(cells, 0.1).id


# cancel

def test_cancel_with_nothing_to_do_succeeds_and_says_so(planner):
    _, client = planner
    statuses = len(client.statuses)
    response = client.call(Trigger, "cancel")
    assert response.success
    assert "Nothing" in response.message
    assert len(client.statuses) == statuses


def test_cancel_before_a_first_path_leaves_an_empty_one(planner):
    _, client = planner
    client.set_parameters(**ENDLESS)
    client.send("start_pose", START)
    plan_id, published = client.next_id, len(client.paths)
    client.send("goal_pose", ON_THE_WAY_OUT)
    response = client.wait_for(lambda: answer_to_cancel_of_a_goal(client), "the goal to be cancelled")
    told = client.status_of(plan_id)
    assert (told["level"], told["error_code"], told["error_name"]) == (DiagnosticStatus.WARN, "213", "CANCELLED")
    assert response.success and response.message == told["message"]
    client.wait_for_word(told["message"])
    path = client.wait_for(lambda: client.paths[published:], "an empty path")[-1]
    assert (path.header.frame_id, path.poses) == ("map", [])


def answer_to_cancel_of_a_goal(client):
    """The answer to cancel, once the goal, which comes on a topic, has come in."""
    response = client.call(Trigger, "cancel")
    return None if "Nothing" in response.message else response


def test_cancel_after_a_first_path_keeps_the_best_one_on_display(planner):
    _, client = planner
    client.set_parameters(**ENDLESS)
    client.send("start_pose", START)
    plan_id, published = client.next_id, len(client.paths)
    client.send("goal_pose", GOAL)
    client.status_of(plan_id, error_name="NONE")
    client.wait_for(lambda: client.paths[published:], "its path")
    response = client.call(Trigger, "cancel")
    client.wait_for(lambda: client.statuses[-1].message == response.message, "the last status")
    told = values_of(client.statuses[-1])
    assert client.statuses[-1].level == DiagnosticStatus.WARN
    assert (told["plan_id"], told["error_name"], told["audit"]) == (str(plan_id), "NONE", "ok")
    assert poses_of(client.paths[-1])[-1] == pytest.approx(GOAL, abs=1e-9)


def test_cancel_ends_all_requests_of_get_plan_and_each_is_answered(planner):
    _, client = planner
    client.set_parameters(**ENDLESS)
    futures, plan_ids = zip(*(client.begin_plan(START, ON_THE_WAY_OUT) for _ in range(3)), strict=True)
    assert not any(future.done() for future in futures)
    assert client.call(Trigger, "cancel").success
    assert [client.response(future).plan.poses for future in futures] == [[], [], []]
    for plan_id in plan_ids:
        told = client.status_of(plan_id)
        assert (told["level"], told["error_name"]) == (DiagnosticStatus.WARN, "CANCELLED")


def test_cancel_of_get_plan_after_a_first_path_gives_the_best_one(planner):
    _, client = planner
    client.set_parameters(**ENDLESS)
    future, plan_id = client.begin_plan(START, GOAL)
    client.call(Trigger, "cancel")
    path = poses_of(client.response(future).plan)
    told = client.status_of(plan_id)
    assert told["level"] == DiagnosticStatus.WARN
    assert (len(path) > 1) == (told["error_name"] == "NONE")


def test_what_comes_after_a_cancellation_is_planned(planner):
    _, client = planner
    client.set_parameters(**ENDLESS)
    future, _ = client.begin_plan(START, ON_THE_WAY_OUT)
    client.cancel(future)
    client.set_parameters(**QUICK)
    assert client.plan(START, GOAL)[1]["error_name"] == "NONE"


def test_cancel_while_a_goal_waits_for_a_start(module_planners, running, folder):
    module_planners.start(map_file=str(folder / "yard.yaml"))
    client = module_planners.client()
    said = []

    def cancelled():
        client.send("goal_pose", GOAL)
        said.append(client.call(Trigger, "cancel").message)
        return [status for status in client.statuses if values_of(status)["error_name"] == "CANCELLED"
                and "waited for a start" in status.message]  # and had begun to

    told = client.wait_for(cancelled, "a cancellation within the time that a goal waits")[0]
    assert told.level == DiagnosticStatus.WARN
    assert all(path.poses == [] for path in client.paths)
    assert told.message in said


@pytest.mark.slow
def test_a_signal_ends_the_node_that_owes_answers(planners, folder):
    process = planners.start(map_file=str(folder / "yard.yaml"), **ENDLESS)
    client = planners.client()
    for _ in range(3):
        client.begin_plan(START, ON_THE_WAY_OUT)
    status = process.end(signal.SIGTERM)
    assert status == 0, process.output
    assert "Traceback" not in process.output
    assert "did not stop" not in process.output
