"""Keep the memory that a request frees for the next one, rather than give it back to the system."""

from functools import cache

import numpy as np

#: A block of memory that is larger than any array of most requests [bytes].
LARGE_BLOCK = 1 << 24


@cache
def keep_freed_memory() -> None:
    """Have glibc keep what a request frees for the next one, up to 32 MB.

    By itself it gives much of it back, and fetching that again, page by page, takes up to a quarter of the time to a first path.
    It keeps twice the largest block that it saw freed; this one costs nothing, as it is not touched. Other C libraries, and
    limits that were set with mallopt(), are left as they are.
    """
    np.empty(LARGE_BLOCK, np.uint8)
