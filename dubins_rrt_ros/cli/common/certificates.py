"""Certificates of paths, as commands write them."""

import argparse
import gzip
import io
import math
import os
import stat
import sys
import zlib
from pathlib import Path
from typing import Any

from dubins_rrt_ros.checker.check import NO_CERTIFICATE, Refused
from dubins_rrt_ros.checker.maps import World
from dubins_rrt_ros.planning import Plan, Problem

from .parser import UsageError
from .request import find_map_or_suggest

#: Gap down to which the proof goes, and approximate time for it [s].
GAP, SECONDS = 0.005, 30.0
#: Options of a request with which a path has no certificate.
UNCERTIFIED = ("start_slack",)
#: Size from which on a certificate is not read [bytes].
MOST_BYTES = 2**28


def add_certificate_flags(parser: argparse.ArgumentParser) -> None:
    """Give a parser the flags that say how far a proof goes."""
    group = parser.add_argument_group("certificate")
    group.add_argument("--gap", metavar="SHARE", type=float,
                       help=f"end the proof when the path is at most so much longer than the shortest; default {GAP:g}")
    group.add_argument("--seconds", metavar="s", type=float,
                       help=f"approximate time for the proof; what is proved then is written; default {SECONDS:g}")


def proof_limits(arguments: argparse.Namespace) -> tuple[float, float]:
    """Return gap and seconds as the flags have them, or the defaults.

    Raises:
        UsageError: one of them is none.
    """
    given = {"gap": arguments.gap, "seconds": arguments.seconds}
    for name, value in given.items():
        if value is not None and not 0 <= value < math.inf:
            raise UsageError(f"--{name} is {value:g}; give a number from 0 on")
        if value is not None and not arguments.certificate:
            print(f"dubins_rrt {arguments.command}: warning: --{name} has no effect without --certificate", file=sys.stderr)
    return GAP if arguments.gap is None else arguments.gap, SECONDS if arguments.seconds is None else arguments.seconds


def certifiable_map(problem: Problem, map_name: str) -> World:
    """Return a problem's map as the checker reads it.

    Raises:
        UsageError: paths of the problem can have no certificate.
    """
    from dubins_rrt_ros.planning.certificate.certificate import CertificateError, checked_map  # few plans need it
    try:
        return checked_map(problem, find_map_or_suggest(map_name))
    except CertificateError as error:
        raise UsageError(str(error)) from None


def write_proof(file: str, answer: Plan, world: World, gap: float, seconds: float) -> str:
    """Prove how short a plan's path is, write its certificate, and return what it claims in a sentence."""
    from dubins_rrt_ros.planning.certificate.certificate import certify, write_certificate
    assert answer.path is not None
    document = certify(answer.problem, answer.path, world, gap, seconds)
    write_certificate(file, document)
    return f"{file}: a path of {document['length']:.4f} m, and {proved(document)}"


def read_certificate(file: str | Path) -> bytes:
    """Return the JSON of a certificate; the file may be a pipe or a device, and expand to more than there is memory for.

    Raises:
        Refused: it is too large, or damaged.
        OSError: it cannot be read.
    """
    descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK)  # a pipe that nobody writes to is not waited for
    os.set_blocking(descriptor, True)
    with open(descriptor, "rb") as opened:
        data = opened.read(-1 if stat.S_ISREG(os.fstat(descriptor).st_mode) else MOST_BYTES)
    try:
        text = gzip.GzipFile(fileobj=io.BytesIO(data)).read(MOST_BYTES) if data[:2] == b"\x1f\x8b" else data
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        raise Refused(f"{NO_CERTIFICATE}: {error}") from None
    if len(text) >= MOST_BYTES:
        raise Refused(f"the file has {MOST_BYTES} bytes or more")
    return text


def proved(claim: dict[str, Any]) -> str:
    """Return the end of a sentence: what a certificate proves of all paths."""
    length, bound = claim["length"], claim["bound"]
    if bound <= 0:
        return "nothing is proved of how short others are."
    return (f"no path is shorter than {bound:.4f} m; so it is at most {100 * (length / bound - 1):.3g} % above the shortest "
            "possible.")
