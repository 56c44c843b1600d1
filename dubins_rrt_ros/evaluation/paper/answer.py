"""The answer to the paper's open question in two paragraphs, what was found and why, with the figures of the runs."""

import math
from collections.abc import Callable, Iterable
from typing import Any

from dubins_rrt_ros.cli.bench.report import median, metres, milliseconds

from .runs import ENVIRONMENTS, LIMITED, MAZE, UNLIMITED, Measured, RunOutcome

FOUND = """\
**What was found**, in block, maze and forest in this order. *Without a limit to the step* RRT\\*'s paths are shorter: with
uniform headings {star} m, against {star_limited} m with steps of {limit:g} m. RRT's are longer: {rrt} m against {rrt_limited} m.
A first path takes RRT\\* {first} samples without a limit, and {first_limited} with it. *Headings towards the goal*, without a
limit, make RRT\\*'s paths {goal} than uniform ones do. With them RRT finds a path through the maze with {solved} of {seeds}
seeds; with steps of {limit:g} m it does with {solved_limited}, after {goal_samples} samples in place of {uniform_samples} with
uniform headings. *Headings along the field*, without a limit, make RRT\\*'s paths {field} than uniform ones do, and the first
path takes {field_samples} samples; in time, {field_times} ms in place of {times} ms, the computation of the field included.
"""
WHY = """\
**Why.** Long edges need few links. RRT\\*'s path through the maze has {curves} curves without a limit and {curves_limited} with
steps of {limit:g} m, and at each link between them it takes a heading that was drawn at random, or passed on the way to one: it
turns by {turned} full circles, against {turned_limited}. RRT is not rerouted and keeps all that its first path had to pass.
There a limit helps, as it cuts off the end of most edges, where the car would turn into the random heading: RRT turns by
{rrt_turned} full circles without a limit, and by {rrt_turned_limited} with it. Headings towards the goal fit where the way leads
there, as in block and forest; in the maze the car has to drive away from the goal too. RRT asks one link alone, that with the
shortest curve to the new pose. Where all poses point to the goal, it lies straight behind the new pose, on the other side of the
wall: no tree of the {unsolved} runs without a path came beyond x = {reach} m, where the second wall stops the vehicle. A limit
leaves links halfway along curves, with other headings, and these lead on. RRT\\* asks all near links, and from one of them a
curve leads around the wall; but however many samples it draws, at each of them its path must point to the goal. The field points
along the way around obstacles, which fits in all three. This planner's defaults follow from it: `step_size: 0`, and
`heading_sampling: mixed`, headings near the field's and a fifth of them uniform, so that no path is ruled out.
"""


def found(measured: Measured) -> dict[str, Any]:
    """Return the values of FOUND."""
    return {"limit": LIMITED, "seeds": measured.seeds, **_lengths(measured), **_firsts(measured)}


def why(measured: Measured) -> dict[str, Any]:
    """Return the values of WHY."""
    return {"limit": LIMITED, **_shapes(measured), **_stuck(measured)}


def _lengths(measured: Measured) -> dict[str, str]:
    def medians(planner: str, headings: str = "uniform", step_size: float = UNLIMITED) -> list[float]:
        return _medians(measured, lambda run: run.length, planner, headings, step_size)

    star = medians("rrt_star")
    return {"star": _listed(map(metres, star)), "star_limited": _listed(map(metres, medians("rrt_star", step_size=LIMITED))),
            "rrt": _listed(map(metres, medians("rrt"))), "rrt_limited": _listed(map(metres, medians("rrt", step_size=LIMITED))),
            "goal": _listed(map(_compared, medians("rrt_star", "goal"), star)),
            "field": _listed(map(_compared, medians("rrt_star", "field"), star))}


def _firsts(measured: Measured) -> dict[str, str | int]:
    """Return the figures of the first paths."""
    def samples(headings: str = "uniform", step_size: float = UNLIMITED) -> str:
        return _listed(map(_count, _medians(measured, lambda run: run.samples_to_first, "rrt_star", headings, step_size)))

    def times(headings: str) -> str:
        return _listed(map(milliseconds, _medians(measured, lambda run: run.time_to_first, "rrt_star", headings, UNLIMITED)))

    def in_maze(headings: str) -> str:
        return _count(_median(measured, lambda run: run.samples_to_first, MAZE, "rrt", headings, LIMITED))

    solved, solved_limited = (sum(run.solved for run in measured.of(MAZE, "rrt", headings="goal", step_size=step_size))
                              for step_size in (UNLIMITED, LIMITED))
    return {"first": samples(), "first_limited": samples(step_size=LIMITED), "field_samples": samples("field"),
            "field_times": times("field"), "times": times("uniform"), "solved": solved, "solved_limited": solved_limited,
            "goal_samples": in_maze("goal"), "uniform_samples": in_maze("uniform")}


def _shapes(measured: Measured) -> dict[str, str]:
    """Return the number of curves of the paths and how much they turn, with uniform headings."""
    shapes: dict[str, str] = {}
    for ending, step_size in (("", UNLIMITED), ("_limited", LIMITED)):
        curves, turned = (_median(measured, figure, MAZE, "rrt_star", "uniform", step_size)
                          for figure in (lambda run: run.curves, lambda run: run.turned))
        by_rrt = _medians(measured, lambda run: run.turned, "rrt", "uniform", step_size)
        shapes |= {f"curves{ending}": _count(curves), f"turned{ending}": metres(turned),
                   f"rrt_turned{ending}": _listed(map(metres, by_rrt))}
    return shapes


def _stuck(measured: Measured) -> dict[str, str | int]:
    """Return how far RRT came in the maze without a path, with unlimited steps and headings towards the goal."""
    farthest = [run.reach for run in measured.of(MAZE, "rrt", headings="goal") if not run.solved]
    return {"unsolved": len(farthest), "reach": metres(max(farthest, default=math.inf))}


def _medians(measured: Measured, figure: Callable[[RunOutcome], float], planner: str, headings: str, step_size: float
             ) -> list[float]:
    """Return the median of a figure in each environment."""
    return [_median(measured, figure, environment, planner, headings, step_size) for environment in ENVIRONMENTS]


def _median(measured: Measured, figure: Callable[[RunOutcome], float], environment: str, planner: str, headings: str,
            step_size: float) -> float:
    return median(map(figure, measured.of(environment, planner, headings=headings, step_size=step_size)))


def _count(value: float) -> str:
    return metres(value, 0)


def _compared(length: float, other: float) -> str:
    """Write how much longer or shorter one length is than another."""
    if not math.isfinite(length - other):
        return "not to be compared"
    return f"{100 * abs(length / other - 1):.1f} % {'longer' if length > other else 'shorter'}"


def _listed(texts: Iterable[str]) -> str:
    *most, last = texts
    return f"{', '.join(most)} and {last}"
