"""Plans as JSON documents: every number comes back as it was, and the request can be planned again."""

import dataclasses
import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning import OptionError, PolygonMap, Problem, Settings, Vehicle, load_map, plan, prepare, values
from dubins_rrt_ros.planning.curves.dubins import DubinsCurve
from dubins_rrt_ros.planning.plan_file import HOOKS, PlanFileError, read_path, read_request, to_document
from dubins_rrt_ros.planning.text import LONGEST

FIGURES = ("time_to_first", "time_to_found", "planning_time", "map_time", "length", "lower_bound", "gap", "cost",
           "cost_lower_bound", "cost_gap", "roomy_share", "min_clearance", "max_curvature")
FIELDS = {"error_code", "error_name", "message", "found_by", "planner", "seed", "samples", "tree_nodes", *FIGURES,
          "path_length", "audit", "work",
          "curves", "poses", "map", "map_id", "start", "goal", "vehicle", "settings", "version"}


@pytest.fixture(scope="module")
def hall():
    return PolygonMap(shapely.box(0, 0, 12, 10).difference(shapely.box(5, 0, 6, 6)))


@pytest.fixture(scope="module")
def answer(hall):
    vehicle = Vehicle(robot_radius=0.3, wheelbase=0.7, max_steering_angle=0.6)
    problem = Problem(hall, vehicle, (2.0, 2.0, math.pi / 2), (9.0, 2.0, -math.pi / 2))
    answer = plan(problem, Settings(samples=150, planning_time=60.0, path_spacing=0.3, seed=4))
    assert answer.path is not None, answer.message
    return answer


def through_json(answer):
    return json.loads(json.dumps(to_document(answer, "hall.wkt"), allow_nan=False))


def test_the_document_has_the_promised_fields(answer):
    document = through_json(answer)
    assert set(document) == FIELDS
    assert document["error_code"] == 0 and document["error_name"] == "NONE" and document["audit"] == "ok"
    assert document["path_length"] == document["length"] == answer.length
    assert document["map"] == "hall.wkt" and document["map_id"] == answer.problem.map.id
    assert document["settings"] == values(answer.problem) | values(answer.settings)
    assert document["tree_nodes"] > 1 and document["samples"] == answer.samples and document["seed"] == 4


def test_the_reference_names_every_field(answer):
    reference = (Path(__file__).resolve().parents[2] / "docs/reference.md").read_text("utf-8")
    names = (*through_json(answer), "waypoints", "waypoint_indices", *HOOKS)
    assert [name for name in names if f"`{name}`" not in reference] == []


def test_the_figures_read_back_bit_for_bit(answer):
    document = through_json(answer)
    for name in FIGURES:
        assert document[name] == getattr(answer, name), name
    assert tuple(document["start"]) == answer.problem.start and tuple(document["goal"]) == answer.problem.goal
    assert document["vehicle"] == values(answer.problem.vehicle)


def test_the_path_reads_back_bit_for_bit(answer):
    document = through_json(answer)
    path = read_path(document)
    assert path == answer.path
    assert np.array(document["poses"]).tobytes() == answer.path.poses(0.3).tobytes()
    assert path.poses(0.01).tobytes() == answer.path.poses(0.01).tobytes()


def test_the_request_reads_back_and_gives_the_same_path(answer, hall):
    problem, settings = read_request(through_json(answer), hall)
    assert problem.vehicle == answer.problem.vehicle and problem.start == answer.problem.start
    assert settings == dataclasses.replace(answer.settings, planning_time=3600.0, work_limits=answer.work)
    assert plan(problem, settings).path == answer.path


def test_a_search_that_was_cut_short_is_cut_at_the_same_sample(answer, hall, monkeypatch):
    monkeypatch.setattr("dubins_rrt_ros.planning.planner.REPORT_INTERVAL", 0)
    for grace in ("CANCEL_GRACE", "CANCEL_AUDIT_GRACE"):  # on a machine under load they pass, and an earlier path is the answer
        monkeypatch.setattr(f"dubins_rrt_ros.planning.deadline.{grace}", math.inf)
    samples = [0]
    cut = plan(answer.problem, answer.settings, cancel=lambda: samples[-1] > 0,
               on_progress=lambda progress: samples.append(progress.samples))
    assert 0 < cut.samples < answer.settings.samples
    problem, settings = read_request(through_json(cut), hall)
    again = plan(problem, settings)
    assert again.samples == cut.samples
    assert again.tree.poses.tobytes() == cut.tree.poses.tobytes() and again.path == cut.path


@pytest.mark.parametrize("options", [{}, {"preferred_clearance": 0.5}, {"step_size": 0.5}, {"informed": False, "goal_bias": 0.3}],
                         ids=["length", "clearance", "step", "plain"])
@pytest.mark.parametrize("footprint", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["disc", "footprint"])
def test_what_the_clock_cuts_short_is_planned_again_bit_for_bit(hall, options, footprint, monkeypatch):
    """Wherever it does: at each look at the clock a little time has gone by, so that the time is up after so many looks."""
    vehicle = Vehicle(0.8, footprint=((0.5, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.5, -0.2))) if footprint else Vehicle(0.8, 0.3)
    problem = Problem(prepare(hall, vehicle), start=(2.0, 2.0, math.pi / 2), goal=(9.0, 2.0, -math.pi / 2))
    solved = 0
    for seed, tick in enumerate(np.geomspace(2e-4, 2e-2, 5).tolist()):
        with monkeypatch.context() as patched:
            patched.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", map(tick.__mul__, itertools.count()).__next__)
            cut = plan(problem, Settings(samples=2000, planning_time=1.0, seed=seed, **options))
        _, settings = read_request(through_json(cut), hall)
        again = plan(problem, settings) if cut.path else cut
        assert again.path == cut.path and again.work == cut.work
        solved += cut.path is not None
    assert solved > 0


@pytest.mark.parametrize("work", [7, [1, 2], [1, 2, -3], [1, 2, 3.0], [True, 0, 0], {}], ids=str)
def test_work_that_is_none_is_refused(answer, hall, work):
    with pytest.raises(PlanFileError, match="work"):
        read_request(changed(answer, work=work), hall)


def test_without_a_path_the_document_says_so(hall):
    answer = plan(Problem(hall, Vehicle(), (5.5, 3.0, 0.0), (9.0, 2.0, 0.0)), Settings(samples=10, seed=1))
    document = through_json(answer)
    assert document["error_code"] == 205 and document["error_name"] == "START_OCCUPIED" and document["message"]
    assert document["curves"] == document["poses"] == []
    assert all(document[name] is None for name in ("length", "gap", "time_to_first", "min_clearance", "max_curvature"))
    assert read_path(document) is None
    assert read_request(document, hall)[1].samples == 10


def changed(answer, **fields):
    return through_json(answer) | fields


@pytest.mark.parametrize(("field", "value", "names"), [
    ("settings", None, "settings"), ("vehicle", [], "vehicle"), ("start", [1.0, 2.0], "start"),
    ("samples", "many", "samples"), ("vehicle", {"turning_radius": 1.0}, "wheelbase"),
    ("settings", {"flux": 1}, "flux"), ("start", ["1", "2", "3"], "start"), ("goal", [10**400, 0, 0], "goal"),
    ("goal", [True, 0, 0], "goal"), ("start", [[]] * 3, "start"), ("goal", [math.nan, 0, 0], "goal"),
    ("vehicle", {"two\nlines" * 999: 1}, "two lines")])
def test_a_document_with_a_wrong_request_names_the_field(answer, hall, field, value, names):
    with pytest.raises(PlanFileError, match=names) as refusal:
        read_request(changed(answer, **{field: value}), hall)
    assert str(refusal.value).isprintable() and len(str(refusal.value)) <= LONGEST


def test_a_setting_out_of_range_is_refused(answer, hall):
    document = through_json(answer)
    document["settings"]["goal_bias"] = 7.0
    with pytest.raises(OptionError, match="goal_bias"):
        read_request(document, hall)


FINE = {"word": "LSL", "start": [0, 1, 2.0], "radius": 1.0, "lengths": [1, 0.5, 0.5]}


@pytest.mark.parametrize(("curve", "names"), [
    (FINE | {"radius": 0.0}, "radius"), (FINE | {"radius": -1.0}, "radius"), (FINE | {"radius": math.inf}, "radius"),
    (FINE | {"radius": math.nan}, "radius"), (FINE | {"lengths": [1.0, -1.0, 0.0]}, "length"),
    (FINE | {"lengths": [1.0, math.inf, 0.0]}, "lengths"), (FINE | {"start": [10**400, 0, 0]}, "start"),
    (FINE | {"start": [True, 0, 0]}, "start"), (FINE | {"word": "L" * 5000}, "word"),
    (7, "curves"), ({}, "word"), ({"word": "LLL"}, "LLL"), ({"word": "LSL", "start": [0.0, 0.0]}, "start"),
    (FINE | {"radius": "1"}, "radius")])
def test_a_document_with_a_wrong_curve_names_the_field(answer, curve, names):
    with pytest.raises(PlanFileError, match=names) as refusal:
        read_path(changed(answer, curves=[curve]))
    assert len(str(refusal.value)) < 300


def test_a_curve_that_is_none_of_ours_is_read(answer):
    curve = DubinsCurve(tuple(map(float, FINE["start"])), FINE["radius"], FINE["word"], tuple(map(float, FINE["lengths"])))
    assert read_path(changed(answer, curves=[FINE], poses=[list(curve.start), list(curve.end)])).length == 2.0


def test_a_plan_of_functions_is_not_planned_again_by_the_command(tmp_path, capsys):
    place = (2.0, 2.0, 0.0)
    answer = plan(Problem(load_map("maze"), Vehicle(), place, place, is_free=lambda poses: poses[:, 0] < 9), Settings(seed=1))
    assert answer.path is not None, answer.message
    file = tmp_path / "plan.json"
    file.write_text(json.dumps(to_document(answer, "maze")))
    assert main(["plan", "--replay", str(file)]) == 2
    out, error = capsys.readouterr()
    assert out == "" and "it was planned with is_free" in error and "a function, which no file holds" in error
    assert main(["audit", str(file), "maze"]) == 0
    assert "Not judged: " in (out := capsys.readouterr().out) and "is_free" in out
