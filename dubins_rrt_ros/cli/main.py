"""The command `dubins_rrt`: each subcommand lives in the file of its name."""

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from dubins_rrt_ros import __version__

if TYPE_CHECKING:
    from .common.flags import Parser

SUCCESS, NO_PATH, WRONG_USAGE, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 130, 141


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line `argv`, by default the process' own.

    Returns:
        The exit status: 0 a path, 1 no path or a wrong one, 2 wrong usage, 130 interrupted, 141 nobody reads the output any more.
    """
    words = sys.argv[1:] if argv is None else argv
    name = " ".join(["dubins_rrt", *words[:1]])
    try:
        with _output_written():
            return _run(words)
    except BrokenPipeError:
        return PIPE_CLOSED
    except OSError as error:
        return _refused(name, f"{error.filename or 'the output'} cannot be written: {error.strerror}")
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return INTERRUPTED


@contextlib.contextmanager
def _output_written() -> Iterator[None]:
    """Write what was printed, and where that fails leave nothing for the interpreter to complain of at its end."""
    try:
        yield
    finally:
        try:
            print(end="", flush=True)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise


def _run(words: Sequence[str]) -> int:
    # Imported here, for it takes a second, in which Ctrl-C shall not print a trace either.
    from dubins_rrt_ros.planning import InvalidPose, MapError, OptionError, Status
    from dubins_rrt_ros.planning.plan_file import PlanFileError

    from .common.flags import UsageError, guard_numbers
    parser = _parser()
    if not words:
        parser.print_help(sys.stderr)
        return WRONG_USAGE
    arguments = parser.parse_args(guard_numbers(words))
    try:
        return arguments.run(arguments)
    except InvalidPose as error:
        print(f"{int(Status.INVALID_POSE)} {Status.INVALID_POSE.name}: {error}", file=sys.stderr)
        return NO_PATH
    except (UsageError, OptionError, MapError, PlanFileError) as error:
        return _refused(f"dubins_rrt {arguments.command}", str(error))


def _parser() -> "Parser":
    from dubins_rrt_ros.evaluation.campaign import command as campaign
    from dubins_rrt_ros.evaluation.figures import command as figures
    from dubins_rrt_ros.evaluation.paper import command as paper

    from . import audit, completion, plan, render
    from .bench import command as bench
    from .common.flags import Parser, section
    from .demo import command as demo
    start = section("quick start", *plan.EXAMPLES[:1], "dubins_rrt plan --help")
    status = section("exit status", "0 done, 1 no path or a wrong one, 2 wrong usage, 130 interrupted")
    parser = Parser(prog="dubins_rrt", epilog=f"{start}\n\n{status}",
                    description="Plans paths for a vehicle that drives forward and cannot turn on the spot.")
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", title="commands")
    for command in (plan, audit, bench, campaign, demo, figures, paper, render, completion):
        command.add_to(subparsers)
    return parser


def _refused(name: str, reason: str) -> int:
    print(f"{name}: error: {reason}", file=sys.stderr)
    return WRONG_USAGE
