"""Parameter files: one with all defaults, and warnings about those that ROS ignores silently."""

import json
import os
import re
import textwrap
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from dubins_rrt_ros.planning import options
from dubins_rrt_ros.planning.maps.yaml import load_plain
from dubins_rrt_ros.planning.text import one_line

from .parameters import CLASSES, READ_ONLY, read_only

#: Maximum line length of a parameter file that is written [characters].
WIDTH = 100
#: Maximum size of a file that is read [bytes]; PyYAML may take three seconds for that.
MAX_BYTES = 64 * 2**10


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


def _comment(text: str, indent: str) -> list[str]:
    start = f"{indent}# "
    return textwrap.wrap(text, WIDTH, initial_indent=start, subsequent_indent=start, break_long_words=False,
                         break_on_hyphens=False)


def _parameter_files(arguments: Sequence[str]) -> Iterator[str]:
    is_for_ros = False
    for argument, following in pairwise((*arguments, "")):
        if argument in ("--ros-args", "--"):
            is_for_ros = argument == "--ros-args"
        elif is_for_ros and argument == "--params-file":
            yield following


def _named_nodes(file: str) -> list[str] | None:
    """Return the names or wildcards of the nodes that a file has sections for; None where it cannot be read."""
    try:
        # A pipe, which ROS has read already, would block.
        if not os.path.isfile(file) or os.path.getsize(file) > MAX_BYTES:
            return None
        return list(_sections(load_plain(Path(file).read_text("utf-8"), aliases=False)))  # which ROS refuses too
    except (OSError, ValueError, RecursionError, OverflowError, yaml.YAMLError):
        return None


def _sections(tree: Any, name: str = "") -> Iterator[str]:
    for key, value in tree.items() if isinstance(tree, dict) else ():
        if key == "ros__parameters":
            yield name
        else:
            yield from _sections(value, "/".join([name, *filter(None, key.split("/"))]))


def _is_for(section: str, node_name: str) -> bool:
    """Return True if a section applies to a node, as rcl and rclpy see it: `*` is any one name, `**` any number of them."""
    parts = re.sub(r"(/\*\*)+", "/**", section).split("/")[1:]
    wildcards = {"*": "/[^/]+", "**": "(/[^/]+)*"}
    return re.fullmatch("".join(wildcards.get(part, "/" + re.escape(part)) for part in parts), node_name) is not None
