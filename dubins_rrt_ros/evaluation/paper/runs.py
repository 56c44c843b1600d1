"""The runs of `dubins_rrt paper`: the paper's RRT and RRT* in an environment, with a seed."""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from itertools import product
from typing import NamedTuple

from dubins_rrt_ros.cli.bench.report import median
from dubins_rrt_ros.cli.common.parser import UsageError
from dubins_rrt_ros.planning import Plan, Problem, Progress, Settings, Vehicle, load_map, plan, prepare
from dubins_rrt_ros.planning.maps.locate import find_map

from ..campaign.runs import results

ENVIRONMENTS, PLANNERS, HEADINGS = ("block", "maze", "forest"), ("rrt", "rrt_star"), ("uniform", "goal", "field")
#: The environment of the paper's table.
MAZE = "maze"
#: The paper's turning radius, and our vehicle, a disc [m].
TURNING_RADIUS, ROBOT_RADIUS = 1.0, 0.2
#: The longest edge: none, as Algorithms 1 and 2 are printed, or two turning radii [m].
UNLIMITED, LIMITED = 0.0, 2.0
STEPS = (UNLIMITED, LIMITED)
#: Samples of the paper's pictures of all environments, of its two other pictures of the maze, and of its table; where else its
#: convergence is looked at; and with how many its open question is answered.
PICTURED, PICTURED_MORE, TABLE = 500, (1000, 3000), (500, 1000, 2000, 3000)
MARKS = (50, 70, 100, 150, 200, 300, 400, 500, 700, 1000, 1400, 2000, 3000)
MOST = 3000
#: The paper's pictures, and the names of the files of the two other figures.
PICTURES = [*product(ENVIRONMENTS, PLANNERS, [PICTURED]), *product([MAZE], ["rrt_star"], PICTURED_MORE)]
CONVERGENCE, QUESTION = "convergence", "question"
#: The samples alone end a run, and not the time [s].
NO_LIMIT = 3600.0


class Run(NamedTuple):
    """What one run is to do.

    Attributes:
        environment: the name of an installed polygon map, with a start and a goal.
        planner, samples, headings, step_size, seed: for the settings.
    """

    environment: str
    planner: str
    samples: int
    headings: str
    step_size: float
    seed: int


class Outcome(NamedTuple):
    """What came of a run; without a path all but `reach` is infinite.

    Attributes:
        length: of the best path [m].
        curves: how many Dubins curves the path has.
        turned: by how many full circles it turns, left and right added up.
        time_to_first: until the first path [s].
        samples_to_first: how many samples were drawn until then, that one included.
        reach: the largest x of the tree's nodes [m].
    """

    length: float
    curves: float
    turned: float
    time_to_first: float
    samples_to_first: float
    reach: float

    @property
    def solved(self) -> bool:
        """Whether there is a path."""
        return math.isfinite(self.length)

    def within(self, samples: int) -> "Outcome":
        """What it was after so many samples, of a run that ends with its first path."""
        return self if self.samples_to_first <= samples else _outcome_without_path(self.reach)


class Measured:
    """The outcomes of all runs, each with the seeds 0 to `seeds` - 1."""

    def __init__(self, outcomes: Mapping[Run, Outcome], seeds: int):
        self.outcomes, self.seeds = outcomes, seeds

    def of(self, environment: str, planner: str, samples: int = MOST, headings: str = "uniform", step_size: float = UNLIMITED
           ) -> list[Outcome]:
        """The outcomes of runs that differ in the seed alone, by seed.

        RRT ends with its first path: its run with most samples tells what those with fewer would have come to.
        """
        drawn = MOST if planner == "rrt" else samples
        runs = [Run(environment, planner, drawn, headings, step_size, seed) for seed in range(self.seeds)]
        return [self.outcomes[run].within(samples) for run in runs]

    def median_run(self, environment: str, planner: str, samples: int) -> tuple[Run, int]:
        """The run whose path has the median length of those that found one, and how many did; else the first run."""
        lengths = [outcome.length for outcome in self.of(environment, planner, samples)]
        found = [length for length in lengths if math.isfinite(length)]
        seed = lengths.index(median(found)) if found else 0
        return Run(environment, planner, samples, "uniform", UNLIMITED, seed), len(found)


def picture_name(environment: str, planner: str, samples: int) -> str:
    """The name of a picture's files, without the ending."""
    return f"{environment}-{planner}-{samples}"


def all_runs(seeds: int) -> list[Run]:
    """All that is to be measured: the paper's runs, and those of its open question."""
    kinds = [(MAZE, "rrt_star", mark, "uniform", UNLIMITED) for mark in MARKS]
    kinds += [(environment, "rrt_star", PICTURED, "uniform", UNLIMITED) for environment in ENVIRONMENTS]
    kinds += [(environment, planner, MOST, headings, step_size)
              for environment, planner, headings, step_size in product(ENVIRONMENTS, PLANNERS, HEADINGS, STEPS)]
    return [Run(*kind, seed) for kind in dict.fromkeys(kinds) for seed in range(seeds)]


def outcomes(runs: Iterable[Run], jobs: int) -> Iterator[tuple[Run, Outcome]]:
    """The runs with what came of them, in any order, measured in `jobs` processes; one is this process.

    Raises:
        UsageError: a process was killed.
    """
    yield from map(measure, runs) if jobs == 1 else results(measure, runs, jobs, NO_LIMIT, _lost)


def measure(run: Run) -> tuple[Run, Outcome]:
    """Plan once."""
    drawn_at_first = []

    def note(progress: Progress) -> None:
        if progress.improved and not drawn_at_first:
            drawn_at_first.append(progress.samples)

    answer = planned(run, note)
    reach = float(answer.tree.poses[:, 0].max())
    if answer.path is None:
        return run, _outcome_without_path(reach)
    return run, Outcome(answer.length, len(answer.path.curves), _turned(answer), answer.time_to_first, drawn_at_first[0], reach)


def planned(run: Run, on_progress: Callable[[Progress], None] = lambda progress: None) -> Plan:
    """The plan of a run: Algorithms 1 and 2, with none of what goes beyond them."""
    settings = Settings(planner=run.planner, samples=run.samples, planning_time=NO_LIMIT, step_size=run.step_size,
                        heading_sampling=run.headings, informed=False, shortcut=False, seed=run.seed)
    return plan(problem_in(run.environment), settings, on_progress=on_progress)


@lru_cache
def problem_in(environment: str) -> Problem:
    """The environment with the start and the goal that its file names, ready to plan in."""
    file = find_map(f"{environment}.geojson")
    poses = json.loads(file.read_text(encoding="utf-8"))
    world = prepare(load_map(file), Vehicle(TURNING_RADIUS, ROBOT_RADIUS))
    return Problem(world, start=poses["start"], goal=poses["goal"])


def _outcome_without_path(reach: float) -> Outcome:
    return Outcome(*[math.inf] * 5, reach)


def _turned(answer: Plan) -> float:
    turns = (arc.length for curve in answer.path.curves for arc in curve.arcs if arc.curvature != 0)
    return sum(turns) / (math.tau * answer.problem.vehicle.turning_radius)


def _lost(run: Run, what: str) -> tuple[Run, Outcome]:
    raise UsageError(f"{run.planner} in {run.environment} with seed {run.seed}: {what}; give fewer --jobs")
