"""The stress list of growth: every try ends well, or in a typed error."""

import numpy as np
import pytest

from benchmarks.growth.crossings import crossings
from benchmarks.growth.stress import CASES, SLOW


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in CASES]
)
def test_a_try_at_breaking_it_ends_well(name):
    assert CASES[name]()


def test_crossings_are_edges_that_pass_through_triangles():
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.2, 0.2, 1], [0.9, 0.9, 1.0]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    # one edge of the second passes through the first; one of the first leaves through the second
    assert crossings(x, faces) == 2
    x[3:] += [5, 0, 0]
    assert crossings(x, faces) == 0
