"""Names of poses in pictures, written where they cover least."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely
from matplotlib import patheffects
from matplotlib.axes import Axes

from ..maps.model import GridMap, Map

if TYPE_CHECKING:
    from .drawing import Drawing

#: Size of the letters, and the mean width of one [pt].
SIZE, LETTER = 10.0, 6.4
#: Directions from a pose in which its name is tried, from the preferred one on [rad].
DIRECTIONS = [math.radians(turn) for turn in (0, 90, -90, 45, -45, 135, -135, 180)]
#: Number of points across and up a name at which it is looked at what it covers.
ACROSS, UP = 12, 5
#: Half the width of the arrow at a pose, in its length.
HALF_WIDTH = 0.26
#: Weight of a point outside the picture, and of a pose of the path, in points on an obstacle.
OUTSIDE, ON_PATH = 100.0, 3.0


class Names:
    """The names in one picture, each written where it covers no obstacle, path, waypoint or other name, if possible."""

    def __init__(self, axes: Axes, drawing: "Drawing", arrow: float):
        """Prepare to write on axes that are fitted to the map.

        Args:
            axes, drawing: the picture.
            arrow: length of the arrow at each pose [m].
        """
        self._axes, self._map, self._vehicle, self._arrow = axes, drawing.map, drawing.vehicle, arrow
        self._low, self._high = np.sort([axes.get_xlim(), axes.get_ylim()]).T
        self._covered = np.array([*drawing.path[:, :2].tolist(), *(point[:2] for point in drawing.waypoints)]).reshape(-1, 2)
        figure = axes.get_figure()
        assert figure is not None  # axes are made by a figure
        self._point = float((self._high - self._low).max() / max(axes.bbox.size) * figure.dpi / 72)  # side of a point [m]
        self._boxes: list[np.ndarray] = []

    def draw(self, name: str, pose: Sequence[float], colour: str, preferred: float) -> None:
        """Write a name beside a pose, if possible in the preferred direction, which is relative to its heading [rad]."""
        half = self._point * np.array([LETTER * len(name), 1.2 * SIZE]) / 2
        centres = [self._centre(pose, preferred + turn, half) for turn in DIRECTIONS]
        best = min(centres, key=lambda centre: self._cover(centre, half))  # of equal ones the first
        self._boxes.append(np.array([best - half, best + half]))
        halo = [patheffects.withStroke(linewidth=2.5, foreground="white")]
        x, y = best.tolist()
        self._axes.text(x, y, name, color=colour, fontsize=SIZE, weight="bold", ha="center", va="center", path_effects=halo,
                        zorder=7)

    def _centre(self, pose: Sequence[float], turn: float, half: np.ndarray) -> np.ndarray:
        """Return the centre of a name, clear of the vehicle and its arrow."""
        direction = np.array([math.cos(pose[2] + turn), math.sin(pose[2] + turn)])
        apart = 1.1 * self._reach(turn) + 0.3 * SIZE * self._point + np.abs(direction) @ half
        centre: np.ndarray = pose[:2] + direction * apart
        return centre

    def _reach(self, turn: float) -> float:
        """Return how far the vehicle and its arrow reach in a direction that is relative to its heading [m]."""
        ahead, left = math.cos(turn), math.sin(turn)
        corners = self._vehicle.footprint
        body = max(ahead * x + left * y for x, y in corners) if corners else self._vehicle.robot_radius
        return max(body, self._arrow * ahead, self._arrow * HALF_WIDTH * abs(left))

    def _cover(self, centre: np.ndarray, half: np.ndarray) -> float:
        """Return how much a name would cover that should be seen."""
        low, high = centre - half, centre + half
        points = np.stack(np.meshgrid(np.linspace(low[0], high[0], ACROSS), np.linspace(low[1], high[1], UP)), -1).reshape(-1, 2)
        outside = ((points < self._low) | (points > self._high)).any(axis=1)
        others = sum(bool((low < box[1]).all() and (high > box[0]).all()) for box in self._boxes)
        covered = np.count_nonzero(((self._covered > low) & (self._covered < high)).all(axis=1))
        return (OUTSIDE * (np.count_nonzero(outside) + others) + ON_PATH * covered
                + np.count_nonzero(_are_obstacles(self._map, points[~outside])))


def _are_obstacles(world_map: Map, points: np.ndarray) -> np.ndarray:
    """Return (n,) bool: which of (n, 2) points are drawn as obstacles."""
    if not isinstance(world_map, GridMap):
        return np.asarray(~shapely.contains_xy(world_map.free, points))
    cells = np.floor(world_map.to_grid_frame(points) / world_map.resolution).astype(int)
    rows, columns = cells[:, 1].clip(0, world_map.data.shape[0] - 1), cells[:, 0].clip(0, world_map.data.shape[1] - 1)
    return np.asarray(world_map.thresholds.blocked(world_map.data[rows, columns], allow_unknown=True))
