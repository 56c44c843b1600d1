"""Starts that no arc leaves, goals that no arc reaches, and places too narrow to turn round in: proofs and guesses."""

import itertools
import math
import re

import numpy as np
import pytest
from support.cases import boxes_grid, empty_map, needs_compiled
from support.refusals import reasons_have_time, walls_with_a_gap, why  # noqa: F401 - a fixture

from dubins_rrt_ros.planning import ClearanceField, GridMap, Problem, Settings, Status, Vehicle, kernels_compiled, plan
from dubins_rrt_ros.planning.diagnosis.leaving import cannot_leave, room_to_turn
from dubins_rrt_ros.planning.diagnosis.widest_passage import widest_passage

GOAL = (8.0, 8.0, 1.0)


def facing_a_wall(distance):
    """A grid with a wall across, and a pose that faces it from so far."""
    data = np.zeros((40, 40))
    data[:, 22] = 100
    return GridMap(data, 0.5), (11.0 - distance, 10.0, 0.0)


def test_a_start_that_faces_a_wall():
    map, pose = facing_a_wall(0.8)
    result = why(Problem(map, Vehicle(1.0, 0.3), pose, (3.0, 3.0, 0.0)))
    # The tightest turn comes 0.5 m forward after an angle of asin(0.5), as far aside as it then is.
    within, y = math.asin(0.4995), 10 + 1 - math.cos(math.asin(0.4995))
    assert f"every forward arc from the start hits an obstacle within {math.ceil(100 * within) / 100} m, " in result.message
    assert result.message.endswith("move or turn the start, or check turning_radius (1 m).")
    assert result.location[0] == pytest.approx(11.0)
    assert abs(result.location[1] - 10) == pytest.approx(y - 10, abs=0.002)


@pytest.mark.parametrize("limits", [{"informed": False}, {"samples": 1_000_000, "planning_time": 0.02}])
def test_a_goal_with_its_back_to_a_wall(limits):
    map, (x, y, _) = facing_a_wall(0.8)
    result = why(Problem(map, Vehicle(1.0, 0.3), (3.0, 3.0, 0.0), (x, y, math.pi)), **limits)
    assert result.status == Status.NO_VALID_PATH
    assert ("No path exists: no forward arc reaches the goal: every one that ends there comes through an obstacle within the "
            "last 0.53 m, the longest at (11.00, ") in result.message
    assert "move or turn the goal" in result.message
    assert result.location[0] == pytest.approx(11.0)


def test_a_start_without_a_way_out_ends_at_once():
    """Long before its time; also behind a corner that no arc gets round."""
    map, pose = facing_a_wall(0.8)
    for problem in (Problem(map, Vehicle(1.0, 0.3), pose, (3.0, 3.0, 0.0)),
                    Problem(map, Vehicle(1.0, 0.3), (3.0, 3.0, 0.0), (*pose[:2], math.pi))):
        looks = itertools.count()
        result = plan(problem, Settings(seed=1, planning_time=600.0), cancel=lambda looks=looks: next(looks) > 2000)
        assert result.status == Status.NO_VALID_PATH and result.message.startswith("No path exists: ")


@needs_compiled
def test_what_drives_away_can_leave():
    """No proof is wrong: among obstacles all around, no path of a turning radius and more starts where none can."""
    rng, free, proofs = np.random.default_rng(7), 0, 0
    for number in range(60):
        grid = boxes_grid(np.random.default_rng(number), boxes=60)
        radius = float(rng.uniform(0.5, 3.0))
        corners = grid.corners()
        x, y = (corners[0] + rng.random(2) @ (corners[[1, 3]] - corners[0])).tolist()
        pose = (x, y, float(rng.uniform(-3, 3)))
        far = tuple((2 * corners[2] - corners[0]).tolist())
        problem = Problem(grid, Vehicle(radius, 0.1), pose, (*far, 0.0))
        field = ClearanceField(grid)
        turns = rng.choice([-1.0, 0.0, 1.0], (200, 4)).repeat(25, axis=1) / radius
        heading = pose[2] + np.cumsum(turns, axis=1) * math.pi / 2 * radius / 100
        step = math.pi / 2 * radius / 100 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        points = pose[:2] + np.cumsum(step, axis=1)
        leaves = (field.at(points).min(axis=1) > 0.1 + radius * 0.02).any() and field.at(np.array(pose[:2])) > 0.1
        trapped = cannot_leave(problem, field, pose)
        assert not (leaves and trapped)
        free, proofs = free + bool(leaves), proofs + trapped
    assert free > 2 and proofs > 2


def test_from_a_free_start_a_path_leads_whatever_the_last_bit_of_the_turning_radius():
    """Of some radii the square is less than their product with themselves: one of 2,200 had no path on any map."""
    grid = GridMap(np.zeros((60, 60)), 1.0)
    field = ClearanceField(grid)
    radii = [radius for radius in np.random.default_rng(0).uniform(0.05, 5.0, 20_000).tolist() if radius**2 < radius * radius]
    for radius in (0.07282727487922586, *radii):
        problem = Problem(grid, Vehicle(radius, 0.02), (30.0, 30.0, 0.0), (50.0, 50.0, 0.0))
        assert not cannot_leave(problem, field, problem.start), radius


def test_too_little_room_to_turn_round():
    """In a corridor from which both ends lead on; a place that is wide enough makes it no reason."""
    data = np.full((60, 400), 100, np.int8)
    data[18:42] = 0
    corridor = GridMap(data, 0.1)
    problem = Problem(corridor, Vehicle(1.5, 0.3), (20.0, 3.0, 0.0), (10.0, 3.0, math.pi))
    result = why(problem, informed=False)
    assert "no room to turn round: radius 1.5 m needs 3.60 m, the widest place that can be reached has 2." in result.message
    assert 2.2 < 2 * ClearanceField(corridor).at(np.array(result.location)) < 2.5
    straight_on = Problem(corridor, Vehicle(1.5, 0.3), (10.0, 3.0, 0.0), (20.0, 3.0, 0.0))
    assert room_to_turn(straight_on, ClearanceField(corridor), np.array([[10.0, 3.0], [15.0, 3.0], [20.0, 3.0]])) is None


@needs_compiled
def test_a_tunnel_with_a_centimetre_to_spare_is_not_called_too_narrow():
    """Askew to the cells, so that samples lie beside its middle."""
    along = np.array([math.cos(0.3), math.sin(0.3)])
    rows, columns = np.indices((400, 400))
    middles = (np.stack([columns, rows], axis=-1) + 0.5) * 0.05 - 10.0
    aside = np.abs(middles @ np.array([-along[1], along[0]]))
    grid = GridMap(np.where(aside > 0.6, 100, 0).astype(np.int8), 0.05, (-10.0, -10.0, 0.0))
    ends = [(*(distance * along).tolist(), 0.3) for distance in (-8.0, 8.0)]
    field = ClearanceField(grid)
    middle = np.linspace(-8, 8, 2000)[:, None] * along
    room = float(field.at(middle).min())
    assert widest_passage(Problem(grid, Vehicle(1.0, room - 0.01), *ends), field).radius >= room - 0.01


def test_arcs_that_end_at_the_edge_of_the_map():
    result = why(Problem(empty_map(), Vehicle(1.0, 0.3), (9.2, 0.0, 0.0), GOAL))
    assert "every forward arc from the start hits an obstacle within 0.53 m, the longest at (10.00, " in result.message


def test_a_free_start_and_goal_are_not_blamed():
    map, pose = facing_a_wall(1.31)
    problem = Problem(map, Vehicle(1.0, 0.3), pose, (3.0, 3.0, 0.0))
    assert "arc" not in plan(problem, Settings(samples=1, seed=1)).message
    # Beyond a gap that the disc fits through, but hardly any curve.
    hard = Problem(walls_with_a_gap(slice(20, 22)), Vehicle(9.0, 0.45), (-5.0, -8.0, math.pi / 2), (5.0, -8.0, -math.pi / 2))
    result = why(hard, informed=False)
    near = np.hypot(result.tree.poses[:, 0] - 5, result.tree.poses[:, 1] + 8).min()
    said = float(re.search(r"the tree came within ([\d.]+) m of the goal; allow more samples, or loosen the goal's tolerance\.$",
                           result.message)[1])
    assert near <= said <= near + 0.01
    assert f"60 of 60 samples drawn, {len(result.tree)} tree nodes, " in result.message
    assert result.location is None
    late = why(hard, samples=1_000_000, planning_time=1.5 if kernels_compiled else 3.0)
    assert "allow more time, or loosen the goal's tolerance" in late.message
