"""Paths over waypoints: they pass them, and are as short as dynamic programming over many headings finds."""

import math
import re
from dataclasses import replace
from itertools import pairwise
from threading import Event

import numpy as np
import pytest
from support.cases import needs_compiled, scaled
from support.yard import GOAL, IN_THE_BOX, IN_THE_CHAMBER, START, yard

from dubins_rrt_ros.planning import (
    GridMap,
    InvalidPose,
    Problem,
    Settings,
    Status,
    Vehicle,
    load_map,
    plan,
    plan_through,
    prepare,
    waypoint_headings,
    waypoints,
)
from dubins_rrt_ros.planning.audit import audit_path
from dubins_rrt_ros.planning.audit.verdict import passing_findings
from dubins_rrt_ros.planning.curves import dubins
from dubins_rrt_ros.planning.deadline import OutOfTime
from dubins_rrt_ros.planning.maps.locate import maps_directory
from dubins_rrt_ros.planning.stops import least_length, legs_along, stops_of

DISC = Vehicle(turning_radius=1.0, robot_radius=0.2)
CAR = Vehicle.from_footprint([(0.5, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.5, -0.2)], turning_radius=0.8)
SETTINGS = Settings(samples=scaled(200, least=20), planning_time=300.0, seed=1, preferred_clearance=0.0)
#: Of searches that end with their first path.
FIRST = replace(SETTINGS, planner="rrt")
#: Free places of the yard, around its box.
BELOW, ABOVE = (5.0, 3.0), (5.0, 7.0)
WITH_HEADINGS = [(*BELOW, 0.5), (*ABOVE, 0.5)]


@pytest.fixture(scope="module", autouse=True)
def _first_headings():
    """Fewer drafts of a leg between obstacles, each of them with interpreted kernels a second."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(waypoint_headings, "FIRST_HEADINGS", scaled(waypoint_headings.FIRST_HEADINGS, least=3))
        yield


@pytest.fixture(scope="module")
def world():
    return prepare(GridMap(yard(), 0.1), DISC)


@pytest.fixture(scope="module")
def over_both(world):
    """The answer over the places below and above, with any heading; and the first path that was reported."""
    reports = []
    answer = plan_through(Problem(world, start=START, goal=GOAL), [BELOW, ABOVE], SETTINGS, on_progress=reports.append)
    answer.check()
    return answer, reports


@pytest.fixture(scope="module")
def known(world):
    """The first path over these places with headings that are given."""
    return plan_through(Problem(world, start=START, goal=GOAL), WITH_HEADINGS, FIRST).path


@pytest.fixture(scope="module")
def plane():
    return prepare(GridMap(np.zeros((100, 100), np.int8), 1.0), DISC)


def through(world, *poses, start=START, goal=GOAL, settings=SETTINGS, **options):
    answer = plan_through(Problem(world, start=start, goal=goal, **options), poses, settings)
    answer.check()
    return answer


def assert_passed(answer, *poses):
    """All waypoints are where the answer says, in their order, and the audit says so too."""
    assert answer.solved, answer
    found = answer.poses()
    assert list(answer.waypoint_indices) == sorted(answer.waypoint_indices)
    for index, (x, y, *heading) in zip(answer.waypoint_indices, poses, strict=True):
        np.testing.assert_allclose(found[index, :2], (x, y), atol=1e-9)
        if heading and heading[0] is not None:
            assert abs(math.remainder(found[index, 2] - heading[0], math.tau)) < 1e-9
    assert (np.hypot(*np.diff(found[:, :2], axis=0).T) > 0).all(), "a pose is there twice"
    assert audit_path(answer.path, answer.problem) == answer.audit


def by_dynamic_programming(places, start, goal, headings=72):
    """The length of the shortest chain of Dubins curves over the places, with so many headings at each."""
    grid = np.arange(headings) * math.tau / headings
    stops = [np.array([start]), *(np.column_stack([np.tile(place, (headings, 1)), grid]) for place in places), np.array([goal])]
    cost = np.zeros(1)
    for here, there in pairwise(stops):
        cost = (cost[:, None] + dubins.lengths(here[:, None], there[None], DISC.turning_radius)).min(axis=0)
    return cost[0]


def leg_by_leg(places, start, goal, headings=72):
    """The same with the heading at each place that is best for the leg that leads there."""
    grid, length = np.arange(headings) * math.tau / headings, 0.0
    for place in places:
        ends = np.column_stack([np.tile(place, (headings, 1)), grid])
        lengths = dubins.lengths(np.array([start]), ends, DISC.turning_radius)
        length, start = length + lengths.min(), tuple(ends[np.argmin(lengths)])
    return length + dubins.shortest(start, goal, DISC.turning_radius).length


def test_in_the_open_plane_the_whole_is_shortest(plane):
    rng = np.random.default_rng(4)
    shorter = differs = 0
    for _ in range(scaled(15, least=1)):
        places = 40 + rng.uniform(0, rng.choice([3.0, 6.0, 15.0]), (4, 2))
        start, goal = (*places[0], rng.uniform(-3, 3)), (*places[3], rng.uniform(-3, 3))
        answer = through(plane, *places[1:3], start=start, goal=goal)
        assert_passed(answer, *places[1:3])
        assert answer.length <= by_dynamic_programming(places[1:3], start, goal) * 1.0001
        greedy = leg_by_leg(places[1:3], start, goal)
        differs += greedy > answer.length * 1.0001
        shorter += answer.length < greedy
        assert answer.lower_bound <= answer.length
    assert shorter >= 0.9 * differs


@pytest.mark.slow
@needs_compiled
def test_where_waypoints_have_headings_the_bound_is_the_sum_of_what_is_proved_of_the_legs():
    """With a free heading a leg's proof, which is of one heading, does not count."""
    maze = Problem(prepare(load_map(maps_directory() / "maze.yaml"), Vehicle()), start=(1.5, 2.0, 1.57), goal=(13.5, 10.5, 1.57))
    settings = Settings(samples=100, planning_time=120.0, seed=1, stop_gap=0.05, preferred_clearance=0.0)
    poses = plan(maze, replace(settings, samples=1, stop_gap=0.0)).path.poses(0.1)
    place = tuple(poses[len(poses) // 2].tolist())
    answer = plan_through(maze, [place], settings)
    assert least_length(maze, [place], {}) * 1.1 < answer.lower_bound <= answer.length <= 1.06 * answer.lower_bound
    free = [place[:2]]
    assert plan_through(maze, free, settings).lower_bound == least_length(maze, [(*place[:2], None)], {})


@pytest.mark.slow
@needs_compiled
def test_between_obstacles_the_whole_is_as_short_as_the_best_of_many_planned_legs(world, over_both):
    headings = np.arange(8) * math.tau / 8
    stops = [[START], [(*BELOW, heading) for heading in headings], [(*ABOVE, heading) for heading in headings], [GOAL]]
    quick = Settings(planner="rrt", planning_time=0.1, seed=1)
    cost = np.zeros(1)
    for here, there in pairwise(stops):
        legs = [[plan(Problem(world, start=start, goal=goal), quick).length or math.inf for goal in there] for start in here]
        cost = (cost[:, None] + np.array(legs)).min(axis=0)
    answer, _ = over_both
    assert_passed(answer, BELOW, ABOVE)
    assert answer.length <= cost[0] * 1.005


@pytest.mark.slow
@needs_compiled
def test_headings_that_have_to_change_together_do():
    maze = prepare(load_map("maze"), Vehicle(turning_radius=1.0, robot_radius=0.3))
    start, goal = (3.900343227164678, 3.5617428353108926, 1.9743385564396059), (9.511084429039158, 11.65597502517, 1.1502302018)
    places = [(1.3379307262399633, 7.2112163641844145), (9.877238524621449, 6.753414519643179)]
    answer = plan_through(Problem(maze, start=start, goal=goal), places, SETTINGS)
    assert answer.length <= 25.721 * 1.005  # of legs that are planned between 36 headings


@pytest.mark.parametrize("vehicle", [DISC, pytest.param(CAR, marks=needs_compiled)], ids=["disc", "car"])
def test_headings_that_are_given_are_kept(vehicle):
    yard_of = prepare(GridMap(yard(), 0.1), vehicle)
    answer = through(yard_of, (*BELOW, 0.3), (*ABOVE, None), (*ABOVE, 2.0))
    assert_passed(answer, (*BELOW, 0.3), ABOVE, (*ABOVE, 2.0))
    assert answer.waypoint_indices[1] == answer.waypoint_indices[2]


def test_waypoints_equal_to_each_other_to_the_start_or_to_the_goal_are_passed(world):
    answer = through(world, START, START[:2], BELOW, BELOW, GOAL)
    assert_passed(answer, START, START[:2], BELOW, BELOW, GOAL)
    first, second, third, fourth, last = answer.waypoint_indices
    assert (first, second, third, last) == (0, 0, fourth, len(answer.poses()) - 1)
    assert through(world, START[:2], GOAL).path == plan(Problem(world, start=START, goal=GOAL), SETTINGS).path


def test_without_waypoints_it_is_planned_as_ever(world):
    assert through(world).path == plan(Problem(world, start=START, goal=GOAL), SETTINGS).path


def test_a_waypoint_with_another_heading_at_the_start_is_driven_to(plane):
    start = (50.0, 50.0, 0.0)
    answer = through(plane, (50.0, 50.0, 1.0), start=start, goal=(60.0, 50.0, 0.0))
    assert_passed(answer, (50.0, 50.0, 1.0))
    assert answer.waypoint_indices[0] > 0


def test_the_goal_may_have_any_heading(plane):
    start, goal = (50.0, 50.0, 0.0), (50.0, 56.0, 0.0)
    free = through(plane, (55.0, 53.0), start=start, goal=goal, any_goal_heading=True)
    assert_passed(free, (55.0, 53.0))
    assert free.length < through(plane, (55.0, 53.0), start=start, goal=goal).length - 0.5


@pytest.mark.parametrize(("place", "status", "words"), [
    (IN_THE_BOX[:2], Status.GOAL_OCCUPIED, "Waypoint 2 is occupied: clearance 0.00 m"),
    (IN_THE_CHAMBER[:2], Status.NO_VALID_PATH, r"On the way to waypoint 2 at \(9.000, 9.000\): No path exists"),
    ((20.0, 5.0), Status.GOAL_OUTSIDE_MAP, r"Waypoint 2 \(20, 5\) is 10.00 m outside the map"),
])
def test_a_leg_that_fails_names_its_waypoint(world, place, status, words):
    answer = through(world, BELOW, place, ABOVE)
    assert (answer.status, answer.path, answer.waypoint_indices) == (status, None, ())
    assert re.match(words, answer.message), answer.message
    assert answer.waypoints == ((*BELOW, None), (*place, None), (*ABOVE, None))


@pytest.mark.parametrize("first", [(3.0, 3.0), (3.0, 3.0, 0.0)], ids=["any heading", "a heading"])
def test_a_start_that_no_arc_leaves_is_a_proof_whatever_headings_follow(first):
    cells = np.zeros((40, 40), np.int8)
    cells[:, 22] = 100
    before_a_wall = Problem(GridMap(cells, 0.5), Vehicle(1.0, 0.3), (10.2, 10.0, 0.0), (3.0, 8.0, 0.0))
    answer = plan_through(before_a_wall, [first, (6.0, 6.0)], SETTINGS)
    assert answer.status == Status.NO_VALID_PATH
    assert "On the way to waypoint 1 at (3.000, 3.000): No path exists: every forward arc from the start" in answer.message


@pytest.mark.parametrize(("heading", "words"), [((0.0,), "than a goal alone; "), ((), ", those without a heading most; ")])
def test_without_time_it_is_told_what_takes_most_of_it(heading, words, monkeypatch):
    """By a clock that goes on by a millisecond with each look at it, so that no leg has a path before the time is up."""
    now = iter(np.arange(1e6) / 1000)
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: next(now))
    maze = Problem(load_map("maze"), DISC, (1.5, 2.0, math.pi / 2), (13.5, 2.0, -math.pi / 2))
    answer = plan_through(maze, [(7.5, 10.5, *heading)], replace(SETTINGS, planning_time=1e-3))
    assert answer.status == Status.TIMEOUT and words in answer.message


@pytest.mark.parametrize("heading", [(math.pi,), ()], ids=["a heading", "any heading"])
def test_a_leg_without_a_path_tells_why_where_that_holds_of_all_headings(heading):
    cells = np.full((60, 200), 100, np.int8)
    cells[18:42] = 0
    corridor = Problem(GridMap(cells, 0.1), Vehicle(1.5, 0.3), (10.0, 3.0, 0.0), (2.0, 3.0, math.pi))
    answer = plan_through(corridor, [(5.0, 3.0, *heading)], replace(SETTINGS, samples=200, informed=False))  # ended by samples
    assert answer.status == Status.TIMEOUT
    assert "On the way to waypoint 1 at (5.000, 3.000): No path found within 100 samples, the leg's share; " in answer.message
    assert "turn the start or the goal" in answer.message and answer.message.endswith("or allow more samples.")


@pytest.mark.parametrize("options", [{"goal_tolerance_xy": 0.5}, {"goal_tolerance_xy": 0.5, "any_goal_heading": True}])
def test_a_goal_that_is_not_free_is_reached_within_its_tolerance(world, options):
    answer = through(world, (3.0, 3.0), goal=(5.0, 3.85, 0.0), **options)
    assert_passed(answer, (3.0, 3.0))
    assert "it ends 0." in answer.message


def test_a_start_that_is_occupied_is_named(world):
    answer = through(world, BELOW, ABOVE, start=IN_THE_BOX)
    assert answer.status == Status.START_OCCUPIED
    assert answer.message.startswith("Start is occupied")


@pytest.mark.parametrize("pose", [(1.0,), (1.0, math.nan), (1.0, 2.0, 3.0, 4.0), None, "ab", (1.0, None)])
def test_what_is_no_waypoint_is_refused(world, pose):
    with pytest.raises(InvalidPose, match="waypoint 2"):
        through(world, BELOW, pose)


@needs_compiled
def test_the_same_seed_gives_the_same_path(world, over_both):
    assert through(world, BELOW, ABOVE).path == over_both[0].path


@pytest.mark.parametrize(("cancel", "status", "said"), [
    (None, Status.TIMEOUT, "No path within planning_time 0.001 s, and waypoints take"),
    (lambda: True, Status.CANCELLED, "Cancelled")])
def test_more_waypoints_than_there_is_time_for_keep_the_deadline(plane, cancel, status, said):
    """Their legs are not even made, which alone would take seconds and a tenth of a MB each."""
    places = [(1 + n % 97, 1 + n % 89) for n in range(5000)]
    limit = Settings(planning_time=0.001 if cancel is None else 300.0, seed=1)
    answer = plan_through(Problem(plane, start=(2, 2, 0), goal=(3, 3, 0)), places, limit, cancel=cancel)
    assert answer.status == status and answer.message.startswith(said)


@needs_compiled
@pytest.mark.parametrize("place", [BELOW, (*BELOW, 0.5), GOAL, START])
def test_of_many_waypoints_at_one_place_each_is_followed_by_a_look_at_the_time(world, place):
    looks = []
    answer = plan_through(Problem(world, start=START, goal=GOAL), [place] * 2000, FIRST, cancel=lambda: looks.append(place))
    assert answer.path and len(set(answer.waypoint_indices)) == 1
    assert len(looks) > 2000


@needs_compiled
def test_a_request_that_is_cancelled_after_its_first_path_says_so(world):
    cancelled = Event()
    answer = plan_through(Problem(world, start=START, goal=GOAL), WITH_HEADINGS, SETTINGS, cancel=cancelled.is_set,
                          on_progress=lambda progress: cancelled.set())
    answer.check()
    assert answer.cancelled and "over 2 waypoints, cancelled " in answer.message


def test_a_cancelled_request_has_no_path(world):
    answer = plan_through(Problem(world, start=START, goal=GOAL), [BELOW, ABOVE], SETTINGS, cancel=lambda: True)
    answer.check()
    assert answer.status == Status.CANCELLED or answer.cancelled


@needs_compiled
def test_the_first_path_is_reported(over_both):
    answer, reports = over_both
    first = reports[0].snapshot()
    assert reports[0].improved
    assert first.audit.ok
    assert first.length >= answer.length - 1e-6


@pytest.mark.parametrize(("in_time", "status"), [(0, Status.TIMEOUT), (1, Status.NONE)])
def test_a_path_that_there_is_no_time_to_audit_is_no_answer_and_the_one_before_is(world, in_time, status, monkeypatch):
    audited = []

    def audit(path, *given):
        if len(audited) == in_time:
            raise OutOfTime
        audited.append(path)
        return audit_path(path, *given)
    monkeypatch.setattr(waypoints, "audit_path", audit)
    answer = through(world, *WITH_HEADINGS)
    assert (answer.status, answer.path) == (status, audited[0] if audited else None)
    assert status == Status.NONE or "no time left to audit it" in answer.message


def test_a_request_that_is_cancelled_during_its_first_audit_is_cancelled(world, monkeypatch):
    cancelled = Event()

    def audit(path, problem, obstacles, check_time):
        cancelled.set()
        while True:
            check_time()
    monkeypatch.setattr(waypoints, "audit_path", audit)
    answer = plan_through(Problem(world, start=START, goal=GOAL), WITH_HEADINGS, SETTINGS, cancel=cancelled.is_set)
    answer.check()
    assert answer.status == Status.CANCELLED and answer.path is None
    assert re.match(r"Cancelled before a first path: one of \d+\.\d\d m was found, but not audited yet\.", answer.message)


@needs_compiled
def test_the_audit_finds_a_waypoint_that_is_not_passed(over_both):
    path = over_both[0].path
    assert not list(passing_findings(path, [(*BELOW, None), (*BELOW, None), (*ABOVE, None)]))
    for wrong in ([(*ABOVE, None), (*BELOW, None)], [(5.0, 3.001, None)], [(*BELOW, 9.0)]):
        assert "does not pass waypoint" in next(passing_findings(path, wrong))


@pytest.mark.parametrize("given", [True, pytest.param(False, marks=needs_compiled)], ids=["headings given", "any heading"])
def test_a_path_that_is_known_is_where_it_begins(world, known, given, request):
    rest = (known if given else request.getfixturevalue("over_both")[0].path).after(0.7)
    again = plan_through(Problem(world, start=rest.start, goal=GOAL), WITH_HEADINGS if given else [BELOW, ABOVE], FIRST,
                         seed_path=rest)
    again.check()
    assert again.found_by == "seed_path"
    assert again.length <= rest.length + 1e-9


def test_a_leg_of_a_known_path_that_is_blocked_is_planned_anew(world, known):
    last = legs_along(known, list(stops_of(Problem(world, start=START, goal=GOAL), WITH_HEADINGS)))[-1]
    x, y, _ = last.at(np.array([0.5]))[0]
    cells = yard()
    cells[int(10 * y) - 1:int(10 * y) + 2, int(10 * x) - 1:int(10 * x) + 2] = 100
    problem = Problem(GridMap(cells, 0.1), DISC, START, GOAL)
    again = plan_through(problem, WITH_HEADINGS, FIRST, seed_path=known)
    again.check()
    assert_passed(again, *WITH_HEADINGS)
    assert again.path.start == START and again.length > known.length


def test_a_path_that_passes_other_places_is_no_seed(world, known):
    problem = Problem(world, start=START, goal=GOAL)
    other = plan(problem, FIRST).path
    assert legs_along(other, list(stops_of(problem, WITH_HEADINGS))) is None
    assert plan_through(problem, WITH_HEADINGS, FIRST, seed_path=other).path == known


@needs_compiled
def test_what_is_proved_of_one_heading_at_a_waypoint_is_not_proved_of_all():
    """There is a path; the time is too short for it."""
    problem = Problem(load_map("maze"), Vehicle(1.0, 0.2), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))
    result = plan_through(problem, [(5.5, 5.0), (9.0, 6.5, 0.0)], Settings(seed=1, planning_time=0.02))
    assert result.solved or result.status == Status.TIMEOUT
    assert result.solved or any(words in result.message for words in (
        "No path within planning_time 0.02 s", "headings that were tried", "leads on"))
