# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Distances to obstacles, and the walk along a curve that leaves no gap between its samples.

A field holds, for each cell of a raster over the map, a lower bound of the clearance anywhere in the cell. Where it does
not decide, the exact distance does: to the squares of a grid's occupied cells, or to the edges of polygons.

What the walk guarantees. The clearance changes by at most a metre per metre (it is 1-Lipschitz). A sample is taken as free
where its clearance is at least `need + margin`; the next one lies `clearance - need + margin / 2` ahead. Between two such
samples s apart, with clearances c and c', the clearance is at least (c + c' - s) / 2 >= need + margin / 4. So a curve that
passes has a clearance above `need` everywhere, and one that keeps `need + margin` always passes.
"""

import cython

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import drive, turn_of
    from cython.cimports.libc.math import cos, sin, sqrt
else:
    from math import cos, sin, sqrt

    from .dubins import drive, turn_of


@cython.cclass
class Clearance:
    """A field of lower bounds [m] over a raster; `exact` is the subclasses'. A cell below 0 is an obstacle altogether."""

    def __init__(self, field, resolution: cython.double, origin, margin: cython.double):
        self.field = field
        self.resolution = resolution
        self.margin = margin
        self.x0, self.y0 = origin[0], origin[1]
        self.cos_yaw, self.sin_yaw = cos(origin[2]), sin(origin[2])
        self.width = field.shape[1] * resolution
        self.height = field.shape[0] * resolution

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def exact(self, x: cython.double, y: cython.double) -> cython.double:
        """The distance from a point in the raster's frame to the edge of the map."""
        return min(min(x, self.width - x), min(y, self.height - y))

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def at_least(self, x: cython.double, y: cython.double, enough: cython.double) -> cython.double:
        """The clearance at a point of the map's frame, or a lower bound of it that is at least `enough`; 0 outside."""
        dx: cython.double = x - self.x0
        dy: cython.double = y - self.y0
        u: cython.double = self.cos_yaw * dx + self.sin_yaw * dy
        v: cython.double = self.cos_yaw * dy - self.sin_yaw * dx
        if not (0 <= u < self.width and 0 <= v < self.height):
            return 0
        row: cython.int = min(cython.cast(cython.int, v / self.resolution), cython.cast(cython.int, self.field.shape[0]) - 1)
        column: cython.int = min(cython.cast(cython.int, u / self.resolution), cython.cast(cython.int, self.field.shape[1]) - 1)
        bound: cython.double = cython.cast(cython.double, self.field[row, column])
        if bound < 0:
            return 0
        return bound if bound >= enough else self.exact(u, v)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def free(self, x: cython.double, y: cython.double, need: cython.double) -> cython.bint:
        """Whether the clearance at a point is at least `need + margin`."""
        return self.at_least(x, y, need + self.margin) >= need + self.margin

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def arc_is_free(self, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, turn: cython.int,
                    length: cython.double, s: cython.double, need: cython.double) -> cython.double:
        """Walk an arc from `s` on; by how much the next sample lies beyond its end, or -1 where it hits."""
        worth_exact: cython.double = need + self.margin + self.resolution
        found: cython.double
        px: cython.double
        py: cython.double
        ptheta: cython.double
        while s <= length:
            px, py, ptheta = drive(x, y, theta, radius, turn, s)
            found = self.at_least(px, py, worth_exact)
            if found < need + self.margin:
                return -1
            s += found - need + self.margin / 2
        return s - length

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def curve_is_free(self, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, word: cython.int,
                      first: cython.double, second: cython.double, third: cython.double, need: cython.double) -> cython.bint:
        """Whether a curve keeps the clearance `need`; see the module's guarantee."""
        rest: cython.double = self.arc_is_free(x, y, theta, radius, turn_of(word, 0), first, 0, need)
        if rest < 0:
            return False
        x, y, theta = drive(x, y, theta, radius, turn_of(word, 0), first)
        rest = self.arc_is_free(x, y, theta, radius, turn_of(word, 1), second, rest, need)
        if rest < 0:
            return False
        x, y, theta = drive(x, y, theta, radius, turn_of(word, 1), second)
        rest = self.arc_is_free(x, y, theta, radius, turn_of(word, 2), third, rest, need)
        if rest < 0:
            return False
        x, y, theta = drive(x, y, theta, radius, turn_of(word, 2), third)
        return self.free(x, y, need)

    def distances(self, points: cython.double[:, ::1], out: cython.double[::1]):
        """Write the exact clearance at (n, 2) points of the map's frame to `out` [m]."""
        i: cython.Py_ssize_t
        with cython.nogil:
            for i in range(points.shape[0]):
                out[i] = self.at_least(points[i, 0], points[i, 1], 1e300)

    def is_curve_free(self, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, word: cython.int,
                      first: cython.double, second: cython.double, third: cython.double, need: cython.double) -> bool:
        """Whether a curve keeps the clearance `need`; see the module's guarantee."""
        return self.curve_is_free(x, y, theta, radius, word, first, second, third, need)


@cython.cclass
class GridClearance(Clearance):
    """Clearance from the squares of occupied cells.

    `aside` holds for each cell how far away the next occupied ones in its row are, as `distance.look_aside` writes it.
    """

    def __init__(self, field, resolution, origin, margin, aside):
        Clearance.__init__(self, field, resolution, origin, margin)
        self.aside = aside

    @cython.cfunc
    @cython.nogil
    @cython.inline
    @cython.exceptval(check=False)
    def squared_across(self, x: cython.double, row: cython.int, column: cython.int) -> cython.double:
        """The squared distance along x to the nearest occupied square of a row."""
        aside: cython.int = self.aside[row, column]
        if aside == 0:
            return 0
        # The farther one of the two counts as one cell farther than the nearer: it is at least that, and not the nearest.
        left: cython.int = (aside >> 2) + (aside & 1)
        right: cython.int = (aside >> 2) + (aside >> 1 & 1)
        gap: cython.double = min(x - (column - left + 1) * self.resolution, (column + right) * self.resolution - x)
        return gap * gap

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def exact(self, x: cython.double, y: cython.double) -> cython.double:
        """The distance to the nearest occupied square or the map's edge: rows outward until they are too far."""
        nearest: cython.double = Clearance.exact(self, x, y)
        nearest = nearest * nearest
        rows: cython.int = cython.cast(cython.int, self.field.shape[0])
        row: cython.int = min(cython.cast(cython.int, y / self.resolution), rows - 1)
        column: cython.int = min(cython.cast(cython.int, x / self.resolution), cython.cast(cython.int, self.field.shape[1]) - 1)
        nearest = min(nearest, self.squared_across(x, row, column))
        up: cython.double = (row + 1) * self.resolution - y
        down: cython.double = y - row * self.resolution
        away: cython.int = 1
        while up * up < nearest or down * down < nearest:
            if up * up < nearest and row + away < rows:
                nearest = min(nearest, up * up + self.squared_across(x, row + away, column))
            if down * down < nearest and row - away >= 0:
                nearest = min(nearest, down * down + self.squared_across(x, row - away, column))
            away += 1
            up += self.resolution
            down += self.resolution
        return sqrt(nearest)


@cython.cclass
class PolygonClearance(Clearance):
    """Clearance from the edges of polygons.

    `edges` is (m, 4): x, y, x, y of both ends in the raster's frame. Cell c can have `edge_of[first_edge[c]:first_edge[c + 1]]`
    nearest. The distance has no sign; a walk that starts in free space cannot get into an obstacle but through its edge.
    """

    def __init__(self, field, resolution, origin, margin, edges, first_edge, edge_of):
        Clearance.__init__(self, field, resolution, origin, margin)
        self.edges = edges
        self.first_edge = first_edge
        self.edge_of = edge_of

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def exact(self, x: cython.double, y: cython.double) -> cython.double:
        """The distance to the nearest edge."""
        row: cython.int = min(cython.cast(cython.int, y / self.resolution), cython.cast(cython.int, self.field.shape[0]) - 1)
        column: cython.int = min(cython.cast(cython.int, x / self.resolution), cython.cast(cython.int, self.field.shape[1]) - 1)
        cell: cython.Py_ssize_t = row * self.field.shape[1] + column
        nearest: cython.double = 1e300
        i: cython.Py_ssize_t
        for i in range(self.first_edge[cell], self.first_edge[cell + 1]):
            nearest = min(nearest, squared_to_segment(x, y, self.edges, self.edge_of[i]))
        return sqrt(nearest)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def squared_to_segment(x: cython.double, y: cython.double, edges: cython.double[:, ::1], edge: cython.int) -> cython.double:
    """The squared distance from a point to an edge."""
    dx: cython.double = edges[edge, 2] - edges[edge, 0]
    dy: cython.double = edges[edge, 3] - edges[edge, 1]
    px: cython.double = x - edges[edge, 0]
    py: cython.double = y - edges[edge, 1]
    along: cython.double = (px * dx + py * dy) / (dx * dx + dy * dy)
    along = min(max(along, 0.0), 1.0)
    px -= along * dx
    py -= along * dy
    return px * px + py * py
