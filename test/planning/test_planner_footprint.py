"""plan() for polygon footprints: what a disc around the vehicle could not do, and what no vehicle can."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from support.cases import SCALE, needs_compiled

from dubins_rrt_ros.planning import (
    ClearanceField,
    GridMap,
    PolygonMap,
    Problem,
    Settings,
    Status,
    Vehicle,
    audit_path,
    load_map,
    plan,
    rasterise,
)
from dubins_rrt_ros.planning.curves import dubins
from dubins_rrt_ros.planning.maps.locate import maps_directory

ROBOT = "[[0.6, 0.3], [-0.6, 0.3], [-0.6, -0.3], [0.6, -0.3]]"
CAR = "[[3.6, 0.9], [-0.9, 0.9], [-0.9, -0.9], [3.6, -0.9]]"
SAMPLES = 1000 if SCALE == 1 else 40
#: A search without a path goes on until this [s].
PATIENCE = 60.0 if SCALE == 1 else 10.0


def checked(problem, **settings):
    """The plan, its path judged again and its tree's edges with it."""
    result = plan(problem, Settings(**{"samples": SAMPLES, "seed": 1, "planning_time": PATIENCE, **settings}))
    result.check()
    result.tree.check(ClearanceField(problem.map, problem.allow_unknown), problem.vehicle)
    if result.path:
        assert audit_path(result.path, problem).ok
    return result


def grid_with_a_gap(rows):
    """8 m x 8 m with a wall 0.4 m thick across, but for some rows of 0.05 m."""
    data = np.zeros((160, 160))
    data[:, 76:84] = 100
    data[rows, 76:84] = 0
    return GridMap(data, 0.05)


def polygons_with_a_gap(width):
    wall = shapely.box(3.8, 0, 4.2, 8) - shapely.box(3.7, 4 - width / 2, 4.3, 4 + width / 2)
    return PolygonMap(shapely.box(0, 0, 8, 8) - wall)


@needs_compiled
@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
@pytest.mark.parametrize("map", [grid_with_a_gap(slice(72, 88)), polygons_with_a_gap(0.8)], ids=["grid", "polygons"])
def test_a_long_vehicle_drives_through_a_gap_that_its_disc_does_not(map, planner):
    """0.6 m wide and 1.2 m long, through 0.8 m."""
    vehicle = Vehicle(turning_radius=0.8, footprint=ROBOT)
    result = checked(Problem(map, vehicle, (1.5, 2.0, 0.0), (6.5, 6.0, 0.0)), planner=planner)
    assert result.status == Status.NONE, result.message
    assert 0 < result.min_clearance < 0.1
    assert result.length >= result.lower_bound
    disc = Vehicle(turning_radius=0.8, robot_radius=vehicle.robot_radius)
    assert checked(Problem(map, disc, (1.5, 2.0, 0.0), (6.5, 6.0, 0.0)), planner=planner).status == Status.NO_VALID_PATH


@pytest.mark.slow
@needs_compiled
@pytest.mark.parametrize("width, status", [(0.602, Status.NONE), (0.599, Status.TIMEOUT)])
def test_a_gap_that_just_passes_and_just_fails(width, status):
    """Straight on, as no other way leads through."""
    problem = Problem(polygons_with_a_gap(width), Vehicle(turning_radius=0.8, footprint=ROBOT), (1.5, 4.0, 0.0), (6.5, 4.0, 0.0))
    assert checked(problem, samples=100, planning_time=5.0).status == status


@pytest.mark.slow
@needs_compiled
@pytest.mark.parametrize("seed", range(5))
def test_a_car_parks_forward_between_two_others(seed):
    file = maps_directory() / "parking.geojson"
    start, goal = (json.loads(file.read_text())[name] for name in ("start", "goal"))
    problem = Problem(load_map(file), Vehicle(turning_radius=5.0, footprint=CAR), start, goal)
    result = checked(problem, samples=3000, seed=seed, preferred_clearance=0.0)
    assert result.status == Status.NONE, result.message
    assert result.gap < 0.02


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_the_goal_must_hold_the_whole_footprint(kind):
    """Its reference point has room enough, its corners have not."""
    map = grid_with_a_gap(slice(72, 88)) if kind == "grid" else polygons_with_a_gap(0.8)
    vehicle = Vehicle(turning_radius=0.8, footprint=ROBOT)
    settings = Settings(samples=5, planning_time=0.1, seed=1)
    across, along = (plan(Problem(map, vehicle, (5.5, 2.0, 0.0), (6.5, 0.35, theta)), settings) for theta in (math.pi / 2, 0.0))
    assert across.status == Status.GOAL_OCCUPIED
    assert "the footprint touches the map's edge at (" in across.message
    assert along.status != Status.GOAL_OCCUPIED


#: Trailers 1.2 m long, by the rear edge of what draws them, and by a hitch 0.4 m ahead.
BY_ITS_EDGE = "[[0, 0.3], [-1.2, 0.3], [-1.2, -0.3], [0, -0.3]]"
BY_ITS_HITCH = "[[-0.4, 0.3], [-1.6, 0.3], [-1.6, -0.3], [-0.4, -0.3]]"


@pytest.mark.parametrize("footprint", [BY_ITS_EDGE, BY_ITS_HITCH], ids=["edge", "hitch"])
@pytest.mark.parametrize("map", [grid_with_a_gap(slice(120, 160)), polygons_with_a_gap(1.6)], ids=["grid", "polygons"])
@pytest.mark.parametrize("informed", [True, False])
def test_bounds_are_the_dubins_curves_alone_where_no_disc_lies_inside(map, footprint, informed):
    problem = Problem(map, Vehicle(0.8, footprint=footprint), (2.0, 2.0, math.pi / 2), (6.5, 2.0, -math.pi / 2))
    result = checked(problem, informed=informed, samples=min(SAMPLES, 300))
    assert result.status == (Status.NONE if SCALE == 1 else result.status), result.message
    assert result.lower_bound == dubins.shortest(problem.start, problem.goal, 0.8).length
    words = "the Dubins curve without obstacles" if result.path else "nothing is proved"
    assert words in result.message and "no disc around the reference point lies inside the footprint" in result.message


@needs_compiled
@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_a_hitch_may_stand_over_an_obstacle(kind):
    """Both of the hitch's places lie in a pillar of 0.2 m, which the trailer does not touch."""
    pillar = shapely.box(5.0, 3.9, 5.2, 4.1)
    map = PolygonMap(shapely.box(0, 0, 8, 8) - pillar)
    problem = Problem(map if kind == "polygons" else rasterise(map, 0.05), Vehicle(0.8, footprint=BY_ITS_HITCH), (2.0, 4.0, 0.0),
                      (5.1, 4.0, 0.0))
    assert checked(problem).status == Status.NONE
    inside = replace(problem, vehicle=Vehicle(0.8, footprint=ROBOT))
    assert plan(inside, Settings(samples=5, seed=1)).status == Status.GOAL_OCCUPIED


@needs_compiled
def test_walls_prove_nothing_of_a_hitch_but_of_the_trailer():
    """The trailer is on one side of a closed wall and its goal on the other."""
    problem = Problem(grid_with_a_gap(slice(0)), Vehicle(0.8, footprint=BY_ITS_HITCH), (2.5, 4.0, 0.0), (6.5, 4.0, 0.0))
    result = plan(problem, Settings(samples=50, seed=1, informed=False, planning_time=60.0))
    assert result.status == Status.TIMEOUT and "nothing is proved" in result.message
    touching = replace(problem, start=(4.3, 4.0, 0.0))
    assert "the footprint touches an obstacle" in plan(touching, Settings(samples=5, seed=1)).message


@needs_compiled
def test_nothing_is_proved_of_a_hitch_beside_the_edge_of_the_map():
    """A disc at the hitch cannot turn away from the edge that it faces."""
    ends = (7.9, 4.0, 0.0), (2.0, 6.0, 0.0)
    disc, trailer = (Problem(PolygonMap(shapely.box(0, 0, 8, 8)), vehicle, *ends)
                     for vehicle in (Vehicle(0.8, 0.05), Vehicle(0.8, footprint=BY_ITS_HITCH)))
    short = Settings(samples=5, seed=1, planning_time=0.3)
    assert plan(disc, short).status == Status.NO_VALID_PATH
    assert plan(trailer, short).status in (Status.NONE, Status.TIMEOUT)


@pytest.mark.parametrize("options", [{"informed": False}, {"shortcut": False}, {"step_size": 1.0},
                                     {"informed": False, "step_size": 1.0}])
def test_the_other_ways_to_search_know_the_footprint_too(options):
    vehicle = Vehicle(turning_radius=0.8, footprint=ROBOT)
    problem = Problem(polygons_with_a_gap(1.6), vehicle, (1.5, 2.0, 0.0), (6.5, 6.0, 0.0), goal_tolerance_xy=0.3,
                      any_goal_heading=True)
    result = checked(problem, **options)
    assert result.status == (Status.NONE if SCALE == 1 else result.status), result.message


@needs_compiled
def test_a_seed_determines_the_path_whatever_ran_before():
    problem = Problem(grid_with_a_gap(slice(72, 88)), Vehicle(0.8, footprint=ROBOT), (1.5, 2.0, 0.0), (6.5, 6.0, 0.0))
    first, _, again = (plan(problem, Settings(samples=SAMPLES, seed=seed, planning_time=60.0)) for seed in (3, 4, 3))
    assert first.length == again.length
    assert first.tree.poses.tobytes() == again.tree.poses.tobytes()
