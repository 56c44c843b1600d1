"""How far long work has come: a bar on a terminal, silent elsewhere."""

import sys
from collections.abc import Iterable
from typing import Any

from tqdm import tqdm


def with_bar(steps: Iterable[Any], total: int, unit: str) -> tqdm:
    """The steps, with a bar that counts them in a unit, such as " runs"."""
    return tqdm(steps, total=total, unit=unit, file=sys.stderr, disable=None, leave=False)
