"""What the node says while it waits for a map or a start, through the executable."""

import array
import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import LoadMap
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String
from support.harness import occupancy, values_of
from support.yard import GOAL, QUICK, START

from dubins_rrt_ros.planning import GridMap, save_map

FREE = np.zeros((100, 100), dtype=np.int8)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
VOLATILE = QoSProfile(depth=1, durability=DurabilityPolicy.VOLATILE)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: Publishers of `map` that nothing comes from: their type and quality, the parameter of the planner, and what is said of them.
MISFITS = {
    "volatile": (OccupancyGrid, VOLATILE, True, ["volatile", "set map_transient_local to false"]),
    "best effort": (OccupancyGrid, BEST_EFFORT, True, ["best-effort", "reliably"]),
    "transient local where volatile is asked for": (OccupancyGrid, LATCHED, False,
                                                    ["transient local", "set map_transient_local to true"]),
    "of another type": (String, LATCHED, True, ["std_msgs/msg/String", "nav_msgs/msg/OccupancyGrid"]),
}


@pytest.fixture(scope="module")
def waiting(module_planners, tmp_path_factory):
    """Planners that wait, and their clients, all at the same time as some of it takes 5 s.

    By name: those of MISFITS with the publisher that does not fit; `no map` and `no start`, which lack nothing else; and
    `unheard start`, with a start's publisher that does not fit.
    """
    found = {}
    for name, (kind, qos, transient_local, _) in MISFITS.items():
        process = module_planners.start(map_transient_local=transient_local)
        client = module_planners.client()
        client.node.create_publisher(kind, "map", qos)
        found[name] = process, client
    file = tmp_path_factory.mktemp("maps") / "free.yaml"
    save_map(GridMap(FREE, 0.1), file)
    for name, parameters in {"no map": {}, "no start": {"map_file": str(file)}}.items():
        found[name] = module_planners.start(**parameters, **QUICK), module_planners.client()
    found["unheard start"] = module_planners.start(map_file=str(file)), module_planners.client()
    found["unheard start"][1].node.create_publisher(PoseStamped, "start_pose", BEST_EFFORT)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", MISFITS)
def test_a_publisher_that_does_not_fit_is_named_with_the_remedy_in_log_and_status(waiting, name):
    process, client = waiting[name]
    words = [f"{client.node.get_fully_qualified_name()} ", f"{process.name.removesuffix('planner')}map", *MISFITS[name][3]]

    def told():
        return [status for status in client.statuses if all(word in status.message for word in words)]

    status = client.wait_for(told, f"a status with {words}")[0]
    assert status.level == DiagnosticStatus.STALE
    assert values_of(status)["error_name"] == "NO_MAP"
    client.wait_for_word(status.message)


@pytest.mark.slow
def test_without_a_map_log_and_status_say_what_would_bring_one(waiting):
    process, client = waiting["no map"]
    told = client.status_of(0, error_name="NO_MAP")
    assert told["level"] == DiagnosticStatus.STALE
    for word in (f"{process.name.removesuffix('planner')}map", "map_file", "load_map"):
        assert word in told["message"]
    client.wait_for_word(told["message"])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "words"), [("no map", "There is no map yet"), ("no start", "Waiting for a start")])
def test_what_is_waited_for_is_logged_again_and_again(waiting, name, words):
    process, client = waiting[name]
    client.wait_for(lambda: process.output.count(words) >= 2, f"{words!r} twice in the log")


@pytest.mark.slow
def test_a_map_that_is_refused_is_told_with_what_is_waited_for(waiting):
    _, client = waiting["no map"]
    broken = occupancy(FREE)
    broken.data = array.array("b", [0] * 7)
    client.publish_map(broken)
    told = client.wait_for(lambda: [s for s in client.statuses if "7 values for 100 x 100 cells" in s.message], "the refusal")[0]
    assert (told.level, values_of(told)["error_name"]) == (DiagnosticStatus.STALE, "NO_MAP")
    client.wait_for_word(told.message)


@pytest.mark.slow
def test_the_topics_of_a_start_are_named_in_the_log(waiting):
    process, _ = waiting["no start"]
    namespace = process.name.removesuffix("/planner")
    assert f"{namespace}/start_pose or {namespace}/initialpose" in process.output
    assert "no map" not in process.output


@pytest.mark.slow
def test_a_publisher_of_starts_that_does_not_fit_is_named_with_the_remedy(waiting):
    process, client = waiting["unheard start"]
    client.wait_for_word(f"{client.node.get_fully_qualified_name()} offers it with best-effort reliability")
    assert "publish it reliably" in process.output


@pytest.mark.slow
def test_a_refused_start_is_told_with_what_is_waited_for_and_a_good_one_ends_the_wait(waiting):
    _, client = waiting["no start"]
    client.send("start_pose", (math.nan, 5.0, 0.0))
    assert "finite" in client.status_of(0, error_name="INVALID_POSE")["message"]
    client.send("goal_pose", GOAL)
    told = client.status_of(1, error_name="NO_START")
    assert "start_pose" in told["message"] and "finite" in told["message"]
    client.statuses.clear()
    client.send("start_pose", (math.inf, 5.0, 0.0))
    client.status_of(0, error_name="INVALID_POSE")
    client.send("start_pose", START)  # the goal stands
    assert client.status_of(1, samples="300")["error_name"] == "NONE"
    client.statuses.clear()
    client.send("goal_pose", GOAL)
    assert client.status_of(2, samples="300")["error_name"] == "NONE"


def test_unknown_space_that_counts_as_free_is_told_in_log_and_status(planners, tmp_path):
    grey = np.full((120, 120), 205, np.uint8)
    grey[10:110, 10:110] = 254
    (tmp_path / "slam.pgm").write_bytes(b"P5\n120 120\n255\n" + grey.tobytes())
    (tmp_path / "slam.yaml").write_text("image: slam.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\n"
                                        "free_thresh: 0.25\n")
    process = planners.start(map_file=str(tmp_path / "slam.yaml"), **QUICK)
    client = planners.client()
    warning = "30.56% of the cells have the grey 205, as unknown space has it, and are free by free_thresh"
    told = client.status_of(0, error_name="NO_START")
    assert told["level"] == DiagnosticStatus.WARN and warning in told["message"]
    client.wait_for_word(warning)
    client.wait_for_word("slam.yaml, 100.0% free, 0.0% occupied, 0.0% unknown")
    assert process.output.count("[WARN]") == 1
    client.call(LoadMap, "load_map", map_url="maze.yaml")
    client.call(LoadMap, "load_map", map_url=str(tmp_path / "slam.yaml"))
    event = client.wait_for(lambda: [s for s in client.statuses if values_of(s)["error_name"] == "NONE"], "the warning")[0]
    assert event.level == DiagnosticStatus.WARN and warning in event.message

    process = planners.start(map_file=str(tmp_path / "slam.yaml"), unknown_grey=205)
    planners.client().wait_for_word("slam.yaml, 69.4% free, 0.0% occupied, 30.6% unknown")
    assert "[WARN]" not in process.output


@pytest.mark.slow
def test_with_a_map_file_the_status_is_that_a_start_is_waited_for(planners, map_file):
    planners.start(map_file=map_file, **QUICK)
    client = planners.client()
    client.listen_to_diagnostics()
    told = client.status_of(0, error_name="NO_START")
    assert (told["level"], told["message"][:20]) == (DiagnosticStatus.WARN, "Waiting for a start:")
    assert "start_pose" in told["message"] and told["map_id"]
    client.wait_for(lambda: client.diagnostics and client.diagnostics[0].message == told["message"], "a diagnostic that says so")
    client.send("start_pose", START)
    assert client.status_of(0, error_name="NONE")["message"] == "Ready for a goal."


@pytest.fixture
def nothing_known(planners):
    """A client of a planner without map and start."""
    planners.start(**QUICK)
    return planners.client()


@pytest.mark.slow
def test_once_a_map_came_the_status_is_no_longer_that_there_is_none(nothing_known):
    client = nothing_known
    client.listen_to_diagnostics()
    client.status_of(0, error_name="NO_MAP")
    client.publish_map(occupancy(FREE))
    client.wait_for_word("The map is ready")
    told = client.status_of(0, error_name="NO_START")
    assert told["level"] == DiagnosticStatus.WARN
    assert told["map_id"]
    client.wait_for(lambda: client.diagnostics and values_of(client.diagnostics[-1])["error_name"] == "NO_START",
                    "a diagnostic that says so too")


def test_a_goal_that_came_before_the_map_is_told_what_it_waits_for_and_planned_when_that_comes(nothing_known):
    client = nothing_known
    client.listen_to_diagnostics()
    client.status_of(0, error_name="NO_MAP")
    client.send("start_pose", START)
    client.send("goal_pose", GOAL)  # sent later, so that the start has come in, too, when it is answered
    client.wait_for(lambda: client.statuses[-1].message.startswith("Waiting for a map: "), "what it waits for")
    told = [(status.level, values_of(status)["error_name"]) for status in client.statuses if values_of(status)["plan_id"] == "1"]
    assert told == [(DiagnosticStatus.STALE, "NO_MAP"), (DiagnosticStatus.WARN, "NO_MAP")]
    client.publish_map(occupancy(FREE))
    assert client.status_of(1, samples="300")["error_name"] == "NONE"
    client.wait_for(lambda: client.diagnostics and values_of(client.diagnostics[-1])["error_name"] == "NONE",
                    "a diagnostic that says so too")
