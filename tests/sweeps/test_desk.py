"""What is asked of a live engine, without a connection."""

from __future__ import annotations

import json
import os
import struct
import threading
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest

from solver import registry
from sweeps.live import desk as desk_module
from sweeps.live import screen as screen_module
from sweeps.live import worker
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


def test_play_goes_by_whole_steps_and_less_than_one_is_refused() -> None:
    """What would grow nothing is no gesture, and is not said to be done."""
    solver, told = registry.get("growth"), list[Any]()
    desk = Desk(solver, solver.parse(BALL, None), "preview", (), told.append, lambda frame: None)
    desk.begin_again({})
    desk.take({"do": "play", "id": 1, "until": 0.13})
    desk.finish()
    assert desk.saved()["stage"] == pytest.approx(0.1)
    desk.take({"do": "play", "id": 2, "until": 0.14})
    refused = next(said for said in told if said["say"] == "error")
    assert refused["id"] == 2
    assert refused["problem"]["detail"].startswith("until: growth time 0.14 does not come any more: it is 0.1, and at")
    assert "at least 0.15" in refused["problem"]["detail"]
    assert "`undo` goes back" in refused["problem"]["advice"]
    assert told[-1] == refused
    desk.take({"do": "play", "id": 9, "until": 0.5, "pace": -1})
    assert told[-1]["problem"]["detail"] == "pace: it is above 0."
    desk.take({"do": "play", "id": 3, "until": 0.15})
    desk.finish()
    assert desk.saved()["stage"] == pytest.approx(0.15)
    assert max(said["undo"] for said in told if said["say"] == "state") == 2


def test_a_step_that_has_no_end_can_be_undone(brushed: tuple[Desk, list[Any]]) -> None:
    desk, told = brushed
    while desk.is_busy:
        desk.work()
    assert told[-2]["say"] == "error"
    desk.take({"do": "undo", "id": 2})
    assert [t["say"] for t in told[-2:]] == ["done", "state"]
    assert (told[-1]["undo"], told[-1]["redo"]) == (0, 1)
    # nothing is left to do but to show it, at once or when the next frame may be sent
    for _ in range(3):
        if desk.is_busy:
            desk.work()
    assert not desk.is_busy
    assert desk.saved()["stage"] == 0


def test_a_step_is_shown_on_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames before its end have flag 4, the input that they lead to, and cost what it cost until the first of them."""
    monkeypatch.setattr(desk_module, "_SLICE", 0.0)
    monkeypatch.setattr(screen_module, "_UNDERWAY", 0.0)
    solver, frames = registry.get("growth"), list[bytes]()
    desk = Desk(solver, solver.parse({**BALL, "step": 1.0}, None), "preview", (), lambda told: None, frames.append)
    desk.begin_again({})
    desk.work()
    desk.take({"do": "seen", "frame": 1})
    desk.take({"do": "brush", "id": 7, "at": [0, 0, 1], "radius": 0.8, "stretch": [1.5, 1.5]})
    while desk.is_busy:
        desk.work()
        desk.take({"do": "seen", "frame": len(frames)})
    told = [struct.unpack_from("<dfIfI", frame, 40) for frame in frames]
    stages, residuals, inputs, spent, flags = zip(*told, strict=True)
    assert len(frames) > 3
    assert set(flags[1:-1]) == {2 | 4}
    assert flags[-1] == 2
    assert (stages[0], set(stages[1:])) == (0.0, {1.0})
    assert (inputs[0], set(inputs[1:])) == (0, {7})
    assert residuals[-1] < min(residuals[1:-1])
    assert 0 < spent[1] < spent[-1]
    assert set(spent[2:-1]) <= {0.0}


def test_a_client_that_takes_nothing_in_has_no_glimpses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desk_module, "_SLICE", 0.0)
    monkeypatch.setattr(screen_module, "_UNDERWAY", 0.0)
    solver, frames = registry.get("growth"), list[bytes]()
    desk = Desk(solver, solver.parse({**BALL, "step": 1.0}, None), "preview", (), lambda told: None, frames.append)
    desk.begin_again({})
    desk.work()
    desk.take({"do": "brush", "id": 1, "at": [0, 0, 1], "radius": 0.8, "stretch": [1.5, 1.5]})
    while desk.is_busy:
        desk.work()
    assert len(frames) == 2
    desk.take({"do": "seen", "frame": 1})
    desk.work()
    assert struct.unpack_from("<I", frames[-1], 60) == (2,)


class _Piece(NamedTuple):
    """An engine's process as threads, which is in a piece of work that has no end."""

    told: Any
    answers: Any
    free: threading.Event
    taken: list[Any]


@pytest.fixture
def piece() -> Iterator[_Piece]:
    """Its work begins with the first message, and ends when it is let go."""
    working, free, taken = threading.Event(), threading.Event(), list[Any]()

    class Deaf:
        is_busy = is_waiting = held = False

        def take(self, message: Any) -> None:
            taken.append(message)
            self.is_busy = True

        def work(self) -> None:
            working.set()
            free.wait(60)

        def saved(self) -> dict[str, Any]:
            return {"toml": f"after {len(taken)}"}

    (theirs, told), (answers, ours) = os.pipe(), os.pipe()
    with (
        os.fdopen(theirs, "rb") as stream,
        os.fdopen(told, "wb", 0) as telling,
        os.fdopen(answers, "rb") as hearing,
        os.fdopen(ours, "wb") as out,
    ):
        serving = threading.Thread(target=worker._serve, args=(Deaf(), stream, worker._Out(out)))
        serving.start()
        telling.write(worker.packet(b"M", b'{"do": "settle"}'))
        assert working.wait(60)
        yield _Piece(telling, hearing, free, taken)
        free.set()
        telling.close()
        serving.join(60)
        assert not serving.is_alive()


def test_what_was_made_is_saved_in_the_middle_of_a_piece_of_work(piece: _Piece) -> None:
    """One of a large mesh takes longer than the service waits before it sends a client away with what it made."""
    piece.told.write(worker.packet(b"M", b'{"do": "undo"}'))
    piece.told.write(worker.packet(b"C", b'"save"'))
    letter, length = b"", 0
    answered = threading.Event()

    def hear() -> None:
        nonlocal letter, length
        while letter != b"A":
            length, letter = struct.unpack("<Ic", piece.answers.read(5))
            said.append(json.loads(piece.answers.read(length)))
        answered.set()

    said: list[Any] = []
    threading.Thread(target=hear, daemon=True).start()
    assert answered.wait(30)
    assert said[-1] == {"toml": "after 1"}  # what came meanwhile waits for its turn
    assert piece.taken == [{"do": "settle"}]
