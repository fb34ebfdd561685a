"""Live sessions whose client, engine or time is lost."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from starlette.websockets import WebSocket
from websockets.exceptions import ConnectionClosed

from service.sessions.keeping import Sessions
from service.sessions.session import Session
from store.store import Store

from .._jobs import bearer
from .._live import BALL, Served, engines, live, one_service, refused, serving
from .._session import Client

__all__ = ["live", "one_service"]


def test_a_lost_connection_is_taken_up_again_and_goes_on(live: Served) -> None:
    first = live.client()
    opened = first.opened()
    first.do("brush", at=[0, 0, 1], radius=0.8, stretch=[3, 3])
    first.rest()
    again = {"token": live.token, "session": opened["session"], "key": opened["key"]}
    first.socket.socket.close()  # without a word
    second = Client(live.url, **again)
    assert second.opened()["session"] == opened["session"]
    second.number = first.number
    second.until(lambda c: c.frames and c.state)
    assert second.frames[0]["base"] == 0
    assert second.x.tobytes() == first.x.tobytes()
    assert second.state["undo"] == 1
    # a second connection takes it from the first, and a stranger does not
    problem, _ = refused(Client(live.url, **{**again, "key": "guessed"}))
    assert problem["status"] == 404
    # nor does another token that came by the key, of whatever scope
    for scope in ("run", "admin"):
        other = bearer(Store.open(live.root), f"thief-{scope}", scope)["Authorization"].removeprefix("Bearer ")
        problem, _ = refused(Client(live.url, **{**again, "token": other}))
        assert (problem["status"], problem["type"]) == (404, "urn:wizen:problem:unknown-session")
    third = Client(live.url, **again)
    assert third.opened()["say"] == "opened"
    with pytest.raises(ConnectionClosed) as closed:
        second.until(lambda c: False)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 4409
    second.close()
    third.number = 10
    third.do("undo")
    third.rest()
    third.end()


def test_a_client_that_answers_no_frames_gets_two_and_then_the_newest(live: Served) -> None:
    params = {**BALL, "step": 0.01}
    client = Client(live.url, acknowledges=False, token=live.token, params=params, quality="preview")
    client.opened()
    client.ask("add", tool={"kind": "spot", "at": [0, 0, 1], "stretch": [1.5, 1.5]})
    client.ask("play", until=0.3)
    client.until(lambda c: c.state.get("working") is False)
    assert len(client.frames) <= 2
    client.acknowledges = True
    client.send(do="seen", frame=client.frames[-1]["number"])
    client.until(lambda c: not c.frames[-1]["flags"] & 2)
    assert client.frames[-1]["stage"] == pytest.approx(0.3)
    assert len(client.frames) <= 4
    client.end()


def test_an_engine_that_is_killed_is_told_of(live: Served) -> None:
    client = live.client()
    client.opened()
    client.until(lambda c: c.frames)
    (engine,) = engines()
    os.kill(engine, signal.SIGKILL)
    with pytest.raises(ConnectionClosed) as closed:
        client.until(lambda c: False)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 4500
    client.close()


@pytest.mark.slow
def test_sessions_that_nobody_uses_end(tmp_path: Path) -> None:
    """Silent ones with what was made; those whose client died after a while; and none outlives the service."""
    with serving(tmp_path / "store", session_idle=8.0, session_kept=1.0) as found:
        lost = found.client()
        assert lost.opened()["say"] == "opened"
        silent = found.client()  # whose seconds do not pass while the other one's engine starts
        assert silent.opened()["say"] == "opened"
        silent.do("brush", at=[1, 0, 0])
        lost.socket.socket.close()
        with pytest.raises(ConnectionClosed) as closed:
            silent.until(lambda c: False)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 4408
        assert silent.told[-1]["say"] == "closing"
        assert "stroke" in silent.told[-1]["toml"]
        silent.close()
        end = time.monotonic() + 20
        while engines() and time.monotonic() < end:
            time.sleep(0.1)
        assert not engines()
        assert found.client().opened()["say"] == "opened"
    assert not engines()


def test_the_word_a_client_is_sent_away_with_is_the_last_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever its engine goes on to say until it is ended."""
    had = set[Any]()
    closed = Session._close

    async def late(self: Session, client: WebSocket, status: int, why: str) -> None:
        await asyncio.sleep(1.0)
        await closed(self, client, status, why)

    monkeypatch.setattr(Sessions, "_over", lambda self, session: (408, "enough.") if session.id in had else None)
    monkeypatch.setattr(Session, "_close", late)
    with serving(tmp_path / "store") as found:
        client = found.client({**BALL, "step": 0.001})
        session = client.opened()["session"]
        client.ask("add", tool={"kind": "spot", "at": [0, 0, 1], "stretch": [1.5, 1.5]})
        client.ask("play", until=1.0)
        client.until(lambda c: len(c.frames) > 2)
        had.add(session)
        client.until(lambda c: c.told[-1]["say"] == "closing")
        frames = len(client.frames)
        with pytest.raises(ConnectionClosed):
            client.until(lambda c: False)
        assert len(client.frames) == frames
        assert client.told[-1]["say"] == "closing"


def test_nobody_waits_for_an_engine_that_does_not_save(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two that have had their time the one whose engine stands still holds up itself alone, and gets what it made.

    An engine in a long piece of work is as one that stands still.
    """
    had = set[Any]()
    monkeypatch.setattr(Sessions, "_over", lambda self, session: (408, "enough.") if session.id in had else None)
    with serving(tmp_path / "store") as found:
        still = found.client()
        first = still.opened()
        (engine,) = engines()
        other = found.client()
        second = other.opened()
        other.do("brush", at=[1, 0, 0])
        os.kill(engine, signal.SIGSTOP)
        try:
            had.update([first["session"], second["session"]])
            with pytest.raises(ConnectionClosed) as closed:
                other.until(lambda c: False)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 4408
            assert "stroke" in other.told[-1]["toml"]
            # an engine is given longer than the two seconds after which nobody looks on any more
            end = time.monotonic() + 4
            while time.monotonic() < end:
                with suppress(TimeoutError):
                    still.receive(0.5)
            assert still.told[-1]["say"] != "closing"
            # who takes the session up meanwhile is the one that gets it
            back = Client(found.url, token=found.token, session=first["session"], key=first["key"])
            with pytest.raises(ConnectionClosed) as closed:
                still.until(lambda c: False)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 4409
        finally:
            os.kill(engine, signal.SIGCONT)
        with pytest.raises(ConnectionClosed):
            back.until(lambda c: False)
        assert back.told[-1]["say"] == "closing"
        assert "thickness = 0.1" in back.told[-1]["toml"]
