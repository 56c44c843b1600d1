"""Lower bounds of the lengths of Dubins curves between boxes of poses; `docs/proof.md` has f, psi, phi, V and G.

A box is a row of eleven numbers, in metres and radians:
    0, 1    x, y        middle
    2, 3    dx, dy      unit vector along it
    4, 5    l, w        half its length, and half its width; far above the rounding of places, from which else a direction came
    6, 7    h, dh       middle and half the range of its headings, at most pi
    8       u           potential: no path from the start reaches the box sooner
    9       cost        the cost from the start there; not a number where it is not known
    10      left        lower bound of the cost to the goal there
"""

import numpy as np

TAU = 2 * np.pi
#: Allowance for rounding of angles [rad].
ROUNDING = 1e-9
LEFT, RIGHT = 1, -1
#: Number of pairs of boxes that are looked at together.
PAIRS = 200_000
#: Number of times that boxes are halved at most where the bound of the whole is not enough, and greatest number of their pairs.
HALVINGS, MAX_PAIRS = 14, 20_000
#: What a bound may fall short of the curve between the boxes' middles, in turning radii; a smaller share takes more halvings.
SHORT = 1e-3
#: The sizes of a box.
SIZES = 4, 5, 7


def too_high(ahead: np.ndarray, boxes: np.ndarray, radius: float, margin: float) -> np.ndarray:
    """Return (m,) lengths by which the potentials of (m, 11) boxes, and a margin, are above what those ahead allow, or 0 [m].

    No potential may rise from one of the (n, 11) boxes `ahead` to another box by more than the shortest curve from there.
    """
    excess, size = np.zeros(len(boxes)), max(1, PAIRS // max(1, len(boxes)))
    for begin in range(0, len(ahead), size):
        some = ahead[begin:begin + size, None]
        rise = boxes[:, 8] - some[..., 8] + margin
        # The cost from the start rises by no more than the length of a path.
        least = np.maximum(_distance(some, boxes), np.nan_to_num(np.abs(boxes[:, 9] - some[..., 9])))
        first, last = np.nonzero(rise > least)
        wanted = rise[first, last]
        np.maximum.at(excess, last, wanted - least_length(some[first, 0], boxes[last], radius, wanted))
    return excess


def least_length(a: np.ndarray, b: np.ndarray, radius: float, enough: np.ndarray, halvings: int = HALVINGS) -> np.ndarray:
    """Return lower bounds of the curves from each of (n, 11) boxes to the box of the same row, at most `enough` (n,) [m]."""
    least = np.minimum(_least_of_whole(a, b, radius), enough)
    short = np.flatnonzero(least < enough)
    if halvings == 0 or not 0 < len(short) <= MAX_PAIRS:
        return least
    # No more can be shown than for the poses in the middle: a little less is enough where that is too short.
    middles = _least_of_whole(part(a[short], 0, 0), part(b[short], 0, 0), radius)
    wanted = np.where(middles < enough[short], np.maximum(middles - SHORT * radius, least[short]), enough[short])
    some = least[short] < wanted
    short, wanted = short[some], wanted[some]
    first, last = _halves(a[short], b[short], radius)
    least[short] = np.minimum(*np.split(least_length(first, last, radius, np.tile(wanted, 2), halvings - 1), 2))
    return least


def _halves(a: np.ndarray, b: np.ndarray, radius: float) -> list[np.ndarray]:
    """Return both halves of pairs of boxes: of each pair the interval that matters most is halved."""
    widest = np.column_stack([box[:, SIZES] * (1, 1, radius) for box in (a, b)]).argmax(axis=1)
    ends = np.split(np.arange(6) != widest[:, None], 2, axis=1)  # from -1 to 1, or to and from the middle
    return [np.concatenate([part(box, -1, end), part(box, -1 * end, 1)]) for box, end in zip((a, b), ends, strict=True)]


def part(boxes: np.ndarray, low: np.ndarray | int, high: np.ndarray | int) -> np.ndarray:
    """Return parts of boxes, by (n, 3) ends of their ranges along and across a box and of the headings, from -1 to 1."""
    boxes = boxes.copy()
    along, across, turn = (boxes[:, SIZES] * (low + high) / 2).T
    boxes[:, 0] += along * boxes[:, 2] - across * boxes[:, 3]
    boxes[:, 1] += along * boxes[:, 3] + across * boxes[:, 2]
    boxes[:, 6] += turn
    boxes[:, SIZES] *= (high - low) / 2
    return boxes


def _least_of_whole(a: np.ndarray, b: np.ndarray, radius: float) -> np.ndarray:
    """Bound the lengths of all six words, by the distance too."""
    words = [_turn_straight_turn(a, b, first, last, radius) for first in (LEFT, RIGHT) for last in (LEFT, RIGHT)]
    words += [_three_turns(a, b, first, radius) for first in (LEFT, RIGHT)]
    return np.asarray(np.maximum(_distance(a, b), np.min(words, axis=0)))


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(np.hypot(b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]) - _reach(a) - _reach(b))


def _reach(box: np.ndarray) -> np.ndarray:
    return np.asarray(np.hypot(box[..., 4], box[..., 5]))


def _centres(a: np.ndarray, b: np.ndarray, first: int, last: int, radius: float) -> tuple[np.ndarray, ...]:
    """Return length and direction of V for the boxes' middles; how far V is from there elsewhere; and how far it turns."""
    x = b[:, 0] - a[:, 0] - radius * (last * np.sin(b[:, 6]) - first * np.sin(a[:, 6]))
    y = b[:, 1] - a[:, 1] + radius * (last * np.cos(b[:, 6]) - first * np.cos(a[:, 6]))
    far = np.hypot(x, y)
    off = _reach(a) + _reach(b) + 2 * radius * (np.sin(a[:, 7] / 2) + np.sin(b[:, 7] / 2))
    swing = np.where(off < far, np.arcsin(np.minimum(1, off / np.maximum(far, 1e-12))), np.pi) + ROUNDING
    return far, np.arctan2(y, x), off, swing


def _turn_straight_turn(a: np.ndarray, b: np.ndarray, first: int, last: int, radius: float) -> np.ndarray:
    """Bound the lengths of a word with a straight line by f(psi); infinite where there is no such curve."""
    far, psi, off, slip = _centres(a, b, first, last, radius)  # slip: between psi and phi, at most
    is_near, is_known = far + off < 2 * radius * (1 - ROUNDING), slip < np.pi / 2
    if first != last:
        flattest, tangent, steepest = (np.arcsin(np.minimum(1, 2 * radius / np.maximum(away, 1e-12)))
                                       for away in (far + off, far, far - off))
        tangent = np.minimum(tangent, np.pi / 2 - slip)  # psi has to be within a right angle of V
        psi, slip = psi + first * tangent, slip + np.maximum(np.abs(tangent - flattest), steepest - tangent)
    turns = (first * (psi - a[:, 6]), a[:, 7]), (last * (b[:, 6] - psi), b[:, 7])
    least = np.sum([_lag(_least_turn(middle, half, slip)) for middle, half in turns], axis=0)
    if first == last:  # then the sum of both turns is at least 0 too, for any psi
        start, end = (middle - half for middle, half in turns)
        start = start - TAU * np.floor((start + end + 2 * (a[:, 7] + b[:, 7]) + ROUNDING) / TAU)
        least = np.maximum(least, _lag(start) + _lag(end))
    c, s = np.cos(psi), np.sin(psi)
    length = c * (b[:, 0] - a[:, 0]) + s * (b[:, 1] - a[:, 1]) + radius * least
    for box in (a, b):
        length -= np.abs(c * box[:, 2] + s * box[:, 3]) * box[:, 4] + np.abs(c * box[:, 3] - s * box[:, 2]) * box[:, 5]
    return length if first == last else np.where(is_near, np.inf, np.where(is_known, length, -np.inf))


def _lag(turn: np.ndarray) -> np.ndarray:
    """Return G, by which a turn is longer than it leads ahead, in radii."""
    return np.asarray(turn - np.sin(turn))


def _three_turns(a: np.ndarray, b: np.ndarray, first: int, radius: float) -> np.ndarray:
    """Bound three turns, whose middle one is longer than pi by Dubins; infinite where there is no such curve."""
    far, towards, off, swing = _centres(a, b, first, first, radius)
    # From V to the centre of the turn in the middle, seen from the first.
    least, tilt, most = (np.arccos(np.clip(away / (4 * radius), 0, 1)) for away in (far + off, far, far - off))
    swing = swing + np.maximum(tilt - least, most - tilt)
    start = _least_turn(first * (towards - a[:, 6]) + tilt + np.pi / 2, a[:, 7] + swing, 0.0)
    end = _least_turn(first * (b[:, 6] - towards) + tilt + np.pi / 2, b[:, 7] + swing, 0.0)
    return np.where(far - off > 4 * radius * (1 + ROUNDING), np.inf, radius * (start + np.pi + 2 * least + end))


def _least_turn(middle: np.ndarray, half: np.ndarray, slip: np.ndarray | float) -> np.ndarray:
    """Return the least turn, of those of at least -slip, that is within `half` of `middle` but for whole turns."""
    return np.asarray(np.maximum(np.mod(middle + half + slip, TAU) - slip - 2 * half, -slip))
