"""Options: dataclass fields that know their unit, range and help.

The command line's flags, the node's parameters and the documentation are derived from them, so each is written once.
"""

import dataclasses
import sys
from typing import Any, NamedTuple

from .text import quoted


class OptionError(ValueError):
    """A value that an option does not take; the message names option, value and remedy."""


class Option(NamedTuple):
    """What is known of one option."""

    name: str
    type: type
    default: Any
    unit: str
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    help: str

    def describe(self) -> str:
        """The help with the unit and what is allowed, on one line."""
        return self.help + (f" [{self.unit}]" if self.unit else "") + f" ({self.allowed()})"

    def allowed(self) -> str:
        """What the option takes, in words."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.type is bool:
            return "true or false"
        if self.type is str:
            return "text"
        if self.type is int:
            return f"an integer from {self.low} to {self.high}"
        return f"a number from {self.low:g} to {self.high:g}"

    def convert(self, value: Any) -> Any:
        """`value` as the option's type, an int where a float is due included.

        Raises:
            OptionError: the value is of another type, not finite or out of range.
        """
        fits = type(value) is self.type or (self.type, type(value)) == (float, int)
        if fits and self.type in (int, float):
            fits = self.low <= value <= self.high  # which is exact for an integer that no float can hold, and false for NaN
        if fits and self.choices:
            fits = value in self.choices
        if not fits:
            raise OptionError(f"{self.name} is {quoted(value)}; it takes {self.allowed()}: {self.help}")
        return float(value) if self.type is float else value


def option(default: Any, help: str, *, unit: str = "", low: float | None = None, high: float | None = None,
           choices: tuple[str, ...] = ()) -> Any:
    """A dataclass field that is an option."""
    metadata = {"unit": unit, "low": low, "high": high, "choices": choices, "help": help}
    return dataclasses.field(default=default, metadata=metadata)


def options(cls: type) -> tuple[Option, ...]:
    """The options among the fields of a dataclass, in order."""
    return tuple(Option(name=f.name, type=type(f.default), default=f.default, **f.metadata)
                 for f in dataclasses.fields(cls) if f.metadata)


def convert_options(instance: Any) -> None:
    """Check and convert every option of a frozen dataclass; to be called from its `__post_init__`."""
    for item in options(type(instance)):
        object.__setattr__(instance, item.name, item.convert(getattr(instance, item.name)))


def is_number(value: Any) -> bool:
    """Whether it is a finite float, or an integer that a float can hold; true and false are none."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def values(instance: Any) -> dict[str, Any]:
    """The options of a dataclass' instance by name."""
    return {item.name: getattr(instance, item.name) for item in options(type(instance))}
