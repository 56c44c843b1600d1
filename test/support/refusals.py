"""Problems without a path, and the sentences that say why."""

import numpy as np
import pytest

from dubins_rrt_ros.planning import GridMap, Settings, kernels_compiled, plan


@pytest.fixture(autouse=True)
def reasons_have_time(monkeypatch):
    """However slow the machine is; `test_planner_limits.py` tests that they look at the time."""
    monkeypatch.setattr("dubins_rrt_ros.planning.deadline.AUDIT_GRACE", 600.0)


def walls_with_a_gap(gap, value=100, resolution=0.5, origin=(-10.0, -10.0, 0.0)):
    """A square of 20 m with a wall a metre thick in its middle that leaves some rows free."""
    n = round(20 / resolution)
    data = np.zeros((n, n))
    data[:, n // 2 - round(0.5 / resolution):n // 2 + round(0.5 / resolution)] = value
    data[gap] = np.minimum(data[gap], 0) if value > 0 else 0
    return GridMap(data, resolution, origin)


def why(problem, **settings):
    """The plan of a problem without a path, whose sentence reads like one."""
    # Without a path an informed search goes on up to its limit.
    limit = (0.3 if kernels_compiled else 6.0) if settings.get("informed", True) else 60.0
    result = plan(problem, Settings(**{"samples": 60, "seed": 1, "planning_time": limit, **settings}))
    assert result.path is None
    assert result.message.endswith(".")
    assert "\n" not in result.message
    assert "nan" not in result.message
    return result
