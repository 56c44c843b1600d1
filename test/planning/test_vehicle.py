"""The vehicle: what is derived from its dimensions, and what is refused."""

import math
import pickle
import warnings
from dataclasses import replace

import numpy as np
import pytest

from dubins_rrt_ros.planning import GridMap, OptionError, Problem, Settings, Vehicle, plan, values
from dubins_rrt_ros.planning.vehicle import DoubtfulVehicle

#: A wall behind the start.
WALL = np.zeros((40, 40), np.int8)
WALL[10:30, 2:4] = 100
SQUARE = ((0.3, -0.4), (0.3, 0.4), (-0.3, 0.4), (-0.3, -0.4))


def test_the_steering_determines_the_turning_radius():
    assert Vehicle(wheelbase=2.0, max_steering_angle=0.5).turning_radius == 2.0 / math.tan(0.5)


@pytest.mark.parametrize("half", [{"wheelbase": 2.0}, {"max_steering_angle": 0.5}])
def test_half_of_the_steering_is_refused(half):
    with pytest.raises(OptionError, match="set both at once"):
        Vehicle(**half)


def test_the_disc_of_a_footprint_covers_it():
    vehicle = Vehicle(footprint="[[3, 0.9], [3, -0.9], [-1, -0.9], [-1, 0.9]]")
    assert vehicle.robot_radius == math.hypot(3, 0.9)


@pytest.mark.parametrize(("make", "said"), [
    (lambda: Vehicle(footprint=SQUARE, robot_radius=0.9),
     "robot_radius 0.9 m has no effect, as footprint takes its place: it is 0.5 m"),
    (lambda: Vehicle(footprint=SQUARE, robot_radius=0.2), "robot_radius 0.2 m has no effect"),
    (lambda: Vehicle.from_wheelbase(2.0, 0.5, robot_radius=0.2, footprint=SQUARE), "robot_radius 0.2 m has no effect"),
    (lambda: Vehicle(1.0, wheelbase=2.0, max_steering_angle=math.pi / 4), "turning_radius 1 m has no effect"),
    (lambda: Vehicle(turning_radius=7.0, wheelbase=2.0, max_steering_angle=math.pi / 4),
     "turning_radius 7 m has no effect, as wheelbase takes its place: it is 2 m"),
    (lambda: Vehicle.from_wheelbase(2.0, 0.5, robot_radius=0.9, footprint=SQUARE), "robot_radius 0.9 m has no effect"),
    (lambda: replace(Vehicle(footprint=SQUARE), robot_radius=0.4), "robot_radius 0.4 m has no effect")])
def test_a_radius_in_whose_place_another_size_is_used_is_warned_of(make, said):
    with pytest.warns(DoubtfulVehicle, match=said) as told:
        make()
    assert len(told) == 1


def test_a_radius_that_is_the_derived_one_or_was_not_given_is_not_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        car = Vehicle.from_wheelbase(2.0, 0.5, footprint=SQUARE)
        assert Vehicle(**values(car)) == replace(car) == pickle.loads(pickle.dumps(car)) == car
        assert Vehicle(robot_radius=0.9, footprint=()).robot_radius == 0.9
        assert replace(Vehicle(), footprint=SQUARE).robot_radius == 0.5
        assert replace(Vehicle(3.0, 0.9), footprint=SQUARE) == Vehicle(3.0, footprint=SQUARE)
        twice = replace(Vehicle(footprint=SQUARE), footprint=[(2 * x, 2 * y) for x, y in SQUARE])
        assert twice.robot_radius == replace(pickle.loads(pickle.dumps(twice)), footprint=()).robot_radius == 1.0
        assert replace(car, wheelbase=4.0).turning_radius == 4.0 / math.tan(0.5)
        leaving = plan(Problem(GridMap(WALL, 0.1, (0.0, 0.0, 0.0)), Vehicle(0.5, footprint=SQUARE),
                               (0.69, 2.0, 0.0), (3.5, 2.0, 0.0), start_slack=0.1), Settings(planner="rrt", planning_time=60.0))
        assert leaving.solved and leaving.start_too_near


def test_a_radius_that_is_none_is_refused():
    with pytest.raises(OptionError, match="robot_radius is None"):
        Vehicle(robot_radius=None)


def test_the_place_of_the_warning_is_that_of_the_call():
    with pytest.warns(DoubtfulVehicle) as told:
        Vehicle(footprint=SQUARE, robot_radius=0.9)
    assert told[0].filename == __file__


def test_a_vehicle_is_made_again_from_its_values():
    for vehicle in (Vehicle(footprint="[[1, 0], [0, 1], [-1, -1]]"), Vehicle(wheelbase=2.0, max_steering_angle=0.3)):
        assert Vehicle(**values(vehicle)) == vehicle


def test_a_footprint_is_its_corners_counter_clockwise():
    corners = ((1.0, 0.0), (0.0, 1.0), (-1.0, -1.0))
    for given in (corners, list(corners), np.array(corners), [np.array(corner) for corner in corners],
                  [[np.float64(x), np.int64(y)] for x, y in corners], "[[1, 0], [0, 1], [-1, -1]]",
                  "[[1., .0], [+0, 1e0], [-1, -1.0,],]"):
        assert Vehicle(footprint=given).footprint == corners
        assert Vehicle.from_footprint(given, turning_radius=2.0) == Vehicle(2.0, footprint=corners)
    assert Vehicle(footprint=corners[::-1]).footprint == ((-1.0, -1.0), (0.0, 1.0), (1.0, 0.0))[::-1]
    for nothing in ("", "[]", " [ ] ", (), [], np.empty((0, 2))):
        assert Vehicle(footprint=nothing).footprint == () == Vehicle().footprint


def test_its_text_is_what_files_and_parameters_hold():
    assert values(Vehicle(footprint="[[1,0],[0,1],[-1,-1]]"))["footprint"] == "[[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]]"
    assert values(Vehicle())["footprint"] == ""


def test_the_radii_around_the_reference_point():
    vehicle = Vehicle(footprint=[(3, 0.9), (3, -0.9), (-1, -0.9), (-1, 0.9)])
    assert (vehicle.inscribed_radius, vehicle.circumscribed_radius) == (pytest.approx(0.9), math.hypot(3, 0.9))
    assert (Vehicle(1.0, 0.3).inscribed_radius, Vehicle(1.0, 0.3).circumscribed_radius) == (0.3, 0.3)


def test_the_radii_where_the_reference_point_is_not_inside():
    for edge in (0.0, -0.4):
        vehicle = Vehicle(footprint=[(edge, 0.3), (-1.6, 0.3), (-1.6, -0.3), (edge, -0.3)])
        assert (vehicle.inscribed_radius, vehicle.circumscribed_radius) == (0.0, math.hypot(1.6, 0.3))
        assert vehicle.required_clearance == -math.inf
    assert Vehicle(1.0, 0.3).required_clearance == 0.3 and Vehicle(1.0, 0.0).required_clearance == 0.0


def test_a_vehicle_of_a_wheelbase():
    vehicle = Vehicle.from_wheelbase(2.0, 0.5, robot_radius=0.7)
    assert vehicle == Vehicle(robot_radius=0.7, wheelbase=2.0, max_steering_angle=0.5)
    for wheelbase, angle in ((0, 0), (2.0, 0), (0, 0.5)):
        with pytest.raises(OptionError, match="give both above 0"):
            Vehicle.from_wheelbase(wheelbase, angle)


def test_a_vehicle_of_no_footprint_is_refused():
    for nothing in ((), "", [], "[]"):
        with pytest.raises(OptionError, match="give at least three corners"):
            Vehicle.from_footprint(nothing)


@pytest.mark.parametrize("footprint", [
    None, 5, [1, 2, 3], [(1, 0), (0, 1)], [(1, 0), (0, 1), (-1, "x")], [(1, 0), (0, 1), (-1, True)], np.ones(3), np.ones((3, 3)),
    "[[1, 0], [0, 1], [1e999, 0]]", "[[1, 0], [0, 1], [., 0]]", "[[1, 0], [0, 1], [1 0]]", "[[1, 0], [0, 1], [1, 0]",
    "[[1, 0], [0, 1]]", "[[1, 0], [0, 1], [1]]", "[[1, 0], [0, 1], [1, 2, 3]]", "[[1, 0], [0, 1], [NaN, 0]]",
    "[[1, 0], [0, 1], [Infinity, 0]]", "[[1, 0], [0, 1], [\"a\", 0]]", "[1, 2, 3]", "{}", "3", "null", "a car", "[" * 100_000])
def test_a_footprint_that_is_no_outline_is_refused_with_an_example(footprint):
    with pytest.raises(OptionError, match="give at least three corners") as refusal:
        Vehicle(footprint=footprint)
    assert len(str(refusal.value)) < 200


def test_a_footprint_beyond_the_range_of_discs_is_refused():
    with pytest.raises(OptionError, match=r"footprint has its farthest corner at 1e\+09 m; .*from 0 to 1000"):
        Vehicle(footprint="[[1e9, 0], [0, 1], [-1, -1]]")
