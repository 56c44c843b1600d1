"""Try mutants of the checker and of the audit against the tests that need no search, and list those that none finds.

    python test/checker/mutate.py --sample 400
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from support.mutants import TESTS_OF, is_found, sample


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--module", default="", help="modules with this in their names alone")
    parser.add_argument("--sample", type=int, default=1_000_000, help="how many of each module; by default all")
    arguments = parser.parse_args()
    for module in (module for module in TESTS_OF if arguments.module in module):
        begin, found = time.perf_counter(), 0
        chosen = sample(module, arguments.sample)
        for mutant in chosen:
            if is_found(mutant):
                found += 1
            else:
                print(mutant, flush=True)
        print(f"{module}: {found} of {len(chosen)} found in {time.perf_counter() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    main()
