"""Parameter files: one with all defaults, and warnings about those that ROS ignores silently."""

import json
import os
import re
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from dubins_rrt_ros.planning import options
from dubins_rrt_ros.planning.maps.yaml import RepeatedKey, load_plain
from dubins_rrt_ros.planning.text import one_line

from .parameters import CLASSES, READ_ONLY, read_only

#: Maximum line length of a parameter file that is written [characters].
WIDTH = 100
#: Maximum size of a file that is read [bytes]; PyYAML may take three seconds for that.
MAX_BYTES = 64 * 2**10
#: The key of a node's parameters in a file.
SECTION = "ros__parameters"
#: What reading a file that ROS has taken may raise all the same.
_UNREADABLE = (OSError, ValueError, RecursionError, OverflowError, yaml.YAMLError)


def as_yaml() -> str:
    """Return a parameter file for a node of any name, with all defaults; a comment above each says what it takes."""
    lines = [*_comment("The planner's parameters with their defaults, as `planner --print-parameters` prints them.", ""),
             "/**:", "  ros__parameters:"]
    for cls, title in CLASSES.items():
        lines += ["", f"    # --- {title} ---"]
        for item in options(cls):
            about = item.describe() + (f"; {read_only(item.name)}" if item.name in READ_ONLY else "")
            # JSON is the part of YAML in which no value is mistaken for one of another type.
            lines += ["", *_comment(about, "    "), f"    {item.name}: {json.dumps(item.default)}"]
    return "\n".join(lines) + "\n"


def unused_files(arguments: Sequence[str], node_name: str) -> list[str]:
    """Return a warning, of one sentence, for each parameter file that names other nodes only: ROS ignores it silently.

    Args:
        arguments: the command line. A file that cannot be read gives no warning, as ROS refuses it.
        node_name: the node's fully qualified name, such as /planner.
    """
    warnings = []
    for file in _parameter_files(arguments):
        names = _named_nodes(file)
        if names is not None and not any(_is_for(name, node_name) for name in names):
            found = f"names {', '.join(names)}" if names else "has no ros__parameters"
            warnings.append(one_line(f"Parameter file {file!r} is ignored, as it {found}; name {node_name} or /** in it"))
    return warnings


def doubtful_rules(arguments: Sequence[str], node_name: str) -> list[str]:
    """Return a warning, of one sentence, for each value of which ROS takes nothing without a word.

    Args:
        arguments: the command line, which ROS has taken.
        node_name: the node's fully qualified name, such as /planner.
    """
    rules = [rule.partition(":=")[0].rpartition(":") for rule in _values_of(("-p", "--param"), arguments)]
    elsewhere = [f"{name} is given to the node {node}, and not to {node_name}" for node, _, name in rules
                 if node and f"/{node}" != node_name]
    counts = Counter(rules)
    twice = [f"-p {''.join(rule)} is given {count} times; the last one counts" for rule, count in counts.items() if count > 1]
    in_files = [f"{file}: {repeated}; the last one counts" for file in _parameter_files(arguments)
                if (repeated := _repeated_parameter(file))]
    return [one_line(warning) for warning in (*elsewhere, *twice, *in_files)]


def _comment(text: str, indent: str) -> list[str]:
    start = f"{indent}# "
    return textwrap.wrap(text, WIDTH, initial_indent=start, subsequent_indent=start, break_long_words=False,
                         break_on_hyphens=False)


def _parameter_files(arguments: Sequence[str]) -> Iterator[str]:
    return _values_of(("--params-file",), arguments)


def _values_of(flags: Sequence[str], arguments: Sequence[str]) -> Iterator[str]:
    """Yield what follows a flag among the arguments that are ROS's."""
    is_for_ros = False
    for argument, following in pairwise((*arguments, "")):
        if argument in ("--ros-args", "--"):
            is_for_ros = argument == "--ros-args"
        elif is_for_ros and argument in flags:
            yield following


def _named_nodes(file: str) -> list[str] | None:
    """Return the names or wildcards of the nodes that a file has sections for; None where it cannot be read."""
    try:
        return list(_sections(_read(file)))
    except _UNREADABLE:
        return None


def _repeated_parameter(file: str) -> str:
    """Say which parameter a section of a file has twice; "" where there is none, or the file cannot be read."""
    try:
        _read(file, unique_keys=SECTION)
    except RepeatedKey as error:
        return str(error)
    except _UNREADABLE:
        pass
    return ""


def _read(file: str, unique_keys: bool | str = False) -> Any:
    # A pipe, which ROS has read already, would block.
    if not os.path.isfile(file) or os.path.getsize(file) > MAX_BYTES:
        raise OSError
    return load_plain(Path(file).read_text("utf-8-sig"), aliases=False, unique_keys=unique_keys)  # aliases ROS refuses, too


def _sections(tree: Any, name: str = "") -> Iterator[str]:
    for key, value in tree.items() if isinstance(tree, dict) else ():
        if key == SECTION:
            yield name
        else:
            yield from _sections(value, "/".join([name, *filter(None, key.split("/"))]))


def _is_for(section: str, node_name: str) -> bool:
    """Return True if a section applies to a node, as rcl and rclpy see it: `*` is any one name, `**` any number of them."""
    parts = re.sub(r"(/\*\*)+", "/**", section).split("/")[1:]
    wildcards = {"*": "/[^/]+", "**": "(/[^/]+)*"}
    return re.fullmatch("".join(wildcards.get(part, "/" + re.escape(part)) for part in parts), node_name) is not None
