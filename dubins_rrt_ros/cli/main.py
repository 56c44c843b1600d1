"""The entry of `dubins_rrt`: it runs the command that was asked for, and turns an error into one line and an exit status."""

import contextlib
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from argparse import Namespace

SUCCESS, NO_PATH, WRONG_USAGE, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 130, 141


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line `argv`, by default the process' own.

    Returns:
        The exit status: 0 a path, 1 no path or a wrong one, 2 wrong usage, 130 interrupted, 141 nobody reads the output any more.
    """
    words = sys.argv[1:] if argv is None else argv
    name = " ".join(["dubins_rrt", *words[:1]])
    try:
        with _warnings_in_one_line(name), _output_written():
            return _run(words)
    except BrokenPipeError:
        return PIPE_CLOSED
    except OSError as error:
        return _refused(name, f"{error.filename or 'the output'} cannot be written: {error.strerror}")
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return INTERRUPTED


@contextlib.contextmanager
def _warnings_in_one_line(name: str) -> Iterator[None]:
    """Print warnings, such as that of interpreted kernels, as errors are printed: without the place in the source."""
    before = warnings.formatwarning
    warnings.formatwarning = lambda message, *_, **__: f"{name}: warning: {message}\n"
    try:
        yield
    finally:
        warnings.formatwarning = before


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
    # The imports are here since they take a moment, in which Ctrl-C must not print a trace either.
    from .commands import make_parser
    from .common.parser import guard_numbers
    parser = make_parser(wanted=words[:1])
    if not words:
        parser.print_help(sys.stderr)
        return WRONG_USAGE
    return _run_command(parser.parse_args(guard_numbers(words)))


def _run_command(arguments: "Namespace") -> int:
    from dubins_rrt_ros.planning import InvalidPose, MapError, OptionError, Status
    from dubins_rrt_ros.planning.plan_file import PlanFileError

    from .common.parser import UsageError
    try:
        return arguments.run(arguments)
    except InvalidPose as error:
        print(f"{int(Status.INVALID_POSE)} {Status.INVALID_POSE.name}: {error}", file=sys.stderr)
        return NO_PATH
    except (UsageError, OptionError, MapError, PlanFileError) as error:
        return _refused(f"dubins_rrt {arguments.command}", str(error))


def _refused(name: str, reason: str) -> int:
    from dubins_rrt_ros.planning.text import one_line  # a reason may quote a file
    print(f"{name}: error: {one_line(reason)}", file=sys.stderr)
    return WRONG_USAGE
