"""Functions of the user's: a sampler, and a test for further obstacles, which holds along every path that is returned."""

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from support.cases import needs_compiled, scaled

from dubins_rrt_ros.planning import (
    HookError,
    PolygonMap,
    Problem,
    Settings,
    Status,
    Vehicle,
    audit_path,
    plan,
    plan_through,
    prepare,
)
from dubins_rrt_ros.planning.hooks import name_of
from dubins_rrt_ros.planning.plan_file import PlanFileError, read_request, to_document

HALL = PolygonMap(shapely.box(0, 0, 12, 8))
VEHICLE = Vehicle(turning_radius=1.0, robot_radius=0.2)
START, GOAL = (1.0, 4.0, 0.0), (11.0, 4.0, 0.0)
CAR = Vehicle(turning_radius=1.0, footprint=((0.6, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.6, -0.2)))


def off_the_disc(poses):
    """An obstacle in the middle of the hall."""
    return np.hypot(poses[:, 0] - 6.0, poses[:, 1] - 4.2) > 1.5


def never_backward(poses):
    """A one-way street: headings to the left are refused in the lower half."""
    return (poses[:, 1] > 3.0) | (np.cos(poses[:, 2]) > -0.5)


def everywhere(poses):
    return np.ones(len(poses), bool)


def nowhere_between(poses):
    """A wall that the map does not have."""
    return np.abs(poses[:, 0] - 6.0) > 0.3


def upper_half(rng, count):
    return np.column_stack([rng.uniform(0, 12, count), rng.uniform(4, 8, count), rng.uniform(-np.pi, np.pi, count)])


def problem(is_free=off_the_disc, vehicle=VEHICLE, **more):
    return Problem(HALL, vehicle, START, GOAL, is_free=is_free, **more)


def settings(**more):
    return Settings(**{"samples": scaled(600, least=60), "planning_time": 60.0, "seed": 3} | more)


@pytest.mark.parametrize("more", [
    {"planner": "rrt"}, {"informed": False, "shortcut": False}, pytest.param({}, marks=needs_compiled),
    pytest.param({"step_size": 0.7}, marks=needs_compiled),
    pytest.param({"preferred_clearance": 0.4, "samples": 200}, marks=needs_compiled),
], ids=str)
def test_the_test_holds_along_the_path(more):
    result = plan(problem(), settings(**more))
    assert result.solved, result.message
    assert result.audit.ok
    assert off_the_disc(result.poses()).all()
    assert off_the_disc(result.path.poses(problem().fine_spacing)).all()
    assert "is_free was asked every 0.05 m along it, and not between" in result.message
    without = plan(problem(None), settings())
    assert without.length == pytest.approx(10.0)
    assert result.length > without.length + 0.1
    if more.get("shortcut", True):  # nearly as short as around the same obstacle in the map
        in_map = PolygonMap(HALL.free - shapely.Point(6.0, 4.2).buffer(1.5 - VEHICLE.robot_radius))
        assert result.cost < 1.02 * plan(Problem(in_map, VEHICLE, START, GOAL), settings(**more)).cost


def test_it_holds_for_a_footprint_and_a_heading():
    result = plan(problem(never_backward, CAR, any_goal_heading=True), settings())
    assert result.solved, result.message
    assert never_backward(result.poses()).all()


def test_a_test_that_refuses_nothing_changes_nothing():
    free, without = (plan(problem(is_free), settings()) for is_free in (everywhere, None))
    assert free.path == without.path
    assert np.array_equal(free.tree.poses, without.tree.poses)


@needs_compiled
def test_waypoints_and_a_seed_path():
    through = plan_through(problem(), [(6.0, 6.5)], settings(samples=scaled(100, least=10)))
    assert through.solved, through.message
    assert off_the_disc(through.poses()).all()
    again = plan(problem(), settings(samples=1), seed_path=through.path)
    assert again.solved and off_the_disc(again.poses()).all()


@needs_compiled
def test_a_start_that_is_too_near_to_a_wall_is_left_where_the_test_allows_it():
    near = Problem(HALL, VEHICLE, (1.0, 0.15, 0.0), GOAL, start_slack=0.1, is_free=off_the_disc)
    result = plan(near, settings())
    assert result.solved and result.start_too_near, result.message
    assert off_the_disc(result.poses()).all()
    assert plan(replace(near, is_free=lambda poses: poses[:, 0] > 2.0), settings()).status == Status.START_OCCUPIED


def test_one_world_serves_problems_with_and_without_a_test():
    world = prepare(HALL, VEHICLE)
    with_test = plan(Problem(world, start=START, goal=GOAL, is_free=off_the_disc), settings())
    assert with_test.length > 10.1
    assert plan(Problem(world, start=START, goal=GOAL), settings()).length == pytest.approx(10.0)
    assert with_test.problem.world is world


@pytest.mark.parametrize("place, status", [((1.0, 4.0), Status.START_OCCUPIED), ((11.0, 4.0), Status.GOAL_OCCUPIED)])
def test_an_end_that_is_refused_is_occupied(place, status):
    result = plan(problem(lambda poses: np.hypot(poses[:, 0] - place[0], poses[:, 1] - place[1]) > 0.5), settings())
    assert result.status == status
    assert "is_free refuses" in result.message


def test_nothing_is_proved_where_only_the_test_separates_start_and_goal():
    result = plan(problem(nowhere_between), settings(informed=False))
    assert result.status == Status.TIMEOUT
    assert "is_free was asked" in result.message and "refused" in result.message


def test_what_the_map_proves_is_proved_with_a_test_too():
    walled = PolygonMap(shapely.union_all([shapely.box(0, 0, 5, 8), shapely.box(6, 0, 12, 8)]))
    assert plan(Problem(walled, VEHICLE, START, GOAL, is_free=everywhere), settings()).status == Status.NO_VALID_PATH


def test_the_gap_is_that_of_the_map_and_not_called_proved():
    result = plan(problem(everywhere), settings(stop_gap=0.5))
    assert result.solved and "proved" not in result.message
    assert "proved" in plan(problem(None), settings(stop_gap=0.5)).message


def test_the_audit_asks_the_test_too():
    straight = plan(problem(None), settings())
    audit = audit_path(straight.path, problem())
    assert [finding for finding in audit.findings if "is_free refuses the path at" in finding] == list(audit.findings) != []


def test_samples_are_the_samplers():
    result = plan(problem(None), settings(sampler=upper_half, informed=False, shortcut=False, goal_bias=0.1))
    assert result.solved, result.message
    assert (result.tree.poses[:, 1] >= 4.0).all()
    again = plan(problem(None), settings(sampler=upper_half, informed=False, shortcut=False, goal_bias=0.1))
    assert again.path == result.path
    assert plan(problem(), settings(sampler=upper_half)).solved


def test_samples_may_lie_in_memory_in_any_way():
    plain = settings(informed=False, shortcut=False)
    expected = plan(problem(None), replace(plain, sampler=upper_half)).tree
    for stored in (np.asfortranarray, lambda poses: np.asarray(poses, ">f8"), lambda poses: np.repeat(poses, 2, axis=0)[::2]):
        tree = plan(problem(None), replace(plain, sampler=lambda rng, n, stored=stored: stored(upper_half(rng, n)))).tree
        assert (tree.poses == expected.poses).all()


def raises(poses):
    raise ZeroDivisionError("no such\nplace")


def interrupted(poses):
    raise KeyboardInterrupt


@pytest.mark.parametrize("is_free, sentence", [
    (raises, "is_free raised ZeroDivisionError: no such place"),
    (lambda poses: True, r"is_free gave an array of shape \(\) and type bool for 1 poses; it has to give an array of 1 bools"),
    (lambda poses: np.ones(len(poses)), "type float64"),
    (lambda poses: None, "type object"),
    (lambda poses: raises(poses) if (poses[:, 0] > 6).any() and len(poses) > 1 else everywhere(poses), "ZeroDivisionError"),
], ids=range(5))
def test_what_is_wrong_with_a_test_is_said_in_a_sentence(is_free, sentence):
    for call in (lambda: plan(problem(is_free), settings()), lambda: plan_through(problem(is_free), [(6.0, 2.0)], settings())):
        with pytest.raises(HookError, match=sentence) as error:
            call()
        assert "\n" not in str(error.value)


def test_an_interruption_is_passed_on():
    with pytest.raises(KeyboardInterrupt):
        plan(problem(interrupted), settings())


@pytest.mark.parametrize("sampler, sentence", [
    (lambda rng, count: np.zeros((count, 2)), r"sampler gave an array of shape \(512, 2\) and type float64 when asked for 512"),
    (lambda rng, count: np.full((count, 3), np.nan), "numbers that are not finite"),
    (lambda rng, count: [["x"] * 3] * count, "type <U1"),
    (lambda rng: None, "sampler raised TypeError"),
], ids=range(4))
def test_what_is_wrong_with_a_sampler_is_said_in_a_sentence(sampler, sentence):
    with pytest.raises(HookError, match=sentence):
        plan(problem(None), settings(sampler=sampler))


def test_what_is_no_function_is_refused_at_once():
    with pytest.raises(HookError, match="is_free is True; give a function"):
        problem(True)
    with pytest.raises(HookError, match="sampler is 'halton'"):
        settings(sampler="halton")


def test_a_file_has_the_names_and_is_planned_again_with_the_functions_alone():
    result = plan(problem(), settings(sampler=upper_half))
    document = json.loads(json.dumps(to_document(result, "hall.wkt")))
    assert document["is_free"] == name_of(off_the_disc)
    assert document["sampler"].endswith("test_hooks.upper_half")
    with pytest.raises(PlanFileError, match="planned with is_free '.*test_hooks.off_the_disc', a function, which no file holds"):
        read_request(document, HALL)
    with pytest.raises(PlanFileError, match="planned with sampler"):
        read_request(document, HALL, is_free=off_the_disc)
    again = plan(*read_request(document, HALL, is_free=off_the_disc, sampler=upper_half))
    assert again.path == result.path
