# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True
"""Lower bounds of Dubins curves between boxes, each a rectangle of positions times an interval of headings.

Between two points, with intervals of headings at both, the shortest curve is that of the Dubins interval problem (S. G. Manyam,
S. Rathinam, D. Casbeer, E. Garcia, Tightly bounding the shortest Dubins paths through a sequence of points, 2017). Where a
heading is inside its interval, Pontryagin's principle has the curve begin, or end, with a straight arc, or with a turn that it
drives alone or that joins one other turn. So the shortest is among the Dubins curves between ends of both intervals, a turn from
such an end and then a straight arc or the opposite turn, a single turn, and the straight line.

Between two rectangles any two points lie as far apart, and in a direction, as the rectangles allow. A similarity moves them onto
the rectangles' centres: it scales lengths and the turning radius by at least `least` and at most `most`, and turns headings by at
most `turn`. A curve's image is thus a curve that turns no tighter than with `least` times the radius between the centres, with
headings in the intervals widened by `turn`; and the curve is at least 1 / `most` times as long as its image. Both steps only
lower the bound, and what is rounded is covered by ROUNDING.

Boxes are rows (x, y, cos, sin, half_length, half_width, heading, half_heading): centre [m], direction of the length, halves [m],
middle of the headings and half their range [rad].
"""

import cython

if cython.compiled:
    from cython.cimports.dubins_rrt_ros.planning._kernels.dubins import TWO_PI, Pose, length_of, shortest
    from cython.cimports.libc.math import asin, atan2, cos, fabs, hypot, remainder, sin, sqrt
else:
    from math import asin, atan2, cos, fabs, hypot, remainder, sin, sqrt

    from .dubins import Pose, length_of, shortest

    Interval = cython.struct(middle=cython.double, half=cython.double)
    TWO_PI = 6.283185307179586476925286766559

PI = cython.declare(cython.double, 3.141592653589793238462643383280)
#: Allowance for rounding: relative for lengths, absolute for headings [rad], by which intervals are widened.
ROUNDING = cython.declare(cython.double, 1e-9)
#: Cost that stands for infinity.
UNLIMITED = cython.declare(cython.double, 1e300)


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def holds(interval: Interval, heading: cython.double) -> cython.bint:
    """Return whether a heading is in an interval, or within rounding of it."""
    return fabs(remainder(heading - interval.middle, TWO_PI)) <= interval.half + ROUNDING


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def turned(angle: cython.double) -> cython.double:
    """Return an angle wrapped to [0, 2 pi), and 0 where it is below that by no more than rounding."""
    angle = remainder(angle, TWO_PI)
    return max(0.0, angle) if angle > -ROUNDING else angle + TWO_PI


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def to_point(heading: cython.double, x: cython.double, y: cython.double, ends: Interval, limit: cython.double) -> cython.double:
    """Return the shortest curve from the origin to a point that arrives straight or with the opposite turn; radius 1.

    Only curves whose last heading is in `ends` count; `limit` where none is shorter.
    """
    s: cython.int
    way: cython.int
    best: cython.double = limit
    for s in range(-1, 2, 2):
        # The centre of the first turn, and the point as seen from there.
        dx: cython.double = x + s * sin(heading)
        dy: cython.double = y - s * cos(heading)
        far: cython.double = hypot(dx, dy)
        towards: cython.double = atan2(dy, dx)
        end: cython.double
        if far >= 1 - ROUNDING:
            end = towards + s * asin(min(1.0, 1 / far))
            if holds(ends, end):
                best = min(best, turned(s * (end - heading)) + sqrt(max(0.0, far * far - 1)))
        if 1 - ROUNDING <= far <= 3 + ROUNDING:
            half: cython.double = (far * far + 3) / (4 * far)
            half = atan2(sqrt(max(0.0, 1 - half * half)), half)
            for way in range(-1, 2, 2):
                to_other: cython.double = towards + way * half
                between: cython.double = to_other + s * PI / 2  # the heading where the turns join
                end = atan2(dy - 2 * sin(to_other), dx - 2 * cos(to_other)) - s * PI / 2
                if holds(ends, end):
                    best = min(best, turned(s * (between - heading)) + turned(s * (between - end)))
    return best


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def single_turn(distance: cython.double, start: Interval, end: Interval, limit: cython.double) -> cython.double:
    """Return the shortest single turn of radius 1 over a distance between headings in two intervals, or `limit`."""
    best: cython.double = limit
    if distance > 2:
        return best
    s: cython.int
    longer: cython.int
    for longer in range(2):
        angle: cython.double = 2 * asin(distance / 2)
        if longer:
            angle = TWO_PI - angle
        for s in range(-1, 2, 2):
            if holds(start, -s * angle / 2) and holds(end, s * angle / 2):
                best = min(best, angle)
    return best


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def least_curve(distance: cython.double, start: Interval, end: Interval) -> cython.double:
    """Return the shortest curve of radius 1 from the origin to (distance, 0) with headings in two intervals."""
    if holds(start, 0) and holds(end, 0):
        return distance
    best: cython.double = single_turn(distance, start, end, UNLIMITED)
    backwards: Interval = Interval(start.middle + PI, start.half)
    one: cython.int
    other: cython.int
    for one in range(-1, 2, 2):
        best = to_point(start.middle + one * start.half, distance, 0, end, best)
        # The same curve, driven backwards from the end.
        best = to_point(end.middle + one * end.half + PI, -distance, 0, backwards, best)
        for other in range(-1, 2, 2):
            best = min(best, length_of(shortest(Pose(0, 0, start.middle + one * start.half),
                                                Pose(distance, 0, end.middle + other * end.half), 1)))
    return best


def shortest_of_intervals(distance: cython.double, start: cython.double, start_half: cython.double, end: cython.double,
                          end_half: cython.double, radius: cython.double) -> cython.double:
    """Return the length of the shortest curve from the origin to (distance, 0), with headings in two intervals."""
    return radius * least_curve(distance / radius, Interval(start, min(start_half, PI)), Interval(end, min(end_half, PI)))


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def least_turn(distance: cython.double, off: cython.double) -> cython.double:
    """Return the length of a turn of radius 1 and a straight line to a point, where the heading is `off` its direction [rad].

    No curve that begins, or backwards ends, farther off is shorter. The point is at least 2 away, so that no turn goes around it.
    """
    dx: cython.double = distance - sin(off)
    dy: cython.double = cos(off)
    far: cython.double = hypot(dx, dy)
    return off - atan2(dy, dx) + asin(min(1.0, 1 / far)) + sqrt(max(0.0, far * far - 1))


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def least_between(ax: cython.double, ay: cython.double, au: cython.double, av: cython.double, al: cython.double,
                  aw: cython.double, a: Interval, bx: cython.double, by: cython.double, bu: cython.double, bv: cython.double,
                  bl: cython.double, bw: cython.double, b: Interval, radius: cython.double,
                  limit: cython.double) -> cython.double:
    """Return a lower bound of the curves from one box to another, a quicker one where that is at least `limit`."""
    dx: cython.double = bx - ax
    dy: cython.double = by - ay
    distance: cython.double = hypot(dx, dy)
    if distance == 0:
        return 0
    dx /= distance
    dy /= distance
    # Half the range of the difference of two points, along the line between the centres and across it.
    along: cython.double = (al * fabs(au * dx + av * dy) + aw * fabs(au * dy - av * dx)
                            + bl * fabs(bu * dx + bv * dy) + bw * fabs(bu * dy - bv * dx))
    across: cython.double = (al * fabs(au * dy - av * dx) + aw * fabs(au * dx + av * dy)
                             + bl * fabs(bu * dy - bv * dx) + bw * fabs(bu * dx + bv * dy))
    nearest: cython.double = distance - along
    if nearest <= 0:
        return 0
    if nearest >= limit:
        return nearest * (1 - ROUNDING)
    turn: cython.double = atan2(across, nearest)
    line: cython.double = atan2(dy, dx)
    least: cython.double = distance / hypot(distance + along, across)
    scaled: cython.double = least * radius
    start: Interval = Interval(a.middle - line, min(PI, a.half + turn))
    end: Interval = Interval(b.middle - line, min(PI, b.half + turn))
    off: cython.double = max(fabs(remainder(start.middle, TWO_PI)) - start.half, fabs(remainder(end.middle, TWO_PI)) - end.half)
    image: cython.double
    if off > 0 and distance >= 2 * scaled:
        image = scaled * least_turn(distance / scaled, off)
        if image * nearest >= limit * distance:
            return image * nearest / distance * (1 - ROUNDING)
    image = scaled * least_curve(distance / scaled, start, end)
    return max(nearest, image * nearest / distance) * (1 - ROUNDING)


def relax(costs: cython.double[::1], boxes: cython.double[:, ::1], next_boxes: cython.double[:, ::1],
          left: cython.double[::1], least_edge: cython.double, radius: cython.double, limit: cython.double,
          backwards: cython.bint, out: cython.double[::1], best: cython.int[::1]):
    """Lower the costs of chains to `next_boxes` in `out`, and write the index of the box before each to `best`, or -1.

    Args:
        costs: lower bounds of the costs of chains up to each of `boxes` [m].
        left: lower bounds of the costs from `next_boxes` on [m]; chains that cost `limit` or more with them are left out.
        least_edge: length of which no curve between two of these boxes falls short [m].
        backwards: True if chains lead from `next_boxes` to `boxes`, so that costs are counted from the end.
    """
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    k: cython.Py_ssize_t
    with cython.nogil:
        for j in range(next_boxes.shape[0]):
            least: cython.double = min(limit - left[j], out[j])
            best[j] = -1
            # The most promising box first, so that most of the others are not looked at.
            first: cython.Py_ssize_t = most_promising(costs, boxes, next_boxes, j, radius, least)
            for k in range(-1, boxes.shape[0]):
                i = first if k < 0 else k
                if k == first or costs[i] + least_edge >= least:
                    continue
                edge: cython.double = (edge_between(next_boxes, j, boxes, i, radius, least - costs[i]) if backwards
                                       else edge_between(boxes, i, next_boxes, j, radius, least - costs[i]))
                edge = max(edge, least_edge)
                if costs[i] + edge < least:
                    least = costs[i] + edge
                    best[j] = i
            if best[j] >= 0:
                out[j] = least


@cython.cfunc
@cython.nogil
@cython.inline
@cython.exceptval(check=False)
def edge_between(boxes: cython.double[:, ::1], i: cython.Py_ssize_t, others: cython.double[:, ::1], j: cython.Py_ssize_t,
                 radius: cython.double, limit: cython.double) -> cython.double:
    """Return a lower bound of the curves from box i to one of others, j, a quicker one where that is at least `limit`."""
    return least_between(boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3], boxes[i, 4], boxes[i, 5],
                         Interval(boxes[i, 6], boxes[i, 7]), others[j, 0], others[j, 1], others[j, 2], others[j, 3],
                         others[j, 4], others[j, 5], Interval(others[j, 6], others[j, 7]), radius, limit)


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def most_promising(costs: cython.double[::1], boxes: cython.double[:, ::1], next_boxes: cython.double[:, ::1],
                   j: cython.Py_ssize_t, radius: cython.double, limit: cython.double) -> cython.Py_ssize_t:
    """Return the box from which a chain over a straight line to box j of `next_boxes` costs least, its turns counted roughly."""
    best: cython.Py_ssize_t = 0
    least: cython.double = UNLIMITED
    i: cython.Py_ssize_t
    for i in range(boxes.shape[0]):
        if costs[i] >= limit or costs[i] >= least:
            break
        cost: cython.double = (costs[i] + hypot(next_boxes[j, 0] - boxes[i, 0], next_boxes[j, 1] - boxes[i, 1])
                               + radius * fabs(remainder(next_boxes[j, 6] - boxes[i, 6], TWO_PI)) / 4)
        if cost < least:
            least = cost
            best = i
    return best


def bounds_between(boxes: cython.double[:, ::1], others: cython.double[:, ::1], radius: cython.double, out: cython.double[::1]):
    """Write lower bounds of the curves from each of (n, 8) boxes to that of the same row of `others` to `out` [m]."""
    i: cython.Py_ssize_t
    for i in range(boxes.shape[0]):
        out[i] = edge_between(boxes, i, others, i, radius, UNLIMITED)
