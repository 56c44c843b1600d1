"""A prepared world: what it shares, what it is the same as, and that problems take it."""

import gc
import pickle
import time
import weakref
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage
from support.cases import boxes_grid, holed_polygons, needs_compiled, scaled

from dubins_rrt_ros.planning import (
    GridMap,
    OptionError,
    Problem,
    Settings,
    Thresholds,
    Vehicle,
    World,
    audit_path,
    plan,
    prepare,
)
from dubins_rrt_ros.planning._kernels.components import label_components
from dubins_rrt_ros.planning.collision import clearance as clearance_module

SMALL, LARGE = Vehicle(0.5, 0.1), Vehicle(0.7, 0.4)
#: Time within which what runs beside a search has ended [s].
SOON = 10.0
QUICK = Settings(samples=100, planning_time=600.0, seed=1)


def world_of(make=boxes_grid, vehicle=SMALL, **options):
    return prepare(make(np.random.default_rng(5)), vehicle, **options)


def problem_in(world):
    """From the first free corner to the last."""
    corners = world.map.corners()
    start, goal = (corners[0] + share * (corners[2] - corners[0]) for share in (0.06, 0.94))
    return Problem(world, start=(*start, 0.8), goal=(*goal, 0.8))


def parts_of(world):
    """All that was computed, as arrays."""
    kernel = world.field.kernel
    names = ("field", "row_gap") if isinstance(world.map, GridMap) else ("field",)
    need = world.vehicle.inscribed_radius
    squares = world.field.free_squares(need)
    return [*(np.array(getattr(kernel, name)) for name in names), world.field.components(need), squares.is_free,
            np.array(squares.cells), np.array(kernel.resolution)]


def assert_same(found, expected):
    assert (found.map, found.vehicle, found.allow_unknown) == (expected.map, expected.vehicle, expected.allow_unknown)
    for part, other in zip(parts_of(found), parts_of(expected), strict=True):
        np.testing.assert_array_equal(part, other)


def changed_map(rng, grid):
    """The grid with some boxes of cells changed, or scattered ones; on another place or with another shape now and then."""
    data = grid.data.copy()
    if rng.random() < 0.2:
        data.flat[rng.integers(0, data.size, rng.integers(1, 100))] = rng.choice([0, 100, -1])
    for _ in range(rng.integers(4)):
        row, column = rng.integers(0, data.shape)
        height, width = rng.integers(1, 15, 2)
        data[row:row + height, column:column + width] = rng.choice([0, 100, -1])
    if rng.random() < 0.1:
        data = data[:-1]
    return GridMap(data, grid.resolution, rng.uniform(-3, 3, 3) if rng.random() < 0.2 else grid.origin)


@pytest.mark.parametrize("allow_unknown", [False, True])
def test_an_updated_world_is_the_world_of_the_new_map(allow_unknown):
    rng = np.random.default_rng(6)
    world = world_of(allow_unknown=allow_unknown)
    for _ in range(scaled(200, least=10)):
        before = world, parts_of(world)
        world = world.updated(changed_map(rng, world.map))
        assert_same(world, prepare(world.map, SMALL, allow_unknown))
        for part, kept in zip(parts_of(before[0]), before[1], strict=True):
            np.testing.assert_array_equal(part, kept)


@needs_compiled
def test_of_a_large_map_what_is_far_from_a_change_is_kept():
    """The columns between two changes are too many to be looked at together."""
    rng = np.random.default_rng(10)
    data = np.zeros((60, 700), np.int8)
    data[rng.integers(0, 60, 500), rng.integers(0, 700, 500)] = 100
    world = prepare(GridMap(data, 0.1), SMALL)
    for _ in range(30):
        data = world.map.data.copy()
        for column in rng.choice(690, rng.integers(1, 4)):
            data[rng.integers(60), column:column + 9] = rng.choice([0, 100])
        world = world.updated(GridMap(data, 0.1, percent=True))
        assert_same(world, prepare(world.map, SMALL))


def test_an_equal_map_shares_all(monkeypatch):
    world = world_of()
    calls = counted(monkeypatch, "grid_clearance", "free_squares")
    again = world.updated(GridMap(world.map.data.copy(), world.map.resolution, world.map.origin, "again"))
    assert (again.field, again.obstacles, again.map.name) == (world.field, world.obstacles, "again")
    assert calls == {"grid_clearance": 0, "free_squares": 0}
    other = GridMap(world.map.data, world.map.resolution, world.map.origin, thresholds=Thresholds(0, 100))
    assert world.updated(other).field is not world.field


@needs_compiled
@pytest.mark.parametrize("density", [0.0, 0.05, 0.4, 0.6, 0.9, 1.0])
def test_components_are_numbered_as_by_scipy_but_for_the_order(density):
    rng = np.random.default_rng(11)
    for shape in ((1, 1), (1, 40), (40, 1), (37, 53), (90, 64)):
        cells = (rng.random(shape) < density).astype(np.float32)
        labels = np.empty(shape, np.int32)
        count = label_components(cells, 0.5, labels)
        expected, expected_count = ndimage.label(cells, structure=np.ones((3, 3)))
        assert count == expected_count
        pairs = {*zip(labels.ravel().tolist(), expected.ravel().tolist(), strict=True)}
        assert len(pairs) == count + (not cells.all())
        firsts = [np.flatnonzero(labels == n + 1)[0] for n in range(count)]
        assert firsts == sorted(firsts)


def test_a_world_of_polygons_is_updated_as_a_whole():
    world = world_of(holed_polygons)
    other = holed_polygons(np.random.default_rng(8))
    assert_same(world.updated(other), prepare(other, SMALL))
    assert_same(world_of().updated(other), prepare(other, SMALL))
    grid = world_of()
    assert_same(world.updated(grid.map), grid)


def counted(monkeypatch, *names):
    """How often functions of the clearance field are called, by name."""
    calls = dict.fromkeys(names, 0)

    def count(name, function):
        def counting(*args):
            calls[name] += 1
            return function(*args)
        return counting

    for name in names:
        monkeypatch.setattr(clearance_module, name, count(name, getattr(clearance_module, name)))
    return calls


def test_two_vehicles_on_one_map_prepare_once_each(monkeypatch):
    calls = counted(monkeypatch, "grid_clearance", "free_squares")
    small = world_of()
    large = small.for_vehicle(LARGE)
    for _ in range(3):
        for world in (small, large):
            assert plan(problem_in(world), QUICK).problem.vehicle == world.vehicle
    assert calls == {"grid_clearance": 1, "free_squares": 2}
    assert_same(large, prepare(small.map, LARGE))
    assert_same(small, prepare(small.map, SMALL))


@needs_compiled
@pytest.mark.parametrize("make", [boxes_grid, holed_polygons])
def test_what_the_room_of_a_footprint_needs_is_prepared(make, monkeypatch):
    """On a map of nine million cells it took 0.14 s of a request for 0.05 s."""
    calls = counted(monkeypatch, "CornerIndex")
    world = world_of(make, Vehicle(0.5, footprint=((0.2, -0.1), (0.2, 0.1), (-0.1, 0.1), (-0.1, -0.1))))
    assert calls == {"CornerIndex": 1}
    plan(problem_in(world), replace(QUICK, preferred_clearance=0.2))
    assert calls == {"CornerIndex": 1}


def test_a_vehicle_that_takes_as_much_room_shares_all(monkeypatch):
    small = world_of()
    calls = counted(monkeypatch, "grid_clearance", "free_squares")
    turning = small.for_vehicle(replace(SMALL, turning_radius=2.0))
    assert turning.vehicle.turning_radius == 2.0
    assert turning.field.kernel is small.field.kernel
    assert calls == {"grid_clearance": 0, "free_squares": 0}


@pytest.mark.parametrize("make", [boxes_grid, holed_polygons])
def test_in_its_world_a_problem_is_planned_as_on_its_map(make):
    problem = problem_in(world_of(make))
    bare = Problem(problem.map, problem.vehicle, problem.start, problem.goal)
    assert bare.world is None
    found, expected = plan(problem, QUICK), plan(bare, QUICK)
    assert found.path == expected.path
    assert found.tree.poses.tobytes() == expected.tree.poses.tobytes()
    if found.path:
        assert audit_path(found.path, bare) == audit_path(found.path, problem, problem.world.obstacles)


@pytest.mark.parametrize("make", [boxes_grid, holed_polygons])
def test_a_world_goes_without_what_was_computed_when_it_is_pickled(make):
    world = world_of(make)
    pickled = pickle.dumps(problem_in(world))
    assert len(pickled) < len(pickle.dumps(world.map)) + 2000
    again = pickle.loads(pickled)
    assert isinstance(again.world, World)
    assert again.world.map is again.map
    for part, other in zip(parts_of(again.world), parts_of(world), strict=True):
        np.testing.assert_array_equal(part, other)
    assert plan(again, QUICK).path == plan(problem_in(world), QUICK).path


@needs_compiled
@pytest.mark.parametrize("make", [boxes_grid, holed_polygons])
def test_a_plan_that_is_pickled_is_the_same_and_its_problem_plans_the_same(make):
    answer = plan(problem_in(world_of(make)), QUICK)
    again = pickle.loads(pickle.dumps(answer))
    again.check()
    assert (again.status, again.path, again.message) == (answer.status, answer.path, answer.message)
    for tree in (again.tree, pickle.loads(pickle.dumps(answer.tree)), plan(again.problem, again.settings).tree):
        assert tree.poses.tobytes() == answer.tree.poses.tobytes() and tree.costs.tobytes() == answer.tree.costs.tobytes()



@pytest.mark.parametrize("make", [boxes_grid, holed_polygons])
def test_a_world_is_let_go(make):
    world = world_of(make)
    updated = world.updated(boxes_grid(np.random.default_rng(7)))
    plan(problem_in(world), QUICK)
    seen = weakref.ref(world), weakref.ref(world.map)
    del world
    end = time.monotonic() + SOON

    def is_let_go():
        gc.collect()
        return [reference() for reference in seen] == [None, None]

    while not is_let_go():  # by the proof beside the search, too, which ends when it notices
        assert time.monotonic() < end
        time.sleep(0.01)
    assert updated.map is not None


def test_a_problem_takes_map_vehicle_and_unknown_space_from_its_world():
    world = world_of(allow_unknown=True)
    problem = problem_in(world)
    assert (problem.map, problem.vehicle, problem.allow_unknown, problem.world) == (world.map, SMALL, True, world)
    moved = replace(problem, start=(0.0, 0.0, 0.0))
    assert moved.world is world


@pytest.mark.parametrize("changes", [
    {"map": boxes_grid(np.random.default_rng(9))}, {"vehicle": LARGE}, {"allow_unknown": True},
])
def test_a_problem_of_something_else_has_no_world(changes):
    assert replace(problem_in(world_of()), **changes).world is None


def test_a_world_for_another_vehicle_or_use_of_unknown_space_is_refused():
    ends = {"start": (0.0, 0.0, 0.0), "goal": (1.0, 1.0, 0.0)}
    with pytest.raises(OptionError, match=r"world.for_vehicle"):
        Problem(world_of(), LARGE, **ends)
    with pytest.raises(OptionError, match="allow_unknown=True"):
        Problem(world_of(), allow_unknown=True, **ends)
    assert Problem(world_of(), SMALL, **ends).vehicle == SMALL


def test_a_map_without_a_vehicle_is_refused():
    with pytest.raises(TypeError, match="give a Vehicle, or a World"):
        Problem(world_of().map, start=(0.0, 0.0, 0.0), goal=(1.0, 1.0, 0.0))
