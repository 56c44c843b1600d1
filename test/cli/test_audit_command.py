"""`dubins_rrt audit`, by what it prints, writes and returns."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning import PolygonMap, Problem, Settings, Vehicle, load_map, plan, rasterise, save_map
from dubins_rrt_ros.planning.plan_file import to_document

HALL = shapely.box(0, 0, 12, 10).difference(shapely.box(5, 0, 6, 6))
FOOTPRINT = "[[0.5, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.5, -0.3]]"
DISC = ["--robot-radius", "0.3"]
PROBLEM = Problem(PolygonMap(HALL), Vehicle(robot_radius=0.3), (2.0, 2.0, 1.57), (9.0, 2.0, -1.57))
SETTINGS = Settings(samples=150, planning_time=60.0, seed=4)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, with a map."""
    monkeypatch.chdir(tmp_path)
    Path("hall.wkt").write_text(HALL.wkt)


@pytest.fixture(scope="module")
def document():
    """A plan as `dubins_rrt plan --json` writes it."""
    return to_document(plan(PROBLEM, SETTINGS), "hall.wkt")


def write(document, name="path.json"):
    Path(name).write_text(json.dumps(document))
    return name


def poses(y=8.0, spacing=0.1, x=(2.0, 10.0)):
    """Straight along x."""
    return [[float(at), y, 0.0] for at in np.arange(*x, spacing)]


def run(*argv, capsys):
    status = main(["audit", *argv])
    return status, *capsys.readouterr()


def refusal(*argv, capsys):
    """The one line on standard error of a command that is used wrongly."""
    try:
        status = main(["audit", *argv])
    except SystemExit as end:
        status = end.code
    out, error = capsys.readouterr()
    assert status == 2 and out == "" and error.count("\n") == 1 and "Traceback" not in error
    return error


def test_a_plan_passes_with_its_figures(document, capsys):
    status, out, error = run(write(document), "hall.wkt", capsys=capsys)
    assert status == 0 and error == "" and out.count("\n") == 1
    for figure in ("path.json passes: ", f"length {document['length']:.3f} m", "robot radius of 0.3 m", "turning radius of 1 m",
                   f"least clearance {document['min_clearance']:.4f} m", f"curvature {document['max_curvature']:.4f} 1/m"):
        assert figure in out


def test_a_plan_fails_for_each_thing_that_is_wrong_with_it(document, capsys):
    wrong = json.loads(json.dumps(document))
    wrong["curves"][0]["lengths"][1] += 0.1
    status, out, _ = run(write(wrong), "hall.wkt", "--turning-radius", "1.2", "--goal", "9", "2.5", "-1.57", capsys=capsys)
    verdict, *found = out.splitlines()
    assert status == 1 and verdict.startswith(f"path.json fails with {len(found)} findings: ")
    for what in ("jumps", "tighter than 1.2 m", "0.500000 m and 0.000000 rad from the goal"):
        assert what in out


def test_flags_replace_what_a_plan_says_of_the_vehicle(document, capsys):
    file = write(document)
    assert run(file, "hall.wkt", "--robot-radius", "2.5", capsys=capsys)[0] == 1
    assert run(file, "hall.wkt", "--footprint", FOOTPRINT, capsys=capsys)[0] == 0
    document = document | {"vehicle": document["vehicle"] | {"footprint": FOOTPRINT, "wheelbase": 0.5, "max_steering_angle": 0.4}}
    file = write(document)
    status, out, _ = run(file, "hall.wkt", capsys=capsys)
    assert status == 1 and "tighter than 1.18261 m" in out
    status, out, _ = run(file, "hall.wkt", "--turning-radius", "1", "--robot-radius", "0.25", capsys=capsys)
    assert status == 0 and "robot radius of 0.25 m" in out and "turning radius of 1 m" in out


def test_a_flag_that_another_one_overrides_is_told(document, capsys):
    both = ("--robot-radius", "0.1", "--footprint", FOOTPRINT)
    for file in (write(document), write(poses(), "poses.json")):
        status, out, error = run(file, "hall.wkt", *both, capsys=capsys)
        assert status == 0 and "of its footprint" in out
        assert error == "dubins_rrt audit: warning: --robot-radius has no effect, as --footprint takes its place\n"


def test_a_plan_is_judged_on_the_map_that_is_given(document, capsys):
    Path("other.wkt").write_text((HALL - shapely.box(4, 6, 7, 10)).wkt)
    status, out, _ = run(write(document), "other.wkt", capsys=capsys)
    assert status == 1 and "less than the robot's radius" in out.splitlines()[1] and "it was planned on another one" in out
    Path("other.wkt").write_text((HALL - shapely.box(0, 9.99, 0.01, 10)).wkt)
    assert run(write(document), "other.wkt", capsys=capsys)[0] == 1
    assert run(write(document), "other.wkt", "--any-map", capsys=capsys)[0] == 0


def test_the_poses_of_a_plan_are_judged_for_they_are_driven(document, capsys):
    def moved(pose, x=0.0, y=0.0, yaw=0.0):
        return [pose[0] + x, pose[1] + y, pose[2] + yaw]

    good, count = document["poses"], len(document["poses"])
    for wrong, says in (
            ([good[0], *(moved(pose, y=-3.0) for pose in good[1:-1]), good[-1]], f"{count - 2} of {count} poses are off"),
            ([good[0], *(moved(pose, x=9e8) for pose in good[1:-1]), good[-1]], f"{count - 2} of {count} poses are off"),
            ([*good[:9], moved(good[9], yaw=1e-3), *good[10:]], "pose 9 at "),
            ([*good[:9], moved(good[9], x=1e-5), *good[10:]], "pose 9 at "),
            ([*good[:20], good[19], good[10], *good[20:]], "pose 21 at "),
            ([*good[:20], *good[22:]], "more than the 0.075 m of path_spacing"), ([good[0], good[-1]], "of path_spacing")):
        status, out, _ = run(write(document | {"poses": wrong}), "hall.wkt", capsys=capsys)
        assert status == 1 and says in out, says


def test_a_plan_of_an_earlier_version_is_judged(capsys):
    document = to_document(plan(PROBLEM, replace(SETTINGS, preferred_clearance=0.0)), "hall.wkt")
    later = {"stop_gap", "length_proof", "preferred_clearance", "clearance_weight", "cost_weight", "start_slack"}
    old = document | {"settings": {name: value for name, value in document["settings"].items() if name not in later}}
    assert run(write(old), "hall.wkt", capsys=capsys)[0] == 0
    wrong = [[x, y - 3.0 if 0 < index < len(old["poses"]) - 1 else y, yaw] for index, (x, y, yaw) in enumerate(old["poses"])]
    status, out, _ = run(write(old | {"poses": wrong}), "hall.wkt", capsys=capsys)
    assert status == 1 and "poses are off" in out


def test_every_joint_of_a_plan_is_among_its_poses(document, capsys):
    settings = document["settings"] | {"path_spacing": 1.0}
    without = document["poses"][::3] + document["poses"][-1:] * (len(document["poses"]) % 3 != 1)
    status, out, _ = run(write(document | {"poses": without, "settings": settings}), "hall.wkt", capsys=capsys)
    assert status == 1 and "no pose is where the curvature changes" in out


@pytest.mark.parametrize(("field", "value"), [
    ("length", 12.0), ("path_length", 12.0),
    ("length", "long"), ("length", None), ("lower_bound", 1e3), ("lower_bound", -1.0), ("lower_bound", 1.0),
    ("gap", 0.0), ("gap", None), ("cost", None), ("cost_lower_bound", 99.0), ("cost_gap", 0.0), ("roomy_share", 0.5),
    ("min_clearance", 1.5), ("max_curvature", 0.5), ("error_code", 208), ("error_name", "TIMEOUT"),
    ("audit", "fine"), ("map_id", "0123456789ab"), ("planner", "rrt"), ("seed", 99)])
def test_a_figure_that_is_not_the_path_s_is_found(document, field, value, capsys):
    status, out, _ = run(write(document | {field: value}), "hall.wkt", capsys=capsys)
    verdict, finding = out.splitlines()
    assert status == 1 and "fails with 1 finding: " in verdict
    assert field in finding or (field == "lower_bound" and finding.startswith("gap is "))


def test_the_cost_of_clearance_is_measured_anew(capsys):
    """A mile from a wall a metre costs a metre; along a wall it costs more, and a document has to say how much."""
    world = load_map("hall.wkt")
    problem = Problem(world, Vehicle(robot_radius=0.3), (2.0, 2.0, math.pi / 2), (9.0, 2.0, -math.pi / 2))
    found = to_document(plan(problem, Settings(seed=1, samples=50, planning_time=60.0, preferred_clearance=3.0)), "hall.wkt")
    assert found["cost"] > 1.05 * found["length"] and found["cost_lower_bound"] <= found["cost"]
    assert run(write(found), "hall.wkt", capsys=capsys)[0] == 0
    for share in (0.99, 1.01):
        status, out, _ = run(write(found | {"cost": share * found["cost"]}), "hall.wkt", capsys=capsys)
        assert status == 1 and f"cost is {share * found['cost']:.6g}"[:10] in out
    assert 0 < found["roomy_share"] < 1
    assert "roomy_share is 1.0" in run(write(found | {"roomy_share": 1.0}), "hall.wkt", capsys=capsys)[1]


def test_what_is_not_judged_is_named(document, capsys):
    file = write(document | {"colour": "red"})
    status, out, _ = run(file, "hall.wkt", "--json", "verdict.json", capsys=capsys)
    named = ["message", "found_by", "samples", "tree_nodes", "time_to_first", "time_to_found", "planning_time", "map_time",
             "lower_bound (that no path is shorter)", "cost_lower_bound (that no path costs less)", "work", "map",
             "settings (by which it was sought)", "version", "colour"]
    assert status == 0 and out.endswith(f"Not judged: {', '.join(named)}.\n")
    assert json.loads(Path("verdict.json").read_text())["not_judged"] == named
    status, out, _ = run(file, "hall.wkt", "--robot-radius", "0.25", capsys=capsys)
    assert status == 0 and "min_clearance" in out.split("Not judged: ")[1]


def test_a_document_that_holds_no_plan_with_a_path_takes_one_line(document, capsys):
    nothing = document | {"error_name": "NO_VALID_PATH", "curves": [], "poses": []}
    assert "NO_VALID_PATH" in refusal(write(nothing), "hall.wkt", capsys=capsys)
    assert "start holds" in refusal(write(document | {"start": [10**400, 0, 0]}), "hall.wkt", capsys=capsys)
    assert "start holds" in refusal(write(document | {"start": [float("nan"), 0, 0]}), "hall.wkt", capsys=capsys)
    assert "field settings" in refusal(write({"curves": [], "poses": poses()}), "hall.wkt", capsys=capsys)


@pytest.mark.parametrize("wrapped", [False, True])
def test_poses_are_judged_with_the_vehicle_of_the_flags(wrapped, capsys):
    file = write({"poses": poses(), "planner": "theirs"} if wrapped else poses())
    status, out, error = run(file, "hall.wkt", *DISC, capsys=capsys)
    assert status == 0 and error == "" and "length 7.900 m" in out and "least clearance 2.0000 m for a robot radius of 0.3" in out
    status, out, _ = run(file, "hall.wkt", "--footprint", FOOTPRINT, capsys=capsys)
    assert status == 0 and "least clearance 1.6000 m of its footprint" in out
    status, out, _ = run(write(poses(y=6.29)), "hall.wkt", *DISC, capsys=capsys)
    assert status == 1 and out.count("\n") == 2 and "the clearance is 0.29" in out
    assert run(write(poses(y=6.29)), "hall.wkt", "--footprint", FOOTPRINT, capsys=capsys)[0] == 1


def test_poses_in_csv_are_judged(document, capsys):
    """As `plan --csv` writes them."""
    for more, values in ("", ""), (",clearance,curvature", ",0.5,-1.0"):
        rows = "".join(f"{x!r},{y!r},{theta!r}{values}\n" for x, y, theta in document["poses"])
        Path("path.csv").write_text(f"x,y,theta{more}\n{rows}")
        status, out, _ = run("path.csv", "hall.wkt", *DISC, capsys=capsys)
        assert status == 0 and f"length {document['length']:.3f} m" in out
    Path("path.csv").write_text("x,y,theta\n1,2,three\n")
    assert "path.csv: line 2 is '1,2,three'" in refusal("path.csv", "hall.wkt", *DISC, capsys=capsys)


def test_an_echoed_path_message_is_judged(capsys):
    """As `ros2 topic echo /plan --once` writes it."""
    def echoed(y):
        poses = "".join(f"- header:\n    frame_id: map\n  pose:\n    position:\n      x: {x}\n      y: {y}\n      z: 0.0\n"
                        "    orientation:\n      x: 0.0\n      y: 0.0\n      z: 0.0\n      w: 1.0\n" for x, _, _ in poses_along())
        return f"header:\n  stamp:\n    sec: 1\n    nanosec: 2\n  frame_id: map\nposes:\n{poses}---\n"

    poses_along = poses
    Path("path.yaml").write_text(echoed(8.0))
    status, out, _ = run("path.yaml", "hall.wkt", *DISC, capsys=capsys)
    assert status == 0 and "length 7.900 m" in out
    Path("path.yaml").write_text(echoed(6.29))
    assert run("path.yaml", "hall.wkt", *DISC, capsys=capsys)[0] == 1
    Path("path.yaml").write_text(echoed(8.0) + echoed(6.29))
    assert "path.yaml: holds 2 messages; give one" in refusal("path.yaml", "hall.wkt", *DISC, capsys=capsys)


@pytest.mark.parametrize("nothing", ["header:\n  frame_id: map\nposes: []\n---\n", "x,y,theta\n"])
def test_a_path_without_poses_is_told_as_such(nothing, capsys):
    """As the node publishes it where there is none."""
    Path("path").write_text(nothing)
    assert "path: holds a path without poses" in refusal("path", "hall.wkt", *DISC, capsys=capsys)


def test_poses_that_are_off_are_found_unless_the_tolerances_allow_it(capsys):
    jump = poses()
    for pose in jump[40:]:
        pose[1] += 0.01
    status, out, _ = run(write(jump), "hall.wkt", *DISC, capsys=capsys)
    assert status == 1 and "more to the left than its yaw allows" in out
    assert run(write(jump), "hall.wkt", *DISC, "--tolerance-xy", "0.02", capsys=capsys)[0] == 0
    on_the_spot = [*poses(), [*poses()[-1][:2], 0.5]]
    status, out, _ = run(write(on_the_spot), "hall.wkt", *DISC, capsys=capsys)
    assert status == 1 and out.count("\n") == 2 and "turns left 0.5" in out
    assert run(write(on_the_spot), "hall.wkt", *DISC, "--tolerance-yaw", "0.6", capsys=capsys)[0] == 0


def test_the_ends_of_poses_are_judged_where_they_are_given(capsys):
    file = write(poses())
    ends = ["--start", "2", "8", "0", "--goal", "9.9", "8", "0"]
    assert run(file, "hall.wkt", *DISC, *ends, capsys=capsys)[0] == 0
    for more, what in ((["--start", "2", "8.1", "0"], "from the start"), (["--goal", "9.9", "8", "0.1"], "from the goal")):
        status, out, _ = run(file, "hall.wkt", *DISC, *more, capsys=capsys)
        assert status == 1 and what in out
    assert run(file, "hall.wkt", *DISC, "--goal", "9.9", "8", "0.1", "--goal-tolerance-yaw", "0.2", capsys=capsys)[0] == 0


def test_unknown_space_of_a_grid_may_be_allowed(capsys):
    grid = rasterise(PolygonMap(HALL), 0.25)
    data = grid.data.copy()
    data[:, 30] = -1
    save_map(type(grid)(data, grid.resolution, grid.origin), "hall.yaml")
    assert run(write(poses()), "hall.yaml", *DISC, capsys=capsys)[0] == 1
    assert run(write(poses()), "hall.yaml", *DISC, "--allow-unknown", capsys=capsys)[0] == 0
    assert "max_map_cells" in refusal("path.json", "hall.yaml", "--max-map-cells", "100", capsys=capsys)


def test_the_verdict_is_written(capsys):
    status, out, error = run(write(poses(y=6.29)), "hall.wkt", *DISC, "--json", "-", capsys=capsys)
    verdict = json.loads(out)
    assert status == 1 and error.startswith("path.json fails with 1 finding: ") and not verdict["ok"]
    assert verdict["findings"] == error.splitlines()[1:] and verdict["min_clearance"] == pytest.approx(0.29)
    assert verdict["length"] == pytest.approx(7.9) and verdict["max_curvature"] == 0
    assert verdict["start"] == [2.0, 6.29, 0.0] and verdict["vehicle"]["robot_radius"] == 0.3 and verdict["map"] == "hall.wkt"
    run(write(poses()), "hall.wkt", *DISC, "--json", "verdict.json", capsys=capsys)
    assert json.loads(Path("verdict.json").read_text())["ok"]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_path_beyond_all_bounds_is_written_without_its_length(document, capsys):
    endless = json.loads(json.dumps(document))
    endless["curves"][0]["lengths"] = [1e308] * 3
    status, out, _ = run(write(endless), "hall.wkt", "--json", "-", capsys=capsys)
    assert status == 1 and json.loads(out)["length"] is None and "jumps" in json.loads(out)["findings"][0]


def test_a_step_of_next_to_nothing_is_a_turn_on_the_spot(capsys):
    Path("around.wkt").write_text(shapely.box(-4, -4, 4, 4).wkt)
    status, out, error = run(write([[0, 0, 0], [1e-320, 0, 0.1]]), "around.wkt", *DISC, capsys=capsys)
    assert status == 1 and error == "" and out.count("\n") == 2 and "curvature 0.0000 1/m" in out and "turns left 0.1" in out


@pytest.mark.parametrize(("document", "names"), [
    ([], "holds no poses"), ({}, "holds no poses"), ({"poses": {}}, "holds no poses"), (3, "holds no poses"),
    ([[1, 2, 3], [1, float("nan"), 3]], "pose 1 is [1, nan, 3]"), ([[1, 2, float("inf")]], "pose 0 is"),
    ([[1, 2]], "pose 0 is [1, 2]"), ([[1, 2, "3"]], "pose 0 is"), ([{"x": 1}], "pose 0 is"), ([[1, 2, 10**400]], "pose 0 is"),
    ([[1, 2, True]], "pose 0 is"), ([[1, 2, 1e9]], "none beyond 1e+06")])
def test_a_file_that_holds_no_path_takes_one_line(document, names, capsys):
    assert names in refusal(write(document), "hall.wkt", *DISC, capsys=capsys)


@pytest.mark.parametrize(("argv", "names"), [
    (["nowhere.json", "hall.wkt"], "nowhere.json"), (["hall.wkt", "hall.wkt"], "hall.wkt is no JSON file"),
    (["path.json", "nowhere.yaml"], "nowhere.yaml"), (["path.json"], "MAP"),
    (["path.json", "hall.wkt", "--turning-radius", "-1"], "turning_radius is -1"),
    (["path.json", "hall.wkt", "--footprint", "[[1, 2]]"], "footprint is '[[1, 2]]'"),
    (["path.json", "hall.wkt", "--tolerance-xy", "-1"], "--tolerance-xy is -1"),
    (["path.json", "hall.wkt", "--tolerance-yaw", "nan"], "--tolerance-yaw is nan"),
    (["path.json", "hall.wkt", "--start", "nan", "1", "2"], "The start pose"),
    (["path.json", "hall.wkt", "--samples", "3"], "--samples"), (["path.json", "hall.wkt", "--json", "."], "is a folder")])
def test_wrong_usage_takes_one_line(argv, names, capsys):
    write(poses())
    assert names in refusal(*argv, capsys=capsys)


def test_the_help_teaches_by_an_example_that_runs(capsys):
    with pytest.raises(SystemExit):
        main(["audit", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert "dubins_rrt audit theirs.json maze --turning-radius 1 --footprint" in text and "[[x, y, yaw], ...]" in text


def test_figures_beyond_all_maps_are_short(document, capsys):
    *curves, last = document["curves"]
    for change in ({"goal": [1e300, 2.0, 0.0]}, {"curves": [*curves, last | {"lengths": [1e200, 1e200, 1e200]}]},
                   {"curves": [*curves, last | {"start": [1e300, -1e300, 0.0]}]},
                   {"waypoints": [[1e300, 1.0]], "waypoint_indices": [0]}):
        status, out, error = run(write(document | change), "hall.wkt", capsys=capsys)
        assert (status, error) == (1, "")
        assert "e+" in out and max(map(len, re.findall(r"[\d.]+", out))) < 20
