"""What an installation has to hold, whoever made it: pip or colcon. Skipped in a source tree that is not installed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import dubins_rrt_ros

PREFIXES = [Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p] + [Path(sys.prefix)]
INDEX = "share/ament_index/resource_index/packages/dubins_rrt_ros"


@pytest.fixture
def prefix() -> Path:
    """The prefix that the package is installed to."""
    found = [prefix for prefix in PREFIXES if (prefix / INDEX).exists()]
    if not found:
        pytest.skip(f"not installed: {Path(dubins_rrt_ros.__file__).parent}")
    return found[0]


def test_ros2_run_finds_all_executables(prefix):
    """`ros2 run` takes what is executable in lib/PACKAGE of the package's prefix."""
    for name in ("planner", "dubins_rrt_planner", "dubins_rrt"):
        assert os.access(prefix / "lib" / "dubins_rrt_ros" / name, os.X_OK), name


def test_the_share_folder_holds_package_xml_and_every_map(prefix):
    share = prefix / "share" / "dubins_rrt_ros"
    assert "<name>dubins_rrt_ros</name>" in (share / "package.xml").read_text()
    names = {path.name for path in (share / "maps").iterdir()}
    assert names >= {f"{name}.{ending}" for name in ("block", "maze", "forest") for ending in ("geojson", "yaml", "pgm")}


def test_the_installed_command_plans_on_an_installed_map(prefix, tmp_path):
    command = [prefix / "lib" / "dubins_rrt_ros" / "dubins_rrt", "plan", "maze", "--seed", "1",
               "--start", "1.5", "2", "1.57", "--goal", "13.5", "10.5", "1.57"]
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, env={**os.environ, "PATH": path})
    assert done.returncode == 0, done.stderr
    assert "Path of" in done.stdout


@pytest.mark.skipif(not (Path(sys.prefix) / INDEX).exists(), reason="not installed by pip")
def test_the_launchers_in_lib_find_their_own_interpreter(tmp_path):
    """So that `ros2 run` and the demonstration find it whose prefix is in AMENT_PREFIX_PATH, without its bin on the PATH."""
    environment = {"PATH": os.defpath, "HOME": str(tmp_path), "AMENT_PREFIX_PATH": sys.prefix}
    (tmp_path / "dubins_rrt").symlink_to(Path(sys.prefix) / "lib" / "dubins_rrt_ros" / "dubins_rrt")
    for command in (tmp_path / "dubins_rrt", Path(sys.prefix) / "lib" / "dubins_rrt_ros" / "planner"):
        done = subprocess.run([command, "--help"], cwd=tmp_path, capture_output=True, text=True, timeout=120, env=environment)
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith("usage: ")


def test_the_version_is_that_of_package_xml(prefix):
    assert f"<version>{dubins_rrt_ros.__version__}</version>" in (prefix / "share/dubins_rrt_ros/package.xml").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(("beside", "remedy"), [("setup.py", "start Python in another folder"),
                                                ("other.py", "install a C compiler")])
def test_interpreted_kernels_say_what_to_do(beside, remedy, tmp_path):
    """A source folder in which Python is started hides the package that is installed."""
    shutil.copytree(Path(dubins_rrt_ros.__file__).parent, tmp_path / "dubins_rrt_ros",
                    ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    (tmp_path / beside).touch()
    done = subprocess.run([sys.executable, "-c", "import dubins_rrt_ros.planning"], cwd=tmp_path, capture_output=True, text=True,
                          timeout=120, env={**os.environ, "PYTHONPATH": str(tmp_path)})
    assert done.returncode == 0 and remedy in done.stderr
