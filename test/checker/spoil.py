"""Certify random small problems, let the checker judge the certificates, and then claims that were made false.

    python test/checker/spoil.py --count 2000

Every certificate must be accepted, and every spoil that makes a claim false be refused. Those that leave it true are counted.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from support.certificates import random_certified, refusal
from support.spoils import FALSE, SPOILS, is_true

#: Share of the certificates that are to have levels at least.
LEAST_SHARE = 0.2


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=2.0, help="time for each proof at most")
    arguments = parser.parse_args()
    accepted, refused, made, boxes, wrong = Counter(), Counter(), 0, [], []
    begin = time.perf_counter()
    for seed in range(arguments.seed, arguments.seed + 1000 * arguments.count):
        if made == arguments.count:
            break
        rng = np.random.default_rng(seed)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            certified = random_certified(rng, folder / "map", arguments.seconds)
            if certified is None:
                continue
            made += 1
            boxes.append(sum(map(len, certified.document["boxes"])))
            if said := refusal(certified, folder):
                wrong.append(f"seed {seed}: a certificate is refused: {said}")
            for kind, spoil in SPOILS.items():
                spoilt = spoil(certified, rng, folder)
                if spoilt is None:
                    continue
                holds = refusal(spoilt, folder) == ""
                (accepted if holds else refused)[kind] += 1
                if holds and (kind in FALSE or not is_true(spoilt)):
                    wrong.append(f"seed {seed}: {kind} is accepted")
    if sum(map(bool, boxes)) < LEAST_SHARE * made:
        wrong.append("hardly any certificate has levels, so that hardly anything was judged: give --seconds")
    print(f"{made} certificates in {time.perf_counter() - begin:.0f} s, {np.mean(np.array(boxes) == 0):.0%} without levels, "
          f"{np.mean(np.array(boxes) <= 60):.0%} of at most 60 boxes")
    for kind in SPOILS:
        print(f"  {kind}: {refused[kind]} refused, {accepted[kind]} accepted")
    print(*wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
