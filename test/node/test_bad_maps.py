"""Whatever comes as a map, by topic or as a file, the node says what is wrong with it, and plans on the map before."""

import array
import json
import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose, Quaternion
from nav_msgs.srv import LoadMap
from std_srvs.srv import Trigger
from support.conversation import Conversation
from support.harness import assert_says

from dubins_rrt_ros.node.conversions import grid_from, grid_message, pose_message
from dubins_rrt_ros.planning import OCCUPIED, GridMap, Thresholds, save_map

#: On a map of 10 m x 10 m with a box of 2 m in its middle.
START, GOAL = (1.5, 5.0, 0.0), (8.5, 5.0, 0.5)
IN_THE_BOX = (5.05, 5.05, 0.0)
QUICK = {"planner": "rrt", "samples": 3000, "planning_time": 15.0, "seed": 1}
NAN, INF = math.nan, math.inf


def box():
    cells = np.zeros((100, 100), np.int8)
    cells[40:60, 40:60] = OCCUPIED
    return GridMap(cells, 0.1)


@pytest.fixture(scope="module")
def on_a_topic(module_planners):
    """A planner that got its map by topic, for all tests."""
    talk = Conversation(module_planners.start(max_map_cells=20_000, **QUICK), module_planners.client())
    take(talk, changed())
    return talk


@pytest.fixture
def talk(on_a_topic):
    with on_a_topic.going_on(START, GOAL, box().id):
        yield on_a_topic


@pytest.fixture
def on_other_maps(talk):
    """The same, for tests that leave another map behind."""
    yield talk
    take(talk, changed())


def take(talk, message):
    """Publish a map and wait until it is planned on."""
    wanted = grid_from(message, "map", 20_000).id
    talk.client.publish_map(message)
    talk.client.wait_for(lambda: talk.process.map_id == wanted, "the map to be taken")


def refusal(talk, said):
    """What the log says of a map that was refused, after its first `said` letters."""
    def find():
        return next((line for line in talk.process.output[said:].splitlines() if "A map was refused" in line), "")
    return talk.client.wait_for(find, "the refusal")


# By topic

def at(**coordinates):
    return Pose(position=Point(**coordinates))


def turned(**components):
    """A pose whose quaternion has these components, and else zeros."""
    return Pose(orientation=Quaternion(**{"w": 0.0, **components}))


def changed(**fields):
    """The map's message with other fields; `origin` is its pose, `frame_id` its frame, `data` its cells."""
    message = grid_message(box(), "map", Time())
    message.header.frame_id = fields.pop("frame_id", "map")
    message.data = fields.pop("data", message.data)
    for name, value in fields.items():
        setattr(message.info, name, value)
    return message


def cells(count):
    return array.array("b", bytes(count))


@pytest.mark.parametrize(("fields", "words"), [
    ({"width": 0, "height": 0, "data": cells(0)}, ["0 values for 0 x 0 cells"]),
    ({"width": 0}, ["10000 values for 0 x 100"]), ({"height": 0}, ["10000 values for 100 x 0"]),
    ({"data": cells(0)}, ["0 values for 100 x 100"]), ({"data": cells(9999)}, ["9999 values for 100 x 100"]),
    ({"data": cells(10001)}, ["10001 values for 100 x 100"]), ({"width": 99}, ["10000 values for 99 x 100"]),
    ({"width": 20_001, "height": 1, "data": cells(20_001)}, ["20001 x 1 cells", "max_map_cells (20000)"]),
    ({"width": 2**32 - 1, "height": 1, "data": cells(0)}, ["4294967295 x 1 cells", "max_map_cells"]),
    ({"width": 2**32 - 1, "height": 2**32 - 1, "data": cells(0)}, ["4294967295 x 4294967295", "max_map_cells"]),
    ({"width": 2**16, "height": 2**16, "data": cells(0)}, ["65536 x 65536", "max_map_cells"]),
    *[({"resolution": value}, ["resolution", str(value)]) for value in (0.0, -0.1, NAN, INF, -INF)],
    ({"resolution": 1e-9}, ["1e-09 m", "cannot be planned on"]), ({"resolution": 3e38}, ["cannot be planned on"]),
    *[({"origin": at(**{axis: value})}, ["origin", str(value)]) for axis in "xyz" for value in (NAN, INF)],
    ({"origin": at(x=1e300)}, ["cannot be planned on", "1e+300"]),
    ({"origin": turned()}, ["origin", "no rotation"]), ({"origin": turned(w=NAN)}, ["origin", "no rotation"]),
    ({"origin": turned(x=1.0)}, ["origin", "leans by 3.14 rad"]),
    ({"frame_id": "odom"}, ["'odom'", "'map'", "global_frame"]), ({"frame_id": "/map"}, ["'/map'", "'map'"]),
])
def test_a_map_that_is_none_is_refused_and_the_one_before_stays(talk, fields, words):
    said = len(talk.process.output)
    talk.client.publish_map(changed(**fields))
    line = refusal(talk, said)
    assert [word for word in words if word not in line] == [], line
    assert not line.endswith("..")


@pytest.mark.parametrize("frame", ["map\n[ERROR] [1.0] [planner]: forged", "\x1b[2Jred", "x" * 1_000_000],
                         ids=["lines", "escapes", "long"])
def test_a_map_s_frame_is_told_quoted_on_one_line_and_cut(talk, frame):
    said = len(talk.process.output)
    talk.client.publish_map(changed(frame_id=frame))
    assert refusal(talk, said).isprintable()
    lines = talk.process.output[said:].splitlines()
    assert [line for line in lines if not line.isprintable() or line.startswith("[ERROR] [1.0]") or len(line) > 600] == []


def test_the_name_of_a_map_file_is_told_on_one_line(on_other_maps, tmp_path):
    name = "a\n[ERROR] [1.0] [planner]: forged\x1b[2J.yaml"
    save_map(box(), tmp_path / "box.yaml")
    (tmp_path / name).write_text((tmp_path / "box.yaml").read_text())
    said = len(on_other_maps.process.output)
    for file in (tmp_path / name, tmp_path / f"no {name}"):
        on_other_maps.client.call(LoadMap, "load_map", map_url=str(file))
    on_other_maps.client.wait_for_word("no a ")
    lines = on_other_maps.process.output[said:].splitlines()
    assert [line for line in lines if not line.isprintable() or line.startswith("[ERROR] [1.0]")] == []
    assert any("Took a map of 100 x 100 cells: a [ERROR]" in line for line in lines)


def test_a_map_whose_origin_is_turned_is_planned_on(on_other_maps):
    yaw = 0.5
    turned_box = GridMap(box().data, 0.1, (100.0, -50.0, yaw))
    take(on_other_maps, grid_message(turned_box, "map", Time()))
    (start, goal) = ((*turned_box.to_map_frame(np.array(pose[:2])).tolist(), pose[2] + yaw) for pose in (START, GOAL))
    told, poses = on_other_maps.plan(start, goal)
    assert_says(told, "0", "NONE")
    assert poses[-1].pose.position == pose_message(goal).position
    assert_says(on_other_maps.plan(START, goal)[0], "203", "START_OUTSIDE_MAP")


@pytest.mark.parametrize("origin", [(1e6, -1e6, 0.5), (5e5, 5.3e6, -2.0)])
def test_a_path_a_million_metres_off_passes_check(on_other_maps, origin):
    far = GridMap(box().data, 0.1, origin)
    on_other_maps.client.set_parameters(check_invariants=True)
    try:
        take(on_other_maps, grid_message(far, "map", Time()))
        (start, goal) = ((*far.to_map_frame(np.array(pose[:2])).tolist(), pose[2] + origin[2]) for pose in (START, GOAL))
        told, poses = on_other_maps.plan(start, goal)
    finally:
        on_other_maps.client.set_parameters(check_invariants=False)
    assert_says(told, "0", "NONE")
    assert told["audit"] == "ok"
    assert poses[0].pose.position == pose_message(start).position


@pytest.mark.parametrize(("value", "name"), [(-128, "GOAL_OCCUPIED"), (-2, "GOAL_OCCUPIED"), (101, "GOAL_OCCUPIED"),
                                             (127, "GOAL_OCCUPIED"), (25, "NONE"), (26, "GOAL_OCCUPIED")])
def test_cells_of_any_value_are_free_only_where_they_say_so(on_other_maps, value, name):
    data = np.zeros((100, 100), np.int8)
    data[:, 60:] = value
    take(on_other_maps, changed(data=array.array("b", data.tobytes())))
    assert on_other_maps.plan(START, GOAL)[0]["error_name"] == name


@pytest.mark.parametrize(("value", "words"), [
    (1, "no value above 1, which stands for 1 % and is free"), (-2, "values from -2 to 4"), (127, "values from 0 to 127")])
def test_cells_that_were_likely_meant_otherwise_are_told_once(on_other_maps, value, words):
    client, said = on_other_maps.client, len(on_other_maps.process.output)
    for column in (80, 90):
        data = np.zeros((100, 100), np.int8)
        data[:, column], data[0, 0] = value, min(value * value, 100)
        take(on_other_maps, changed(data=array.array("b", data.tobytes())))
    client.wait_for(lambda: any(status.level == DiagnosticStatus.WARN and words in status.message for status in client.statuses),
                    "the warning as a status")
    assert on_other_maps.process.output[said:].count(words) == 1


def test_probabilities_are_free_and_occupied_by_thresholds_that_can_be_set(on_other_maps):
    """Free cells of 5 to 34 %, as cartographer publishes them."""
    client = on_other_maps.client
    data = np.random.default_rng(1).integers(5, 35, (100, 100)).astype(np.int8)
    data[40:60, 40:60], data[50, 15], data[0, 0] = 70, 29, 100
    take(on_other_maps, changed(data=array.array("b", data.tobytes())))
    assert_says(on_other_maps.plan((1.55, 5.05, 0.0), GOAL)[0], "205", "START_OCCUPIED",
                "(1.55, 5.05) lies in unknown space, a cell of 29 % (free is up to 25 %, occupied from 65 % on)",
                "set free_thresh to 0.29 or above")
    assert client.set_parameters(free_thresh=0.35).successful
    told, _ = on_other_maps.plan((1.55, 5.05, 0.0), GOAL)
    assert (told["error_name"], told["map_id"]) == ("NONE", GridMap(data, 0.1, thresholds=Thresholds(free_up_to=35)).id)
    assert_says(on_other_maps.plan(IN_THE_BOX, GOAL)[0], "205", "START_OCCUPIED", "lies in an obstacle, a cell of 70 %")
    assert client.set_parameters(occupied_thresh=0.71).successful
    assert_says(on_other_maps.plan(IN_THE_BOX, GOAL)[0], "205", "START_OCCUPIED", "unknown space, a cell of 70 %", "from 71 %")
    refused = client.set_parameters(occupied_thresh=0.35)
    assert not refused.successful and "make free_thresh the smaller one" in refused.reason
    assert client.set_parameters(occupied_thresh=0.65, free_thresh=0.25).successful


def test_cells_between_the_thresholds_are_free_at_a_cost_where_that_is_asked_for(on_other_maps):
    """The costmap of an inflation layer: 100 is lethal, 99 and less are costs."""
    client = on_other_maps.client
    data = np.full((100, 100), 99, np.int8)
    data[0, 0] = 100
    take(on_other_maps, changed(data=array.array("b", data.tobytes())))
    assert client.set_parameters(occupied_thresh=0.995, free_thresh=0.0).successful
    assert_says(on_other_maps.plan(START, GOAL)[0], "205", "START_OCCUPIED", "a cell of 99 %")
    assert client.set_parameters(cost_weight=2.0).successful
    told, _ = on_other_maps.plan(START, GOAL)
    assert told["error_name"] == "NONE" and float(told["cost"]) == pytest.approx(2.98 * float(told["path_length"]), rel=1e-3)
    assert client.set_parameters(cost_weight=0.0, occupied_thresh=0.65, free_thresh=0.25).successful
    assert_says(on_other_maps.plan(START, GOAL)[0], "205", "START_OCCUPIED", "an obstacle, a cell of 99 %")


@pytest.mark.parametrize("message", [changed(width=1, height=1, data=cells(1)), changed(data=array.array("b", [100] * 10_000)),
                                     changed(data=array.array("b", [-1] * 10_000)),
                                     changed(width=20_000, height=1, data=cells(20_000))],
                         ids=["one cell", "occupied", "unknown", "one row"])
def test_a_map_without_room_is_taken_and_the_start_refused(on_other_maps, message):
    take(on_other_maps, message)
    assert on_other_maps.plan((0.05, 0.05, 0.0), (0.06, 0.05, 0.0))[0]["error_name"] == "START_OCCUPIED"


def test_maps_that_come_while_it_plans_hold_from_the_next_request_on(on_other_maps):
    talk, client = on_other_maps, on_other_maps.client
    client.set_parameters(planner="rrt_star", samples=10_000_000, planning_time=60.0)
    talk.start(START)
    before = talk.goal(GOAL, error_name="NONE")["map_id"]
    for column in range(90, 100):
        data = box().data.copy()
        data[:, column:] = OCCUPIED
        client.publish_map(changed(width=7))
        take(talk, changed(data=array.array("b", data.tobytes())))
    client.call(Trigger, "cancel")
    end = client.wait_for(lambda: client.statuses[-1] if "cancelled" in client.statuses[-1].message else None, "the end")
    assert end.level == DiagnosticStatus.WARN
    assert {item.key: item.value for item in end.values}["map_id"] == before
    client.set_parameters(**QUICK)
    assert talk.goal(GOAL)["map_id"] == grid_from(changed(data=array.array("b", data.tobytes())), "map", 20_000).id


# By file

FIELDS = {"image": "good.pgm", "resolution": "0.1", "origin": "[0, 0, 0]", "negate": "0", "occupied_thresh": "0.65",
          "free_thresh": "0.196"}
SQUARE = [[0, 0], [9, 0], [9, 9], [0, 9], [0, 0]]
TIE = [[0, 0], [9, 9], [9, 0], [0, 9], [0, 0]]
MISSING, DATA, METADATA = (LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST, LoadMap.Response.RESULT_INVALID_MAP_DATA,
                           LoadMap.Response.RESULT_INVALID_MAP_METADATA)


def yaml_of(**changes):
    return "".join(f"{key}: {value}\n" for key, value in {**FIELDS, **changes}.items() if value is not None)


def geojson(*rings, role="bounds"):
    features = [{"type": "Feature", "properties": {"role": role}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
                for ring in rings]
    return json.dumps({"type": "FeatureCollection", "features": features})


@pytest.fixture(scope="module")
def bad_files(tmp_path_factory):
    """A folder in which each bad file of a test is written beside an image that is good."""
    folder = tmp_path_factory.mktemp("bad")
    (folder / "good.pgm").write_bytes(b"P5\n2 2\n255\n" + bytes(4))
    (folder / "folder.yaml").mkdir()
    return folder


def assert_not_loaded(talk, url, result, words):
    said = len(talk.process.output)
    response = talk.client.call(LoadMap, "load_map", map_url=url)
    assert response.result == result
    line = refusal(talk, said)
    assert [word for word in words if word not in line] == [], line
    assert not line.endswith("..")


@pytest.mark.parametrize(("name", "content", "result", "words"), [
    ("a.yaml", "", METADATA, ["empty"]), ("a.yaml", b"\xff\xfe\x00", METADATA, ["UTF-8"]),
    ("a.yaml", "a: [", METADATA, ["YAML"]), ("a.yaml", "just text", METADATA, ["YAML"]),
    ("a.yaml", "[" * 5000, METADATA, ["YAML"]), ("a.yaml", "#" * 2**21, METADATA, ["16384 bytes"]),
    ("a.yaml", yaml_of(image=None), METADATA, ["image"]), ("a.yaml", yaml_of(resolution=None), METADATA, ["resolution"]),
    ("a.yaml", yaml_of(resolution="-0.1"), METADATA, ["resolution", "-0.1"]),
    ("a.yaml", yaml_of(resolution="0"), METADATA, ["resolution"]),
    ("a.yaml", yaml_of(resolution=".nan"), METADATA, ["resolution", "nan"]),
    ("a.yaml", yaml_of(resolution="1e-9"), METADATA, ["cannot be planned on"]),
    ("a.yaml", yaml_of(origin="[0, 0]"), METADATA, ["origin"]), ("a.yaml", yaml_of(origin="[0, nan, 0]"), METADATA, ["origin"]),
    ("a.yaml", yaml_of(negate="2"), METADATA, ["negate"]), ("a.yaml", yaml_of(mode="grey"), METADATA, ["mode", "grey"]),
    ("a.yaml", yaml_of(occupied_thresh="65"), METADATA, ["occupied_thresh", "65"]),
    ("a.yaml", yaml_of(free_thresh="0.9"), METADATA, ["free_thresh", "0.9"]),
    ("a.yaml", yaml_of(image="nowhere.pgm"), MISSING, ["image", "nowhere.pgm"]),
    ("a.yaml", yaml_of(image="."), MISSING, ["image", "directory"]),
    ("a.yaml", yaml_of(image="a.yaml"), DATA, ["image", "PGM"]),
    ("a.pgm", b"P5\n2 2\n255\n" + bytes(4), DATA, ["'.pgm'", ".yaml"]), ("a.txt", "text", DATA, ["'.txt'"]),
    ("a", "text", DATA, ["ending"]),
    ("a.geojson", "{", DATA, ["JSON"]), ("a.geojson", "[" * 100_000, DATA, ["JSON"]),
    ("a.geojson", b"\x89PNG\xff", DATA, ["UTF-8"]),
    ("a.geojson", geojson(), DATA, ["0 features", "bounds"]), ("a.geojson", geojson(SQUARE, role="post"), DATA, ["bounds"]),
    ("a.geojson", geojson(TIE), DATA, ["Self-intersection"]), ("a.geojson", geojson(SQUARE[:-1]), DATA, ["not closed"]),
    ("a.geojson", geojson([[0, 0], [NAN, 0], [9, 9], [0, 0]]), DATA, ["position 2", "nan"]),
    ("a.wkt", "", DATA, ["empty"]), ("a.wkt", "POINT (0 0)", DATA, ["POINT"]), ("a.wkt", "POLYGON ((0 0, 1 0", DATA, ["valid"]),
    ("a.wkt", "POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))", DATA, ["Self-intersection"]),
])
def test_a_map_file_that_is_none_is_refused_and_the_map_stays(talk, bad_files, name, content, result, words):
    (bad_files / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert_not_loaded(talk, str(bad_files / name), result, [name, *words])


@pytest.mark.parametrize(("content", "words"), [
    (b"", ["empty"]), (b"P5\n2 2\n255\n" + bytes(3), ["truncated", "3 of 4"]), (b"P2\n2 2\n255\n0 0 0", ["3 of 4"]),
    (b"P5\n0 2\n255\n", ["width"]), (b"P5 30000 30000 255\n", ["900000000 cells", "max_map_cells = 20000"]),
    (b"P5\n2 2\n70000\n" + bytes(8), ["maxval"]), (b"\x89PNG\r\n\x1a\n", ["damaged"]),
    (b"\x89PNG\r\n\x1a\n" + bytes(50), ["damaged"]),
    (b"BM" + bytes(60), ["damaged"]), (bytes(range(256)) * 4, ["PGM"]), (b"\xff\xd8\xff\xe0 JFIF", ["PGM"]),
])
def test_an_image_that_is_none_is_refused_and_the_map_stays(talk, bad_files, content, words):
    (bad_files / "bad.pgm").write_bytes(content)
    (bad_files / "a.yaml").write_text(yaml_of(image="bad.pgm"))
    assert_not_loaded(talk, str(bad_files / "a.yaml"), DATA, ["image 'bad.pgm'", *words])


@pytest.mark.parametrize(("url", "words"), [
    ("", ["empty"]), ("nowhere.yaml", ["nowhere.yaml", "no such map file", "maze.yaml"]),
    ("/", ["/: is a directory; give the map file in it"]),
    ("/nowhere/a.yaml", ["/nowhere/a.yaml"]), ("/dev/zero", ["no such map file"]), ("n" * 5000 + ".yaml", ["no such map file"]),
    ("two\nlines\x1b[0m.yaml", ["two", "lines"]), ("http://example.org/maze.yaml", ["http://", "file://"]),
    ("s3://bucket/maze.yaml", ["s3://", "file://"]), ("file://elsewhere/maze.yaml", ["'elsewhere'", "file:///PATH"]),
    ("file:///nowhere.yaml", ["no such map file"]), ("package://nowhere/maze.yaml", ["nowhere", "AMENT_PREFIX_PATH"]),
    ("package://dubins_rrt_ros/../maze.yaml", ["'..'"]), ("package:///maze.yaml", ["package://PACKAGE/PATH"]),
])
def test_a_map_that_is_not_there_is_refused_and_the_map_stays(talk, url, words):
    assert_not_loaded(talk, url, MISSING, words)


def test_a_folder_that_is_named_like_a_map_is_refused(talk, bad_files):
    assert_not_loaded(talk, str(bad_files / "folder.yaml"), MISSING, ["folder.yaml"])
