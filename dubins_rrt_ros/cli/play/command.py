"""`dubins_rrt play`: serve a page on which the path follows the mouse, and open it in the browser."""

import argparse
import asyncio
import os
import webbrowser
from importlib.util import find_spec

from dubins_rrt_ros.planning.text import install_command

from ..common.example import MAP
from ..common.parser import Parser, UsageError, describe
from ..common.request import add_map_arguments, map_options, read_map
from .workbench import Workbench


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
    parser.add_argument("--port", metavar="N", type=int, default=0, help="port on 127.0.0.1; default: any that is free")
    parser.add_argument("--no-browser", action="store_true", help="print the address of the page, and open no browser")


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C, and return the exit status."""
    if find_spec("aiohttp") is None:
        raise UsageError(f"the page is served by aiohttp, which is not installed; run: {install_command('play')}")
    if not os.path.isdir(arguments.folder):
        raise UsageError(f"there is no folder {arguments.folder}; make it first")
    if not 0 <= arguments.port <= 65535:
        raise UsageError(f"--port is {arguments.port}; give a number from 0 to 65535")
    world_map, _ = read_map(arguments.map, **map_options(arguments))
    workbench = Workbench(world_map, arguments.map, arguments.folder)
    try:
        asyncio.run(_serve(workbench, arguments.port, not arguments.no_browser))
    except KeyboardInterrupt:
        print()
    return 0


async def _serve(workbench: Workbench, port: int, opens_browser: bool) -> None:
    from .server import HOST, PlayServer  # here, since it takes aiohttp
    server = PlayServer(workbench)
    try:
        await server.start(port)
    except OSError as error:
        raise UsageError(f"port {port} of {HOST} cannot be used: {error.strerror}") from None
    print(f"{server.url}\nPlaying on {workbench.name}, until Ctrl-C.", flush=True)
    if opens_browser:
        webbrowser.open(server.url)
    try:
        await asyncio.Event().wait()
    finally:
        await server.stop()
