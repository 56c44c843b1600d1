"""The audit finds every kind of wrong path, and nothing in a right one."""

import ast
import gc
import math
import weakref
from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pytest
import shapely
from support.cases import naive_clearance, random_maps, random_problem, scaled
from support.naive import points_along

from dubins_rrt_ros.planning import DubinsCurve, GridMap, Path, PolygonMap, Problem, Settings, Status, Vehicle, plan
from dubins_rrt_ros.planning import audit_path as audit_function
from dubins_rrt_ros.planning.curves.dubins import shortest

START, VIA, GOAL = (2.0, 2.0, 0.0), (6.0, 4.0, 1.0), (9.0, 9.0, 2.0)


def square(kind):
    """12 by 12 m, with a wall beside the way."""
    if kind == "polygons":
        return PolygonMap(shapely.box(0, 0, 12, 12) - shapely.box(7, 1, 8, 2))
    data = np.zeros((24, 24))
    data[2:4, 14:16] = 100
    return GridMap(data, 0.5)


@pytest.fixture(params=["grid", "polygons"])
def case(request):
    """A problem and a right path of two curves."""
    problem = Problem(square(request.param), Vehicle(1.0, 0.3), START, GOAL)
    path = Path.of_curves(START, GOAL, (shortest(START, VIA, 1.0), shortest(VIA, GOAL, 1.0)))
    assert audit_function(path, problem).ok
    return problem, path


def with_curve(path, index, **changes):
    curves = list(path.curves)
    curves[index] = replace(curves[index], **changes)
    return Path.of_curves(curves[0].start, path.end, curves)


def with_end(path, index, pose):
    waypoints = path.waypoints.copy()
    waypoints[index] = pose
    return replace(path, waypoints=waypoints)


def joined(path, *curves):
    """The curves as a path to the same end."""
    return Path.of_curves(curves[0].start, path.end, curves)


def findings(problem, path):
    verdict = audit_function(path, problem)
    assert verdict.ok == (not verdict.findings)
    return "; ".join(verdict.findings)


def test_a_right_path_passes_with_its_figures(case):
    problem, path = case
    verdict = audit_function(path, problem)
    assert verdict.findings == ()
    points = np.concatenate([points_along(c.start, c.word, c.lengths, c.radius, 0.001) for c in path.curves])
    assert verdict.min_clearance == pytest.approx(naive_clearance(problem.map)(points).min(), abs=0.001)
    assert verdict.max_curvature == 1.0


def test_curvature_is_that_of_the_tightest_turn(case):
    problem, _ = case
    wide = Path.of_curves(START, GOAL, (shortest(START, VIA, 1.1), shortest(VIA, GOAL, 1.1)))
    assert audit_function(wide, problem).max_curvature == pytest.approx(1 / 1.1)
    straight = Path.of_curves(START, (6.0, 2.0, 0.0), (DubinsCurve(START, 0.1, "LSL", (0.0, 4.0, 0.0)),))
    verdict = audit_function(straight, Problem(problem.map, Vehicle(0.1, 0.3), START, (6.0, 2.0, 0.0)))
    assert verdict.ok
    assert verdict.max_curvature == 0


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("off", [1e-5, -0.1])
def test_a_gap_is_found(case, axis, off):
    problem, path = case
    moved = list(VIA)
    moved[axis] += off
    assert "before curve 1 the path jumps" in findings(problem, with_curve(path, 1, start=tuple(moved)))


@pytest.mark.parametrize("index, finding", [(0, "before curve 1 the path jumps"), (1, "the path starts at")])
def test_a_curve_left_out_is_found(case, index, finding):
    problem, path = case
    assert finding in findings(problem, joined(path, path.curves[index]))
    assert "the path jumps" in findings(problem, joined(path, *path.curves[::-1]))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_wrong_ends_are_found(case, axis):
    problem, path = case
    off = [0.0, 0.0, 0.0]
    off[axis] = 1e-4
    assert "the path starts at" in findings(problem, with_end(path, 0, np.add(path.start, off)))
    assert "from the goal" in findings(problem, with_end(path, -1, np.add(path.end, off)))
    elsewhere = replace(problem, goal=tuple(np.add(problem.goal, off).tolist()))
    assert "from the goal" in findings(elsewhere, path)


def test_the_end_may_use_the_tolerance_and_no_more(case):
    problem, path = case
    nearby = replace(problem, goal=(9.1, 9.0, 2.1 + math.tau), goal_tolerance_xy=0.1001, goal_tolerance_yaw=0.1001)
    assert not findings(nearby, path)
    assert "from the goal" in findings(replace(nearby, goal_tolerance_xy=0.0999), path)
    assert "from the goal" in findings(replace(nearby, goal_tolerance_yaw=0.0999), path)
    assert not findings(replace(nearby, goal_tolerance_yaw=0.0, any_goal_heading=True), path)


def test_a_turn_too_tight_is_found(case):
    problem, path = case
    tight = Path.of_curves(START, GOAL, (shortest(START, VIA, 0.999), shortest(VIA, GOAL, 0.999)))
    assert "curve 0 turns with a radius of 0.999 m, tighter than 1 m" in findings(problem, tight)
    assert "curve 0 cannot be driven" in findings(problem, replace(path, radius=-1.0))


def test_a_negative_length_is_found(case):
    problem, _ = case
    back_and_forth = Path.of_curves(START, (6.0, 2.0, 0.0), (DubinsCurve(START, 1.0, "LSL", (-0.5, 4.0, 0.5)),))
    assert "curve 0 cannot be driven" in findings(replace(problem, goal=(6.0, 2.0, 0.0)), back_and_forth)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("index", [0, 1, 2])
def test_what_is_no_number_is_found(case, bad, index):
    problem, path = case
    lengths, start = list(path.curves[1].lengths), list(path.curves[1].start)
    lengths[index] = start[index] = bad
    for changes in ({"lengths": tuple(lengths)}, {"start": tuple(start)}):
        assert "curve 1 cannot be driven" in findings(problem, with_curve(path, 1, **changes))
    assert "curve 1 cannot be driven" in findings(problem, replace(path, radius=bad))
    assert findings(problem, with_end(path, 0, start))
    assert findings(problem, with_end(path, -1, start))


def straight_past(map, gap, radius):
    """A problem and a path a metre straight along x, `gap` from the map's lower edge."""
    start, goal = (1.0, gap, 0.0), (2.0, gap, 0.0)
    return Problem(map, Vehicle(1.0, radius), start, goal), Path.of_curves(start, goal, (shortest(start, goal, 1.0),))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["grid", "polygons"])
@pytest.mark.parametrize("gap, free", [(0.301, True), (0.299, False), (0.3, True), (0.0, False), (-0.1, False)])
def test_contact_along_a_straight_line(kind, gap, free):
    problem, path = straight_past(square(kind), gap, 0.3)
    found = findings(problem, path)
    assert ("the clearance is" in found) == (not free)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_contact_by_a_millimetre_between_any_samples(kind):
    """A bend's outermost point comes a millimetre too near the wall at x = 12, wherever samples may lie."""
    for y in np.linspace(5, 5.1, 11):
        for too_near in (True, False):
            x = 12 - 0.3 - 1.0 + (0.001 if too_near else -0.001)
            start, goal = (x, y, 0.0), (x, y + 2, math.pi)
            path = Path.of_curves(start, goal, (DubinsCurve(start, 1.0, "LSL", (math.pi / 2, 0.0, math.pi / 2)),))
            verdict = audit_function(path, Problem(square(kind), Vehicle(1.0, 0.3), start, goal))
            assert verdict.ok != too_near
            assert verdict.min_clearance == pytest.approx(12 - x - 1, abs=0.001)


@pytest.mark.parametrize("thickness", [0.1, 1e-3, 1e-6])
@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_a_path_through_a_thin_wall_is_found(thickness, radius):
    """Nor may a mere point drive through it."""
    map = PolygonMap(shapely.box(0, 0, 12, 12) - shapely.box(6, 0, 6 + thickness, 11))
    for shift in np.linspace(0, 0.1, 7):
        start, goal = (1.0 + shift, 3.0, 0.0), (11.0, 3.0, 0.0)
        path = Path.of_curves(start, goal, (shortest(start, goal, 1.0),))
        assert "the clearance is" in findings(Problem(map, Vehicle(1.0, radius), start, goal), path)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_a_path_out_of_the_map_and_back_is_found(kind):
    start, goal = (11.0, 4.0, 0.0), (11.0, 8.0, math.pi)
    path = Path.of_curves(start, goal, (shortest(start, goal, 2.0),))
    assert "the clearance is" in findings(Problem(square(kind), Vehicle(1.0, 0.1), start, goal), path)


def test_unknown_space_counts_unless_it_is_allowed():
    data = np.zeros((24, 24))
    data[:, 12] = -1
    start, goal = (2.0, 6.0, 0.0), (10.0, 6.0, 0.0)
    path = Path.of_curves(start, goal, (shortest(start, goal, 1.0),))
    problem = Problem(GridMap(data, 0.5), Vehicle(), start, goal)
    assert "the clearance is" in findings(problem, path)
    assert not findings(replace(problem, allow_unknown=True), path)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_a_path_that_stays_where_it_is(kind):
    problem = Problem(square(kind), Vehicle(1.0, 0.3), START, START)
    verdict = audit_function(Path.of_pose(START), problem)
    assert verdict.ok
    assert verdict.min_clearance == pytest.approx(2.0)
    assert not audit_function(Path.of_pose(START), replace(problem, vehicle=Vehicle(1.0, 2.1))).ok


@pytest.mark.slow
def test_least_clearance_is_that_of_the_naive_twin():
    rng = np.random.default_rng(5)
    found = 0
    for map in random_maps(30)[:16]:
        problem, clearance = random_problem(rng, map)
        result = plan(problem, Settings(seed=1, samples=scaled(400, least=60), planner="rrt"))
        if result.status != Status.NONE:
            continue
        points = [points_along(c.start, c.word, c.lengths, c.radius, 0.002) for c in result.path.curves]
        least = clearance(np.concatenate([[problem.start[:2]], *points])).min()
        assert result.min_clearance == pytest.approx(least, abs=0.002)
        found += 1
    assert found > 3


def sparse_grid(rng, side, blocked):
    """A turned grid of some thousand cells' width with a few blocked ones, so that obstacles are near and far."""
    data = np.zeros((side, side + side // 10), np.int8)
    data[rng.integers(0, side, blocked), rng.integers(0, side, blocked)] = rng.choice([100, -1], blocked)
    return GridMap(data, 0.05, (*rng.uniform(-50, 50, 2), rng.uniform(-math.pi, math.pi)))


def random_points(rng, map, count):
    """Points of a map's rectangle and around it."""
    corners = map.corners()
    return corners[0] + rng.uniform(-0.05, 1.05, (count, 2)) @ (corners[[1, 3]] - corners[0])


@pytest.mark.parametrize("allow_unknown", [False, True])
@pytest.mark.parametrize("side, blocked", [(700, 0), (700, 1), (1500, 1), (1500, 12),
                                           pytest.param(2500, 3, marks=pytest.mark.slow)])
def test_the_clearance_of_a_point_is_exact_however_far_the_obstacles(side, blocked, allow_unknown):
    rng = np.random.default_rng(side + blocked)
    map = sparse_grid(rng, side, blocked)
    points = random_points(rng, map, 40)
    poses = [(*point, 0.0) for point in points.tolist()]
    problem = Problem(map, Vehicle(), START, GOAL, allow_unknown=allow_unknown)
    found = [audit_function(Path.of_pose(pose), problem).min_clearance for pose in poses]
    assert found == pytest.approx(naive_clearance(map, allow_unknown)(points), abs=1e-9)


def test_the_verdict_on_random_paths_is_that_of_the_naive_twin():
    """Also on those that run through obstacles and out of the map."""
    rng = np.random.default_rng(6)
    verdicts = []
    for map in [*random_maps(30), *(sparse_grid(rng, 700, 20) for _ in range(3))]:
        clearance = naive_clearance(map)
        for points in random_points(rng, map, 6).reshape(3, 2, 2):
            start, goal = ((*point, rng.uniform(-math.pi, math.pi)) for point in points.tolist())
            curve = shortest(start, goal, 0.5)
            least = clearance(points_along(start, curve.word, curve.lengths, 0.5, 0.002)).min()
            radius = float(max(0.01, least + rng.uniform(-0.1, 0.1)))
            verdict = audit_function(Path.of_curves(start, goal, (curve,)), Problem(map, Vehicle(0.5, radius), start, goal))
            if abs(radius - least) > 0.002:
                assert verdict.ok == (radius < least)
                verdicts.append(verdict.ok)
            if verdict.ok:  # otherwise the search for the least ends with the first contact
                assert verdict.min_clearance == pytest.approx(least, rel=0.021, abs=0.002)
    assert 10 < sum(verdicts) < len(verdicts) - 10


def test_of_a_large_noisy_map_every_part_of_a_path_counts():
    """A lane from edge to edge, with one blocked cell in it, or none."""
    noise = np.where(np.random.default_rng(3).random((60, 5000)) < 0.2, 100, 0).astype(np.int8)
    noise[20:40] = 0
    start, goal = (1.0, 1.5, 0.0), (249.0, 1.5, 0.0)
    path = Path.of_curves(start, goal, (shortest(start, goal, 1.0),))
    for column in (None, *range(100, 4900, 480)):
        data = noise.copy()
        if column is not None:
            data[32, column] = 100
        verdict = audit_function(path, Problem(GridMap(data, 0.05), Vehicle(1.0, 0.3), start, goal))
        assert verdict.ok == (column is None)
        assert verdict.min_clearance == pytest.approx(0.5, rel=0.02) or verdict.min_clearance < 0.3


@pytest.mark.parametrize("kind", ["grid", "polygons"])
@pytest.mark.parametrize("spare, free", [(1e-3, True), (1e-6, True), (0.0, True), (-1e-5, False)])
def test_a_kilometre_along_a_wall_takes_few_pieces(kind, spare, free):
    """However little there is to spare, and no more looks at the time than a path that keeps clear."""
    world_map = GridMap(np.zeros((40, 10_200)), 0.1) if kind == "grid" else PolygonMap(shapely.box(0, 0, 1020, 4))
    start, goal = (1.0, 0.2 + spare, 0.0), (1001.0, 0.2 + spare, 0.0)
    path = Path.of_curves(start, goal, (shortest(start, goal, 1.0),))
    looks = []
    verdict = audit_function(path, Problem(world_map, Vehicle(1.0, 0.2), start, goal), check_time=lambda: looks.append(0))
    assert verdict.ok == free and len(looks) < 20
    assert verdict.min_clearance == pytest.approx(0.2 + spare, abs=1e-9)


def test_a_bend_along_a_round_wall_is_decided():
    """Where a millionth of a metre is to spare all along, on a circle of 60 m."""
    world_map = PolygonMap(shapely.Point(0, 0).buffer(10.2 + 1e-6, quad_segs=2000))
    start = (-10.0, 0.0, -math.pi / 2)
    curve = DubinsCurve(start, 10.0, "LSL", (19 * math.pi, 0.0, 0.0))
    assert audit_function(Path.of_curves(start, curve.end, (curve,)), Problem(world_map, Vehicle(10.0, 0.2), start, curve.end)).ok
    nearer = Vehicle(10.0, 0.2 + 1e-5)
    assert not audit_function(Path.of_curves(start, curve.end, (curve,)), Problem(world_map, nearer, start, curve.end)).ok


def test_the_time_is_looked_at_between_portions_of_a_path_of_many_curves():
    count, step = 6000, 0.01
    curves = [DubinsCurve((i * step, 0.0, 0.0), 1.0, "LSL", (0.0, step, 0.0)) for i in range(count)]
    start, end = (0.0, 0.0, 0.0), curves[-1].end
    problem = Problem(GridMap(np.zeros((40, 2040)), 0.1, (-2.0, -2.0, 0.0)), Vehicle(robot_radius=0.1), start, end)
    looks = []
    assert audit_function(Path.of_curves(start, end, curves), problem, check_time=lambda: looks.append(0)).ok
    assert len(looks) > 10


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_a_map_is_not_kept_alive(kind):
    map = square(kind)
    assert audit_function(Path.of_pose(START), Problem(map, Vehicle(1.0, 0.3), START, START)).ok
    kept = weakref.ref(map)
    del map
    gc.collect()
    assert kept() is None


def test_joints_that_each_creep_are_found():
    """Two thousand joints of 0.9 micrometres to the side, each less than the tolerance of one."""
    step, creep, count = 0.005, 9e-7, 2000
    curves = [DubinsCurve((i * step, i * creep, 0.0), 1.0, "LSL", (0.0, step, 0.0)) for i in range(count)]
    start, end = (0.0, 0.0, 0.0), (count * step, (count - 1) * creep, 0.0)
    problem = Problem(GridMap(np.zeros((40, 240)), 0.1, (-2.0, -2.0, 0.0)), Vehicle(robot_radius=0.1), start, end)
    found = audit_function(Path.of_curves(start, end, curves), problem)
    assert found.findings == ("at its joints the path jumps by 0.0017991 m and 0 rad in all",)
    straight = [DubinsCurve((i * step, 0.0, 0.0), 1.0, "LSL", (0.0, step, 0.0)) for i in range(count)]
    end = straight[-1].end
    assert audit_function(Path.of_curves(start, end, straight), replace(problem, goal=end)).ok


def test_the_audit_shares_no_code_with_the_planner():
    own = sorted(File(audit_function.__globals__["__file__"]).parent.glob("*.py"))
    imported = set()
    for node in (node for file in own for node in ast.walk(ast.parse(file.read_text("utf-8")))):
        if isinstance(node, ast.ImportFrom):
            imported.add("." * node.level + (node.module or ""))
        elif isinstance(node, ast.Import):
            imported.update(name.name for name in node.names)
    assert len(own) == 9
    libraries = {"math", "dataclasses", "weakref", "collections.abc", "itertools", "typing", "numpy", "shapely"}
    # Of curves only the types, for a type checker.
    assert imported - {f".{file.stem}" for file in own} - libraries == {
        "..curves.dubins", "..curves.path", "..hooks", "..maps.model", "..option", "..problem", "..settings", "..text",
        "..vehicle"}
