"""Options: dataclass fields that know their unit, range and help.

The command line's flags, the node's parameters and the documentation are derived from them, so each is written once.
"""

import dataclasses
import math
import sys
import textwrap
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np

from .errors import PlanningError
from .text import quoted

_Class = TypeVar("_Class", bound=type)


class Assumed(float):
    """A default that is told from the same number given, until the field is converted."""


class OptionError(PlanningError, ValueError):
    """A value that an option does not take; the message names option, value and remedy."""


class TextForm(NamedTuple):
    """The text form of an option whose values are structured, for files, flags and parameters.

    Attributes:
        read: takes a text or a value and returns the value, or raises OptionError.
        write: returns the text of a value.
    """

    read: Callable[[Any], Any]
    write: Callable[[Any], str]


class Option(NamedTuple):
    """An option of a dataclass.

    Attributes:
        name: the name of the field.
        type, default: as in files, flags and parameters; `text_form` tells where a field holds something else.
        unit: in brackets after the help; "" for none.
        low, high: the range of a number, both included.
        choices: the texts that are allowed; () for any.
        help: a phrase without a full stop.
        text_form: of a field that holds more than a text, or None.
    """

    name: str
    type: type
    default: Any
    unit: str
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    help: str
    text_form: TextForm | None

    def describe(self) -> str:
        """Return the help with the unit and what is allowed, on one line."""
        return self.help + (f" [{self.unit}]" if self.unit else "") + f" ({self.allowed()})"

    def allowed(self) -> str:
        """Return what the option takes, in words."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.type is bool:
            return "true or false"
        if self.type is str:
            return "text"
        if self.type is list:
            return "a list of texts"
        if self.type is int:
            return f"an integer from {self.low} to {self.high}"
        return f"a number from {self.low:g} to {self.high:g}"

    def convert(self, value: Any) -> Any:
        """Return `value` as the field holds it; an int is taken where a float is due, and a NumPy number as Python's own.

        A list of texts is held as a tuple.

        Raises:
            OptionError: the value is of another type, not finite or out of range.
        """
        if self.text_form:
            return self.text_form.read(value)
        value = plain_number(value)
        if not self._takes(value):
            raise OptionError(f"{self.name} is {quoted(value)}; it takes {self.allowed()}: {self.help}{self._in_degrees(value)}")
        if self.type is list:
            return tuple(value)
        return float(value) if self.type is float else value

    def _in_degrees(self, value: Any) -> str:
        """Ask whether an angle was meant that is out of range in radians, and not in degrees."""
        if self.unit != "rad" or not is_number(value) or not self._takes(radians := math.radians(value)):
            return ""
        return f"; did you mean {radians:.4g} ({value:g} degrees)?"

    def _takes(self, value: Any) -> bool:
        if self.type is list:
            return isinstance(value, list | tuple) and all(isinstance(item, str) for item in value)
        if not (type(value) is self.type or (self.type, type(value)) == (float, int)):
            return False
        if self.low is not None and self.high is not None:
            return bool(self.low <= value <= self.high)  # exact for an integer that no float can hold, and false for NaN
        return not self.choices or value in self.choices


def option(default: Any, description: str, *, unit: str = "", low: float | None = None, high: float | None = None,
           choices: tuple[str, ...] = (), text_form: TextForm | None = None) -> Any:
    """Return a dataclass field that is an option."""
    metadata = {"unit": unit, "low": low, "high": high, "choices": choices, "help": description, "text_form": text_form}
    return dataclasses.field(default=default, metadata=metadata)


def options(cls: type) -> tuple[Option, ...]:
    """Return the options among the fields of a dataclass, in order."""
    return tuple(_option_of(field) for field in dataclasses.fields(cls) if field.metadata)


def _option_of(field: "dataclasses.Field[Any]") -> Option:
    form = field.metadata["text_form"]
    default = form.write(field.default) if form else plain_number(field.default)
    if isinstance(default, tuple):
        default = list(default)
    return Option(name=field.name, type=type(default), default=default, **field.metadata)


def documented(cls: _Class) -> _Class:
    """Add the options of a dataclass, with default, unit and range, to its docstring."""
    defaults = {field.name: plain_number(field.default) for field in dataclasses.fields(cls)}
    lines = [f"{item.name} ({type(defaults[item.name]).__name__}, default {defaults[item.name]!r}): {item.describe()}"
             for item in options(cls)]
    entries = (textwrap.fill(line, 110, initial_indent=" " * 8, subsequent_indent=" " * 12) for line in lines)
    cls.__doc__ = "\n".join([(cls.__doc__ or "").rstrip(), "", "    Options:", *entries, "    "])
    return cls


def convert_options(instance: Any) -> None:
    """Check and convert every option of a frozen dataclass; to be called from its `__post_init__`."""
    for item in options(type(instance)):
        object.__setattr__(instance, item.name, item.convert(getattr(instance, item.name)))


def plain_number(value: Any) -> Any:
    """Return a number or Boolean of NumPy as Python's own, a default as one that is given, and anything else as it is."""
    if isinstance(value, Assumed):
        return float(value)
    return value.item() if isinstance(value, np.generic | np.ndarray) and value.ndim == 0 else value


def plain_float(value: Any) -> float:
    """Return a number of a text in which nothing but a number is written, or a number, as a float.

    Raises:
        ValueError, TypeError, OverflowError: it is none, as are Booleans, and digits with underscores between them.
    """
    if isinstance(value, bool | np.bool_) or (isinstance(value, str) and "_" in value):
        raise ValueError
    return float(value)


def own_floats(numbers: Any) -> tuple[float, ...]:
    """Return a sequence of numbers as floats; texts and Booleans are no numbers, nor are sets and mappings in an order.

    Raises:
        ValueError, TypeError, OverflowError: it is none.
    """
    if isinstance(numbers, str | bytes | dict | set | frozenset):
        raise TypeError
    given = tuple(numbers)
    if any(isinstance(number, str | bytes) for number in given):
        raise TypeError
    return tuple(map(plain_float, given))


def is_number(value: Any) -> bool:
    """Return True for a finite float, and for an integer that a float can hold; true and false are no numbers."""
    value = plain_number(value)
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def values(instance: Any) -> dict[str, Any]:
    """Return the options of a dataclass' instance by name, as in files, flags and parameters."""
    return {item.name: _plain(item, getattr(instance, item.name)) for item in options(type(instance))}


def _plain(item: Option, value: Any) -> Any:
    return item.text_form.write(value) if item.text_form else value
