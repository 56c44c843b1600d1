"""A test of the user's for further obstacles, as the collision checkers ask it: at poses along each motion."""

from collections.abc import Callable

import numpy as np

from ..curves.dubins import DubinsCurve
from ..curves.path import Path
from ..hooks import IsFree, are_free


class OwnTest:
    """The answers of `is_free` about poses, motions and paths, at samples.

    The kernels cannot pass on an exception. So the first one is kept, from then on nothing is free, and `cancel` ends the search.

    Attributes:
        is_free: the user's function.
        asked, refused: number of motions and poses that it was asked about, and that it refused.
    """

    def __init__(self, is_free: IsFree, spacing: float):
        """Ask `is_free` at poses that are at most `spacing` apart [m], and at both ends of each arc."""
        self.is_free, self._spacing = is_free, spacing
        self.asked = self.refused = 0
        self._error: BaseException | None = None

    def pose_is_free(self, x: float, y: float, theta: float) -> bool:
        """Return whether the test holds at a pose."""
        return self._holds(lambda: np.array([[x, y, theta]]))

    def motion_is_free(self, x: float, y: float, theta: float, radius: float, word: int, *lengths: float) -> bool:
        """Return whether the test holds along a curve; `word` is an index into WORDS."""
        curve = DubinsCurve.of_row(np.array([x, y, theta]), radius, word, np.array(lengths))
        return self._holds(lambda: curve.poses(self._spacing))

    def path_is_free(self, path: Path) -> bool:
        """Return whether the test holds along a path."""
        return self._holds(lambda: path.poses(self._spacing))

    def cancel(self, cancelled: Callable[[], bool]) -> Callable[[], bool]:
        """Return what cancels a request: what did so before, and an exception of the test."""
        return lambda: self._error is not None or cancelled()

    def raise_error(self) -> None:
        """Raise the first exception of the test, if there was one."""
        if self._error is not None:
            raise self._error

    def _holds(self, poses: Callable[[], np.ndarray]) -> bool:
        if self._error is not None:
            return False
        try:
            holds = bool(are_free(self.is_free, poses()).all())
        except BaseException as error:  # a Ctrl-C too; it is raised again
            self._error = error
            return False
        self.asked += 1
        self.refused += not holds
        return holds
