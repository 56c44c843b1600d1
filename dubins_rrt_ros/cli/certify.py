"""`dubins_rrt certify`: plan a path, and write it with the proof of how short it is."""

import argparse

from dubins_rrt_ros.planning.settings import SHORTEST

from . import plan
from .common.certificates import add_certificate_flags
from .common.example import ENDS, MAP
from .common.parser import Parser, describe


def add_arguments(parser: Parser) -> None:
    """Give the parser the flags and the help of the command."""
    describe(
        parser, usage="MAP --start X Y YAW --goal X Y YAW --out FILE.cert [options]",
        description="Plans a path on a map, proves that no path is much shorter, and writes both for `dubins_rrt check`.",
        notes="The map is a map_server YAML file, or polygons as GeoJSON or WKT. The proof is of the length, at any "
              "preferred_clearance; with 0, the default here, the path is the shortest that was found.",
        examples=[f"dubins_rrt certify {MAP} {ENDS} --seconds 2 --out path.cert", f"dubins_rrt check path.cert {MAP}"],
        exit_status="0 the file is written, 1 no path: its error_code and the reason are on standard error, 2 wrong usage, "
                    "130 interrupted")
    plan.add_request_arguments(parser, certified=True)
    parser.add_argument("--out", metavar="FILE.cert", required=True, help="the file to write")
    add_certificate_flags(parser)


def run(arguments: argparse.Namespace) -> int:
    """Plan, prove, write the file, and return the exit status."""
    return plan.run(argparse.Namespace(json=None, csv=None, plot=None, drive=None, replay=None,
                                       certificate=arguments.out, **SHORTEST | vars(arguments)))
