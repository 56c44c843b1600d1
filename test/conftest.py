"""What holds for all tests: which kernels they run on, and hypothesis' profiles."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

import dubins_rrt_ros
from dubins_rrt_ros.planning import kernels_compiled

KERNELS = "compiled" if kernels_compiled else "interpreted"

settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")


def pytest_addoption(parser):
    parser.addoption("--kernels", choices=["any", "compiled", "interpreted"], default="any",
                     help="end at once where the kernels in use are others")


def pytest_configure(config):
    wanted = config.getoption("--kernels")
    if wanted not in ("any", KERNELS):
        remedy = ("build them with `python setup.py build_ext --inplace`" if wanted == "compiled"
                  else "remove the extension modules from planning/_kernels")
        pytest.exit(f"--kernels asks for {wanted} kernels, but the {KERNELS} ones are in use; {remedy}.", returncode=1)


def pytest_report_header():
    return [f"kernels: {KERNELS}", f"package: {Path(dubins_rrt_ros.__file__).parent}"]
