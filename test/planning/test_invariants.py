"""check() of curve, path and plan: it holds for whatever the library makes, after every step, and finds what is broken."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cases import (
    empty_map,
    needs_compiled,
    path_over,
    random_maps,
    random_pose,
    random_problem,
    scaled,
    search_on,
    steps_of,
)
from support.planner_cases import GOAL, START, VEHICLE, hard_to_reach, settings, walled

from dubins_rrt_ros.planning import (
    Audit,
    ClearanceField,
    CurveError,
    DubinsCurve,
    GridMap,
    Path,
    PathError,
    PlanError,
    Problem,
    Settings,
    Status,
    TreeError,
    Vehicle,
    plan,
)
from dubins_rrt_ros.planning.curves.dubins import shortest
from dubins_rrt_ros.planning.search.smoothing import smooth

PLAIN = {"informed": False, "shortcut": False, "heading_sampling": "uniform"}
KINDS = {"rrt": {"planner": "rrt"}, "rrt_star": {"planner": "rrt_star"},
         "plain rrt": {"planner": "rrt", **PLAIN}, "plain rrt_star": {"planner": "rrt_star", **PLAIN},
         "short edges": {"planner": "rrt_star", "step_size": 0.5}}
#: Of random problems, how many are looked at of each kind.
PROBLEMS = scaled(8, least=2)

coordinates = st.floats(-20, 20)
poses = st.tuples(coordinates, coordinates, st.floats(-7, 7))


# What is made holds

@given(poses, poses, st.floats(0.01, 10))
def test_shortest_curves_and_their_pieces_hold(start, goal, radius):
    shortest(start, goal, radius).check()
    path = path_over([start, goal, start], radius)
    path.check()
    path.cut(1.7).check()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(PROBLEMS))
def test_tree_and_path_hold_after_every_step(kind, seed):
    problem = a_problem(seed)
    search = search_on(problem, Settings(samples=scaled(800, least=60), seed=seed, **KINDS[kind]))
    for _ in steps_of(search):
        tree, path = search.tree, search.path
        tree.check()
        if path is not None:
            path.check()
            assert tree.path_to(search.best) == path
            assert tree.costs[search.best] == search.cost >= path.length == search.length


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(PROBLEMS))
def test_answers_hold_and_those_on_the_way_to_them(kind, seed):
    plan(a_problem(seed), Settings(samples=scaled(600, least=60), planning_time=0.3, seed=seed, **KINDS[kind]),
         on_progress=lambda progress: progress.snapshot().check()).check()


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
@pytest.mark.parametrize("status, problem, options", [
    (Status.NONE, Problem(empty_map(), VEHICLE, START, START), {}),
    (Status.NONE, Problem(empty_map(), VEHICLE, START, GOAL, goal_tolerance_xy=0.5, any_goal_heading=True), {}),
    (Status.NO_VALID_PATH, Problem(walled(), VEHICLE, START, GOAL), {}),
    (Status.TIMEOUT, hard_to_reach(), {"samples": 30, **PLAIN}),
    (Status.TIMEOUT, hard_to_reach(), {"samples": 10_000_000, "planning_time": 0.05, **PLAIN}),
    (Status.START_OUTSIDE_MAP, Problem(empty_map(), VEHICLE, (99.0, 0.0, 0.0), GOAL), {}),
    (Status.GOAL_OCCUPIED, Problem(walled(), VEHICLE, START, (0.0, 0.0, 0.0)), {}),
])
def test_every_ending_holds(planner, status, problem, options):
    answer = plan(problem, settings(planner, **options))
    assert answer.status == status
    answer.check()


@pytest.mark.parametrize("asked", [0, 1, 2, 3, 5])
def test_cancelled_answers_hold(asked):
    """Cancelled when it is asked about for the first, the second ... time: before the search, and with a path or without."""
    answers = iter([False] * asked)
    answer = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings("rrt_star", samples=10_000_000),
                  cancel=lambda: next(answers, True))
    assert answer.cancelled
    answer.check()


@pytest.mark.parametrize("seed", range(PROBLEMS))
def test_smoothed_paths_hold(seed):
    rng = np.random.default_rng(seed)
    field = ClearanceField(empty_map(40.0))
    path = path_over([random_pose(rng) for _ in range(5)], VEHICLE.turning_radius)
    for first_round in (True, False):
        path = smooth(path, VEHICLE, field, rng, first_round)
        path.check()


def a_problem(seed):
    """A random one whose start is free."""
    rng = np.random.default_rng(seed)
    drawn = (random_problem(rng, random_maps(30)[index % 30]) for index in range(seed, seed + 60))
    return next(problem for problem, clearance in drawn
                if clearance(np.array([problem.start[:2]]))[0] > problem.vehicle.robot_radius)


@needs_compiled
@pytest.mark.parametrize(("x", "y"), [(3e6, 4.8e6), (9.9e7, -9.9e7)], ids=["utm", "largest"])
def test_answers_hold_far_from_the_origin(x, y):
    c, s = math.cos(1.0), math.sin(1.0)
    world_map = GridMap(np.zeros((100, 100), np.int8), 0.1, (x, y, 1.0))
    start, goal = ((x + c * u - s * v, y + s * u + c * v, theta) for u, v, theta in ((2.0, 3.0, 2.0), (8.0, 7.0, 3.1)))
    answer = plan(Problem(world_map, Vehicle(0.02, 0.1), start, goal), Settings(samples=100, seed=1, planning_time=60))
    assert answer.solved
    answer.check()


# What is broken is found

CURVE = DubinsCurve((1.0, 2.0, 0.5), 0.5, "LSR", (0.4, 3.0, 0.7))

CURVES = {
    "no word": ("'LSX' is none of the words LSL", {"word": "LSX"}),
    "a start that is none": ("starts at (1.0, nan, 0.5)", {"start": (1.0, math.nan, 0.5)}),
    "no radius": ("turning radius is 0.0 m", {"radius": 0.0}),
    "an endless radius": ("turning radius is inf m", {"radius": math.inf}),
    "an arc driven backwards": ("arcs are (0.4, -1e-12, 0.7) m long", {"lengths": (0.4, -1e-12, 0.7)}),
    "an endless arc": ("arcs are (0.4, inf, 0.7) m long", {"lengths": (0.4, math.inf, 0.7)}),
    "more than a circle": ("an arc of LSR turns by 6.4 rad", {"lengths": (3.2, 0.0, 0.0)}),
    "three turns too short": ("second arc of LRL turns by 3.1 rad, less than pi", {"word": "LRL", "lengths": (0.4, 1.55, 0.7)}),
}


@pytest.mark.parametrize("name", CURVES)
def test_check_finds_a_curve_with(name):
    message, broken = CURVES[name]
    CURVE.check()
    with pytest.raises(CurveError) as caught:
        replace(CURVE, **broken).check()
    assert message in str(caught.value)


def test_a_piece_of_three_turns_may_end_within_the_second():
    replace(CURVE, word="LRL", lengths=(0.4, 1.0, 0.0)).check()
    replace(CURVE, word="LRL", lengths=(0.0, 1.0, 0.7)).check()


@pytest.fixture(scope="module")
def answer():
    """A plan with a path of several curves."""
    found = plan(Problem(empty_map(), VEHICLE, START, GOAL), settings("rrt_star", samples=100, step_size=3.0))
    assert len(found.path.curves) > 3
    found.check()
    return found


def moved(pose, x=0.0, theta=0.0):
    return pose[0] + x, pose[1], pose[2] + theta


def with_waypoint(path, index, *pose):
    waypoints = path.waypoints.copy()
    waypoints[index] = pose
    return replace(path, waypoints=waypoints)


def with_lengths(path, index, *lengths):
    changed = path.lengths.copy()
    changed[index + 1] = lengths
    return replace(path, lengths=changed)


def joined(path, curves):
    return Path.of_curves(path.start, path.end, curves)


PATHS = {
    "a start that is none": ("the start of the path is (nan", lambda p: with_waypoint(p, 0, math.nan, 0.0, 0.0)),
    "an end that is none": ("the end of the path is (0.0, 0.0, inf)", lambda p: with_waypoint(p, -1, 0.0, 0.0, math.inf)),
    "a broken curve": ("of curve 1 of the path: its arcs are", lambda p: with_lengths(p, 1, -1.0, 0.0, 0.0)),
    "no radius": ("of curve 0 of the path: its turning radius", lambda p: replace(p, radius=-1.0)),
    "another start": ("the first curve starts at", lambda p: Path.of_curves(moved(p.start, x=1e-9), p.end, p.curves)),
    "another end": ("the path jumps by 1.1e-06 m and", lambda p: with_waypoint(p, -1, *moved(p.end, x=1.1e-6))),
    "another last heading": ("m and 1.1e-06 rad", lambda p: with_waypoint(p, -1, *moved(p.end, theta=1.1e-6))),
    "a gap": ("before curve 2 the path jumps by 0.01 m", lambda p: with_waypoint(p, 2, *moved(p.curves[2].start, x=0.01))),
    "a curve left out": ("before curve 1 the path jumps", lambda p: joined(p, p.curves[:1] + p.curves[2:])),
    "no curves between two poses": ("no curve leads from", lambda p: joined(p, ())),
}


@pytest.mark.parametrize("name", PATHS)
def test_check_finds_a_path_with(answer, name):
    message, broken = PATHS[name]
    with pytest.raises(PathError) as caught:
        broken(answer.path).check()
    assert message in str(caught.value)


def test_a_path_without_curves_stays_where_it_is():
    Path.of_pose(START).check()


def of_another(plan, **changes):
    """The same plan as the answer to another problem."""
    return replace(plan, problem=replace(plan.problem, **changes))


def shorter_way(plan):
    """The same plan with a path that its tree does not have."""
    path = path_over([START, GOAL], VEHICLE.turning_radius)
    return replace(plan, path=path, lower_bound=0.0)


PLANS = {
    "no message": ("the message is ''", lambda p: replace(p, message="")),
    "two lines": ("not one line", lambda p: replace(p, message="Path\nof 2 m.")),
    "a path in spite of its status": ("TIMEOUT with a path", lambda p: replace(p, status=Status.TIMEOUT)),
    "success without a path": ("NONE without a path", lambda p: replace(p, path=None)),
    "too many samples": ("101 samples were drawn of 100",
                         lambda p: replace(p, samples=101, settings=replace(p.settings, informed=False))),
    "no seed": ("seed that was used is -1", lambda p: replace(p, settings=replace(p.settings, seed=-1))),
    "negative time": ("the planning took -1.0 s", lambda p: replace(p, planning_time=-1.0)),
    "no bound": ("the lower bound is nan m", lambda p: replace(p, lower_bound=math.nan)),
    "a bound above the path": ("less than the lower bound", lambda p: replace(p, lower_bound=p.length * (1 + 1e-8))),
    "another problem's tree": ("the tree begins at", lambda p: of_another(p, start=moved(START, x=1e-9))),
    "another vehicle": ("the tree turns with a radius", lambda p: of_another(p, vehicle=replace(VEHICLE, turning_radius=0.4))),
    "another goal": ("ends 0.5 m and 0 rad from the goal, whose tolerance is 0.2 m", lambda p: of_another(
        p, goal=moved(GOAL, x=0.5), goal_tolerance_xy=0.2)),
    "another goal's heading": ("ends 0 m and 0.5 rad", lambda p: of_another(p, goal=moved(GOAL, theta=0.5))),
    "no audit": ("its audit is None", lambda p: replace(p, audit=None)),
    "a failed audit": ("its audit is it jumps", lambda p: replace(p, audit=replace(p.audit, findings=("it jumps",)))),
    "a clearance below 0": ("the least clearance is -0.1 m", lambda p: replace(p, audit=replace(p.audit, min_clearance=-0.1))),
    "too tight a turn": ("the path bends by 2.1/m, the vehicle by 2.0/m",
                         lambda p: replace(p, audit=replace(p.audit, max_curvature=2.1))),
    "its first path too late": ("the first path came after 9.0 s", lambda p: replace(p, time_to_first=9.0, planning_time=1.0)),
    "no time of its first path": ("the first path came after None s", lambda p: replace(p, time_to_first=None)),
    "a path that is not in the tree": ("is not in the tree of", shorter_way),
}


@pytest.mark.parametrize("name", PLANS)
def test_check_finds_a_plan_with(answer, name):
    message, broken = PLANS[name]
    with pytest.raises(PlanError) as caught:
        broken(answer).check()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_check_finds_a_plan_whose_tree_or_path_is_broken(answer):
    with pytest.raises(TreeError):
        replace(answer, tree=replace(answer.tree, costs=answer.tree.costs + 1)).check()
    with pytest.raises(PathError):
        replace(answer, path=with_waypoint(answer.path, -1, 0.0, 0.0, 0.0)).check()


def test_check_finds_a_failure_with_what_only_a_path_has():
    failed = plan(Problem(walled(), VEHICLE, START, GOAL), settings("rrt"))
    failed.check()
    for message, broken in (("audit is ok", {"audit": Audit((), 0.1, 2.0)}),
                            ("NO_VALID_PATH, and cancelled is True", {"cancelled": True}),
                            ("CANCELLED, and cancelled is False", {"status": Status.CANCELLED})):
        with pytest.raises(PlanError) as caught:
            replace(failed, **broken).check()
        assert message in str(caught.value)
