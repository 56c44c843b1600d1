"""YAML whose scalars stay texts, loaded without constructing objects."""

from collections.abc import Hashable
from itertools import accumulate
from typing import Any, ClassVar

import yaml

#: Maximum number of brackets open at once: PyYAML takes seconds for a line of a thousand.
DEEPEST = 50


class RepeatedKey(yaml.YAMLError):
    """A key that a mapping has twice; parsers differ in which of its values they take."""


def load_plain(text: str, *, aliases: bool, unique_keys: bool | str = False) -> Any:
    """Return the contents of a YAML document as dicts, lists and texts.

    YAML 1.1 would make 1e-2 text, 010 eight, an image named 2024 a number, and a mode named off a boolean. Tabs are taken where
    yaml-cpp and libyaml take them: between tokens, but not as indentation.

    Args:
        text: the document.
        aliases: True if aliases are allowed; a few lines of them can stand for billions of values, which take time to go
            through.
        unique_keys: True if a key must not be given twice in a mapping, of which the last value would be taken; a name if it
            must not in the mappings that are the values of this key.

    Raises:
        RepeatedKey: a key is given twice where it must not.
        yaml.YAMLError: it is not valid YAML, or has an alias although none is allowed.
        RecursionError: it is nested too deep.
        ValueError, OverflowError: it has an escape of a character that does not exist.
    """
    # Brackets in quotes and comments count too; telling them apart is not worth it.
    if max(accumulate((letter in "[{") - (letter in "]}") for letter in text), default=0) > DEEPEST:
        raise RecursionError
    loader = type("Loader", (_Loader,), {"aliases": aliases, "unique_keys": unique_keys})
    return yaml.load(text, Loader=loader)


class _Loader(yaml.BaseLoader):
    """A loader of plain values.

    Attributes:
        aliases, unique_keys: see `load_plain`.
    """

    aliases: ClassVar[bool]
    unique_keys: ClassVar[bool | str]

    def scan_to_next_token(self) -> None:
        super().scan_to_next_token()
        while self.peek() == "\t":
            if not self.flow_level:
                self.allow_simple_key = False  # no key may follow: the tab would be indentation
            self.forward()
            super().scan_to_next_token()

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        if self.unique_keys is True:
            _refuse_repeated_keys(node)
        for key, value in node.value if isinstance(self.unique_keys, str) else ():
            if key.value == self.unique_keys and isinstance(value, yaml.MappingNode):
                _refuse_repeated_keys(value)
        return super().construct_mapping(node, deep)

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if not self.aliases and self.check_event(yaml.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "there is an alias", self.peek_event().start_mark)  # type: ignore[no-untyped-call]  # PyYAML's stubs leave it untyped
        return super().compose_node(parent, index)


def _refuse_repeated_keys(node: yaml.MappingNode) -> None:
    lines: dict[str, int] = {}
    for key, _ in node.value:
        if not isinstance(key, yaml.ScalarNode):
            continue
        line = key.start_mark.line + 1
        if key.value in lines:
            raise RepeatedKey(f"{key.value} is given twice, in lines {lines[key.value]} and {line}")
        lines[key.value] = line
