"""The records of `dubins_rrt bench`: runs read from lines of JSON, and the shortest known lengths of their problems."""

import json
import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from dubins_rrt_ros.planning.text import fixed, one_line

from ..common.documents import read_json, read_text
from ..common.parser import UsageError


class RunRecord(NamedTuple):
    """The record of one run.

    Attributes:
        problem, planner, seed: the problem, the planner and its seed.
        solved: True if it has a path that passed its check.
        trace: (time [s], cost [m]) of each improvement, with falling costs; empty for a run that is not solved. Times of a run
            on a cluster, whose machines may differ and share their cores, are infinite.
        end: time until which the result is known [s]: its limit, or its end if that was later.
        total: duration, at most the time limit [s]; 0 for a run on a cluster.
        samples, nodes: number of samples drawn, and of nodes of the tree; 0 where the line does not say.
        reason: why it is not solved; "" where it is, or the line does not say.
    """

    problem: str
    planner: str
    seed: int
    solved: bool
    trace: tuple[tuple[float, float], ...]
    end: float
    total: float
    samples: int
    nodes: int
    reason: str = ""

    @property
    def first(self) -> tuple[float, float]:
        """Time [s] and cost [m] of the first path."""
        return self.trace[0] if self.trace else (math.inf, math.inf)

    @property
    def cost(self) -> float:
        """Cost of the best path [m]."""
        return self.trace[-1][1] if self.trace else math.inf

    def cost_at(self, time: float) -> float:
        """Return the cost of the best path at a time [m]."""
        done = bisect_right(self.trace, (time, math.inf))
        return self.trace[done - 1][1] if done and time <= self.end else math.inf

    def time_to(self, cost: float) -> float:
        """Return the time at which a path first cost no more than that [s]."""
        return next((at for at, reached in self.trace if reached <= cost), math.inf)


class Best(NamedTuple):
    """The shortest known length of a problem [m], and its source."""

    cost: float
    source: str


#: The runs by problem, then by planner.
Runs = Mapping[str, Mapping[str, list[RunRecord]]]


def parse_record(line: Mapping[str, Any]) -> RunRecord:
    """Parse a line of `dubins_rrt bench`, or of a program that writes the same fields.

    The path passed its check if the field `audit` is "ok", or `verify.step_ok` is true; without either `solved` is believed.
    `samples` and `vertices` are optional. Lines of a cluster have `cluster`.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: a field is missing or wrong.
    """
    if not isinstance(line, Mapping):
        raise TypeError("it is no object")
    passed = line.get("audit", "ok") == "ok" and line.get("verify", {}).get("step_ok", True)
    solved = bool(line["solved"] and passed)
    limit, total = float(line.get("time_limit") or math.inf), float(line["total_s"])
    if not 0 <= total < math.inf:
        raise ValueError(f"its total_s is {total:g}")
    trace = _improvements(line["trace"]) if solved else ()
    if line.get("cluster"):
        trace, total = tuple((math.inf, cost) for _, cost in trace), 0.0
    if solved and not trace:
        raise ValueError("it is solved, but its trace is empty")
    return RunRecord(
        problem=str(line["problem"]), planner=str(line["planner"]), seed=int(line["seed"]), solved=solved, trace=trace,
        end=max(limit, total), total=min(limit, total), samples=int(line.get("samples") or 0),
        nodes=int(line.get("vertices") or 0), reason="" if solved else _reason(line))


def _reason(line: Mapping[str, Any]) -> str:
    """Return why a run is not solved, by its name and its sentence, as far as the line has them."""
    return ": ".join(one_line(str(line[name])) for name in ("error_name", "message") if line.get(name))


def _improvements(trace: Iterable[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Return the entries of a trace that improve on all before."""
    improvements: list[tuple[float, float]] = []
    for time, cost in sorted((float(time), float(cost)) for time, cost in trace):
        if not (0 <= time < math.inf and 0 <= cost < math.inf):
            raise ValueError(f"its trace holds [{time:g}, {cost:g}]")
        if not improvements or cost < improvements[-1][1]:
            improvements.append((time, cost))
    return tuple(improvements)


def grouped(runs: Iterable[RunRecord]) -> Runs:
    """Group runs by problem and planner, both in the order of their first run."""
    groups: dict[str, dict[str, list[RunRecord]]] = {}
    for run in runs:
        groups.setdefault(run.problem, {}).setdefault(run.planner, []).append(run)
    return groups


def read_runs(files: Iterable[str]) -> Runs:
    """Read the runs in files of JSON lines.

    Raises:
        UsageError: a file cannot be read, a line is no run, a run occurs twice, or there is none.
    """
    runs: list[RunRecord] = []
    places: dict[tuple[str, str, int], str] = {}
    for file in files:
        for number, text in enumerate(read_text(file).split("\n"), 1):
            if not text.strip():
                continue
            place = f"{file}, line {number}"
            run = _read_run(text, place)
            before = places.setdefault((run.problem, run.planner, run.seed), place)
            if before != place:
                raise UsageError(f"{place} is the run of {run.planner} on {run.problem} with seed {run.seed} again, after "
                                 f"{before}; leave one out, or tell the rows apart by `dubins_rrt bench --label`")
            runs.append(run)
    if not runs:
        raise UsageError("there are no runs to report; give files that `dubins_rrt bench --out` wrote")
    return grouped(runs)


def _read_run(text: str, place: str) -> RunRecord:
    try:
        return parse_record(json.loads(text))
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        reason = f"it has no {error}" if isinstance(error, KeyError) else str(error)
        raise UsageError(f"{place} is no run, for {reason}; give files that `dubins_rrt bench --out` wrote, and drop lines that "
                         "were cut short") from error


def read_best_known(file: str) -> dict[str, float]:
    """Read the lengths in a file {problem: m} or {problem: {"cost": m}} [m].

    Raises:
        UsageError: it is no such file.
    """
    document = read_json(file)
    entries = document.items() if isinstance(document, dict) else [("", document)]
    costs: dict[str, Any] = {name: entry.get("cost") if isinstance(entry, dict) else entry for name, entry in entries}
    wrong = [name for name, cost in costs.items() if type(cost) not in (int, float) or not 0 < cost < math.inf]
    if wrong:
        raise UsageError(f"{file}: what it has for {wrong[0] or 'the problems'} is no length; give {{problem: metres, ...}}")
    return costs


def best_known(runs: Runs, given: Mapping[str, float]) -> dict[str, Best]:
    """Return the shortest known length of each problem: the given one, or that of a run if it is shorter or none is given."""
    return {problem: _best(planners, given.get(problem)) for problem, planners in runs.items()}


def _best(planners: Mapping[str, list[RunRecord]], given: float | None) -> Best:
    run = min((run for group in planners.values() for run in group), key=lambda run: run.cost)
    if given is not None and given <= run.cost:
        return Best(given, "as given")
    found = f"the best of these runs, of {run.planner} with seed {run.seed}" if run.solved else "no run is solved"
    return Best(run.cost, found if given is None else f"**new**: {found}, below the {fixed(given, 4)} m given")
