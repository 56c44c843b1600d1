"""Hundreds of random problems: every path is right by two judges, and every tree holds its invariants."""

import math

import numpy as np
import pytest
from support.cases import SCALE, random_maps, random_problem, scaled
from support.naive import drive, points_along

from dubins_rrt_ros.planning import Settings, Status, audit_path, plan

POSSIBLE = {Status.NONE, Status.START_OCCUPIED, Status.GOAL_OCCUPIED, Status.TIMEOUT, Status.NO_VALID_PATH}
#: Number of problems of each algorithm.
COUNT = scaled(100, least=15)
#: A search without a path goes on until this [s].
PATIENCE = 0.15 if SCALE == 1 else 8.0


@pytest.mark.parametrize(("planner", "count"), [
    ("rrt_star", 15), *(pytest.param(planner, COUNT, marks=pytest.mark.slow) for planner in ("rrt", "rrt_star"))])
def test_random_problems(planner, count):
    rng = np.random.default_rng({"rrt": 1, "rrt_star": 2}[planner])
    statuses = []
    for seed in range(count):
        problem, clearance = random_problem(rng, random_maps(30)[seed % 30])
        settings = Settings(planner=planner, samples=scaled(600, least=60), seed=seed, planning_time=PATIENCE,
                            step_size=float(rng.choice([0.0, 0.0, 1.0])),
                            heading_sampling=str(rng.choice(["uniform", "goal", "field", "mixed"])),
                            informed=bool(rng.random() < 0.6), shortcut=bool(rng.random() < 0.6))
        result = plan(problem, settings)
        assert result.status in POSSIBLE, result.message
        assert result.message
        assert (result.status == Status.NONE) == (result.path is not None)
        result.tree.check(problem.world.field, problem.vehicle)
        if result.path is not None:
            check_path(result, clearance)
        statuses.append(result.status)
    assert statuses.count(Status.NONE) > count / 3
    assert statuses.count(Status.TIMEOUT) > 0


def check_path(result, clearance):
    """The audit passes, and so does a drive along the path in small steps."""
    problem, path = result.problem, result.path
    assert audit_path(path, problem).ok
    at = np.array(problem.start)
    least = clearance(at[None, :2])[0]
    for curve in path.curves:
        assert curve.radius >= problem.vehicle.turning_radius
        assert min(curve.lengths) >= 0
        assert_close(at, curve.start)
        points = points_along(curve.start, curve.word, curve.lengths, curve.radius, 0.02)
        least = min(least, clearance(points).min())
        at = drive(curve.start, curve.word, curve.lengths, curve.radius)
    assert_close(at, path.end)
    assert least >= problem.vehicle.robot_radius - 1e-9
    assert math.dist(at[:2], problem.goal[:2]) <= problem.goal_tolerance_xy + 1e-6
    assert abs(math.remainder(at[2] - problem.goal[2], math.tau)) <= problem.yaw_tolerance + 1e-6
    assert path.length >= result.lower_bound - 1e-9


def assert_close(pose, other):
    assert math.dist(pose[:2], other[:2]) <= 1e-8
    assert abs(math.remainder(pose[2] - other[2], math.tau)) <= 1e-8
