"""Lower bounds of the lengths of Dubins curves between boxes of poses.

A box is a row of eleven numbers, in metres and radians:
    0, 1    x, y        middle
    2, 3    dx, dy      unit vector along it
    4, 5    l, w        half its length, and half its width
    6, 7    h, dh       middle and half the range of its headings, at most pi
    8       u           potential: no path from the start reaches the box sooner
    9       cost        the cost from the start there; not a number where it is not known
    10      left        lower bound of the cost to the goal there

By Dubins (1957) the shortest curve is one of six words. Take a word of two turns and a straight line in the direction phi, with
the turning angles a and b, and let G(t) = t - sin t. For any direction psi let a and b be the angles of the same turns to psi and
from psi on. Then

    f(psi) = e(psi) (q - p) + R G(a) + R G(b),      f(phi) = length,   f'(phi) = 0,   f'' = - e(psi) V

where V leads from the centre of the first turning circle to that of the last. Where both turn the same way, f(psi) is
e(psi) V + R (a + b), and the length |V| + R (a + b). Otherwise f is concave within a right angle of V, where phi is. So
f(psi) <= length in both cases, and f is the sum of what depends on p, on q, on the heading at p and on that at q: each is least
at an end. `docs/proof.md` has the pictures.
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


def too_high(ahead: np.ndarray, boxes: np.ndarray, radius: float, margin: float) -> np.ndarray:
    """Return (m,) lengths by which the potentials of (m, 11) boxes, and a margin, are above what those ahead allow, or 0 [m].

    No potential may rise from one of the (n, 11) boxes `ahead` to another box by more than the shortest curve from there.
    """
    excess, size = np.zeros(len(boxes)), max(1, PAIRS // max(1, len(boxes)))
    for begin in range(0, len(ahead), size):
        some = ahead[begin:begin + size, None]
        rise = boxes[:, 8] - some[..., 8] + margin
        least = np.hypot(boxes[:, 0] - some[..., 0], boxes[:, 1] - some[..., 1]) - _reach(boxes) - _reach(some)
        # The cost from the start rises by no more than the length of a path.
        first, last = np.nonzero(rise > np.maximum(least, np.nan_to_num(np.abs(boxes[:, 9] - some[..., 9]))))
        wanted = rise[first, last]
        np.maximum.at(excess, last, wanted - least_length(some[first, 0], boxes[last], radius, wanted))
    return excess


def least_length(a: np.ndarray, b: np.ndarray, radius: float, enough: np.ndarray, halvings: int = HALVINGS) -> np.ndarray:
    """Return lower bounds of the curves from each of (n, 8) boxes to the box of the same row, at most `enough` (n,) [m]."""
    least = np.minimum(_least_of_whole(a, b, radius, enough), enough)
    short = np.flatnonzero(least < enough)
    if halvings == 0 or not 0 < len(short) <= MAX_PAIRS:
        return least
    # No more can be shown than for the poses in the middle: a little less is enough where that is too short.
    middles = _least_of_whole(_middle(a[short]), _middle(b[short]), radius, enough[short])
    wanted = np.where(middles < enough[short], np.maximum(middles - SHORT * radius, least[short]), enough[short])
    some = least[short] < wanted
    short, wanted = short[some], wanted[some]
    parts = least_length(*_halves(a[short], b[short], radius), radius, np.tile(wanted, 2), halvings - 1)
    least[short] = np.minimum(*np.split(parts, 2))
    return least


def _middle(boxes: np.ndarray) -> np.ndarray:
    """Return the poses in the middles of boxes, as boxes."""
    boxes = boxes.copy()
    boxes[:, (4, 5, 7)] = 0
    return boxes


def _halves(a: np.ndarray, b: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return both halves of pairs of boxes: of each pair the interval that matters most is halved."""
    widest = np.stack([size for box in (a, b) for size in (radius * box[:, 7], box[:, 4], box[:, 5])]).argmax(axis=0)
    sign, halves = np.repeat((-1, 1), len(a)), [np.tile(box, (2, 1)) for box in (a, b)]
    for number, box in enumerate(halves):
        heading, along, across = (np.flatnonzero(np.tile(widest == 3 * number + kind, 2)) for kind in range(3))
        box[heading, 7] /= 2
        box[heading, 6] += sign[heading] * box[heading, 7]
        for some, half, direction in ((along, 4, box[along, 2:4]), (across, 5, box[across, 3:1:-1] * (-1, 1))):
            box[some, half] /= 2
            box[some, :2] += (sign[some] * box[some, half])[:, None] * direction
    return halves[0], halves[1]


def _least_of_whole(a: np.ndarray, b: np.ndarray, radius: float, enough: np.ndarray) -> np.ndarray:
    least = np.hypot(b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]) - _reach(a) - _reach(b)
    for choice in range(3):
        some = np.flatnonzero(least < enough)
        if len(some):
            least[some] = np.maximum(least[some], _least_of_words(a[some], b[some], radius, choice))
    return np.asarray(least)


def _least_of_words(a: np.ndarray, b: np.ndarray, radius: float, choice: int) -> np.ndarray:
    """Bound all six words, with another psi for each choice: the middle phi, or the heading in the middle of a box."""
    least = np.full(len(a), np.inf)
    for first in (LEFT, RIGHT):
        for last in (LEFT, RIGHT):
            least = np.minimum(least, _turn_straight_turn(a, b, first, last, radius, choice))
        least = np.minimum(least, _three_turns(a, b, first, radius))
    return least


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


def _turn_straight_turn(a: np.ndarray, b: np.ndarray, first: int, last: int, radius: float, choice: int) -> np.ndarray:
    """Bound the lengths of a word with a straight line; infinite where there is no such curve."""
    far, towards, off, swing = _centres(a, b, first, last, radius)
    psi = (towards, a[:, 6], b[:, 6])[choice]
    if first == last:
        slip = swing + np.abs(_wrapped(psi - towards))
        return _along(a, b, psi) + radius * np.maximum(_turns_together(a, b, first, psi), np.where(
            off < far, _turns_apart(a, b, first, last, psi, slip), -np.inf))
    tangent = first * _wrapped(psi - towards) if choice else np.arcsin(np.minimum(1, 2 * radius / np.maximum(far, 1e-12)))
    tangent = np.clip(tangent, swing - np.pi / 2, np.pi / 2 - swing)
    flattest = np.arcsin(np.minimum(1, 2 * radius / (far + off)))
    steepest = np.arcsin(np.minimum(1, 2 * radius / np.maximum(far - off, 1e-12)))
    psi = towards + first * tangent
    slip = swing + np.maximum(np.abs(tangent - flattest), np.abs(steepest - tangent))  # between psi and phi, at most
    length = _along(a, b, psi) + radius * _turns_apart(a, b, first, last, psi, slip)
    return np.where(far + off < 2 * radius * (1 - ROUNDING), np.inf, np.where(swing < np.pi / 2, length, -np.inf))


def _along(a: np.ndarray, b: np.ndarray, psi: np.ndarray) -> np.ndarray:
    """Return the least e(psi) (q - p)."""
    c, s = np.cos(psi), np.sin(psi)
    least = c * (b[:, 0] - a[:, 0]) + s * (b[:, 1] - a[:, 1])
    for box in (a, b):
        least = least - (np.abs(c * box[:, 2] + s * box[:, 3]) * box[:, 4] + np.abs(c * box[:, 3] - s * box[:, 2]) * box[:, 5])
    return np.asarray(least)


def _turns_together(a: np.ndarray, b: np.ndarray, way: int, psi: np.ndarray) -> np.ndarray:
    """Return the least G(a) + G(b) of two turns the same way, whose sum is at least 0."""
    start, end = way * (psi - a[:, 6]) - a[:, 7], way * (b[:, 6] - psi) - b[:, 7]
    start = start - TAU * np.floor((start + end + 2 * (a[:, 7] + b[:, 7]) + ROUNDING) / TAU)
    return np.asarray(start - np.sin(start) + end - np.sin(end))


def _turns_apart(a: np.ndarray, b: np.ndarray, first: int, last: int, psi: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """Return the least G(a) + G(b) of turns that are at least -slip, as G rises."""
    least = np.zeros(len(a))
    for middle, half in ((first * (psi - a[:, 6]), a[:, 7]), (last * (b[:, 6] - psi), b[:, 7])):
        high = np.mod(middle + half + slip, TAU) - slip  # the greatest turn that is at least -slip by less than a whole one
        low = np.maximum(high - 2 * half, -slip)
        least = least + low - np.sin(low)
    return least


def _three_turns(a: np.ndarray, b: np.ndarray, first: int, radius: float) -> np.ndarray:
    """Bound three turns, whose middle one is longer than pi by Dubins; infinite where there is no such curve."""
    far, towards, off, swing = _centres(a, b, first, first, radius)
    tilt = np.arccos(np.minimum(1, far / (4 * radius)))  # from V to the centre of the turn in the middle, seen from the first
    least_tilt = np.arccos(np.minimum(1, (far + off) / (4 * radius)))
    swing = swing + np.maximum(tilt - least_tilt, np.arccos(np.clip((far - off) / (4 * radius), 0, 1)) - tilt)
    start = _least_whole(first * (towards - a[:, 6]) + tilt + np.pi / 2, a[:, 7] + swing)
    end = _least_whole(first * (b[:, 6] - towards) + tilt + np.pi / 2, b[:, 7] + swing)
    return np.where(far - off > 4 * radius * (1 + ROUNDING), np.inf, radius * (start + np.pi + 2 * least_tilt + end))


def _least_whole(middle: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the least of all angles within `half` of `middle`, taken modulo a whole turn."""
    low = middle - half
    return np.where(np.floor(low / TAU) == np.floor((middle + half) / TAU), np.mod(low, TAU), 0)


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return np.asarray(np.mod(angle + np.pi, TAU) - np.pi)
