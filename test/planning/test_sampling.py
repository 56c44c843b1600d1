"""Informed samples: where a path can still become shorter, uniformly, and the plain ones where nothing is known yet."""

import math

import numpy as np
import pytest
from cases import boxes_grid, empty_map, holed_polygons, scaled

from dubins_rrt_ros.planning import ClearanceField, GridMap, Problem, Settings, Vehicle, rrt
from dubins_rrt_ros.planning.rrt import Search
from dubins_rrt_ros.planning.sampling import Sampler

START, GOAL = (-4.0, -3.0, 0.0), (4.0, 3.0, 1.0)
APART = 10.0


def open_field(start=START, goal=GOAL, **options):
    return Problem(empty_map(), Vehicle(0.5, 0.2), start, goal, **options)


def drawn(problem, *best, count=2000, **options):
    settings = Settings(**{"seed": 1, "goal_bias": 0.0, **options})
    return Sampler(problem, settings, ClearanceField.of(problem.map)).draw(count, *best)


def over(problem, points):
    """The length of the straight lines from the start over each of the points to the goal [m]."""
    return sum(np.hypot(*(points[:, :2] - pose[:2]).T) for pose in (problem.start, problem.goal))


@pytest.mark.parametrize("best", [10.001, 10.5, 12.0, 14.0])
def test_informed_positions_are_uniform_over_the_ellipse(best):
    poses = drawn(open_field(), best, count=20_000)
    assert over(open_field(), poses).max() <= best + 1e-9
    along, across = (poses[:, :2] @ [[0.8, -0.6], [0.6, 0.8]] / (best / 2, math.sqrt(best**2 - APART**2) / 2)).T
    distance = np.hypot(along, across)
    assert 0.99 < distance.max() <= 1 + 1e-9
    for part in (0.25, 0.5, 0.75):
        assert (distance**2 < part).mean() == pytest.approx(part, abs=0.015)
    bearings, _ = np.histogram(np.arctan2(across, along), bins=8, range=(-math.pi, math.pi))
    np.testing.assert_allclose(bearings / 2500, 1, atol=0.1)
    assert np.ptp(poses[:, 2]) > 6


@pytest.mark.parametrize("best", [17.0, 21.0, 24.0])
def test_an_ellipse_that_reaches_beyond_the_map_is_cut_at_its_edge(best):
    problem = open_field((-8.0, 5.0, 0.0), (8.0, 9.0, 0.0))
    poses = drawn(problem, best, count=20_000)
    assert over(problem, poses).max() <= best + 1e-9
    assert np.abs(poses[:, :2]).max() <= 10
    plain = drawn(problem, count=100_000)
    expected = plain[over(problem, plain) <= best]
    for axis in (0, 1):
        quantiles = [np.quantile(some[:, axis], [0.1, 0.5, 0.9]) for some in (poses, expected)]
        np.testing.assert_allclose(*quantiles, atol=0.2)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_informed_positions_may_be_free(kind):
    rng = np.random.default_rng(3)
    map = boxes_grid(rng, boxes=20) if kind == "grid" else holed_polygons(rng)
    start, goal = ((*(map.corners()[[0, 2]].T @ weights), 0.0) for weights in ((0.7, 0.3), (0.3, 0.7)))
    problem = Problem(map, Vehicle(0.5, 0.2), start, goal)
    for factor in (1.01, 1.2, 2.0, 5.0):
        best = factor * math.dist(start[:2], goal[:2])
        points = drawn(problem, best)[:, :2]
        assert over(problem, points).max() <= best + 1e-9
        assert ClearanceField.of(map).may_be_free(points, 0.2).all()


def test_a_tolerance_widens_the_ellipse():
    problem = open_field(goal_tolerance_xy=1.0)
    reached = over(problem, drawn(problem, 11.0, count=20_000)).max()
    assert 11.9 < reached <= 12 + 1e-9


@pytest.mark.parametrize("best", [APART, APART - 1e-12])
def test_a_straight_path_leaves_the_line(best):
    poses = drawn(open_field(), best)
    np.testing.assert_allclose(over(open_field(), poses), APART, atol=1e-6)
    assert np.ptp(poses[:, 0]) > 7


def test_a_goal_at_the_start_but_for_its_heading_leaves_a_disc():
    problem = open_field(goal=(*START[:2], 2.0))
    away = np.hypot(*(drawn(problem, 3.0)[:, :2] - START[:2]).T)
    assert 1.45 < away.max() <= 1.5 + 1e-9


def test_plain_draws_know_of_no_path():
    problem = open_field()
    plain = drawn(problem, goal_bias=0.05, informed=False)
    for more in ({"informed": False}, {}):
        assert drawn(problem, math.inf, goal_bias=0.05, **more).tobytes() == plain.tobytes()
    assert drawn(problem, 11.0, goal_bias=0.05, informed=False).tobytes() == plain.tobytes()
    assert drawn(problem, 11.0, goal_bias=0.05).tobytes() != plain.tobytes()
    assert drawn(problem, 100.0, goal_bias=0.05).tobytes() == plain.tobytes()


@pytest.mark.parametrize("shortcut", [False, True])
def test_a_block_is_drawn_by_the_best_length_before_it(shortcut):
    """Nodes that were added later than a block was begun lie in the ellipse of the length then."""
    data = np.zeros((40, 40))
    data[10:30, 19:21] = 100
    problem = Problem(GridMap(data, 0.5, (-10.0, -10.0, 0.0)), Vehicle(0.5, 0.2), START, GOAL)
    settings = Settings(samples=scaled(4 * rrt.BLOCK, least=2 * rrt.BLOCK), seed=1, shortcut=shortcut)
    search, begun = Search(problem, settings, ClearanceField.of(problem.map)), []
    while not search.done:
        if search.samples % rrt.BLOCK == 0 and search.length is not None:
            begun.append((search.size, search.length))
        search.grow()
        search.shorten(search.done)
    assert begun
    nodes = search.tree.poses
    for size, length in begun:
        assert over(problem, nodes[size:]).max(initial=0) <= length + 1e-9
    assert over(problem, nodes[:begun[0][0]]).max() > begun[0][1]
