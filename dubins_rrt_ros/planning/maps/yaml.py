"""YAML whose scalars stay texts, loaded without constructing objects."""

from itertools import accumulate
from typing import Any

import yaml

#: Maximum number of brackets open at once: PyYAML takes seconds for a line of a thousand.
DEEPEST = 50


def load_plain(text: str, *, aliases: bool) -> Any:
    """Return the contents of a YAML document as dicts, lists and texts.

    YAML 1.1 would make 1e-2 text, 010 eight, an image named 2024 a number, and a mode named off a boolean.

    Args:
        text: the document.
        aliases: True if aliases are allowed; a few lines of them can stand for billions of values, which take time to go
            through.

    Raises:
        yaml.YAMLError: it is not valid YAML, or has an alias although none is allowed.
        RecursionError: it is nested too deep.
        ValueError, OverflowError: it has an escape of a character that does not exist.
    """
    # Brackets in quotes and comments count too; telling them apart is not worth it.
    if max(accumulate((letter in "[{") - (letter in "]}") for letter in text), default=0) > DEEPEST:
        raise RecursionError
    return yaml.load(text, Loader=yaml.BaseLoader if aliases else _Loader)


class _Loader(yaml.BaseLoader):
    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "there is an alias", self.peek_event().start_mark)  # type: ignore[no-untyped-call]  # PyYAML's stubs leave it untyped
        return super().compose_node(parent, index)
