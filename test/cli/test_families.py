"""Problems that are solvable by construction: their paths are free, and `dubins_rrt families` counts who finds one."""

import json

import pytest
from support.cases import needs_compiled

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.evaluation.families import ways
from dubins_rrt_ros.evaluation.families.buildings import BUILDINGS, building
from dubins_rrt_ros.evaluation.families.problems import FAMILIES, constructed
from dubins_rrt_ros.planning import Path, Settings, audit_path


@pytest.mark.parametrize("family", [
    pytest.param(family, marks=pytest.mark.slow if "footprint" in family else ()) for family in FAMILIES])
def test_the_constructed_path_is_free_with_the_room_it_tells(family):
    for number in range(3):
        problem = constructed(family, 1, number)
        path = Path.of_curves(problem.problem.start, problem.problem.goal, problem.curves)
        audit = audit_path(path, problem.problem)
        assert audit.ok, audit.findings
        required = problem.problem.vehicle.robot_radius if not problem.problem.vehicle.footprint else 0.0
        assert audit.min_clearance >= required + problem.spare - 0.001  # which is how exact the audit's is


def test_a_number_and_a_seed_give_the_same_problem():
    one, again, other = constructed("clutter", 1, 2), constructed("clutter", 1, 2), constructed("clutter", 2, 2)
    assert one.problem.map.id == again.problem.map.id != other.problem.map.id
    assert one.curves == again.curves


@pytest.mark.slow
@needs_compiled
def test_most_tunnels_are_solved_and_none_by_a_longer_path(tmp_path, capsys):
    file = tmp_path / "lines.jsonl"
    main(["families", "--families", "tunnel,clutter", "--problems", "12", "--time", "3", "--out", str(file)])
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert len(lines) == 24
    assert sum(line["solved"] for line in lines) >= 20
    assert all(line["longer"] <= 0.01 for line in lines if line["solved"])
    out = capsys.readouterr().out
    assert "tunnel" in out and "clutter" in out


@pytest.mark.parametrize("flags, words", [(["--families", "maze"], "there is no family 'maze'; there are tunnel"),
                                          (["--problems", "0"], "--problems is 0; give 1 or more")])
def test_wrong_usage_is_refused(flags, words, capsys):
    assert main(["families", *flags]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.slow
@needs_compiled
def test_ways_are_compared_with_the_best_that_is_known(monkeypatch):
    for name, value in {"SEEDS": 2, "REFERENCE_SAMPLES": 64, "CLOSED_PLACES": 2, "CLOSED_TIME": 0.2}.items():
        monkeypatch.setattr(ways, name, value)
    line = ways.measured(2, Settings(samples=64, planning_time=20, seed=0))
    assert line["kind"] == "depot" and line["solved"] == 2 and min(line["longer"]) >= 0
    table = list(ways.report([line]))
    assert len(table) == 1 + len(BUILDINGS) and table[3].split()[:2] == ["depot", "2"]


def test_a_building_is_always_the_same():
    first, second = building("office", 0, 3), building("office", 0, 3)
    assert (first.map.data == second.map.data).all() and (first.start, first.goal) == (second.start, second.goal)
