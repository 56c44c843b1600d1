"""The argument parser of `dubins_rrt`, whose errors take one line. It knows nothing of planning, so that it starts at once."""

import argparse
import difflib
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import takewhile
from typing import Any, NoReturn

#: What to give where a number is wanted, by its type.
NUMBERS: dict[Any, str] = {int: "give an integer, such as 10", float: "give digits without a unit, such as 0.5"}


class UsageError(Exception):
    """The command was used wrongly; the message says how and what to do instead."""


def near_miss(word: str, known: Iterable[str]) -> str:
    """Return the end of a sentence on an unknown word: a known one that it begins or nearly is, if there is any."""
    known = list(known)
    near = [name for name in known if name.startswith(word)] or difflib.get_close_matches(word, known)
    return f"; did you mean {near[0]}?" if near else ""


class _Formatter(argparse.HelpFormatter):
    """A formatter that fills paragraphs but those with indented lines: examples are printed as they are run."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        fill = super()._fill_text
        return "\n\n".join(part if "\n  " in part else fill(part, width, indent) for part in text.split("\n\n"))


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors take one line and suggest what was meant. Flags cannot be abbreviated."""

    def __init__(self, **keywords: Any):
        super().__init__(allow_abbrev=False, formatter_class=_Formatter, **keywords)

    def error(self, message: str) -> NoReturn:
        """End the process with status 2."""
        message = message.replace("ignored explicit argument", "it takes no value, and has")
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse as argparse does, but leave nothing over, and name an unknown flag before those that are missing for it."""
        args = sys.argv[1:] if args is None else args
        own = takewhile(_is_flag, args) if self._subparsers else filter(_is_flag, args)  # after a command come its flags
        given = Counter(word.split("=")[0] for word in own)
        for flag in given:
            if flag not in self._option_string_actions:
                self.error(f"there is no flag {flag}{near_miss(flag, self._option_string_actions)}")
        for flag, times in given.items():
            if times > 1 and not isinstance(self._option_string_actions[flag], argparse._AppendAction):
                print(f"{self.prog}: warning: {flag} is given {times} times; the last one counts", file=sys.stderr)
        parsed, extras = super().parse_known_args(args, namespace)
        if extras:
            self.error(f"{extras[0].strip()} is one argument too many")
        return parsed, extras

    def _match_argument(self, action: argparse.Action, arg_strings_pattern: str) -> int:
        try:
            return super()._match_argument(action, arg_strings_pattern)
        except argparse.ArgumentError:
            if isinstance(action.metavar, tuple):  # several numbers, which some write with commas
                raise argparse.ArgumentError(action, f"give {' '.join(action.metavar)}, with blanks between them") from None
            raise

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        if action.type not in NUMBERS:
            return super()._get_value(action, arg_string)
        try:
            if "_" in arg_string:  # which Python takes between digits
                raise ValueError
            return int(arg_string) if action.type is int else float(arg_string)
        except ValueError:
            raise argparse.ArgumentError(action, f"{arg_string.strip()!r} is no number; {NUMBERS[action.type]}") from None

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            remedy = near_miss(value, action.choices) or f"; give one of {', '.join(action.choices)}"
            raise argparse.ArgumentError(action, f"{value} is unknown{remedy}")


def _is_flag(word: str) -> bool:
    return word.startswith("-") and word not in ("-", "--")


def describe(parser: argparse.ArgumentParser, *, usage: str, description: str, examples: Sequence[str], exit_status: str,
             notes: str = "") -> None:
    """Give a command its help: description, notes, examples that run as they are printed, and the exit status."""
    parser.usage = f"%(prog)s {usage}"
    parser.description = description
    parser.epilog = f"{notes}\n\n{section('examples', *examples)}\n\n{section('exit status', exit_status)}"


def section(title: str, *lines: str) -> str:
    """Return a section of a help text whose lines are printed as they are."""
    return "\n".join([f"{title}:", *(f"  {line}" for line in lines)])


def add_json_flag(parser: argparse.ArgumentParser, what: str) -> None:
    """Give `parser` the flag --json, whose default is None."""
    parser.add_argument("--json", metavar="FILE", default=None,
                        help=f"write {what} as JSON; - is standard output, where nothing else goes then")


def guard_numbers(argv: Sequence[str]) -> list[str]:
    """Return `argv` with a blank in front of every negative number, so that argparse takes none for a flag.

    By itself it knows -1 and -0.5 as numbers, but neither -1e-3 nor -inf. float() ignores the blank.
    """
    return [" " + word if word.startswith("-") and _is_number(word) else word for word in argv]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
