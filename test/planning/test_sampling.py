"""Informed samples: where a path can still become shorter, uniformly, and near the best path; else the plain ones."""

import math

import numpy as np
import pytest
from support.cases import (
    SCALE,
    boxes_grid,
    empty_map,
    field_of,
    holed_polygons,
    maze_grid,
    path_over,
    scaled,
    search_on,
    steps_of,
)

from dubins_rrt_ros.planning import ClearanceField, GridMap, Problem, Settings, Vehicle
from dubins_rrt_ros.planning.search import rrt, sampling
from dubins_rrt_ros.planning.search.cost_to_go import CostToGo
from dubins_rrt_ros.planning.search.sampling import Sampler

START, GOAL = (-4.0, -3.0, 0.0), (4.0, 3.0, 1.0)
APART = 10.0
VEHICLE = Vehicle(0.5, 0.2)


def open_field(start=START, goal=GOAL, **options):
    return Problem(empty_map(), VEHICLE, start, goal, **options)


class Drawing:
    """A sampler with the bounds that it is informed by."""

    def __init__(self, problem, **options):
        field = field_of(problem)
        self.problem, self.to_goal = problem, CostToGo.to_goal(problem, field).make_bound()
        self.from_start = CostToGo.from_start(problem, field).make_bound()
        settings = Settings(**{"seed": 1, "goal_bias": 0.0, "preferred_clearance": 0.0, **options})
        self.sampler = Sampler(problem, settings, field, self.to_goal)

    def plain(self, count=2000):
        return self.sampler.draw(count)

    def below(self, length, count=2000):
        """Informed by a path of a length, which is a straight line here."""
        return self.sampler.draw(count, self.from_start, line_of(self.problem, length))

    def bound(self, poses):
        return self.from_start.at(poses[:, :2]) + self.to_goal.at(poses[:, :2])


def line_of(problem, length):
    x, y, theta = problem.start
    return path_over([problem.start, (x + length * math.cos(theta), y + length * math.sin(theta), theta)], 0.5)


@pytest.fixture
def never_near(monkeypatch):
    """All informed samples are drawn where the bounds allow them."""
    monkeypatch.setattr(sampling, "NEAR_SHARE", 0.0)


def over(problem, points):
    """The length of the straight lines from the start over each of the points to the goal [m]."""
    return sum(np.hypot(*(points[:, :2] - pose[:2]).T) for pose in (problem.start, problem.goal))


@pytest.mark.parametrize("best", [10.5, 12.0, 14.0])
def test_on_an_open_field_positions_are_uniform_over_the_ellipse(never_near, best):
    """But for the squares that it cuts, and for what the bounds are below the straight line."""
    drawing = Drawing(open_field())
    poses = drawing.below(best, scaled(20_000, least=5000))
    side, margin = drawing.to_goal.kernel.side, 0.02 * APART
    assert over(open_field(), poses).max() <= best + 3 * side + margin
    inside = poses[over(open_field(), poses) <= best]
    assert len(inside) > 0.5 * len(poses)
    along, across = (inside[:, :2] @ [[0.8, -0.6], [0.6, 0.8]] / (best / 2, math.sqrt(best**2 - APART**2) / 2)).T
    distance = np.hypot(along, across)
    for part in (0.25, 0.5, 0.75):
        assert (distance**2 < part).mean() == pytest.approx(part, abs=0.03)
    assert np.ptp(poses[:, 2]) > 6


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["grid", "maze", "polygons"])
def test_no_place_is_left_out_that_a_shorter_path_may_lead_over(never_near, kind):
    """All that plain samples find below the length, informed ones come near to; and they lie in squares that reach below it."""
    rng = np.random.default_rng(3)
    map = {"grid": boxes_grid, "maze": maze_grid, "polygons": holed_polygons}[kind](rng)
    field = ClearanceField(map)
    corners = map.corners()
    points = corners[0] + rng.random((400, 2)) @ (corners[[1, 3]] - corners[0])
    free = points[field.at(points) > 0.3]
    start, goal = ((*point, 0.0) for point in free[np.argsort(free @ (1, 2))[[0, -1]]])
    drawing = Drawing(Problem(map, VEHICLE, start, goal))
    least = drawing.from_start.at(np.array([goal[:2]]))[0]
    if not math.isfinite(least):
        pytest.skip("start and goal are not connected")
    plain = drawing.plain(scaled(20_000, least=4000))
    for best in (1.3 * least, 1.05 * least):
        poses = drawing.below(best, scaled(20_000, least=8000))
        assert field.may_be_free(poses[:, :2], 0).all()
        assert drawing.bound(poses).min() < best
        near_bound = drawing.bound(poses)
        assert near_bound[np.isfinite(near_bound)].max() <= best + 4 * drawing.to_goal.kernel.side
        useful = plain[(drawing.bound(plain) < best) & (field.at(plain[:, :2]) >= 0.2)]
        assert len(useful) > 10
        away = np.array([np.hypot(*(poses[:, :2] - pose[:2]).T).min() for pose in useful[:200]])
        assert away.max() < (0.5 if SCALE == 1 else 1.0)


def test_a_tolerance_widens_where_samples_are_drawn(never_near):
    exact, loose = (over(open_field(), Drawing(open_field(goal_tolerance_xy=tolerance)).below(11.0)).max()
                    for tolerance in (0.0, 1.0))
    assert 0.6 < loose - exact < 1.3


@pytest.mark.parametrize("best", [APART - 3.0, 1e-9])
def test_a_path_below_all_bounds_leaves_the_samples_as_they_were(never_near, best):
    poses = Drawing(open_field()).below(best)
    assert np.ptp(poses[:, 0]) > 18
    assert np.ptp(poses[:, 1]) > 18


def test_what_is_allowed_follows_the_shortest_path_so_far(never_near):
    """A longer path afterwards does not widen it again, since a tree never has one."""
    drawing, fresh = Drawing(open_field()), Drawing(open_field())
    drawing.below(14.0)
    narrow = over(open_field(), drawing.below(10.5)).max()
    assert narrow == pytest.approx(over(open_field(), fresh.below(10.5)).max(), abs=0.2)
    assert over(open_field(), drawing.below(14.0)).max() <= narrow + 0.2


def test_a_share_of_samples_is_near_the_path():
    """Most much nearer than a turning radius, all about it, with headings like its own."""
    problem = open_field()
    path = path_over([START, (-6.0, 5.0, 1.0), (2.0, 7.0, -1.0), GOAL], 0.5)
    drawing = Drawing(problem, heading_sampling="uniform")
    poses = drawing.sampler.draw(scaled(20_000, least=4000), drawing.from_start, path)
    along = path.at(np.linspace(0, 1, 2000))
    beside = np.array([np.hypot(*(along[:, :2] - pose[:2]).T).min() for pose in poses[:2000]])
    closest = along[[np.hypot(*(along[:, :2] - pose[:2]).T).argmin() for pose in poses[:2000]]]
    turned = np.abs(np.remainder(poses[:2000, 2] - closest[:, 2] + math.pi, math.tau) - math.pi)
    near = (beside < 0.1) & (turned < 0.3)
    uniform = 0.2 * path.length / 400 * 0.3 / math.pi
    assert 0.3 * sampling.NEAR_SHARE < near.mean() - uniform < 1.2 * sampling.NEAR_SHARE
    assert np.ptp(closest[near, 0]) > 8


def test_plain_draws_know_of_no_path():
    problem = open_field()
    plain = Drawing(problem, goal_bias=0.05, informed=False).plain()
    assert Drawing(problem, goal_bias=0.05).plain().tobytes() == plain.tobytes()
    drawing = Drawing(problem, goal_bias=0.05)
    assert drawing.sampler.draw(2000, None, line_of(problem, 11.0)).tobytes() == plain.tobytes()
    assert Drawing(problem, goal_bias=0.05).below(11.0).tobytes() != plain.tobytes()


@pytest.mark.parametrize("bias", [0.0, 0.3, 1.0])
def test_informed_samples_keep_the_share_at_the_goal(bias):
    poses = Drawing(open_field(), goal_bias=bias).below(12.0, 10_000)
    share = (poses == GOAL).all(axis=1).mean()
    assert share == pytest.approx(bias, abs=0.02 if 0 < bias < 1 else 0)


@pytest.mark.parametrize("shortcut", [False, True])
def test_nodes_are_added_only_where_a_path_shorter_than_the_best_may_lead(shortcut):
    """By bounds that are computed here, before each block."""
    data = np.zeros((40, 40))
    data[10:30, 19:21] = 100
    problem = Problem(GridMap(data, 0.5, (-10.0, -10.0, 0.0)), VEHICLE, START, GOAL)
    drawing = Drawing(problem)
    search = search_on(problem, Settings(samples=scaled(4 * rrt.BLOCK, least=2 * rrt.BLOCK), seed=1, shortcut=shortcut,
                                         preferred_clearance=0.0))
    at_blocks = []
    for _ in steps_of(search):
        if search.samples % rrt.BLOCK == 0 and search.length is not None:
            at_blocks.append((search.growing.size, search.length))
    assert at_blocks
    nodes = search.tree.poses
    for size, length in at_blocks:
        # Of a path that was inserted the nodes lie below its own length.
        assert drawing.bound(nodes[size:]).max(initial=0) <= length + 1e-9


@pytest.mark.parametrize("informed", [True, False])
def test_samples_fall_where_the_start_can_reach(informed):
    """Informed ones; the paper's fall everywhere that may be free."""
    cells = np.zeros((60, 100))
    cells[:, 20] = 100
    problem = Problem(GridMap(cells, 0.1), Vehicle(0.5, 0.2), (1.0, 1.0, 0.0), (1.0, 5.0, 0.0))
    sampler = Sampler(problem, Settings(informed=informed, heading_sampling="uniform", goal_bias=0.0, seed=1),
                      ClearanceField(problem.map), None)
    beyond = (sampler.draw(512)[:, 0] > 2.0).mean()
    assert (beyond == 0) == informed
