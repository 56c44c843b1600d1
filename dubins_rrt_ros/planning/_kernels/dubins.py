# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Dubins curves between two poses: section III of A. Khanal, RRT and RRT* Using Vehicle Dynamics, its misprints corrected.

Lengths are in turning radii, as there, and a curve is three arcs of lengths t, p and q. The paper moves the poses so that they
become (0, 0, alpha) and (d, 0, beta). Its square roots and arctangents are then the length and the direction psi of the vector
(u, v) between the centres of the first and the last turn, and alpha and beta are headings measured from the line between the
poses; so the same formulas hold with (u, v) and the headings as they are, and nothing is moved. With s = +1 for words that
begin with L and -1 for R, modulo 2 pi:

    LSL, RSR  p = |(u, v)|             t = s (psi - alpha)            q = s (beta - psi)
    LSR, RSL  p = sqrt(u^2 + v^2 - 4)  t = s (psi - alpha)            q = s (psi - beta)    psi turned by s atan(2 / p)
    LRL, RLR  p = 2 pi - 2 asin(|(u, v)| / 4)   t = s (psi - alpha) + p / 2   q = s (beta - alpha) - t + p

LSL and RSL are as printed. The others as printed do not reach the goal; corrected are, for RSR the sign of 2d(sin alpha - sin
beta) and of the arctangent's numerator, for LSR the sign of 2cos(alpha - beta) and the beginning of q, for LRL and RLR the
middle arc, which is the longer one of the two that are possible, and q. Their arccos(1 - c^2 / 8), c = |(u, v)|, is written as
2 asin(c / 4), since the arccosine loses half of the digits where the circles nearly coincide.
"""

import cython

if cython.compiled:
    from cython.cimports.libc.math import asin, atan2, cos, fabs, fmod, hypot, remainder, sin, sqrt
else:
    from math import asin, atan2, cos, fabs, fmod, hypot, remainder, sin, sqrt

    # As dubins.pxd declares them. Values: a pose or a curve is never changed once it is made, since C copies and Python does not.
    Pose = cython.struct(x=cython.double, y=cython.double, theta=cython.double)
    Curve = cython.struct(word=cython.int, first=cython.double, second=cython.double, third=cython.double)

COMPILED: bool = cython.compiled

WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")

PI = cython.declare(cython.double, 3.141592653589793238462643383280)
TWO_PI = cython.declare(cython.double, 6.283185307179586476925286766559)
#: Rounding by which a tangent condition that holds exactly may leave its domain, in turning radii.
ROUNDING = cython.declare(cython.double, 1e-12)
#: Margin below a full circle within which a turn is tried as none [rad]: the angles between close poses are ill-conditioned.
NEARLY_NONE = cython.declare(cython.double, 1e-6)
#: Error of the end up to which such a turn is taken as none, in turning radii per turning radius of distance.
FIT = cython.declare(cython.double, 2e-13)
#: Relative error of a coordinate: a few roundings, such as a pose at the end of a curve has accumulated.
COORDINATE_ERROR = cython.declare(cython.double, 1e-15)
#: Upper bound of the rounding error of 2 - 2 cos, which matters for small turns.
COSINE_ERROR = cython.declare(cython.double, 1e-14)
#: Length that stands for infinity: no limit, or the length of a curve that does not exist.
UNLIMITED = cython.declare(cython.double, 1e300)
#: Upper bound of the length of a curve, in turning radii, whose square is finite.
LONGEST = cython.declare(cython.double, 1e150)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def mod_two_pi(angle: cython.double) -> cython.double:
    """Return the angle wrapped to [0, 2 pi)."""
    if not -TWO_PI <= angle < 2 * TWO_PI:
        angle = fmod(angle, TWO_PI)
    if angle < 0:
        return angle + TWO_PI
    return angle - TWO_PI if angle >= TWO_PI else angle + 0.0  # no -0.0


def turn_of(word, arc):
    """Return +1 where the arc of the word turns left, -1 right, 0 straight on."""
    first: cython.int = 1 if word == 0 or word == 2 or word == 5 else -1
    if arc == 0:
        return first
    if arc == 1:
        return 0 if word < 4 else -first
    return -first if word == 2 or word == 3 else first


def length_of(curve):
    """Return the length of a curve."""
    return curve.first + curve.second + curve.third


def arc_length(curve, arc):
    """Return the length of arc 0, 1 or 2 of a curve."""
    return curve.first if arc == 0 else curve.second if arc == 1 else curve.third


def single_arc(turn, length):
    """Return the curve of one arc: +1 left, -1 right, 0 straight on."""
    return Curve(1 if turn < 0 else 0, length if turn != 0 else 0, length if turn == 0 else 0, 0)


def first_part(curve, length):
    """Return the first `length` of a curve."""
    first: cython.double = min(curve.first, length)
    second: cython.double = min(curve.second, length - first)
    return Curve(curve.word, first, second, min(curve.third, length - first - second))


def part_of(curve, begin, end):
    """Return the part of a curve from `begin` to `end` along it."""
    second: cython.double = curve.first + curve.second
    return Curve(curve.word, max(0.0, min(end, curve.first) - max(begin, 0.0)),
                 max(0.0, min(end, second) - max(begin, curve.first)),
                 max(0.0, min(end, second + curve.third) - max(begin, second)))


def fastest_point(points, radius, turn):
    """Return the speed of the fastest point of a vehicle in an arc, in metres per metre along it.

    Args:
        points: (n, 2 or more): x and y of points in the vehicle's frame, whose reference point counts too [m].
    """
    fastest: cython.double = 1
    i: cython.Py_ssize_t
    for i in range(points.shape[0]):
        fastest = max(fastest, hypot(1 - turn * points[i, 1] / radius, points[i, 0] / radius))
    return fastest


def drive(pose, radius, turn, s):
    """Return the pose after an arc of length `s`: the operators L_v, R_v and S_v of the paper."""
    if s == 0:
        return pose
    return drive_from(pose, sin(pose.theta), cos(pose.theta), radius, turn, s)


def drive_from(pose, sin_theta, cos_theta, radius, turn, s):
    """Return what `drive` does, given the sine and cosine of the heading."""
    if turn == 0:
        return Pose(pose.x + s * cos_theta, pose.y + s * sin_theta, pose.theta)
    after: cython.double = pose.theta + turn * s / radius
    return Pose(pose.x + turn * radius * (sin(after) - sin_theta), pose.y - turn * radius * (cos(after) - cos_theta), after)


def end_of(pose, radius, curve):
    """Return the pose at the end of a curve."""
    arc: cython.int
    for arc in range(3):
        pose = drive(pose, radius, turn_of(curve.word, arc), arc_length(curve, arc))
    return pose


def along(pose, radius, curve, s):
    """Return the pose after `s` along a curve; all lengths in metres."""
    arc: cython.int
    length: cython.double
    for arc in range(2):
        length = arc_length(curve, arc)
        if s <= length:
            return drive(pose, radius, turn_of(curve.word, arc), s)
        pose = drive(pose, radius, turn_of(curve.word, arc), length)
        s -= length
    return drive(pose, radius, turn_of(curve.word, 2), min(s, curve.third))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def fits(word: cython.int, t: cython.double, p: cython.double, q: cython.double, x: cython.double, y: cython.double,
         theta0: cython.double, theta1: cython.double, rounding: cython.double) -> cython.bint:
    """Return whether a curve driven from (0, 0, theta0) ends at (x, y, theta1), where x and y have an error of `rounding`."""
    end: Pose = along(Pose(0, 0, theta0), 1, Curve(word, t, p, q), t + p + q)
    tolerance: cython.double = FIT * (1 + fabs(x) + fabs(y))
    return (fabs(end.x - x) <= tolerance + rounding and fabs(end.y - y) <= tolerance + rounding
            and fabs(remainder(end.theta - theta1, TWO_PI)) <= tolerance)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def without_full_circles(word: cython.int, t: cython.double, p: cython.double, q: cython.double, x: cython.double,
                         y: cython.double, theta0: cython.double, theta1: cython.double, rounding: cython.double
                         ) -> tuple[cython.double, cython.double, cython.double]:
    """Return the curve without a first or last turn that is 2 pi but for rounding, if its end still fits.

    What a dropped turn lacks to 2 pi is added to the other turn.
    """
    handed: cython.int = turn_of(word, 0) * turn_of(word, 2)
    less_t: cython.double = 0 if t > TWO_PI - NEARLY_NONE else t
    less_q: cython.double = mod_two_pi(q + handed * (t - less_t))
    less_q = 0 if less_q > TWO_PI - NEARLY_NONE else less_q
    if fits(word, less_t, p, less_q, x, y, theta0, theta1, rounding):
        return less_t, p, less_q
    less_q = 0 if q > TWO_PI - NEARLY_NONE else q
    less_t = mod_two_pi(t + handed * (q - less_q))
    less_t = 0 if less_t > TWO_PI - NEARLY_NONE else less_t
    if fits(word, less_t, p, less_q, x, y, theta0, theta1, rounding):
        return less_t, p, less_q
    return t, p, q


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def turn_at_least(cos_turn: cython.double, sin_turn: cython.double) -> cython.double:
    """Return a lower bound of a turn in [0, 2 pi): its chord, which is at most the turn, and at least 2 / pi of it up to pi."""
    chord: cython.double = sqrt(max(2 - 2 * cos_turn - COSINE_ERROR, 0.0))
    return chord if sin_turn > -2 * NEARLY_NONE else TWO_PI - PI / 2 * (chord + NEARLY_NONE)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def straight_turns_at_least(first: cython.int, last: cython.int, cos_straight: cython.double, sin_straight: cython.double,
                            sin0: cython.double, cos0: cython.double, sin1: cython.double,
                            cos1: cython.double) -> cython.double:
    """Return a lower bound of the two turns into and out of a straight arc of known direction."""
    return (turn_at_least(cos_straight * cos0 + sin_straight * sin0, first * (sin_straight * cos0 - cos_straight * sin0))
            + turn_at_least(cos_straight * cos1 + sin_straight * sin1, last * (cos_straight * sin1 - sin_straight * cos1)))


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def arcs(word: cython.int, x: cython.double, y: cython.double, theta0: cython.double, sin0: cython.double, cos0: cython.double,
         theta1: cython.double, sin1: cython.double, cos1: cython.double, left: cython.double,
         rounding: cython.double, limit: cython.double) -> tuple[cython.double, cython.double, cython.double]:
    """Return (t, p, q) of a word's curve from (0, 0, theta0) to (x, y, theta1).

    p is UNLIMITED where there is no such curve, or none shorter than `limit`. x and y have an error of at most `rounding`; `left`
    is theta1 - theta0 in [0, 2 pi). Lower bounds from `left`, (u, v) and the direction of the straight arc rule out most words
    before an arctangent is computed.
    """
    s: cython.int = turn_of(word, 0)
    last: cython.int = turn_of(word, 2)
    u: cython.double = x + s * sin0 - last * sin1
    v: cython.double = y - s * cos0 + last * cos1
    squared: cython.double = u * u + v * v
    turned: cython.double = left if s > 0 else TWO_PI - left
    least: cython.double
    p: cython.double
    t: cython.double
    q: cython.double
    if word >= 4:
        if squared > 16 + ROUNDING:
            return 0, UNLIMITED, 0
        p = min(sqrt(squared) / 4, 1.0)
        if TWO_PI - PI * p >= limit:  # asin(p) <= p pi / 2
            return 0, UNLIMITED, 0
        p = TWO_PI - 2 * asin(p)
        if p + mod_two_pi(turned + p) >= limit:
            return 0, UNLIMITED, 0
        t = mod_two_pi(s * (atan2(v, u) - theta0) + p / 2)
        q = mod_two_pi(turned - t + p)
    elif s == last:
        least = FIT * (1 + fabs(x) + fabs(y)) + rounding
        if squared <= least * least and turned < limit and fits(word, turned, 0, 0, x, y, theta0, theta1, rounding):
            return turned, 0, 0  # both poses on one circle, where the direction of (u, v) is but rounding
        if turned >= limit or squared >= (limit - turned) * (limit - turned):
            return 0, UNLIMITED, 0
        p = sqrt(squared)
        if p > 0 and p + straight_turns_at_least(s, last, u / p, v / p, sin0, cos0, sin1, cos1) >= limit:
            return 0, UNLIMITED, 0
        t = mod_two_pi(s * (atan2(v, u) - theta0))
        q = mod_two_pi(turned - t)
    else:
        least = min(turned, TWO_PI - turned)
        if squared < 4 - ROUNDING or least >= limit or squared - 4 >= (limit - least) * (limit - least):
            return 0, UNLIMITED, 0
        p = sqrt(max(squared - 4, 0.0))
        if p + straight_turns_at_least(s, last, (p * u - 2 * s * v) / squared, (p * v + 2 * s * u) / squared,
                                       sin0, cos0, sin1, cos1) >= limit:
            return 0, UNLIMITED, 0
        t = mod_two_pi(s * (atan2(v, u) - theta0) + atan2(2.0, p))
        q = mod_two_pi(t - turned)
    if t > TWO_PI - NEARLY_NONE or q > TWO_PI - NEARLY_NONE:
        return without_full_circles(word, t, p, q, x, y, theta0, theta1, rounding)
    return t, p, q


def rounding_at(x, y):
    """Return the largest error of the difference between two coordinates near (x, y) [m]."""
    return COORDINATE_ERROR * max(fabs(x), fabs(y))


def shortest_within(dx, dy, theta0, sin0, cos0, theta1, sin1, cos1, radius, rounding, limit):
    """Return the shortest curve to a goal that lies (dx, dy) from the start; lengths in metres.

    dx and dy have an error of at most `rounding`, in metres too. The first arc is UNLIMITED where no curve is shorter than
    `limit`, which takes a fraction of the time.
    """
    x: cython.double = dx / radius
    y: cython.double = dy / radius
    left: cython.double = mod_two_pi(theta1 - theta0)
    best: cython.double = min(limit / radius, LONGEST)
    best_word: cython.int = 0
    best_t: cython.double = UNLIMITED
    best_p: cython.double = 0
    best_q: cython.double = 0
    t: cython.double
    p: cython.double
    q: cython.double
    word: cython.int
    if x == 0 and y == 0 and remainder(theta1 - theta0, TWO_PI) == 0:
        return Curve(0, 0, 0, 0)
    for word in range(6):
        if word == 4 and best <= PI:
            break
        t, p, q = arcs(word, x, y, theta0, sin0, cos0, theta1, sin1, cos1, left, rounding / radius, best)
        if t + p + q < best:
            best, best_word, best_t, best_p, best_q = t + p + q, word, t, p, q
    if best_t == UNLIMITED:
        return Curve(0, UNLIMITED, 0, 0)
    return Curve(best_word, best_t * radius, best_p * radius, best_q * radius)


def shortest(start, goal, radius):
    """Return the shortest curve between two poses."""
    return shortest_below(start, goal, radius, max(rounding_at(start.x, start.y), rounding_at(goal.x, goal.y)), UNLIMITED)


def shortest_below(start, goal, radius, rounding, limit):
    """Return the shortest curve between two poses, or one whose first arc is UNLIMITED where it is not below the limit."""
    return shortest_within(goal.x - start.x, goal.y - start.y, start.theta, sin(start.theta), cos(start.theta),
                           goal.theta, sin(goal.theta), cos(goal.theta), radius, rounding, limit)


def shortest_curve(start, goal, radius: cython.double):
    """Return (word, first, second, third) of the shortest curve between (x, y, theta) and another; lengths in metres."""
    curve: Curve = shortest(Pose(start[0], start[1], start[2]), Pose(goal[0], goal[1], goal[2]), radius)
    return curve.word, curve.first, curve.second, curve.third


def all_curves(start, goal, radius: cython.double) -> list:
    """Return (word, first, second, third) of every word that has a curve between (x, y, theta) and another; lengths in metres."""
    begin: Pose = Pose(start[0], start[1], start[2])
    end: Pose = Pose(goal[0], goal[1], goal[2])
    rounding: cython.double = max(rounding_at(begin.x, begin.y), rounding_at(end.x, end.y))
    t: cython.double
    p: cython.double
    q: cython.double
    word: cython.int
    found = []
    for word in range(6):
        t, p, q = arcs(word, (end.x - begin.x) / radius, (end.y - begin.y) / radius, begin.theta, sin(begin.theta),
                       cos(begin.theta), end.theta, sin(end.theta), cos(end.theta), mod_two_pi(end.theta - begin.theta),
                       rounding / radius, UNLIMITED)
        if p < UNLIMITED:
            found.append((word, t * radius, p * radius, q * radius))
    return found


def shortest_lengths(starts: cython.double[:, ::1], goals: cython.double[:, ::1], radius: cython.double,
                     out: cython.double[::1]):
    """Write the lengths of the shortest curves between (n, 3) poses to `out`, in metres."""
    i: cython.Py_ssize_t
    with cython.nogil:
        for i in range(starts.shape[0]):
            out[i] = length_of(shortest(Pose(starts[i, 0], starts[i, 1], starts[i, 2]),
                                        Pose(goals[i, 0], goals[i, 1], goals[i, 2]), radius))


def pose_along(start, radius: cython.double, word: cython.int, lengths, s: cython.double):
    """Return the pose (x, y, theta) after `s` along a curve of three lengths; all lengths in metres."""
    pose: Pose = along(Pose(start[0], start[1], start[2]), radius, Curve(word, lengths[0], lengths[1], lengths[2]), s)
    return pose.x, pose.y, pose.theta


def poses_along(start, radius: cython.double, word: cython.int, lengths, arc_lengths: cython.double[::1],
                out: cython.double[:, ::1]):
    """Write the poses at (n,) arc lengths of a curve to `out` (n, 3), headings in [-pi, pi] but for the first."""
    begin: Pose = Pose(start[0], start[1], start[2])
    curve: Curve = Curve(word, lengths[0], lengths[1], lengths[2])
    pose: Pose
    i: cython.Py_ssize_t
    for i in range(arc_lengths.shape[0]):
        pose = along(begin, radius, curve, arc_lengths[i])
        out[i, 0], out[i, 1], out[i, 2] = pose.x, pose.y, pose.theta if i == 0 else remainder(pose.theta, TWO_PI)


def path_poses(poses: cython.double[:, ::1], words: cython.schar[::1], lengths: cython.double[:, ::1], radius: cython.double,
               starts: cython.long[::1], ends: cython.long[::1], arc_lengths: cython.double[::1], out: cython.double[:, ::1]):
    """Write the poses at the arc lengths of curves to `out` (m, 3), headings in [-pi, pi].

    Curve i leads from pose `starts[i]` to pose `ends[i]`, whose word and lengths are its own.
    """
    i: cython.Py_ssize_t
    start: cython.Py_ssize_t
    end: cython.Py_ssize_t
    pose: Pose
    with cython.nogil:
        for i in range(ends.shape[0]):
            start, end = starts[i], ends[i]
            pose = along(Pose(poses[start, 0], poses[start, 1], poses[start, 2]), radius,
                         Curve(words[end], lengths[end, 0], lengths[end, 1], lengths[end, 2]), arc_lengths[i])
            out[i, 0], out[i, 1], out[i, 2] = pose.x, pose.y, remainder(pose.theta, TWO_PI)
