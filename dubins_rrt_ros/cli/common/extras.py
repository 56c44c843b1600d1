"""Packages that an installation may lack, since they come with an extra, and what to say where one is missing."""

from dubins_rrt_ros.planning.pictures import PictureError, check_ffmpeg, check_matplotlib

from .parser import UsageError


def require_matplotlib(extra: str = "plots") -> None:
    """Refuse to draw without matplotlib. Called before the work, so that none is lost.

    Raises:
        UsageError: matplotlib is not installed; the message names the extra that installs it.
    """
    try:
        check_matplotlib(extra)
    except PictureError as error:
        raise UsageError(str(error)) from None


def require_ffmpeg() -> None:
    """Refuse to make a video without ffmpeg. Called before the work, so that none is lost.

    Raises:
        UsageError: it is not installed; the message names the package that has it.
    """
    try:
        check_ffmpeg()
    except PictureError as error:
        raise UsageError(str(error)) from None
