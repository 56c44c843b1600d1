# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Path smoothing by random shortcuts and vertex perturbations.

A shortcut replaces a piece of the path by the Dubins curve between its ends. A vertex perturbation replaces it by two curves over
a pose near the middle of the piece, so that the poses between curves find their best places and headings by trial. A change is
made only where it is free and costs less than the piece that it replaces; where the cost is not the length, that rules most of
them out. A price for each curve makes a path simpler at little cost. Non-holonomic shortcuts are due to S. Sekhavat et al.
(1998); OMPL's PathSimplifier has both.
"""

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.collision import CollisionChecker
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import (
        TWO_PI,
        UNLIMITED,
        Curve,
        Pose,
        along,
        drive,
        length_of,
        part_of,
        rounding_at,
        shortest_below,
        turn_of,
    )
    from cython.cimports.dubins_rrt_ros.planning._kernels.edge_cost import EdgeCost
    from cython.cimports.libc.math import cos, exp, log, remainder, sin
else:
    from math import cos, exp, log, remainder, sin

    from .collision import CollisionChecker
    from .dubins import TWO_PI, UNLIMITED, Curve, Pose, along, drive, length_of, part_of, rounding_at, shortest_below, turn_of
    from .edge_cost import EdgeCost

#: Least gain for which the path is changed [m]; a smaller one is rounding.
LEAST_GAIN = cython.declare(cython.double, 1e-9)
#: The same where the cost is not the length, as a share of the cost of what is replaced; less is an error of the integrals.
LEAST_SHARE = cython.declare(cython.double, 1e-4)
#: Length of the shortest piece of a path that is replaced, in turning radii.
LEAST_SPAN = cython.declare(cython.double, 0.25)
#: Natural logarithm of the ratio of the coarsest to the finest perturbations.
FINENESS = cython.declare(cython.double, 7)
#: Number of tries after which poses that are no longer needed are removed.
TRIES_PER_CLEARING = cython.declare(cython.int, 64)
#: Share of the perturbations that move a pose between its neighbours.
VERTEX_SHARE = cython.declare(cython.double, 0.7)
#: A number of checks that is not limited.
ALL = cython.declare(cython.int, 2_147_483_647)
#: Maximum number of curves in a change: the first part of the curve on which it leaves the path, and two of a perturbation.
MAX_NEW = 3


@cython.cclass
class Shortcutter:
    """A path as poses, each reached by a curve from the one before.

    Attributes:
        count: number of poses; the first `count` entries of the arrays are in use.
        poses: (n, 3): x [m], y [m], theta [rad].
        words, lengths: (n,) and (n, 3): the curves to the poses, in metres; those of the first mean nothing.
        ends, excess: (n,): the arc length of the path up to each pose, and what its cost is above that [m].
        costs: (n,): the costs of the curves to the poses [m]; these and `excess` mean nothing where the cost is the length.
    """

    def __init__(self, checker: CollisionChecker, edge_cost: EdgeCost, radius: cython.double, scale: cython.double, poses, words,
                 lengths, tries, price: cython.double = 0):
        """Copy a path.

        Args:
            checker: judges every new curve; the path is free by it.
            edge_cost: the cost of curves.
            radius: the turning radius [m].
            scale: length that the sizes of changes are measured in [m]: the turning radius, or more where that is tiny.
            poses, words, lengths: of the path, as in the attributes.
            tries: number of changes that will be tried, for which room is made.
            price: added to the cost of each curve [m], where the cost is not the length.
        """
        self.checker, self.edge_cost, self.radius, self.scale, self.price = checker, edge_cost, radius, scale, price
        self.count = len(poses)
        # A change adds two poses at most; between two clearings they are all kept.
        room = self.count + 2 * tries + MAX_NEW
        all_poses, all_words, all_lengths = np.empty((room, 3)), np.empty(room, np.int8), np.empty((room, 3))
        all_poses[:self.count], all_words[:self.count], all_lengths[:self.count] = poses, words, lengths
        self.poses, self.words, self.lengths = all_poses, all_words, all_lengths
        self.ends, self.excess, costs = np.zeros((3, room))
        self.new_costs = np.zeros(MAX_NEW)
        self.rest_cost = 0
        if not edge_cost.is_length:
            edge_cost.costs(all_poses[:self.count - 1], radius, all_words[1:self.count], all_lengths[1:self.count],
                            costs[1:self.count])
        self.costs = costs
        self.new_poses, self.new_lengths = np.empty((2, MAX_NEW, 3))
        self.new_words = np.empty(MAX_NEW, np.int8)
        self.measure_from(1)
        self.clearing = 1

    def prepare(self, checks: cython.int) -> int:
        """Do some of what `improve` does before the first change, for so many curves; return for how many: fewer at the end."""
        before: cython.int = self.clearing - self.count
        with cython.nogil:
            self.clear_some(checks)
        return self.clearing - self.count - before

    def improve(self, draws: cython.double[:, ::1], begin: cython.int, end: cython.int, shortcuts: cython.double):
        """Try a change for each of the rows from `begin` to `end` of (n, 6) draws, four uniform in [0, 1) and two normal.

        It comes to the same, whether all rows are tried at once or some after the other. `shortcuts` is the share of shortcuts
        among the changes.
        """
        i: cython.int
        with cython.nogil:
            if begin == 0:
                self.clear_some(ALL)
            for i in range(begin, end):
                self.try_change(draws[i, 0] < shortcuts, draws[i, 1], draws[i, 2], draws[i, 3], draws[i, 4], draws[i, 5])
                if (i + 1) % TRIES_PER_CLEARING == 0:
                    self.clear()
            if end == draws.shape[0]:
                self.clear()

    def try_change(self, direct, where, back, ahead, across, turn):
        """Try a shortcut or a perturbation; the draws say where, how far back and ahead, and by how much off the path."""
        total: cython.double = self.ends[self.count - 1]
        least: cython.double = LEAST_SPAN * self.scale
        largest_span: cython.double = log(max(total / least, 2.0))
        pose: cython.int
        if not direct and self.count > 2 and where < VERTEX_SHARE:
            pose = 1 + cython.cast(cython.int, where / VERTEX_SHARE * (self.count - 2))
            self.try_perturbation(self.ends[pose - 1], self.ends[pose], self.ends[pose + 1], back, across, turn)
            return
        middle: cython.double = where * total
        begin: cython.double = max(0.0, middle - least * exp(back * largest_span))
        end: cython.double = min(total, middle + least * exp(ahead * largest_span))
        if direct:
            self.try_shortcut(begin, end)
        else:
            # The draws for both ends serve once more, for the size of the perturbation.
            self.try_perturbation(begin, middle, end, (back + ahead) / 2, across, turn)

    def try_shortcut(self, begin, end):
        """Replace the path between two arc lengths by one curve, if that is shorter and free."""
        target: Pose = self.pose_at(end)
        self.leave(begin)
        if (self.drive_to(target, end - begin - LEAST_GAIN + self.excess_between(begin, end)) and self.new_is_free()
                and self.pays(end, LEAST_SHARE)):
            self.come_back(end)

    def try_perturbation(self, begin, middle, end, fine, across, turn):
        """Replace the path between two arc lengths by two curves over a pose near the one in the middle, if shorter and free."""
        size: cython.double = exp(-FINENESS * fine)
        via: Pose = self.pose_at(middle)
        across *= size * min(end - begin, 2 * self.scale)
        via = Pose(via.x - across * sin(via.theta), via.y + across * cos(via.theta), remainder(via.theta + turn * size, TWO_PI))
        limit: cython.double = end - begin - LEAST_GAIN + self.excess_between(begin, end)
        if not self.checker.pose_is_free(via):
            return
        self.leave(begin)
        if not self.drive_to(via, limit):
            return
        limit -= length_of(self.new_curve(self.new - 1))
        if self.drive_to(self.pose_at(end), limit) and self.new_is_free() and self.pays(end, LEAST_SHARE):
            self.come_back(end)

    def leave(self, s):
        """Begin a change at arc length `s` of the path."""
        edge: cython.int = self.edge_at(s)
        pose: Pose = self.pose_at(s)
        self.leave_pose(edge if s >= self.ends[edge] else edge - 1, pose)
        if self.ends[edge - 1] < s < self.ends[edge]:
            self.append(pose, part_of(self.curve_to(edge), 0, s - self.ends[edge - 1]))
            self.kept = 1

    def leave_pose(self, pose, at):
        """Begin a change at `at`, on the curve that follows a pose of the path."""
        self.left, self.new, self.kept = pose + 1, 0, 0
        self.begin = self.at = at

    def drive_to(self, target, limit):
        """Append the Dubins curve to `target` to the change, if shorter than `limit`; return whether it is."""
        curve: Curve = shortest_below(self.at, target, self.radius, rounding_at(target.x, target.y), limit)
        if curve.first == UNLIMITED:
            return False
        self.append(target, curve)
        self.at = target
        return True

    def append(self, pose, curve):
        """Append a pose and the curve to it to the change."""
        self.new_poses[self.new, 0], self.new_poses[self.new, 1], self.new_poses[self.new, 2] = pose.x, pose.y, pose.theta
        self.new_words[self.new] = curve.word
        self.new_lengths[self.new, 0] = curve.first
        self.new_lengths[self.new, 1] = curve.second
        self.new_lengths[self.new, 2] = curve.third
        self.new += 1

    def new_curve(self, i):
        """Return the i-th curve of the change."""
        return Curve(self.new_words[i], self.new_lengths[i, 0], self.new_lengths[i, 1], self.new_lengths[i, 2])

    def curve_to(self, pose):
        """Return the curve to a pose of the path."""
        return Curve(self.words[pose], self.lengths[pose, 0], self.lengths[pose, 1], self.lengths[pose, 2])

    def pose_of(self, pose):
        """Return a pose of the path by its number."""
        return Pose(self.poses[pose, 0], self.poses[pose, 1], self.poses[pose, 2])

    def new_is_free(self):
        """Return whether the curves of the change are free, but for those that are pieces of the path."""
        pose: Pose = self.begin
        i: cython.int
        for i in range(self.kept, self.new):
            if not self.is_free(pose, self.new_curve(i)):
                return False
            pose = self.pose_of_new(i)
        return True

    def is_free(self, pose, curve):
        """Return whether a curve is free. Its middle is checked first, where most blocked curves are blocked."""
        middle: Pose = drive(pose, self.radius, turn_of(curve.word, 0), curve.first)
        middle = drive(middle, self.radius, turn_of(curve.word, 1), curve.second / 2)
        return self.checker.pose_is_free(middle) and self.checker.motion_is_free(pose, self.radius, curve)

    def excess_between(self, begin, end):
        """Return what the curves that hold two arc lengths, and all between them, cost above their lengths; with their prices."""
        if self.edge_cost.is_length:
            return 0
        first: cython.int = self.edge_at(begin)
        last: cython.int = self.edge_at(end)
        return self.excess[last] - self.excess[first - 1] + self.price * (last - first)

    def pays(self, s, least_gain):
        """Return whether the change, which comes back to the path at arc length `s`, saves a share `least_gain` of its cost.

        It does where the cost is the length, which was compared before. The costs of its curves are noted.
        """
        if self.edge_cost.is_length:
            return True
        edge: cython.int = self.edge_at(s)
        rest: Curve = self.rest_of(edge, s)
        i: cython.int
        left: cython.double = 0
        for i in range(self.left, edge + 1):
            left += self.costs[i]
        left = left * (1 - least_gain) + self.price * (edge + 1 - self.left - self.new - (1 if length_of(rest) > 0 else 0))
        # What is kept costs at least its length, so that a change fails most often by its new curves alone.
        left -= length_of(rest)
        for i in range(self.kept):
            left -= length_of(self.new_curve(i))
        pose: Pose = self.begin
        for i in range(self.kept, self.new):
            self.new_costs[i] = self.edge_cost.of(pose, self.radius, self.new_curve(i), left)
            left -= self.new_costs[i]
            if left <= 0:
                return False
            pose = self.pose_of_new(i)
        left += length_of(rest)
        self.rest_cost = self.edge_cost.of(pose, self.radius, rest, left)
        left -= self.rest_cost
        if left <= 0:
            return False
        pose = self.pose_of(self.left - 1)
        for i in range(self.kept):
            left += length_of(self.new_curve(i))
            self.new_costs[i] = self.edge_cost.of(pose, self.radius, self.new_curve(i), left)
            left -= self.new_costs[i]
            pose = self.pose_of_new(i)
        return left > 0

    def pose_of_new(self, i):
        """Return the i-th pose of the change."""
        return Pose(self.new_poses[i, 0], self.new_poses[i, 1], self.new_poses[i, 2])

    def rest_of(self, edge, s):
        """Return what is left of the curve to a pose from arc length `s` of the path on."""
        if s >= self.ends[edge]:
            return Curve(0, 0, 0, 0)
        return part_of(self.curve_to(edge), s - self.ends[edge - 1], self.ends[edge] - self.ends[edge - 1])

    def come_back(self, s):
        """Replace the path, from where the change left it to arc length `s`, by the change."""
        edge: cython.int = self.edge_at(s)
        rest: Curve
        if s < self.ends[edge]:
            rest = self.rest_of(edge, s)
            self.lengths[edge, 0], self.lengths[edge, 1], self.lengths[edge, 2] = rest.first, rest.second, rest.third
            self.costs[edge] = self.rest_cost
        else:
            edge += 1
        self.put_in(edge)

    def put_in(self, tail):
        """Insert the change between the pose where it left the path and the pose `tail`."""
        self.move_tail(tail, self.left + self.new)
        i: cython.int
        part: cython.int
        for i in range(self.new):
            self.words[self.left + i] = self.new_words[i]
            self.costs[self.left + i] = self.new_costs[i]
            for part in range(3):
                self.poses[self.left + i, part] = self.new_poses[i, part]
                self.lengths[self.left + i, part] = self.new_lengths[i, part]
        self.measure_from(self.left)

    def clear(self):
        """Remove the poses whose neighbours are joined by a free curve that costs no more than the path over them."""
        self.clearing = 1
        self.clear_some(ALL)

    def clear_some(self, checks):
        """Go on with that, for so many curves."""
        pose: cython.int = self.clearing
        limit: cython.double
        while pose < self.count - 1 and checks > 0:
            checks -= 1
            self.leave_pose(pose - 1, self.pose_of(pose - 1))
            limit = self.ends[pose + 1] - self.ends[pose - 1] + LEAST_GAIN
            limit += self.excess_between(self.ends[pose], self.ends[pose + 1])
            if (self.drive_to(self.pose_of(pose + 1), limit) and self.new_is_free()
                    and self.pays(self.ends[pose + 1], -LEAST_SHARE)):
                self.put_in(pose + 2)
            else:
                pose += 1
        self.clearing = pose

    def move_tail(self, begin, to):
        """Move the poses from `begin` on so that they begin at `to`."""
        moved: cython.int = self.count - begin
        i: cython.int
        for i in range(moved):
            if to < begin:
                self.copy(begin + i, to + i)
            else:
                self.copy(self.count - 1 - i, to + moved - 1 - i)
        self.count = to + moved

    def copy(self, pose, to):
        """Write a pose and the curve to it over another."""
        part: cython.int
        self.words[to] = self.words[pose]
        self.costs[to] = self.costs[pose]
        for part in range(3):
            self.poses[to, part] = self.poses[pose, part]
            self.lengths[to, part] = self.lengths[pose, part]

    def measure_from(self, first):
        """Recompute `ends` and `excess` from the pose `first` on."""
        i: cython.int
        for i in range(first, self.count):
            self.ends[i] = self.ends[i - 1] + length_of(self.curve_to(i))
            self.excess[i] = self.excess[i - 1] + self.costs[i] - length_of(self.curve_to(i))

    def edge_at(self, s):
        """Return the pose whose curve holds the arc length `s` of the path, the first of two."""
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

    def pose_at(self, s):
        """Return the pose at arc length `s` of the path: exactly one of its poses where it ends a curve."""
        edge: cython.int = self.edge_at(s)
        if s >= self.ends[edge]:
            return self.pose_of(edge)
        start: Pose = self.pose_of(edge - 1)
        s -= self.ends[edge - 1]
        if s <= 0:
            return start
        pose: Pose = along(start, self.radius, self.curve_to(edge), s)
        return Pose(pose.x, pose.y, remainder(pose.theta, TWO_PI))
