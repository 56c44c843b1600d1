"""`dubins_rrt play`: serve a page on which the path follows the mouse, and open it in the browser."""

import argparse
import asyncio
import contextlib
import os
import webbrowser
from importlib.util import find_spec
from typing import TYPE_CHECKING

from dubins_rrt_ros.planning.text import install_command

from ..common.example import MAP
from ..common.parser import Parser, UsageError, describe
from ..common.request import add_map_arguments, given_map_options, map_options, read_map
from .workbench import Workbench

if TYPE_CHECKING:
    from .server import MakeSession


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="[MAP] [options]",
        description="Opens a page in the browser: drag start and goal, and see path and tree while you drag; change the vehicle "
                    "and the settings, draw obstacles. It is served on 127.0.0.1 alone, without ROS, until Ctrl-C.",
        examples=["dubins_rrt play", f"dubins_rrt play {MAP}.geojson --folder ."],
        notes="Only a page with the token of the printed address is served.",
        exit_status="0 ended by Ctrl-C, 2 wrong usage")
    action = add_map_arguments(parser)
    action.nargs, action.default, action.required = "?", MAP, False
    parser.add_argument("--folder", metavar="DIR", default=".",
                        help="folder that the page may load maps from, and save them to, with its subfolders; default: the "
                             "current one")
    add_page_flags(parser)


def add_page_flags(parser: Parser) -> None:
    """Give the parser the flags of a command that serves a page."""
    parser.add_argument("--port", metavar="N", type=int, default=0, help="port on 127.0.0.1; default: any that is free")
    parser.add_argument("--no-browser", action="store_true", help="print the address of the page, and open no browser")


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C, and return the exit status."""
    check_page_flags(arguments)
    if not os.path.isdir(arguments.folder):
        raise UsageError(f"there is no folder {arguments.folder}; make it first")
    from .session import Session
    world_map, _ = read_map(arguments.map, **map_options(arguments))
    workbench = Workbench(world_map, arguments.map, arguments.folder, given_map_options(arguments))
    return serve(lambda send: Session(workbench, send), f"Playing on {workbench.name}", arguments)


def check_page_flags(arguments: argparse.Namespace) -> None:
    """Refuse to serve a page without aiohttp, or on no port.

    Raises:
        UsageError: aiohttp is not installed; or the port is none.
    """
    if find_spec("aiohttp") is None:
        raise UsageError(f"the page is served by aiohttp, which is not installed; run: {install_command('play')}")
    if not 0 <= arguments.port <= 65535:
        raise UsageError(f"--port is {arguments.port}; give a number from 0 to 65535")


def serve(make_session: "MakeSession", doing: str, arguments: argparse.Namespace) -> int:
    """Serve pages until Ctrl-C, and return the exit status.

    Args:
        make_session: takes what sends to a page, and returns what serves it.
        doing: what is served, for people.
        arguments: those of `add_page_flags`.
    """
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_serve(make_session, doing, arguments.port, not arguments.no_browser))
    return 0


async def _serve(make_session: "MakeSession", doing: str, port: int, opens_browser: bool) -> None:
    from .server import HOST, PlayServer  # here, since it takes aiohttp
    server = PlayServer(make_session)
    try:
        await server.start(port)
    except OSError as error:
        raise UsageError(f"port {port} of {HOST} cannot be used: {error.strerror}") from None
    print(f"{server.url}\n{doing}, until Ctrl-C.", flush=True)
    if opens_browser:
        webbrowser.open(server.url)
    try:
        await asyncio.Event().wait()
    finally:
        await server.stop()
