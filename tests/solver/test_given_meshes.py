"""Meshes that users give name vertices that are there, whatever numbers they are."""

from __future__ import annotations

from typing import Any

import pytest

from solver import registry
from solver.contract import InvalidInput

POINTS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


def given(number: int) -> dict[str, Any]:
    return {"points": POINTS, "faces": [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, number]]}


WAYS: dict[str, tuple[str, Any]] = {
    "a sheet": ("growth", lambda mesh: {"mesh": mesh}),
    "a solid": ("growth", lambda mesh: {"solids": [{"kind": "mesh", "mesh": mesh, "centre": [9, 9, 9]}]}),
    "a fruit": ("decay", lambda mesh: {"mesh": mesh}),
    "a hammer": ("wood", lambda mesh: {"bodies": [{"kind": "mesh", "mesh": mesh, "path": [[0, 0, 0, 0.5]]}]}),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("number", [4, -1, 2**31, -(2**70), 2**70])
def test_a_vertex_that_is_not_there_is_refused(way: str, number: int) -> None:
    """An array holds no number of more than 64 bits: one that was made of them first ended as an internal error."""
    solver, params = WAYS[way]
    with pytest.raises(InvalidInput, match=r"names a vertex that is not there: they are numbered 0 to 3"):
        registry.get(solver).parse(params(given(number)))


@pytest.mark.parametrize("way", ["a sheet", "a solid", "a fruit"])
def test_one_that_is_there_is_taken(way: str) -> None:
    solver, params = WAYS[way]
    registry.get(solver).parse(params(given(3)))
