"""What holds for all tests: which kernels they run on, and hypothesis' profiles."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import dubins_rrt_ros
from dubins_rrt_ros.planning import kernels_compiled

KERNELS = "compiled" if kernels_compiled else "interpreted"

settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")


def pytest_addoption(parser):
    parser.addoption("--kernels", choices=["any", "compiled", "interpreted"], default="any",
                     help="end at once where the kernels in use are others")
    parser.addoption("--fuzz", type=int, default=50, metavar="N", help="how many spoiled inputs each reader gets in test/fuzz")
    parser.addoption("--soak", type=float, default=60.0, metavar="SECONDS", help="how long test/node/test_soak.py asks at random")
    parser.addoption("--soak-seed", type=int, metavar="N", help="what it asks is drawn with this seed, not with a fresh one")


def pytest_configure(config):
    settings.register_profile("fuzz", max_examples=config.getoption("--fuzz"), suppress_health_check=list(HealthCheck))
    wanted = config.getoption("--kernels")
    if wanted not in ("any", KERNELS):
        remedy = ("build them with `python setup.py build_ext --inplace`" if wanted == "compiled"
                  else "remove the extension modules from planning/_kernels")
        pytest.exit(f"--kernels asks for {wanted} kernels, but the {KERNELS} ones are in use; {remedy}.", returncode=1)


def pytest_report_header():
    return [f"kernels: {KERNELS}", f"package: {Path(dubins_rrt_ros.__file__).parent}"]
