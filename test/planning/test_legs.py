"""The legs of a path over waypoints: the cheapest chain of them, and whether one is given up too soon."""

import math

import numpy as np
import pytest
from support.buildings import office
from support.cases import needs_compiled

from dubins_rrt_ros.planning import Problem, Settings, Vehicle, plan, plan_through, prepare, rasterise
from dubins_rrt_ros.planning.search.legs import cheapest_chain, first_impassable


def test_the_cheapest_chain_is_that_of_all_chains():
    rng = np.random.default_rng(2)
    for _ in range(20):
        costs = [rng.uniform(1, 2, shape) for shape in ((1, 4), (4, 3), (3, 4))]
        costs[1][rng.integers(4), :] = math.inf
        i, j, k = min(np.ndindex(4, 3, 4), key=lambda chain: costs[0][0, chain[0]] + costs[1][chain[:2]] + costs[2][chain[1:]])
        assert cheapest_chain(costs) == [0, i, j, k]
        assert first_impassable(costs) is None
        assert first_impassable([costs[0], np.full((4, 3), math.inf), costs[2]]) == 1


@pytest.mark.slow
@needs_compiled
def test_a_leg_is_not_given_up_where_the_cheapest_ways_onto_its_path_and_off_it_cross():
    vehicle = Vehicle(1.0, 0.3)
    world = prepare(rasterise(office(5, seed=3, door=1.6), 0.05), vehicle)
    rng = np.random.default_rng(5)
    draws = np.column_stack([rng.uniform(0.5, 24.5, (100, 2)), rng.uniform(-math.pi, math.pi, 100)]).tolist()
    free = [pose for pose in map(tuple, draws) if world.field.pose_is_free(pose, vehicle)]
    settings = Settings(planner="rrt", planning_time=2.0, seed=1)
    for start, waypoint, goal in zip(free[:9:3], free[1::3], free[2::3], strict=False):
        legs = [Problem(world, start=here, goal=there) for here, there in ((start, waypoint), (waypoint, goal))]
        if all(plan(leg, settings).solved for leg in legs):
            assert plan_through(Problem(world, start=start, goal=goal), [waypoint], settings).solved
