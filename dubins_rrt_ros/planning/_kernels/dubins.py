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
    from cython.cimports.libc.math import asin, atan2, cos, fabs, fmod, remainder, sin, sqrt
else:
    from math import asin, atan2, cos, fabs, fmod, remainder, sin, sqrt

COMPILED: bool = cython.compiled

WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")

PI = cython.declare(cython.double, 3.141592653589793238462643383280)
TWO_PI = cython.declare(cython.double, 6.283185307179586476925286766559)
#: By how much rounding may push a tangent condition that holds exactly out of its domain, in turning radii.
ROUNDING = cython.declare(cython.double, 1e-12)
#: Turns within this of a full circle are tried as none [rad]: the angles of close poses are ill-conditioned, and ...
NEARLY_NONE = cython.declare(cython.double, 1e-6)
#: ... are taken as none where the end then is off by no more than this, in turning radii per turning radius of distance.
FIT = cython.declare(cython.double, 2e-13)
#: What a coordinate may be off by, relatively: a few roundings, as a pose that was driven to has behind it.
COORDINATE_ERROR = cython.declare(cython.double, 1e-15)
#: More than the rounding of 2 - 2 cos; it is the difference from 0 that counts for small turns.
COSINE_ERROR = cython.declare(cython.double, 1e-14)
NO_CURVE = cython.declare(cython.double, 1e300)
#: No curve is longer, in turning radii; its square is finite.
LONGEST = cython.declare(cython.double, 1e150)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def mod_two_pi(angle: cython.double) -> cython.double:
    """`angle` in [0, 2 pi)."""
    if not -TWO_PI <= angle < 2 * TWO_PI:
        angle = fmod(angle, TWO_PI)
    if angle < 0:
        return angle + TWO_PI
    return angle - TWO_PI if angle >= TWO_PI else angle + 0.0  # no -0.0


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def turn_of(word: cython.int, arc: cython.int) -> cython.int:
    """+1 where the arc of the word turns left, -1 right, 0 straight on."""
    first: cython.int = 1 if word == 0 or word == 2 or word == 5 else -1
    if arc == 0:
        return first
    if arc == 1:
        return 0 if word < 4 else -first
    return -first if word == 2 or word == 3 else first


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def drive(x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, turn: cython.int,
          s: cython.double) -> tuple[cython.double, cython.double, cython.double]:
    """The operators L_v, R_v and S_v of the paper: the pose after an arc of length `s`."""
    if s == 0:
        return x, y, theta
    return drive_from(x, y, theta, sin(theta), cos(theta), radius, turn, s)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def drive_from(x: cython.double, y: cython.double, theta: cython.double, sin_theta: cython.double, cos_theta: cython.double,
               radius: cython.double, turn: cython.int, s: cython.double) -> tuple[cython.double, cython.double, cython.double]:
    """`drive` from a pose whose sine and cosine are known."""
    if turn == 0:
        return x + s * cos_theta, y + s * sin_theta, theta
    after: cython.double = theta + turn * s / radius
    return (x + turn * radius * (sin(after) - sin_theta), y - turn * radius * (cos(after) - cos_theta), after)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def along(x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, word: cython.int,
          first: cython.double, second: cython.double, third: cython.double,
          s: cython.double) -> tuple[cython.double, cython.double, cython.double]:
    """The pose after `s` along a curve; all lengths in metres."""
    if s <= first:
        return drive(x, y, theta, radius, turn_of(word, 0), s)
    x, y, theta = drive(x, y, theta, radius, turn_of(word, 0), first)
    s -= first
    if s <= second:
        return drive(x, y, theta, radius, turn_of(word, 1), s)
    x, y, theta = drive(x, y, theta, radius, turn_of(word, 1), second)
    return drive(x, y, theta, radius, turn_of(word, 2), min(s - second, third))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def fits(word: cython.int, t: cython.double, p: cython.double, q: cython.double, x: cython.double, y: cython.double,
         theta0: cython.double, theta1: cython.double, rounding: cython.double) -> cython.bint:
    """Whether a curve that is driven from (0, 0, theta0) ends at (x, y, theta1), where x and y are rounded by so much."""
    end_x: cython.double
    end_y: cython.double
    end_theta: cython.double
    end_x, end_y, end_theta = along(0, 0, theta0, 1, word, t, p, q, t + p + q)
    tolerance: cython.double = FIT * (1 + fabs(x) + fabs(y))
    return (fabs(end_x - x) <= tolerance + rounding and fabs(end_y - y) <= tolerance + rounding
            and fabs(remainder(end_theta - theta1, TWO_PI)) <= tolerance)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def without_full_circles(word: cython.int, t: cython.double, p: cython.double, q: cython.double, x: cython.double,
                         y: cython.double, theta0: cython.double, theta1: cython.double, rounding: cython.double
                         ) -> tuple[cython.double, cython.double, cython.double]:
    """The curve with first and last turns that are 2 pi but for rounding taken as none, if the end still fits.

    What a turn falls short of 2 pi by is handed to the other one.
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
    """A lower bound of a turn in [0, 2 pi): its chord, which is at most the turn and at least 2 / pi of a turn up to pi."""
    chord: cython.double = sqrt(max(2 - 2 * cos_turn - COSINE_ERROR, 0.0))
    return chord if sin_turn > -2 * NEARLY_NONE else TWO_PI - PI / 2 * (chord + NEARLY_NONE)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def straight_turns_at_least(first: cython.int, last: cython.int, cos_straight: cython.double, sin_straight: cython.double,
                            sin0: cython.double, cos0: cython.double, sin1: cython.double,
                            cos1: cython.double) -> cython.double:
    """A lower bound of the two turns into and out of a straight arc of known direction."""
    return (turn_at_least(cos_straight * cos0 + sin_straight * sin0, first * (sin_straight * cos0 - cos_straight * sin0))
            + turn_at_least(cos_straight * cos1 + sin_straight * sin1, last * (cos_straight * sin1 - sin_straight * cos1)))


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def arcs(word: cython.int, x: cython.double, y: cython.double, theta0: cython.double, sin0: cython.double, cos0: cython.double,
         theta1: cython.double, sin1: cython.double, cos1: cython.double, left: cython.double,
         rounding: cython.double, limit: cython.double) -> tuple[cython.double, cython.double, cython.double]:
    """(t, p, q) of a word's curve from (0, 0, theta0) to (x, y, theta1), or p = NO_CURVE: none, or none shorter than `limit`.

    x and y are rounded by no more than `rounding`. `left` is theta1 - theta0 in [0, 2 pi). It, (u, v), and the direction of the
    straight arc tell most words to be too long before an arctangent is taken.
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
            return 0, NO_CURVE, 0
        p = min(sqrt(squared) / 4, 1.0)
        if TWO_PI - PI * p >= limit:  # asin(p) <= p pi / 2
            return 0, NO_CURVE, 0
        p = TWO_PI - 2 * asin(p)
        if p + mod_two_pi(turned + p) >= limit:
            return 0, NO_CURVE, 0
        t = mod_two_pi(s * (atan2(v, u) - theta0) + p / 2)
        q = mod_two_pi(turned - t + p)
    elif s == last:
        least = FIT * (1 + fabs(x) + fabs(y)) + rounding
        if squared <= least * least and turned < limit and fits(word, turned, 0, 0, x, y, theta0, theta1, rounding):
            return turned, 0, 0  # both poses on one circle, where the direction of (u, v) is but rounding
        if turned >= limit or squared >= (limit - turned) * (limit - turned):
            return 0, NO_CURVE, 0
        p = sqrt(squared)
        if p > 0 and p + straight_turns_at_least(s, last, u / p, v / p, sin0, cos0, sin1, cos1) >= limit:
            return 0, NO_CURVE, 0
        t = mod_two_pi(s * (atan2(v, u) - theta0))
        q = mod_two_pi(turned - t)
    else:
        least = min(turned, TWO_PI - turned)
        if squared < 4 - ROUNDING or least >= limit or squared - 4 >= (limit - least) * (limit - least):
            return 0, NO_CURVE, 0
        p = sqrt(max(squared - 4, 0.0))
        if p + straight_turns_at_least(s, last, (p * u - 2 * s * v) / squared, (p * v + 2 * s * u) / squared,
                                       sin0, cos0, sin1, cos1) >= limit:
            return 0, NO_CURVE, 0
        t = mod_two_pi(s * (atan2(v, u) - theta0) + atan2(2.0, p))
        q = mod_two_pi(t - turned)
    if t > TWO_PI - NEARLY_NONE or q > TWO_PI - NEARLY_NONE:
        return without_full_circles(word, t, p, q, x, y, theta0, theta1, rounding)
    return t, p, q


@cython.ccall
@cython.nogil
@cython.exceptval(check=False)
def rounding_at(x: cython.double, y: cython.double) -> cython.double:
    """By how much the rounding of poses around (x, y) may move what lies between them [m]."""
    return COORDINATE_ERROR * max(fabs(x), fabs(y))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def shortest_within(dx: cython.double, dy: cython.double, theta0: cython.double, sin0: cython.double, cos0: cython.double,
                    theta1: cython.double, sin1: cython.double, cos1: cython.double, radius: cython.double,
                    rounding: cython.double, limit: cython.double
                    ) -> tuple[cython.int, cython.double, cython.double, cython.double]:
    """(word, first, second, third) in metres: the shortest curve to a goal that lies (dx, dy) from the start.

    dx and dy, in metres too, are rounded by no more than `rounding`. `first` is NO_CURVE where that curve is not shorter than
    `limit`, which is found out in a fraction of the time.
    """
    x: cython.double = dx / radius
    y: cython.double = dy / radius
    left: cython.double = mod_two_pi(theta1 - theta0)
    best: cython.double = min(limit / radius, LONGEST)
    best_word: cython.int = 0
    best_t: cython.double = NO_CURVE
    best_p: cython.double = 0
    best_q: cython.double = 0
    t: cython.double
    p: cython.double
    q: cython.double
    word: cython.int
    if x == 0 and y == 0 and remainder(theta1 - theta0, TWO_PI) == 0:
        return 0, 0, 0, 0
    for word in range(6):
        if word == 4 and best <= PI:
            break
        t, p, q = arcs(word, x, y, theta0, sin0, cos0, theta1, sin1, cos1, left, rounding / radius, best)
        if t + p + q < best:
            best, best_word, best_t, best_p, best_q = t + p + q, word, t, p, q
    if best_t == NO_CURVE:
        return 0, NO_CURVE, 0, 0
    return best_word, best_t * radius, best_p * radius, best_q * radius


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def shortest(x0: cython.double, y0: cython.double, theta0: cython.double, x1: cython.double, y1: cython.double,
             theta1: cython.double, radius: cython.double
             ) -> tuple[cython.int, cython.double, cython.double, cython.double]:
    """(word, first, second, third): the shortest curve; lengths in metres."""
    return shortest_within(x1 - x0, y1 - y0, theta0, sin(theta0), cos(theta0), theta1, sin(theta1), cos(theta1),
                           radius, max(rounding_at(x0, y0), rounding_at(x1, y1)), NO_CURVE)


def shortest_curve(x0: cython.double, y0: cython.double, theta0: cython.double, x1: cython.double, y1: cython.double,
                   theta1: cython.double, radius: cython.double):
    """(word, first, second, third) of the shortest curve; lengths in metres."""
    return shortest(x0, y0, theta0, x1, y1, theta1, radius)


def all_curves(x0: cython.double, y0: cython.double, theta0: cython.double, x1: cython.double, y1: cython.double,
               theta1: cython.double, radius: cython.double) -> list:
    """(word, first, second, third) of every word that has a curve; lengths in metres."""
    t: cython.double
    p: cython.double
    q: cython.double
    word: cython.int
    found = []
    for word in range(6):
        t, p, q = arcs(word, (x1 - x0) / radius, (y1 - y0) / radius, theta0, sin(theta0), cos(theta0),
                       theta1, sin(theta1), cos(theta1), mod_two_pi(theta1 - theta0),
                       max(rounding_at(x0, y0), rounding_at(x1, y1)) / radius, NO_CURVE)
        if p < NO_CURVE:
            found.append((word, t * radius, p * radius, q * radius))
    return found


def shortest_lengths(starts: cython.double[:, ::1], goals: cython.double[:, ::1], radius: cython.double,
                     out: cython.double[::1]):
    """Write the lengths of the shortest curves between (n, 3) poses to `out`, in metres."""
    i: cython.Py_ssize_t
    word: cython.int
    first: cython.double
    second: cython.double
    third: cython.double
    with cython.nogil:
        for i in range(starts.shape[0]):
            word, first, second, third = shortest(starts[i, 0], starts[i, 1], starts[i, 2],
                                                  goals[i, 0], goals[i, 1], goals[i, 2], radius)
            out[i] = first + second + third


def pose_along(x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, word: cython.int,
               first: cython.double, second: cython.double, third: cython.double, s: cython.double):
    """The pose after `s` along a curve; all lengths in metres."""
    return along(x, y, theta, radius, word, first, second, third, s)


def poses_along(x: cython.double, y: cython.double, theta: cython.double, radius: cython.double, word: cython.int,
                first: cython.double, second: cython.double, third: cython.double, arc_lengths: cython.double[::1],
                out: cython.double[:, ::1]):
    """Write the poses at the arc lengths `arc_lengths` to `out` (n, 3), headings in [-pi, pi] but for the first."""
    i: cython.Py_ssize_t
    for i in range(arc_lengths.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = along(x, y, theta, radius, word, first, second, third, arc_lengths[i])
        if i > 0:
            out[i, 2] = remainder(out[i, 2], TWO_PI)


def chain_poses(poses: cython.double[:, ::1], words: cython.schar[::1], lengths: cython.double[:, ::1], radius: cython.double,
                curves: cython.long[::1], arc_lengths: cython.double[::1], out: cython.double[:, ::1]):
    """Write the poses at the arc lengths `arc_lengths` of a chain's `curves` to `out` (m, 3), headings in [-pi, pi].

    Curve i leads from pose i to pose i + 1, whose word and lengths are its own.
    """
    i: cython.Py_ssize_t
    pose: cython.Py_ssize_t
    with cython.nogil:
        for i in range(curves.shape[0]):
            pose = curves[i]
            out[i, 0], out[i, 1], out[i, 2] = along(poses[pose, 0], poses[pose, 1], poses[pose, 2], radius, words[pose + 1],
                                                    lengths[pose + 1, 0], lengths[pose + 1, 1], lengths[pose + 1, 2],
                                                    arc_lengths[i])
            out[i, 2] = remainder(out[i, 2], TWO_PI)


def edge_points(poses: cython.double[:, ::1], parents: cython.int[::1], words: cython.schar[::1],
                lengths: cython.double[:, ::1], radius: cython.double, edges: cython.long[::1], arc_lengths: cython.double[::1],
                out: cython.double[:, :]):
    """Write the positions at the arc lengths `arc_lengths` of a tree's `edges` to `out` (m, 2)."""
    i: cython.Py_ssize_t
    node: cython.Py_ssize_t
    parent: cython.Py_ssize_t
    theta: cython.double
    with cython.nogil:
        for i in range(edges.shape[0]):
            node = edges[i]
            parent = parents[node]
            out[i, 0], out[i, 1], theta = along(poses[parent, 0], poses[parent, 1], poses[parent, 2], radius, words[node],
                                                lengths[node, 0], lengths[node, 1], lengths[node, 2], arc_lengths[i])
