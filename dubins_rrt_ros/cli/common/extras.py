"""Packages that an installation may lack, since they come with an extra, and what to say where one is missing."""

from importlib.util import find_spec

from .parser import UsageError


def require_matplotlib(extra: str = "plots") -> None:
    """Refuse to draw without matplotlib. Called before the work, so that none is lost.

    Raises:
        UsageError: matplotlib is not installed; the message names the extra that installs it.
    """
    if find_spec("matplotlib") is None:
        raise UsageError(f"pictures are drawn by matplotlib, which is not installed; run: {install_command(extra)}")


def install_command(extra: str) -> str:
    """Return the command that installs an extra."""
    return f"pip install 'dubins_rrt_ros[{extra}]'"
