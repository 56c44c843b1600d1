"""The types of the package, as pyproject.toml has mypy check them: strictly in the library."""

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mypy") is None, reason="mypy is not installed")
def test_all_types_are_right(tmp_path):
    done = subprocess.run([sys.executable, "-m", "mypy", "--cache-dir", str(tmp_path)], cwd=ROOT, capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


def test_what_is_excepted_from_the_types_is_little_and_says_why():
    lines = [line for file in ROOT.glob("dubins_rrt_ros/**/*.py") for line in file.read_text("utf-8").splitlines()]
    excepted = [line for line in lines if "type: ignore" in line]
    assert [line for line in excepted if not re.search(r"# type: ignore\[[a-z-]+\]  # \w+", line)] == []
    assert len(excepted) <= 20
