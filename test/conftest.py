"""What holds for all tests: which package and which kernels they run on, and hypothesis' profiles."""

import os
import signal
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

SOURCE = Path(__file__).resolve().parent.parent

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
    if _is_sourced():
        # `colcon test` runs `python -m pytest`, which would find the source tree first.
        sys.path[:] = [entry for entry in sys.path if Path(entry).resolve() != SOURCE]
    if _package().parent != SOURCE:
        # The Pythons that tests start in the source tree find what is tested, too.
        os.environ["PYTHONSAFEPATH"] = "1"
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        # As in the background of a shell: what the tests start would inherit it, and not end by Ctrl-C.
        signal.signal(signal.SIGINT, signal.default_int_handler)
    wanted = config.getoption("--kernels")
    if wanted not in ("any", _kernels()):
        remedy = ("build them with `python setup.py build_ext --inplace`" if wanted == "compiled"
                  else "remove the extension modules from planning/_kernels")
        pytest.exit(f"--kernels asks for {wanted} kernels, but the {_kernels()} ones are in use; {remedy}.", returncode=1)


@pytest.hookimpl(optionalhook=True)  # without pytest-xdist the suite still runs
def pytest_xdist_auto_num_workers():
    """How many processes `-n auto` means: more than cores, as many tests wait for a node."""
    return len(os.sched_getaffinity(0)) * 3 // 2 or 1


def pytest_collection_modifyitems(items):
    """Begin with those that last a minute, so that no process goes on with one when the others are done."""
    items.sort(key=lambda item: item.get_closest_marker("minute") is None)


def pytest_report_header():
    return [f"kernels: {_kernels()}", f"package: {_package()}"]


def _is_sourced() -> bool:
    """Whether the package is in a colcon workspace, or in a ROS installation, that is sourced."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return any(Path(prefix, "share/dubins_rrt_ros").is_dir() for prefix in prefixes)


def _package() -> Path:
    """The folder of the package that is tested."""
    import dubins_rrt_ros  # here, for it takes the path of modules as pytest_configure() leaves it

    return Path(dubins_rrt_ros.__file__).resolve().parent


def _kernels() -> str:
    from dubins_rrt_ros.planning import kernels_compiled

    return "compiled" if kernels_compiled else "interpreted"
