"""Values in messages: short, on one line, and in characters that any terminal can show."""

import math
import re
import reprlib
from collections.abc import Sequence
from typing import Any

#: The longest message [characters], of a longer one the middle is left out; a path may take 4096 of them.
LONGEST = 6000
_MOST_QUOTED = 200
#: Maximum length of a quoted name [characters].
_LONGEST_NAME = 220
#: Absolute number from which decimals say nothing: no map reaches so far [m].
_FAR = 1e10


def one_line(message: str) -> str:
    """`message` on one line, control characters escaped, and no longer than LONGEST."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(message.split()))
    if len(line) <= LONGEST:
        return line
    half = LONGEST // 2 - 3
    return f"{line[:half]} ... {line[-half:]}"


def quoted(value: Any) -> str:
    """`value` as Python writes it, on one line, of a long or deep one only the beginning."""
    text = re.sub(r"\n\s*", " ", _SHORT.repr(value))  # an array's rows
    return text if len(text) <= _MOST_QUOTED else f"{text[:_MOST_QUOTED]}..."


def quoted_name(name: str) -> str:
    """Return a name as Python writes it; of one that is too long for a name the middle is left out."""
    text = repr(name)
    half = _LONGEST_NAME // 2 - 2
    return text if len(text) <= _LONGEST_NAME else f"{text[:half]}...{text[-half:]}"


def fixed(value: float, decimals: int) -> str:
    """Return a number with so many decimals; six digits of one that is beyond all maps."""
    rounded = round(value, decimals) + 0.0  # no -0.00
    return f"{rounded:.{decimals}f}" if abs(value) < _FAR else f"{value:.6g}"


def at(point: Sequence[float], decimals: int = 2) -> str:
    """Return a position (x, y) [m], or more coordinates, with so many decimals."""
    return f"({', '.join(fixed(coordinate, decimals) for coordinate in point)})"


def metres(value: float) -> str:
    """Return two decimals, or two significant digits where that is more; three digits of what is too far to imagine."""
    if value >= 1e7:
        return f"{value:.3g}"
    return f"{value:.2f}" if value >= 0.1 or value == 0 else f"{value:.2g}"


def rounded_down(value: float) -> str:
    """Return a number that is not above `value`, with the digits of `metres`."""
    digits = _decimals(value)
    return f"{math.floor(value * 10**digits) / 10**digits:.{digits}f}"


def rounded_up(value: float) -> str:
    """Return a number that is not below `value`, with the digits of `metres`."""
    digits = _decimals(value)
    return f"{math.ceil(value * 10**digits) / 10**digits:.{digits}f}"


def _decimals(value: float) -> int:
    """Return the number of decimals that show two significant digits; two at least."""
    return max(2, 1 - math.floor(math.log10(value))) if value > 0 else 2


def distinct(*values: float) -> tuple[str, ...]:
    """Return figures with two decimals, or with as many as make them differ."""
    digits = next(n for n in range(2, 17) if len({f"{value:.{n}f}" for value in values}) == len(values) or n == 16)
    return tuple(f"{value:.{digits}f}" for value in values)


class _Short(reprlib.Repr):
    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxother = 2, 60

    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to write integers of more than 4300 digits.
        return super().repr_int(x, level) if x.bit_length() < 10_000 else f"an integer of {x.bit_length()} bits"


_SHORT = _Short()


def install_command(extra: str) -> str:
    """Return the command that installs an extra of this package."""
    return f"pip install 'dubins_rrt_ros[{extra}]'"
