"""The reasons why there is no path: every sentence with its figures, and the truth of what they claim."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import shapely
from support.cases import SCALE, boxes_grid, empty_map, holed_polygons, maze_grid, naive_clearance
from support.naive import are_connected, free_space
from support.refusals import reasons_have_time, walls_with_a_gap, why  # noqa: F401 - a fixture

from dubins_rrt_ros.planning import (
    ClearanceField,
    GridMap,
    PolygonMap,
    Problem,
    Settings,
    Status,
    Thresholds,
    Vehicle,
    plan,
)
from dubins_rrt_ros.planning.diagnosis import widest_passage as passage_module
from dubins_rrt_ros.planning.diagnosis.obstacles import has_no_room, nearest_in_map, nearest_obstacle
from dubins_rrt_ros.planning.diagnosis.widest_passage import sample_spacing

START, GOAL = (-8.0, -8.0, 0.0), (8.0, 8.0, 1.0)
TURNED = (3.0, -2.0, 0.7)


# Between start and goal ---------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("origin", [(-10.0, -10.0, 0.0), TURNED])
@pytest.mark.parametrize("resolution, gap, width, radius", [
    (0.5, slice(30, 31), "0.50 m", "0.24 m"), (0.2, slice(50, 52), "0.40 m", "0.19 m"),
    (0.2, slice(50, 53), "0.60 m", "0.29 m")])
def test_too_narrow_a_gap_in_a_grid_is_measured(resolution, gap, width, radius, origin):
    map = walls_with_a_gap(gap, resolution=resolution, origin=origin)
    start, goal = ((*map.to_map_frame(np.array(at)).tolist(), 0.0) for at in ((2.0, 2.0), (18.0, 17.0)))
    problem = Problem(map, Vehicle(0.5, 0.9), start, goal)
    result = why(problem)
    middle = map.to_map_frame(np.array([10.0, (gap.start + gap.stop) / 2 * resolution]))
    # Half a cell of 0.5 m is too much to prove it.
    assert result.status == (Status.TIMEOUT if resolution == 0.5 else Status.NO_VALID_PATH)
    x, y = (round(coordinate, 2) + 0.0 for coordinate in result.location)
    assert (f"the widest way found between start and goal is {width} wide at ({x:.2f}, {y:.2f}); "
            f"with radius {radius} instead of 0.9 m they are connected") in result.message
    assert result.location == pytest.approx(middle, abs=0.3)
    assert are_connected(problem, float(radius[:-2]))
    assert not are_connected(problem, float(radius[:-2]) + 0.0101)


@pytest.mark.parametrize("gap", [0.9, 0.6, 0.33] if SCALE == 1 else [0.9])
def test_too_narrow_a_gap_in_polygons_is_measured(gap):
    walls = shapely.union(shapely.box(-0.5, -11, 0.5, 3), shapely.box(-0.5, 3 + gap, 0.5, 11))
    problem = Problem(PolygonMap(shapely.box(-10, -10, 10, 10) - walls), Vehicle(0.5, 0.9), START, GOAL)
    result = why(problem)
    spacing = sample_spacing(problem.map, ClearanceField(problem.map))
    width, radius = map(float, re.search(r"is ([\d.]+) m wide .* radius ([\d.]+) m instead of 0.9 m", result.message).groups())
    assert gap - 2 * spacing < width <= gap + 0.005
    assert (width - spacing) / 2 - 0.02 < radius < gap / 2
    assert are_connected(problem, radius)
    assert result.location == pytest.approx((0.0, 3 + gap / 2), abs=0.5)


def test_a_proof_before_the_search_names_the_narrowest_place():
    problem = Problem(walls_with_a_gap(slice(50, 52), resolution=0.2), Vehicle(0.5, 0.9), START, GOAL)
    result = why(problem)
    assert result.samples == 0
    assert result.message.startswith("No path exists: the widest way found between start and goal is 0.40 m wide at (0.00, 0.20)")


def test_a_gap_too_narrow_to_be_proved_is_named_after_the_search():
    """Less than a cell too narrow: the proof leaves it open, but more samples are no help."""
    problem = Problem(walls_with_a_gap(slice(50, 52), resolution=0.2), Vehicle(0.5, 0.23), START, GOAL)
    result = why(problem, informed=False)
    assert result.samples == 60
    assert result.message.startswith("No path found: 60 of 60 samples drawn, ")
    assert "0.40 m wide at (0.00, 0.20); with radius 0.19 m instead of 0.23 m" in result.message
    assert "more samples" not in result.message
    result = why(problem, samples=1_000_000, planning_time=0.02)
    assert result.status == Status.TIMEOUT
    assert "0.40 m wide at (0.00, 0.20)" in result.message


def test_a_gap_narrower_than_the_samples_is_bounded():
    walls = shapely.union(shapely.box(-0.5, -11, 0.5, 3), shapely.box(-0.5, 3.001, 0.5, 11))
    problem = Problem(PolygonMap(shapely.box(-10, -10, 10, 10) - walls), Vehicle(0.5, 0.3), START, GOAL)
    result = why(problem)
    width = float(re.search(r"no way between start and goal is wider than ([\d.]+) m, and robot_radius is", result.message)[1])
    assert 4 * sample_spacing(problem.map, ClearanceField(problem.map)) <= width < 1
    assert not are_connected(problem, width / 2)
    assert result.location is None


@pytest.mark.parametrize("map", [
    walls_with_a_gap(slice(0, 0)), PolygonMap(shapely.box(-10, -10, 10, 10) - shapely.box(-0.001, -11, 0.001, 11)),
    PolygonMap(shapely.box(-10, -10, 10, 10) - shapely.Point(START[:2]).buffer(1.2).boundary.buffer(0.01))])
def test_walls_separate_at_any_size(map):
    result = why(Problem(map, Vehicle(0.5, 0.2), START, GOAL))
    assert result.message == ("No path exists: walls separate start and goal, so that no robot_radius is small enough; "
                              "check the map.")
    assert (result.samples, result.location) == (0, None)


def test_cells_that_touch_in_a_corner_are_a_wall_for_any_size():
    """The proof before the search takes diagonal neighbours as connected; that after it does not."""
    data = np.zeros((40, 40))
    data[np.arange(40), np.arange(40)] = 100
    problem = Problem(GridMap(data, 0.5, (-10.0, -10.0, 0.0)), Vehicle(0.5, 0.2), (8.0, -8.0, 0.0), (-8.0, 8.0, 0.0))
    result = why(problem, planning_time=1.5 if SCALE == 1 else 6.0)
    assert "walls separate start and goal, so that no robot_radius is small enough" in result.message


# Unknown space ------------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("resolution", [0.5, 0.2])
@pytest.mark.parametrize("origin", [(-10.0, -10.0, 0.0), TURNED])
def test_unknown_space_that_separates_is_named_with_where_it_begins(resolution, origin):
    map = walls_with_a_gap(slice(0, 0), -1, resolution, origin)
    start, goal = ((*map.to_map_frame(np.array(at)).tolist(), 0.0) for at in ((2.0, 2.0), (18.0, 17.0)))
    result = why(Problem(map, Vehicle(0.5, 0.2), start, goal))
    assert result.message.startswith("No path exists: unknown space separates start and goal for robot_radius 0.2 m; on the way "
                                     "between them it begins at ({:.2f}, {:.2f}); drive there".format(*result.location))
    assert map.to_grid_frame(np.array(result.location))[0] == pytest.approx(10 - round(0.5 / resolution) * resolution)


def test_unknown_space_that_leaves_too_narrow_a_gap_is_named():
    """No cell of the way is unknown, but the gap is only wide enough with the unknown cells beside it."""
    map = walls_with_a_gap(slice(50, 52), -1, resolution=0.2)
    data = np.array(map.data)
    data[:49, 48:52] = data[53:, 48:52] = 100
    problem = Problem(GridMap(data, 0.2, map.origin), Vehicle(0.5, 0.3), START, GOAL)
    assert "unknown space separates start and goal" in why(problem).message


def test_unknown_space_is_not_blamed_for_walls():
    map = walls_with_a_gap(slice(0, 0))
    data = np.array(map.data)
    data[:, 5] = -1
    result = why(Problem(GridMap(data, 0.5, map.origin), Vehicle(0.5, 0.2), (-5.0, -8.0, 0.0), GOAL))
    assert result.message.startswith("No path exists: walls or unknown space separate start and goal")
    allowed = why(Problem(GridMap(data, 0.5, map.origin), Vehicle(0.5, 0.2), (-5.0, -8.0, 0.0), GOAL, allow_unknown=True))
    assert allowed.message.startswith("No path exists: walls separate start and goal")


def test_large_grids_are_coarsened_to_the_safe_side(monkeypatch):
    monkeypatch.setattr(passage_module, "MAX_CELLS", 300)
    monkeypatch.setattr(passage_module, "MAX_NODES", 2000)
    problem = Problem(walls_with_a_gap(slice(0, 0), -1, 0.25), Vehicle(0.5, 0.2), START, GOAL)
    assert "unknown space separates start and goal" in why(problem).message
    problem = Problem(walls_with_a_gap(slice(30, 36), resolution=0.25), Vehicle(0.5, 1.5), START, GOAL)
    radius = float(re.search(r"with radius ([\d.]+) m instead", why(problem).message)[1])
    assert 0.3 < radius < 0.75
    grid = boxes_grid(np.random.default_rng(3), unknown=True)
    coarse = passage_module._coarsened(grid, 4, lambda: None)
    assert coarse.data.shape == (10, 12)
    points = np.random.default_rng(4).uniform(grid.corners().min(axis=0), grid.corners().max(axis=0), (2000, 2))
    for allow_unknown in (False, True):
        assert (ClearanceField(coarse, allow_unknown).at(points) <= ClearanceField(grid, allow_unknown).at(points) + 1e-9).all()


# Occupied and outside -----------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("make", [boxes_grid, lambda rng: boxes_grid(rng, unknown=True), maze_grid,
                                  lambda rng: holed_polygons(rng, "circles")])
def test_the_nearest_obstacle_is_the_nearest(make):
    rng = np.random.default_rng(7)
    map = make(rng)
    field, corners, free = ClearanceField(map), map.corners(), free_space(map)
    seen = set()
    for _ in range(200):
        point = tuple((corners[0] + rng.random(2) @ (corners[[1, 3]] - corners[0])).tolist())
        clearance = float(field.at(np.array(point)))
        found, what, _ = nearest_obstacle(map, False, point, clearance)
        assert math.dist(found, point) == pytest.approx(clearance, abs=1e-9)
        if clearance > 0:
            assert shapely.boundary(free).distance(shapely.Point(found)) < 1e-9
        assert (what == "the map's edge") == (shapely.LinearRing(corners).distance(shapely.Point(found)) < 1e-9)
        seen.add(what)
    assert seen >= {"obstacle", "the map's edge"}


def test_the_figures_of_an_occupied_pose():
    grid, polygons = walls_with_a_gap(slice(0, 0)), PolygonMap(shapely.box(-10, -10, 10, 10) - shapely.box(-0.5, -5, 0.5, 5))
    for map in (grid, polygons):
        for x, sentence in (
                (0.62, "clearance 0.12 m, needed 0.20 m; nearest obstacle at (0.50, 1.00); move it, or make robot_radius"),
                (0.6995, "clearance 0.200 m, needed 0.201 m; nearest obstacle at (0.50, 1.00)"),
                (0.69, "clearance 0.19 m, needed 0.20 m;"),
                (0.2, "clearance 0.00 m, needed 0.20 m; (0.20, 1.00) lies in an obstacle; move it."),
                (-9.96, "clearance 0.04 m, needed 0.20 m; nearest obstacle is the map's edge at (-10.00, 1.00); move it")):
            result = why(Problem(map, Vehicle(0.5, 0.2), (x, 1.0, 0.0), GOAL))
            assert result.status == Status.START_OCCUPIED
            assert result.message.startswith(f"Start is occupied: {sentence}")
            assert result.location == pytest.approx((np.sign(x) * 10 if x < -9 else min(x, 0.5), 1.0))


def test_an_occupied_pose_between_unknown_and_occupied_cells():
    data = np.zeros((40, 40))
    data[:, 20], data[:, 22] = -1, 100
    problem = Problem(GridMap(data, 0.5, (-10.0, -10.0, 0.0)), Vehicle(0.5, 0.3), (0.7, 0.0, 0.0), GOAL)
    assert "clearance 0.20 m, needed 0.30 m; nearest obstacle is unknown space at (0.50, 0.00); move it" in why(problem).message
    problem = replace(problem, vehicle=Vehicle(0.5, 0.25))
    assert "needed 0.25 m; only unknown space is that near, at (0.50, 0.00): drive there to map it" in why(problem).message
    data[:, 22] = 0
    inside = replace(problem, map=GridMap(data, 0.5, (-10.0, -10.0, 0.0)), start=(0.3, 0.0, 0.0))
    assert "clearance 0.00 m, needed 0.25 m; (0.30, 0.00) lies in unknown space: drive there to map it" in why(inside).message


def test_an_occupied_pose_in_a_cell_that_is_neither_free_nor_occupied():
    data = np.zeros((40, 40), np.int8)
    data[:, 20], data[0, 0] = 29, 100
    problem = Problem(GridMap(data, 0.5, (-10.0, -10.0, 0.0)), Vehicle(0.5, 0.25), (0.3, 0.0, 0.0), GOAL)
    assert why(problem).message.endswith("(0.30, 0.00) lies in unknown space, a cell of 29 % (free is up to 25 %, occupied from "
                                         "65 % on): if that is free, set free_thresh to 0.29 or above, or allow_unknown.")
    footprint = replace(problem, vehicle=Vehicle(0.5, footprint=[(0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2)]),
                        start=(0.75, 0.0, 0.0))
    assert "touches unknown space, a cell of 29 %" in why(footprint).message
    thresholds = Thresholds.of_fractions(free_thresh=0.29, occupied_thresh=0.3)
    assert (thresholds.free_up_to, thresholds.occupied_from) == (29, 30)
    assert plan(replace(problem, map=problem.map.with_thresholds(thresholds)), Settings(planner="rrt", seed=1)).solved


def test_a_wall_of_cells_that_are_neither_free_nor_occupied_is_named_with_their_value():
    data = np.zeros((40, 40), np.int8)
    data[:, 20], data[0, 0] = 64, 100
    problem = Problem(GridMap(data, 0.5, (-10.0, -10.0, 0.0)), Vehicle(0.5, 0.25), START, GOAL)
    assert re.search(r"begins at \(.*\) with a cell of 64 %; if that is free, set free_thresh to 0.64", why(problem).message)


def test_the_figures_of_an_occupied_goal_with_a_tolerance():
    problem = Problem(walls_with_a_gap(slice(0, 0)), Vehicle(0.5, 0.2), START, (0.6, 1.0, 0.0), goal_tolerance_xy=0.05)
    result = why(problem)
    assert result.message.startswith("Goal is occupied: clearance 0.10 m, needed 0.20 m, which no place within "
                                     "goal_tolerance_xy 0.05 m has; nearest obstacle at (0.50, 1.00); move it")
    deep = Problem(GridMap(np.pad(np.full((20, 20), 100), 10), 0.5), Vehicle(0.5, 0.3), (1.0, 1.0, 0.0), (10.0, 10.0, 0.0),
                   goal_tolerance_xy=2.0)
    assert why(deep).status == Status.GOAL_OCCUPIED


@pytest.mark.parametrize("tolerance", [0.0, 0.2, 0.7])
def test_no_room_is_a_proof(tolerance):
    rng = np.random.default_rng(9)
    map = boxes_grid(rng, boxes=40)
    field, clearance, corners = ClearanceField(map), naive_clearance(map), map.corners()
    proved = 0
    for _ in range(100):
        point = corners[0] + rng.uniform(-0.1, 1.1, 2) @ (corners[[1, 3]] - corners[0])
        if has_no_room(field, 0.3, tuple(point.tolist()), tolerance):
            around = tolerance * np.sqrt(rng.random(100)) * np.exp(2j * math.pi * rng.random(100))
            assert (clearance(point + np.column_stack([around.real, around.imag])) < 0.3).all()
            proved += 1
    assert proved > 5


def test_the_figures_of_a_pose_outside():
    turned = GridMap(np.zeros((20, 40)), 0.5, (1.0, 2.0, math.pi / 6))
    beyond = turned.to_map_frame(np.array([20.5, 5.0]))
    result = why(Problem(turned, Vehicle(), (*beyond.tolist(), 0.0), (*turned.to_map_frame(np.array([5.0, 5.0])).tolist(), 0.0)))
    assert result.status == Status.START_OUTSIDE_MAP
    assert ("is 0.50 m outside the map, which spans 20.00 m x 10.00 m from its corner (1.00, 2.00) on, turned by 0.524 rad; "
            "check the pose and its frame.") in result.message
    assert result.location == pytest.approx(turned.to_map_frame(np.array([20.0, 5.0])))
    result = why(Problem(empty_map(), Vehicle(), START, (10.7, 0.0, 0.0), goal_tolerance_xy=0.75))
    assert result.status == Status.GOAL_OUTSIDE_MAP
    assert result.message == ("Goal (10.7, 0) is 0.70 m outside the map, which spans x -10.00 to 10.00 m and y -10.00 to "
                              "10.00 m, and goal_tolerance_xy 0.75 m reaches no place with room enough in it; check the pose "
                              "and its frame.")


def test_the_nearest_point_in_a_map():
    map = GridMap(np.zeros((20, 40)), 0.5, (1.0, 2.0, 0.4))
    rectangle = shapely.Polygon(map.corners())
    for point in np.random.default_rng(2).uniform(-30, 30, (200, 2)).tolist():
        nearest = nearest_in_map(map, tuple(point))
        assert math.dist(point, nearest) == pytest.approx(rectangle.distance(shapely.Point(point)), abs=1e-9)
        assert rectangle.distance(shapely.Point(nearest)) < 1e-9


# After a search -----------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("tolerance", [0.0, 0.5])
def test_a_goal_beyond_all_measure(tolerance):
    goal = (1e300, 0.0, 0.0)
    result = why(Problem(walls_with_a_gap(slice(0, 40)), Vehicle(0.5, 0.0), START, goal, goal_tolerance_xy=tolerance))
    assert result.status == Status.GOAL_OUTSIDE_MAP
    assert "1e+300 m outside the map" in result.message


FOOTPRINT = "[[0.6, 0.3], [-0.6, 0.3], [-0.6, -0.3], [0.6, -0.3]]"


@pytest.mark.parametrize("turned, status", [(0.0, Status.START_OCCUPIED), (math.pi / 2, None)])
def test_a_footprint_that_touches_is_told_where(turned, status):
    """Lengthwise it fits between the wall and the map's edge, across it does not."""
    map = PolygonMap(shapely.box(0, 0, 10, 10) - shapely.box(1, 2, 1.2, 8))
    problem = Problem(map, Vehicle(0.5, footprint=FOOTPRINT), (0.5, 5.0, turned), (8.0, 5.0, 0.0))
    result = plan(problem, Settings(samples=5, seed=1, informed=False))
    assert (result.status == Status.START_OCCUPIED) == (status is not None)
    if status:
        assert result.message.startswith("Start is occupied: the footprint touches ")
        assert result.message.endswith("; move or turn it, or make footprint smaller if the robot is, or set start_slack if it "
                                       "can leave.")
        assert result.location[0] in (pytest.approx(0.0), pytest.approx(1.0))


def test_unknown_space_under_a_footprint_is_told():
    data = np.zeros((40, 40))
    data[19:21, 25] = -1
    problem = Problem(GridMap(data, 0.1), Vehicle(0.5, footprint=FOOTPRINT), (2.0, 2.0, 0.0), (2.0, 3.0, 0.0))
    result = why(problem)
    assert result.status == Status.START_OCCUPIED
    assert re.fullmatch(r"Start is occupied: the footprint touches unknown space at \(2\.5\d, [12]\.\d\d\): "
                        r"drive there to map it, or set allow_unknown\.", result.message)


def test_a_way_too_narrow_for_a_footprint_is_told():
    problem = Problem(walls_with_a_gap(slice(20, 21)), Vehicle(0.5, footprint=FOOTPRINT), START, GOAL)
    result = why(problem)
    assert "the widest way found between start and goal is 0.50 m wide at (" in result.message
    assert "a footprint that is 0.6 m wide or more everywhere around its reference point does not fit; " in result.message


def test_start_and_goal_that_nearly_coincide():
    problem = Problem(walls_with_a_gap(slice(0, 0)), Vehicle(8.0, 0.3), (-5.0, 0.0, 0.0), (-5.0, 0.01, 0.0))
    assert "the goal is so close to the start" in why(problem).message
    assert "set goal_tolerance_xy and goal_tolerance_yaw" in why(problem).message
