"""The progress of long work: a bar on a terminal, where tqdm is installed; silent elsewhere."""

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Step = TypeVar("Step")


@contextlib.contextmanager
def progress_bar(total: int, unit: str, note: str = "") -> Iterator[Callable[[int, str], None]]:
    """Show a bar that counts up to `total` in a unit, such as " runs", with a note beside it.

    The context is the function that moves it: to the number of steps done, with a note.
    """
    try:
        from tqdm import tqdm  # here, for a command that shows no bar need not wait for it
    except ImportError:  # it comes with the extra `plots`
        yield lambda done, note: None
        return
    with tqdm(total=total, unit=unit, file=sys.stderr, disable=None, leave=False, postfix=note or None) as bar:
        def move(done: int, note: str) -> None:
            bar.set_postfix_str(note, refresh=False)
            bar.update(done - bar.n)

        yield move


def with_bar(steps: Iterable[Step], total: int, unit: str) -> Iterator[Step]:
    """Yield the steps, with a bar that counts them in a unit, such as " runs"."""
    with progress_bar(total, unit) as move:
        for done, step in enumerate(steps, 1):
            yield step
            move(done, "")
