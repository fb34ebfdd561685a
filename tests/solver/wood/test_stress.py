"""The stress list of the wood solver: every try ends well, or in a typed error."""

import pytest

from benchmarks.wood_stress import CASES, tried


@pytest.mark.parametrize("name", CASES)
def test_a_try_at_breaking_it_ends_well(name):
    assert tried(name)
