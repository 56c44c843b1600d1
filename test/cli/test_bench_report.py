"""`dubins_rrt bench --report`, by numbers computed by hand."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from dubins_rrt_ros.cli.bench import report as bench_report
from dubins_rrt_ros.cli.bench.plots import sample_cost
from dubins_rrt_ros.cli.bench.records import parse_record
from dubins_rrt_ros.cli.main import main
from dubins_rrt_ros.planning.pictures.drawing import GOAL, PATH


def run(problem, planner, seed, *trace, **more):
    """The line of a run of 1 s; without a trace it is not solved."""
    first_time, first_cost = trace[0] if trace else (None, None)
    return {"problem": problem, "planner": planner, "seed": seed, "time_limit": 1.0, "solved": bool(trace), "total_s": 1.001,
            "time_to_first": first_time, "first_cost": first_cost, "final_cost": trace[-1][1] if trace else None,
            "trace": [list(entry) for entry in trace], "audit": "ok" if trace else ""} | more


#: On "yard" a's medians are those of seed 1, and one of four runs is not solved; b is always at 11 m, and on "pond" never solved.
RUNS = [run("yard", "a", 0, (0.02, 20), (0.2, 10)), run("yard", "a", 1, (0.04, 16), (0.25, 10.5), (0.5, 10.15)),
        run("yard", "a", 2, (0.06, 15), (0.8, 10.4)), run("yard", "a", 3),
        run("yard", "b", 0, (0.01, 11)), run("yard", "b", 1, (0.03, 11)),
        run("pond", "a", 0, (0.09, 40)), run("pond", "b", 0)]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(runs, file="runs.jsonl"):
    Path(file).write_text("".join(json.dumps(line) + "\n" for line in runs))
    return file


def report(*flags):
    """The report's rows of cells, by their section and their first cell, and its text."""
    assert main(["bench", "--report", *flags, "--out", "report.md"]) == 0
    text = Path("report.md").read_text()
    rows, section = {}, ""
    for line in text.splitlines():
        if line.startswith("## "):
            section = line[3:]
        elif line.startswith("| "):
            first, *cells = line.strip("| ").split(" | ")
            rows[section, first] = cells
    return rows, text


def refusal(*files, capsys):
    status = main(["bench", "--report", *files])
    out, error = capsys.readouterr()
    assert status == 2 and out == "" and error.count("\n") == 1
    return error


@pytest.mark.parametrize(("values", "quarter", "half", "three_quarters"), [
    ([7], 7, 7, 7), ([2, 1], 1, 1, 2), ([3, 1, 2], 1, 2, 3), ([4, 3, 2, 1], 1, 2, 3), ([5, 4, 3, 2, 1], 2, 3, 4),
    ([1, math.inf, math.inf], 1, math.inf, math.inf)])
def test_quantiles_are_values_that_were_measured(values, quarter, half, three_quarters):
    assert [bench_report.quantile(values, share) for share in (0.25, 0.5, 0.75)] == [quarter, half, three_quarters]


def test_a_problem_has_medians_and_quartiles_over_all_its_runs():
    rows, text = report(write(RUNS))
    assert rows["yard", "planner"] == [
        "solved", "first path [ms]", "its cost", "cost at 0.05 s", "cost at 0.1 s", "cost at 0.3 s", "cost at 1 s", "final cost",
        "5 % above best [ms]", "2 % above best [ms]", "1 % above best [ms]"]
    # 10.5, 10.2 and 10.1 m are aimed at; within 5 % are the runs after 200, 250 and 800 ms, within 2 % after 200 and 500.
    assert rows["yard", "a"] == ["3/4", "40 [20, 60]", "16.00", "20.00", "16.00", "10.50", "10.15 [10.00, 10.40]",
                                 "10.15 [10.00, 10.40]", "250", "500", "-"]
    assert rows["yard", "b"] == ["2/2", "10 [10, 30]", "11.00", "11.00", "11.00", "11.00", *["11.00 [11.00, 11.00]"] * 2,
                                 "-", "-", "-"]
    assert rows["pond", "b"] == ["0/1", *["-"] * 10]
    assert "Best known: 10.0000 m, the best of these runs, of a with seed 0." in text


def test_the_overview_has_geometric_means_over_the_problems():
    rows, _ = report(write(RUNS))
    # a: 40 and 90 ms; on pond nothing at 0.05 s, then the best itself; on yard 20, 16, 10.5 and 10.15 by 10 m.
    assert rows["All problems", "a"] == ["4/5", "2/2", "60", "2.0000 (1/2)", f"{1.6 ** 0.5:.4f}", f"{1.05 ** 0.5:.4f}",
                                         f"{1.015 ** 0.5:.4f}"]
    assert rows["All problems", "b"] == ["2/3", "1/2", "10 (1/2)", *["1.1000 (1/2)"] * 4]


def test_best_known_lengths_are_taken_from_a_file():
    Path("best.json").write_text('{"yard": 9.5, "pond": {"cost": 50, "planner": "c"}, "elsewhere": 3}')
    rows, text = report(write(RUNS), "--best-known", "best.json")
    assert "Best known: 9.5000 m, as given." in text
    assert "Best known: 40.0000 m, **new**: the best of these runs, of a with seed 0, below the 50.0000 m given." in text
    assert rows["All problems", "a"][-1] == f"{(10.15 / 9.5) ** 0.5:.4f}"


def test_a_path_that_failed_its_check_does_not_count():
    failed = [run("yard", "a", 0, (0.1, 9), audit="at (1, 2) the clearance is 0.1 m"),
              run("yard", "c", 0, (0.1, 8), audit="ok", verify={"step_ok": False}), run("yard", "a", 1, (0.1, 10))]
    rows, text = report(write(failed))
    assert rows["yard", "a"][0] == "1/2" and rows["yard", "c"][0] == "0/1" and "Best known: 10.0000 m" in text


def test_lines_of_another_program_are_read():
    """It has no audit, thins its trace, and says little of a run that crashed."""
    other = {"problem": "yard", "planner": "RRT|x", "ompl_planner": "RRT", "seed": 1, "time_limit": 1, "status": "exact",
             "solved": True, "time_to_first": 0.021783506, "first_cost": 12.5, "final_cost": 10.1440949, "total_s": 1.0000,
             "verify": {"step_ok": True, "dense_ok": False}, "trace": [[0.0217835, 12.5], [0.4, 10.144095]]}
    crashed = {"problem": "yard", "planner": "RRT|x", "seed": 2, "time_limit": 1, "solved": False, "status": "failed",
               "why": "exit 1", "trace": [], "total_s": 21.5}
    rows, _ = report(write(RUNS), write([other, crashed], "other.jsonl"))
    assert rows["yard", "RRT\\|x"][:4] == ["1/2", "21.8 [21.8, -]", "12.50", "12.50"]
    assert list(rows["All problems", "planner"])[-1] == "cost / best known at 1 s"


def test_what_runs_cut_short_would_have_had_is_not_guessed():
    longer = [run("yard", "slow", seed, (0.5, 12), (3, 10), time_limit=5, total_s=5) for seed in (0, 1)]
    ended = run("yard", "rrt", 0, (0.01, 14), time_limit=5, total_s=0.01)
    rows, _ = report(write([*longer, ended, *RUNS[:4]]))
    assert rows["yard", "slow"][6:8] == ["12.00", "10.00 [10.00, 10.00]"]
    assert rows["yard", "a"][6:8] == ["10.15", "-"] and rows["yard", "rrt"][6:8] == ["14.00", "14.00 [14.00, 14.00]"]


def test_marks_end_with_the_longest_run():
    rows, _ = report(write([run("yard", "rrt", 0, (0.01, 14), time_limit=5, total_s=0.02)]))
    assert rows["yard", "planner"][3:6] == ["cost at 0.05 s", "final cost", "5 % above best [ms]"]


def test_without_a_file_the_report_is_printed(capsys):
    _, text = report(write(RUNS))
    for flags in ([], ["--out", "-"]):
        assert main(["bench", "--report", "runs.jsonl", *flags]) == 0
        assert capsys.readouterr().out == text


def test_a_report_as_csv_has_the_figures_of_the_json():
    assert main(["bench", "--report", write(RUNS), "--out", "report.CSV", "--json", "report.json"]) == 0
    with Path("report.CSV").open(newline="") as file:
        rows = list(csv.DictReader(file))
    results = json.loads(Path("report.json").read_text())["results"]
    assert [(row["problem"], row["planner"]) for row in rows] == [("yard", "a"), ("yard", "b"), ("pond", "a"), ("pond", "b")]
    for row, result in zip(rows, results, strict=True):
        figures = {"final_cost_median": result["final_cost"]["median"], "cost_at_0.3_median": result["cost_at"]["0.3"]["median"],
                   "time_to_within_0.02": result["time_to_within"]["0.02"], "solved": result["solved"]}
        assert {name: row[name] for name in figures} == {name: "" if value is None else str(value)
                                                         for name, value in figures.items()}
    moments = [[row[f"final_cost_of_solved_{name}"] for name in ("mean", "standard_deviation")] for row in rows]
    assert list(map(float, moments[0])) == pytest.approx([30.55 / 3, math.sqrt(0.245 / 6)])
    assert moments[1:] == [["11.0", "0.0"], ["40.0", ""], ["", ""]]


def test_a_report_as_latex_has_the_cells_of_the_markdown():
    runs = write([*RUNS, run("a & b_c", "50 % {x}~^\\$#", 0, (0.1, 9))])
    rows, _ = report(runs)
    assert main(["bench", "--report", runs, "--out", "report.tex"]) == 0
    text = Path("report.tex").read_text()
    assert text.count(r"\begin{tabular}{lrr") == 3 and text.count(r"\bottomrule") == 4
    lines = [line.removesuffix(r" \\").split(" & ") for line in text.split(r"\begin{table}")[2].splitlines() if " & " in line]
    assert list(zip(*lines, strict=True))[1:] == [(name, *rows["yard", name]) for name in ("a", "b")]
    assert r"\caption{a \& b\_c. Best known: 9.0000 m" in text
    assert r"planner & 50 \% \{x\}\textasciitilde{}\textasciicircum{}\textbackslash{}\$\# \\" in text


@pytest.mark.parametrize(("text", "says"), [
    ("", "no runs to report"), ("{", "bad.jsonl, line 1 is no run"), ("\n[]\n", "line 2 is no run, for it is no object"),
    ('{"problem": "yard"}\n', "line 1 is no run, for it has no 'solved'"),
    (json.dumps(run("yard", "a", 0, total_s=math.nan)), "its total_s is nan"),
    (json.dumps(run("yard", "a", 0, (0.1, math.nan))), "its trace holds [0.1, nan]"),
    (json.dumps(run("yard", "a", 0, (0.1, 9), trace=[])), "its trace is empty")])
def test_a_file_that_holds_no_runs_takes_one_line(text, says, capsys):
    Path("bad.jsonl").write_text(text)
    assert says in refusal("bad.jsonl", capsys=capsys)


def test_the_same_run_twice_is_refused(capsys):
    said = refusal(write(RUNS), write(RUNS[4:5], "again.jsonl"), capsys=capsys)
    assert "again.jsonl, line 1 is the run of b on yard with seed 0 again, after runs.jsonl, line 5" in said


def test_files_are_not_lost_nor_missing(capsys):
    file = write(RUNS)
    assert "overwrite" in refusal(file, "--out", file, capsys=capsys)
    assert "gone.jsonl cannot be read" in refusal("gone.jsonl", capsys=capsys)


@pytest.mark.parametrize("text", ["[1]", '{"yard": "9"}', '{"yard": {"length": 9}}', '{"yard": 0}', '{"yard": NaN}', "{"])
def test_best_known_lengths_that_are_none_take_one_line(text, capsys):
    Path("best.json").write_text(text)
    assert "best.json" in refusal(write(RUNS), "--best-known", "best.json", capsys=capsys)


@pytest.mark.slow
def test_the_plot_has_a_line_for_each_planner():
    report(write(RUNS), "--plot", "runs.png")
    pixels = np.round(imread("runs.png")[..., :3] * 255)
    panel = pixels[len(pixels) // 3:]  # the legend is above
    for colour in (PATH, GOAL):
        rgb = [int(colour[i:i + 2], 16) for i in (1, 3, 5)]
        assert (np.abs(panel - rgb) < 3).all(axis=2).sum() > 300, colour


def test_the_plot_has_the_names():
    report(write(RUNS), "--plot", "runs.svg")
    text = Path("runs.svg").read_text()
    assert all(f"<!-- {name} -->" in text for name in ("yard", "pond", "a", "b"))


def test_the_plot_of_short_runs_names_major_ticks_alone():
    short = {"time_limit": 0.02, "total_s": 0.02}
    report(write([run("yard", planner, 0, (0.002, 12.0), (0.01, 10.0), **short) for planner in "ab"]), "--plot", "runs.svg")
    text = Path("runs.svg").read_text()
    assert "<!-- 10 ms -->" in text and "times10" not in text


@pytest.mark.slow
def test_the_plot_takes_runs_of_any_kind():
    """None solved, the start the goal, and more planners than kinds of line."""
    many = [run("yard", f"planner {i}", 0, (0.1, 10 + i)) for i in range(24)]
    report(write([run("gap", "a", 0), run("still", "a", 0, (1e-5, 0.0)), *many]), "--plot", "runs.png")
    assert imread("runs.png").size > 0


def test_what_a_sample_costs_is_drawn_for_each_budget():
    """Medians of 20 and 30 µs at 200 and 2000 nodes; seed 2 is slower, and runs that do not tell are left out."""
    runs = [run("yard", label, seed, (0.1, 10), total_s=total, samples=samples, vertices=samples // 5)
            for label, samples, total in (("few", 1000, 0.02), ("many", 10_000, 0.3)) for seed, total in enumerate(
                (total, total, 2 * total))]
    assert sample_cost([parse_record(line) for line in runs[:3]]) == (200, pytest.approx(20))
    assert sample_cost([parse_record(line) for line in runs[3:]]) == (2000, pytest.approx(30))
    report(write([*runs, *RUNS[4:]]), "--plot-samples", "samples.svg")
    text = Path("samples.svg").read_text()
    assert "<!-- yard -->" in text and "<!-- pond -->" not in text


def test_runs_that_do_not_say_their_samples_are_refused(capsys):
    assert "says its samples" in refusal(write(RUNS), "--plot-samples", "samples.svg", "--out", "report.md", capsys=capsys)
    assert not Path("samples.svg").exists()


@pytest.mark.parametrize("flag", ["--plot", "--plot-samples"])
def test_a_picture_in_another_format_is_refused(flag, capsys):
    assert "p.gif" in refusal(write(RUNS), flag, "p.gif", capsys=capsys)
