"""Short arcs, which are flicks of the wheel, are merged at the end where there is room, and empty curves are left out."""

import numpy as np
import pytest
from support.cases import needs_compiled, scaled

from dubins_rrt_ros.planning import ClearanceField, GridMap, Problem, Settings, Vehicle, audit_path, load_map, plan
from dubins_rrt_ros.planning.curves.dubins import DubinsCurve
from dubins_rrt_ros.planning.curves.path import Path
from dubins_rrt_ros.planning.search.cost import Objective
from dubins_rrt_ros.planning.search.short_arcs import MOST_LONGER, merge_short_arcs, short_arcs
from dubins_rrt_ros.planning.work import Work

ROOM = GridMap(np.zeros((120, 120), np.int8), 0.1)
START = (1.0, 2.0, 0.0)
#: In the forest.
ENDS = (1.2, 1.2, 0.79), (18.8, 16.8, 0.79)


def path_of(*arcs, radius=1.0, start=START):
    """A path of words and lengths, each a curve."""
    curves = []
    for word, lengths in arcs:
        curves.append(DubinsCurve(start, radius, word, lengths))
        start = curves[-1].end
    return Path.of_curves(curves[0].start, start, curves)


def with_a_flick(radius=1.0):
    """A turn, a straight, a flick, a straight and a turn."""
    r = radius
    return path_of(("LSL", (0.4 * r, 2.0 * r, 0.003 * r)), ("LSR", (0.002 * r, 1.5 * r, 0.3 * r)), radius=r)


def checked(path, vehicle, world_map, **options):
    """The path without its short arcs, judged."""
    merged = merge_short_arcs(path, Objective(vehicle, ClearanceField(world_map)), 1, **options)
    assert (merged.start, merged.end, merged.radius) == (path.start, path.end, path.radius)
    assert merged.length <= path.length + MOST_LONGER
    assert audit_path(merged, Problem(world_map, vehicle, path.start, path.end)).ok
    merged.check()
    assert all(curve.length > 0 for curve in merged.curves)
    return merged


def test_a_short_arc_is_one_between_two_others_even_across_curves():
    path = with_a_flick()
    assert short_arcs(path) == [(pytest.approx(2.4), pytest.approx(2.405))]
    assert short_arcs(path_of(("LSL", (0.001, 2.0, 0.4)), ("LSR", (0.3, 1.0, 0.001)))) == []
    assert len(short_arcs(path_of(("LSR", (0.4, 0.019, 0.4))))) == 1
    assert short_arcs(path_of(("LSR", (0.4, 0.021, 0.4)))) == []


def test_they_are_merged_where_there_is_room():
    path = with_a_flick()
    merged = checked(path, Vehicle(1.0, 0.2), ROOM)
    assert short_arcs(merged) == []
    assert merged == checked(path, Vehicle(1.0, 0.2), ROOM)


def test_they_are_merged_for_a_footprint():
    vehicle = Vehicle(1.0, footprint=[(0.6, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.6, -0.2)])
    assert short_arcs(checked(with_a_flick(), vehicle, ROOM)) == []


def test_they_stay_where_there_is_no_room():
    """A corridor with a bend that leaves the vehicle a tenth of a millimetre all along."""
    path = with_a_flick()
    cells = np.zeros((1200, 1200), np.int8)
    rows, columns = np.mgrid[0:1200, 0:1200]
    driven = path.poses(0.002)[:, :2]
    near = np.zeros(cells.shape, bool)
    for x, y in driven:
        low_row, low_column = int(y * 100) - 30, int(x * 100) - 30
        window = np.s_[low_row:low_row + 60, low_column:low_column + 60]
        centre_x, centre_y = (columns[window] + 0.5) / 100, (rows[window] + 0.5) / 100
        near[window] |= np.hypot(centre_x - x, centre_y - y) < 0.21
    cells[~near] = 100
    tight = GridMap(cells, 0.01)
    least = audit_path(path, Problem(tight, Vehicle(1.0, 0.1), path.start, path.end)).min_clearance
    merged = checked(path, Vehicle(1.0, least - 2e-4), tight)
    assert len(short_arcs(merged)) == 1 and merged.length == pytest.approx(path.length, abs=1e-9)


def test_paths_of_tiny_turning_radii_stay_as_they_are():
    path = with_a_flick(0.04)
    assert merge_short_arcs(path, Objective(Vehicle(0.04, 0.2), ClearanceField(ROOM)), 1) is path


def test_an_interruption_leaves_them():
    path = with_a_flick()
    assert checked(path, Vehicle(1.0, 0.2), ROOM, work=Work(lambda: True)) == path


def test_empty_curves_are_left_out_and_the_ends_stay():
    empty = ("LSL", (0.0, 0.0, 0.0))
    curve = ("LSR", (0.4, 2.0, 0.4))
    merged = checked(path_of(empty, curve, empty, ("RSL", (0.3, 1.0, 0.3)), empty), Vehicle(1.0, 0.2), ROOM)
    assert merged == path_of(curve, ("RSL", (0.3, 1.0, 0.3)))
    alone = path_of(empty)
    assert merge_short_arcs(alone, Objective(Vehicle(1.0, 0.2), ClearanceField(ROOM)), 1) == alone


@needs_compiled
@pytest.mark.parametrize("options", [{"planner": "rrt"}, {"planner": "rrt_star"}, {"preferred_clearance": -1.0}])
def test_plans_have_none_and_hold_their_invariants(options):
    forest = load_map("forest")
    for seed in range(3):
        answer = plan(Problem(forest, Vehicle(1.0, 0.2), *ENDS), Settings(seed=seed, planning_time=60.0, **options))
        answer.check()
        assert answer.solved, answer.message
        assert short_arcs(answer.path) == [] and all(curve.length > 0 for curve in answer.path.curves)


@needs_compiled
def test_paths_that_are_not_smoothed_keep_theirs():
    forest = load_map("forest")
    problem = Problem(forest, Vehicle(1.0, 0.2), *ENDS)
    plain = [plan(problem, Settings(shortcut=False, step_size=0.5, seed=seed, planning_time=60.0)) for seed in range(3)]
    assert any(short_arcs(answer.path) for answer in plain if answer.path)


@pytest.mark.parametrize("preferred", [0.0, 0.3])
def test_the_longest_edge_is_kept_by_what_merges_and_simplifies(preferred):
    """Also in the tree, which holds the path."""
    problem = Problem(load_map("maze"), Vehicle(), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))
    settings = Settings(seed=1, samples=scaled(400), step_size=0.4, planning_time=60.0, preferred_clearance=preferred)
    result = plan(problem, settings)
    result.check()
    assert result.path.lengths.sum(axis=1).max() <= 0.4 * (1 + 1e-9)
    assert result.tree.lengths.sum(axis=1).max() <= 0.4 * (1 + 1e-9)
