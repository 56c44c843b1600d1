"""RRT and RRT* as searches: what they draw, what they keep, and that a seed determines all of it."""

import math

import numpy as np
import pytest
from cases import SCALE, boxes_grid, empty_map, holed_polygons, needs_compiled, scaled

from dubins_rrt_ros.planning import ClearanceField, Problem, Settings, Vehicle, load_map, rrt
from dubins_rrt_ros.planning.dubins import shortest
from dubins_rrt_ros.planning.rrt import Search
from dubins_rrt_ros.planning.sampling import Sampler
from dubins_rrt_ros.share import maps_directory

ARRAYS = ("poses", "parents", "costs", "words", "lengths")


@pytest.fixture(scope="module")
def maze():
    return Problem(load_map(maps_directory() / "maze.yaml"), Vehicle(), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))


def searched(problem, **options):
    """A finished search, with the best length after every batch."""
    search = Search(problem, Settings(**{"seed": 1, "samples": scaled(1500), **options}),
                    ClearanceField.of(problem.map, problem.allow_unknown))
    lengths = []
    while not search.done:
        search.grow()
        search.shorten(search.done)
        lengths.append(math.inf if search.length is None else search.length)
    return search, lengths


def open_field(**options):
    return Problem(empty_map(), Vehicle(0.5, 0.2), (-8, -8, 0), (8, 8, 1), **options)


def contents(search):
    path = search.path.poses(0.1) if search.path else np.empty(0)
    return [*(getattr(search.tree, name).tobytes() for name in ARRAYS), path.tobytes()]


def test_rrt_ends_with_its_first_path():
    search, lengths = searched(open_field(), planner="rrt", shortcut=False)
    assert search.samples < scaled(1500)
    assert sum(map(math.isfinite, lengths)) == 1
    assert search.length == search.tree.costs[search.best] == lengths[-1]
    assert search.best == len(search.tree) - 1
    assert tuple(search.tree.poses[search.best]) == (8, 8, 1)


@pytest.mark.parametrize("seed", range(3))
def test_rrt_star_never_gets_worse_and_uses_its_budget(maze, seed):
    search, lengths = searched(maze, seed=seed, shortcut=False)
    assert search.samples == scaled(1500)
    assert (np.diff(np.array(lengths)[np.isfinite(lengths)]) <= 0).all()
    if SCALE == 1:
        assert lengths[-1] < next(length for length in lengths if length < math.inf)


def test_rrt_star_finds_the_dubins_curve_on_an_open_field():
    problem = open_field()
    search, _ = searched(problem, samples=scaled(2000, least=200))
    assert search.length == pytest.approx(shortest(problem.start, problem.goal, 0.5).length, rel=1e-12)


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
@pytest.mark.parametrize("samples", [1, 2, 7, 255, 256, 257, 300])
def test_the_budget_is_met_exactly(planner, samples):
    search, _ = searched(open_field(), planner=planner, samples=samples, goal_bias=0.0)
    assert search.samples == samples
    assert search.best == -1


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
@pytest.mark.parametrize("kind", ["maze", "polygons"])
def test_a_seed_determines_every_byte(planner, kind, maze, monkeypatch):
    problem = maze
    if kind == "polygons":
        map = holed_polygons(np.random.default_rng(1), count=3)
        problem = Problem(map, Vehicle(0.4, 0.1), (0.5, 0.5, 1), (9, 9, 1))
    once, _ = searched(problem, planner=planner)
    again, _ = searched(problem, planner=planner)
    assert contents(once) == contents(again)
    for batch_time in (1e-9, 1.0):
        monkeypatch.setattr(rrt, "BATCH_TIME", batch_time)
        other, _ = searched(problem, planner=planner)
        assert contents(other) == contents(once)
        assert (other.best, other.samples) == (once.best, once.samples)
    different, _ = searched(problem, planner=planner, seed=2)
    assert contents(different) != contents(once)


def test_rrt_shortens_its_one_path():
    plain, _ = searched(open_field(), planner="rrt", shortcut=False)
    search, lengths = searched(open_field(), planner="rrt")
    assert contents(search)[:-1] == contents(plain)[:-1]
    assert search.path.length == search.length == min(lengths) < plain.length


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_shortcuts_leave_the_tree_as_it_is(planner, maze):
    search, _ = searched(maze, planner=planner, informed=False)
    plain, _ = searched(maze, planner=planner, informed=False, shortcut=False)
    assert contents(search)[:-1] == contents(plain)[:-1]
    if plain.path:
        assert plain.path == plain.tree.path_to(plain.best)
        assert search.length == search.path.length <= plain.length == plain.path.length


@needs_compiled
def test_informed_samples_give_shorter_paths():
    """About half as far above the shortest."""
    least = shortest((-8, -8, 0), (8, 8, 1), 0.5).length
    above = {informed: np.mean([
        searched(open_field(), seed=seed, step_size=2.0, informed=informed, shortcut=False)[0].length - least
        for seed in range(5)]) for informed in (True, False)}
    assert above[True] < 0.7 * above[False]


def test_a_smaller_budget_is_the_beginning_of_a_larger_one(maze, monkeypatch):
    """So a plan that was cut short can be had again with the samples that it took."""
    monkeypatch.setattr(rrt, "BATCH_TIME", 1e-9)  # batches of one sample
    count = scaled(700)
    part, _ = searched(maze, samples=count)
    whole = Search(maze, Settings(samples=10 * count, seed=1), ClearanceField.of(maze.map))
    while whole.samples < count:
        whole.grow()
        whole.shorten(whole.samples == count)
    assert whole.samples == count
    assert contents(whole) == contents(part)


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_no_new_edge_is_longer_than_the_step(planner):
    search, _ = searched(open_field(), planner=planner, step_size=0.8, samples=scaled(3000, least=400))
    tree = search.tree
    assert len(tree) > 50
    assert tree.lengths.sum(axis=1).max() <= 0.8 + 1e-12


def test_without_a_step_size_edges_are_long():
    search, _ = searched(open_field(), planner="rrt", goal_bias=0, samples=scaled(300, least=50))
    assert search.tree.lengths.sum(axis=1).max() > 3


def drawn(problem, count=2000, **options):
    return Sampler(problem, Settings(seed=1, **options), ClearanceField.of(problem.map)).draw(count)


def test_samples_are_uniform():
    poses = drawn(open_field(), 40_000, goal_bias=0)
    for values, low, high in [(poses[:, 0], -10, 10), (poses[:, 1], -10, 10), (poses[:, 2], -math.pi, math.pi)]:
        assert low <= values.min() <= values.max() <= high
        counts, _ = np.histogram(values, bins=8, range=(low, high))
        # 5000 per bin; cells at the map's edge cannot be free, so the outer bins may have a tenth less.
        assert (np.abs(counts / 5000 - 1) < 0.15).all()


def test_samples_lie_in_the_turned_map():
    rng = np.random.default_rng(2)
    grid = boxes_grid(rng, boxes=0)
    centre = grid.corners().mean(axis=0)
    points = grid.to_grid_frame(drawn(Problem(grid, Vehicle(), (*centre, 0), (*centre, 1)), goal_bias=0)[:, :2])
    assert (points >= 0).all()
    assert (points <= grid.size).all()
    assert (np.ptp(points, axis=0) > 0.9 * np.array(grid.size)).all()


def test_headings_towards_the_goal():
    poses = drawn(open_field(), heading_sampling="goal", goal_bias=0)
    towards = np.arctan2(8 - poses[:, 1], 8 - poses[:, 0])
    np.testing.assert_allclose(poses[:, 2], towards, atol=1e-12)
    search, _ = searched(open_field(), heading_sampling="goal", goal_bias=0, samples=scaled(400, least=50))
    nodes = search.tree.poses[1:]
    assert len(nodes) > 5
    np.testing.assert_allclose(nodes[:, 2], np.arctan2(8 - nodes[:, 1], 8 - nodes[:, 0]), atol=1e-12)


@pytest.mark.parametrize("bias", [0.0, 0.1, 0.5, 1.0])
def test_goal_bias_is_the_share_at_the_goal(bias):
    poses = drawn(open_field(), 10_000, goal_bias=bias)
    share = (poses == (8, 8, 1)).all(axis=1).mean()
    assert share == pytest.approx(bias, abs=0.02 if 0 < bias < 1 else 0)


def test_samples_at_a_goal_with_tolerance_fill_it():
    problem = open_field(goal_tolerance_xy=0.5, goal_tolerance_yaw=0.2)
    poses = drawn(problem, 4000, goal_bias=1.0)
    off = np.hypot(*(poses[:, :2] - (8, 8)).T)
    assert off.max() <= 0.5
    assert (off < 0.25).mean() == pytest.approx(0.25, abs=0.05)
    assert 0.19 < np.abs(poses[:, 2] - 1).max() <= 0.2
    turned = drawn(open_field(any_goal_heading=True), 4000, goal_bias=1.0)
    assert (turned[:, :2] == (8, 8)).all()
    assert np.ptp(turned[:, 2]) > 6


def test_with_nothing_but_the_goal_drawn_the_tree_is_one_edge():
    for planner in ("rrt", "rrt_star"):
        search, _ = searched(open_field(), planner=planner, goal_bias=1.0, samples=50)
        assert len(search.tree) == 2
        assert search.samples == (1 if planner == "rrt" else 50)
        assert search.length == search.tree.costs[1]


def test_with_nothing_but_the_goal_drawn_and_a_step_the_tree_is_a_line_of_steps():
    for planner in ("rrt", "rrt_star"):
        search, _ = searched(open_field(), planner=planner, goal_bias=1.0, step_size=5.0, samples=50)
        tree = search.tree
        assert search.best == len(tree) - 1 > 3
        np.testing.assert_allclose(tree.lengths.sum(axis=1)[1:-1], 5.0)


def test_the_best_node_is_the_cheapest_within_the_tolerance():
    problem = open_field(goal_tolerance_xy=1.0, goal_tolerance_yaw=0.5)
    search, _ = searched(problem, shortcut=False)
    tree = search.tree
    within = (np.hypot(*(tree.poses[:, :2] - (8, 8)).T) <= 1) & (np.abs(tree.poses[:, 2] - 1) <= 0.5)
    assert within[search.best]
    assert search.length == tree.costs[within].min()
