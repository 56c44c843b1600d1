"""What commands read besides maps: byte order marks, pipes and devices, poses that are none, and what is likely a slip."""

import json
import os
from pathlib import Path

import pytest
import shapely

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning import load_map

SQUARE = shapely.box(0, 0, 12, 10)
PROBLEM = {"name": "square", "map": "square.wkt", "start": [2, 2, 0], "goal": [9, 2, 0], "turning_radius": 1.0,
           "robot_radius": 0.3}
REQUEST = ["--start", "2", "2", "0", "--goal", "9", "2", "0", "--samples", "30", "--seed", "4"]
ECHOED = """header:
  frame_id: map
poses:
- pose:
    position: {x: 2.0, y: 8.0, z: 0.0}
    orientation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}
- pose:
    position: {x: 3.0, y: 8.0, z: 0.0}
    orientation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}
"""
CSV = "x,y,theta\n2,8,0\n3,8,0\n"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, with a map."""
    monkeypatch.chdir(tmp_path)
    Path("square.wkt").write_text(SQUARE.wkt)


def run(*words, status, capsys):
    assert main(words) == status
    return capsys.readouterr()


def refusal(*words, capsys):
    """The one line on standard error of a command that is used wrongly."""
    out, error = run(*words, status=2, capsys=capsys)
    assert out == "" and error.count("\n") == 1 and error[:-1].isprintable()
    return error


def plan_of(**changes):
    """The document of a plan, with changes."""
    main(["plan", "square.wkt", *REQUEST, "--json", "plan.json"])
    document = json.loads(Path("plan.json").read_text())
    return json.dumps(document | {name: document[name] | value if isinstance(value, dict) else value
                                  for name, value in changes.items()})


COMMANDS = {"audit": ["audit", "FILE", "square.wkt"], "replay": ["plan", "--replay", "FILE"],
            "bench": ["bench", "FILE", "--out", "runs.jsonl", "--samples", "30", "--seeds", "1"]}


def words_for(command, file):
    return [file if word == "FILE" else word for word in COMMANDS[command]]


@pytest.mark.parametrize("text", [ECHOED, "---\n" + ECHOED, CSV, "[[2, 8, 0], [3, 8, 0]]"],
                         ids=["echo", "document", "csv", "json"])
def test_poses_with_a_byte_order_mark_are_read(text, capsys):
    Path("poses.txt").write_text(text, "utf-8-sig")
    assert "passes" in run("audit", "poses.txt", "square.wkt", status=0, capsys=capsys).out


@pytest.mark.parametrize("command", ["audit", "replay", "bench"])
def test_json_with_a_byte_order_mark_is_read(command, capsys):
    text = json.dumps([PROBLEM]) if command == "bench" else plan_of()
    Path("file.json").write_text(text, "utf-8-sig")
    run(*words_for(command, "file.json"), status=0, capsys=capsys)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_pipe_that_nobody_writes_to_is_not_waited_for(command, capsys):
    os.mkfifo("pipe")
    assert "pipe is no JSON file" in refusal(*words_for(command, "pipe"), capsys=capsys)
    assert not Path("runs.jsonl").exists()


def test_a_pipe_with_poses_is_read(capsys):
    out, into = os.pipe()
    os.write(into, CSV.encode())
    os.close(into)
    assert "passes" in run("audit", f"/dev/fd/{out}", "square.wkt", status=0, capsys=capsys).out
    os.close(out)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_device_without_an_end_and_a_name_without_a_letter_are_refused(command, monkeypatch, capsys):
    monkeypatch.setattr("dubins_rrt_ros.cli.common.documents.MAX_STREAM_BYTES", 1000)
    line = refusal(*words_for(command, "/dev/zero"), capsys=capsys)
    assert "/dev/zero is a pipe or device that gives more than 1000 bytes" in line
    assert "the name of a file to read is empty" in refusal(*words_for(command, ""), capsys=capsys)


def test_a_link_to_itself_is_no_map_and_no_output(capsys):
    os.symlink("loop.wkt", "loop.wkt")
    assert "loop.wkt: no such map file" in refusal("plan", "loop.wkt", *REQUEST, capsys=capsys)
    Path("problems.json").write_text(json.dumps([PROBLEM]))
    assert "loop.wkt cannot be written" in run("bench", "problems.json", "--out", "loop.wkt", status=2, capsys=capsys).err


@pytest.mark.parametrize(("text", "names"), [
    (ECHOED.replace("w: 1.0", "w: 0.0"), ["pose 0 has the quaternion x 0, y 0, z 0, w 0", "give a rotation"]),
    (ECHOED.replace("y: 0.0, z: 0.0, w: 1.0", "y: 0.7071, z: 0.0, w: 0.7071"), ["pose 0", "y 0.7071", "no yaw follows"]),
    (ECHOED.replace("x: 3.0", "x: 3.0, x: 4.0"), ["x is given twice", "give it once"]),
    (ECHOED.replace("y: 8.0", "y: .nan"), ["pose 0 is {", "give a geometry_msgs/PoseStamped of finite numbers"]),
    (ECHOED.replace("x: 3.0", "x: 3_0"), ["pose 1 is {"]),
    (ECHOED + "- '...'\n", ["the poses from 2 on are left out", "--full-length"]),
    (CSV + "4,8\n", ["line 4 is '4,8'", "give three numbers"]), (CSV + "\n4_0,8,0\n", ["line 5 is '4_0,8,0'"]),
    (CSV + "4,8,zero\n", ["line 4 is '4,8,zero'"]),
], ids=["no rotation", "vertical", "repeated key", "nan", "underscore", "left out", "short row", "underscore in a row",
        "text row"])
def test_a_pose_that_is_none_is_named(text, names, capsys):
    Path("poses.txt").write_text(text)
    line = refusal("audit", "poses.txt", "square.wkt", capsys=capsys)
    assert all(name in line for name in ["poses.txt: ", *names]), line


@pytest.mark.parametrize("w", [7.0, 1e200, 1.7e308])
def test_a_rotation_that_is_not_normalised_is_taken(w, capsys):
    Path("poses.txt").write_text(ECHOED.replace("w: 1.0", f"w: {w}"))
    assert "passes" in run("audit", "poses.txt", "square.wkt", status=0, capsys=capsys).out


def test_fields_beside_poses_are_named_as_not_judged(capsys):
    Path("poses.json").write_text(json.dumps({"poses": [[2, 8, 0], [3, 8, 0]], "units": "cm", "vehicle": {"turning_radius": 5}}))
    assert "Not judged: units, vehicle." in run("audit", "poses.json", "square.wkt", status=0, capsys=capsys).out


@pytest.mark.parametrize(("changes", "says"), [
    ({"settings": {"samples": -3}}, "plan.json: samples is -3"),
    ({"vehicle": {"robot_radius": "0.2"}}, "plan.json: robot_radius is '0.2'"),
    ({"start": [1, 1, 1e9]}, "plan.json: The start pose has the yaw"),
    ({"waypoints": [["a"]]}, "plan.json: The waypoint pose is ['a']"),
], ids=["samples", "robot_radius", "start", "waypoints"])
def test_the_file_of_a_replay_is_named_with_what_is_wrong_in_it(changes, says, capsys):
    text = plan_of(**changes)
    capsys.readouterr()
    Path("plan.json").write_text(text)
    assert says in refusal("plan", "--replay", "plan.json", capsys=capsys)


def test_what_a_file_says_forges_no_line(capsys):
    Path("plan.json").write_text('{"a\\u001b[31m\\nb": 1, "a\\u001b[31m\\nb": 2}')
    assert "an object has" in refusal("plan", "--replay", "plan.json", capsys=capsys)
    for name in ("two\nlines", "\x1b[31m", "n" * 201):
        Path("problems.json").write_text(json.dumps([PROBLEM | {"name": name}]))
        assert "printable characters at most" in refusal(*words_for("bench", "problems.json"), capsys=capsys)


def test_what_is_set_to_nothing_overrides_nothing(capsys):
    for unset in ("", []):
        Path("problems.json").write_text(json.dumps([PROBLEM | {"footprint": unset, "wheelbase": 0.0}]))
        assert "no effect" not in run(*words_for("bench", "problems.json"), status=0, capsys=capsys).err


def test_a_flag_that_is_given_twice_is_told(capsys):
    _, error = run("plan", "square.wkt", *REQUEST, "--robot-radius", "0.1", "--robot-radius=0.3", status=0, capsys=capsys)
    assert error == "dubins_rrt plan: warning: --robot-radius is given 2 times; the last one counts\n"
    _, error = run("plan", "square.wkt", *REQUEST, "--via", "4", "4", "--via", "6", "4", status=0, capsys=capsys)
    assert error == ""


def test_a_grey_of_polygons_is_told(capsys):
    error = run("plan", "square.wkt", *REQUEST, "--unknown-grey", "205", status=0, capsys=capsys).err
    assert error == "dubins_rrt: warning: square.wkt: --unknown-grey has no effect on polygons\n"


def test_what_is_odd_about_a_map_is_told_with_its_name_once(capsys):
    ring = [[0, 0], [12, 0], [12, 10], [0, 10], [0, 0]]
    features = [{"type": "Feature", "properties": {"role": role}, "geometry": {"type": "Polygon", "coordinates": [[
        [y, x] if role == "obstacle" else [x, y] for x, y in ([x + 20 * (role == "obstacle"), y] for x, y in ring)]]}}
        for role in ("bounds", "obstacle")]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    Path("town.geojson").write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}))
    error = run("plan", "town.geojson", *REQUEST, status=0, capsys=capsys).err
    outside, degrees = error.splitlines()
    assert outside.startswith("dubins_rrt: warning: town.geojson: 1 of 1 obstacles lie outside of the bounds and have no effect: "
                              "feature 2, which begins at (0, 20), is the first")
    assert "its crs is 'urn:ogc:def:" in degrees and "CRS84', whose coordinates are degrees" in degrees
    assert error.count("town.geojson") == 2 and len(load_map("town.geojson").warnings) == 2


@pytest.mark.parametrize("name", ["json", "csv", "plot", "drive", "certificate"])
def test_an_empty_name_of_a_file_to_write_is_refused(name, capsys):
    """As of a variable of the shell that is not set: nothing was written, without a word."""
    error = run("plan", "square.wkt", *REQUEST, f"--{name}", "", status=2, capsys=capsys).err
    assert "the name of a file to write is empty; give one" in error


@pytest.mark.parametrize(("flags", "said"), [
    (["--start", "1_0", "4", "0"], "--start: '1_0' is no number; give digits without a unit"),
    (["--turning-radius", "1m"], "--turning-radius: '1m' is no number; give digits without a unit"),
    (["--samples", "1e3"], "--samples: '1e3' is no number; give an integer"),
    (["--informed=false"], "--informed/--no-informed: it takes no value, and has 'false'")])
def test_what_is_no_number_is_told_with_what_to_give(flags, said, capsys):
    with pytest.raises(SystemExit) as end:
        main(["plan", "square.wkt", *REQUEST, *flags])
    assert end.value.code == 2 and said in capsys.readouterr().err


def test_limits_of_a_proof_are_numbers_and_told_where_there_is_none(capsys):
    for name in ("gap", "seconds"):
        for number in ("-1", "nan", "inf"):
            assert f"--{name} is {number}; give a number" in run(
                "plan", "square.wkt", *REQUEST, f"--{name}", number, status=2, capsys=capsys).err
        error = run("plan", "square.wkt", *REQUEST, f"--{name}", "1", status=0, capsys=capsys).err
        assert error == f"dubins_rrt plan: warning: --{name} has no effect without --certificate\n"
