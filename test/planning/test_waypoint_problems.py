"""The problems of `python -m dubins_rrt_ros.evaluation.waypoints`: how their poses are drawn."""

import itertools

import numpy as np
import pytest
from support.cases import needs_compiled

from dubins_rrt_ros.evaluation.waypoints import VEHICLE, random_poses
from dubins_rrt_ros.planning import GridMap, prepare

#: Maximum number of figures that are drawn.
MOST_DRAWN = 1000


class Limited(np.random.Generator):
    """A generator that ends what goes on drawing for ever."""

    def __init__(self, seed):
        super().__init__(np.random.PCG64(seed))
        self._drawn = 0

    def uniform(self, *arguments):
        self._drawn += 1
        assert self._drawn <= MOST_DRAWN
        return super().uniform(*arguments)


def floor(with_closets):
    """A room of 10 m; its left half may be closets that nothing can leave."""
    cells = np.zeros((200, 200), np.int8)
    if with_closets:
        cells[:, 96:100] = 100
        cells[::30, :96] = 100
        cells[:, :96:32] = 100
    return prepare(GridMap(cells, 0.05, (0.0, 0.0, 0.0), percent=True), VEHICLE)


@needs_compiled
@pytest.mark.parametrize("seed", [11, 12, 18])  # whose first place is in a closet
def test_a_pose_that_leads_nowhere_is_drawn_anew(seed):
    poses = random_poses(floor(with_closets=True), Limited(seed))
    assert len(poses) == 4 and min(x for x, _, _ in poses) > 5.0


@needs_compiled
def test_problems_do_not_depend_on_how_busy_the_machine_is(monkeypatch):
    """With a clock that goes on by 10 ms with each look at it a path takes a second."""
    world, looks = floor(with_closets=False), itertools.count()
    usual = random_poses(world, Limited(0))
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.time.perf_counter", lambda: 0.01 * next(looks))
    assert random_poses(world, Limited(0)) == usual
