"""The commands' entries: Ctrl-C at any time ends them without a trace, also while they are imported."""

import subprocess
import sys

import pytest

#: A module of another package that is imported late by both commands; the signal comes while it is.
INTERRUPTING = "import os, signal, time\nos.kill(os.getpid(), signal.{})\ntime.sleep(5)\n"


@pytest.mark.parametrize(("module", "words", "by", "status", "said"), [
    ("dubins_rrt_ros", ["plan", "maze", "--start", "1", "1", "0", "--goal", "2", "2", "0"], "SIGINT", 130, "interrupted\n"),
    ("dubins_rrt_ros.node", ["--help"], "SIGINT", 0, ""), ("dubins_rrt_ros.node", ["--help"], "SIGTERM", 0, "")],
    ids=["command", "node", "node by SIGTERM"])
def test_an_interrupt_while_importing_leaves_no_trace(tmp_path, module, words, by, status, said):
    if module.endswith("node"):
        pytest.importorskip("rclpy", reason="rclpy is not installed")
    (tmp_path / "yaml.py").write_text(INTERRUPTING.format(by))
    run = f"import runpy, sys; sys.path.insert(0, {str(tmp_path)!r}); sys.argv[1:] = {words!r}; " \
          f"runpy.run_module({module!r}, run_name='__main__', alter_sys=True)"
    done = subprocess.run([sys.executable, "-c", run], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (status, "")
    assert done.stderr.endswith(said) and done.stderr.count("\n") == said.count("\n"), done.stderr
