"""A table of all parameters in Markdown, which docs/reference.md shows."""

import json
import re

from dubins_rrt_ros.planning.option import Option

from .parameters import OPTIONS, READ_ONLY

#: Maximum width of a row, where its first three cells leave room [characters].
WIDTH = 130


def as_table() -> str:
    """Return a row for each parameter: name, default, values it takes and, as far as there is room, its meaning."""
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
    """Return what the option takes, in fewer words than `allowed()`, as the default shows the type."""
    taken = re.sub("one of |an? (number|integer) from ", "", item.allowed()).replace("true or false", "true, false")
    return taken + (f" {item.unit}" if item.unit else "") + ("; read-only" if item.name in READ_ONLY else "")


def _within(room: int, item: Option) -> str:
    """Return the help, shortened clause by clause from its end to `room` characters; choices are explained all or not at all."""
    text = item.help
    if len(text) > room and item.choices:
        text = text.partition(": ")[0]
    while len(text) > room and (clause := re.search("[,;] [^,;]*$", text)):
        text = text[:clause.start()]
    return text
