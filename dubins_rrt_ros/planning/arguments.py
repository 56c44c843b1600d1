"""What calls of the planner take beside problem and settings."""

from typing import Any

from .curves.path import Path
from .text import quoted


def check_call(cancel: Any, on_progress: Any, seed_path: Any) -> None:
    """Check what is given to a call beside problem and settings, or left out.

    Raises:
        TypeError: it is of another kind.
    """
    for name, function in (("cancel", cancel), ("on_progress", on_progress)):
        if function is not None and not callable(function):
            raise TypeError(f"{name} is {quoted(function)}; give a function, or None")
    if seed_path is not None and not isinstance(seed_path, Path):
        raise TypeError(f"seed_path is {quoted(seed_path)}; give a Path, such as the path of a Plan, or None")
