"""The library's options as flags of the command line."""

import argparse
import sys
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from dubins_rrt_ros.planning import Settings, options
from dubins_rrt_ros.planning.option import Option
from dubins_rrt_ros.planning.settings import PAPER, SHORTEST, preferred_clearance_option
from dubins_rrt_ros.planning.vehicle import overridden


@dataclass(frozen=True)
class LengthSettings(Settings):
    """The settings of commands that are about the length of paths, which by default is what is minimised."""

    preferred_clearance: float = preferred_clearance_option(SHORTEST["preferred_clearance"])


def add_option_flags(parser: argparse.ArgumentParser, title: str, cls: type, without: Collection[str] = ()) -> None:
    """Give `parser` a flag for every option of the dataclass `cls` but some, such as --turning-radius for turning_radius."""
    group = parser.add_argument_group(title)
    for item in (item for item in options(cls) if item.name not in without):
        text = f"{item.describe()}; default {_shown_default(item)}".replace("%", "%%")
        group.add_argument(flag(item.name), default=argparse.SUPPRESS, help=text, **_keywords(item))


def _shown_default(item: Option) -> str:
    if item.type is bool:
        return str(item.default).lower()
    return str(item.default) or "empty"


def _keywords(item: Option) -> dict[str, Any]:
    """Return the keyword arguments with which argparse reads an option's type."""
    if item.type is bool:
        return {"action": argparse.BooleanOptionalAction}
    if item.choices:
        return {"choices": item.choices}
    return {"type": item.type, "metavar": item.unit or item.type.__name__.upper()}


def given_options(arguments: argparse.Namespace, cls: type) -> dict[str, Any]:
    """Return the options of `cls` that were given on the command line, by name."""
    return {item.name: getattr(arguments, item.name) for item in options(cls) if item.name in arguments}


def checked_options(arguments: argparse.Namespace, cls: type) -> dict[str, Any]:
    """Return the options of `cls` that were given on the command line; warn of those in whose place another one is used."""
    given = given_options(arguments, cls)
    for name, by in overridden(given).items():
        print(f"dubins_rrt {arguments.command}: warning: {flag(name)} has no effect, as {flag(by)} takes its place",
              file=sys.stderr)
    return given


def flag(name: str) -> str:
    """Return the flag of an option, such as --turning-radius for turning_radius."""
    return "--" + name.replace("_", "-")


def add_paper_flag(parser: argparse.ArgumentParser) -> None:
    """Give `parser` the flag --paper."""
    parser.add_argument("--paper", action="store_true", default=argparse.SUPPRESS,
                        help="the paper's plain RRT and RRT*: --no-informed --no-shortcut --heading-sampling uniform")


def given_settings(arguments: argparse.Namespace, cls: type = Settings) -> dict[str, Any]:
    """Return the settings that were given on the command line, by flags or by --paper, as the options of `cls`."""
    preset = PAPER if "paper" in arguments else {}
    return preset | given_options(arguments, cls)


def largest(cls: type, name: str) -> Any:
    """Return the largest value that an option of the dataclass `cls` takes."""
    return {item.name: item.high for item in options(cls)}[name]
