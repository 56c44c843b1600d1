# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Collision checkers: does the vehicle touch an obstacle at a pose, or anywhere along a curve?

A disc is free where the clearance is great enough. For a polygon the gap between it and the obstacles decides. A lower bound of
that is the gap of the discs that cover the polygon; where they are too coarse, the polygon widened by some distance is checked
against the obstacles exactly, and if it is clear, the gap is at least that distance. Before a polygon's convex parts, where they
are many, its hull is checked, which is clear most often and takes a fraction of their time.

Guarantee of conservative advancement for a polygon. No point of the body moves faster than its fastest corner, in metres per
metre along the curve, so neither does the gap change faster. A pose is free with a gap of at least `margin`; the next one is so
far ahead that no point moves by more than `gap + margin / 2` until there. Between two such poses, with gaps g and g', the gap is
at least (g + g' - (g + margin / 2)) / 2 >= margin / 4. On a straight arc the body covers the convex hull of its first and last
place, which is checked as a whole. A polygon widened by e reaches no farther than sqrt(2) e beyond itself, so a curve that keeps
a gap of sqrt(2) margin always passes.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.clearance import Clearance
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import (
        UNLIMITED,
        Curve,
        Pose,
        arc_length,
        drive,
        drive_from,
        fastest_point,
        turn_of,
    )
    from cython.cimports.libc.math import cos, sin
else:
    from math import cos, sin

    from .clearance import Clearance
    from .dubins import UNLIMITED, Curve, Pose, arc_length, drive, drive_from, fastest_point, turn_of

#: Gap of a vehicle that touches an obstacle.
CONTACT = cython.declare(cython.double, -UNLIMITED)
#: How far a polygon reaches beyond itself per metre of widening, rounded up.
FARTHEST = cython.declare(cython.double, 1.4143)
#: Factor by which a widened polygon is narrowed until it is clear.
NARROWER = cython.declare(cython.double, 0.25)


@cython.cclass
class CollisionChecker:
    """The checker of a disc around the reference point.

    Attributes:
        required_clearance: the disc's radius; for other shapes, that of the largest disc around the reference point inside [m].
    """

    def __init__(self, clearance: Clearance, required_clearance: cython.double):
        self.clearance, self.required_clearance = clearance, required_clearance

    def pose_is_free(self, pose):
        """Return whether the vehicle keeps the margin at a pose."""
        return self.clearance.point_is_free(pose.x, pose.y, self.required_clearance)

    def motion_is_free(self, pose, radius, curve):
        """Return whether the vehicle is free all along a curve; see the module's guarantee."""
        turn: cython.int
        arc: cython.int
        length: cython.double
        walked: cython.double = 0
        for arc in range(3):
            turn, length = turn_of(curve.word, arc), arc_length(curve, arc)
            walked = self.arc_is_free(pose, radius, turn, length, walked)
            if walked < 0:
                return False
            pose = drive(pose, radius, turn, length)
        return self.pose_is_free(pose)

    def arc_is_free(self, pose, radius, turn, length, walked):
        """Check an arc whose first `walked` metres are known to be free.

        Return how far the next sample lies beyond the end of the arc, or -1 where the vehicle collides.
        """
        return self.clearance.arc_is_free(pose, radius, turn, length, walked, self.required_clearance)

    def is_pose_free(self, pose) -> bool:
        """Return whether the vehicle keeps the margin at a pose (x, y, theta)."""
        return self.pose_is_free(Pose(pose[0], pose[1], pose[2]))

    def is_motion_free(self, pose, radius: cython.double, word: cython.int, lengths) -> bool:
        """Return whether the vehicle is free all along the curve of three lengths [m] from (x, y, theta)."""
        return self.motion_is_free(Pose(pose[0], pose[1], pose[2]), radius, Curve(word, lengths[0], lengths[1], lengths[2]))


@cython.cclass
class PolygonChecker(CollisionChecker):
    """The checker of a polygon, as `collision/footprint.py` prepares it. It has working memory: no two threads may share one."""

    def __init__(self, clearance: Clearance, required_clearance, discs, corners, first_corner, part_discs, hull, worth):
        """Make the checker of a polygon.

        Args:
            required_clearance: radius of the largest disc around the reference point inside the polygon [m].
            discs: (m, 4): the discs that cover it: x, y, radius, and the radius of a disc around the same centre inside it [m].
            corners: (n, 4): the corners of its convex parts, counter-clockwise: x, y, and their displacement per metre of
                widening.
            first_corner: (p + 1,) int32: the index of each part's first corner, and n.
            part_discs: (p, 3): a disc around each part: x, y, radius.
            hull: (h, 4): as `corners`, those of the convex hull, or none where that is not to be checked first.
            worth: gap from which on the bound by the discs is good enough [m].
        """
        CollisionChecker.__init__(self, clearance, required_clearance)
        self.discs, self.corners, self.first_corner, self.worth = discs, corners, first_corner, worth
        self.part_discs, self.hull, self.outline = part_discs, hull, hull if len(hull) else corners
        self.placed = np.empty((max(len(hull), len(corners)), 2))
        self.spans = np.empty((clearance.field.shape[0], 2))
        self.touching = 0  # the part that touched an obstacle last, which is looked at first

    def pose_is_free(self, pose):
        """Return whether the vehicle keeps the margin at a pose."""
        found: cython.double = self.rough_gap(pose)
        if found == CONTACT or found >= self.clearance.margin:
            return found != CONTACT
        return self.is_clear(pose, self.clearance.margin, 0)

    def arc_is_free(self, pose, radius, turn, length, walked):
        """Check an arc; `walked` and the result are in metres that the fastest point of the vehicle moves."""
        if turn == 0:
            return self.straight_is_free(pose, length, walked)
        return self.turn_is_free(pose, radius, turn, length, walked)

    def straight_is_free(self, pose, length, walked):
        """Check a straight arc; where the discs do not decide, its rest is checked as a whole."""
        found: cython.double
        at: Pose
        while walked <= length:
            at = drive(pose, 1, 0, walked)
            found = self.rough_gap(at)
            if found == CONTACT:
                return -1
            if found < self.worth:
                return 0 if self.is_clear(at, self.clearance.margin, length - walked) else -1
            walked += found + self.clearance.margin / 2
        return walked - length

    def turn_is_free(self, pose, radius, turn, length, walked):
        """Check a turn."""
        speed: cython.double = fastest_point(self.outline, radius, turn)
        sin_theta: cython.double = sin(pose.theta)
        cos_theta: cython.double = cos(pose.theta)
        s: cython.double = walked / speed
        found: cython.double = self.worth
        while s <= length:
            found = self.gap(drive_from(pose, sin_theta, cos_theta, radius, turn, s), found)
            if found == CONTACT:
                return -1
            s += (found + self.clearance.margin / 2) / speed
        return (s - length) * speed

    def gap(self, pose, expected):
        """Return a lower bound of the gap between vehicle and obstacles, at least `margin`; or CONTACT.

        A good estimate in `expected` saves work.
        """
        found: cython.double = self.rough_gap(pose)
        if found == CONTACT or found >= self.worth:
            return found
        wider: cython.double = min(2 * expected, self.worth)
        while wider > self.clearance.margin:
            if self.is_clear(pose, wider, 0):
                return wider
            wider *= NARROWER
        return self.clearance.margin if self.is_clear(pose, self.clearance.margin, 0) else CONTACT

    def rough_gap(self, pose):
        """Return a lower bound of the gap, by the discs: negative where these touch obstacles, CONTACT where the vehicle must."""
        cos_theta: cython.double = cos(pose.theta)
        sin_theta: cython.double = sin(pose.theta)
        least: cython.double = UNLIMITED
        found: cython.double
        i: cython.Py_ssize_t
        for i in range(self.discs.shape[0]):
            found = self.clearance.at_least(pose.x + cos_theta * self.discs[i, 0] - sin_theta * self.discs[i, 1],
                                            pose.y + sin_theta * self.discs[i, 0] + cos_theta * self.discs[i, 1],
                                            self.discs[i, 2] + self.worth)
            if found < self.discs[i, 3]:
                return CONTACT
            least = min(least, found - self.discs[i, 2])
        return least

    def is_clear(self, pose, wider, ahead):
        """Return whether the vehicle, widened and driven straight ahead from a pose, touches no obstacle."""
        cos_yaw: cython.double = self.clearance.cos_yaw
        sin_yaw: cython.double = self.clearance.sin_yaw
        x: cython.double = pose.x - self.clearance.x0
        y: cython.double = pose.y - self.clearance.y0
        column: cython.double = cos_yaw * x + sin_yaw * y
        row: cython.double = cos_yaw * y - sin_yaw * x
        cos_theta: cython.double = cos(pose.theta) * cos_yaw + sin(pose.theta) * sin_yaw
        sin_theta: cython.double = sin(pose.theta) * cos_yaw - cos(pose.theta) * sin_yaw
        forth_x: cython.double = ahead * cos_theta
        forth_y: cython.double = ahead * sin_theta
        parts: cython.int = cython.cast(cython.int, self.part_discs.shape[0])
        i: cython.int
        part: cython.int
        first: cython.int
        end: cython.int
        if self.hull.shape[0] > 0:
            end = cython.cast(cython.int, self.hull.shape[0])
            self.place(self.hull, 0, end, column, row, cos_theta, sin_theta, wider)
            if self.clearance.sweep_is_clear(self.placed, 0, end, forth_x, forth_y, self.spans):
                return True
        for i in range(parts):
            part = (self.touching + i) % parts
            if ahead == 0 and self.part_is_far(part, column, row, cos_theta, sin_theta, wider):
                continue
            first, end = self.first_corner[part], self.first_corner[part + 1]
            self.place(self.corners, first, end, column, row, cos_theta, sin_theta, wider)
            if not self.clearance.sweep_is_clear(self.placed, first, end, forth_x, forth_y, self.spans):
                self.touching = part
                return False
        return True

    def part_is_far(self, part, column, row, cos_theta, sin_theta, wider):
        """Return whether the raster alone shows that a part, widened, touches no obstacle."""
        x: cython.double = column + cos_theta * self.part_discs[part, 0] - sin_theta * self.part_discs[part, 1]
        y: cython.double = row + sin_theta * self.part_discs[part, 0] + cos_theta * self.part_discs[part, 1]
        if not (0 <= x <= self.clearance.width and 0 <= y <= self.clearance.height):
            return False
        bound: cython.double = cython.cast(cython.double, self.clearance.field[self.clearance.row_of(y),
                                                                               self.clearance.column_of(x)])
        return bound >= self.part_discs[part, 2] + FARTHEST * wider + self.clearance.margin

    def place(self, corners, first, end, column, row, cos_theta, sin_theta, wider):
        """Write corners, displaced as those of what is widened, to `placed`, in the raster's frame."""
        along: cython.double
        across: cython.double
        i: cython.int
        for i in range(first, end):
            along = corners[i, 0] + wider * corners[i, 2]
            across = corners[i, 1] + wider * corners[i, 3]
            self.placed[i, 0] = column + cos_theta * along - sin_theta * across
            self.placed[i, 1] = row + sin_theta * along + cos_theta * across


@cython.final
@cython.cclass
class TestedChecker(CollisionChecker):
    """A checker that asks a test in Python too where another checker finds the vehicle free.

    It takes the interpreter's lock for that. The test must not raise.
    """

    def __init__(self, checker: CollisionChecker, test):
        """Make the checker of another one and a test: `pose_is_free(x, y, theta)`, and `motion_is_free` with what follows."""
        CollisionChecker.__init__(self, checker.clearance, checker.required_clearance)
        self.checker, self.test = checker, test

    def pose_is_free(self, pose):
        """Return whether both find the vehicle free at a pose."""
        free: cython.bint = self.checker.pose_is_free(pose)
        if free:
            with cython.gil:
                free = self.test.pose_is_free(pose.x, pose.y, pose.theta)
        return free

    def motion_is_free(self, pose, radius, curve):
        """Return whether both find the vehicle free along a curve."""
        free: cython.bint = self.checker.motion_is_free(pose, radius, curve)
        if free:
            with cython.gil:
                free = self.test.motion_is_free(pose.x, pose.y, pose.theta, radius, curve.word, curve.first, curve.second,
                                                curve.third)
        return free
