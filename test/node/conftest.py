"""Fixtures: messages that went through the wire format, plans, and the node as a process of its own."""

import os

import pytest
from support.domains import claim_domain

# Before rclpy is imported: a field of the wrong type is an error, and nobody else hears us.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(claim_domain())

#: Fast DDS announces a participant five times at 0.1 s; who is not there yet waits for seconds.
EAGER_DISCOVERY = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="eager" is_default_profile="true">
    <rtps><builtin><discovery_config><initialAnnouncements>
      <count>100</count><period><sec>0</sec><nanosec>50000000</nanosec></period>
    </initialAnnouncements></discovery_config></builtin></rtps>
  </participant>
</profiles>
"""


@pytest.fixture(scope="session", autouse=True)
def _ros_environment(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ros")
    profile = folder / "eager_discovery.xml"
    profile.write_text(EAGER_DISCOVERY)
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(profile)
    os.environ["ROS_LOG_DIR"] = str(folder / "log")


@pytest.fixture(scope="session")
def over_the_wire():
    """A function that gives back a message as a receiver has it."""
    serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")

    def transfer(message):
        return serialization.deserialize_message(serialization.serialize_message(message), type(message))

    return transfer


@pytest.fixture(scope="session")
def plans():
    """Real plans by name: `solved`, `blocked` (the goal is occupied)."""
    import numpy as np

    from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, plan

    cells = np.zeros((100, 100), dtype=np.int8)
    cells[40:60, 40:60] = 100
    grid = GridMap(cells, 0.1)
    settings = Settings(samples=300, planning_time=20.0, seed=1, preferred_clearance=0.0)
    start = (1.5, 5.0, 0.0)
    return {name: plan(Problem(grid, Vehicle(), start, goal), settings)
            for name, goal in {"solved": (8.5, 5.0, 0.5), "blocked": (5.0, 5.0, 0.0)}.items()}


@pytest.fixture
def map_yaml(tmp_path):
    """A map_server pair: 10 m x 10 m, free but for a box of 2 m in its middle."""
    rows = [[0 if 40 <= row < 60 and 40 <= column < 60 else 254 for column in range(100)] for row in range(100)]
    lines = "\n".join(" ".join(map(str, row)) for row in rows)
    (tmp_path / "box.pgm").write_text(f"P2\n100 100\n255\n{lines}\n")
    path = tmp_path / "box.yaml"
    path.write_text("image: box.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
                    "occupied_thresh: 0.65\nfree_thresh: 0.25\n")
    return path


@pytest.fixture(scope="module")
def map_file(tmp_path_factory):
    """The yard's map as a file."""
    from support.yard import yard

    from dubins_rrt_ros.planning import GridMap, save_map

    file = tmp_path_factory.mktemp("maps") / "yard.yaml"
    save_map(GridMap(yard(), 0.1), file)
    return str(file)


@pytest.fixture
def planners():
    """Planner processes and their clients."""
    yield from _planners()


@pytest.fixture(scope="module")
def module_planners():
    """The same for all tests of a module: what they start lives until the last of them."""
    yield from _planners()


@pytest.fixture
def installed_planners():
    """The same by the installed command, where start, end and signals of the interpreter count too."""
    yield from _planners(installed=True)


@pytest.fixture
def lean_planners(installed_planners, monkeypatch):
    """The same where the C library gives memory back as soon as it is free.

    Else what a node holds at rest depends on the holes between what was freed, which are tens of MB and grow for minutes.
    """
    for name, value in {"ARENA_MAX": "1", "MMAP_THRESHOLD_": "65536", "TRIM_THRESHOLD_": "65536"}.items():
        monkeypatch.setenv(f"MALLOC_{name}", value)  # a fork would keep the allocator of its parent
    return installed_planners


def _planners(installed: bool = False):
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from support.harness import Planners
    planners = Planners(installed)
    yield planners
    planners.close()
