"""`dubins_rrt check`: check a certificate, by code that shares nothing with the planner."""

import argparse
import sys
from pathlib import Path

from dubins_rrt_ros.checker.check import Refused, check
from dubins_rrt_ros.checker.maps import UnreadableMap
from dubins_rrt_ros.planning.text import quoted_name

from .common.certificates import proved, read_certificate
from .common.example import ENDS, MAP
from .common.parser import Parser, UsageError, describe
from .common.request import find_map_or_suggest


def add_arguments(parser: Parser) -> None:
    """Give the parser the arguments and the help of the command."""
    describe(
        parser, usage="FILE.cert MAP",
        description="Checks a certificate against a map: whether a car can drive its path, free of obstacles, from start to "
                    "goal, and whether no path is shorter than it claims.",
        notes="The checker reads maps and decides thresholds by its own code. docs/proof.md has the argument.",
        examples=[f"dubins_rrt certify {MAP} {ENDS} --seconds 2 --out path.cert", f"dubins_rrt check path.cert {MAP}"],
        exit_status="0 it holds, 1 it does not: standard error says what does not, 2 wrong usage")
    parser.add_argument("certificate", metavar="FILE.cert", help="what `dubins_rrt certify` wrote")
    parser.add_argument("map", metavar="MAP", help="the map's file, or an installed map's name")


def run(arguments: argparse.Namespace) -> int:
    """Check, report, and return the exit status."""
    try:
        claim = check(read_certificate(arguments.certificate), find_map_or_suggest(arguments.map))
    except Refused as refusal:
        print(f"{arguments.certificate} does not hold: {refusal}", file=sys.stderr)
        return 1
    except UnreadableMap as error:
        raise UsageError(str(error)) from None
    except OSError as error:
        file = error.filename if isinstance(error.filename, str | Path) else arguments.certificate  # of an open one a number
        raise UsageError(f"{quoted_name(str(file))} cannot be read: {error.strerror}") from None
    request = claim["request"]
    vehicle = f"a footprint of {len(request['footprint'])} corners" if request["footprint"] else (
        f"a robot radius of {request['robot_radius']:g} m")
    print(f"{arguments.certificate} holds: a path of {claim['length']:.4f} m from {request['start']} to {request['goal']} for "
          f"{vehicle} and a turning radius of {request['turning_radius']:g} m, and {proved(claim)}")
    return 0
