"""The vehicle's progress along a path: only what is ahead of it counts."""

import math

import numpy as np

from ..problem import Pose
from .angles import position_error
from .path import Path

#: Distance between the poses among which the nearest is sought [m], and the maximum number of them.
STEP, MOST_POSES = 0.01, 2000


class PathProgress:
    """The place of the vehicle on a path. It never goes back, also where the path crosses itself or the vehicle is beside it.

    Attributes:
        arc_length: from the path's start to the pose that the vehicle has reached [m].
        distance: from the vehicle to that pose [m].
    """

    def __init__(self, path: Path):
        self._path, self._length = path, path.length
        self._position = path.start
        self.arc_length = self.distance = 0.0

    def advance(self, position: Pose) -> None:
        """Take a new pose of the vehicle: the nearest pose is sought ahead, within twice the distance driven since the last."""
        window = min(2 * position_error(position, self._position), self._length - self.arc_length)
        self._position = position
        candidates = self.arc_length + window * np.linspace(0.0, 1.0, min(MOST_POSES, 2 + math.ceil(window / STEP)))
        poses = self._path.at(candidates / self._length) if self._length else self._path.waypoints[:1]
        with np.errstate(over="ignore"):
            distances = np.hypot(poses[:, 0] - position[0], poses[:, 1] - position[1])
        nearest = int(np.argmin(distances))
        self.arc_length, self.distance = max(self.arc_length, float(candidates[nearest])), float(distances[nearest])

    @property
    def ahead(self) -> Path:
        """The rest of the path."""
        return self._path.after(self.arc_length)

    @property
    def left(self) -> float:
        """Its length [m]."""
        return self._length - self.arc_length
