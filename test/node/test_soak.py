"""One node that is asked for everything at random, for a minute; for an hour, with all figures:

    pytest test/node/test_soak.py --soak 3600 -rP

The same questions, though not at the same times, come again with `--soak-seed` and the seed that a failure prints.
"""

import math
import signal
import time

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from support.cases import empty_map
from support.soak import AT_REST, Soak, driven, length_of

from dubins_rrt_ros.planning import Problem, Settings, Vehicle, audit_path, kernels_compiled, plan

pytestmark = pytest.mark.skipif(not kernels_compiled, reason="too little happens in a minute with interpreted kernels")

#: How often the node is brought to rest, where its resources are read.
RESTS = 24
#: How much more memory the node may hold in the last third of the rests than in the second [MB], both at the least and at the
#: most: at rest it is always in the same state. In an hour a leak of 10 kB/s, some 2 kB a request, is found.
GROWTH = 10.0
#: How much of the node's log a failure shows [characters].
LOG = 5000


@pytest.mark.slow
@pytest.mark.minute
def test_soak(lean_planners, request, record_property):
    seconds, seed = request.config.getoption("--soak"), request.config.getoption("--soak-seed")
    seed = int(np.random.SeedSequence().entropy % 2**31) if seed is None else seed
    print(f"repeat it with --soak {seconds:g} --soak-seed {seed}")
    process = lean_planners.start(**AT_REST)
    soak = Soak(lean_planners.client(listens_to_tree=True), np.random.default_rng(seed))
    memory, others = [], []
    begin = time.monotonic()
    try:
        for rest in range(1, RESTS + 1):
            soak.rest()
            memory.append(process.memory)
            others.append((process.threads, process.descriptors))
            while time.monotonic() < begin + seconds * rest / RESTS:
                soak.step()
        soak.rest()
    except AssertionError:
        print(f"the node said: {process.output[-LOG:]}")
        raise
    finally:
        print(f"after {time.monotonic() - begin:.0f} s, the last steps: {', '.join(soak.steps)}")
        for what, figure in {**soak.counts, "memory at rest [MB]": memory, "threads and descriptors": others}.items():
            record_property(what, figure)
            print(f"{what}: {figure}")
    warm = RESTS // 3
    before, last = memory[warm:2 * warm], memory[2 * warm:]
    assert min(min(last) - min(before), max(last) - max(before)) < GROWTH
    assert set(others[warm:]) == {others[warm]}
    assert process.end(signal.SIGINT) == 0
    for word in ("Traceback", "defect", "Warning"):
        assert word not in process.output


def test_the_judge_of_published_poses_misses_nothing():
    problem = Problem(empty_map(), Vehicle(0.5), (-8.0, -8.0, 0.0), (8.0, 8.0, 1.0))
    path = plan(problem, Settings(planner="rrt", step_size=2.0, seed=1)).path
    poses = path.poses(0.05)
    assert length_of(poses) == pytest.approx(path.length, abs=1e-9)
    assert audit_path(driven(poses, 2.0), problem).ok
    assert not audit_path(driven(poses, 2.001), problem).ok
    for index in (1, len(poses) // 2, -2):
        theta = poses[index, 2]
        for row_gap in ((-math.sin(theta), math.cos(theta), 0.0), (0.0, 0.0, 1.0)):
            moved = poses.copy()
            moved[index] += 1e-4 * np.array(row_gap)
            assert "jumps" in audit_path(driven(moved, 2.0), problem).findings[0]
