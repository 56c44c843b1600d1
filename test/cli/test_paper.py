"""`dubins_rrt paper`: what it measures, with two seeds, and that the report says so."""

import json
import math
import re
import signal
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

import pytest
from matplotlib.image import imread
from support.cases import needs_compiled

from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.evaluation.paper.runs import MARKS, TABLE, Measured, PaperRun, RunOutcome
from dubins_rrt_ros.planning import Problem, Settings, Vehicle, load_map, plan
from dubins_rrt_ros.planning.maps.locate import maps_directory

PLAIN = {"informed": False, "shortcut": False, "heading_sampling": "uniform", "planning_time": 600.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the command writes for two seeds."""
    folder = tmp_path_factory.mktemp("paper") / "results"
    assert main(["paper", "--out", str(folder), "--seeds", "2", "--jobs", "2", "--json", str(folder.parent / "answer.json")]) == 0
    return folder


@pytest.fixture(scope="module")
def lengths(folder):
    """The lengths by run."""
    lines = [json.loads(line) for line in (folder / "runs.jsonl").read_text().splitlines()]
    return {PaperRun(*(line[name] for name in PaperRun._fields)): line["length"] for line in lines}


def outcome(length, samples_to_first):
    return RunOutcome(length, 5, 1.5, 0.01, samples_to_first, 3.0)


def report_rows(folder, first):
    """The cells of the report's rows that begin with a cell."""
    rows = [line.strip("| ").split(" | ") for line in (folder / "report.md").read_text().splitlines() if line.startswith("| ")]
    return [cells for cells in rows if cells[0] == first]


@pytest.mark.slow
@needs_compiled
def test_rrt_star_is_never_longer_with_more_samples_of_the_same_seed(lengths):
    by_seed = defaultdict(dict)
    for run, length in lengths.items():
        if (run.environment, run.planner, run.headings, run.step_size) == ("maze", "rrt_star", "uniform", 0):
            by_seed[run.seed][run.samples] = math.inf if length is None else length
    assert set(by_seed) == {0, 1}
    for by_samples in by_seed.values():
        falling = [by_samples[mark] for mark in MARKS]
        assert falling == sorted(falling, reverse=True) and falling[-1] < falling[MARKS.index(500)] < math.inf


@pytest.mark.slow
@needs_compiled
def test_rrt_star_is_at_least_8_percent_shorter_than_rrt(folder, lengths):
    rrt, star = (min(lengths[PaperRun("maze", planner, 3000, "uniform", 0.0, seed)] for seed in (0, 1))
                 for planner in ("rrt", "rrt_star"))
    assert star <= 0.92 * rrt
    row, = report_rows(folder, "3000")
    assert row[1] == row[3] == "2/2" and row[2].startswith(f"{rrt:.2f} [") and row[4].startswith(f"{star:.2f} [")
    assert row[5] == f"{100 * (1 - star / rrt):.1f} %" and row[6:] == ["22.54", "20.26", "10.1 %"]
    assert all(len(report_rows(folder, str(samples))) == 1 for samples in TABLE)


@pytest.mark.slow
@needs_compiled
def test_the_runs_are_those_of_the_papers_algorithms(lengths):
    file = maps_directory() / "forest.geojson"
    poses = json.loads(file.read_text())
    problem = Problem(load_map(file), Vehicle(turning_radius=1.0, robot_radius=0.2), poses["start"], poses["goal"])
    for planner, samples in (("rrt", 3000), ("rrt_star", 500)):
        answer = plan(problem, Settings(planner=planner, samples=samples, seed=1, **PLAIN))
        assert lengths[PaperRun("forest", planner, samples, "uniform", 0.0, 1)] == answer.length
    limited = plan(problem, Settings(planner="rrt", seed=0, **PLAIN | {"heading_sampling": "field"}, step_size=2.0))
    assert lengths[PaperRun("forest", "rrt", 3000, "field", 2.0, 0)] == limited.length


@pytest.mark.slow
@needs_compiled
def test_the_report_is_whole_and_shows_every_figure(folder):
    text = (folder / "report.md").read_text()
    links = re.findall(r"\(([\w-]+\.(?:png|svg))\)", text)
    assert sorted(links) == sorted(file.name for file in folder.iterdir() if file.suffix in (".png", ".svg")) and len(links) == 20
    assert all(imread(folder / link).shape[1] > 900 for link in links if link.endswith(".png"))
    assert [len(report_rows(folder, environment)) for environment in ("block", "maze", "forest")] == [6, 6, 6]
    assert not re.search(r"[{}]|\b(nan|inf|None)\b", text)
    assert "**What was found**" in text and "**Why.**" in text
    assert all(len(line) <= 130 for line in text.splitlines() if line[:1] not in ("|", "["))


@pytest.mark.slow
@needs_compiled
def test_rrt_with_headings_towards_the_goal_never_passes_the_second_wall(folder, lengths):
    """As the report explains."""
    assert all(lengths[PaperRun("maze", "rrt", 3000, "goal", 0.0, seed)] is None for seed in (0, 1))
    assert "finds a path through the maze with 0 of 2 seeds" in " ".join((folder / "report.md").read_text().split())


@pytest.mark.slow
@needs_compiled
def test_json_holds_the_tables_and_the_answer(folder, lengths):
    document = json.loads((folder.parent / "answer.json").read_text())
    assert document["report"] == str(folder / "report.md") and document["seeds"] == 2
    assert [row["samples"] for row in document["table"]] == list(TABLE)
    last = document["table"][-1]
    shorter, longer = sorted(lengths[PaperRun("maze", "rrt_star", 3000, "uniform", 0.0, seed)] for seed in (0, 1))
    assert last["rrt_star"]["length"] == {"lower_quartile": shorter, "median": shorter, "upper_quartile": longer}
    assert last["paper"] == {"rrt": 22.54, "rrt_star": 20.26} and last["rrt"]["runs"] == last["rrt"]["solved"] == 2
    stuck, = (row["rrt"] for row in document["question"]
              if (row["environment"], row["heading_sampling"], row["step_size"]) == ("maze", "goal", 0))
    assert stuck["solved"] == 0 and stuck["length"]["median"] is stuck["samples_to_first"]["median"] is None
    assert len(document["question"]) == 18 and len(document["answer"]) == 2
    assert all(text in (folder / "report.md").read_text() for text in document["answer"])


def test_rrt_with_fewer_samples_has_what_it_found_by_then():
    runs = [PaperRun("maze", "rrt", 3000, "uniform", 0.0, seed) for seed in range(3)]
    found = [outcome(30.0, 120), outcome(20.0, 700), outcome(25.0, 400)]
    measured = Measured(dict(zip(runs, found, strict=True)), 3)
    assert [run.length for run in measured.of("maze", "rrt", 500)] == [30.0, math.inf, 25.0]
    assert measured.of("maze", "rrt") == found and not measured.of("maze", "rrt", 119)[0].solved
    assert measured.of("maze", "rrt", 120)[0].solved and measured.of("maze", "rrt", 119)[0].reach == 3.0


@pytest.mark.parametrize("samples, seed, found", [(3000, 2, 3), (500, 2, 2), (150, 0, 1), (50, 0, 0)])
def test_the_picture_shows_the_median_of_the_paths_that_were_found(samples, seed, found):
    firsts = {0: (30.0, 120), 1: (20.0, 700), 2: (25.0, 400)}
    outcomes = {PaperRun("maze", "rrt", 3000, "uniform", 0.0, number): outcome(*first) for number, first in firsts.items()}
    measured = Measured(outcomes, 3)
    assert measured.median_run("maze", "rrt", samples) == (PaperRun("maze", "rrt", samples, "uniform", 0.0, seed), found)


@pytest.mark.slow
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_ends_it_and_keeps_the_lines_that_are_written(jobs, tmp_path):
    command = [sys.executable, "-m", "dubins_rrt_ros", "paper", "--out", str(tmp_path), "--jobs", jobs]
    lines = tmp_path / "runs.jsonl"
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not (lines.exists() and lines.read_text().endswith("\n")):
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
    assert process.returncode == 130 and out == "" and error.endswith("dubins_rrt paper: interrupted\n")
    assert "Traceback" not in error and json.loads(lines.read_text().splitlines()[0])["environment"] == "maze"


@pytest.mark.parametrize("flags, words", [(["--seeds", "0"], "--seeds is 0; give 1 or more"), (["--jobs", "-1"], "--jobs is -1"),
                                          (["--out", __file__], f"{Path(__file__).name} cannot be written")])
def test_wrong_usage_takes_one_line(flags, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["paper", *flags]) == 2
    out, error = capsys.readouterr()
    assert out == "" and words in error and error.splitlines()[-1].startswith("dubins_rrt paper: error: ")
    assert not list(tmp_path.iterdir())
