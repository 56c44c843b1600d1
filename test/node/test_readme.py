"""The README's client, as it stands there, against the installed planner."""

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).resolve().parents[2] / "README.md"


def test_the_example_client_gets_its_path(planners):
    block = re.search(r"<!-- example client -->\n```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
    process = planners.start(map_file="maze", seed=1)
    process.wait_until_ready()
    namespace = process.name.removesuffix("/planner")
    done = subprocess.run([sys.executable, "-c", block[1], "--ros-args", "-r", f"__ns:={namespace}"],
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"Path of \d\d\.\d\d m.* [1-9]\d\d poses\n", done.stdout), done.stdout + process.output
