"""The list of mutations does not rot: each change still fits its file and names tests that are there."""

from __future__ import annotations

import ast
from collections import Counter

import pytest

from .listed import ROOT, Mutation, files_of, listed

LISTED = listed()


def test_there_are_enough_over_all_floors_and_no_two_alike() -> None:
    assert len(LISTED) >= 150
    assert max(Counter(m.name for m in LISTED).values()) == 1
    assert len({(m.file, m.old, m.new) for m in LISTED}) == len(LISTED)
    places = Counter(
        tuple(m.file.split("/")[:2]) if m.file.startswith("solver/") else m.file.split("/")[0] for m in LISTED
    )
    for solver in ("decay", "dehydration", "growth", "wood"):
        assert places["solver", solver] >= 10, solver
    for floor in ("store", "sweeps", "service"):
        assert places[floor] >= 10, floor


@pytest.mark.parametrize("mutation", LISTED, ids=lambda m: m.name)
def test_a_mutation_fits_its_file(mutation: Mutation) -> None:
    """The old text is there exactly once, the new text is Python, and the tests exist and say why."""
    ast.parse(mutation.applied(mutation.path.read_text()))
    assert mutation.why
    files = files_of(mutation.tests)
    assert files
    for path in files:
        assert path.is_file(), path.relative_to(ROOT)
