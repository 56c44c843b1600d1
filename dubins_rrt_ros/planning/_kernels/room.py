# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The room of a vehicle: the distance from its outline to the nearest obstacle, exact for discs and for polygons.

The distance between two polygons that do not meet is that from a corner of one of them to an edge of the other. So the room of a
footprint is the least of the clearances of its corners, and of the distances from its edges to the corners of the obstacles. Only
corners that stick out count: to a straight or a hollow piece of a wall no edge is nearer with its inside than with its ends.

Poses at which the vehicle touches an obstacle have no room that is defined here; whether it does, the collision checker says.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.clearance import Clearance
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import Pose, fastest_point
    from cython.cimports.libc.math import cos, sin, sqrt
else:
    from math import cos, sin, sqrt

    from .clearance import Clearance
    from .dubins import Pose, fastest_point


@cython.cclass
class CornerIndex:
    """The corners of obstacles that stick out, in buckets.

    Attributes:
        side: side of a bucket [m].
    """

    def __init__(self, points, width, height, side):
        """Sort the corners.

        Args:
            points: (n, 2) float64: x and y in the raster's frame [m].
            width, height: of the raster [m].
            side: side of a bucket [m].
        """
        self.side = side
        self.rows, self.columns = int(height / side) + 1, int(width / side) + 1
        column = np.clip((points[:, 0] / side).astype(np.int64), 0, self.columns - 1)
        row = np.clip((points[:, 1] / side).astype(np.int64), 0, self.rows - 1)
        bucket = row * self.columns + column
        order = np.argsort(bucket, kind="stable")
        self.points = np.ascontiguousarray(points[order], float)
        self.first = np.searchsorted(bucket[order], np.arange(self.rows * self.columns + 1)).astype(np.int32)

    def row_of(self, y):
        """Return the row of buckets that holds a y, the nearest beyond them."""
        return min(max(cython.cast(cython.int, y / self.side), 0), self.rows - 1)

    def column_of(self, x):
        """Return the column of buckets that holds an x, the nearest beyond them."""
        return min(max(cython.cast(cython.int, x / self.side), 0), self.columns - 1)

    def nearest(self, outline, within):
        """Return the distance from an outline, (n, 2) corners one after the other, to the nearest corner, or `within` if less."""
        left: cython.double = outline[0, 0]
        right: cython.double = left
        low: cython.double = outline[0, 1]
        high: cython.double = low
        i: cython.int
        k: cython.int
        row: cython.int
        for i in range(1, cython.cast(cython.int, outline.shape[0])):
            left, right = min(left, outline[i, 0]), max(right, outline[i, 0])
            low, high = min(low, outline[i, 1]), max(high, outline[i, 1])
        left -= within
        right += within
        low -= within
        high += within
        first: cython.int = self.column_of(left)
        last: cython.int = self.column_of(right)
        squared: cython.double = within * within
        for row in range(self.row_of(low), self.row_of(high) + 1):
            for k in range(self.first[row * self.columns + first], self.first[row * self.columns + last + 1]):
                if left < self.points[k, 0] < right and low < self.points[k, 1] < high:
                    squared = min(squared, squared_to_outline(self.points[k, 0], self.points[k, 1], outline))
        return sqrt(squared)


@cython.cclass
class Room:
    """The room of a disc around the reference point: its clearance less its radius."""

    def __init__(self, clearance: Clearance, radius: cython.double):
        self.clearance, self.radius = clearance, radius

    def at(self, pose, enough):
        """Return the room at a pose that is free [m], or a lower bound of it that is at least `enough`."""
        return self.clearance.at_least(pose.x, pose.y, self.radius + enough) - self.radius

    def speed(self, radius, turn):
        """Return the greatest change of the room in an arc, in metres per metre along it."""
        return 1

    def rooms(self, poses: cython.double[:, ::1], enough: cython.double, out: cython.double[::1]):
        """Write what `at` returns for (n, 3) poses to `out`."""
        i: cython.Py_ssize_t
        with cython.nogil:
            for i in range(poses.shape[0]):
                out[i] = self.at(Pose(poses[i, 0], poses[i, 1], poses[i, 2]), enough)


@cython.cclass
class FootprintRoom(Room):
    """The room of a polygon. It has working memory: no two threads may share one."""

    def __init__(self, clearance: Clearance, discs, outline, corners: CornerIndex):
        """Prepare the room of a polygon.

        Args:
            discs: (m, 3 or more): the discs that cover it: x, y, radius [m].
            outline: (n, 2): its corners, one after the other [m].
            corners: those of the obstacles.
        """
        Room.__init__(self, clearance, 0)
        self.discs, self.outline, self.corners = discs, outline, corners
        self.placed = np.empty((len(outline), 2))

    def at(self, pose, enough):
        """Return the room at a pose that is free [m], or a lower bound of it that is at least `enough`."""
        sine: cython.double = sin(pose.theta)
        cosine: cython.double = cos(pose.theta)
        found: cython.double = self.discs_at_least(pose.x, pose.y, sine, cosine, enough)
        return found if found >= enough else self.outline_at_least(pose.x, pose.y, sine, cosine, enough)

    def discs_at_least(self, x, y, sine, cosine, enough):
        """Return a lower bound of the room, by the discs; below `enough` it says nothing."""
        least: cython.double = 1e300
        i: cython.Py_ssize_t
        for i in range(self.discs.shape[0]):
            least = min(least, self.clearance.at_least(x + cosine * self.discs[i, 0] - sine * self.discs[i, 1],
                                                       y + sine * self.discs[i, 0] + cosine * self.discs[i, 1],
                                                       self.discs[i, 2] + enough) - self.discs[i, 2])
            if least < enough:
                break
        return least

    def outline_at_least(self, x, y, sine, cosine, enough):
        """Return the room, or `enough` where that is less: by the corners of the vehicle, and by those of the obstacles."""
        least: cython.double = enough
        along: cython.double
        across: cython.double
        i: cython.Py_ssize_t
        for i in range(self.outline.shape[0]):
            along = x + cosine * self.outline[i, 0] - sine * self.outline[i, 1]
            across = y + sine * self.outline[i, 0] + cosine * self.outline[i, 1]
            least = min(least, self.clearance.at_least(along, across, least))
            along -= self.clearance.x0
            across -= self.clearance.y0
            self.placed[i, 0] = self.clearance.cos_yaw * along + self.clearance.sin_yaw * across
            self.placed[i, 1] = self.clearance.cos_yaw * across - self.clearance.sin_yaw * along
        return self.corners.nearest(self.placed, least)

    def speed(self, radius, turn):
        """Return the speed of the fastest point of the vehicle in an arc, in metres per metre along it."""
        return fastest_point(self.outline, radius, turn)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def squared_to_outline(x: cython.double, y: cython.double, outline: cython.double[:, ::1]) -> cython.double:
    """Return the squared distance from a point to the edges of an outline."""
    before: cython.int = cython.cast(cython.int, outline.shape[0]) - 1
    nearest: cython.double = 1e300
    i: cython.int
    dx: cython.double
    dy: cython.double
    px: cython.double
    py: cython.double
    along: cython.double
    for i in range(cython.cast(cython.int, outline.shape[0])):
        dx, dy = outline[i, 0] - outline[before, 0], outline[i, 1] - outline[before, 1]
        px, py = x - outline[before, 0], y - outline[before, 1]
        along = min(max((px * dx + py * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        px -= along * dx
        py -= along * dy
        nearest = min(nearest, px * px + py * py)
        before = i
    return nearest
