"""The commands of `dubins_rrt`: their names, what each is for, and the module that is imported when it is asked for.

A command's module has two functions: `add_arguments(parser)` gives it flags and help, `run(arguments)` does its work and returns
the exit status. Nothing heavy is imported here, so that `dubins_rrt --help` answers at once.
"""

from collections.abc import Collection
from importlib import import_module
from typing import NamedTuple

from dubins_rrt_ros import __version__

from .common.example import EXAMPLE
from .common.parser import Parser, section


class Command(NamedTuple):
    """A command: its help in one line, and the module that holds it.

    Evaluation is built on this package, so its modules are named here and never imported by name.
    """

    help: str
    module: str


COMMANDS = {
    "plan": Command("plan a path on a map", "dubins_rrt_ros.cli.plan"),
    "audit": Command("judge a path, whoever planned it", "dubins_rrt_ros.cli.audit"),
    "bench": Command("measure the planner on a file of problems, and compare", "dubins_rrt_ros.cli.bench.command"),
    "campaign": Command("try to prove the planner wrong with random problems", "dubins_rrt_ros.evaluation.campaign.command"),
    "certify": Command("plan a path, and prove how short it is", "dubins_rrt_ros.cli.certify"),
    "check": Command("check such a proof by code that shares nothing with the planner", "dubins_rrt_ros.cli.check"),
    "demo": Command("see the ROS node plan in the maze", "dubins_rrt_ros.cli.demo.command"),
    "families": Command("plan problems that are solvable by construction", "dubins_rrt_ros.evaluation.families.command"),
    "figures": Command("draw the figures of the documentation", "dubins_rrt_ros.evaluation.figures.command"),
    "paper": Command("measure again what the paper measured", "dubins_rrt_ros.evaluation.paper.command"),
    "play": Command("drag start and goal in the browser, and see the path follow", "dubins_rrt_ros.cli.play.command"),
    "render": Command("make a map_server pair of a polygon map", "dubins_rrt_ros.cli.render"),
    "watch": Command("see a running node in the browser: map, path, tree and status", "dubins_rrt_ros.cli.watch.command"),
    "completion": Command("let the tab key complete commands, flags and map names", "dubins_rrt_ros.cli.completion"),
}


def make_parser(wanted: Collection[str]) -> Parser:
    """Make the parser that knows all commands by name, and the arguments of those that are wanted."""
    start = section("quick start", EXAMPLE, "dubins_rrt plan --help")
    status = section("exit status", "0 done, 1 no path or a wrong one, 2 wrong usage, 130 interrupted")
    parser = Parser(prog="dubins_rrt", epilog=f"{start}\n\n{status}",
                    description="Plans paths for a vehicle that drives forward and cannot turn on the spot.")
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", title="commands")
    for name, command in COMMANDS.items():
        subparser = subparsers.add_parser(name, help=command.help)
        if name in wanted:
            load_arguments(name, subparser)
    return parser


def load_arguments(name: str, parser: Parser) -> Parser:
    """Give a parser the arguments of a command, and what runs it."""
    module = import_module(COMMANDS[name].module)
    module.add_arguments(parser)
    parser.set_defaults(run=module.run)
    return parser
