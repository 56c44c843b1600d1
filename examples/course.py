"""The path that a simulated car of `drive.py` drives on, as a planner tells of it."""

import math

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Path

#: Number of poses ahead of the last one among which the nearest is sought.
WINDOW = 100


class Course:
    """A path by `plan`, and by `planner/status` whether it is free.

    Attributes:
        poses: (n, 3) as x [m], y [m] and yaw [rad]; empty without a path.
        is_broken: True if the path is not free on a newer map, and none has come in its place.
    """

    def __init__(self):
        self.poses = np.empty((0, 3))
        self.is_broken = False
        self._at = 0  # index of the pose that was passed last
        self._stamp = ""

    @property
    def is_free(self) -> bool:
        """True if there is a path to drive on."""
        return len(self.poses) > 0 and not self.is_broken

    @property
    def ahead(self) -> np.ndarray:
        """The poses from the one on that was passed last."""
        return self.poses[self._at:]

    @property
    def length(self) -> float:
        """The length of the whole path [m]."""
        return float(_steps(self.poses).sum())

    def take(self, message: Path) -> None:
        """Take another path, or none."""
        poses = [(p.pose.position.x, p.pose.position.y, 2 * math.atan2(p.pose.orientation.z, p.pose.orientation.w))
                 for p in message.poses]
        self.poses, self._at, self.is_broken = np.array(poses).reshape(-1, 3), 0, False
        self._stamp = f"{message.header.stamp.sec}.{message.header.stamp.nanosec:09}"

    def hear(self, message: DiagnosticStatus) -> None:
        """Hear whether the path is broken.

        Topics keep no common order: the warning may come later than the path in its place, of which a status with its stamp
        tells.
        """
        values = {value.key: value.value for value in message.values}
        if message.level == DiagnosticStatus.WARN and values["error_name"] == "NO_VALID_PATH":
            self.is_broken = True
        elif values["stamp"] == self._stamp:
            self.is_broken = False

    def point_ahead(self, x: float, y: float, distance: float) -> tuple[float, float]:
        """Return the point of the path that is so far ahead of the one nearest to (x, y) [m]; straight on beyond its end."""
        window = self.ahead[:WINDOW]
        self._at += int(np.argmin(np.hypot(window[:, 0] - x, window[:, 1] - y)))
        lengths = np.cumsum(_steps(self.ahead))
        if len(lengths) and lengths[-1] > distance:
            px, py = self.ahead[1 + int(np.searchsorted(lengths, distance)), :2]
            return px, py
        beyond = distance - (lengths[-1] if len(lengths) else 0.0)
        px, py, yaw = self.poses[-1]
        return px + beyond * math.cos(yaw), py + beyond * math.sin(yaw)


def _steps(poses: np.ndarray) -> np.ndarray:
    return np.hypot(*np.diff(poses[:, :2], axis=0).T)
