"""RRT and RRT* as searches, mostly the plain algorithms: what they draw and what they keep."""

import math

import numpy as np
import pytest
from support.cases import SCALE, boxes_grid, contents, empty_map, field_of, finish, needs_compiled, scaled, search_on, steps_of

from dubins_rrt_ros.planning import GridMap, Problem, Settings, Vehicle, load_map
from dubins_rrt_ros.planning.curves.dubins import shortest
from dubins_rrt_ros.planning.maps.locate import maps_directory
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.rrt import BLOCK, Search
from dubins_rrt_ros.planning.search.sampling import Sampler

PLAIN = {"informed": False, "shortcut": False, "heading_sampling": "uniform"}


@pytest.fixture(scope="module")
def maze():
    return Problem(load_map(maps_directory() / "maze.yaml"), Vehicle(), (1.5, 2.0, 1.57), (13.5, 10.5, 1.57))


def searched(problem, **options):
    """A finished search, of the plain algorithm unless the options say otherwise, with the best length after every batch."""
    search, lengths = search_on(problem, Settings(**{"seed": 1, "samples": scaled(1500), **PLAIN, **options})), []
    for _ in steps_of(search):
        lengths.append(math.inf if search.length is None else search.length)
    return search, lengths


def open_field(**options):
    return Problem(empty_map(), Vehicle(0.5, 0.2), (-8, -8, 0), (8, 8, 1), **options)


def test_rrt_ends_with_its_first_path():
    search, lengths = searched(open_field(), planner="rrt")
    assert search.samples < scaled(1500)
    assert sum(map(math.isfinite, lengths)) >= 1
    assert search.length == search.tree.costs[search.best] == lengths[-1]
    assert search.best == len(search.tree) - 1
    assert tuple(search.tree.poses[search.best]) == (8, 8, 1)


@pytest.mark.parametrize("seed", range(3))
def test_rrt_star_never_gets_worse_and_uses_its_budget(maze, seed):
    search, lengths = searched(maze, seed=seed)
    assert search.samples == scaled(1500)
    assert (np.diff(np.array(lengths)[np.isfinite(lengths)]) <= 0).all()
    if SCALE == 1:
        assert lengths[-1] < next(length for length in lengths if length < math.inf)


@pytest.mark.parametrize("shortcut", [False, True])
@pytest.mark.parametrize("informed", [False, True])
def test_rrt_star_finds_the_dubins_curve_on_an_open_field(informed, shortcut):
    problem = open_field()
    search, _ = searched(problem, samples=scaled(2000, least=200), informed=informed, shortcut=shortcut)
    # Without either the goal must be drawn while the start is among the nodes near it, or else the path only comes close.
    within = 1e-12 if informed or shortcut else 0.02
    assert search.length == pytest.approx(shortest(problem.start, problem.goal, 0.5).length, rel=within)


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
@pytest.mark.parametrize("samples", [1, 2, 7, BLOCK - 1, BLOCK, BLOCK + 1, BLOCK + 44])
def test_the_budget_is_met_exactly(planner, samples):
    search, _ = searched(open_field(), planner=planner, samples=samples, goal_bias=0.0)
    assert search.samples == samples
    assert search.best == -1


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_the_plain_algorithm_needs_no_distances_to_the_goal(planner, maze):
    """What a search is given beyond field and settings changes nothing."""
    settings = Settings(planner=planner, seed=1, samples=scaled(1500), **PLAIN)
    without = Search(maze, settings, field_of(maze), None)
    assert contents(finish(without)) == contents(searched(maze, planner=planner)[0])


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_the_best_path_of_the_plain_algorithm_is_the_tree_s(planner, maze):
    search, _ = searched(maze, planner=planner, goal_bias=0.2)
    if SCALE == 1:
        assert search.best >= 0
    if search.best >= 0:
        assert search.path == search.tree.path_to(search.best)
        assert search.length == search.path.length


def test_rrt_smooths_its_one_path():
    """Its samples, and so its path, are those of the plain algorithm until then."""
    plain, _ = searched(open_field(), planner="rrt")
    search, lengths = searched(open_field(), planner="rrt", shortcut=True)
    assert search.samples == plain.samples
    assert search.path.length == pytest.approx(search.length)
    assert search.length == min(lengths) < plain.length
    np.testing.assert_array_equal(search.tree.poses[:plain.growing.size], plain.tree.poses)


@pytest.mark.slow
@needs_compiled
@pytest.mark.parametrize("shortcut", [False, True])
@pytest.mark.parametrize("informed", [False, True])
def test_what_goes_beyond_the_paper_gives_shorter_paths(informed, shortcut, maze):
    if not (informed or shortcut):
        return
    plain, better = ([searched(maze, seed=seed, goal_bias=0.2, **options)[0].length or math.inf for seed in range(5)]
                     for options in ({}, {"informed": informed, "shortcut": shortcut}))
    assert np.mean(better) < np.mean(plain) - 0.3
    assert max(better) < max(plain)


@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
def test_no_new_edge_is_longer_than_the_step(planner):
    search, _ = searched(open_field(), planner=planner, step_size=0.8, samples=scaled(3000, least=400))
    tree = search.tree
    assert len(tree) > 50
    assert tree.lengths.sum(axis=1).max() <= 0.8 + 1e-12


@needs_compiled
def test_steps_lead_to_the_goal_however_far_the_origin_is():
    """A pose that a step led to is rounded; what is left of the way must not come out a full circle longer for it."""
    found = []
    for x, y in ((0.0, 0.0), (4e5, 5e6)):
        problem = Problem(GridMap(np.zeros((40, 40)), 0.5, (x - 10, y - 10, 0)), Vehicle(0.5, 0.2),
                          (x - 8, y - 8, 0), (x + 8, y + 8, 1))
        searches = [searched(problem, planner="rrt", step_size=0.5, seed=seed, goal_bias=0.2)[0] for seed in range(10)]
        found.append([search.length for search in searches])
    assert found[1] == pytest.approx(found[0], abs=1e-4)


def test_without_a_step_size_edges_are_long():
    search, _ = searched(open_field(), planner="rrt", goal_bias=0, samples=scaled(300, least=50))
    assert search.tree.lengths.sum(axis=1).max() > 3


def drawn(problem, count=2000, **options):
    field = field_of(problem)
    return Sampler(problem, Settings(seed=1, **{**PLAIN, **options}), field, CostToGo.to_goal(problem, field)).draw(count)


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
    search, _ = searched(problem)
    tree = search.tree
    within = (np.hypot(*(tree.poses[:, :2] - (8, 8)).T) <= 1) & (np.abs(tree.poses[:, 2] - 1) <= 0.5)
    assert within[search.best]
    assert search.length == tree.costs[within].min()
