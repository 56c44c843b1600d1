"""`dubins_rrt demo`: start the installed node, send it a start and a goal over topics, receive the path and draw it."""

import argparse
import sys
from typing import TYPE_CHECKING, Any

from dubins_rrt_ros import __version__
from dubins_rrt_ros.planning import Vehicle
from dubins_rrt_ros.planning.maps.locate import maps_directory

from ..common.example import GOAL, MAP, START
from ..common.output import check_drawing, check_folder, words_for, write_document
from ..common.parser import Parser, add_json_flag, describe
from .process import DemoError, enter_domain, running_planner

if TYPE_CHECKING:
    from .client import Answer

PARAMETERS: dict[str, Any] = {
    "planner": "rrt_star", "turning_radius": 1.0, "robot_radius": 0.2, "samples": 3000, "planning_time": 2.0, "seed": 1}


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="[options]",
        description="Starts the node on the installed maze, sends it a start and a goal over real topics, "
                    "receives the path, draws it and stops the node.",
        examples=["dubins_rrt demo", "dubins_rrt demo --plot maze.svg --json demo.json"],
        exit_status="0 a path was received, 1 none: the reason is on standard error, 2 wrong usage, 130 interrupted")
    parser.add_argument("--plot", metavar="FILE", default="demo.png",
                        help="picture to write (.png, .svg or .pdf); default demo.png")
    add_json_flag(parser, "what was received")


def run(arguments: argparse.Namespace) -> int:
    """Run the demonstration, and return the exit status: 0 with a path."""
    check_folder(arguments.plot, arguments.json)
    check_drawing(arguments.plot)
    try:
        answer, exit_status = _demonstrate()
    except DemoError as error:
        print(f"dubins_rrt demo: error: {error}", file=sys.stderr)
        return 1
    out = words_for(arguments.json)
    print(_report(answer), file=out)
    _draw(arguments.plot, answer)
    if arguments.json:
        write_document(arguments.json, _document(answer))
    print(f"  picture        {arguments.plot}\n  node stopped   exit status {exit_status}", file=out)
    return 0


def _demonstrate() -> tuple["Answer", int]:
    """Return the answer of the node and its exit status.

    Raises:
        DemoError: there is no answer.
    """
    enter_domain()
    from .client import DemoClient
    with running_planner(PARAMETERS | {"map_file": maps_directory() / f"{MAP}.yaml"}) as planner:
        with DemoClient(planner.check) as client:
            answer = client.ask(START, GOAL, PARAMETERS)
        return answer, planner.stop()


def _report(answer: "Answer") -> str:
    figures = answer.figures
    gap = 100 * figures["gap"]
    return (f"  path           {figures['path_length']:.2f} m, {len(answer.path)} poses on the topic plan\n"
            f"  lower bound    {figures['lower_bound']:.2f} m, so at most {gap:.1f} % above the shortest\n"
            f"  first path     after {1000 * figures['time_to_first']:.1f} ms\n"
            f"  planning time  {1000 * figures['planning_time']:.1f} ms for {figures['samples']:.0f} samples, "
            f"{figures['tree_nodes']:.0f} tree nodes")


def _document(answer: "Answer") -> dict[str, Any]:
    """Return the answer as JSON holds it, by the names of a plan's file."""
    figures = answer.figures
    return {"length": figures["path_length"], **figures, "samples": int(figures["samples"]),
            "tree_nodes": int(figures["tree_nodes"]), "poses": answer.path.tolist(), "start": START, "goal": GOAL,
            "settings": PARAMETERS, "version": __version__}


def _draw(file: str, answer: "Answer") -> None:
    # Here, since matplotlib is slow to import.
    from dubins_rrt_ros.planning.pictures.drawing import Drawing, draw, figures_title, path_title
    figures, vehicle = answer.figures, Vehicle(PARAMETERS["turning_radius"], PARAMETERS["robot_radius"])
    draw(file, Drawing(answer.map, START, GOAL, vehicle, answer.tree, answer.path,
                       path_title(PARAMETERS["planner"], figures["path_length"], figures["gap"]),
                       figures_title(int(figures["samples"]), figures["time_to_first"], figures["planning_time"])))
