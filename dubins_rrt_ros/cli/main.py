"""The command `dubins_rrt`: each subcommand lives in the file of its name."""

import sys

from dubins_rrt_ros import __version__
from dubins_rrt_ros.planning import InvalidPose, MapError, OptionError, Status
from dubins_rrt_ros.planning.plan_file import PlanFileError

from . import audit, bench, campaign, demo, paper, plan, render
from .flags import Parser, UsageError, guard_numbers

SUCCESS, NO_PATH, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130


def main(argv: list[str] | None = None) -> int:
    """Run the command line `argv`, by default the process' own.

    Returns:
        The exit status: 0 a path, 1 no path or a wrong one, 2 wrong usage, 130 interrupted.
    """
    arguments = _parser().parse_args(guard_numbers(sys.argv[1:] if argv is None else argv))
    try:
        return arguments.run(arguments)
    except InvalidPose as error:
        print(f"{int(Status.INVALID_POSE)} {Status.INVALID_POSE.name}: {error}", file=sys.stderr)
        return NO_PATH
    except OSError as error:
        return _refused(arguments.command, f"{error.filename or 'the output'} cannot be written: {error.strerror}")
    except (UsageError, OptionError, MapError, PlanFileError) as error:
        return _refused(arguments.command, str(error))
    except KeyboardInterrupt:
        print(f"dubins_rrt {arguments.command}: interrupted", file=sys.stderr)
        return INTERRUPTED


def _parser() -> Parser:
    parser = Parser(prog="dubins_rrt", epilog="Exit status: 0 done, 1 no path or a wrong one, 2 wrong usage, 130 interrupted.",
                    description="Plans paths for a vehicle that drives forward and cannot turn on the spot.")
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in (plan, audit, bench, campaign, demo, paper, render):
        command.add_to(subparsers)
    return parser


def _refused(command: str, reason: str) -> int:
    print(f"dubins_rrt {command}: error: {reason}", file=sys.stderr)
    return WRONG_USAGE
