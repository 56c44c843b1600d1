"""The vehicle: what is derived from its dimensions, and what is refused."""

import math

import pytest

from dubins_rrt_ros.planning import OptionError, Vehicle, values


def test_the_steering_determines_the_turning_radius():
    assert Vehicle(turning_radius=7.0, wheelbase=2.0, max_steering_angle=0.5).turning_radius == 2.0 / math.tan(0.5)


@pytest.mark.parametrize("half", [{"wheelbase": 2.0}, {"max_steering_angle": 0.5}])
def test_half_of_the_steering_is_refused(half):
    with pytest.raises(OptionError, match="set both at once"):
        Vehicle(**half)


def test_the_disc_of_a_footprint_covers_it():
    vehicle = Vehicle(robot_radius=0.1, footprint="[[3, 0.9], [3, -0.9], [-1, -0.9], [-1, 0.9]]")
    assert vehicle.robot_radius == math.hypot(3, 0.9)


def test_a_vehicle_is_made_again_from_its_values():
    for vehicle in (Vehicle(footprint="[[1, 0], [0, 1], [-1, -1]]"), Vehicle(wheelbase=2.0, max_steering_angle=0.3)):
        assert Vehicle(**values(vehicle)) == vehicle


@pytest.mark.parametrize("footprint", [
    "[]", "[[1, 0], [0, 1]]", "[[1, 0], [0, 1], [1]]", "[[1, 0], [0, 1], [1, 2, 3]]", "[[1, 0], [0, 1], [NaN, 0]]",
    "[[1, 0], [0, 1], [Infinity, 0]]", "[[1, 0], [0, 1], [\"a\", 0]]", "[1, 2, 3]", "{}", "3", "null", "a car", "[" * 100_000])
def test_a_footprint_that_is_no_outline_is_refused_with_an_example(footprint):
    with pytest.raises(OptionError, match="give at least three corners") as refusal:
        Vehicle(footprint=footprint)
    assert len(str(refusal.value)) < 200


def test_a_footprint_beyond_the_range_of_discs_is_refused():
    with pytest.raises(OptionError, match=r"robot_radius is .*from 0 to 1000"):
        Vehicle(footprint="[[1e9, 0], [0, 1], [-1, -1]]")
