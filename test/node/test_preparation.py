"""Maps that come one after the other: what each is prepared from, and that the old ones are let go. The node is a real one."""

import gc
import threading
import time
import weakref
from contextlib import contextmanager

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

import rclpy
from rclpy.executors import SingleThreadedExecutor

from dubins_rrt_ros.node import maps as module
from dubins_rrt_ros.node.executor_queue import ExecutorQueue
from dubins_rrt_ros.node.maps import Maps
from dubins_rrt_ros.node.parameters import Parameters
from dubins_rrt_ros.planning import GridMap, prepare

SOON = 10.0


class Keeper:
    """Keeps maps as the planner's node does.

    Attributes:
        made: the names of the maps that were prepared, each with that of the map that it was prepared from.
        turns: where it is set, each preparation waits for one.
    """

    def __init__(self, executor, node):
        self._executor = executor
        self._maps = Maps(node, Parameters(node), ExecutorQueue(node), lambda: None, self._hear)
        self._name, self._heard = "", []
        self.worker = self._maps._worker
        self.made = []
        self.turns = None

    def _hear(self):
        self._heard.append(self._maps.prepared.map.name)

    def prepare(self, map, vehicle, allow_unknown, previous):
        self.made.append((map.name, previous and previous.map.name))
        assert self.turns is None or self.turns.acquire(timeout=SOON)
        return prepare(map, vehicle, allow_unknown, previous)

    def take(self, name):
        """Take a map that differs from those of other names, as equal ones share what was computed; a weak reference to it."""
        cells = np.zeros((10, 10))
        cells[0, ord(name) - ord("a")] = 100
        grid = GridMap(cells, 0.1, name=name)
        self._name = name
        self._maps.take(grid, grid)
        return weakref.ref(grid)

    def wait(self):
        """Until the newest is prepared and that has been heard of."""
        self.wait_for_ready(self._name)

    def wait_for(self, condition):
        end = time.monotonic() + SOON
        while not condition():
            assert time.monotonic() < end, f"it did not come; heard of {self._heard}"
            self._executor.spin_once(timeout_sec=0.1)

    def wait_for_ready(self, name):
        """Until a map is prepared and that has been heard of."""
        self.wait_for(lambda: name in self._heard)

    @contextmanager
    def busy(self):
        """What is taken within is prepared after it."""
        go_on = threading.Event()
        self.worker.submit(lambda cancelled: go_on.wait(SOON), lambda outcome: None)
        yield
        go_on.set()


@pytest.fixture
def keeper(monkeypatch):
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("planner", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    keeper = Keeper(executor, node)
    monkeypatch.setattr(module, "prepare", keeper.prepare)
    yield keeper
    assert keeper.worker.close(SOON)
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def test_a_map_is_prepared_from_the_one_before(keeper):
    for name in "abc":
        keeper.take(name)
        keeper.wait()
    assert keeper.made == [("a", None), ("b", "a"), ("c", "b")]


def test_a_map_is_prepared_from_the_last_that_was_where_those_between_were_not(keeper):
    keeper.take("a")
    keeper.wait()
    with keeper.busy():
        for name in "bcd":
            keeper.take(name)
    keeper.wait()
    assert keeper.made == [("a", None), ("d", "a")]


def test_maps_that_come_faster_than_they_are_prepared_are_told_as_they_get_ready(keeper):
    keeper.turns = threading.Semaphore(0)
    keeper.take("a")
    for before, name in zip("abc", "bcd", strict=True):
        keeper.wait_for(lambda before=before: before in dict(keeper.made))
        keeper.take(name)  # while the one before is being prepared
        keeper.turns.release()
        keeper.wait_for_ready(before)
    keeper.turns.release()
    keeper.wait()


def test_old_maps_are_let_go(keeper):
    taken = []
    for name in "abcd":
        taken.append(keeper.take(name))
        keeper.wait()
    gc.collect()
    assert [kept() is not None for kept in taken] == [False, False, False, True]


def test_the_map_before_lives_until_the_next_is_prepared(keeper):
    before = keeper.take("a")
    keeper.wait()
    with keeper.busy():
        between, newest = keeper.take("b"), keeper.take("c")
        gc.collect()
        assert before() is not None
    keeper.wait()
    gc.collect()
    assert (before(), between()) == (None, None)
    assert newest() is not None
