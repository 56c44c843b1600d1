"""Pictures of maps, trees and plans, by matplotlib.

Importing the planner imports no matplotlib: what has a picture imports the modules here when the picture is asked for.
"""

import shutil
from importlib.util import find_spec
from typing import TYPE_CHECKING

from ..errors import PlanningError
from ..text import install_command

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: The ending of videos, and the endings of all files that hold an animation.
VIDEO = ".mp4"
ANIMATIONS = (".gif", VIDEO, ".html")


class PictureError(PlanningError, ImportError):
    """A picture that cannot be drawn, as a package is missing; the message says how to install it."""


def check_matplotlib(extra: str = "plots") -> None:
    """Refuse to draw without matplotlib.

    Args:
        extra: the extra of this package that installs it.

    Raises:
        PictureError: it is not installed.
    """
    if find_spec("matplotlib") is None:
        raise PictureError(f"pictures are drawn by matplotlib, which is not installed; run: {install_command(extra)}")


def check_ffmpeg() -> None:
    """Refuse to make a video without ffmpeg.

    Raises:
        PictureError: it is not on the PATH.
    """
    if shutil.which("ffmpeg") is None:
        raise PictureError("videos are encoded by ffmpeg, which is not installed; install the package ffmpeg, or let the name "
                           "end with .gif or .html")


class Plottable:
    """A base of what has a picture, which notebooks show."""

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw on axes, by default those of a new pyplot figure, and return them."""
        raise NotImplementedError

    def _repr_png_(self) -> bytes | None:
        """Return the picture for a notebook; None, so that it shows the text instead, where matplotlib is not installed."""
        try:
            check_matplotlib()
        except PictureError:
            return None
        from .plots import png_of
        return png_of(self.plot)
