"""Certificates of paths, as commands write them."""

import argparse

from dubins_rrt_ros.planning import Plan

from .parser import UsageError
from .request import find_map_or_suggest

#: Gap down to which the proof goes, and approximate time for it [s].
GAP, SECONDS = 0.005, 30.0


def add_certificate_flags(parser: argparse.ArgumentParser) -> None:
    """Give a parser the flags that say how far a proof goes."""
    group = parser.add_argument_group("certificate")
    group.add_argument("--gap", metavar="SHARE", type=float, default=GAP,
                       help=f"end the proof when the path is at most so much longer than the shortest; default {GAP:g}")
    group.add_argument("--seconds", metavar="s", type=float, default=SECONDS,
                       help=f"approximate time for the proof; what is proved then is written; default {SECONDS:g}")


def write_proof(file: str, answer: Plan, map_name: str, gap: float, seconds: float) -> str:
    """Prove how short a plan's path is, write its certificate, and return what it claims in a sentence."""
    from dubins_rrt_ros.planning.certificate.certificate import CertificateError, certify, write_certificate  # few plans need it
    assert answer.path is not None
    try:
        document = certify(answer.problem, answer.path, find_map_or_suggest(map_name), gap, seconds)
    except CertificateError as error:
        raise UsageError(str(error)) from None
    write_certificate(file, document)
    return (f"{file}: no path is shorter than {document['bound']:.4f} m; the path, {document['length']:.4f} m, is proved to be "
            f"at most {100 * document['gap']:.3g} % above the shortest possible.")
