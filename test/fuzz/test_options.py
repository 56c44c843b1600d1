"""Whatever is given for an option, there is a value of its type or a sentence. `test_maps.py` says how to run more of them."""

import dataclasses
import json

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from support.bounded import read_or_refused
from support.mutations import json_of, odd_values, spoiled

from dubins_rrt_ros.planning import GridMap, InvalidPose, OptionError, Problem, Settings, Vehicle, options, values

MAP = GridMap(np.zeros((4, 4)), 1.0)
fuzz = settings.get_profile("fuzz")


def fields(cls):
    """Some of the options of a class with odd values, or ones near the ends of their ranges."""
    of_any = {item.name: odd_values | near_ends(item) for item in options(cls)}
    return st.fixed_dictionaries({}, optional=of_any)


def near_ends(item):
    ends = [item.default, *item.choices, *(end for end in (item.low, item.high) if end is not None)]
    return st.sampled_from(ends) | st.sampled_from([end * factor for end in ends if isinstance(end, int | float)
                                                    for factor in (-1, 0.999, 1.001, 2, 10**6)] or ends)


def made_or_refused(make, *refusals):
    made = read_or_refused(make, *refusals)
    if made is not None:
        for item in options(type(made)):
            assert type(values(made)[item.name]) is item.type
            assert item.convert(values(made)[item.name]) == getattr(made, item.name)
            assert item.convert(getattr(made, item.name)) == getattr(made, item.name)


@fuzz
@given(fields(Settings))
def test_settings(given):
    made_or_refused(lambda: Settings(**given), OptionError)


@fuzz
@given(fields(Vehicle))
def test_vehicle(given):
    made_or_refused(lambda: Vehicle(**given), OptionError)


@fuzz
@given(fields(Problem), odd_values | st.lists(odd_values, max_size=4))
def test_problem(given, pose):
    made_or_refused(lambda: Problem(MAP, Vehicle(), pose, (1, 1, 0), **given), OptionError, InvalidPose)


FOOTPRINTS = [[[1.0, 0.4], [-0.5, 0.4], [-0.5, -0.4], [1.0, -0.4]], [[2, 0], [-1, 1], [-1, -1]],
              [[0.1, 0.1], [0.5, 0.0], [0.1, -0.1], [-0.1, -0.1], [-0.1, 0.1]]]


@fuzz
@given(json_of(FOOTPRINTS).map(lambda text: text.decode("utf-8", "replace")) | st.text()
       | spoiled([b"[[1e3, 1e3], [-1e3, 1e3], [0, -1e3]]"]).map(lambda text: text.decode("latin-1")))
def test_footprint(text):
    def outline():
        vehicle = Vehicle(footprint=text)
        assert 0 <= vehicle.inscribed_radius <= vehicle.robot_radius <= 1000
        return vehicle.footprint

    corners = read_or_refused(outline, OptionError)
    assert not corners or len(corners) >= 3


def test_a_footprint_of_very_many_corners_takes_bounded_time_and_memory():
    angles = np.linspace(0, 2 * np.pi, 100_000, endpoint=False)
    text = json.dumps(np.stack([np.cos(angles), np.sin(angles)], axis=1).tolist())
    assert read_or_refused(lambda: Vehicle(footprint=text), OptionError) is None


def test_what_is_made_of_the_values_of_another_is_the_same():
    vehicle = Vehicle(footprint=json.dumps(FOOTPRINTS[0]))
    assert dataclasses.replace(vehicle) == Vehicle(**values(vehicle))
