"""The tree: its invariants after every batch, and that check() finds every one that is broken."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support import naive
from support.cases import SCALE, boxes_grid, finish, free_pose, holed_polygons, naive_clearance, scaled, search_on, steps_of

from dubins_rrt_ros.planning import ClearanceField, Problem, Settings, Tree, TreeError, Vehicle

NEED = 0.2
VEHICLE = Vehicle(robot_radius=NEED)


def problem_on(kind, seed=1):
    rng = np.random.default_rng(seed)
    map = boxes_grid(rng) if kind == "grid" else holed_polygons(rng)
    start, goal = (free_pose(rng, map, naive_clearance(map), 2 * NEED) for _ in range(2))
    return Problem(map, Vehicle(0.5, NEED), start, goal)


def grown(kind="grid", seed=1, **options):
    """A finished search and its field."""
    problem = problem_on(kind, seed)
    field = ClearanceField(problem.map)
    settings = Settings(**{"samples": scaled(1000, least=150), "seed": 1, **options})
    return finish(search_on(problem, settings)), field


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["grid", "polygons"])
@pytest.mark.parametrize("planner", ["rrt", "rrt_star"])
@pytest.mark.parametrize("step_size", [0.0, 0.4])
@pytest.mark.parametrize("options", [{}, {"informed": False, "shortcut": False, "heading_sampling": "uniform"}])
def test_invariants_hold_after_every_step(kind, planner, step_size, options):
    batches = nodes = 0
    for seed in range(3 if SCALE == 1 else 1):
        problem = problem_on(kind, seed)
        field = ClearanceField(problem.map)
        settings = Settings(planner=planner, samples=scaled(1200, least=100), step_size=step_size, seed=seed,
                            preferred_clearance=0.0, **options)
        search = search_on(problem, settings)
        for _ in steps_of(search):
            tree = search.tree
            tree.check(field, VEHICLE)
            assert len(tree) == search.growing.size
            assert step_size == 0 or tree.lengths.sum(axis=1).max() <= step_size * (1 + 1e-9)
            np.testing.assert_allclose(tree.costs, naive.costs(tree.parents, tree.lengths), rtol=1e-12)
            batches += 1
        nodes += len(tree)
    assert batches > (3 if SCALE == 1 else 0)
    assert nodes > (15 if SCALE == 1 else 1)


@pytest.mark.parametrize("kind", ["grid", "polygons"])
def test_edges_are_free_by_dense_sampling(kind):
    search, _ = grown(kind)
    tree, clearance = search.tree, naive_clearance(problem_on(kind).map)
    for node in range(1, len(tree), 5):
        curve = tree.curve_to(node)
        points = naive.points_along(curve.start, curve.word, curve.lengths, curve.radius, 0.01)
        assert clearance(points).min() >= NEED - 1e-9


@pytest.fixture(scope="module")
def small():
    """A tree to be corrupted, and the field that it was grown in."""
    search, field = grown(samples=100, preferred_clearance=0.0)
    tree = search.tree
    tree.check(field, VEHICLE)
    return tree, field


def corrupted(tree, name, index, value):
    array = getattr(tree, name).copy()
    array[index] = value
    return replace(tree, **{name: array})


def leaf_and_parent(tree):
    leaf = next(node for node in range(1, len(tree)) if node not in tree.parents and tree.parents[node] > 0)
    return leaf, int(tree.parents[leaf])


def node_above(tree):
    """A node with a child, and that child; the node is not the root."""
    leaf, parent = leaf_and_parent(tree)
    return parent, leaf


def with_another_word(tree):
    """The turns of an edge that has one, to the other side."""
    node = int(np.argmax(tree.lengths[:, 0] > 0.01))
    return corrupted(tree, "words", node, (tree.words[node] + 1) % 2)


CORRUPTIONS = {
    "root with a parent": ("no root", lambda t: corrupted(t, "parents", 0, 1)),
    "root with a cost": ("no root", lambda t: corrupted(t, "costs", 0, 1e-9)),
    "second root": ("a parent is no node", lambda t: corrupted(t, "parents", 5, -1)),
    "parent beyond the nodes": ("a parent is no node", lambda t: corrupted(t, "parents", 5, len(t))),
    "cycle of one": ("below a cycle", lambda t: corrupted(t, "parents", 5, 5)),
    "cycle of two": ("below a cycle", lambda t: corrupted(t, "parents", *node_above(t))),
    "cost by a nanometre": ("the cost of node 7 is not", lambda t: corrupted(t, "costs", 7, t.costs[7] + 1e-9)),
    "cost not a number": ("the cost of node", lambda t: corrupted(t, "costs", 7, math.nan)),
    "length by a nanometre": ("the edge to node 3 costs less than its length",
                              lambda t: corrupted(t, "lengths", (3, 1), t.lengths[3, 1] + 1e-9)),
    "pose by 1e-7 m": ("edge to node", lambda t: corrupted(t, "poses", (3, 0), t.poses[3, 0] + 1e-7)),
    "heading by 1e-7 rad": ("edge to node", lambda t: corrupted(t, "poses", (3, 2), t.poses[3, 2] + 1e-7)),
    "pose not a number": ("edge to node", lambda t: corrupted(t, "poses", (3, 0), math.nan)),
    "heading not a number": ("edge to node", lambda t: corrupted(t, "poses", (3, 2), math.nan)),
    "another word": ("edge to node", with_another_word),
    "another radius": ("edge to node", lambda t: replace(t, radius=1.01 * t.radius)),
    "no nodes": ("no root", lambda t: Tree(1.0, *(a[:0] for a in (t.poses, t.parents, t.costs, t.words, t.lengths,
                                                             t.edge_costs)))),
}


@pytest.mark.parametrize("name", CORRUPTIONS)
def test_check_finds(small, name):
    message, corrupt = CORRUPTIONS[name]
    with pytest.raises(TreeError, match=message):
        corrupt(small[0]).check()


def test_check_finds_arcs_of_negative_length():
    """Driven backwards and forwards again an edge ends where it should, and costs what it should."""
    tree = Tree(1.0, np.array([[0.0, 0, 0], [2, 0, 0]]), np.array([-1, 0], np.int32), np.array([0.0, 2.0]),
                np.zeros(2, np.int8), np.array([[0.0, 0, 0], [0.0, 2.0, 0.0]]), np.array([0.0, 2.0]))
    tree.check()
    there_and_back = replace(tree, lengths=np.array([[0.0, 0, 0], [-math.tau, 2.0, math.tau]]))
    with pytest.raises(TreeError):
        there_and_back.check()


def test_check_finds_an_edge_that_is_too_near_an_obstacle(small):
    tree, field = small
    with pytest.raises(TreeError, match=r"edge to node \d+ is not free for Vehicle.*robot_radius=1.5"):
        tree.check(field, Vehicle(robot_radius=1.5))


def test_a_tree_of_its_root_alone():
    tree = Tree.of_root((1.0, 2.0, 3.0), 0.5)
    tree.check()
    assert len(tree) == 1
    assert tree.segments(0.1).shape == (0, 2, 2)
    path = tree.path_to(0)
    assert (path.start, path.end, path.curves) == ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), ())


def test_paths_cost_what_the_tree_says(small):
    tree, _ = small
    for node in range(len(tree)):
        path = tree.path_to(node)
        assert path.length == pytest.approx(tree.costs[node], rel=1e-12)
        assert path.start == tuple(tree.poses[0])
        assert path.end == tuple(tree.poses[node])
        at = np.array(path.start)
        for curve in path.curves:
            np.testing.assert_allclose(curve.start, at, atol=1e-8)
            at = naive.drive(curve.start, curve.word, curve.lengths, tree.radius)
            at[2] = math.remainder(at[2], math.tau)
            at[2] += math.tau * round((path.end[2] - at[2]) / math.tau) if curve is path.curves[-1] else 0
        np.testing.assert_allclose(at, path.end, atol=1e-8)


@pytest.mark.parametrize("spacing", [0.05, 0.2])
def test_segments_follow_the_edges(small, spacing):
    """From each node's parent to the node, without a gap, with both ends on the curve and the middle next to it."""
    tree, _ = small
    segments = iter(tree.segments(spacing))
    for node in range(1, len(tree)):
        curve = tree.curve_to(node)
        points = naive.points_along(curve.start, curve.word, curve.lengths, curve.radius, 0.001)
        at, driven = tree.poses[tree.parents[node], :2], 0.0
        while math.dist(at, tree.poses[node, :2]) > 1e-9 or driven < curve.length / 2:
            begin, end = next(segments)
            np.testing.assert_allclose(begin, at, atol=1e-9)
            for point, beside in ((end, 0), ((begin + end) / 2, spacing**2 / 8 / curve.radius)):
                assert np.hypot(*(points - point).T).min() < 0.001 + beside
            at, driven = end, driven + math.dist(begin, end)
        assert driven == pytest.approx(curve.length, rel=0.02)
    assert next(segments, None) is None
