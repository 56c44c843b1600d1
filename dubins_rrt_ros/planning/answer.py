"""An audited path, which is the answer to a request, and the sentence that tells of it."""

import math
from dataclasses import dataclass

from .audit.verdict import Audit
from .curves.angles import heading_error, position_error
from .curves.path import Path
from .diagnosis import explain
from .problem import Problem
from .result import Status, gap_above
from .search.cost import minimises_length
from .search.tree import Tree
from .settings import Settings
from .work import NO_WORK, WorkDone

#: What may find a path, by the values of `Plan.found_by`.
ALGORITHMS = {"hybrid_astar": "hybrid A*", "rrt": "RRT", "rrt_star": "RRT*", "seed_path": "the seed path"}
#: A path shorter by less than this is no improvement [m].
LEAST_IMPROVEMENT = 1e-6


@dataclass(frozen=True, eq=False)
class AuditedPath:
    """A path that passed its audit, with the search as it was then.

    Attributes:
        cost: the cost of the path [m].
        found: the best path of the search, of which this one is a simpler form, or the same.
        is_simple: False where the path was not simplified, since the first one is not to wait for that, or not wholly.
        work: where the work that made it ended.
    """

    path: Path
    audit: Audit
    tree: Tree
    samples: int
    found_by: str = ""
    cost: float = 0.0
    found: Path | None = None
    is_simple: bool = True
    work: WorkDone = NO_WORK

    def improves(self, other: "AuditedPath | None") -> bool:
        """Return True if this is worth a report after the other."""
        if other is None or self.cost < other.cost - LEAST_IMPROVEMENT:
            return True
        return self.is_simple > other.is_simple and self.path != other.path

    def outlasts(self, other: "AuditedPath", price: float) -> bool:
        """Return True if this stays the answer after a cheaper path that there was no time to simplify.

        Args:
            price: of a curve [m].
        """
        more = len(other.path.curves) - len(self.path.curves)
        return self.is_simple > other.is_simple and self.cost < other.cost + price * more


def success_message(problem: Problem, settings: Settings, answer: AuditedPath, bounds: tuple[float, float], elapsed: float, *,
                    cancelled: bool, running: bool, proved: bool) -> str:
    """Return what was found, in a sentence.

    Args:
        bounds: lower bounds of the length and of the cost [m].
        elapsed: time since the request began [s].
        running: True while the search goes on.
        proved: True if the gap is the one that was to be proved.
    """
    path = answer.path
    so_far = " so far" if running else ""
    above = _above_the_least(problem, settings, answer, bounds, "proved to be " if proved and not problem.is_free else "")
    budget = settings.samples if settings.planner == "rrt_star" and not running else 0
    found = f", found by {ALGORITHMS[answer.found_by]}" if answer.found_by else ""
    message = f"Path of {path.length:.2f} m{so_far}{above}{found}, {effort(answer.samples, elapsed, cancelled, budget)}"
    if problem.vehicle.required_clearance < 0:
        message += f"; {explain.NO_DISC}, so that obstacles raise no bound"
    if problem.is_free:
        message += f"; is_free was asked every {problem.fine_spacing:g} m along it, and not between"
    return f"{message}{end_clause(problem, path)}."


def effort(samples: int, elapsed: float, cancelled: bool, budget: int = 0) -> str:
    """Return after how many samples and in what time [s] a path was found, and whether that was the end, as a clause.

    Args:
        budget: number of samples that were asked for, which is told where they were fewer.
    """
    of_budget = f" of {budget}" if samples < budget else ""
    many = f"{of_budget} sample{'' if samples == 1 and not of_budget else 's'}"
    drawn = f"after {samples}{many}" if samples else f"before the first{many if budget else ' sample'},"
    return f"{'cancelled ' if cancelled else ''}{drawn} in {elapsed:.3g} s"


def end_clause(problem: Problem, path: Path) -> str:
    """Return how far from the goal a path ends, as a clause; "" where it has to end there exactly."""
    if problem.exact_goal:
        return ""
    off, turned = position_error(path.end, problem.goal), heading_error(path.end, problem.goal)
    if problem.any_goal_heading:
        return f"; it ends {off:.3f} m from the goal, with the heading {path.end[2]:.3f} rad"
    return f"; it ends {off:.3f} m and {turned:.3f} rad from the goal"


def not_audited(path: Path, cancelled: bool) -> tuple[Status, str]:
    """Return the status of a request that ended before a path that was found was audited, and the sentence on it."""
    if cancelled:
        return Status.CANCELLED, f"Cancelled before a first path: one of {path.length:.2f} m was found, but not audited yet."
    return Status.TIMEOUT, f"A path of {path.length:.2f} m was found, but there was no time left to audit it; allow more time."


def defect_message(audit: Audit) -> str:
    """Return what is said of a path that failed its audit, in a sentence."""
    return f"A defect in the planner: its path failed the audit: {audit}. Please report it."


def _above_the_least(problem: Problem, settings: Settings, answer: AuditedPath, bounds: tuple[float, float], proved: str) -> str:
    """Return how far the path is above the shortest, or the cheapest, possible at most."""
    if not minimises_length(problem, settings):
        gap = gap_above(bounds[1], answer.cost)
        cost = f" with a cost of {answer.cost:.2f} m"
        return cost + (f", {proved}at most {100 * gap:.1f} % above the least possible" if math.isfinite(gap) else "")
    gap = gap_above(bounds[0], answer.path.length)
    if not math.isfinite(gap):
        return ""
    least = "the Dubins curve without obstacles" if problem.vehicle.required_clearance < 0 else "the shortest possible"
    return f", {proved}at most {100 * gap:.{1 if gap > 0.001 else 2}f} % above {least}"
