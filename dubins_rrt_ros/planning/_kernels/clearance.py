# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Distances to obstacles, and the check of an arc by conservative advancement, which leaves no gap between its samples.

The field holds, for each cell of a raster over the map, a lower bound of the clearance anywhere in the cell. Where that does
not decide, the exact distance does: to the squares of a grid's occupied cells, or to the edges of polygons.

Guarantee of conservative advancement. The clearance changes by at most a metre per metre (it is 1-Lipschitz). A
sample is taken as free where its clearance is at least `required_clearance + margin`; the next one lies
`clearance - required_clearance + margin / 2` ahead. Between two such samples s apart, with clearances c and c', the clearance is
at least (c + c' - s) / 2 >= required_clearance + margin / 4. So a curve that passes has more than the required clearance
everywhere, and one that keeps `required_clearance + margin` always passes.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import UNLIMITED, Pose, drive_from
    from cython.cimports.dubins_rrt_ros.planning._kernels.edge_tree import EdgeTree
    from cython.cimports.libc.math import cos, sin, sqrt
else:
    from math import cos, sin, sqrt

    from .dubins import UNLIMITED, Pose, drive_from
    from .edge_tree import EdgeTree


@cython.cclass
class Clearance:
    """A field of lower bounds [m] over a raster; subclasses have the exact distance. A cell below 0 lies in an obstacle."""

    def __init__(self, field, resolution: cython.double, origin, margin: cython.double):
        self.field = field
        self.resolution = resolution
        self.margin = margin
        self.x0, self.y0 = origin[0], origin[1]
        self.cos_yaw, self.sin_yaw = cos(origin[2]), sin(origin[2])
        self.width = field.shape[1] * resolution
        self.height = field.shape[0] * resolution

    def exact(self, x, y):
        """Return the distance from a point in the raster's frame to the edge of the map."""
        return min(min(x, self.width - x), min(y, self.height - y))

    def at_least(self, x, y, enough):
        """Return the clearance at a point of the map's frame, or a lower bound of it that is at least `enough`; 0 outside."""
        dx: cython.double = x - self.x0
        dy: cython.double = y - self.y0
        u: cython.double = self.cos_yaw * dx + self.sin_yaw * dy
        v: cython.double = self.cos_yaw * dy - self.sin_yaw * dx
        if not (0 <= u < self.width and 0 <= v < self.height):
            return 0
        row: cython.int = self.row_of(v)
        column: cython.int = self.column_of(u)
        bound: cython.double = cython.cast(cython.double, self.field[row, column])
        if bound < 0:
            return 0
        return bound if bound >= enough else self.exact(u, v)

    def point_is_free(self, x, y, required_clearance):
        """Return whether a point has the required clearance and the margin."""
        return self.at_least(x, y, required_clearance + self.margin) >= required_clearance + self.margin

    def arc_is_free(self, pose, radius, turn, length, s, required_clearance):
        """Check an arc from `s` on; return how far the next sample lies beyond its end, or -1 where it is not free."""
        if s > length:
            return s - length
        sin_theta: cython.double = sin(pose.theta)
        cos_theta: cython.double = cos(pose.theta)
        worth_exact: cython.double = required_clearance + self.margin + self.resolution
        found: cython.double
        at: Pose
        while s <= length:
            at = drive_from(pose, sin_theta, cos_theta, radius, turn, s)
            found = self.at_least(at.x, at.y, worth_exact)
            if found < required_clearance + self.margin:
                return -1
            s += found - required_clearance + self.margin / 2
        return s - length

    def sweep_is_clear(self, corners, first, end, along, across, spans):
        """Return whether a convex polygon that moves straight touches no obstacle and stays on the map.

        Args:
            corners: (n, 2), of which `corners[first:end]` are the polygon's, counter-clockwise, in the raster's frame [m].
            along, across: the motion in that frame [m].
            spans: (rows, 2) working memory: the least and the greatest x that the polygon covers in each row of the raster.
        """
        left: cython.double = UNLIMITED
        right: cython.double = -UNLIMITED
        low: cython.double = UNLIMITED
        high: cython.double = -UNLIMITED
        i: cython.int
        for i in range(first, end):
            left = min(left, min(corners[i, 0], corners[i, 0] + along))
            right = max(right, max(corners[i, 0], corners[i, 0] + along))
            low = min(low, min(corners[i, 1], corners[i, 1] + across))
            high = max(high, max(corners[i, 1], corners[i, 1] + across))
        if not (left >= 0 and right < self.width and low >= 0 and high < self.height):
            return False
        first_row: cython.int = self.row_of(low)
        last_row: cython.int = self.row_of(high)
        for i in range(first_row, last_row + 1):
            spans[i, 0], spans[i, 1] = UNLIMITED, -UNLIMITED
        before: cython.int = end - 1
        for i in range(first, end):
            self.span(corners[before, 0], corners[before, 1], corners[i, 0], corners[i, 1], spans)
            if along != 0 or across != 0:
                self.span(corners[before, 0] + along, corners[before, 1] + across, corners[i, 0] + along, corners[i, 1] + across,
                          spans)
                self.span(corners[i, 0], corners[i, 1], corners[i, 0] + along, corners[i, 1] + across, spans)
            before = i
        return self.spans_are_clear(first_row, last_row, spans, corners, first, end, along, across)

    def span(self, x0, y0, x1, y1, spans):
        """Widen the spans of the rows that an edge crosses by the part of it in each row."""
        if y1 < y0:
            x0, y0, x1, y1 = x1, y1, x0, y0
        row: cython.int = self.row_of(y0)
        last: cython.int = self.row_of(y1)
        slope: cython.double = (x1 - x0) / (y1 - y0) if last > row else 0
        at: cython.double = x0
        after: cython.double
        while row <= last:
            after = x1
            if row < last:  # where the edge leaves the row
                after = min(max(x0 + slope * ((row + 1) * self.resolution - y0), min(x0, x1)), max(x0, x1))
            spans[row, 0] = min(spans[row, 0], min(at, after))
            spans[row, 1] = max(spans[row, 1], max(at, after))
            at = after
            row += 1

    @cython.cfunc
    @cython.nogil
    @cython.inline
    @cython.exceptval(check=False)
    def row_of(self, y: cython.double) -> cython.int:
        """Return the row of the raster that holds a y in its frame."""
        return min(cython.cast(cython.int, y / self.resolution), cython.cast(cython.int, self.field.shape[0]) - 1)

    @cython.cfunc
    @cython.nogil
    @cython.inline
    @cython.exceptval(check=False)
    def column_of(self, x: cython.double) -> cython.int:
        """Return the column of the raster that holds an x in its frame."""
        return min(cython.cast(cython.int, x / self.resolution), cython.cast(cython.int, self.field.shape[1]) - 1)

    def spans_are_clear(self, first_row, last_row, spans, corners, first, end, along, across):
        """Return what `sweep_is_clear` does, given the spans of the rows; subclasses know the obstacles."""
        return True

    def distances(self, points: cython.double[:, ::1], out: cython.double[::1]):
        """Write the exact clearance at (n, 2) points of the map's frame to `out` [m]."""
        i: cython.Py_ssize_t
        with cython.nogil:
            for i in range(points.shape[0]):
                out[i] = self.at_least(points[i, 0], points[i, 1], UNLIMITED)


@cython.cclass
class GridClearance(Clearance):
    """Clearance from the squares of occupied cells.

    `row_gap` holds the distances of each cell to the next occupied ones in its row, as `distance.measure_row_gaps` packs them.
    `nearest_rows` holds, for the cells that were asked for, the rows in which the nearest square to a point of the cell may lie:
    the first one as seen from the cell's, times 65536, and their number. Threads write the same there, each at one stroke.
    """

    def __init__(self, field, resolution, origin, margin, row_gap):
        Clearance.__init__(self, field, resolution, origin, margin)
        self.row_gap = row_gap
        self.nearest_rows = np.zeros(row_gap.shape, np.int32)  # which takes memory only where it is written to

    @cython.cfunc
    @cython.nogil
    @cython.inline
    @cython.exceptval(check=False)
    def squared_across(self, x: cython.double, row: cython.int, column: cython.int) -> cython.double:
        """Return the squared distance along x to the nearest occupied square of a row."""
        row_gap: cython.int = self.row_gap[row, column]
        if row_gap == 0:
            return 0
        gap: cython.double = min(x - (column - left_gap(row_gap) + 1) * self.resolution,
                                 (column + right_gap(row_gap)) * self.resolution - x)
        return gap * gap

    def exact(self, x, y):
        """Return the distance to the nearest occupied square or the map's edge."""
        nearest: cython.double = Clearance.exact(self, x, y)
        nearest = nearest * nearest
        row: cython.int = self.row_of(y)
        column: cython.int = self.column_of(x)
        if self.nearest_rows[row, column] == 0:
            self.nearest_rows[row, column] = self.find_nearest_rows(row, column)
        first: cython.int = self.nearest_rows[row, column] >> 16
        end: cython.int = first + (self.nearest_rows[row, column] & 65535)
        if first <= 0 < end:
            nearest = min(nearest, self.squared_across(x, row, column))
        up: cython.double = (row + 1) * self.resolution - y
        down: cython.double = y - row * self.resolution
        away: cython.int = 1
        while away < end or away <= -first:
            if first <= away < end:
                nearest = min(nearest, up * up + self.squared_across(x, row + away, column))
            if first <= -away < end:
                nearest = min(nearest, down * down + self.squared_across(x, row - away, column))
            away += 1
            up += self.resolution
            down += self.resolution
        return sqrt(nearest)

    def find_nearest_rows(self, row, column):
        """Return the rows in which the nearest square to a point of a cell may lie, as `nearest_rows` holds them.

        Rows are left out that are farther from any point of the cell than a square, or the map's edge, is from all of them.
        """
        rows: cython.int = cython.cast(cython.int, self.field.shape[0])
        columns: cython.int = cython.cast(cython.int, self.field.shape[1])
        side: cython.double = 1 + min(min(row, rows - 1 - row), min(column, columns - 1 - column))
        farthest: cython.double = side * side
        most: cython.int = 0
        while most * cython.cast(cython.double, most) < farthest:
            farthest = min(farthest, min(self.squared_cells(row + most, column, most, 0),
                                         self.squared_cells(row - most, column, -most, 0)))
            most += 1
        most += 1  # whose nearest point may be as far, so that rounding decides
        first: cython.int = -most
        while first <= most and self.squared_cells(row + first, column, first, 1) > farthest:
            first += 1
        end: cython.int = most + 1
        while end > first and self.squared_cells(row + end - 1, column, end - 1, 1) > farthest:
            end -= 1
        if first >= end:  # the map's edge is nearer than all squares
            first, end = 0, 1
        return first * 65536 + (end - first)

    def squared_cells(self, row, column, away, nearer):
        """Return the squared distance [cells] from the farthest (0) or nearest (1) point of a cell to the squares of a row."""
        if not (0 <= row < self.field.shape[0]):
            return UNLIMITED
        row_gap: cython.int = self.row_gap[row, column]
        gap: cython.double = 0 if row_gap == 0 else min(left_gap(row_gap), right_gap(row_gap)) - nearer
        across: cython.double = max(max(away, -away) - nearer, 0)
        return gap * gap + across * across

    def spans_are_clear(self, first_row, last_row, spans, corners, first, end, along, across):
        """Return whether no cell in the spans is occupied; go from each to where the next occupied one to the right may be."""
        row: cython.int
        column: cython.int
        last: cython.int
        row_gap: cython.int
        for row in range(first_row, last_row + 1):
            column = self.column_of(spans[row, 0])
            last = self.column_of(spans[row, 1])
            while column <= last:
                row_gap = self.row_gap[row, column]
                if row_gap == 0:
                    return False
                column += right_gap(row_gap)
        return True


@cython.cclass
class PolygonClearance(Clearance):
    """Clearance from the edges of polygons, (m, 4): x, y, x, y of both ends in the raster's frame.

    The distance has no sign: an obstacle is entered only through an edge. A cell that an edge touches is 0 in the field.
    """

    def __init__(self, field, resolution, origin, margin, edges):
        Clearance.__init__(self, field, resolution, origin, margin)
        self.edges = EdgeTree(edges)

    def exact(self, x, y):
        """Return the distance to the nearest edge."""
        return sqrt(self.edges.squared_distance(x, y))

    def spans_are_clear(self, first_row, last_row, spans, corners, first, end, along, across):
        """Return whether no edge is touched."""
        left: cython.double = UNLIMITED
        right: cython.double = -UNLIMITED
        row: cython.int
        for row in range(first_row, last_row + 1):
            left, right = min(left, spans[row, 0]), max(right, spans[row, 1])
        return not self.edges.meets_sweep(left - self.resolution, (first_row - 0.5) * self.resolution,
                                          right + self.resolution, (last_row + 1.5) * self.resolution,
                                          corners, first, end, along, across)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def left_gap(row_gap: cython.int) -> cython.int:
    """Return a lower bound of the distance to the next blocked cell to the left, in cells, from a packed `row_gap`.

    It is exact where that is the nearer of both sides; else it is one more than the nearer one, which then decides.
    """
    return (row_gap >> 2) + (row_gap & 1)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def right_gap(row_gap: cython.int) -> cython.int:
    """Return the same for the next blocked cell to the right."""
    return (row_gap >> 2) + (row_gap >> 1 & 1)
