"""The widest passage between two places: the search against brute force, and what is said of passages against shapely."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import shapely
from support import naive
from support.cases import SCALE, boxes_grid, holed_polygons, naive_clearance, needs_compiled, scaled
from support.naive import are_connected, free_space

from dubins_rrt_ros.planning import ClearanceField, PolygonMap, Problem, Status, Vehicle
from dubins_rrt_ros.planning._kernels.widest_path import WidestPathSearch
from dubins_rrt_ros.planning.collision.raster import CLEARANCE_MARGIN
from dubins_rrt_ros.planning.diagnosis.components import are_separated
from dubins_rrt_ros.planning.diagnosis.explain import before_search
from dubins_rrt_ros.planning.diagnosis.widest_passage import AT_ONCE, sample_spacing, widest_passage


@pytest.mark.parametrize("seed", range(scaled(30, least=6)))
def test_the_search_finds_the_widest_passage(seed):
    rng = np.random.default_rng(seed)
    map = boxes_grid(rng, side=int(rng.integers(3, 12)), boxes=int(rng.integers(0, 14)))
    shape = tuple(rng.integers(2, 16, 2).tolist())
    corner, end = map.corners()[:2]
    step = (end - corner) / max(shape)
    first = corner + 0.3 * step
    turned = np.array([-step[1], step[0]])
    nodes = first + np.arange(shape[1])[None, :, None] * step + np.arange(shape[0])[:, None, None] * turned
    enough, least = rng.uniform(0.1, 1.0), rng.choice([0.0, 0.05])
    clearance = np.minimum(naive_clearance(map)(nodes.reshape(-1, 2)).reshape(shape), enough)
    start, *targets = (tuple(at) for at in rng.integers(0, shape, (4, 2)).tolist())
    is_target = np.zeros(shape, np.int8)
    is_target[tuple(np.transpose(targets))] = 1
    search = WidestPathSearch(clearance=ClearanceField(map).kernel, first=first.tolist(), along=step.tolist(), shape=shape,
                              is_target=is_target.ravel(), least=least, enough=enough)
    search.begin(start[0] * shape[1] + start[1])
    while search.run(int(rng.integers(1, 20))):
        pass
    found, passage = search.widest_path()
    assert found == pytest.approx(naive.widest(np.where(clearance > least, clearance, 0), start, targets), abs=1e-9)
    if found == 0:
        assert len(passage) == 0
        return
    rows, columns = np.divmod(passage, shape[1])
    assert (rows[0], columns[0]) == start
    assert (rows[-1], columns[-1]) in targets
    assert (np.abs(np.diff(rows)) + np.abs(np.diff(columns)) == 1).all()
    assert clearance[rows, columns].min() == pytest.approx(found, abs=1e-9)


def crowded_problem(rng):
    """Two of the places with most room in a crowded map, and a vehicle that hardly fits in there."""
    kind = rng.integers(4)
    map = (boxes_grid(rng, boxes=50, unknown=kind == 0) if kind < 2
           else holed_polygons(rng, "circles" if kind == 2 else "boxes", count=40))
    corners, clearance = map.corners(), naive_clearance(map)
    points = corners[0] + rng.random((500, 2)) @ (corners[[1, 3]] - corners[0])
    start, goal = points[rng.choice(np.argsort(clearance(points))[-60:], 2, replace=False)]
    radius = float(rng.uniform(0.6, 1.0) * clearance(np.array([start, goal])).min()) - CLEARANCE_MARGIN
    tolerance = float(rng.choice([0.0, 0.2]))
    return Problem(map, Vehicle(0.5, radius), (*start.tolist(), 0.0), (*goal.tolist(), 0.0), goal_tolerance_xy=tolerance)


@pytest.mark.slow
def test_the_widest_passage_is_as_wide_as_it_says_and_hardly_narrower_than_any():
    """By shapely, on grids and polygons: what is left of the free space when its edge is moved inwards."""
    rng = np.random.default_rng(5)
    narrow = 0
    for _ in range(40 if SCALE == 1 else 8):
        problem = crowded_problem(rng)
        field = ClearanceField(problem.map)
        spacing = sample_spacing(problem.map, field)
        passage = widest_passage(problem, field)
        if passage is None:
            assert not are_connected(problem, 2 * spacing)
            continue
        assert are_connected(problem, (1 - 1e-4) * passage.radius)
        assert field.at(passage.points).min() >= passage.radius
        assert tuple(passage.points[0]) == problem.start[:2]
        assert math.dist(passage.points[-1], problem.goal[:2]) <= problem.goal_tolerance_xy + 1e-9
        if passage.radius < problem.vehicle.robot_radius:
            assert not are_connected(problem, passage.radius + 3 * spacing)
            narrow += 1
    assert narrow > 3


@pytest.mark.slow
def test_random_problems_have_true_reasons():
    """What is refused before the search cannot be solved, by shapely."""
    rng = np.random.default_rng(11)
    seen = set()
    for seed in range(50 if SCALE == 1 else 20):
        problem = crowded_problem(rng)
        if seed % 2:
            corners = problem.map.corners()
            anywhere = corners[0] + rng.uniform(-0.1, 1.1, 2) @ (corners[[1, 3]] - corners[0])
            problem = replace(problem, goal=(*anywhere.tolist(), 0.0))
        clearance = naive_clearance(problem.map)
        field = ClearanceField(problem.map, problem.allow_unknown)
        reason = before_search(problem, field)
        if reason is None:
            continue
        seen.add(reason.status)
        need = problem.vehicle.robot_radius + CLEARANCE_MARGIN
        if reason.status in (Status.START_OCCUPIED, Status.START_OUTSIDE_MAP):
            assert clearance(np.array([problem.start[:2]]))[0] < need
        elif reason.status in (Status.GOAL_OCCUPIED, Status.GOAL_OUTSIDE_MAP):
            assert clearance(np.array([problem.goal[:2]]))[0] < need
            room = shapely.buffer(free_space(problem.map, problem.allow_unknown), -need)
            assert room.is_empty or room.distance(shapely.Point(problem.goal[:2])) > problem.goal_tolerance_xy - 1e-4
        else:
            assert are_separated(problem, field)
            assert not are_connected(problem, need)
            check_claimed_radius(problem, reason.message)
    assert seen >= {Status.GOAL_OCCUPIED, Status.GOAL_OUTSIDE_MAP, Status.NO_VALID_PATH}


def check_claimed_radius(problem, message):
    """A radius that would do does, and unknown space that is blamed is to blame."""
    if found := re.search(r"with radius ([\d.]+) m instead", message):
        assert 0 < float(found[1]) < problem.vehicle.robot_radius
        assert are_connected(problem, float(found[1]))
    if "unknown space separates" in message:
        assert are_connected(replace(problem, allow_unknown=True), problem.vehicle.robot_radius)
    if "no robot_radius" in message:
        assert not are_connected(problem, 1e-4)


@needs_compiled
def test_the_time_is_looked_at_before_the_clearance_at_many_points_is_measured():
    """Where a map has many edges that takes long; the passage here is found at some thousand points."""
    class Field(ClearanceField):
        most = 0

        def at(self, points):
            self.most = max(self.most, np.asarray(points).size // 2)
            return super().at(points)

    walls = [shapely.box(2 * i, 10 * (i % 2), 2 * i + 1, 30 + 10 * (i % 2)) for i in range(1, 20)]
    world_map = PolygonMap(shapely.box(0, 0, 41, 40).difference(shapely.union_all(walls)))
    looks, field = [], Field(world_map)
    passage = widest_passage(Problem(world_map, Vehicle(1.0, 0.2), (1.0, 1.0, 1.0), (40.0, 1.0, -1.0)), field,
                             lambda: looks.append(field.most))
    assert passage.radius > 0.2 and len(looks) > 20
    assert field.most <= AT_ONCE
