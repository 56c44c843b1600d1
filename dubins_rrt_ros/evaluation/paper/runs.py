"""The runs of `dubins_rrt paper`: the paper's plain RRT and RRT* in an environment, with a seed."""

import json
import math
from collections.abc import Callable, Generator, Iterable, Mapping
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple, NoReturn

from dubins_rrt_ros.cli.bench.report import median
from dubins_rrt_ros.cli.common.cluster import connected, place
from dubins_rrt_ros.cli.common.flags import largest
from dubins_rrt_ros.cli.common.parser import UsageError
from dubins_rrt_ros.planning import Path, Plan, Problem, Progress, Settings, Vehicle, load_map, plan, prepare
from dubins_rrt_ros.planning.maps.locate import find_map

from ..processes import run_in_processes

ENVIRONMENTS, PLANNERS, HEADINGS = ("block", "maze", "forest"), ("rrt", "rrt_star"), ("uniform", "goal", "field")
#: The environment of the paper's table.
MAZE = "maze"
#: Turning radius of the paper, and radius of our vehicle, a disc [m].
TURNING_RADIUS, ROBOT_RADIUS = 1.0, 0.2
#: Longest edge: unlimited, as Algorithms 1 and 2 are printed, or two turning radii [m].
UNLIMITED, LIMITED = 0.0, 2.0
STEPS = (UNLIMITED, LIMITED)
#: Numbers of samples: of the paper's pictures of all environments, of its other pictures of the maze and of its table; of the
#: convergence plot; and of the open question.
PICTURED, PICTURED_MORE, TABLE = 500, (1000, 3000), (500, 1000, 2000, 3000)
MARKS = (50, 70, 100, 150, 200, 300, 400, 500, 700, 1000, 1400, 2000, 3000)
MOST = 3000
#: The paper's pictures, and the names of the files of the two other figures.
PICTURES = [*product(ENVIRONMENTS, PLANNERS, [PICTURED]), *product([MAZE], ["rrt_star"], PICTURED_MORE)]
CONVERGENCE, QUESTION = "convergence", "question"
#: Time limit of a run, which only its samples end [s].
NO_LIMIT = largest(Settings, "planning_time")


class PaperRun(NamedTuple):
    """A run to be made.

    Attributes:
        environment: the name of an installed polygon map, with a start and a goal.
        planner, samples, headings, step_size, seed: the settings.
    """

    environment: str
    planner: str
    samples: int
    headings: str
    step_size: float
    seed: int


class RunOutcome(NamedTuple):
    """The outcome of a run; without a path all but `reach` is infinite.

    Attributes:
        length: length of the best path [m].
        curves: number of Dubins curves of the path.
        turned: angle by which it turns, left and right added up [full circles].
        time_to_first: time to the first path [s].
        samples_to_first: number of samples drawn until then, that one included.
        reach: largest x of the tree's nodes [m].
    """

    length: float
    curves: float
    turned: float
    time_to_first: float
    samples_to_first: float
    reach: float

    @property
    def solved(self) -> bool:
        """True if there is a path."""
        return math.isfinite(self.length)

    def without_times(self) -> "RunOutcome":
        """Return the outcome without its time, which was not measured on a machine like the others'."""
        return self._replace(time_to_first=math.inf)

    def within(self, samples: int) -> "RunOutcome":
        """Return the outcome after this number of samples, for a run that ends with its first path."""
        return self if self.samples_to_first <= samples else _outcome_without_path(self.reach)


#: A run, its outcome, and the fields of its line that say where on a cluster it was made.
Outcome = tuple[PaperRun, RunOutcome, dict[str, Any]]


class Measured:
    """The outcomes of all runs, each with the seeds 0 to `seeds` - 1."""

    def __init__(self, outcomes: Mapping[PaperRun, RunOutcome], seeds: int):
        self.outcomes, self.seeds = outcomes, seeds

    def of(self, environment: str, planner: str, samples: int = MOST, headings: str = "uniform", step_size: float = UNLIMITED
           ) -> list[RunOutcome]:
        """Return the outcomes of runs that differ in the seed alone, by seed.

        RRT ends with its first path: from its run with most samples follow those with fewer.
        """
        drawn = MOST if planner == "rrt" else samples
        runs = [PaperRun(environment, planner, drawn, headings, step_size, seed) for seed in range(self.seeds)]
        return [self.outcomes[run].within(samples) for run in runs]

    def median_run(self, environment: str, planner: str, samples: int) -> tuple[PaperRun, int]:
        """Return the run whose path has the median length of those that found one, or the first run, and how many did."""
        lengths = [outcome.length for outcome in self.of(environment, planner, samples)]
        found = [length for length in lengths if math.isfinite(length)]
        seed = lengths.index(median(found)) if found else 0
        return PaperRun(environment, planner, samples, "uniform", UNLIMITED, seed), len(found)


def picture_name(environment: str, planner: str, samples: int) -> str:
    """Return the name of a picture's files, without the ending."""
    return f"{environment}-{planner}-{samples}"


def all_runs(seeds: int) -> list[PaperRun]:
    """List all runs: the paper's, and those of its open question."""
    kinds = [(MAZE, "rrt_star", mark, "uniform", UNLIMITED) for mark in MARKS]
    kinds += [(environment, "rrt_star", PICTURED, "uniform", UNLIMITED) for environment in ENVIRONMENTS]
    kinds += [(environment, planner, MOST, headings, step_size)
              for environment, planner, headings, step_size in product(ENVIRONMENTS, PLANNERS, HEADINGS, STEPS)]
    return [PaperRun(*kind, seed) for kind in dict.fromkeys(kinds) for seed in range(seeds)]


def outcomes(runs: Iterable[PaperRun], jobs: int) -> Generator[Outcome, None, None]:
    """Yield the runs with their outcomes, in any order, measured in `jobs` processes; one is this process.

    Raises:
        UsageError: a process was killed.
    """
    yield from map(measure, runs) if jobs == 1 else run_in_processes(measure, runs, jobs, NO_LIMIT, _lost)


def outcomes_on_cluster(runs: Iterable[PaperRun], address: str) -> Generator[Outcome, None, None]:
    """Yield the runs with their outcomes, in any order, measured by the workers of a Dask cluster.

    Raises:
        UsageError: the cluster cannot be used, or every worker that tried a run died.
    """
    with connected(address) as cluster:
        yield from cluster.run(_measure_on_host, ((run,) for run in runs), lambda call, what: _lost(call[0], what))


def _measure_on_host(run: PaperRun) -> Outcome:
    return *measure(run)[:2], place()


def measure(run: PaperRun) -> Outcome:
    """Plan once."""
    samples_at_first: list[int] = []

    def record(progress: Progress) -> None:
        if progress.improved and not samples_at_first:
            samples_at_first.append(progress.samples)

    answer = planned(run, record)
    reach = float(answer.tree.poses[:, 0].max())
    if answer.path is None or answer.time_to_first is None:
        return run, _outcome_without_path(reach), {}
    return run, RunOutcome(answer.path.length, len(answer.path.curves), _full_circles(answer.path), answer.time_to_first,
                           samples_at_first[0], reach), {}


def planned(run: PaperRun, on_progress: Callable[[Progress], None] = lambda progress: None) -> Plan:
    """Plan a run by Algorithms 1 and 2, without what goes beyond them."""
    settings = Settings(planner=run.planner, samples=run.samples, planning_time=NO_LIMIT, step_size=run.step_size,
                        heading_sampling=run.headings, informed=False, shortcut=False, seed=run.seed)
    return plan(problem_in(run.environment), settings, on_progress=on_progress)


@lru_cache
def problem_in(environment: str) -> Problem:
    """Prepare the problem of an environment, whose file names the start and the goal."""
    file = find_map(f"{environment}.geojson")
    poses = json.loads(file.read_text(encoding="utf-8"))
    world = prepare(load_map(file), Vehicle(TURNING_RADIUS, ROBOT_RADIUS))
    return Problem(world, start=poses["start"], goal=poses["goal"])


def _outcome_without_path(reach: float) -> RunOutcome:
    return RunOutcome(math.inf, math.inf, math.inf, math.inf, math.inf, reach)


def _full_circles(path: Path) -> float:
    turns = (arc.length for curve in path.curves for arc in curve.arcs if arc.curvature != 0)
    return sum(turns) / (math.tau * TURNING_RADIUS)


def _lost(run: PaperRun, what: str) -> NoReturn:
    raise UsageError(f"{run.planner} in {run.environment} with seed {run.seed}: {what}; give fewer --jobs or more memory")
