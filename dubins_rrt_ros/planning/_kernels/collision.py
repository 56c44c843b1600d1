# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The vehicle's body on a map: whether it touches an obstacle at a pose, or anywhere along a curve.

A disc is a matter of the clearance alone. For a polygon the gap between it and the obstacles decides, which is at least that of
the discs that cover it; where these are too coarse, the polygon made wider by some distance is held against the obstacles, which
is exact, and the gap is at least that distance.

What the walk guarantees for a polygon. No point of the body moves faster than `speed`, in metres per metre along the curve, so
neither does the gap change faster. A pose is free with a gap of at least `margin`; the next one is so far ahead that no point
moves by more than `gap + margin / 2` until there. Between two such poses, with gaps g and g', the gap is at least
(g + g' - (g + margin / 2)) / 2 >= margin / 4. Straight on the body covers the convex hull of its first and last place, which is
held against the obstacles as a whole. A polygon made wider by e reaches no farther than sqrt(2) e beyond itself, so a curve that
keeps a gap of sqrt(2) margin always passes.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.clearance import Clearance
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import drive, drive_from, turn_of
    from cython.cimports.libc.math import cos, hypot, sin
else:
    from math import cos, hypot, sin

    from .clearance import Clearance
    from .dubins import drive, drive_from, turn_of

#: The gap of a body that touches an obstacle.
CONTACT = cython.declare(cython.double, -1e300)
#: By this factor a polygon is made less wide until it is clear.
NARROWER = cython.declare(cython.double, 0.25)


@cython.cclass
class CollisionChecker:
    """A disc around the reference point.

    Attributes:
        required_clearance: its radius; for other bodies, that of the largest disc around the reference point that they cover [m].
    """

    def __init__(self, clearance: Clearance, required_clearance: cython.double):
        self.clearance, self.required_clearance = clearance, required_clearance

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def free(self, x: cython.double, y: cython.double, theta: cython.double) -> cython.bint:
        """Whether the body keeps the margin at a pose."""
        return self.clearance.free(x, y, self.required_clearance)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def curve_is_free(self, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, word: cython.int,
                      first: cython.double, second: cython.double, third: cython.double) -> cython.bint:
        """Whether the body is free all along a curve; see the module's guarantee."""
        return self.clearance.curve_is_free(x, y, theta, radius, word, first, second, third, self.required_clearance)

    def is_free(self, x: cython.double, y: cython.double, theta: cython.double) -> bool:
        """Whether the body keeps the margin at a pose."""
        return self.free(x, y, theta)

    def is_curve_free(self, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, word: cython.int,
                      first: cython.double, second: cython.double, third: cython.double) -> bool:
        """Whether the body is free all along a curve; see the module's guarantee."""
        return self.curve_is_free(x, y, theta, radius, word, first, second, third)


@cython.cclass
class PolygonChecker(CollisionChecker):
    """A polygon, as `footprint.py` prepares it. It has room of its own to work in: no two threads may share one."""

    def __init__(self, clearance: Clearance, required_clearance, discs, corners, first_corner, worth):
        """
        Args:
            required_clearance: the radius of the largest disc around the reference point that the polygon covers [m].
            discs: (m, 4): the discs that cover it: x, y, radius, and the radius of a disc there that it covers [m].
            corners: (n, 4): the corners of its convex parts, counter-clockwise: x, y, and how far they move, per metre that the
                part is made wider by.
            first_corner: (p + 1,) int32: where each part's corners begin.
            worth: where the discs give at least this gap, they are exact enough [m].
        """
        CollisionChecker.__init__(self, clearance, required_clearance)
        self.discs, self.corners, self.first_corner, self.worth = discs, corners, first_corner, worth
        self.placed = np.empty((len(corners), 2))
        self.spans = np.empty((clearance.field.shape[0], 2))

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def free(self, x: cython.double, y: cython.double, theta: cython.double) -> cython.bint:
        """Whether the body keeps the margin at a pose."""
        found: cython.double = self.rough_gap(x, y, theta)
        if found == CONTACT or found >= self.clearance.margin:
            return found != CONTACT
        return self.is_clear(x, y, theta, self.clearance.margin, 0)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def curve_is_free(self, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, word: cython.int,
                      first: cython.double, second: cython.double, third: cython.double) -> cython.bint:
        """Whether the body is free all along a curve; see the module's guarantee."""
        moved: cython.double = self.arc_is_free(x, y, theta, radius, turn_of(word, 0), first, 0)
        if moved < 0:
            return False
        x, y, theta = drive(x, y, theta, radius, turn_of(word, 0), first)
        moved = self.arc_is_free(x, y, theta, radius, turn_of(word, 1), second, moved)
        if moved < 0:
            return False
        x, y, theta = drive(x, y, theta, radius, turn_of(word, 1), second)
        if self.arc_is_free(x, y, theta, radius, turn_of(word, 2), third, moved) < 0:
            return False
        x, y, theta = drive(x, y, theta, radius, turn_of(word, 2), third)
        return self.free(x, y, theta)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def arc_is_free(self, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, turn: cython.int,
                    length: cython.double, moved: cython.double) -> cython.double:
        """Walk an arc, up to `moved` of which is known to be free, as far as the body's points move; by how much they may still
        move beyond its end until the next pose is due, or -1 where the body hits."""
        if turn == 0:
            return self.straight_is_free(x, y, theta, length, moved)
        return self.turn_is_free(x, y, theta, radius, turn, length, moved)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def straight_is_free(self, x: cython.double, y: cython.double, theta: cython.double, length: cython.double,
                         moved: cython.double) -> cython.double:
        """`arc_is_free` straight on: where the discs do not decide, the rest is looked at as a whole."""
        found: cython.double
        px: cython.double
        py: cython.double
        _: cython.double
        while moved <= length:
            px, py, _ = drive(x, y, theta, 1, 0, moved)
            found = self.rough_gap(px, py, theta)
            if found == CONTACT:
                return -1
            if found < self.worth:
                return 0 if self.is_clear(px, py, theta, self.clearance.margin, length - moved) else -1
            moved += found + self.clearance.margin / 2
        return moved - length

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def turn_is_free(self, x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, turn: cython.int,
                     length: cython.double, moved: cython.double) -> cython.double:
        """`arc_is_free` in a turn."""
        speed: cython.double = self.speed(radius, turn)
        sin_theta: cython.double = sin(theta)
        cos_theta: cython.double = cos(theta)
        s: cython.double = moved / speed
        found: cython.double = self.worth
        px: cython.double
        py: cython.double
        ptheta: cython.double
        while s <= length:
            px, py, ptheta = drive_from(x, y, theta, sin_theta, cos_theta, radius, turn, s)
            found = self.gap(px, py, ptheta, found)
            if found == CONTACT:
                return -1
            s += (found + self.clearance.margin / 2) / speed
        return (s - length) * speed

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def speed(self, radius: cython.double, turn: cython.int) -> cython.double:
        """How fast the fastest point of the body moves in a turn, in metres per metre along it."""
        fastest: cython.double = 1
        i: cython.Py_ssize_t
        for i in range(self.corners.shape[0]):
            fastest = max(fastest, hypot(1 - turn * self.corners[i, 1] / radius, self.corners[i, 0] / radius))
        return fastest

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def gap(self, x: cython.double, y: cython.double, theta: cython.double, expected: cython.double) -> cython.double:
        """A lower bound of the gap between the body and the obstacles, at least `margin`; or CONTACT. What is `expected` saves
        work where it comes close."""
        found: cython.double = self.rough_gap(x, y, theta)
        if found == CONTACT or found >= self.worth:
            return found
        wider: cython.double = min(2 * expected, self.worth)
        while wider > self.clearance.margin:
            if self.is_clear(x, y, theta, wider, 0):
                return wider
            wider *= NARROWER
        return self.clearance.margin if self.is_clear(x, y, theta, self.clearance.margin, 0) else CONTACT

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def rough_gap(self, x: cython.double, y: cython.double, theta: cython.double) -> cython.double:
        """A lower bound of the gap, by the discs: negative where these touch obstacles; CONTACT where the body does for sure."""
        cos_theta: cython.double = cos(theta)
        sin_theta: cython.double = sin(theta)
        least: cython.double = 1e300
        found: cython.double
        i: cython.Py_ssize_t
        for i in range(self.discs.shape[0]):
            found = self.clearance.at_least(x + cos_theta * self.discs[i, 0] - sin_theta * self.discs[i, 1],
                                            y + sin_theta * self.discs[i, 0] + cos_theta * self.discs[i, 1],
                                            self.discs[i, 2] + self.worth)
            if found < self.discs[i, 3]:
                return CONTACT
            least = min(least, found - self.discs[i, 2])
        return least

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def is_clear(self, x: cython.double, y: cython.double, theta: cython.double, wider: cython.double,
                 ahead: cython.double) -> cython.bint:
        """Whether the body, made wider and driven straight ahead from a pose, touches no obstacle."""
        cos_yaw: cython.double = self.clearance.cos_yaw
        sin_yaw: cython.double = self.clearance.sin_yaw
        x -= self.clearance.x0
        y -= self.clearance.y0
        column: cython.double = cos_yaw * x + sin_yaw * y
        row: cython.double = cos_yaw * y - sin_yaw * x
        cos_theta: cython.double = cos(theta) * cos_yaw + sin(theta) * sin_yaw
        sin_theta: cython.double = sin(theta) * cos_yaw - cos(theta) * sin_yaw
        along: cython.double
        across: cython.double
        i: cython.int
        part: cython.int
        for i in range(cython.cast(cython.int, self.corners.shape[0])):
            along = self.corners[i, 0] + wider * self.corners[i, 2]
            across = self.corners[i, 1] + wider * self.corners[i, 3]
            self.placed[i, 0] = column + cos_theta * along - sin_theta * across
            self.placed[i, 1] = row + sin_theta * along + cos_theta * across
        for part in range(cython.cast(cython.int, self.first_corner.shape[0]) - 1):
            if not self.clearance.sweep_is_clear(self.placed, self.first_corner[part], self.first_corner[part + 1],
                                                 ahead * cos_theta, ahead * sin_theta, self.spans):
                return False
        return True
