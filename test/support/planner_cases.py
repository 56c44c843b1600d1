"""Requests, and what is asserted of their answers, that the planner's tests share."""

import math

import numpy as np

from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle
from support.cases import scaled

START, GOAL = (-8.0, -8.0, 0.0), (8.0, 8.0, 1.0)
VEHICLE = Vehicle(0.5, 0.2)


def settings(planner, **options):
    budget = {"samples": scaled(3000, least=300), "planning_time": 60.0}
    return Settings(**{"planner": planner, "seed": 1, **budget, **options})


def hard_to_reach():
    """The goal is behind a gap that is wide enough for the disc, but hardly for its turning radius."""
    data = np.zeros((40, 40))
    data[:, 20] = 100
    data[20, 20] = 0
    map = GridMap(data, 0.5, (-10.0, -10.0, 0.0))
    return Problem(map, Vehicle(9.0, 0.24), (-5.0, -8.0, math.pi / 2), (5.0, -8.0, -math.pi / 2))


def assert_refused(result, status, *words):
    assert result.status == status
    assert result.path is result.length is result.gap is None
    assert result.location is None or (len(result.location) == 2 and all(type(c) is float for c in result.location))
    assert result.audit is None
    assert len(result.tree) >= 1
    assert "\n" not in result.message
    for word in words:
        assert word in result.message


def walled(value=100):
    data = np.zeros((40, 40))
    data[:, 19:21] = value
    return GridMap(data, 0.5, (-10.0, -10.0, 0.0))
