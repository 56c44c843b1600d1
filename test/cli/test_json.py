"""What `--json` writes: with - standard output holds it alone, and the words go to standard error."""

import json
import math
import statistics
from pathlib import Path

import pytest
import shapely
from support.cases import needs_compiled

from dubins_rrt_ros import __version__
from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning import load_map

HALL = shapely.box(-6, -5, 6, 5).difference(shapely.box(-1, -5, 0, 1))
CASE = {"name": "hall", "map": "hall.wkt", "start": [-4, -3, 1.57], "goal": [3.5, -3, -1.57], "turning_radius": 1.0,
        "robot_radius": 0.2}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, with a map and a problem that can be solved and one that cannot."""
    monkeypatch.chdir(tmp_path)
    Path("hall.wkt").write_text(HALL.wkt)
    Path("problems.json").write_text(json.dumps([CASE, CASE | {"name": "walled", "goal": [-0.5, 0, 0]}]))


def alone(*words, capsys, status=0):
    """What standard output holds as JSON, and the words."""
    assert main([*words, "--json", "-"]) == status
    out, error = capsys.readouterr()
    return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON")), error


def bench(*words, capsys, status=1):
    return alone("bench", *words, capsys=capsys, status=status)


def test_bench_writes_what_its_runs_amount_to(capsys):
    document, error = bench("problems.json", "--samples", "100", "--seeds", "3", "--out", "runs.jsonl", capsys=capsys)
    lines = [json.loads(line) for line in Path("runs.jsonl").read_text().splitlines()]
    hall, walled = document["results"]
    assert (hall["problem"], hall["planner"], hall["runs"], hall["solved"]) == ("hall", "rrt_star", 3, 3)
    assert hall["final_cost"]["median"] == statistics.median(line["final_cost"] for line in lines[:3])
    assert hall["time_to_first"]["median"] == statistics.median(line["time_to_first"] for line in lines[:3])
    assert hall["best_known"] == min(line["final_cost"] for line in lines[:3])
    assert (walled["solved"], walled["best_known"], walled["final_cost"]["median"]) == (0, None, None)
    assert "hall: 3/3 solved" in error and "walled: 0/3 solved" in error


def test_a_report_is_written_with_the_figures_of_its_tables(capsys):
    def run(planner, seed, *trace):
        return {"problem": "yard", "planner": planner, "seed": seed, "time_limit": 1.0, "solved": bool(trace), "total_s": 1.0,
                "trace": trace}

    runs = [run("a", 0, (0.02, 20.0), (0.2, 10.0)), run("a", 1, (0.04, 16.0)), run("a", 2), run("b", 0, (0.01, 10.4))]
    Path("runs.jsonl").write_text("\n".join(map(json.dumps, runs)))
    document, error = bench("--report", "runs.jsonl", capsys=capsys, status=0)
    a, b = document["results"]
    assert a["time_to_first"] == {"lower_quartile": 0.02, "median": 0.04, "upper_quartile": None}
    assert a["first_cost"]["median"] == 20 and a["cost_at"]["0.05"]["median"] == 20 and a["cost_at"]["1"]["median"] == 16
    assert b["time_to_within"] == {"0.05": 0.01, "0.02": None, "0.01": None} and a["best_known"] == b["best_known"] == 10
    first, second = document["planners"]
    assert (first["planner"], first["runs"], first["solved"], first["problems_solved"]) == ("a", 3, 2, 1)
    assert second["cost_over_best_known"]["1"] == {"geometric_mean": pytest.approx(1.04), "problems": 1}
    assert error.startswith("# Planners compared\n")


@pytest.mark.slow
@needs_compiled
def test_campaign_writes_its_counts(capsys):
    document, error = alone("campaign", "--problems", "3", "--seed", "2", "--out", "lines.jsonl", capsys=capsys)
    lines = [json.loads(line) for line in Path("lines.jsonl").read_text().splitlines()]
    assert document["problems"] == 3 and document["seed"] == 2 and document["disagreements"] == []
    assert document["edges"] == sum(line["edges"] for line in lines) and document["version"] == __version__
    ends = [(kind.split(",")[0], end) for kind, counts in document["kinds"].items() for end in counts]
    assert set(ends) == {(line["kind"], line["status"]) for line in lines} and "3 problems of seed 2 in " in error


def test_campaign_writes_what_is_wrong_with_the_command_that_repeats_it(monkeypatch, capsys):
    wrong = {"seed": 2, "number": 7, "kind": "gap", "fits": False, "status": "NONE", "edges": 1, "curves": 2, "paths": 1,
             "findings": ["it found a path where there is none"]}
    monkeypatch.setattr("dubins_rrt_ros.evaluation.campaign.command.judge", lambda task: wrong)
    document, _ = alone("campaign", "--problems", "1", capsys=capsys, status=1)
    assert document["kinds"] == {"gap, does not pass": {"NONE": 1}}
    assert document["disagreements"] == [{"number": 7, "kind": "gap", "findings": wrong["findings"],
                                          "repeat": "dubins_rrt campaign --seed 2 --first 7 --problems 1"}]


def test_render_writes_the_files_and_the_measures(capsys):
    document, error = alone("render", "hall.wkt", "--resolution", "0.5", "--out", "grids", capsys=capsys)
    grid = load_map(document["files"][0])
    assert document["files"] == ["grids/hall.yaml", "grids/hall.pgm"] and all(Path(file).is_file() for file in document["files"])
    assert (document["height"], document["width"]) == grid.data.shape and document["resolution"] == 0.5
    assert document["origin"] == list(grid.origin) and document["map_id"] == grid.id and 0 < document["occupied"] < 1
    assert "grids/hall.yaml and its image" in error


@pytest.mark.slow
def test_demo_writes_what_it_received(monkeypatch, capsys):
    """By a file, and with the words on standard output; test_demo.py runs the node."""
    pytest.importorskip("rclpy")
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    assert main(["demo", "--plot", "demo.svg", "--json", "demo.json"]) == 0
    document, out = json.loads(Path("demo.json").read_text()), capsys.readouterr().out
    assert f"{document['length']:.2f} m, {len(document['poses'])} poses" in out
    assert document["poses"][0] == pytest.approx(document["start"]) and document["poses"][-1] == pytest.approx(document["goal"])
    length = sum(math.dist(a[:2], b[:2]) for a, b in zip(document["poses"], document["poses"][1:], strict=False))
    assert document["length"] == document["path_length"] == pytest.approx(length, rel=1e-3)
    assert document["lower_bound"] <= document["length"]
    assert document["gap"] == pytest.approx(document["length"] / document["lower_bound"] - 1, rel=1e-3)
    assert document["samples"] > 0 and document["settings"]["planner"] == "rrt_star" and document["time_to_first"] > 0


@needs_compiled
def test_figures_of_a_plan_are_read_back_bit_for_bit(capsys):
    words = ["plan", "hall.wkt", "--start", "-4", "-3", "1.57", "--goal", "3.5", "-3", "-1.57", "--planner", "rrt"]
    document, error = alone(*words, capsys=capsys)
    assert main([*words, "--json", "plan.json", "--seed", str(document["seed"])]) == 0
    assert json.loads(Path("plan.json").read_text())["curves"] == document["curves"] and f"{document['length']:.2f} m" in error


@pytest.mark.parametrize("words", [["bench", "problems.json", "--out", "x.jsonl"], ["campaign"], ["paper"], ["demo"],
                                   ["render", "hall.wkt"],
                                   ["plan", "hall.wkt", "--start", "0", "0", "0", "--goal", "0", "0", "0"]])
def test_a_file_that_cannot_be_written_is_refused_before_the_work(words, capsys):
    before = sorted(Path().iterdir())
    assert main([*words, "--json", "nowhere/x.json"]) == 2
    assert "there is no folder nowhere" in capsys.readouterr().err and sorted(Path().iterdir()) == before


@pytest.mark.parametrize("words, says", [
    (["--json", "out", "--csv", "out"], "out is to be written twice"),
    (["--json", "x.json", "--csv", "./x.json"], "x.json is to be written twice"),
    (["--csv", "hall.wkt"], "hall.wkt is read, and would be written over")])
def test_nothing_is_written_over_what_is_read_or_written(words, says, capsys):
    before = Path("hall.wkt").read_bytes()
    assert main(["plan", "hall.wkt", "--start", "0", "0", "0", "--goal", "1", "0", "0", *words]) == 2
    assert says in capsys.readouterr().err and Path("hall.wkt").read_bytes() == before


def test_a_key_that_an_object_has_twice_is_refused(capsys):
    """Of which the last value was taken."""
    problem = '{"name": "a", "map": "hall.wkt", "start": [0, 0, 0], "goal": [1, 0, 0], "start": [5, 0, 0]}'
    Path("problems.json").write_text(f"[{problem}]")
    Path("path.json").write_text('{"poses": [[0, 0, 0]], "poses": [[1, 0, 0], [2, 0, 0]]}')
    for words in (["bench", "problems.json", "--out", "x.jsonl"], ["audit", "path.json", "hall.wkt"]):
        assert main(words) == 2
        assert f'{words[1]}: an object has "{"start" if words[0] == "bench" else "poses"}" 2 times' in capsys.readouterr().err
