"""Small changes of the checker and of the audit are found by tests that need no search (`mutate.py` tries all of them)."""

import pytest
from support.mutants import TESTS_OF, is_found, sample

#: Number of mutants of each module, and how many of them may be such that no verdict tells, as docs/proof.md lists them.
COUNT, ALIKE = 5, 2


@pytest.mark.slow
@pytest.mark.parametrize("module", TESTS_OF)
def test_mutants_are_found(module):
    mutants = sample(module, COUNT)
    assert len(mutants) == COUNT
    survivors = [str(mutant) for mutant in mutants if not is_found(mutant)]
    assert len(survivors) <= ALIKE, survivors
