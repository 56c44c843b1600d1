"""`dubins_rrt` and `planner` where packages that come with an extra are not installed."""

import subprocess
import sys

import pytest
from support.cases import needs_compiled

from dubins_rrt_ros.cli.common.example import ENDS

BLOCKED = """
import sys
sys.modules |= dict.fromkeys(["matplotlib", "tqdm"])  # so that to import one raises ImportError
from dubins_rrt_ros.cli.main import main
sys.exit(main(sys.argv[1:]))
"""
PLAN = ["plan", "maze", *ENDS.split(), "--planner", "rrt"]


def without_extras(folder, *words):
    return subprocess.run([sys.executable, "-c", BLOCKED, *words], cwd=folder, capture_output=True, text=True, timeout=120)


@pytest.mark.slow
@needs_compiled
def test_plan_audit_render_bench_and_campaign_do_not_need_them(tmp_path):
    problem = ('[{"name": "maze", "map": "maze.yaml", "start": [1.5, 2, 1.57], "goal": [13.5, 10.5, 1.57], '
               '"turning_radius": 1, "robot_radius": 0.2}]')
    (tmp_path / "problems.json").write_text(problem)
    for words in ([*PLAN, "--json", "plan.json"], ["audit", "plan.json", "maze"], ["render", "maze.geojson", "--out", "."],
                  ["bench", "problems.json", "--samples", "20", "--planner", "rrt", "--out", "runs.jsonl"],
                  ["bench", "--report", "runs.jsonl"], ["campaign", "--problems", "1"]):
        done = without_extras(tmp_path, *words)
        assert (done.returncode, done.stderr) == (0, ""), words


@pytest.mark.parametrize("words, extra", [
    ([*PLAN, "--json", "plan.json", "--plot", "maze.png"], "plots"), pytest.param(["demo"], "plots", marks=pytest.mark.slow),
    pytest.param(["bench", "--report", "runs.jsonl", "--plot", "runs.png"], "plots", marks=pytest.mark.slow),
    pytest.param(["paper", "--out", "paper"], "evaluation", marks=pytest.mark.slow),
    pytest.param(["figures", "--out", "figures"], "evaluation", marks=pytest.mark.slow)])
def test_what_draws_says_what_to_install_before_any_work(words, extra, tmp_path):
    done = without_extras(tmp_path, *words)
    assert done.returncode == 2 and done.stdout == "" and list(tmp_path.iterdir()) == []
    assert done.stderr.endswith(f"dubins_rrt {words[0]}: error: pictures are drawn by matplotlib, which is not installed; "
                                f"run: pip install 'dubins_rrt_ros[{extra}]'\n")


def test_without_ros_the_planner_says_what_to_install():
    blocked = "import sys; sys.modules['rclpy'] = None; from dubins_rrt_ros.node.__main__ import main; sys.exit(main())"
    done = subprocess.run([sys.executable, "-c", blocked], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == ("planner: ROS 2 is not here (no module rclpy); source its setup file, or run: "
                           "pip install 'dubins_rrt_ros[ros]'\n")
