"""The runs of `dubins_rrt bench`: one problem and one seed make one line of figures, in this process or in several."""

import signal
import time
import warnings
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from dubins_rrt_ros.planning import GridMap, Map, Plan, Problem, Progress, Settings, Vehicle, World, load_map, plan, prepare
from dubins_rrt_ros.planning.maps.frame import DoubtfulYaw

from ..common.cluster import connected, place
from ..common.parser import UsageError
from .problems import Case

#: Distance between the poses of a path [m], or this share of a cell where that is more: with cells of 1 m a quarter of a cell
#: shows every obstacle that the path passes, and the line of a path of 1 km has 0.3 MB, not 1.5.
SPACING, SHARE_OF_CELL = 0.05, 0.25


class BenchRun(NamedTuple):
    """A run to be made: a problem, the settings with the seed, and the label of its row."""

    case: Case
    settings: Settings
    label: str


def measure_all(runs: Iterable[BenchRun], jobs: int) -> Generator[dict[str, Any], None, None]:
    """Yield the line of each run as soon as it is done, measured in `jobs` processes; one is this process.

    Raises:
        MapError: a map cannot be used.
        UsageError: a process was killed.
    """
    _loaded.cache_clear()  # of a previous call, since which the file may have changed
    yield from map(measure, runs) if jobs == 1 else _from_processes(runs, jobs)


def measure_on_cluster(runs: Iterable[BenchRun], address: str) -> Generator[dict[str, Any], None, None]:
    """Yield the line of each run as soon as it is done, measured by the workers of a Dask cluster; maps are read here.

    Raises:
        MapError: a map cannot be used.
        UsageError: the cluster cannot be used, or every worker that tried a run died.
    """
    runs = list(runs)
    with connected(address) as cluster:
        maps = {file: cluster.share(load_map(file)) for file in dict.fromkeys(run.case.map for run in runs)}
        yield from cluster.run(_measure_on_host, ((run, maps[run.case.map]) for run in runs), _lost)


def _lost(call: tuple[BenchRun, Any], what: str) -> NoReturn:
    raise UsageError(f"{call[0].case.name} with seed {call[0].settings.seed}: {what}, perhaps for lack of memory")


def _from_processes(runs: Iterable[BenchRun], jobs: int) -> Iterator[dict[str, Any]]:
    # Ctrl-C on a terminal reaches the processes too: with the default action they die without a trace.
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_DFL))
    done = False
    try:
        for future in as_completed([pool.submit(measure, run) for run in runs]):
            yield future.result()
        done = True
    except BrokenProcessPool:
        raise UsageError(f"one of {jobs} processes was killed, perhaps for lack of memory; give fewer --jobs") from None
    finally:
        if not done:  # a run may have an hour to go
            for process in active_children():
                process.terminate()
        pool.shutdown(cancel_futures=True)


def measure(run: BenchRun) -> dict[str, Any]:
    """Plan once, and return the figures by name.

    Raises:
        MapError: the map cannot be used.
    """
    return _measure_in(*_loaded(run.case.map, run.case.vehicle, run.case.allow_unknown), run)


def _measure_on_host(run: BenchRun, world_map: Map) -> dict[str, Any]:
    """Plan once on a worker of a cluster; return the figures, and where it was."""
    return _measure_in(*_prepared(world_map, run.case.vehicle, run.case.allow_unknown), run) | place()


def _measure_in(world: World, map_time: float, run: BenchRun) -> dict[str, Any]:
    """Plan once.

    Every improvement is recorded at the time it was reported. A path that only the answer has, as when the start is the goal,
    counts from the end of planning.
    """
    case = run.case
    warnings.simplefilter("ignore", DoubtfulYaw)  # which was said when the problems were read
    problem = Problem(world, start=case.start, goal=case.goal, **dict(case.request))
    trace: list[list[float]] = []
    objectives: list[float | None] = []

    def record(progress: Progress) -> None:
        if progress.improved and progress.length is not None:
            trace.append([progress.elapsed, progress.length])
            objectives.append(progress.cost)

    answer = plan(problem, run.settings, on_progress=record)
    if answer.length is not None and not (trace and trace[-1][1] <= answer.length):
        trace.append([answer.planning_time, answer.length])
        objectives.append(answer.cost)
    return _line(run, answer, trace, objectives[0] if objectives else None, map_time)


@lru_cache(maxsize=1)
def _loaded(file: Path, vehicle: Vehicle, allow_unknown: bool) -> tuple[World, float]:
    """Load and prepare the map of a case; return it with the time taken [s]. Runs of a case follow each other: one is kept."""
    begin = time.perf_counter()
    world = prepare(load_map(file), vehicle, allow_unknown=allow_unknown)
    return world, time.perf_counter() - begin


@lru_cache(maxsize=4)
def _prepared(world_map: Map, vehicle: Vehicle, allow_unknown: bool) -> tuple[World, float]:
    """Prepare a map that a worker was sent; return it with the time taken [s]. Several are kept: workers share cases."""
    begin = time.perf_counter()
    world = prepare(world_map, vehicle, allow_unknown=allow_unknown)
    return world, time.perf_counter() - begin


def _line(run: BenchRun, answer: Plan, trace: list[list[float]], first_objective: float | None, map_time: float
          ) -> dict[str, Any]:
    solved = answer.path is not None
    first_time, first_cost = trace[0] if solved else (None, None)
    return {
        "problem": run.case.name, "planner": run.label, "seed": run.settings.seed, "time_limit": run.settings.planning_time,
        "solved": solved, "error_name": answer.status.name, "message": answer.message, "found_by": answer.found_by,
        "time_to_found": answer.time_to_found, "time_to_first": first_time, "first_cost": first_cost, "final_cost": answer.length,
        "first_objective": first_objective, "final_objective": answer.cost,
        "total_s": answer.planning_time, "samples": int(answer.samples), "vertices": len(answer.tree),
        "map_ms": 1000 * map_time, "trace": trace,
        "path": answer.path.poses(_spacing(answer.problem.map)).tolist() if answer.path else [], "audit": str(answer.audit or ""),
    }


def _spacing(world_map: Map) -> float:
    return max(SPACING, SHARE_OF_CELL * world_map.resolution) if isinstance(world_map, GridMap) else SPACING
