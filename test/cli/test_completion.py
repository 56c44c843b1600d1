"""`dubins_rrt completion`: what the shells make of the script."""

import contextlib
import io
import os
import pty
import select
import shutil
import subprocess
import termios
import time
from pathlib import Path

import pytest

from dubins_rrt_ros.cli import completion
from dubins_rrt_ros.cli.main import main

MAPS = {"block", "block.geojson", "forest", "forest.geojson", "maze", "maze.geojson", "parking.geojson"}
#: Completes the words given as arguments, the last of which may be cut short; one reply a line.
ASK_BASH = """. ./script
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
_dubins_rrt 2>/dev/null  # compopt works at the tab key alone
printf '%s\\n' ${COMPREPLY[@]+"${COMPREPLY[@]}"}"""


def script(shell):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(["completion", shell]) == 0
    return out.getvalue()


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, with some files."""
    monkeypatch.chdir(tmp_path)
    Path("map of mine.wkt").touch()
    Path("plan.json").touch()
    Path("grids").mkdir()


@pytest.fixture
def bash(folder):
    Path("script").write_text(script("bash"))

    def ask(*words):
        done = subprocess.run(["bash", "-u", "-c", ASK_BASH, "bash", "dubins_rrt", *words], capture_output=True, text=True,
                              timeout=60)
        assert done.returncode == 0 and done.stderr == ""
        return set(filter(None, done.stdout.splitlines()))

    return ask


def test_bash_completes_the_commands(bash):
    assert {"plan", "audit", "bench", "campaign", "demo", "paper", "render", "completion", "--help", "--version"} <= bash("")
    assert bash("pl") == {"plan", "play"}


@pytest.mark.parametrize("command", ["plan", "audit", "bench", "campaign", "demo", "paper", "render"])
def test_bash_completes_all_flags_of_a_command(command, bash, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    columns = (line[2:].split("  ")[0] for line in capsys.readouterr().out.splitlines() if line.startswith("  -"))
    flags = {flag.split()[0] for column in columns for flag in column.split(", ") if flag.startswith("--")}
    assert {"--help", "--json"} <= flags <= bash(command, "--")


@pytest.mark.parametrize("words", [["plan"], ["plan", "--informed"], ["plan", "--json", "-"], ["audit", "plan.json"], ["render"],
                                   ["plan", "--start", "1", "-2", "3"], ["plan", "--seed", "=", "3"]])
def test_bash_completes_map_names_and_files_where_a_map_is_due(words, bash):
    assert bash(*words, "") >= MAPS | {"map of mine.wkt", "plan.json"}
    assert bash(*words, "ma") == {"maze", "maze.geojson", "map of mine.wkt"}


@pytest.mark.parametrize("words, replies", [
    (["plan", "maze", "--planner", ""], {"rrt", "rrt_star"}), (["plan", "maze", "--planner", "=", "rrt_"], {"rrt_star"}),
    (["plan", "maze", "--planner", "="], {"rrt", "rrt_star"}), (["plan", "maze", "--heading-sampling", "g"], {"goal"}),
    (["plan", "maze", "--start", ""], set()), (["plan", "maze", "--start", "1", "2", ""], set()),
    (["plan", "maze", "--seed", ""], set()), (["completion", ""], {"bash", "zsh", "fish"}),
    (["render", "maze.geojson", "--out", ""], {"grids"}), (["nothing", ""], set()),
    (["bench", "--report", "a", "b", "--plo"], {"--plot", "--plot-samples"}),
    (["plan", "maze", "--goal-t"], {"--goal-tolerance-xy", "--goal-tolerance-yaw"})])
def test_bash_completes_what_a_place_takes(words, replies, bash):
    assert bash(*words) == replies


def test_no_program_of_ours_is_asked_and_it_takes_no_time(bash):
    begin = time.perf_counter()
    bash("plan", "ma")
    assert time.perf_counter() - begin < 1.0 and "$(dubins_rrt" not in Path("script").read_text()


def test_maps_that_come_later_are_completed_too(tmp_path, monkeypatch, bash):
    maps = tmp_path / "it's a folder"
    maps.mkdir()
    monkeypatch.setattr(completion, "maps_directory", lambda: maps)
    Path("script").write_text(script("bash"))
    assert bash("plan", "y") == set()
    for name in ("yard.yaml", "yard.pgm", "yacht.wkt"):
        (maps / name).touch()
    assert bash("plan", "y") == {"yard", "yacht.wkt"}


def test_the_tab_key_completes_in_a_terminal():
    """A line as it is typed, its words cut short; files in the shell's own way."""
    Path("script").write_text(script("bash"))
    typed = "dubins_rrt plan\tpark\t--planner rrt_\t--json pl\t--csv 'map o\t\n"
    assert "<plan><parking.geojson><--planner><rrt_star><--json><plan.json><--csv><map of mine.wkt>" in _typed_into_bash(typed)


def _typed_into_bash(line):
    """What a terminal shows where `dubins_rrt` prints its words."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 200))
    with subprocess.Popen(["bash", "--norc", "--noprofile", "-i"], stdin=theirs, stdout=theirs, stderr=theirs,
                          start_new_session=True, env={**os.environ, "TERM": "dumb", "HISTFILE": ""}):
        os.close(theirs)
        os.write(ours, b"dubins_rrt() { printf '<%s>' \"$@\"; }; . ./script; echo rea''dy\n")
        shown = _read_until(ours, b"ready\r")
        os.write(ours, line.encode())
        shown += _read_until(ours, b"wkt>")
        os.write(ours, b"exit\n")
    os.close(ours)
    return shown


def _read_until(terminal, end):
    shown = b""
    while end not in shown:
        assert select.select([terminal], [], [], 60)[0], shown
        shown += os.read(terminal, 4096)
    return shown.decode()


@pytest.mark.skipif(not shutil.which("zsh"), reason="zsh is not installed")
def test_zsh_reads_the_script():
    Path("script").write_text(script("zsh"))
    done = subprocess.run(["zsh", "-f", "-c", ". ./script; print $_comps[dubins_rrt]"], capture_output=True, text=True,
                          timeout=60)
    assert done.returncode == 0 and "_dubins_rrt" in done.stdout


@pytest.mark.skipif(not shutil.which("fish"), reason="fish is not installed")
@pytest.mark.parametrize("line, replies", [
    ("pl", {"plan", "play"}), ("plan ma", {"maze", "maze.geojson", "map of mine.wkt"}),
    ("plan maze --planner ", {"rrt", "rrt_star"}),
    ("plan maze --goal-t", {"--goal-tolerance-xy", "--goal-tolerance-yaw"}), ("plan --json pl", {"plan.json"}),
    ("render --out g", {"grids/"}), ("plan --seed ", set())])
def test_fish_completes_likewise(line, replies):
    Path("script").write_text(script("fish"))
    done = subprocess.run(["fish", "--no-config", "-c", f"source script; complete -C 'dubins_rrt {line}'"], capture_output=True,
                          text=True, timeout=60)
    assert done.stderr == "" and {reply.split("\t")[0].replace("\\", "") for reply in done.stdout.splitlines()} == replies


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_line_of_a_script_has_its_words(shell):
    text = script(shell)
    assert "None" not in text and "PLACES" not in text and text.count("\n") < 400 and "heading-sampling" in text
