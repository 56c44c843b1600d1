"""The table of all parameters that the README has, in Markdown."""

import json
import re

from dubins_rrt_ros.planning.option import Option

from .parameters import OPTIONS, READ_ONLY

#: A row is kept within this width, where that can be [characters].
WIDTH = 130


def as_table() -> str:
    """A row for each parameter: its name, its default, what it takes and, as far as there is room, what it is for."""
    lines = [_row("parameter", "default", "takes", "meaning"), "|---|---|---|---|"]
    for item in OPTIONS.values():
        cells = f"`{item.name}`", _default(item), _taken(item)
        lines.append(_row(*cells, _within(WIDTH - len(_row(*cells, "")), item)))
    return "\n".join(lines) + "\n"


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _default(item: Option) -> str:
    return item.default or '""' if item.type is str else json.dumps(item.default)


def _taken(item: Option) -> str:
    """What the option takes, in fewer words than by `allowed()`, as its default shows its type."""
    taken = re.sub("one of |an? (number|integer) from ", "", item.allowed()).replace("true or false", "true, false")
    return taken + (f" {item.unit}" if item.unit else "") + ("; read-only" if item.name in READ_ONLY else "")


def _within(room: int, item: Option) -> str:
    """The help, without so many of its last clauses that it has room; the choices are told of all together or not at all."""
    text = item.help
    if len(text) > room and item.choices:
        text = text.partition(": ")[0]
    while len(text) > room and (clause := re.search("[,;] [^,;]*$", text)):
        text = text[:clause.start()]
    return text
