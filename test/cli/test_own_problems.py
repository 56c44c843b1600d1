"""maps/problems.json: the package's own problems for `dubins_rrt bench`."""

import json
from pathlib import Path

from support.cases import needs_compiled

from dubins_rrt_ros.cli.bench.problems import read_cases
from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.evaluation.paper.runs import ENVIRONMENTS, ROBOT_RADIUS, TURNING_RADIUS
from dubins_rrt_ros.planning.maps.locate import maps_directory

FILE = maps_directory() / "problems.json"


def test_the_problems_are_those_of_the_paper_s_environments():
    cases = read_cases(str(FILE))
    assert [case.name for case in cases] == [case.map.stem for case in cases] == list(ENVIRONMENTS)
    for case in cases:
        described = json.loads(case.map.read_text("utf-8"))
        assert [list(case.start), list(case.goal)] == [described["start"], described["goal"]]
        assert (case.vehicle.turning_radius, case.vehicle.robot_radius) == (TURNING_RADIUS, ROBOT_RADIUS)


@needs_compiled
def test_the_bench_solves_them_all(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["bench", str(FILE), "--samples", "200", "--seeds", "1", "--out", "runs.jsonl"]) == 0
    lines = [json.loads(line) for line in Path("runs.jsonl").read_text().splitlines()]
    assert [line["problem"] for line in lines] == list(ENVIRONMENTS)
    assert all(line["solved"] and line["audit"] == "ok" and line["samples"] == 200 for line in lines)
    assert capsys.readouterr().out.count(": 1/1 solved") == len(ENVIRONMENTS)
