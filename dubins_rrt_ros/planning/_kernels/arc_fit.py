# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Residuals of a chain of arcs, and their derivatives by the lengths of the arcs.

The residuals are the chain's errors at the goal, and the clearance that points of the vehicle lack at samples along it. What
follows an arc that becomes longer moves with the arc's end, and turns around the arc's centre.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.clearance import Clearance
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import TWO_PI, UNLIMITED, Pose, drive, drive_from
    from cython.cimports.libc.math import ceil, cos, fabs, hypot, remainder, sin
else:
    from math import ceil, cos, fabs, hypot, remainder, sin

    from .clearance import Clearance
    from .dubins import TWO_PI, UNLIMITED, Pose, drive, drive_from

#: Weight of the errors at the goal, among those of the clearance.
GOAL_WEIGHT = cython.declare(cython.double, 3.0)
#: Step of the differences by which the clearance is differentiated [turning radii].
DIFFERENCE = cython.declare(cython.double, 1e-7)
#: Number of samples after which a slice of the residuals ends, and of their derivatives: some milliseconds.
SLICE, DERIVATIVE_SLICE = cython.declare(cython.int, 4096), cython.declare(cython.int, 512)


@cython.final
@cython.cclass
class ArcFit:
    """The residuals of a chain of arcs between two poses, in turning radii.

    They take time where there are many samples, so that it is spent in slices: `begin` a chain and `measure` its samples until it
    is `measured`; then `differentiate` them until they are `differentiated`.

    Attributes:
        ends: (n + 1, 3) poses at the start, and at the ends of the arcs.
        largest: the greatest absolute value of the residuals so far.
        measured, differentiated: True if all samples are.
    """

    def __init__(self, clearance: Clearance, radius, start, goal, turns, points):
        """Take a chain of n arcs.

        Args:
            clearance: that of the map.
            radius: the turning radius [m].
            start, goal: (x, y, theta).
            turns: (n,) int32: +1 for an arc that turns left, -1 right, 0 for a straight one.
            points: (m, 3): points of the vehicle, x, y in its frame, and what the clearance of each exceeds the required one by
                [m].
        """
        self.clearance, self.radius, self.turns, self.points = clearance, radius, turns, points
        self.start, self.goal = Pose(start[0], start[1], start[2]), Pose(goal[0], goal[1], goal[2])
        self.ends = np.zeros((len(turns) + 1, 3))
        self.row = np.zeros(len(turns))
        self.errors = np.zeros(3)
        self.required = self.spacing = self.largest = 0
        self.size = self.next_arc = self.next_sample = 0
        self.measured = self.differentiated = False
        self.lengths = np.empty(0)
        self.arcs = np.empty(0, np.int32)
        self.samples = np.empty((0, 7))

    def require(self, clearance: cython.double, spacing: cython.double, longest: cython.double):
        """Say what clearance is to be kept, and where.

        Args:
            clearance: to be kept [m] ...
            spacing: ... at samples so far apart at most [m].
            longest: maximum length of a chain [m].
        """
        self.required, self.spacing = clearance, spacing
        capacity = (int(longest / spacing) + len(self.turns) + 1) * len(self.points)
        self.arcs = np.empty(capacity, np.int32)
        self.samples = np.empty((capacity, 7))

    def begin(self, lengths: cython.double[::1]) -> cython.double:
        """Take these lengths of the arcs [m]; return the sum of the squares of the errors at the goal."""
        self.lengths = lengths
        self.size, self.next_arc, self.next_sample = 0, 0, 0
        self.measured, self.differentiated = self.turns.shape[0] == 0, False
        return self.measure_goal()

    def measure(self, total: cython.double, limit: cython.double) -> cython.double:
        """Measure a slice of the samples.

        Args:
            total: the sum of the squares so far ...
            limit: ... and that from which on no more are measured.

        Returns:
            The sum with those of the slice.
        """
        left: cython.double = SLICE
        arc: cython.int = self.next_arc
        with cython.nogil:
            while arc < self.turns.shape[0] and left > 0 and total <= limit:
                left -= self.lengths[arc] / self.spacing * self.points.shape[0]
                total += self.measure_arc(arc, self.lengths[arc], limit - total)
                arc += 1
        self.next_arc = arc
        self.measured = arc == self.turns.shape[0]
        return total

    def measure_goal(self):
        """Place the ends of the arcs; return the sum of the squares of the errors at the goal."""
        at: Pose = self.start
        arc: cython.int
        self.ends[0, 0], self.ends[0, 1], self.ends[0, 2] = at.x, at.y, at.theta
        for arc in range(cython.cast(cython.int, self.turns.shape[0])):
            at = drive(at, self.radius, self.turns[arc], self.lengths[arc])
            self.ends[arc + 1, 0], self.ends[arc + 1, 1], self.ends[arc + 1, 2] = at.x, at.y, at.theta
        self.errors[0] = GOAL_WEIGHT * (at.x - self.goal.x) / self.radius
        self.errors[1] = GOAL_WEIGHT * (at.y - self.goal.y) / self.radius
        self.errors[2] = GOAL_WEIGHT * remainder(at.theta - self.goal.theta, TWO_PI)
        self.largest = max(fabs(self.errors[0]), max(fabs(self.errors[1]), fabs(self.errors[2])))
        return self.errors[0] * self.errors[0] + self.errors[1] * self.errors[1] + self.errors[2] * self.errors[2]

    def measure_arc(self, arc, length, limit):
        """Note the samples of an arc that lack clearance; return the sum of their squares, or a part of it above `limit`."""
        begin: Pose = Pose(self.ends[arc, 0], self.ends[arc, 1], self.ends[arc, 2])
        sine: cython.double = sin(begin.theta)
        cosine: cython.double = cos(begin.theta)
        count: cython.int = max(1, cython.cast(cython.int, ceil(length / self.spacing)))
        total: cython.double = 0
        point: cython.Py_ssize_t
        step: cython.double
        lacking: cython.double
        i: cython.int
        for point in range(self.points.shape[0]):
            # The clearance changes by a metre per metre at most, and no point moves by more than this between two samples.
            step = length / count * (1 + hypot(self.points[point, 0], self.points[point, 1]) / self.radius)
            i = 1
            while i <= count:
                lacking = self.measure_point(arc, cython.cast(cython.double, i) / count, length, begin, sine, cosine, point)
                i += 1
                if lacking > 0:
                    total += lacking * lacking / (self.radius * self.radius)
                    if total > limit:
                        return total
                elif step > 0:
                    i += cython.cast(cython.int, min(-lacking / step, count))
        return total

    def measure_point(self, arc, share, length, begin, sine, cosine, point):
        """Return what a point of the vehicle lacks in clearance on an arc [m], 0 or less where none; note it where it does."""
        at: Pose = drive_from(begin, sine, cosine, self.radius, self.turns[arc], share * length)
        sine, cosine = sin(at.theta), cos(at.theta)
        x: cython.double = at.x + cosine * self.points[point, 0] - sine * self.points[point, 1]
        y: cython.double = at.y + sine * self.points[point, 0] + cosine * self.points[point, 1]
        required: cython.double = self.required + self.points[point, 2]
        lacking: cython.double = required - self.clearance.at_least(x, y, required)
        i: cython.Py_ssize_t = self.size
        if lacking > 0:
            self.size += 1
            self.arcs[i] = arc
            self.samples[i, 0], self.samples[i, 1], self.samples[i, 2] = at.x, at.y, at.theta
            self.samples[i, 3], self.samples[i, 4], self.samples[i, 5] = x, y, share
            self.samples[i, 6] = lacking / self.radius
            self.largest = max(self.largest, self.samples[i, 6])
        return lacking

    def differentiate(self, gradient: cython.double[::1], curvature: cython.double[:, ::1]):
        """Write the sums of J r and J J^T over the residuals r, with their derivatives J by the lengths [1/m]; those of a slice.

        Args:
            gradient: (n,) added to, from 0 on.
            curvature: (n, n) added to, from 0 on; below the diagonal and on it until the last slice, which makes it symmetric.
        """
        n: cython.int = cython.cast(cython.int, self.turns.shape[0])
        i: cython.Py_ssize_t = self.next_sample
        end: cython.Py_ssize_t = min(self.size, i + DERIVATIVE_SLICE)
        j: cython.int
        k: cython.int
        with cython.nogil:
            if i == 0:
                for j in range(3):
                    self.differentiate_goal(j)
                    self.accumulate(n, self.errors[j], gradient, curvature)
            while i < end:
                self.differentiate_sample(i)
                self.accumulate(self.arcs[i] + 1, self.samples[i, 6], gradient, curvature)
                i += 1
            if end == self.size:
                for j in range(n):
                    for k in range(j):
                        curvature[k, j] = curvature[j, k]
        self.next_sample = end
        self.differentiated = end == self.size

    def accumulate(self, n, residual, gradient, curvature):
        """Add a residual whose derivatives, by the first `n` lengths, are in `row`: below the diagonal and on it."""
        j: cython.int
        k: cython.int
        for j in range(n):
            gradient[j] += self.row[j] * residual
            for k in range(j + 1):
                curvature[j, k] += self.row[j] * self.row[k]

    def differentiate_goal(self, which):
        """Write the derivatives of an error at the goal, of x, y or theta, to `row`."""
        j: cython.int
        last: cython.Py_ssize_t = self.turns.shape[0]
        for j in range(cython.cast(cython.int, last)):
            if which == 2:
                self.row[j] = GOAL_WEIGHT * self.turns[j] / self.radius
            else:
                self.row[j] = GOAL_WEIGHT * self.motion(j, self.ends[last, 0], self.ends[last, 1], which == 0,
                                                        which == 1) / self.radius

    def differentiate_sample(self, i):
        """Write the derivatives of what a sample lacks in clearance to `row`."""
        x: cython.double = self.samples[i, 3]
        y: cython.double = self.samples[i, 4]
        step: cython.double = DIFFERENCE * self.radius
        here: cython.double = self.clearance.at_least(x, y, UNLIMITED)
        rise_x: cython.double = (self.clearance.at_least(x + step, y, UNLIMITED) - here) / step
        rise_y: cython.double = (self.clearance.at_least(x, y + step, UNLIMITED) - here) / step
        arc: cython.int = self.arcs[i]
        j: cython.int
        for j in range(arc):
            self.row[j] = -self.motion(j, x, y, rise_x, rise_y) / self.radius
        bend: cython.double = self.turns[arc] / self.radius
        along_x: cython.double = cos(self.samples[i, 2]) - bend * (y - self.samples[i, 1])
        along_y: cython.double = sin(self.samples[i, 2]) + bend * (x - self.samples[i, 0])
        self.row[arc] = -self.samples[i, 5] * (rise_x * along_x + rise_y * along_y) / self.radius

    def motion(self, arc, x, y, along_x, along_y):
        """Return by how much a point that follows an arc moves in a direction, in metres for a metre of the arc."""
        theta: cython.double = self.ends[arc + 1, 2]
        bend: cython.double = self.turns[arc] / self.radius
        return (along_x * (cos(theta) - bend * (y - self.ends[arc + 1, 1]))
                + along_y * (sin(theta) + bend * (x - self.ends[arc + 1, 0])))
