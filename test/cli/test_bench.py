"""`dubins_rrt bench`, by the lines it writes."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import shapely

from dubins_rrt_ros.cli.bench import deadlines, latencies
from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning import PolygonMap, Problem, Settings, Vehicle, load_map, plan, rasterise, save_map
from dubins_rrt_ros.planning.maps.locate import maps_directory

HALL = shapely.box(-6, -5, 6, 5).difference(shapely.box(-1, -5, 0, 1))
START, GOAL = [-4.0, -3.0, 1.5707963267948966], [3.5, -3.0, -1.5707963267948966]
BUDGET = ["--samples", "150"]


def entry(**more):
    return {"name": "hall", "map": "hall.wkt", "start": START, "goal": GOAL, "turning_radius": 1.0, "robot_radius": 0.195,
            "check_step": 0.025} | more


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, and in another one the maps beside which the problems are."""
    monkeypatch.chdir(tmp_path)
    Path("set").mkdir()
    Path("set/hall.wkt").write_text(HALL.wkt)


def problems(*entries):
    Path("set/problems.json").write_text(json.dumps(entries))
    return "set/problems.json"


def bench(file, *flags, status=0):
    """The lines of a call that ends with `status`, or with one of several."""
    assert main(["bench", file, "--out", "runs.jsonl", *flags]) in np.atleast_1d(status)
    return [json.loads(line) for line in Path("runs.jsonl").read_text().splitlines()]


def refusal(*argv, capsys):
    """The one line on standard error of a command that is used wrongly."""
    try:
        status = main(["bench", *argv])
    except SystemExit as end:
        status = end.code
    out, error = capsys.readouterr()
    assert status == 2 and out == "" and error.count("\n") == 1 and "Traceback" not in error
    return error


@pytest.mark.slow
def test_what_is_overridden_or_in_degrees_is_told_once():
    footprint = "[[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]"
    file = problems(entry(footprint=footprint), entry(name="other", footprint=footprint, start=[-4.0, -3.0, 90.0]))
    command = [sys.executable, "-m", "dubins_rrt_ros", "bench", file, "--planner", "rrt", "--seeds", "2", "--out", "runs.jsonl"]
    done = subprocess.run([*command, *BUDGET], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stderr.splitlines() if "warning" in line] == [
        f"dubins_rrt bench: warning: {file}: robot_radius has no effect, as footprint takes its place, in 2 problems",
        f"dubins_rrt bench: warning: {file}: problem other: its start has the yaw 90 rad; did you mean 1.5708?"]


def test_a_line_tells_what_plan_does(capsys):
    block = entry(name="block", map=str(maps_directory() / "block.yaml"), start=[2, 3, 1.57], goal=[6, 4, 0], turning_radius=0.5)
    lines = bench(problems(entry(), block), "--seeds", "2", *BUDGET, "--goal-bias", "0.2", "--heading-sampling", "goal")
    assert [(line["problem"], line["seed"]) for line in lines] == [("hall", 0), ("hall", 1), ("block", 0), ("block", 1)]
    for line, case in zip(lines, (entry(), entry(), block, block), strict=True):
        problem = Problem(load_map(Path("set", case["map"])), Vehicle(case["turning_radius"], 0.195), case["start"], case["goal"])
        settings = Settings(samples=150, planning_time=3600, goal_bias=0.2, heading_sampling="goal", seed=line["seed"],
                            preferred_clearance=0.0)
        answer = plan(problem, settings)
        assert line["planner"] == "rrt_star" and line["solved"] and line["error_name"] == "NONE" and line["audit"] == "ok"
        assert line["final_cost"] == answer.length and line["path"] == answer.path.poses(0.05).tolist()
        assert line["samples"] == answer.samples == 150 and line["vertices"] == len(answer.tree)
        assert line["map_ms"] > 0
        times, costs = zip(*line["trace"], strict=True)
        assert 0 < line["time_to_found"] <= line["time_to_first"]
        assert [line["time_to_first"], line["first_cost"]] == line["trace"][0] and costs[-1] == line["final_cost"]
        assert [line["first_objective"], line["final_objective"]] == [line["first_cost"], line["final_cost"]]
        assert (np.diff(costs) < 0).all() and (np.diff((0, *times, line["total_s"])) >= 0).all()
    said, errors = capsys.readouterr()
    assert errors == "" and said.count("\n") == 2 and said.startswith("hall: 2/2 solved, first path ")
    assert f" ms, {min(line['final_cost'] for line in lines[:2]):.2f} m\n" in said


def test_a_problem_without_a_path_is_told_with_its_reason_once(capsys):
    file = problems(entry(), entry(name="beside", goal=[99.0, 0.0, 0.0]))
    lines = bench(file, "--seeds", "2", *BUDGET, status=1)
    said = capsys.readouterr().out.splitlines()
    assert said[1].startswith("beside: 0/2 solved, ")
    assert said[2:] == [f"  {lines[2]['error_name']}: {lines[2]['message']}"]
    assert said[2].startswith("  GOAL_OUTSIDE_MAP: ") and "99" in said[2]


@pytest.mark.slow
def test_any_number_of_processes_plans_the_same():
    file = problems(entry(), entry(name="back", start=[*GOAL[:2], 1.57], goal=[*START[:2], -1.57]))
    alone = bench(file, "--seeds", "2", *BUDGET)
    together = bench(file, "--seeds", "2", *BUDGET, "--jobs", "2")
    by_run = {(line["problem"], line["seed"]): line for line in together}
    assert len(by_run) == len(together) == 4
    for line in alone:
        other = by_run[line["problem"], line["seed"]]
        # How many improvements in between are reported depends on the time.
        assert other["path"] == line["path"]
        assert (other["first_cost"], other["final_cost"]) == (line["first_cost"], line["final_cost"])


def test_what_the_planner_refuses_is_a_line(capsys):
    walled = entry(name="walled", goal=[-0.5, 0, 0])
    lines = bench(problems(walled, entry()), *BUDGET, status=1)
    assert [line["solved"] for line in lines] == [False, True]
    told = {"problem": "walled", "error_name": "GOAL_OCCUPIED", "time_to_found": None, "time_to_first": None, "first_cost": None,
            "final_cost": None, "trace": [], "path": [], "samples": 0, "vertices": 1}
    assert lines[0].items() >= told.items()
    assert lines[0]["message"].startswith("Goal is occupied: ")
    assert [line["found_by"] for line in lines] == ["", "hybrid_astar"]
    assert ("walled: 0/1 solved, first path - ms, - m\n  GOAL_OCCUPIED: Goal is occupied: clearance "
            in capsys.readouterr().out)


def test_a_start_that_is_the_goal_has_a_path_without_length():
    line, = bench(problems(entry(goal=START)))
    assert line["solved"] and line["final_cost"] == line["first_cost"] == 0
    assert line["trace"] == [[line["time_to_first"], 0]] and line["path"] == [START]


def test_poses_are_a_quarter_of_a_coarse_cell_apart():
    save_map(rasterise(PolygonMap(HALL), 0.5), Path("set/coarse.yaml"))
    line, = bench(problems(entry(map="coarse.yaml")), *BUDGET)
    steps = np.hypot(*np.diff(np.array(line["path"])[:, :2], axis=0).T)
    assert 0.1 < steps.max() <= 0.125


@pytest.mark.parametrize(("flags", "limit"), [([], 5), (["--time", "7"], 7), (BUDGET, 3600), ([*BUDGET, "--time", "7"], 7)])
def test_time_and_samples_rule_by_what_is_given(flags, limit):
    """rrt ends with its first path, long before either, unless the machine is slow."""
    line, = bench(problems(entry()), "--planner", "rrt", *flags, status=(0, 1))
    assert line["time_limit"] == limit and line["planner"] == "rrt"


def test_the_time_ends_a_run():
    line, = bench(problems(entry()), "--time", "0.2", status=(0, 1))
    assert line["time_limit"] == 0.2 and line["total_s"] > 0.1 and line["samples"] < 10_000_000


def test_rows_are_named_and_problems_chosen():
    file = problems(entry(), entry(name="other"), entry(name="third"))
    lines = bench(file, *BUDGET, "--label", "plain", "--no-shortcut", "--no-informed", "--problems", "third,hall")
    assert [(line["problem"], line["planner"]) for line in lines] == [("hall", "plain"), ("third", "plain")]


def test_the_map_of_a_problem_may_be_an_installed_one_by_its_name():
    at = {"start": [1.5, 2.0, 1.57], "goal": [1.5, 6.0, 1.57]}
    lines = bench(problems(entry(map="maze", **at), entry(name="b", map="maze.geojson", **at)), *BUDGET)
    assert len(lines) == 2 and all(line["solved"] for line in lines)


@pytest.mark.parametrize(("document", "says"), [
    ({"problems": []}, "no list of problems"), ([], "no list of problems"), ([7], "problem 1 is no object"),
    ([{"name": "a", "map": "hall.wkt"}], "problem 1 lacks start, goal, turning_radius, robot_radius"),
    ([entry(name=3)], "its name is 3"), ([entry(map=None)], "its map is None"),
    ([entry(), entry()], "several problems have the name hall"),
    ([entry(), entry(name="b", map="gone.yaml")], "problem 2, b: there is no map file set/gone.yaml"),
    ([entry(start=[1, 2])], "problem 1, hall: The start pose is"), ([entry(goal=["1", 2, 3])], "The goal pose is"),
    ([entry(goal="123")], "The goal pose is"), ([entry(start=[1, float("nan"), 3])], "The start pose is"),
    ([entry(turning_radius="1")], "turning_radius is '1'"), ([entry(turning_radius=0)], "turning_radius is 0"),
    ([entry(robot_radius=-1)], "robot_radius is -1"), ([entry(robot_radius=10**400)], "robot_radius is 1000"),
    ([entry(goal=[10**400, 0, 0])], "The goal pose is [1000"), ([entry(map="m" * 5000)], "there is no map file"),
    ([entry(name="two\nlines")], "problem 1: its name is 'two\\nlines'; give one of 200 printable characters at most"),
    ([entry(map=".")], "problem 1, hall: its map set is a directory; give the map file in it (.yaml, .geojson, .wkt)"),
    ([entry(map="two\nlines.wkt")], "problem 1, hall: there is no map file set/two lines.wkt")])
def test_a_file_of_problems_that_is_none_takes_one_line(document, says, capsys):
    Path("set/problems.json").write_text(json.dumps(document))
    line = refusal("set/problems.json", "--out", "runs.jsonl", capsys=capsys)
    assert says in line and line[:-1].isprintable()
    assert not Path("runs.jsonl").exists()


def test_what_the_output_had_is_kept_until_there_is_a_first_line(capsys):
    Path("runs.jsonl").write_text("of before\n")
    Path("set/bad.wkt").write_text("POLYGON ((0 0, 1")
    assert "bad.wkt" in refusal(problems(entry(map="bad.wkt")), "--out", "runs.jsonl", *BUDGET, capsys=capsys)
    assert Path("runs.jsonl").read_text() == "of before\n"
    assert [line["problem"] for line in bench(problems(entry()), *BUDGET)] == ["hall"]


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_without_a_line_there_is_no_output(jobs, capsys):
    Path("set/bad.wkt").write_text("POLYGON ((0 0, 1")
    assert "bad.wkt" in refusal(problems(entry(map="bad.wkt")), "--out", "runs.jsonl", *BUDGET, "--jobs", jobs, capsys=capsys)
    assert not Path("runs.jsonl").exists()


def test_files_that_cannot_be_read_take_one_line(capsys):
    assert "gone.json cannot be read: No such file" in refusal("gone.json", "--out", "runs.jsonl", capsys=capsys)
    Path("torn.json").write_text('[{"name":')
    assert "torn.json is no JSON file" in refusal("torn.json", "--out", "runs.jsonl", capsys=capsys)
    Path("set/broken.wkt").write_text("POLYGON ((0 0")
    for jobs in ("1", "2"):
        file = problems(entry(map="broken.wkt"))
        assert "broken.wkt" in refusal(file, "--out", "runs.jsonl", "--jobs", jobs, capsys=capsys)


@pytest.mark.parametrize(("flags", "names"), [
    ([], "--out"), (["--out", "nowhere/runs.jsonl"], "nowhere"), (["--out", "r", "--seeds", "0"], "--seeds is 0"),
    (["--out", "r", "--jobs", "-1"], "--jobs is -1"), (["--out", "r", "--time", "0"], "planning_time is 0"),
    (["--out", "r", "--samples", "0"], "samples is 0"), (["--out", "r", "--problems", "hall,hell"], "no problem 'hell'"),
    (["--out", "r", "--plot", "p.png"], "--plot"), (["--out", "r", "--best-known", "b.json"], "--best-known"),
    (["--out", "r", "--seed", "3"], "--seed"), (["--out", "./set/problems.json"], "overwrite"),
    (["--report", "r"], "PROBLEMS.json"),
    (["--report", "r", "--no-informed", "--time", "3"], "leave out --informed, --time, PROBLEMS.json")])
def test_wrong_usage_takes_one_line(flags, names, capsys):
    assert names in refusal(problems(entry()), *flags, capsys=capsys)


def test_problems_must_be_given_to_measure(capsys):
    assert "PROBLEMS.json must be given" in refusal("--out", "r", capsys=capsys)


def test_every_option_of_vehicle_request_and_settings_is_a_key():
    footprint = [[0.5, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.5, -0.3]]
    wheels = {"wheelbase": 0.5, "max_steering_angle": 0.4}
    rich = entry(name="rich", footprint=footprint, **wheels, goal_tolerance_xy=0.5, any_goal_heading=True, planner="rrt",
                 samples=120, seed=7, shortcut=False, _why="a note", set="other")
    bare = {key: value for key, value in rich.items() if key not in ("turning_radius", "robot_radius", "name")}
    lines = bench(problems(rich, {"name": "bare", **bare}), "--seeds", "2", status=(0, 1))
    assert [(line["problem"], line["seed"]) for line in lines] == [("rich", 7), ("rich", 8), ("bare", 7), ("bare", 8)]
    vehicle = Vehicle(footprint=footprint, **wheels)
    problem = Problem(load_map("set/hall.wkt"), vehicle, START, GOAL, goal_tolerance_xy=0.5, any_goal_heading=True)
    for line in lines:
        answer = plan(problem, Settings(planner="rrt", samples=120, planning_time=3600, seed=line["seed"], shortcut=False,
                                        preferred_clearance=0.0))
        assert line["planner"] == "rrt" and line["time_limit"] == 3600
        assert line["path"] == (answer.path.poses(0.05).tolist() if answer.path else [])


def test_flags_come_before_what_a_problem_says():
    file = problems(entry(planner="rrt", planning_time=9.0, seed=3))
    line, = bench(file, "--planner", "rrt_star", "--time", "4", *BUDGET)
    assert (line["planner"], line["time_limit"], line["seed"]) == ("rrt_star", 4, 3)


def test_unknown_space_may_be_free_in_a_problem():
    grid = rasterise(PolygonMap(HALL), 0.25)
    data = grid.data.copy()
    data[data == 0] = -1
    save_map(type(grid)(data, grid.resolution, grid.origin), "set/hall.yaml")
    lines = bench(problems(entry(map="hall.yaml"), entry(map="hall.yaml", name="free", allow_unknown=True)), *BUDGET, status=1)
    assert [line["error_name"] for line in lines] == ["START_OCCUPIED", "NONE"]


@pytest.mark.parametrize(("more", "says"), [
    ({"foot_print": []}, "problem 1, hall: there is no key 'foot_print'; did you mean footprint?"),
    ({"turningradius": 2}, "did you mean turning_radius?"),
    ({"colour": "red"}, "there is no key 'colour'; give none but name, map"),
    ({"footprint": [[1, 2]]}, "footprint is"), ({"goal_bias": 7}, "goal_bias is 7"),
    ({"allow_unknown": "yes"}, "allow_unknown is 'yes'")])
def test_a_key_of_which_nothing_comes_is_refused(more, says, capsys):
    assert says in refusal(problems(entry(**more)), "--out", "runs.jsonl", capsys=capsys)


@pytest.mark.slow
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_keeps_the_lines_that_are_written(jobs):
    """The second problem's goal lies behind a gap that the vehicle fits through only by a hair."""
    Path("set/gap.wkt").write_text(shapely.box(-6, -5, 6, 5).difference(
        shapely.union_all([shapely.box(-1, -5, 1, -0.1951), shapely.box(-1, 0.1951, 1, 5)])).wkt)
    file = problems(entry(), entry(name="gap", map="gap.wkt", start=[-4, -3, 2], goal=[3.5, 3, 2]))
    command = [sys.executable, "-m", "dubins_rrt_ros", "bench", file, "--out", "runs.jsonl", "--planner", "rrt", "--goal-bias",
               "0.01", "--time", "3600", "--jobs", jobs]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not (Path("runs.jsonl").exists() and Path("runs.jsonl").read_text().endswith("\n")):
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
    assert process.returncode == 130 and out == "" and error == "dubins_rrt bench: interrupted\n"
    line, = Path("runs.jsonl").read_text().splitlines()
    assert json.loads(line)["problem"] == "hall" and json.loads(line)["solved"]


def test_deadlines_are_measured_on_maps_of_its_own(monkeypatch, capsys):
    monkeypatch.setattr(deadlines, "VEHICLES", {"maze": {"disc": deadlines.DISC}})
    monkeypatch.setattr(deadlines, "LIMITS", (0.02, 0.05))
    assert main(["bench", "--deadlines", "--seeds", "2", "--out", "runs.jsonl"]) == 0
    lines = [json.loads(line) for line in Path("runs.jsonl").read_text().splitlines()]
    assert len(lines) == deadlines.number_of_requests(2) == 12
    assert {line["problem"] for line in lines} == {"maze disc open", "maze disc walled", "maze disc tight"}
    for line in lines:
        assert line["over_s"] == pytest.approx(line["total_s"] - line["time_limit"])
        assert line["cpu_over_s"] == pytest.approx(line["cpu_s"] - line["time_limit"])
        assert line["problem"] != "maze disc walled" or line["error_name"] == "NO_VALID_PATH"
    out = capsys.readouterr().out
    assert "| problem | limit [s] | solved | p50 over, wall [ms] |" in out and "| maze disc tight | 0.05 | 0/2 |" in out


def test_deadlines_take_no_problems(capsys):
    file = problems(entry())
    assert "--deadlines has problems of its own" in refusal(file, "--deadlines", "--out", "runs.jsonl", capsys=capsys)


@pytest.mark.slow
def test_the_node_is_measured_over_topics_each_answer_a_line(monkeypatch, capsys):
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.setenv(name, "")
    monkeypatch.setattr(latencies, "IDLE", 1.0)
    block = entry(name="block", map=str(maps_directory() / "block.yaml"), start=[2, 3, 1.57], goal=[6, 4, 0], turning_radius=0.5)
    lines = bench(problems(block), "--node", "--seeds", "2", "--samples", "50")
    kinds = [line["measured"] for line in lines]
    assert len(lines) == latencies.number_of_lines([block], 2)
    assert kinds[:11] == ["goal"] * 2 + ["start moved"] * 2 + ["get_plan"] * 2 + ["map window"] * 2 + ["equal map"] * 2 + ["idle"]
    assert all(line["wall_s"] > 0 and line["cpu_s"] > 0 for line in lines)
    assert {line["error_name"] for line in lines[:8]} == {"NONE"}
    assert all(line["over_s"] == line["wall_s"] - line["planning_time"] and line["poses"] > 1 for line in lines[4:6])
    assert lines[6]["map_id"] != lines[7]["map_id"]
    assert all(0 < line["share"] < 1 for line in lines[10:])
    table = capsys.readouterr().out
    assert "| block | goal | 2 |" in table and "of a core" in table


def test_the_node_needs_ros(monkeypatch, capsys):
    monkeypatch.setattr("dubins_rrt_ros.cli.demo.process.importlib.util.find_spec", lambda name: None)
    assert main(["bench", problems(entry()), "--node", "--out", "runs.jsonl"]) == 1
    assert "pip install 'dubins_rrt_ros[ros]'" in capsys.readouterr().err
