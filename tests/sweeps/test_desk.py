"""What is asked of a live engine, without a connection."""

from __future__ import annotations

from typing import Any

import pytest

from solver import registry
from sweeps.live import desk as desk_module
from sweeps.live.desk import Desk

BALL = {"shape": "sphere", "thickness": 0.1, "tools": [], "step": 0.05}


@pytest.fixture
def brushed(monkeypatch: pytest.MonkeyPatch) -> tuple[Desk, list[Any]]:
    """A desk where no step may take more than a hundredth of a second, after a stroke; and what it says."""
    monkeypatch.setattr(desk_module, "_LONG", 0.01)
    solver, told = registry.get("growth"), list[Any]()
    desk = Desk(solver, solver.parse(BALL, None), "default", (), told.append, lambda frame: None)
    desk.begin_again({})
    desk.take({"do": "brush", "id": 1, "at": [0, 0, 1], "radius": 0.8, "stretch": [3, 3]})
    return desk, told


def test_a_step_without_end_waits_for_somebody_who_wants_it(brushed: tuple[Desk, list[Any]]) -> None:
    """What is asked again goes on from where it stood."""
    desk, told = brushed
    given_up = 0
    for number in range(2, 2000):
        if not desk.is_busy:
            break
        while desk.is_busy:
            desk.work()
        if told[-2]["say"] == "error":
            assert told[-2]["problem"]["type"] == "urn:wizen:problem:over-budget"
            assert "play" in told[-2]["problem"]["advice"]
            assert told[-1]["working"] is False
            given_up += 1
            desk.take({"do": "play", "id": number, "until": BALL["step"]})
    assert given_up > 1
    assert desk.saved()["stage"] == pytest.approx(BALL["step"])


def test_a_step_that_has_no_end_can_be_undone(brushed: tuple[Desk, list[Any]]) -> None:
    desk, told = brushed
    while desk.is_busy:
        desk.work()
    assert told[-2]["say"] == "error"
    desk.take({"do": "undo", "id": 2})
    assert [t["say"] for t in told[-2:]] == ["done", "state"]
    assert not desk.is_busy
    assert (told[-1]["undo"], told[-1]["redo"]) == (0, 1)
