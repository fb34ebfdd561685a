"""Places and directions that users give: those that are none, or whose squares are no numbers, are refused."""

from __future__ import annotations

from typing import Any

import pytest

from solver import registry
from solver.contract import InvalidInput

#: What has a direction, at {}, beside what it needs.
DIRECTIONS: list[tuple[str, dict[str, Any], tuple[str | int, ...]]] = [
    ("growth", {"solids": [{"kind": "plane", "point": [0, 0, -2]}]}, ("solids", 0, "normal")),
    ("growth", {"tools": [{"kind": "spot", "at": [0, 0, 1]}]}, ("tools", 0, "frame")),
    ("growth", {"tools": [{"kind": "curve", "apex": {"at": [0, 0, 1]}}]}, ("tools", 0, "apex", "frame")),
    ("growth", {"tools": [{"kind": "surface", "where": {"kind": "everywhere"}}]}, ("tools", 0, "frame")),
    ("decay", {"cuts": [{}]}, ("cuts", 0, "normal")),
]
#: What has a place.
PLACES: list[tuple[str, dict[str, Any], tuple[str | int, ...]]] = [
    ("growth", {"solids": [{"kind": "plane"}]}, ("solids", 0, "point")),
    ("growth", {"solids": [{"kind": "ball"}]}, ("solids", 0, "centre")),
    ("growth", {"tools": [{"kind": "spot"}]}, ("tools", 0, "at")),
    (
        "growth",
        {"tools": [{"kind": "surface", "where": {"kind": "ball", "radius": 1}}]},
        ("tools", 0, "where", "centre"),
    ),
    ("decay", {"cuts": [{"normal": [0, 0, 1]}]}, ("cuts", 0, "point")),
    ("decay", {"neighbours": [{}]}, ("neighbours", 0, "position")),
]


def _with(values: Any, at: tuple[str | int, ...], value: Any) -> Any:
    head, *rest = at
    inner = _with(values[head] if isinstance(head, int) else values.get(head), tuple(rest), value) if rest else value
    if isinstance(head, int):
        return [*values[:head], inner, *values[head + 1 :]]
    return {**values, head: inner}


@pytest.mark.parametrize(("solver", "values", "at"), DIRECTIONS, ids=lambda one: str(one))
@pytest.mark.parametrize("direction", [(0, 0, False), (1e-200, 0, 0), (-1e-320, 1e-320, 0)], ids=str)
def test_what_has_no_direction_is_refused(solver: str, values: Any, at: Any, direction: tuple[float, ...]) -> None:
    with pytest.raises(InvalidInput, match="no direction: give one of any length"):
        registry.get(solver).parse(_with(values, at, direction))
    registry.get(solver).parse(_with(values, at, (1e-3, 2e-3, 0)))


@pytest.mark.parametrize(("solver", "values", "at"), [*DIRECTIONS, *PLACES], ids=lambda one: str(one))
@pytest.mark.parametrize("far", [(1e200, -1e200, 0), (1e308, 0, 1e308)], ids=str)
def test_what_overflows_is_refused(solver: str, values: Any, at: Any, far: tuple[float, ...]) -> None:
    with pytest.raises(InvalidInput, match="less than or equal to 1000000"):
        registry.get(solver).parse(_with(values, at, far))


def test_a_weight_is_one_at_most_each_way() -> None:
    growth, held = registry.get("growth"), [{"where": {"kind": "rim", "width": 0.1}}]
    assert growth.parse({"shape": "disc", "attached": held, "gravity": (0, 0, -1)})
    with pytest.raises(InvalidInput, match=r"gravity\.2: Input should be greater than or equal to -1"):
        growth.parse({"shape": "disc", "attached": held, "gravity": (0, 0, -1e200)})
