"""`dubins_rrt plan`, by what it prints, writes and returns."""

import json
import math
import os
import pty
import signal
import subprocess
import sys
import termios
from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning import ClearanceField, PolygonMap, Settings, rasterise, save_map

HALL = shapely.box(-6, -5, 6, 5).difference(shapely.box(-1, -5, 0, 1))
REQUEST = ["--start", "-4", "-3", "1.5707963267948966", "--goal", "3.5", "-3", "-1.5707963267948966"]
BUDGET = ["--samples", "150", "--planning-time", "60", "--seed", "4"]


@pytest.fixture
def hall(tmp_path, monkeypatch):
    """A map file in the current folder, which is empty otherwise."""
    monkeypatch.chdir(tmp_path)
    Path("hall.wkt").write_text(HALL.wkt)
    return "hall.wkt"


def run(*argv, capsys):
    status = main(["plan", *argv])
    return status, *capsys.readouterr()


def refusal(*argv, capsys):
    """The one line on standard error of a command that is used wrongly."""
    try:
        status = main(["plan", *argv])
    except SystemExit as end:
        status = end.code
    out, error = capsys.readouterr()
    assert status == 2 and out == "" and error.count("\n") == 1 and "Traceback" not in error
    return error


def test_a_path_is_told_in_one_line_with_its_figures(hall, capsys):
    status, out, error = run(hall, *REQUEST, *BUDGET, capsys=capsys)
    assert status == 0 and error == "" and out.count("\n") == 1
    for figure in (" m, ", "%", "150 samples", "Lower bound of the length ", "first path after ", "tree nodes", "seed 4"):
        assert figure in out


def test_a_yaw_beyond_a_full_turn_is_doubted_and_degrees_can_be_given(hall, capsys):
    at = ["--start", "-4", "-3", "90", "--goal", "3.5", "-3", "-90"]
    status, _, error = run(hall, *at, *BUDGET, capsys=capsys)
    assert status == 0 and error.splitlines() == [
        f"dubins_rrt plan: warning: --{name} has the yaw {yaw} rad; did you mean {meant}? --degrees takes degrees"
        for name, yaw, meant in (("start", "90", "1.5708"), ("goal", "-90", "-1.5708"))]
    status, out, error = run(hall, *at, "--degrees", *BUDGET, "--json", "-", capsys=capsys)
    assert status == 0 and "warning" not in error
    assert [json.loads(out)[name][2] for name in ("start", "goal")] == [math.pi / 2, -math.pi / 2]
    assert run(hall, *REQUEST, *BUDGET, capsys=capsys)[2] == ""


def test_the_gap_of_the_length_is_told_beside_that_of_the_cost(hall, capsys):
    _, out, error = run(hall, *REQUEST, *BUDGET, "--json", "-", capsys=capsys)
    answer = json.loads(out)
    assert f"at most {100 * answer['cost_gap']:.1f} % above the least possible" in error
    assert f"Lower bound of the length {answer['lower_bound']:.2f} m, gap {100 * answer['gap']:.1f} %, " in error


def test_a_pose_with_commas_is_told_how_it_is_written(hall, capsys):
    for numbers in (["1,2,1.57"], ["-4", "-3"]):
        error = refusal(hall, "--start", *numbers, "--goal", "3.5", "-3", "0", capsys=capsys)
        assert "argument --start: give X Y YAW, with blanks between them" in error


@pytest.mark.slow
def test_the_drive_along_a_path_is_an_animation(hall, capsys):
    assert run(hall, *REQUEST, *BUDGET, "--drive", "drive.gif", capsys=capsys)[0] == 0
    assert Image.open("drive.gif").n_frames > 50
    assert "drive.png" in refusal(hall, *REQUEST, "--drive", "drive.png", capsys=capsys)


def test_the_reference_point_of_a_car_is_told_in_help_readme_and_docs(capsys):
    with pytest.raises(SystemExit):
        main(["plan", "--help"])
    root = Path(__file__).parents[2]
    for text in (capsys.readouterr().out, (root / "README.md").read_text(), (root / "docs/dubins_curves.md").read_text()):
        assert "rear axle" in " ".join(text.split())
        assert any(formula in " ".join(text.split()) for formula in ("wheelbase / tan(max_steering_angle)", "L / tan φ",
                                                                     "`wheelbase` / tan(`max_steering_angle`)"))


def test_how_a_path_was_found_is_told(hall, capsys):
    for flags, found_by, name in ((["--planner", "rrt"], "hybrid_astar", "hybrid A*"),
                                  (["--planner", "rrt", "--paper"], "rrt", "RRT"), (["--paper"], "rrt_star", "RRT*")):
        budget = ("--samples", "5000", "--planning-time", "60", "--seed", "4", "--json", "-")
        status, out, error = run(hall, *REQUEST, *flags, *budget, capsys=capsys)
        assert status == 0
        document = json.loads(out)
        assert document["found_by"] == found_by
        assert f", found by {name}, " in document["message"] and document["message"] in error
    settings = json.loads(out)["settings"]
    assert (settings["informed"], settings["shortcut"], settings["heading_sampling"]) == (False, False, "uniform")
    assert Settings.paper(samples=7, informed=True) == Settings(samples=7, shortcut=False, heading_sampling="uniform")


def test_a_flag_that_another_one_overrides_is_told_and_the_turning_radius_that_results(hall, capsys):
    car = ("--footprint", "[[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1], [0.2, -0.1]]", "--wheelbase", "0.3",
           "--max-steering-angle", "0.5")
    status, out, error = run(hall, *REQUEST, *BUDGET, *car, capsys=capsys)
    assert (status, error) == (0, "") and "Turning radius 0.5491 m, by wheelbase and steering angle." in out
    status, out, error = run(hall, *REQUEST, *BUDGET, *car, "--robot-radius", "0.3", "--turning-radius", "1", capsys=capsys)
    assert status == 0 and error.splitlines() == [
        "dubins_rrt plan: warning: --robot-radius has no effect, as --footprint takes its place",
        "dubins_rrt plan: warning: --turning-radius has no effect, as --wheelbase takes its place"]
    status, out, error = run(hall, *REQUEST, *BUDGET, "--any-goal-heading", "--goal-tolerance-yaw", "0.2", capsys=capsys)
    assert status == 0 and error == (
        "dubins_rrt plan: warning: --goal-tolerance-yaw has no effect, as --any-goal-heading takes its place\n")


def test_unknown_space_that_counts_as_free_is_warned_about(hall, capsys):
    """A mapped room of 10 m with unknown space around, saved by map_saver and loaded with its own default of free_thresh."""
    grey = np.full((120, 120), 205, np.uint8)
    grey[10:110, 10:110] = 254
    Path("slam.pgm").write_bytes(b"P5\n120 120\n255\n" + grey.tobytes())
    Path("slam.yaml").write_text("image: slam.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
                                 "free_thresh: 0.25\n")
    request = ["slam.yaml", "--start", "5", "5", "0", "--goal", "11.5", "5", "0", *BUDGET]
    status, out, error = run(*request, capsys=capsys)
    assert status == 0 and "Cells: 100.0% free, 0.0% occupied, 0.0% unknown." in out
    assert error.startswith("dubins_rrt: warning: slam.yaml: 30.56% of the cells have the grey 205") and error.count("\n") == 1
    status, out, error = run(*request, "--unknown-grey", "205", "--json", "plan.json", capsys=capsys)
    assert status == 1 and error.startswith("206 GOAL_OCCUPIED: ") and error.count("\n") == 1
    status, out, error = run("--replay", "plan.json", "--unknown-grey", "205", capsys=capsys)
    assert status == 1 and error.startswith("206 GOAL_OCCUPIED: ")
    assert "unknown_grey is 300" in refusal(*request, "--unknown-grey", "300", capsys=capsys)


def test_a_picture_without_a_yaml_file_is_planned_on(hall, capsys):
    grey = np.full((100, 200), 254, np.uint8)
    grey[40:, 100] = 0  # a wall from below, with a way around it above
    Path("hall.pgm").write_bytes(b"P5\n200 100\n255\n" + grey.tobytes())
    request = ["hall.pgm", "--start", "1", "1", "0", "--goal", "9", "1", "0", "--robot-radius", "0.2", *BUDGET]
    status, _, error = run(*request, "--resolution", "0.05", "--json", "plan.json", capsys=capsys)
    assert status == 0 and error == "" and 9 < json.loads(Path("plan.json").read_text())["length"] < 12
    assert run("--replay", "plan.json", "--resolution", "0.05", capsys=capsys)[0] == 0
    assert "--resolution 0.05" in refusal(*request, capsys=capsys)


@pytest.mark.parametrize(("flags", "needs_samples"), [([], False), (["--no-informed", "--no-shortcut"], True)])
def test_rrt_needs_samples_only_where_hybrid_a_star_is_left_out(hall, flags, needs_samples, capsys):
    status, out, _ = run(hall, *REQUEST, *BUDGET, "--planner", "rrt", "--samples", "9000", *flags, "--json", "-", capsys=capsys)
    drawn = json.loads(out)["samples"]
    assert status == 0 and (0 < drawn < 9000 if needs_samples else drawn == 0)


def test_json_on_standard_output_stands_alone(hall, capsys):
    status, out, error = run(hall, *REQUEST, *BUDGET, "--json", "-", capsys=capsys)
    document = json.loads(out)
    assert status == 0 and document["error_code"] == 0 and document["map"] == hall
    assert document["start"] == [-4.0, -3.0, 1.5707963267948966] and document["settings"]["samples"] == 150
    assert "150 samples" in error


def test_csv_and_json_hold_the_same_poses_from_start_to_goal(hall, capsys):
    files = ["--json", "p.json", "--csv", "p.csv", "--path-spacing", "0.2"]
    assert run(hall, *REQUEST, *BUDGET, *files, capsys=capsys)[0] == 0
    header, *rows = Path("p.csv").read_text().splitlines()
    table = np.array([list(map(float, row.split(","))) for row in rows])
    poses, clearance, curvature = table[:, :3], table[:, 3], table[:, 4]
    assert header == "x,y,theta,clearance,curvature"
    np.testing.assert_allclose(clearance, ClearanceField(PolygonMap(HALL)).at(poses[:, :2]), atol=1e-9)
    assert set(np.round(curvature, 6)) <= {-1.0, 0.0, 1.0} and len(set(np.round(curvature, 6))) > 1
    assert poses.tolist() == json.loads(Path("p.json").read_text())["poses"]
    assert poses[[0, -1]].tolist() == [[-4.0, -3.0, 1.5707963267948966], [3.5, -3.0, -1.5707963267948966]]
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= 0.2
    assert shapely.covers(HALL, shapely.points(poses[:, :2])).all()


def test_the_plot_shows_the_planned_path(hall, capsys):
    from matplotlib.image import imread
    assert run(hall, *REQUEST, *BUDGET, "--preferred-clearance", "0", "--plot", "p.png", capsys=capsys)[0] == 0
    pixels = np.round(imread("p.png")[..., :3] * 255)
    assert (np.abs(pixels - [0xd5, 0x5e, 0x00]) < 3).all(axis=2).sum() > 2000


def test_no_path_gives_the_reason_in_one_line_and_the_files(hall, capsys):
    files = ["--json", "p.json", "--csv", "p.csv", "--plot", "p.svg"]
    status, out, error = run(hall, "--start", "-0.5", "-2", "0", *REQUEST[4:], *files, capsys=capsys)
    assert status == 1 and out == "" and error.startswith("205 START_OCCUPIED: ") and error.count("\n") == 1
    assert json.loads(Path("p.json").read_text())["error_name"] == "START_OCCUPIED"
    assert Path("p.csv").read_text() == "x,y,theta,clearance,curvature\n" and "START_OCCUPIED" in Path("p.svg").read_text()


@pytest.mark.parametrize("number", ["-1e-3", "-.5", "-4"])
def test_negative_numbers_are_values(hall, number, capsys):
    _, out, _ = run(hall, "--start", number, number, number, *REQUEST[4:], *BUDGET, "--json", "-", capsys=capsys)
    assert json.loads(out)["start"] == [float(number)] * 3


def test_every_option_is_a_flag(hall, capsys):
    flags = ["--turning-radius", "0.5", "--robot-radius", "0.1", "--planner", "rrt", "--goal-bias", "0.5",
             "--step-size", "2", "--heading-sampling", "goal", "--path-spacing", "0.5", "--goal-tolerance-xy", "0.25",
             "--goal-tolerance-yaw", "0.5", "--any-goal-heading", "--no-allow-unknown"]
    document = json.loads(run(hall, *REQUEST, *BUDGET, *flags, "--json", "-", capsys=capsys)[1])
    assert document["vehicle"]["turning_radius"] == 0.5 and document["vehicle"]["robot_radius"] == 0.1
    told = {"planner": "rrt", "goal_bias": 0.5, "step_size": 2.0, "heading_sampling": "goal", "path_spacing": 0.5,
            "goal_tolerance_xy": 0.25, "goal_tolerance_yaw": 0.5, "any_goal_heading": True, "allow_unknown": False}
    assert document["settings"].items() >= told.items()


def test_a_footprint_is_taken_as_nav2_writes_it(hall, capsys):
    footprint = "[[.3,.2],[.3,-.2],[-.3,-.2],[-.3,.2],]"
    _, out, _ = run(hall, *REQUEST, *BUDGET, "--footprint", footprint, "--json", "-", capsys=capsys)
    assert json.loads(out)["vehicle"]["footprint"] == "[[-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2], [0.3, 0.2]]"


@pytest.mark.parametrize(("flags", "names"), [
    (["--turning-radius", "-1"], "turning_radius is -1"), (["--turning-radius", "wide"], "--turning-radius"),
    (["--samples", "0"], "samples is 0"), (["--planner", "a_star"], "--planner"),
    (["--wheelbase", "1"], "max_steering_angle"), (["--via", "north"], "--via"),
    (["--json", "."], "is a folder"),
    (["--json", "nowhere/p.json"], "nowhere"), (["--plot", "p.jpg"], "p.jpg"), (["--sampels", "3"], "--sampels")])
def test_wrong_usage_takes_one_line(hall, flags, names, capsys):
    assert names in refusal(hall, *REQUEST, *flags, capsys=capsys)


@pytest.mark.parametrize("start", [("1", "2", "nan"), ("-inf", "2", "0"), ("1", "2", "1e9")])
def test_a_pose_that_is_none_has_no_path(hall, start, capsys):
    status, out, err = run(hall, "--start", *start, *REQUEST[4:], capsys=capsys)
    assert (status, out) == (1, "")
    assert err.startswith("212 INVALID_POSE: The start pose ") and err.count("\n") == 1


def test_a_missing_or_broken_map_takes_one_line(hall, capsys):
    assert "nowhere.yaml" in refusal("nowhere.yaml", *REQUEST, capsys=capsys)
    Path("broken.yaml").write_text("image: nothing.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
    assert "broken.yaml" in refusal("broken.yaml", *REQUEST, capsys=capsys)
    assert "MAP" in refusal(*REQUEST, capsys=capsys)


def test_a_grid_above_max_map_cells_is_refused(hall, capsys):
    save_map(rasterise(PolygonMap(HALL), 0.5), "hall.yaml")
    assert "max_map_cells" in refusal("hall.yaml", *REQUEST, "--max-map-cells", "100", capsys=capsys)


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_replay_plans_the_same_path_from_another_folder(hall, planner, tmp_path, monkeypatch, capsys):
    budget = ["--planner", planner, "--samples", "300", "--planning-time", "60"]
    first = json.loads(run(hall, *REQUEST, *budget, "--json", "-", capsys=capsys)[1])
    assert first["settings"]["seed"] == first["seed"] >= 0
    Path("p.json").write_text(json.dumps(first))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    status, out, error = run("--replay", "../p.json", "--json", "-", capsys=capsys)
    second = json.loads(out)
    assert status == 0 and "is not the one" not in error
    for name in ("curves", "poses", "length", "seed", "samples", "tree_nodes", "start", "goal", "vehicle", "map_id"):
        assert second[name] == first[name], name


def test_replay_tells_of_a_path_that_is_not_the_one(hall, capsys):
    document = json.loads(run(hall, *REQUEST, *BUDGET, "--json", "-", capsys=capsys)[1])
    document["curves"][0]["lengths"][0] += 1e-9
    Path("p.json").write_text(json.dumps(document))
    status, _, error = run("--replay", "p.json", capsys=capsys)
    assert status == 0 and "is not the one of p.json" in error


def test_replay_refuses_another_map_and_other_options(hall, capsys):
    assert run(hall, *REQUEST, *BUDGET, "--json", "p.json", capsys=capsys)[0] == 0
    assert "samples" in refusal("--replay", "p.json", "--samples", "7", capsys=capsys)
    Path("hall.wkt").write_text(HALL.difference(shapely.box(4, 4, 5, 5)).wkt)
    assert "map_id" in refusal("--replay", "p.json", capsys=capsys)
    Path("hall.wkt").unlink()
    assert "no such map" in refusal("--replay", "p.json", capsys=capsys)
    assert "p.csv" in refusal("--replay", "p.csv", capsys=capsys)


def command(*words):
    return [sys.executable, "-m", "dubins_rrt_ros", "plan", *words]


def on_a_terminal(words, *, interrupt_at=None):
    """Run the command with a terminal as its standard error; exit status, standard output, what the terminal showed."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 100))
    with subprocess.Popen(command(*words), stdout=subprocess.PIPE, stderr=theirs, text=True) as process:
        os.close(theirs)
        shown = _read(ours, process if interrupt_at else None, interrupt_at)
        out = process.stdout.read()
    os.close(ours)
    return process.returncode, out, shown


def _read(terminal, process, interrupt_at):
    shown = b""
    while True:
        try:
            shown += os.read(terminal, 4096)
        except OSError:  # the other end is closed
            return shown.decode()
        if process and interrupt_at in shown:
            process.send_signal(signal.SIGINT)
            process = None


def test_a_terminal_sees_a_bar(hall):
    status, out, shown = on_a_terminal([hall, *REQUEST, *BUDGET])
    assert status == 0 and "150 samples" in out
    assert "/150" in shown and "%" in shown and "limit 60 s" in shown


@pytest.mark.slow
def test_ctrl_c_gives_the_best_path_so_far(hall):
    budget = ["--samples", "10000000", "--planning-time", "3600", "--seed", "4"]
    status, out, shown = on_a_terminal([hall, *REQUEST, *budget, "--json", "p.json"], interrupt_at=b"path ")
    document = json.loads(Path("p.json").read_text())
    assert status == 0 and document["error_code"] == 0 and document["samples"] < 10_000_000
    assert "Traceback" not in shown and "tree nodes" in out


@pytest.mark.slow
def test_ctrl_c_before_a_path_is_cancelled(hall):
    """The goal lies behind a gap that the vehicle fits through only by a hair."""
    Path("gap.wkt").write_text(shapely.box(-6, -5, 6, 5).difference(
        shapely.union_all([shapely.box(-1, -5, 1, -0.2001), shapely.box(-1, 0.2001, 1, 5)])).wkt)
    budget = ["--samples", "10000000", "--planning-time", "3600", "--goal-bias", "0", "--no-informed", "--seed", "4"]
    status, out, shown = on_a_terminal(["gap.wkt", "--start", "-4", "-3", "2", "--goal", "3.5", "3", "2", *budget],
                                       interrupt_at=b"samples/s")
    assert status == 1 and out == "" and "213 CANCELLED: " in shown and "Traceback" not in shown


@pytest.mark.slow
def test_a_plot_may_be_an_animation_of_the_search(hall, capsys, monkeypatch):
    from PIL import Image
    monkeypatch.setattr("dubins_rrt_ros.planning.pictures.animation.MOST_FRAMES", 12)
    status, out, err = run(hall, *REQUEST, *BUDGET, "--paper", "--plot", "p.gif", capsys=capsys)
    assert (status, err) == (0, "") and "Path of" in out
    assert Image.open("p.gif").n_frames > 10


@pytest.mark.slow
def test_an_animation_changes_no_path(hall, capsys, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.pictures.animation.MOST_FRAMES", 12)
    for more in (["--json", "without.json"], ["--json", "with.json", "--plot", "p.gif"]):
        assert run(hall, *REQUEST, *BUDGET, *more, capsys=capsys)[0] == 0
    without, animated = (json.loads(Path(file).read_text()) for file in ("without.json", "with.json"))
    assert [animated[key] for key in ("curves", "samples", "cost")] == [without[key] for key in ("curves", "samples", "cost")]


def test_a_video_without_ffmpeg_is_refused_before_planning(hall, capsys, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert "install the package ffmpeg" in refusal(hall, *REQUEST, "--plot", "p.mp4", capsys=capsys)
    assert not Path("p.mp4").exists()


VIA = ["--via", "-2", "3", "--via", "2", "3", "0"]


def test_a_path_over_waypoints_is_written_planned_again_and_judged(hall, capsys):
    status, out, error = run(hall, *REQUEST, *BUDGET, *VIA, "--json", "via.json", capsys=capsys)
    assert (status, error) == (0, "") and "over 2 waypoints" in out
    document = json.loads(Path("via.json").read_text())
    assert document["waypoints"] == [[-2, 3, None], [2, 3, 0]]
    passed = [document["poses"][index] for index in document["waypoint_indices"]]
    assert passed[0][:2] == [-2, 3] and passed[1] == [2, 3, 0]
    status, out, error = run("--replay", "via.json", "--json", "again.json", capsys=capsys)
    assert (status, error) == (0, "")
    assert json.loads(Path("again.json").read_text())["curves"] == document["curves"]
    assert main(["audit", "via.json", hall]) == 0
    assert "waypoint" not in capsys.readouterr().out


@pytest.mark.parametrize(("change", "finding"), [
    ({"waypoints": [[-2, 3.1, None], [2, 3, 0]]}, "the path does not pass waypoint 1 at (-2.000, 3.100)"),
    ({"waypoint_indices": [0, 1]}, "waypoint_indices are [0, 1], which are not the poses at the waypoints"),
    ({"waypoints": 5}, "waypoints are 5"),
])
def test_what_a_file_says_of_its_waypoints_is_judged(hall, change, finding, capsys):
    run(hall, *REQUEST, *BUDGET, *VIA, "--json", "via.json", capsys=capsys)
    Path("via.json").write_text(json.dumps(json.loads(Path("via.json").read_text()) | change))
    assert main(["audit", "via.json", hall]) == 1
    assert finding in capsys.readouterr().out


def test_a_waypoint_of_one_number_is_refused(hall, capsys):
    assert "--via has 1 number; give X Y or X Y YAW" in refusal(hall, *REQUEST, "--via", "1", capsys=capsys)


def test_a_waypoint_that_is_not_reached_is_named(hall, capsys):
    status, _, error = run(hall, *REQUEST, *BUDGET, "--via", "-0.5", "0", capsys=capsys)
    assert status == 1 and error.startswith("206 GOAL_OCCUPIED: Waypoint 1 is occupied")
