"""The runs of `dubins_rrt bench`: one problem, one seed, one line of figures; in this process or in several."""

import signal
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from multiprocessing import active_children, get_context
from typing import Any, NamedTuple

from dubins_rrt_ros.planning import GridMap, Map, Plan, Problem, Progress, Settings, World, load_map, plan, prepare

from ..common.parser import UsageError
from .problems import Case

#: The poses of a path are this far apart [m], or this share of a cell where that is more: on cells of a metre a quarter of one
#: shows every obstacle that the path passes, and a path of a kilometre takes a line of 0.3 MB and not of 1.5.
SPACING, SHARE_OF_CELL = 0.05, 0.25


class Task(NamedTuple):
    """What one run is to do: a problem, the settings with its seed, and the name of its row."""

    case: Case
    settings: Settings
    label: str


def results(tasks: Iterable[Task], jobs: int) -> Iterator[dict[str, Any]]:
    """The lines of all tasks, each as soon as it is there, measured in `jobs` processes; one is this process.

    Raises:
        MapError: a map cannot be used.
        UsageError: a process was killed.
    """
    _loaded.cache_clear()  # of a call before, since which the file may have changed
    yield from map(measure, tasks) if jobs == 1 else _from_processes(tasks, jobs)


def _from_processes(tasks: Iterable[Task], jobs: int) -> Iterator[dict[str, Any]]:
    # Ctrl-C on a terminal reaches the processes too: by default they die of it, instead of each printing a trace.
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_DFL))
    done = False
    try:
        for future in as_completed([pool.submit(measure, task) for task in tasks]):
            yield future.result()
        done = True
    except BrokenProcessPool:
        raise UsageError(f"one of {jobs} processes was killed, perhaps for lack of memory; give fewer --jobs") from None
    finally:
        if not done:  # what still runs may have an hour to go
            for process in active_children():
                process.terminate()
        pool.shutdown(cancel_futures=True)


def measure(task: Task) -> dict[str, Any]:
    """Plan once; the line of the figures, by name.

    Every improvement is noted at the moment it was reported. A path that only the answer has, as where the start is the goal,
    counts from then on.

    Raises:
        MapError: the map cannot be used.
    """
    world, map_time = _loaded(task.case)
    problem = Problem(world, start=task.case.start, goal=task.case.goal)
    trace = []

    def note(progress: Progress) -> None:
        if progress.improved:
            trace.append([progress.elapsed, progress.length])

    answer = plan(problem, task.settings, on_progress=note)
    if answer.path and not (trace and trace[-1][1] <= answer.length):
        trace.append([answer.planning_time, answer.length])
    return _line(task, answer, trace, map_time)


@lru_cache(maxsize=1)
def _loaded(case: Case) -> tuple[World, float]:
    """The case's map, prepared, and how long that took [s]. The runs of a case follow each other: one world is kept."""
    begin = time.perf_counter()
    world = prepare(load_map(case.map), case.vehicle)
    return world, time.perf_counter() - begin


def _line(task: Task, answer: Plan, trace: list[list[float]], map_time: float) -> dict[str, Any]:
    solved = answer.path is not None
    first_time, first_cost = trace[0] if solved else (None, None)
    return {
        "problem": task.case.name, "planner": task.label, "seed": task.settings.seed, "time_limit": task.settings.planning_time,
        "solved": solved, "error_name": answer.status.name, "time_to_first": first_time, "first_cost": first_cost,
        "final_cost": answer.length, "total_s": answer.planning_time, "samples": int(answer.samples),
        "vertices": len(answer.tree), "map_ms": 1000 * map_time, "trace": trace,
        "path": answer.path.poses(_spacing(answer.problem.map)).tolist() if solved else [], "audit": str(answer.audit or ""),
    }


def _spacing(map: Map) -> float:
    return max(SPACING, SHARE_OF_CELL * map.resolution) if isinstance(map, GridMap) else SPACING
