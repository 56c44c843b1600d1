"""`dubins_rrt campaign`: it is clean on the planner as it is, and finds what is planted."""

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.cases import needs_compiled

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.evaluation.campaign import judge as campaign_judge
from dubins_rrt_ros.evaluation.campaign import problems as campaign_problems
from dubins_rrt_ros.evaluation.campaign.judge import TrialNumber, judge
from dubins_rrt_ros.evaluation.campaign.problems import AMPLE_TIME, Trial, random_trial
from dubins_rrt_ros.evaluation.processes import run_in_processes
from dubins_rrt_ros.planning import ClearanceField, GridMap, Problem, Settings, Status, Vehicle, plan, planner
from dubins_rrt_ros.planning._kernels.collision import CollisionChecker
from dubins_rrt_ros.planning.diagnosis import explain as reasons
from dubins_rrt_ros.planning.diagnosis.explain import Diagnosis

START, GOAL, STRAIGHT_ON = (1.0, 1.0, 0.0), (9.0, 6.0, 0.0), (1.0, 6.0, 0.0)


def walled_trial(fits=None, start=START, turning_radius=0.5, walled_off=False, **settings):
    """A problem with a wall between start and goal, beside which 2 m are open, or none."""
    data = np.zeros((14, 20))
    data[:14 if walled_off else 10, 9:11] = 100
    problem = Problem(GridMap(data, 0.5), Vehicle(turning_radius, 0.4), start, GOAL)
    defaults = {"samples": 60, "planning_time": AMPLE_TIME, "seed": 1, "preferred_clearance": 0.0}
    return Trial("walled", problem, Settings(**{**defaults, **settings}), fits)


def findings_of(trial, monkeypatch, number=0):
    """What the judge finds wrong with the planner's answer to a problem."""
    monkeypatch.setattr(campaign_judge, "random_trial", lambda seed, number: trial)
    return judge(TrialNumber(0, number))["findings"]


def contents(trial):
    problem = trial.problem
    return trial.kind, trial.fits, trial.settings, problem.map.id, problem.vehicle, problem.start, problem.goal


def run(*argv, capsys):
    status = main(["campaign", *argv])
    return status, *capsys.readouterr()


@pytest.mark.slow
@needs_compiled
def test_the_planner_is_right(tmp_path, capsys):
    file = tmp_path / "lines.jsonl"
    status, out, error = run("--problems", "25", "--out", str(file), capsys=capsys)
    assert (status, error) == (0, "") and "; 0 disagreements\n" in out
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    assert [line["number"] for line in lines] == list(range(25)) and not any(line["findings"] for line in lines)
    assert all(Status[line["status"]] in Status for line in lines)
    assert "25 problems of seed 0 in " in out and f" {sum(line['edges'] for line in lines)} edges of trees and 150 other" in out
    assert len({line["kind"] for line in lines}) > 5 and {"NONE", "NO_VALID_PATH"} < {line["status"] for line in lines}


@pytest.mark.slow
@needs_compiled
def test_any_number_of_processes_judges_the_same(tmp_path, capsys):
    def lines(jobs):
        file = tmp_path / f"{jobs}.jsonl"
        assert run("--problems", "6", "--first", "50", "--jobs", jobs, "--out", str(file), capsys=capsys)[0] == 0
        found = sorted((json.loads(line) for line in file.read_text().splitlines()), key=lambda line: line["number"])
        # How many edges there are when the time is up depends on the machine.
        return [(line["number"], line["kind"], line["status"], line["edges"] * (line["status"] != "TIMEOUT"), line["length"])
                for line in found]

    assert lines("1") == lines("3")


def test_a_number_gives_the_same_problem():
    for number in range(40):
        assert contents(random_trial(3, number)) == contents(random_trial(3, number))
    assert contents(random_trial(3, 0)) != contents(random_trial(4, 0)) != contents(random_trial(4, 1))


@pytest.mark.slow
def test_costs_of_cells_are_drawn_last(monkeypatch):
    """So a problem without them is the one that its number always gave."""
    found = [random_trial(3, number) for number in range(60)]
    monkeypatch.setattr(campaign_problems, "WITH_CELL_COSTS", 0.0)
    without = [random_trial(3, number) for number in range(60)]
    costly = [trial.settings.cost_weight > 0 for trial in found]
    assert 15 < sum(costly) < 45
    for now, then, has_costs in zip(found, without, costly, strict=True):
        assert has_costs or contents(now) == contents(then)
        assert replace(now.settings, cost_weight=0.0) == then.settings and now.problem.start == then.problem.start
        if has_costs and isinstance(now.problem.map, GridMap) and now.settings.informed and now.kind != "gap":
            # What was free still is, and costs something in places; obstacles stay where they were.
            assert now.problem.map.with_costs(True).costs is not None
            blocked, before = now.problem.map.with_costs(True).blocked(False), then.problem.map.blocked(False)
            assert not (blocked & ~before).any() and now.fits == then.fits
            assert (now.problem.map.blocked(True) == then.problem.map.blocked(True)).all()
        else:
            assert now.problem.map.id == then.problem.map.id


@pytest.mark.parametrize("kind", campaign_problems.KINDS)
def test_each_kind_of_problem_can_be_planned(kind):
    found = [campaign_problems.KINDS[kind](np.random.default_rng(seed)) for seed in range(10)]
    assert all(isinstance(trial.problem, Problem) for trial in found)
    assert {trial.fits for trial in found} == {"gap": {True, False}, "corner": {True, None}}.get(kind, {None})


@pytest.mark.parametrize("informed", [True, False])
def test_a_collision_check_that_is_too_easy_is_found(informed, monkeypatch):
    monkeypatch.setattr(ClearanceField, "collision_checker",
                        lambda field, vehicle: CollisionChecker(field.kernel, vehicle.robot_radius / 2))
    found = " ".join(findings_of(walled_trial(informed=informed), monkeypatch))
    assert "the tree's edges: along curve " in found and "less than the robot's radius, 0.4 m" in found


def test_a_collision_check_that_is_too_strict_is_found(monkeypatch):
    monkeypatch.setattr(ClearanceField, "collision_checker",
                        lambda field, vehicle: CollisionChecker(field.kernel, vehicle.robot_radius + 0.65))
    found = " ".join(findings_of(walled_trial(start=STRAIGHT_ON), monkeypatch))
    assert "the planner holds DubinsCurve(" in found and "to touch something, but the gap is 0.58" in found  # 0.6 less 2 % of 1


@pytest.mark.parametrize("status, message, finding", [
    (Status.START_OCCUPIED, "Start is occupied.", "START_OCCUPIED, but the vehicle has 0.600000 m to spare there"),
    (Status.GOAL_OCCUPIED, "Goal is occupied.", "GOAL_OCCUPIED, but the vehicle has "),
    (Status.START_OUTSIDE_MAP, "Start is outside.", "START_OUTSIDE_MAP, but it is in the map"),
    (Status.NO_VALID_PATH, "No path exists: walls.", "a way leads from start to goal, but: No path exists: walls."),
    (Status.TIMEOUT, "No path found: yet.", "it gave up after 0 of 60 samples"),
    (Status.TIMEOUT, "No time.", "s, the limit being 1 s"),
    (Status.UNKNOWN, "A defect.", "UNKNOWN: A defect."),
])
def test_a_false_status_is_found(status, message, finding, monkeypatch):
    monkeypatch.setattr(reasons, "before_search", lambda *_: Diagnosis(status, message))
    assert finding in " ".join(findings_of(walled_trial(), monkeypatch))


@pytest.mark.parametrize("name, pose", [("start", (5.0, 1.0, 0.0)), ("goal", (5.0, 1.0, 0.0)), ("goal", (10.5, 1.0, 0.0))])
def test_a_pose_that_should_have_been_refused_is_found(name, pose, monkeypatch):
    trial = walled_trial()
    trial = replace(trial, problem=replace(trial.problem, **{name: pose}))
    assert findings_of(trial, monkeypatch) == []
    monkeypatch.setattr(reasons, "before_search", lambda *_: Diagnosis(Status.NO_VALID_PATH, "No path exists: x."))
    assert f"NO_VALID_PATH, but at the {name} the vehicle has no room: -0.4" in " ".join(findings_of(trial, monkeypatch))


@pytest.mark.slow
def test_what_the_maker_of_a_problem_knows_counts(monkeypatch):
    assert "it found a path where there is none" in findings_of(walled_trial(fits=False), monkeypatch)
    found, = findings_of(walled_trial(fits=True, walled_off=True), monkeypatch)
    assert found.startswith("a way leads from start to goal, but: No path exists: walls separate ")
    found, = findings_of(walled_trial(fits=True, start=(7.0, 1.0, 0.0), turning_radius=9.0), monkeypatch)
    assert found.startswith("the shortest curve leads to the goal, but: No path within planning_time 1 s: ")


def test_an_exception_is_found_and_told_with_the_command_that_repeats_it(monkeypatch, capsys):
    def fail(*_):
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(planner.explain, "before_search", fail)
    status, out, _ = run("--problems", "2", "--first", "7", "--seed", "3", capsys=capsys)
    assert status == 1 and "2 problems of seed 3" in out and "2 disagreements" in out
    assert "repeat it with `dubins_rrt campaign --seed 3 --first 8 --problems 1`:\n  ZeroDivisionError in fail" in out


def test_a_broken_invariant_is_found(monkeypatch):
    answer = replace(plan(walled_trial().problem, walled_trial().settings), samples=-1)
    monkeypatch.setattr(campaign_judge, "plan", lambda problem, settings: answer)
    assert "PlanError: -1 samples were drawn of 60" in findings_of(walled_trial(), monkeypatch)


@pytest.mark.slow
def test_an_answer_that_comes_late_is_found(monkeypatch):
    def late(problem, settings):
        end = time.process_time() + 1.5
        while time.process_time() < end:
            pass
        return replace(plan(problem, settings), planning_time=1.6)

    monkeypatch.setattr(campaign_judge, "plan", late)
    assert "it took 1.6 s, the limit being 0.5 s" in findings_of(walled_trial(planning_time=0.5), monkeypatch)


def test_a_lower_bound_that_is_none_is_found(monkeypatch):
    answers = iter([replace(plan(walled_trial().problem, walled_trial().settings), lower_bound=bound)
                    for bound in (1.0, 50.0)])
    monkeypatch.setattr(campaign_judge, "plan", lambda problem, settings: next(answers))
    found, = (finding for finding in findings_of(walled_trial(), monkeypatch, number=1) if "PlanError" not in finding)
    assert found.startswith("50.000000 m is said to be a lower bound, but there is a path of 1")


def costly_trial(preferred_clearance=0.0, **settings):
    """A problem without obstacles, half of whose cells cost something."""
    data = np.zeros((14, 20))
    data[:, 10:] = 40
    problem = Problem(GridMap(data, 0.5), Vehicle(0.5, 0.4), START, GOAL)
    return Trial("costly", problem, Settings(**{"samples": 60, "seed": 1, "preferred_clearance": preferred_clearance,
                                                "cost_weight": 3.0, **settings}))


@pytest.mark.parametrize("preferred_clearance", [0.0, 0.5])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_costs_of_cells_are_judged_with_and_without_a_preferred_clearance(number, preferred_clearance, monkeypatch):
    trial = costly_trial(preferred_clearance)
    assert findings_of(trial, monkeypatch, number) == []
    right = plan(trial.problem, trial.settings)
    assert right.cost > 1.3 * right.length
    answers = iter([replace(right, cost=0.9 * right.cost, cost_lower_bound=1.1 * right.cost), right])
    monkeypatch.setattr(campaign_judge, "plan", lambda problem, settings: next(answers))
    found = " ".join(findings_of(trial, monkeypatch, number))
    assert f"the cost of the path is {0.9 * right.cost} m, and by the audit {right.cost:.4g}"[:50] in found
    assert "there is a path with a cost of " in found and f"less than the bound {1.1 * right.cost:.6g} m" in found


def test_a_cost_that_is_not_the_length_is_found_where_nothing_else_costs(monkeypatch):
    right = plan(walled_trial().problem, walled_trial().settings)
    monkeypatch.setattr(campaign_judge, "plan", lambda problem, settings: replace(right, cost=1.01 * right.cost))
    found = " ".join(findings_of(walled_trial(), monkeypatch, number=2))
    assert f"the cost of the path is {1.01 * right.cost} m, and by the audit " in found


def test_a_wrong_cost_of_an_edge_is_found(monkeypatch):
    trial = costly_trial(0.5)
    right = plan(trial.problem, trial.settings)
    tree = replace(right.tree, edge_costs=0.99 * right.tree.edge_costs, costs=0.99 * right.tree.costs)
    monkeypatch.setattr(campaign_judge, "plan", lambda problem, settings: replace(right, tree=tree))
    assert "the edge to node 1 costs " in " ".join(findings_of(trial, monkeypatch, 2))


def test_a_bound_of_the_cost_above_another_planners_path_is_found(monkeypatch):
    trial = costly_trial()
    right = plan(trial.problem, trial.settings)
    answers = iter([right, replace(right, cost_lower_bound=2 * right.cost)])
    monkeypatch.setattr(campaign_judge, "plan", lambda problem, settings: next(answers))
    found, = findings_of(trial, monkeypatch, number=1)
    assert found.startswith("there is a path with a cost of ") and f"less than the bound {2 * right.cost:.6g} m" in found


def test_an_answer_that_changes_is_found(monkeypatch):
    plans = iter([plan(walled_trial(seed=seed).problem, walled_trial(seed=seed).settings) for seed in (1, 2)])
    monkeypatch.setattr(campaign_judge, "plan", lambda problem, settings: next(plans))
    assert "planned again it came to NONE, and to another tree or path" in findings_of(walled_trial(), monkeypatch)


@pytest.mark.slow
def test_a_process_that_dies_or_hangs_is_told_and_replaced():
    dies, hangs = "__import__('os')._exit(3)", "__import__('time').sleep(3600)"
    found = list(run_in_processes(eval, ["1", dies, "2", hangs, "3", "4"], 2, 8.0, lambda task, what: (task, what)))
    assert len(found) == 6 and {1, 2, 3, 4} < set(found)
    assert {(dies, "the process died with status 3"), (hangs, "no answer within 8 s")} < set(found)


@pytest.mark.slow
def test_after_ctrl_c_what_was_done_is_told(monkeypatch, capsys):
    def interrupted(task):
        if task.number == 2:
            raise KeyboardInterrupt
        return judge(task)

    monkeypatch.setattr("dubins_rrt_ros.evaluation.campaign.command.judge", interrupted)
    status, out, error = run("--problems", "5", capsys=capsys)
    assert status == 130 and "2 problems of seed 0" in out and error == "dubins_rrt campaign: interrupted\n"


@pytest.mark.parametrize("argv, words", [
    (["--problems", "0"], "--problems is 0; give 1 or more"), (["--seed", "-1"], "--seed is -1; give 0 or more"),
    (["--jobs", "0"], "--jobs is 0"), (["--first", "-3"], "--first is -3"),
    (["--out", "none/x.jsonl"], "there is no folder none")])
def test_wrong_usage_is_refused(argv, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    status, out, error = run(*argv, capsys=capsys)
    assert status == 2 and out == "" and words in error and not list(Path().iterdir())
