"""Certify random small problems, let the checker judge the certificates, and then claims that were made false.

    python test/checker/spoil.py --count 2000

Every certificate must be accepted, and every claim that cannot hold be refused. Spoils that can leave a claim true are counted.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from support.certificates import MAY_HOLD, SPOILS, opened, random_certified, spoiled, too_near, walled

from dubins_rrt_ros.checker.check import Refused, check
from dubins_rrt_ros.planning.certificate.certificate import write_certificate


def is_accepted(document, map_file, folder):
    """True if the checker accepts a document."""
    write_certificate(folder / "path.cert", document)
    try:
        check(folder / "path.cert", map_file)
    except Refused:
        return False
    return True


def spoils_of(certified, folder, rng):
    """Yield the names of what was made false, with document and map."""
    for name in SPOILS:
        if len(certified.document["boxes"]) > 0 and (name != "two levels swapped" or len(certified.document["levels"]) > 1):
            yield name, spoiled(certified, name, rng), certified.file
    yield "2 mm too near", too_near(certified), certified.file
    yield "a wall added", *walled(certified, folder / "walled")
    if len(certified.document["boxes"]) > 0:
        yield "walls removed", *opened(certified, folder / "opened")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    accepted, refused, made, wrong = Counter(), Counter(), 0, []
    begin = time.perf_counter()
    for seed in range(arguments.seed, arguments.seed + 100 * arguments.count):
        if made == arguments.count:
            break
        rng = np.random.default_rng(seed)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            certified = random_certified(rng, folder)
            if certified is None:
                continue
            made += 1
            if not is_accepted(certified.document, certified.file, folder):
                wrong.append(f"seed {seed}: a certificate is refused")
            for spoil, document, map_file in spoils_of(certified, folder, rng):
                holds = is_accepted(document, map_file, folder)
                (accepted if holds else refused)[spoil] += 1
                if holds and spoil not in MAY_HOLD:
                    wrong.append(f"seed {seed}: {spoil} is accepted")
    print(f"{made} certificates in {time.perf_counter() - begin:.0f} s")
    for spoil in sorted({*accepted, *refused}):
        print(f"  {spoil}: {refused[spoil]} refused, {accepted[spoil]} accepted")
    print(*wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
