"""The stress list of the decay solver: every try ends well, or in a typed error."""

import pytest

from benchmarks.decay.stress import CASES, SLOW


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in CASES]
)
def test_a_try_at_breaking_it_ends_well(name):
    assert CASES[name]()
