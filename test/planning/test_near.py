"""The near sets of RRT*, sample by sample against brute force, on the inner loops themselves."""

import math
from itertools import repeat

import numpy as np
import pytest
from support import naive
from support.cases import SCALE, boxes_grid, empty_map, holed_polygons, scaled

from dubins_rrt_ros.planning import ClearanceField, Tree, Vehicle
from dubins_rrt_ros.planning._kernels.edge_cost import EdgeCost
from dubins_rrt_ros.planning._kernels.near import takes_half_circle
from dubins_rrt_ros.planning._kernels.rrt import RrtKernel
from dubins_rrt_ros.planning._kernels.tree import SearchTree
from dubins_rrt_ros.planning.curves.dubins import shortest
from dubins_rrt_ros.planning.search.growing_tree import MOST_NEAR, NEAR_FACTOR

GAIN = 1e-6
NEED = 0.2
VEHICLE = Vehicle(robot_radius=NEED)


class Inner:
    """The inner loop on a map, one sample at a time."""

    def __init__(self, map, root, radius, step=0.0):
        self.field = ClearanceField(map)
        corners = map.corners()
        low, high = corners.min(axis=0), corners.max(axis=0)
        self.grown = SearchTree(root=root, radius=radius, corner=low, extent=high - low)
        self.grower = RrtKernel(tree=self.grown, checker=self.field.collision_checker(VEHICLE),
                                edge_cost=EdgeCost(), step=step, near_factor=NEAR_FACTOR, max_near=MOST_NEAR,
                                goal=(1e6, 1e6, 0.0), tolerance_xy=0.0,
                                tolerance_yaw=0.0)

    def add(self, sample, algorithm="rrt_star"):
        """Give it a sample; whether it became a node."""
        before = self.grown.size
        self.grower.reserve(1)
        getattr(self.grower, algorithm)(np.array([sample], dtype=float), 0, 1)
        return self.grown.size > before

    @property
    def tree(self):
        return Tree.copy_of(self.grown)

    def is_free(self, start, goal):
        """Whether the shortest curve between two poses is."""
        return self.field.curve_is_free(shortest(tuple(start.tolist()), tuple(goal.tolist()), self.grown.radius), VEHICLE)


def samples_on(map, count, seed=1):
    """Random poses of a map."""
    rng = np.random.default_rng(seed)
    corners = map.corners()
    points = corners[0] + rng.random((count, 2)) @ (corners[[1, 3]] - corners[0])
    return np.column_stack([points, rng.uniform(-math.pi, math.pi, count)])


def near_count(size):
    return min(math.ceil(NEAR_FACTOR * math.log(size + 1)), size)


MAPS = [empty_map(), empty_map(6.0), boxes_grid(np.random.default_rng(2), boxes=4),
        holed_polygons(np.random.default_rng(3), count=4)]


def first_free_pose(map):
    field = ClearanceField(map)
    return tuple(next(pose for pose in samples_on(map, 100, seed=9) if field.at(pose[:2]) > 2 * NEED).tolist())


@pytest.mark.parametrize("map", MAPS)
def test_rrt_extends_the_closest_node(map):
    inner = Inner(map, first_free_pose(map), 0.5)
    added = 0
    for sample in samples_on(map, scaled(200, least=60)):
        before = inner.tree
        (closest,), (length,) = naive.nearest(before.poses, sample, 0.5, 1)
        expected = inner.field.at(sample[:2]) >= NEED + 0.001 and inner.is_free(before.poses[closest], sample)
        if inner.add(sample, "rrt"):
            after = inner.tree
            assert after.parents[-1] == closest
            assert after.lengths[-1].sum() == pytest.approx(length, abs=1e-9)
            added += 1
        else:
            assert not expected
    assert added > 10


@pytest.mark.parametrize("map", MAPS)
def test_rrt_star_chooses_the_cheapest_free_parent_among_the_near(map):
    inner = Inner(map, first_free_pose(map), 0.5)
    added = 0
    for sample in samples_on(map, scaled(200, least=60)):
        before = inner.tree
        near, to_sample = naive.nearest(before.poses, sample, 0.5, near_count(len(before)))
        cost = before.costs[near] + to_sample
        free = np.array([inner.is_free(before.poses[node], sample) for node in near])
        if not inner.add(sample):
            assert not free.any()
            continue
        after = inner.tree
        assert free.any()
        assert after.costs[-1] == pytest.approx(cost[free].min(), abs=1e-9)
        assert after.parents[-1] == near[free][np.argmin(cost[free])]
        added += 1
    assert added > 10


@pytest.mark.slow
@pytest.mark.parametrize("map", MAPS)
def test_rrt_star_rewires_just_those_near_that_gain(map):
    inner = Inner(map, first_free_pose(map), 0.5)
    rewired = 0
    for sample in samples_on(map, scaled(400, least=60)):
        before = inner.tree
        _, to_sample = naive.nearest(before.poses, sample, 0.5, near_count(len(before)))
        if not inner.add(sample):
            continue
        after, node = inner.tree, len(before)
        onward = naive.shortest(sample, before.poses, 0.5)
        changed = np.flatnonzero(after.parents[:-1] != before.parents)
        assert (after.parents[changed] == node).all()
        assert (after.costs[:-1] <= before.costs).all()
        for other in changed:
            assert after.lengths[other].sum() == pytest.approx(onward[other], abs=1e-9)
            assert after.costs[other] < before.costs[other]
            assert onward[other] <= to_sample[-1] or len(before) == near_count(len(before))
        gains = after.costs[node] + onward + GAIN < after.costs[:-1]
        for other in np.flatnonzero((onward < to_sample[-1] - GAIN) & gains):
            assert not inner.is_free(sample, before.poses[other])
        rewired += len(changed)
    assert rewired > (5 if SCALE == 1 else 0)


def test_costs_follow_to_all_descendants():
    inner = Inner(MAPS[1], first_free_pose(MAPS[1]), 0.3)
    for sample in samples_on(MAPS[1], scaled(600, least=100)):
        inner.add(sample)
    tree = inner.tree
    np.testing.assert_allclose(tree.costs, naive.costs(tree.parents, tree.lengths), rtol=1e-12)
    tree.check(inner.field, VEHICLE)


@pytest.mark.parametrize("algorithm", ["rrt", "rrt_star"])
@pytest.mark.parametrize("step", [0.0, 0.7])
def test_a_pose_drawn_again_adds_no_node_and_ends(algorithm, step):
    inner = Inner(empty_map(), (0.0, 0.0, 0.0), 0.5, step)
    for sample in [(0, 0, 0), (0.5, 0, 0), (0.5, 0, 0), (0.5, 0, math.tau), (3, 2, 1), (0.5, 0, 0)]:
        inner.add(sample, algorithm)
    poses = inner.tree.poses
    assert len(poses) == 3
    assert poses[1].tolist() == [0.5, 0, 0]


def test_a_goal_drawn_again_is_tried_from_elsewhere():
    """Its first parent is a detour; drawn once more it finds the direct way from the root, and adds no node."""
    inner = Inner(empty_map(), (-8.0, 0.0, 0.0), 1.0, step=0.0)
    goal = (8.0, 0.0, 2.0)
    for sample in samples_on(empty_map(), scaled(300, least=60)):
        inner.add(sample)
        inner.add(goal)
    tree = inner.tree
    (node,) = np.flatnonzero((tree.poses == goal).all(axis=1))
    assert tree.costs[node] == pytest.approx(shortest((-8.0, 0.0, 0.0), goal, 1.0).length, abs=1e-9)
    tree.check(inner.field, VEHICLE)


@pytest.mark.parametrize("algorithm", ["rrt", "rrt_star"])
def test_the_step_is_cut_off_the_shortest_curve(algorithm):
    curve = shortest((0.0, 0.0, 0.0), (-3.0, 4.0, 2.0), 1.0)
    inner = Inner(empty_map(), curve.start, 1.0, step=2.5)
    assert inner.add((-3.0, 4.0, 2.0), algorithm)
    tree = inner.tree
    np.testing.assert_allclose(tree.poses[1], curve.pose_at(2.5), atol=1e-12)
    assert tree.costs[1] == pytest.approx(2.5)


@pytest.mark.parametrize("algorithm", ["rrt", "rrt_star"])
def test_nodes_that_are_forgotten_are_no_neighbours(algorithm):
    """None of them gets a child, nor another parent; those that are kept do."""
    inner = Inner(empty_map(), (0.0, 0.0, 0.0), 0.5)
    samples = samples_on(empty_map(), scaled(400, least=60))
    for sample in samples[:len(samples) // 2]:
        inner.add(sample)
    before = inner.tree
    wanted = (before.poses[:, 0] > 0).astype(np.int8)
    wanted[0] = 1
    inner.grown.prune_index(wanted)
    for sample in samples[len(samples) // 2:]:
        inner.add(sample, algorithm)
        inner.grown.rehash()
    after, known = inner.tree, len(before)
    assert len(after) > known + 5
    new = after.parents[known:]
    assert wanted[new[new < known]].all()
    np.testing.assert_array_equal(after.parents[:known][wanted == 0], before.parents[wanted == 0])
    after.check(inner.field, VEHICLE)


@pytest.mark.parametrize("radius", [1.0, 0.3])
def test_no_curve_shorter_than_half_a_circle_is_taken_to_need_one(radius):
    """Random ones, asked at both ends, and about a place beside the true one."""
    rng = np.random.default_rng(1)
    asked = ruled_out = 0
    for starts, goals in naive.short_curves(rng, scaled(150_000)):
        apart = radius * (goals - starts)[:, :2]
        bearing, slack = rng.uniform(-math.pi, math.pi, len(apart)), 3 * radius * rng.random(len(apart)) ** 4
        beside = apart + (0.999 * slack * (np.cos(bearing), np.sin(bearing))).T
        for theta in (starts[:, 2], goals[:, 2]):
            sine, cosine = np.sin(theta).tolist(), np.cos(theta).tolist()
            for places, slacks in ((apart, np.zeros(len(apart))), (beside, slack)):
                x, y = places.T.tolist()
                assert not any(map(takes_half_circle, x, y, sine, cosine, repeat(radius), slacks.tolist()))
                asked += len(x)
            x, y = -apart.T
            ruled_out += sum(map(takes_half_circle, x, y, sine, cosine, repeat(radius), repeat(0.0)))
    assert asked > scaled(550_000)
    assert ruled_out > 0.2 * asked


def test_more_buckets_find_the_same_neighbours():
    """Whether they are made after each sample or never."""
    trees = []
    for spread in (True, False):
        inner = Inner(MAPS[2], first_free_pose(MAPS[2]), 0.5)
        for i, sample in enumerate(samples_on(MAPS[2], scaled(4000, least=100))):
            inner.add(sample)
            if spread and i % 100 == 99:
                inner.grown.rehash()
        trees.append(inner.tree)
    assert len(trees[0]) == len(trees[1]) > scaled(2100)
    np.testing.assert_array_equal(trees[0].poses, trees[1].poses)
    np.testing.assert_allclose(trees[0].costs, trees[1].costs, rtol=1e-9)
