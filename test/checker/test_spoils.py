"""Claims of recorded certificates made false in many ways: the checker refuses each, but for those that stay true."""

import numpy as np
import pytest
from support.certificates import recorded, recorded_names, refusal
from support.spoils import FALSE, SPOILS, is_true

#: Number of spoils of each kind in a short test, and in a slow one.
FEW, MANY = 4, 40


def spoiled(kind, count, folder):
    """Yield certificates that are spoilt in one way, each of those that are recorded in turn."""
    made, names = 0, recorded_names()
    for seed in range(20 * count):
        name = names[seed % len(names)]
        spoilt = SPOILS[kind](recorded(name), np.random.default_rng(seed), folder)
        if spoilt is not None:
            yield f"{name}, seed {seed}", spoilt
            made += 1
        if made == count:
            return
    raise AssertionError(f"only {made} of {count}")


def judge(kind, count, folder):
    accepted = [(name, is_true(spoilt)) for name, spoilt in spoiled(kind, count, folder) if refusal(spoilt, folder) == ""]
    assert [name for name, holds in accepted if kind in FALSE or not holds] == []


@pytest.mark.parametrize("name", recorded_names())
def test_recorded_certificates_hold(name, tmp_path):
    assert refusal(recorded(name), tmp_path) == ""


@pytest.mark.parametrize("kind", SPOILS)
def test_what_is_false_is_refused(kind, tmp_path):
    judge(kind, FEW, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", SPOILS)
def test_what_is_false_is_refused_again_and_again(kind, tmp_path):
    judge(kind, MANY, tmp_path)


