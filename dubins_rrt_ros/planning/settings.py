"""The settings of the planner: one frozen dataclass whose fields are options."""

import secrets
from dataclasses import dataclass, field, replace
from typing import Any

from .hooks import Sampler, check_function
from .option import OptionError, convert_options, documented, option
from .text import quoted
from .vehicle import Vehicle
from .work import UNLIMITED_WORK, WorkDone

#: Maximum planning_time [s].
MAX_PLANNING_TIME = 3600.0
#: Minimum planning_time [s].
MIN_PLANNING_TIME = 0.001
#: Minimum path_spacing, where it is not 0 [m].
MIN_SPACING = 0.001
#: Share of the preferred clearance from which on a place counts as roomy: at corners the best path is a little inside it.
ROOMY = 0.8
#: The preferred clearance that stands for the vehicle's inscribed radius.
INSCRIBED = -1.0
#: The options of the paper's plain algorithms.
PAPER = {"informed": False, "shortcut": False, "heading_sampling": "uniform"}
#: The option that makes the length what is minimised.
SHORTEST = {"preferred_clearance": 0.0}


def preferred_clearance_option(default: float) -> Any:
    """Return the option, also for settings with another default."""
    return option(default, "distance of the vehicle's outline from the nearest obstacle below which a metre costs more; 0 seeks "
                  "the shortest path, -1 is the inscribed radius; without effect with informed: false", unit="m", low=INSCRIBED,
                  high=1000.0)


@documented
@dataclass(frozen=True)
class Settings:
    """The planner's settings.

    Attributes:
        sampler: a function of yours that draws the samples, or None: `sampler(rng, n)` gives (n, 3) poses. The share `goal_bias`
            of them is at the goal all the same. It is no option: files and the node do not know it.
        work_limits: where a plan ended that is to be made again, as its `work` tells; no option either.

    Raises:
        HookError: the sampler is no function.
        OptionError: an option is of the wrong type or out of range.
    """

    planner: str = option("rrt_star", "algorithm: rrt ends with its first path, rrt_star uses its whole budget",
                          choices=("rrt", "rrt_star"))
    samples: int = option(3000, "number of samples after which a search that has a path ends; the maximum with informed: false",
                          low=1, high=10_000_000)
    planning_time: float = option(1.0, "time limit", unit="s", low=MIN_PLANNING_TIME, high=MAX_PLANNING_TIME)
    goal_bias: float = option(0.05, "share of the samples drawn at the goal", low=0.0, high=1.0)
    step_size: float = option(0.0, "maximum length of an edge, also when rewired; 0 is unlimited", unit="m", low=0.0, high=1e6)
    heading_sampling: str = option(
        "mixed", "headings of the samples: uniform in [0, 2 pi); goal, straight towards the goal; field, along the shortest way "
        "there around obstacles; mixed, a fifth uniform, the others near field", choices=("uniform", "goal", "field", "mixed"))
    informed: bool = option(True, "find a first path by hybrid A*, then have rrt_star sample only where it can become shorter")
    shortcut: bool = option(True, "shorten each best path by Dubins shortcuts and vertex perturbation, and grow the tree from it")
    preferred_clearance: float = preferred_clearance_option(INSCRIBED)
    clearance_weight: float = option(2.0, "extra cost of a metre in contact: a metre costs 1 + clearance_weight * "
                                     "(1 - room / preferred_clearance)^2", low=0.0, high=100.0)
    cost_weight: float = option(
        0.0, "extra cost of a metre over a cell of 100 %; above 0 a grid's cells between free_thresh and occupied_thresh are "
        "free, and a metre over one of c % costs cost_weight * c / 100 more; 0 leaves them unknown, and so does informed: false",
        low=0.0, high=1000.0)
    path_spacing: float = option(0.0, "maximum distance between two poses of a published path; 0 is the smaller of a cell (of a "
                                 "polygon map a quarter of the inscribed radius) and a tenth of the turning radius, and at least "
                                 "0.01", unit="m", low=0.0, high=1000.0)
    stop_gap: float = option(0.0, "end as soon as the path is proved to be at most this share longer than the shortest possible; "
                             "0 is never", low=0.0, high=1.0)
    length_proof: bool = option(True, "raise lower_bound towards the path's length, on a second core beside the search; it takes "
                                "no longer; without effect on one core, with informed: false, and for rrt")
    seed: int = option(-1, "seed of the random samples; -1 draws a fresh one, which is reported", low=-1, high=2**31 - 1)
    sampler: Sampler | None = field(default=None)
    work_limits: WorkDone = field(default=UNLIMITED_WORK)

    def __post_init__(self) -> None:
        convert_options(self)
        check_function("sampler", self.sampler)
        if 0 < self.path_spacing < MIN_SPACING:
            raise OptionError(f"path_spacing is {self.path_spacing:g}; give 0 or at least {MIN_SPACING:g} [m]")
        if INSCRIBED < self.preferred_clearance < 0:
            raise OptionError(f"preferred_clearance is {self.preferred_clearance:g}; give a distance [m], 0 for the shortest "
                              "path, or -1 for the inscribed radius")

    def preferred_clearance_of(self, vehicle: Vehicle) -> float:
        """Return the room that a vehicle prefers [m]; 0 where the cost is the length."""
        if not self.informed or self.clearance_weight == 0:
            return 0.0
        return vehicle.inscribed_radius if self.preferred_clearance == INSCRIBED else self.preferred_clearance

    @property
    def weight_of_cells(self) -> float:
        """The extra cost of a metre over a cell of 100 %; 0 where cells between the thresholds are unknown."""
        return self.cost_weight if self.informed else 0.0

    def with_seed(self) -> "Settings":
        """Return the settings with a fresh seed in place of -1."""
        return self if self.seed >= 0 else replace(self, seed=secrets.randbits(31))

    @classmethod
    def paper(cls, **others: Any) -> "Settings":
        """Make the settings of plain RRT and RRT*: without hybrid A*, shortcuts and guided headings.

        They are the paper's algorithms, but for the parent of a node of RRT*, which is chosen among the near ones.

        Args:
            others: options by name, which take precedence.
        """
        return cls(**{**PAPER, **others})


def demand_settings(settings: object) -> Settings:
    """Return settings, the defaults for None.

    Raises:
        TypeError: they are none.
    """
    if settings is None:
        return Settings()
    if not isinstance(settings, Settings):
        raise TypeError(f"the settings are {quoted(settings)}; give Settings, such as Settings(samples=3000)")
    return settings
