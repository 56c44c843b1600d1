# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The costs of a grid's cells, and their integral along an arc, which is exact: the arc is split where it crosses their edges.

In the frame of the cells, whose sides are 1, an arc is a straight line or a part of a circle. A place just ahead on it lies in
one cell; the first crossing from there of one of the four lines around that cell is where the next one begins.
"""

import cython

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import TWO_PI, UNLIMITED, Pose
    from cython.cimports.libc.math import acos, cos, fabs, floor, fmod, sin
else:
    from math import acos, cos, fabs, floor, fmod, sin

    from .dubins import TWO_PI, UNLIMITED, Pose

#: How far ahead the cell is looked up [cells], so that rounding on an edge does not matter; and how far at most, where that has
#: to be doubled, since an arc of a large radius leaves an edge slowly.
AHEAD = cython.declare(cython.double, 1e-7)
FARTHEST_AHEAD = cython.declare(cython.double, 1e-3)
#: Columns or rows per cell of a straight line below which it runs along an edge.
ALONG = cython.declare(cython.double, 1e-9)
#: Angle that is due to rounding, ahead of which a crossing is the one just passed [rad].
ROUNDING = cython.declare(cython.double, 1e-12)
#: A quarter of a turn [rad].
QUARTER_TURN = cython.declare(cython.double, TWO_PI / 4)


@cython.cclass
class CellCosts:
    """The costs of cells. It has working memory: no two threads may share one."""

    def __init__(self, costs, free_of_cost, resolution: cython.double, origin):
        """Take the costs of a grid.

        Args:
            costs: (rows, columns) uint8, in percent.
            free_of_cost: (rows, columns) uint8: the number of columns or rows to the nearest cell with a cost, or fewer; 0 in it.
            resolution: the side of a cell [m].
            origin: (x [m], y [m], yaw [rad]) of the outer corner of cell (0, 0).
        """
        self.costs, self.free_of_cost, self.resolution = costs, free_of_cost, resolution
        self.rows, self.columns = costs.shape
        self.x0, self.y0, self.yaw = origin
        self.sin_yaw, self.cos_yaw = sin(origin[2]), cos(origin[2])

    def integral(self, pose, radius, turn, length, limit):
        """Return the integral of the cells' costs, as shares of 100 %, along an arc [m]; from `limit` on it may be less."""
        self.begin(pose, radius, turn)
        length /= self.resolution
        limit /= self.resolution
        found: cython.double = 0
        s: cython.double = 0
        ahead: cython.double = AHEAD
        size: cython.double
        column: cython.double
        row: cython.double
        cost: cython.double
        near: cython.int
        while s < length and found < limit:
            column, row = self.place_at(s + ahead)
            near, cost = self.free_of_cost_at(column, row), 0
            if near > 1:
                size = near - 1
            else:
                size = ahead + self.to_edge(s + ahead, floor(column), floor(row))
                cost = self.cost_at(column, row)
            ahead = AHEAD if size > ahead else min(2 * ahead, FARTHEST_AHEAD)
            found += min(size, length - s) * cost
            s += size
        return found * self.resolution

    def begin(self, pose, radius, turn):
        """Begin an arc at a pose."""
        dx: cython.double = (pose.x - self.x0) / self.resolution
        dy: cython.double = (pose.y - self.y0) / self.resolution
        heading: cython.double = pose.theta - self.yaw
        self.turn, self.radius = turn, radius / self.resolution
        self.column = self.cos_yaw * dx + self.sin_yaw * dy
        self.row = self.cos_yaw * dy - self.sin_yaw * dx
        self.cosine, self.sine = cos(heading), sin(heading)
        if turn != 0:  # the middle of the circle, and the direction from there
            self.column -= turn * self.radius * self.sine
            self.row += turn * self.radius * self.cosine
            self.direction = heading - turn * QUARTER_TURN

    def place_at(self, s):
        """Return the column and the row after `s` cells on the arc."""
        direction: cython.double
        if self.turn == 0:
            return self.column + s * self.cosine, self.row + s * self.sine
        direction = self.direction + self.turn * s / self.radius
        return self.column + self.radius * cos(direction), self.row + self.radius * sin(direction)

    def free_of_cost_at(self, column, row):
        """Return how many cells away the nearest one with a cost is at least; 1 beyond the grid."""
        if not (0 <= column < self.columns and 0 <= row < self.rows):
            return 1
        return self.free_of_cost[cython.cast(cython.int, row), cython.cast(cython.int, column)]

    def cost_at(self, column, row):
        """Return the cost of the cell at a place as a share of 100 %; 0 beyond the grid."""
        if not (0 <= column < self.columns and 0 <= row < self.rows):
            return 0
        return self.costs[cython.cast(cython.int, row), cython.cast(cython.int, column)] / 100.0

    def to_edge(self, s, column, row):
        """Return how far ahead of `s` the arc leaves the cell of a whole column and row that it is in there [cells]."""
        direction: cython.double
        if self.turn == 0:
            return min(to_line(self.column + s * self.cosine - column, self.cosine),
                       to_line(self.row + s * self.sine - row, self.sine))
        direction = self.direction + self.turn * s / self.radius
        return self.radius * min(
            min(self.angle_to(direction, column - self.column), self.angle_to(direction, column + 1 - self.column)),
            min(self.angle_to(direction - QUARTER_TURN, row - self.row),
                self.angle_to(direction - QUARTER_TURN, row + 1 - self.row)))

    def angle_to(self, direction, line):
        """Return the angle to where the circle next crosses a line, at this distance from its middle along direction 0 [rad]."""
        if fabs(line) >= self.radius:
            return UNLIMITED
        crossing: cython.double = acos(line / self.radius)
        return min(self.angle_between(direction, crossing), self.angle_between(direction, -crossing))

    def angle_between(self, direction, other):
        """Return the angle by which a direction turns on until it is another, in [0, 2 pi) [rad]."""
        angle: cython.double = fmod(self.turn * (other - direction), TWO_PI)
        if angle < 0:
            angle += TWO_PI
        return angle if angle < TWO_PI - ROUNDING else 0

    def integral_along(self, pose, radius: cython.double, turn: cython.int, length: cython.double,
                       limit: cython.double = UNLIMITED) -> float:
        """Return what `integral` does for an arc from (x, y, theta)."""
        return self.integral(Pose(pose[0], pose[1], pose[2]), radius, turn, length, limit)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def to_line(share: cython.double, step: cython.double) -> cython.double:
    """Return after how much of a straight line a column or row ends of which a share is passed, a step of it per cell."""
    if fabs(step) < ALONG:
        return UNLIMITED
    return max(0.0, (1 - share if step > 0 else -share) / step)
