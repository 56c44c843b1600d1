"""`dubins_rrt` among other programs: pipes, full disks, Ctrl-C, terminals."""

import os
import pty
import signal
import subprocess
import sys
import termios
import time

import pytest
from support.cases import needs_compiled

PLAN = ["plan", "maze", "--start", "1.5", "2", "1.57", "--goal", "13.5", "10.5", "1.57", "--planner", "rrt"]


def start(*words, **keywords):
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | keywords
    environment = {**os.environ, "PYTHONUNBUFFERED": ""}  # as a shell has it: what is printed is written at the end
    return subprocess.Popen([sys.executable, "-m", "dubins_rrt_ros", *words], text=True, env=environment, **streams)


@pytest.mark.slow
@pytest.mark.parametrize("words", [[*PLAN, "--json", "-", "--path-spacing", "0.001"], PLAN, ["--help"], ["completion", "bash"]])
def test_a_reader_that_goes_away_is_no_error(words):
    """As `dubins_rrt ... | true`: much output fails while it is written, a little at the end."""
    with start(*words) as process:
        process.stdout.close()
        error = process.stderr.read()
    assert process.returncode == 141 and "Error" not in error and "Traceback" not in error


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
@pytest.mark.parametrize("words", [[*PLAN, "--json", "-", "--path-spacing", "0.001"], PLAN])
def test_a_full_disk_is_told_in_one_line(words):
    with open("/dev/full", "w") as full, start(*words, stdout=full) as process:
        error = process.stderr.read()
    assert process.returncode == 2 and "Traceback" not in error and "Exception" not in error
    assert error.endswith("dubins_rrt plan: error: the output cannot be written: No space left on device\n")


@pytest.mark.slow
@needs_compiled
def test_without_a_standard_output_it_plans_all_the_same(tmp_path):
    command = f"exec {sys.executable} -m dubins_rrt_ros {' '.join(PLAN)} --json {tmp_path / 'plan.json'} >&-"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stderr == "" and (tmp_path / "plan.json").stat().st_size > 0


INTERRUPTED_IMPORT = """
import os, signal, sys
from dubins_rrt_ros.cli.main import main

class Finder:
    def find_spec(name, path, target):
        if name == "scipy":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Finder)
sys.exit(main(["campaign"]))
"""


def test_ctrl_c_while_it_starts_prints_no_trace():
    """Its imports take a second."""
    done = subprocess.run([sys.executable, "-c", INTERRUPTED_IMPORT], capture_output=True, text=True, timeout=60)
    assert done.returncode == 130 and done.stderr == "dubins_rrt campaign: interrupted\n" and done.stdout == ""


@pytest.mark.slow
@needs_compiled
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_ends_a_campaign_with_what_was_done(jobs, tmp_path):
    lines = tmp_path / "lines.jsonl"
    with start("campaign", "--jobs", jobs, "--out", str(lines)) as process:
        while process.poll() is None and not (lines.exists() and lines.read_text().count("\n") > 3):
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60)
    assert process.returncode == 130 and error == "dubins_rrt campaign: interrupted\n" and "problems of seed 0 in" in out


def on_a_terminal(*words):
    """What a terminal as standard error shows, and standard output."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 100))
    with start(*words, stderr=theirs) as process:
        os.close(theirs)
        shown = b""
        while chunk := _read(ours):
            shown += chunk
        out = process.stdout.read()
    os.close(ours)
    return shown.decode(), out


def _read(terminal):
    try:
        return os.read(terminal, 4096)
    except OSError:  # the other end is closed
        return b""


@pytest.mark.slow
@needs_compiled
def test_long_work_shows_a_bar_on_a_terminal_and_no_colours_in_a_pipe():
    shown, out = on_a_terminal("campaign", "--problems", "3")
    assert "/3 [" in shown and "3 problems of seed 0" in out and "\x1b" not in out and "\r" not in out


@needs_compiled
def test_a_pipe_gets_one_line():
    done = subprocess.run([sys.executable, "-m", "dubins_rrt_ros", *PLAN], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stderr == "" and done.stdout.count("\n") == 1 and "\x1b" not in done.stdout
