"""What plan() returns."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from .path import Path
from .problem import Problem
from .settings import Settings
from .tree import Tree


class Status(IntEnum):
    """How a request ended; 0 and 200 to 208 are Nav2's numbers for ComputePathToPose."""

    NONE = 0
    UNKNOWN = 200
    TF_ERROR = 202
    START_OUTSIDE_MAP = 203
    GOAL_OUTSIDE_MAP = 204
    START_OCCUPIED = 205
    GOAL_OCCUPIED = 206
    TIMEOUT = 207
    NO_VALID_PATH = 208
    NO_MAP = 210
    NO_START = 211
    INVALID_POSE = 212
    CANCELLED = 213


@dataclass(frozen=True, eq=False)
class Plan:
    """The answer to a request; the tree is part of it, also on failure.

    Attributes:
        status: how it ended; NONE is success.
        message: one sentence for a person: what happened, the measured figures, what to change.
        problem, settings: the request, with the seed that was used.
        path: the audited path, or None.
        tree: the search tree; it holds the start alone where nothing was searched.
        samples: how many samples were drawn.
        culprit: (x, y) of what shows why there is no path: the nearest obstacle, the narrowest place, the first hit [m]; or None.
        cancelled: whether it was cancelled; with a path, that is the best by then.
        time_to_first: until the search found its first path, its audit not counted [s], or None.
        planning_time: from request to answer, the clearance field not counted [s].
        map_time: for the clearance field, and the loading of the map where the caller added it [s].
        lower_bound: no path of the problem is shorter [m].
        min_clearance: the least distance from the path to an obstacle, by the audit [m], or None.
        max_curvature: of the path, by the audit [1/m], or None.
        audit: "ok" with a path, else what the audit found, or "" where there was nothing to audit.
    """

    status: Status
    message: str
    problem: Problem
    settings: Settings
    tree: Tree
    path: Path | None = None
    samples: int = 0
    culprit: tuple[float, float] | None = None
    cancelled: bool = False
    time_to_first: float | None = None
    planning_time: float = 0.0
    map_time: float = 0.0
    lower_bound: float = 0.0
    min_clearance: float | None = None
    max_curvature: float | None = None
    audit: str = ""

    @property
    def length(self) -> float | None:
        """Of the path [m], or None."""
        return self.path.length if self.path else None

    @property
    def gap(self) -> float | None:
        """length / lower_bound - 1, 0 for a path of length 0, infinite where the bound says nothing, None without a path."""
        if self.path is None:
            return None
        if self.lower_bound == 0:
            return math.inf if self.length > 0 else 0.0
        return self.length / self.lower_bound - 1


@dataclass(frozen=True)
class Progress:
    """How far a request has come.

    Attributes:
        samples: drawn so far.
        elapsed: since the request [s].
        length: of the best path so far [m], or None.
        improved: whether this report was made because the best path is new.
        snapshot: a function that returns the audited Plan so far; it costs an audit, so call it only to use it, and
            only before the callback returns.
    """

    samples: int
    elapsed: float
    length: float | None
    improved: bool
    snapshot: Callable[[], Plan]
