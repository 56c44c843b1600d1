"""`dubins_rrt watch`: serve a page that shows a running planner, and open it in the browser."""

import argparse
from importlib.util import find_spec

from dubins_rrt_ros.planning.text import install_command

from ..common.parser import Parser, UsageError, describe
from ..play.command import add_page_flags, check_page_flags, serve


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="[options]",
        description="Opens a page in the browser that shows a running planner: map, path, tree, status and parameters. A drag "
                    "sends a start or a goal. It is served on 127.0.0.1 alone, until Ctrl-C.",
        examples=["dubins_rrt watch", "dubins_rrt watch --planner /robot1/planner"],
        notes="Only a page with the token of the printed address is served.",
        exit_status="0 ended by Ctrl-C, 2 wrong usage")
    parser.add_argument("--planner", metavar="NAME", default="/planner",
                        help="name of the node, with its namespace; default: /planner")
    add_page_flags(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C, and return the exit status."""
    check_page_flags(arguments)
    if find_spec("rclpy") is None:
        raise UsageError(f"ROS 2 is not here (no module rclpy); source its setup file, or run: {install_command('ros')}")
    from .listener import Listener  # here, since it takes ROS
    from .session import WatchSession
    name = arguments.planner if arguments.planner.startswith("/") else f"/{arguments.planner}"
    listener = Listener(name)
    try:
        return serve(lambda send: WatchSession(listener, send), f"Watching {name}", arguments)
    finally:
        listener.close()
