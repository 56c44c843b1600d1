# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""The cost of an edge: the one place in the kernels that says what is minimised.

The cost of a metre is

    1 + w max(0, 1 - room / p)^2 + v c,

where `room` is the distance from the vehicle's outline to the nearest obstacle, p the preferred clearance and w its weight: 1 in
the open, 1 + w in contact. c is the cost of the grid's cell under the reference point, from 0 to 1, and v the weight of that.
The cost of an edge is the integral of all this along its curve; it is the length with p = 0 and without cells that cost. Every
search minimises the sum of the costs of a path's edges. Pruning requires that an edge cost at least its length: only then are
the Dubins length, the straight line and the way around the obstacles lower bounds of the cost.

The integral over cells is exact. As to the room: where it exceeds p, the curve is free of extra cost for as far as it takes to
lose what is above p, since the room changes by at most a metre per metre that the fastest point of the vehicle moves. Elsewhere
pieces are integrated by Simpson's rule over their halves, and halved until it differs little from the rule over the whole: the
room has kinks where another obstacle becomes the nearest. A search finds whatever makes its costs too low, so each piece has to
be right by itself.
"""

import cython

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.cell_costs import CellCosts
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import (
        UNLIMITED,
        Curve,
        Pose,
        arc_length,
        drive,
        drive_from,
        length_of,
        turn_of,
    )
    from cython.cimports.dubins_rrt_ros.planning._kernels.room import Room
    from cython.cimports.libc.math import ceil, cos, fabs, sin
else:
    from math import ceil, cos, fabs, sin

    from .cell_costs import CellCosts
    from .dubins import UNLIMITED, Curve, Pose, arc_length, drive, drive_from, length_of, turn_of
    from .room import Room

#: Way of the vehicle's fastest point along a piece that is integrated, before it is halved, in preferred clearances.
PIECE = cython.declare(cython.double, 1)
#: Maximum difference between the two rules over a piece, relative to its cost; the better one is off by a fraction of that.
PRECISION = cython.declare(cython.double, 1e-3)
#: Room that has not been asked for.
UNKNOWN = cython.declare(cython.double, -UNLIMITED)
#: Maximum number of times that a piece is halved.
HALVINGS = cython.declare(cython.int, 6)


@cython.cclass
class EdgeCost:
    """The cost of curves. It has working memory: no two threads may share one.

    Attributes:
        is_length: whether the cost is the length.
        preferred_clearance, weight: p [m] and w.
        cell_weight: v.
    """

    def __init__(self, room: Room = None, preferred_clearance: cython.double = 0, weight: cython.double = 0,
                 cells: CellCosts = None, cell_weight: cython.double = 0):
        """Prepare the costs; `room` is the vehicle's, and may be left out where p or w is 0, as `cells` may where v is."""
        self.has_room, self.has_cells = preferred_clearance > 0 and weight > 0, cell_weight > 0
        self.is_length = not self.has_room and not self.has_cells
        self.room, self.preferred_clearance, self.weight = room, preferred_clearance, weight
        self.cells, self.cell_weight = cells, cell_weight

    def of(self, pose, radius, curve, limit):
        """Return the cost of driving a free curve from a pose [m], or a lower bound of it that is at least `limit`."""
        length: cython.double = length_of(curve)
        if self.is_length:
            return length
        cost: cython.double = length
        arc: cython.int
        turn: cython.int
        self.radius = radius
        self.room_here = UNKNOWN
        for arc in range(3):
            if cost >= limit:
                break
            length = arc_length(curve, arc)
            if length > 0:
                turn = turn_of(curve.word, arc)
                if self.has_room:
                    self.begin_arc(pose, turn)
                    cost += self.excess_of_arc(length, limit - cost)
                if self.has_cells and cost < limit:
                    cost += self.cell_weight * self.cells.integral(pose, radius, turn, length, (limit - cost) / self.cell_weight)
                pose = drive(pose, radius, turn, length)
        return cost

    def begin_arc(self, pose, turn):
        """Begin an arc at a pose, whose room is `room_here`, if that is known."""
        self.pose, self.turn = pose, turn
        self.sine, self.cosine = sin(pose.theta), cos(pose.theta)
        if self.room_here == UNKNOWN:
            self.room_here = self.room_at(0)

    def excess_of_arc(self, length, limit):
        """Return by how much the cost of the arc exceeds its length, or a lower bound of that that is at least `limit`."""
        speed: cython.double = self.room.speed(self.radius, self.turn)
        piece: cython.double = PIECE * self.preferred_clearance / speed
        excess: cython.double = 0
        s: cython.double = 0
        room: cython.double = self.room_here
        rate: cython.double
        self.room_here = UNKNOWN
        ahead: cython.double
        while s < length:
            ahead = (room - self.preferred_clearance) / speed
            if ahead >= length - s:
                break
            if ahead >= piece / 4:
                s += ahead
                room = self.room_at(s)
                continue
            ahead = (length - s) / ceil((length - s) / piece) if length - s < 2 * piece else piece
            rate = self.rate(room)
            room = self.room_at(s + ahead)
            excess += self.between(s, ahead, rate, self.rate_at(s + ahead / 2), self.rate(room), HALVINGS)
            if excess >= limit:
                break
            s += ahead
            if s >= length:
                self.room_here = room
        return excess

    def room_at(self, s):
        """Return the room after `s` on the arc, or a lower bound of it that is at least the preferred clearance."""
        return self.room.at(drive_from(self.pose, self.sine, self.cosine, self.radius, self.turn, s), self.preferred_clearance)

    def rate_at(self, s):
        """Return the extra cost of a metre after `s` on the arc."""
        return self.rate(self.room_at(s))

    def rate(self, room):
        """Return the extra cost of a metre with this room."""
        lack: cython.double = max(0.0, 1 - room / self.preferred_clearance)
        return self.weight * lack * lack

    def between(self, begin, size, at_begin, at_middle, at_end, halvings):
        """Return the extra cost of a piece of the arc, given that of a metre at its ends and its middle."""
        first: cython.double = self.rate_at(begin + size / 4)
        third: cython.double = self.rate_at(begin + 3 * size / 4)
        rough: cython.double = size / 6 * (at_begin + 4 * at_middle + at_end)
        fine: cython.double = size / 12 * (at_begin + 4 * first + 2 * at_middle + 4 * third + at_end)
        if halvings == 0 or fabs(fine - rough) <= PRECISION * (size + fine):
            return fine
        return (self.between(begin, size / 2, at_begin, first, at_middle, halvings - 1)
                + self.between(begin + size / 2, size / 2, at_middle, third, at_end, halvings - 1))

    def of_curve(self, pose, radius: cython.double, word: cython.int, lengths, limit: cython.double = UNLIMITED) -> float:
        """Return what `of` does for the curve of three lengths [m] from (x, y, theta)."""
        return self.of(Pose(pose[0], pose[1], pose[2]), radius, Curve(word, lengths[0], lengths[1], lengths[2]), limit)

    def costs(self, poses: cython.double[:, ::1], radius: cython.double, words: cython.schar[::1],
              lengths: cython.double[:, ::1], out: cython.double[::1]):
        """Write the costs of (n,) curves with (n, 3) lengths from (n, 3) poses to `out`."""
        i: cython.Py_ssize_t
        with cython.nogil:
            for i in range(out.shape[0]):
                out[i] = self.of(Pose(poses[i, 0], poses[i, 1], poses[i, 2]), radius,
                                 Curve(words[i], lengths[i, 0], lengths[i, 1], lengths[i, 2]), UNLIMITED)
