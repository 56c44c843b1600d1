"""The size of portions of work."""

import pytest

from dubins_rrt_ros.planning.search.pace import MEMORY, Pace


@pytest.fixture
def clock(monkeypatch):
    """A clock that goes by what the test lets it: a list with the time [s] as its last item."""
    times = [0.0]
    monkeypatch.setattr("dubins_rrt_ros.planning.search.pace.time.perf_counter", lambda: times[-1])
    return times


def work(pace, clock, seconds_per_item):
    """Do the next portion; return its size."""
    size = pace.size
    with pace.measured(size):
        clock.append(clock[-1] + size * seconds_per_item)
    return size


def test_portions_grow_until_they_take_the_time_that_they_may(clock):
    pace = Pace(first=4, largest=1000, duration=2.0**-9)
    assert [work(pace, clock, 2.0**-17) for _ in range(6)] == [4, 16, 64, 256, 256, 256]


def test_they_grow_up_to_the_largest(clock):
    pace = Pace(first=4, largest=50, duration=0.002)
    assert [work(pace, clock, 1e-9) for _ in range(4)] == [4, 16, 50, 50]


def test_after_slow_items_they_grow_slowly(clock):
    pace = Pace(first=100, largest=1000, duration=0.002)
    work(pace, clock, 1e-3)
    sizes = [work(pace, clock, 1e-6) for _ in range(20)]
    assert sizes[0] == 2 and sizes == sorted(sizes)
    assert sizes[-1] == int(2 / MEMORY**19)


def test_there_is_an_item_in_each(clock):
    pace = Pace(first=1, largest=10, duration=0.002)
    assert [work(pace, clock, 1.0) for _ in range(3)] == [1, 1, 1]
