"""What a reader may take and say, whatever it reads: seconds, megabytes, a result or a sentence."""

import contextlib
import resource
import signal
from pathlib import Path

from hypothesis import currently_in_test_context, event

from dubins_rrt_ros.planning.text import LONGEST

SECONDS, MEGABYTES = 5.0, 64
#: What ends an allocation before it takes the machine down [bytes].
_SAFETY = 2 * 2**30
_PROCESS = Path("/proc/self")


class Bounds:
    """A block of code that takes at most SECONDS, and MEGABYTES more than the process had before.

    An allocation of gigabytes fails with a MemoryError; memory that is taken and given back within the block counts.
    """

    def __enter__(self):
        self._limits = resource.getrlimit(resource.RLIMIT_AS)
        used = int((_PROCESS / "statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + _SAFETY, self._limits[1]))
        self._before = signal.signal(signal.SIGALRM, _too_slow)
        with contextlib.suppress(OSError):  # where it may not be written, only a new peak of the whole process is noticed
            (_PROCESS / "clear_refs").write_text("5")  # the peak counts from here on
        self._peak = _peak()
        signal.setitimer(signal.ITIMER_REAL, SECONDS)

    def __exit__(self, kind, error, trace):
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, self._before)
        resource.setrlimit(resource.RLIMIT_AS, self._limits)
        taken = (_peak() - self._peak) / 1024
        assert taken <= MEGABYTES, f"it took {taken:.0f} MB"


def _too_slow(signum, frame):
    raise AssertionError(f"it takes more than {SECONDS} s")


def _peak():
    """The most memory that the process has had since its peak was cleared [kB]."""
    status = (_PROCESS / "status").read_text()
    return int(status.partition("VmHWM:")[2].split(maxsplit=1)[0])


def read_or_refused(read, *refusals):
    """What `read` gives, or None where it raises one of the refusals, in one line that can be shown; within bounds."""
    with Bounds():
        try:
            result, message = read(), ""
        except refusals as error:
            result, message = None, str(error)
    if currently_in_test_context():
        event("refused" if message else "read")
    if result is None:
        assert message
        assert message.isprintable()
        assert len(message) <= LONGEST
    return result
