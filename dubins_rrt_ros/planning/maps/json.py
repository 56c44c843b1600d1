"""JSON in which a key that an object has twice is refused."""

import json
from typing import Any


class RepeatedKey(ValueError):
    """A key that an object has twice; parsers differ in which of its values they take."""


def load_unique(text: str) -> Any:
    """Return the contents of a JSON document.

    Raises:
        RepeatedKey: an object has a key twice, of which the last value would be taken.
        ValueError: it is no valid JSON.
        RecursionError: it is nested too deep.
    """
    return json.loads(text, object_pairs_hook=_unique)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        keys = [key for key, _ in pairs]
        repeated = next(key for key in members if keys.count(key) > 1)
        raise RepeatedKey(f'an object has "{repeated}" {keys.count(repeated)} times; give it once')
    return members
