"""The help of `dubins_rrt`, whose examples run, and what it says to those who slip."""

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from support.cases import needs_compiled

from dubins_rrt_ros.cli import main as program
from dubins_rrt_ros.cli.commands import make_parser
from dubins_rrt_ros.cli.common.parser import guard_numbers

COMMANDS = ["plan", "audit", "bench", "campaign", "certify", "check", "completion", "demo", "figures", "paper", "play", "render",
            "watch"]
ENDS = ["--start", "1.5", "2", "1.57", "--goal", "13.5", "10.5", "1.57"]


def help_of(*command):
    with contextlib.redirect_stdout(io.StringIO()) as out, pytest.raises(SystemExit) as end:
        program.main([*command, "--help"])
    assert end.value.code == 0
    return out.getvalue()


def examples(command):
    """The lines of a command's examples."""
    text = re.search(r"^examples:\n((?:  .*\n)+)", help_of(command), re.MULTILINE)[1]
    return [line[2:] for line in text.splitlines()]


def run_as_printed(lines, folder):
    """Run lines in a shell, which finds this very `dubins_rrt`."""
    words = f"#!/bin/sh\nexec {shlex.quote(sys.executable)} -m dubins_rrt_ros \"$@\"\n"
    (folder / "bin").mkdir()
    (folder / "bin" / "dubins_rrt").write_text(words)
    (folder / "bin" / "dubins_rrt").chmod(0o755)
    environment = {**os.environ, "PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "HOME": str(folder)}
    return subprocess.run(["bash", "-euo", "pipefail", "-c", "\n".join(lines)], cwd=folder, env=environment, capture_output=True,
                          text=True, timeout=300)


def refusal(*words, capsys):
    """The one line on standard error of a command that is used wrongly."""
    try:
        status = program.main(words)
    except SystemExit as end:
        status = end.code
    out, error = capsys.readouterr()
    assert status == 2 and out == "" and error.count("\n") == 1
    return error


def test_no_command_shows_the_help_with_a_quick_start(capsys):
    assert program.main([]) == 2
    out, error = capsys.readouterr()
    assert out == "" and error == help_of()
    start = re.search(r"quick start:\n((?:  .*\n)+)", error)[1].splitlines()
    assert len(start) == 2 and start[0].startswith("  dubins_rrt plan maze --start ") and "exit status:" in error
    assert all(f"\n    {command}" in error for command in COMMANDS)


@pytest.mark.parametrize("flag", ["--help", "--version"])
def test_the_list_of_commands_needs_none_of_what_they_import(flag):
    words = ("import sys; sys.modules |= dict.fromkeys(['numpy', 'scipy']); "
             f"from dubins_rrt_ros.cli.main import main; main(['{flag}'])")
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stdout.startswith(("usage: dubins_rrt", "dubins_rrt ")) and done.stderr == ""


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_examples_that_are_understood_and_tells_the_exit_status(command):
    lines = "\n".join(examples(command)).replace("\\\n", "").splitlines()
    mine = [shlex.split(line)[1:] for line in lines if f"{line} ".startswith(f"dubins_rrt {command} ")]
    for words in mine:
        arguments = make_parser([command]).parse_args(guard_numbers(words[:words.index(">")] if ">" in words else words))
        assert arguments.command == command
    assert mine and re.search(r"^exit status:\n  0 .*2 wrong usage", help_of(command), re.MULTILINE)


@pytest.mark.slow
@needs_compiled
@pytest.mark.parametrize("command, some, files", [
    ("plan", slice(None), ["maze.png", "plan.json"]), ("audit", slice(None), ["plan.json", "theirs.json"]),
    ("bench", slice(None), ["ours.jsonl", "plain.jsonl", "report.png"]), ("campaign", slice(1), []),
    ("completion", slice(None), [".local/share/bash-completion/completions/dubins_rrt"]),
    ("render", slice(None), ["grids/maze.yaml", "grids/maze.pgm"])])
def test_the_examples_run_as_they_are_printed(command, some, files, tmp_path):
    done = run_as_printed(examples(command)[some], tmp_path)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert all((tmp_path / file).stat().st_size > 0 for file in files)


@pytest.mark.parametrize("words, says", [
    (["pln"], "argument COMMAND: pln is unknown; did you mean plan? (see dubins_rrt --help)"),
    (["zzz"], "zzz is unknown; give one of plan, audit, "),
    (["--hlep"], "dubins_rrt: error: there is no flag --hlep; did you mean --help?"),
    (["plan"], "the following arguments are required: MAP, --start, --goal (see dubins_rrt plan --help)"),
    (["plan", "maze", "--strat", *ENDS[1:]], "there is no flag --strat; did you mean --start? (see dubins_rrt plan --help)"),
    (["plan", "maze", *ENDS, "--sampels=3"], "there is no flag --sampels; did you mean --samples?"),
    (["plan", "maze", *ENDS, "--qqq", "3"], "dubins_rrt plan: error: there is no flag --qqq (see "),
    (["plan", "maze", *ENDS, "-0.5", "7"], "-0.5 is one argument too many"),
    (["plan", "maze", *ENDS, "--planner", "rrtstar"], "argument --planner: rrtstar is unknown; did you mean rrt_star?"),
    (["plan", "maze", *ENDS, "--planner", "a"], "argument --planner: a is unknown; give one of rrt, rrt_star"),
    (["plan", "mase", *ENDS], "mase: no such map file; give "), (["plan", "mase.yaml", *ENDS], "; did you mean maze?"),
    (["render", "parkin"], "; did you mean parking.geojson?"), (["completion", "tcsh"], "tcsh is unknown; ")])
def test_a_slip_takes_one_line_that_suggests_what_was_meant(words, says, capsys):
    assert says in refusal(*words, capsys=capsys)


@pytest.mark.parametrize("name", ["nowhere/at/all.yaml", "m.jpg", "maz.png", "."], ids=["other", "photo", "picture", "folder"])
def test_a_map_that_resembles_none_gets_no_suggestion(name, capsys):
    assert "did you mean" not in refusal("plan", name, *ENDS, capsys=capsys)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_fits_a_terminal(command):
    text = help_of(command)
    assert all(len(line) <= 130 for line in text.splitlines()) and "usage: dubins_rrt " in text.splitlines()[0]


def test_the_installed_maps_are_not_written_to_by_render(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert program.main(["render", "block.geojson", "--resolution", "0.5"]) == 0
    assert Path("block.yaml").is_file() and Path("block.pgm").is_file() and "block.yaml and its image" in capsys.readouterr().out
