"""What messages say of values: short, on one line, and in characters that any terminal can show."""

import reprlib
from typing import Any

#: The longest message [characters], of a longer one the middle is left out; a path may take 4096 of them.
LONGEST = 6000
_MOST_QUOTED = 200


def one_line(message: str) -> str:
    """`message` on one line, control characters escaped, and no longer than LONGEST."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(message.split()))
    if len(line) <= LONGEST:
        return line
    half = LONGEST // 2 - 3
    return f"{line[:half]} ... {line[-half:]}"


def quoted(value: Any) -> str:
    """`value` as Python writes it, of a long or deep one only the beginning."""
    text = _SHORT.repr(value)
    return text if len(text) <= _MOST_QUOTED else f"{text[:_MOST_QUOTED]}..."


class _Short(reprlib.Repr):
    def __init__(self):
        super().__init__()
        self.maxlevel, self.maxother = 2, 60

    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to write integers of more than 4300 digits.
        return super().repr_int(x, level) if x.bit_length() < 10_000 else f"an integer of {x.bit_length()} bits"


_SHORT = _Short()
