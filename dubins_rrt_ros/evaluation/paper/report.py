"""The report of `dubins_rrt paper`, in Markdown: the paper's pictures and table, and the answer to its open question."""

import math
import textwrap
from itertools import pairwise, product
from typing import Any

from dubins_rrt_ros import __version__
from dubins_rrt_ros.cli.bench.report import median, metres, milliseconds, quartiles, table, with_quartiles
from dubins_rrt_ros.planning.pictures.drawing import planner_title

from .answer import FOUND, WHY, found, why
from .runs import (
    CONVERGENCE,
    ENVIRONMENTS,
    HEADINGS,
    LIMITED,
    MARKS,
    MAZE,
    MOST,
    PICTURES,
    PLANNERS,
    QUESTION,
    ROBOT_RADIUS,
    STEPS,
    TABLE,
    TURNING_RADIUS,
    Measured,
    RunOutcome,
    picture_name,
)

#: The paper's table, of one run in a maze whose coordinates it does not give [m].
PAPERS = {500: (22.54, 22.24), 1000: (22.54, 22.19), 2000: (22.54, 20.75), 3000: (22.54, 20.26)}
#: Maximum number of letters in a line of text.
WIDTH = 130
HEADINGS_TITLES = {"uniform": "uniform", "goal": "towards the goal", "field": "along the field"}

INTRODUCTION = """\
A. Khanal, *RRT and RRT\\* Using Vehicle Dynamics*, measured again with {seeds} seeds in place of one run. All is planned by its
Algorithms 1 and 2: positions uniform over the map, headings uniform, turning radius {radius:g} m, none of this planner's
additions (`informed: false`, `shortcut: false`, `heading_sampling: uniform`). What the paper leaves open is set so: the
environments are ours, in the same manner, for it gives no coordinates; the vehicle is a disc of radius {robot_radius:g} m; the
goal is drawn in place of 5 % of the samples; steps have no limit; and RRT\\* chooses a new link's parent among the near ones
too, the half of Karaman and Frazzoli's algorithm that Algorithm 2 leaves out.

Each figure is the lower median over the seeds, in brackets the quartiles: values that were measured. A run without a path counts
as infinitely long, and a dash is an infinite figure.
"""
PICTURES_TEXT = """\
Light blue is the tree, orange the path with what the vehicle sweeps. Each picture shows the run whose path has the median length
of those that found one. RRT ends with its first path; RRT\\* uses all its samples.
"""
CONVERGENCE_TEXT = """\
RRT stays what it first found: its median falls only while some seeds have no path yet. RRT\\* becomes shorter: with the same
seed, more samples gave a path that is not longer in {fell} of {pairs} pairs of neighbouring marks of the figure. With {most}
samples it is {shorter} shorter than RRT; in the paper it is {papers}.
"""
QUESTION_TEXT = """\
The paper asks what happens without a limit to the step size and with headings that always point towards the goal. Here are all
combinations of no limit and steps of {limit:g} m, two turning radii, with headings that are uniform, that point straight towards
the goal, or that point along the shortest way there around obstacles (the field of the cost-to-go), each with {most} samples and
{seeds} seeds. {times}
"""
NOTE = "The two paragraphs were written from the medians of 30 seeds; the figures in them are computed from these runs."


def headline(measured: Measured) -> str:
    """Write the result of the paper's table in a line."""
    rrt, star = (median(run.length for run in measured.of(MAZE, planner)) for planner in ("rrt", "rrt_star"))
    return (f"{MAZE}, {MOST} samples, {measured.seeds} seeds: RRT {metres(rrt)} m, RRT* {metres(star)} m, {_gain(rrt, star)} "
            f"shorter; the paper: {_gain(*PAPERS[MOST])}")


def to_markdown(measured: Measured, jobs: int | None, seconds: float) -> str:
    """Write the report of runs that took `seconds` in `jobs` processes, or on a cluster."""
    flags = "--scheduler ..." if jobs is None else f"--jobs {jobs}"
    made = (f"Made by `dubins_rrt paper --seeds {measured.seeds} {flags}`, version {__version__}: {len(measured.outcomes)} "
            f"runs and all figures in {seconds:.0f} s. Every run is a line of `runs.jsonl`.")
    parts = ["# The paper, measured again",
             _prose(INTRODUCTION, seeds=measured.seeds, radius=TURNING_RADIUS, robot_radius=ROBOT_RADIUS),
             "## RRT and RRT\\*", _prose(PICTURES_TEXT), *_pictures(),
             f"## The table: length in the {MAZE} over samples", _papers_table(measured),
             _image(CONVERGENCE, "Length over samples, RRT and RRT*"), _prose(CONVERGENCE_TEXT, **_convergence(measured)),
             "## The open question: step size and headings",
             _prose(QUESTION_TEXT, limit=LIMITED, most=MOST, seeds=measured.seeds, times=_times(jobs)),
             _question_table(measured), _image(QUESTION, "Time to the first path, and lengths, by headings and step size"),
             _prose(FOUND, **found(measured)), _prose(WHY, **why(measured)), _prose(NOTE), _prose(made)]
    return "\n\n".join(parts) + "\n"


def _times(jobs: int | None) -> str:
    """Say what the times of the open question are."""
    if jobs is None:
        return "Times are left out: the runs were made on a cluster."
    at_once = "one process" if jobs == 1 else f"{jobs} processes at once"
    return f"Times are those of {at_once}; they hold the computation of the field, but not that of the map's clearance."


def to_document(measured: Measured) -> dict[str, Any]:
    """Return the report's tables and its answer for JSON, infinite figures included; in seconds and metres."""
    table = [{"samples": samples, "paper": dict(zip(PLANNERS, PAPERS[samples], strict=True)),
              **{planner: _figures(measured.of(MAZE, planner, samples)) for planner in PLANNERS}} for samples in TABLE]
    question = [{"environment": environment, "heading_sampling": headings, "step_size": step_size,
                 **{planner: _figures(measured.of(environment, planner, headings=headings, step_size=step_size))
                    for planner in PLANNERS}}
                for environment, headings, step_size in product(ENVIRONMENTS, HEADINGS, STEPS)]
    return {"seeds": measured.seeds, "table": table, "question": question, "version": __version__,
            "answer": [_prose(FOUND, **found(measured)), _prose(WHY, **why(measured))]}


def _figures(runs: list[RunOutcome]) -> dict[str, Any]:
    return {"runs": len(runs), "solved": sum(run.solved for run in runs), "length": quartiles(run.length for run in runs),
            "time_to_first": quartiles(run.time_to_first for run in runs),
            "samples_to_first": quartiles(run.samples_to_first for run in runs)}


def _prose(template: str, **values: Any) -> str:
    """Fill in the values of paragraphs, and wrap them."""
    paragraphs = template.format(**values).strip().split("\n\n")
    return "\n\n".join(textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False) for text in paragraphs)


def _image(name: str, title: str) -> str:
    return f"[![{title}]({name}.png)]({name}.svg)"


def _pictures() -> list[str]:
    """Write the pictures in tables of two side by side."""
    pairs = [PICTURES[i:i + 2] for i in range(0, len(PICTURES), 2)]
    return [table([_picture_title(*picture) for picture in pair],
                  [[_image(picture_name(*picture), _picture_title(*picture)) for picture in pair]]) for pair in pairs]


def _picture_title(environment: str, planner: str, samples: int) -> str:
    return f"{planner_title(planner)}, {environment}, {samples} samples".replace("*", "\\*")


def _papers_table(measured: Measured) -> str:
    head = ["samples", "RRT: paths", "RRT [m]", "RRT\\*: paths", "RRT\\* [m]", "RRT\\* shorter by", "the paper's RRT [m]",
            "its RRT\\* [m]", "shorter by"]
    return table(head, [_papers_row(measured, samples) for samples in TABLE])


def _papers_row(measured: Measured, samples: int) -> list[str]:
    rrt, star = (measured.of(MAZE, planner, samples) for planner in ("rrt", "rrt_star"))
    gain = _gain(*(median(run.length for run in runs) for runs in (rrt, star)))
    papers = PAPERS[samples]
    return [str(samples), _solved(rrt), _lengths(rrt), _solved(star), _lengths(star), gain, *map(metres, papers),
            _gain(*papers)]


def _convergence(measured: Measured) -> dict[str, Any]:
    """Return the values of CONVERGENCE_TEXT."""
    by_mark = [[run.length for run in measured.of(MAZE, "rrt_star", mark)] for mark in MARKS]
    steps = [(before, after) for pair in pairwise(by_mark) for before, after in zip(*pair, strict=True)]
    rrt, star = (median(run.length for run in measured.of(MAZE, planner)) for planner in ("rrt", "rrt_star"))
    return {"fell": sum(after <= before for before, after in steps), "pairs": len(steps), "most": MOST,
            "shorter": _gain(rrt, star), "papers": _gain(*PAPERS[MOST])}


def _question_table(measured: Measured) -> str:
    head = ["environment", "headings", "step", "RRT: paths", "first path [ms]", "after samples", "length [m]",
            "RRT\\*: paths", "first path [ms]", "after samples", "length [m]"]
    return table(head, [_question_row(measured, *kind) for kind in product(ENVIRONMENTS, HEADINGS, STEPS)])


def _question_row(measured: Measured, environment: str, headings: str, step_size: float) -> list[str]:
    kinds = (measured.of(environment, planner, headings=headings, step_size=step_size) for planner in ("rrt", "rrt_star"))
    return [environment, HEADINGS_TITLES[headings], f"{step_size:g} m" if step_size else "no limit",
            *(cell for runs in kinds for cell in _question_cells(runs))]


def _question_cells(runs: list[RunOutcome]) -> list[str]:
    return [_solved(runs), with_quartiles([run.time_to_first for run in runs], milliseconds),
            metres(median(run.samples_to_first for run in runs), 0), _lengths(runs)]


def _solved(runs: list[RunOutcome]) -> str:
    return f"{sum(run.solved for run in runs)}/{len(runs)}"


def _lengths(runs: list[RunOutcome]) -> str:
    return with_quartiles([run.length for run in runs], metres)


def _gain(rrt: float, star: float) -> str:
    """Write by how much RRT* is shorter."""
    return f"{100 * (1 - star / rrt):.1f} %" if math.isfinite(rrt) and math.isfinite(star) else "-"
