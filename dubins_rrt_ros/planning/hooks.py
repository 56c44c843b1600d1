"""Functions of the user's that the planner calls: a sampler, and a test for obstacles that the map does not have.

What they give is checked here, at each call: an exception, a wrong shape or a wrong type ends in one sentence.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from .errors import PlanningError
from .text import quoted

#: Draws samples: `sampler(rng, n)` gives (n, 3) poses x [m], y [m], theta [rad], as random as `rng` alone makes them.
Sampler = Callable[[np.random.Generator, int], np.ndarray]
#: Tests for further obstacles: `is_free(poses)` gives a bool for each of (n, 3) poses, False where the vehicle may not be.
IsFree = Callable[[np.ndarray], np.ndarray]


class HookError(PlanningError):
    """A function of the user's raised an exception, or gave what it should not; the message says which one, and what."""


def draw_poses(sampler: Sampler, rng: np.random.Generator, count: int) -> np.ndarray:
    """Return the (count, 3) poses that a sampler draws.

    Raises:
        HookError: it raised an exception, or gave anything else.
    """
    given = _called("sampler", sampler, rng, count)
    if given.shape != (count, 3) or given.dtype.kind not in "fiu" or not np.isfinite(given).all():
        raise HookError(f"sampler gave {_described(given)} when asked for {count} poses; it has to give ({count}, 3) finite "
                        "numbers: x [m], y [m], theta [rad]")
    return given.astype(float, order="C")  # which is the order that kernels take


def are_free(is_free: IsFree, poses: np.ndarray) -> np.ndarray:
    """Return (n,) bool: what a test says of (n, 3) poses.

    Raises:
        HookError: it raised an exception, or gave anything but a bool for each.
    """
    given = _called("is_free", is_free, poses.copy())
    if given.shape != (len(poses),) or given.dtype != bool:
        raise HookError(f"is_free gave {_described(given)} for {len(poses)} poses; it has to give an array of {len(poses)} bools")
    return given


def check_function(name: str, function: Any) -> None:
    """Check that a hook can be called, or is left out.

    Raises:
        HookError: it cannot.
    """
    if function is not None and not callable(function):
        raise HookError(f"{name} is {quoted(function)}; give a function, or None")


def name_of(function: Callable[..., Any]) -> str:
    """Return the name by which files speak of a function: that of its module, and its own."""
    of = function if hasattr(function, "__qualname__") else type(function)
    return f"{of.__module__}.{of.__qualname__}"


def _called(name: str, function: Callable[..., Any], *args: Any) -> np.ndarray:
    """Return what a function gives, as an array."""
    try:
        return np.asarray(function(*args))
    except Exception as error:
        raise HookError(f"{name} raised {type(error).__name__}: {error}") from error


def _described(given: np.ndarray) -> str:
    """Return shape and type of an array, in words."""
    finite = given.dtype.kind != "f" or bool(np.isfinite(given).all())
    return f"an array of shape {given.shape} and type {given.dtype}{'' if finite else ' with numbers that are not finite'}"
