"""Words of a solver for the outside: stages by their own digits."""

from __future__ import annotations

import re

import pytest

from service.errors import InvalidQuery
from service.vocabulary import row_of

STAGES = (0.1, 0.123456789, 0.3)


def test_stages_that_are_advised_are_found():
    with pytest.raises(InvalidQuery) as refused:
        row_of(STAGES, 0.2, "run")
    (wrong,) = refused.value.wrong
    assert (wrong.name, wrong.detail) == ("stage", "the run has no stage 0.2")
    advised = [float(word.rstrip(".")) for word in re.findall(r"[\d.]+", wrong.advice)]
    assert [row_of(STAGES, stage) for stage in advised] == [0, 1, 2]


@pytest.mark.parametrize("stage", [float("nan"), float("inf"), 1e308, 0.1234567])
def test_what_is_no_stage_is_not_the_nearest_one(stage):
    with pytest.raises(InvalidQuery, match="no stage"):
        row_of(STAGES, stage)
