# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""A path made shorter step by step: by shortcuts and detours of Dubins curves that keep the clearance.

A shortcut leaves the path at one place and comes back at a later one by the Dubins curve between the two; a detour does so over a
pose near the path between the two. Both are taken only where they are shorter than the piece of the path that they replace.
Detours let a path settle against the obstacles: each pose between two curves finds its best place and heading by trial.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.collision import CollisionChecker
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import (
        NO_CURVE,
        TWO_PI,
        drive,
        rounding_at,
        shortest_within,
        turn_of,
    )
    from cython.cimports.libc.math import cos, exp, log, remainder, sin
else:
    from math import cos, exp, log, remainder, sin

    from .collision import CollisionChecker
    from .dubins import NO_CURVE, TWO_PI, drive, rounding_at, shortest_within, turn_of

#: A smaller gain is rounding [m].
LEAST_GAIN = cython.declare(cython.double, 1e-9)
#: The shortest pieces of a path that are replaced, in turning radii.
LEAST_SPAN = cython.declare(cython.double, 0.25)
#: The natural logarithm of how much smaller the finest detours are than the coarsest.
FINENESS = cython.declare(cython.double, 7)
#: After so many tries poses that are of no use any more are left out.
TRIES_PER_CLEARING = cython.declare(cython.int, 64)
#: Of the tries that are no shortcuts the share that moves a pose between its neighbours.
MOVES = cython.declare(cython.double, 0.7)
#: The most curves that one change puts in: the rest of the one where it leaves the path, and two of a detour.
MOST_NEW = 3


@cython.cclass
class Shortcutter:
    """A path as a chain of poses, each reached by a curve from the one before.

    Attributes:
        count: how many poses there are; the first `count` entries of the arrays are in use.
        poses: (n, 3): x [m], y [m], theta [rad].
        words, lengths: (n,) and (n, 3): the curves to the poses, in metres; those of the first mean nothing.
        ends: (n,): how far along the path the poses are [m].
    """

    body: CollisionChecker
    radius: cython.double
    count = cython.declare(cython.int, visibility="readonly")
    poses = cython.declare(cython.double[:, ::1], visibility="readonly")
    words = cython.declare(cython.schar[::1], visibility="readonly")
    lengths = cython.declare(cython.double[:, ::1], visibility="readonly")
    ends = cython.declare(cython.double[::1], visibility="readonly")
    # A change under way: `new` poses from the pose `left` on, the first `kept` of which lie on the path; it leads to x, y, theta.
    left: cython.int
    kept: cython.int
    new: cython.int
    x: cython.double
    y: cython.double
    theta: cython.double
    from_x: cython.double
    from_y: cython.double
    from_theta: cython.double
    new_poses: cython.double[:, ::1]
    new_words: cython.schar[::1]
    new_lengths: cython.double[:, ::1]

    def __init__(self, body: CollisionChecker, radius: cython.double, poses, words, lengths, tries):
        """
        Args:
            body: what is free along the path, and must be along each curve that is put in.
            poses, words, lengths: of the path.
            tries: room is made for so many.
        """
        self.body, self.radius = body, radius
        self.count = len(poses)
        # A change adds two poses at most; between two clearings they are all kept.
        room = self.count + 2 * tries + MOST_NEW
        grown_poses, grown_words, grown_lengths = np.empty((room, 3)), np.empty(room, np.int8), np.empty((room, 3))
        grown_poses[:self.count], grown_words[:self.count], grown_lengths[:self.count] = poses, words, lengths
        self.poses, self.words, self.lengths = grown_poses, grown_words, grown_lengths
        self.ends = np.zeros(room)
        self.new_poses, self.new_lengths = np.empty((2, MOST_NEW, 3))
        self.new_words = np.empty(MOST_NEW, np.int8)
        self.measure_from(1)

    def improve(self, draws: cython.double[:, ::1], shortcuts: cython.double):
        """Try a change for each row of (n, 6) draws: four uniform in [0, 1), two normal; the share `shortcuts` are such."""
        i: cython.int
        with cython.nogil:
            self.clear()
            for i in range(draws.shape[0]):
                self.try_change(draws[i, 0] < shortcuts, draws[i, 1], draws[i, 2], draws[i, 3], draws[i, 4], draws[i, 5])
                if (i + 1) % TRIES_PER_CLEARING == 0:
                    self.clear()
            self.clear()

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def try_change(self, direct: cython.bint, where: cython.double, back: cython.double, ahead: cython.double,
                   across: cython.double, turn: cython.double) -> cython.void:
        """Try a shortcut or a detour; the draws say where, how far back and ahead, and by how much beside the path."""
        total: cython.double = self.ends[self.count - 1]
        least: cython.double = LEAST_SPAN * self.radius
        largest_span: cython.double = log(max(total / least, 2.0))
        pose: cython.int
        if not direct and self.count > 2 and where < MOVES:
            pose = 1 + cython.cast(cython.int, where / MOVES * (self.count - 2))
            self.try_detour(self.ends[pose - 1], self.ends[pose], self.ends[pose + 1], back, across, turn)
            return
        middle: cython.double = where * total
        begin: cython.double = max(0.0, middle - least * exp(back * largest_span))
        end: cython.double = min(total, middle + least * exp(ahead * largest_span))
        if direct:
            self.try_shortcut(begin, end)
        else:
            # What the draw of where, back and ahead left unused says how fine the detour is.
            self.try_detour(begin, middle, end, (back + ahead) / 2, across, turn)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def try_shortcut(self, begin: cython.double, end: cython.double) -> cython.void:
        """Go straight from one place along the path to a later one, if that is shorter and free."""
        x: cython.double
        y: cython.double
        theta: cython.double
        x, y, theta = self.pose_at(end)
        self.leave(begin)
        if self.drive_to(x, y, theta, end - begin - LEAST_GAIN) and self.new_is_free():
            self.come_back(end)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def try_detour(self, begin: cython.double, middle: cython.double, end: cython.double, fine: cython.double,
                   across: cython.double, turn: cython.double) -> cython.void:
        """Go over a pose near the one in the middle, if that is shorter and free."""
        size: cython.double = exp(-FINENESS * fine)
        x: cython.double
        y: cython.double
        theta: cython.double
        x, y, theta = self.pose_at(middle)
        across *= size * min(end - begin, 2 * self.radius)
        x -= across * sin(theta)
        y += across * cos(theta)
        theta = remainder(theta + turn * size, TWO_PI)
        limit: cython.double = end - begin - LEAST_GAIN
        if not self.body.free(x, y, theta):
            return
        self.leave(begin)
        if not self.drive_to(x, y, theta, limit):
            return
        limit -= self.new_lengths[self.new - 1, 0] + self.new_lengths[self.new - 1, 1] + self.new_lengths[self.new - 1, 2]
        x, y, theta = self.pose_at(end)
        if self.drive_to(x, y, theta, limit) and self.new_is_free():
            self.come_back(end)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def leave(self, s: cython.double) -> cython.void:
        """Begin a change `s` along the path."""
        edge: cython.int = self.edge_at(s)
        x: cython.double
        y: cython.double
        theta: cython.double
        x, y, theta = self.pose_at(s)
        self.leave_pose(edge if s >= self.ends[edge] else edge - 1, x, y, theta)
        if self.ends[edge - 1] < s < self.ends[edge]:
            self.append(x, y, theta, self.words[edge])
            self.write_piece(edge, 0, s - self.ends[edge - 1], self.new_lengths, 0)
            self.kept = 1

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def leave_pose(self, pose: cython.int, x: cython.double, y: cython.double, theta: cython.double) -> cython.void:
        """Begin a change behind a pose of the chain, at (x, y, theta)."""
        self.left, self.new, self.kept = pose + 1, 0, 0
        self.x = self.from_x = x
        self.y = self.from_y = y
        self.theta = self.from_theta = theta

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def drive_to(self, x: cython.double, y: cython.double, theta: cython.double, limit: cython.double) -> cython.bint:
        """Add the Dubins curve to a pose to the change, if it is shorter than `limit`."""
        word: cython.int
        first: cython.double
        second: cython.double
        third: cython.double
        word, first, second, third = shortest_within(x - self.x, y - self.y, self.theta, sin(self.theta), cos(self.theta),
                                                     theta, sin(theta), cos(theta), self.radius, rounding_at(x, y), limit)
        if first == NO_CURVE:
            return False
        self.append(x, y, theta, word)
        self.new_lengths[self.new - 1, 0] = first
        self.new_lengths[self.new - 1, 1] = second
        self.new_lengths[self.new - 1, 2] = third
        self.x, self.y, self.theta = x, y, theta
        return True

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def append(self, x: cython.double, y: cython.double, theta: cython.double, word: cython.int) -> cython.void:
        """Add a pose to the change, reached by a curve whose lengths the caller writes."""
        self.new_poses[self.new, 0], self.new_poses[self.new, 1], self.new_poses[self.new, 2] = x, y, theta
        self.new_words[self.new] = word
        self.new += 1

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def new_is_free(self) -> cython.bint:
        """Whether the curves of the change that are not pieces of the path keep the clearance."""
        x: cython.double = self.from_x
        y: cython.double = self.from_y
        theta: cython.double = self.from_theta
        i: cython.int
        for i in range(self.kept, self.new):
            if not self.is_free(x, y, theta, self.new_words[i], self.new_lengths[i, 0], self.new_lengths[i, 1],
                                self.new_lengths[i, 2]):
                return False
            x, y, theta = self.new_poses[i, 0], self.new_poses[i, 1], self.new_poses[i, 2]
        return True

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def is_free(self, x: cython.double, y: cython.double, theta: cython.double, word: cython.int, first: cython.double,
                second: cython.double, third: cython.double) -> cython.bint:
        """Whether a curve is free. Most that do not are blocked in the middle, so that is looked at first."""
        px: cython.double
        py: cython.double
        ptheta: cython.double
        px, py, ptheta = drive(x, y, theta, self.radius, turn_of(word, 0), first)
        px, py, ptheta = drive(px, py, ptheta, self.radius, turn_of(word, 1), second / 2)
        return (self.body.free(px, py, ptheta)
                and self.body.curve_is_free(x, y, theta, self.radius, word, first, second, third))

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def come_back(self, s: cython.double) -> cython.void:
        """Put the change in place of the path from where it left to `s` along it."""
        edge: cython.int = self.edge_at(s)
        if s < self.ends[edge]:
            self.write_piece(edge, s - self.ends[edge - 1], self.ends[edge] - self.ends[edge - 1], self.lengths, edge)
        else:
            edge += 1
        self.put_in(edge)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def put_in(self, tail: cython.int) -> cython.void:
        """Put the change between the pose where it left and the pose `tail`."""
        self.move_tail(tail, self.left + self.new)
        i: cython.int
        part: cython.int
        for i in range(self.new):
            self.words[self.left + i] = self.new_words[i]
            for part in range(3):
                self.poses[self.left + i, part] = self.new_poses[i, part]
                self.lengths[self.left + i, part] = self.new_lengths[i, part]
        self.measure_from(self.left)

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def write_piece(self, edge: cython.int, begin: cython.double, end: cython.double, out: cython.double[:, ::1],
                    row: cython.int) -> cython.void:
        """Write the lengths of the arcs of a curve from `begin` to `end` along it to a row of `out`."""
        passed: cython.double = 0
        length: cython.double
        part: cython.int
        for part in range(3):
            length = self.lengths[edge, part]
            out[row, part] = max(0.0, min(end, passed + length) - max(begin, passed))
            passed += length

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def clear(self) -> cython.void:
        """Leave out the poses whose neighbours are joined by a free curve that is no longer than the way over them."""
        pose: cython.int = 1
        while pose < self.count - 1:
            self.leave_pose(pose - 1, self.poses[pose - 1, 0], self.poses[pose - 1, 1], self.poses[pose - 1, 2])
            if (self.drive_to(self.poses[pose + 1, 0], self.poses[pose + 1, 1], self.poses[pose + 1, 2],
                              self.ends[pose + 1] - self.ends[pose - 1] + LEAST_GAIN) and self.new_is_free()):
                self.put_in(pose + 2)
            else:
                pose += 1

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def move_tail(self, begin: cython.int, to: cython.int) -> cython.void:
        """Move the poses from `begin` on so that they begin at `to`."""
        moved: cython.int = self.count - begin
        i: cython.int
        for i in range(moved):
            if to < begin:
                self.copy(begin + i, to + i)
            else:
                self.copy(self.count - 1 - i, to + moved - 1 - i)
        self.count = to + moved

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def copy(self, pose: cython.int, to: cython.int) -> cython.void:
        """Write a pose and the curve to it over another."""
        part: cython.int
        self.words[to] = self.words[pose]
        for part in range(3):
            self.poses[to, part] = self.poses[pose, part]
            self.lengths[to, part] = self.lengths[pose, part]

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def measure_from(self, first: cython.int) -> cython.void:
        """Sum up how far along the path the poses from `first` on are."""
        i: cython.int
        for i in range(first, self.count):
            self.ends[i] = self.ends[i - 1] + (self.lengths[i, 0] + self.lengths[i, 1] + self.lengths[i, 2])

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def edge_at(self, s: cython.double) -> cython.int:
        """The pose whose curve holds the place `s` along the path, the first one of two."""
        low: cython.int = 1
        high: cython.int = self.count - 1
        middle: cython.int
        while low < high:
            middle = (low + high) // 2
            if self.ends[middle] < s:
                low = middle + 1
            else:
                high = middle
        return low

    @cython.cfunc
    @cython.nogil
    @cython.exceptval(check=False)
    def pose_at(self, s: cython.double) -> tuple[cython.double, cython.double, cython.double]:
        """The pose `s` along the path; where one of the chain is, exactly that."""
        edge: cython.int = self.edge_at(s)
        if s >= self.ends[edge]:
            return self.poses[edge, 0], self.poses[edge, 1], self.poses[edge, 2]
        x: cython.double = self.poses[edge - 1, 0]
        y: cython.double = self.poses[edge - 1, 1]
        theta: cython.double = self.poses[edge - 1, 2]
        s -= self.ends[edge - 1]
        if s <= 0:
            return x, y, theta
        length: cython.double
        part: cython.int
        for part in range(3):
            length = min(s, self.lengths[edge, part])
            x, y, theta = drive(x, y, theta, self.radius, turn_of(self.words[edge], part), length)
            s -= length
        return x, y, remainder(theta, TWO_PI)
