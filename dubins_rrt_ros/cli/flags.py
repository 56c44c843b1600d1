"""The library's options as command line flags, and an argument parser whose errors take one line."""

import argparse
from typing import Any, NoReturn

from dubins_rrt_ros.planning import options
from dubins_rrt_ros.planning.options import Option


class UsageError(Exception):
    """The command was used wrongly; the message says how and what to do instead."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors take one line, and which knows flags by their full names only."""

    def __init__(self, **keywords: Any):
        super().__init__(allow_abbrev=False, **keywords)

    def error(self, message: str) -> NoReturn:
        """End the process with status 2."""
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def guard_numbers(argv: list[str]) -> list[str]:
    """`argv` with a blank in front of every negative number, so that argparse takes none for a flag.

    It knows -1 and -0.5 as numbers by itself, but not -1e-3 nor -inf. The blank is lost again in float().
    """
    return [" " + word if word.startswith("-") and _is_number(word) else word for word in argv]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def add_option_flags(parser: argparse.ArgumentParser, title: str, cls: type) -> None:
    """Give `parser` a flag for every option of the dataclass `cls`, such as --turning-radius for turning_radius."""
    group = parser.add_argument_group(title)
    for item in options(cls):
        default = str(item.default).lower() if item.type is bool else item.default
        help = f"{item.describe()}; default {default}".replace("%", "%%")
        group.add_argument("--" + item.name.replace("_", "-"), default=argparse.SUPPRESS, help=help, **_kind(item))


def _kind(item: Option) -> dict[str, Any]:
    """What argparse wants to know of an option's type."""
    if item.type is bool:
        return {"action": argparse.BooleanOptionalAction}
    if item.choices:
        return {"choices": item.choices}
    return {"type": item.type, "metavar": item.unit or item.type.__name__.upper()}


def given_options(arguments: argparse.Namespace, cls: type) -> dict[str, Any]:
    """The options of `cls` that were given on the command line, by name."""
    return {item.name: getattr(arguments, item.name) for item in options(cls) if item.name in arguments}
