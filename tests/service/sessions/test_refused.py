"""What live sessions refuse, and what they say then: strangers, nonsense, wrong actions, more than there may be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from service.app import create_app
from service.settings import Settings
from store.store import Store

from .._jobs import bearer
from .._live import BALL, Served, engines, live, one_service, refused, serving
from .._session import Client
from ..conftest import served

__all__ = ["live", "one_service"]


def test_who_is_not_let_in_is_told_why(live: Served) -> None:
    reader = bearer(Store.open(live.root), "reader", "read")["Authorization"].removeprefix("Bearer ")
    tries: list[tuple[dict[str, Any], str, int, str]] = [
        ({"token": None}, "growth", 401, "unauthorized"),
        ({"token": reader}, "growth", 403, "forbidden"),
        ({}, "growht", 404, "unknown-solver"),
        ({}, "wood", 422, "invalid-input"),
        ({"params": {"thicknes": 0.1}}, "growth", 422, "invalid-input"),
        ({"params": {"shape": "pear"}}, "growth", 422, "invalid-input"),
        ({"params": [1]}, "growth", 422, "invalid-input"),
        ({"preset": "pumpkn"}, "growth", 422, "invalid-input"),
        ({"quality": "best"}, "growth", 422, "invalid-input"),
        ({"fields": ["colour"]}, "growth", 422, "invalid-input"),
        ({"fields": "red"}, "growth", 422, "invalid-input"),
        ({"paramz": {}}, "growth", 422, "invalid-input"),
        ({"session": "s_1", "key": "x"}, "growth", 404, "unknown-session"),
        ({"params": {"shape": "sphere", "attached": [{"where": {"kind": "rim", "width": 0.1}}]}}, "growth", 422, ""),
    ]
    for wrong, solver, status, code in tries:
        again = "session" in wrong
        opening = {"token": live.token} | ({} if again else {"params": BALL}) | wrong
        problem, closed = refused(Client(live.url, solver, **opening))
        assert problem["status"] == status, (wrong, problem)
        assert closed == 4000 + status
        assert problem["detail"]
        assert problem["advice"] or "thicknes" in str(wrong) or "shape" in str(wrong)
        assert problem["type"].endswith(code)
    assert not engines()


def test_what_is_no_message_ends_the_connection_with_a_reason(live: Served) -> None:
    half = '{"do": "open", "token": "\\ud800"}'
    deep = '{"do": "open", "params": ' + '{"a":' * 300 + "1" + "}" * 301
    long = '{"do": "open", "params": {"seed": ' + "9" * 30 + "}}"
    for text in ("", "{", "[]", '{"do": NaN}', "[" * 100_000, b"bytes", half, deep, long):
        client = Client(live.url)
        client.socket.send(text)
        problem, closed = refused(client)
        assert (problem["type"], closed) == ("urn:wizen:problem:invalid-query", 4422)


def test_wrong_actions_change_nothing_and_say_what_to_change(live: Served) -> None:
    client = live.client()
    client.opened()
    client.until(lambda c: c.frames)
    before = client.x.copy()
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"do": "paint"}, "Known"),
        ({"do": 3}, "Known"),
        ({"do": "brush"}, "at"),
        ({"do": "brush", "at": [50, 0, 0]}, "nearest point"),
        ({"do": "brush", "at": [1, 0, 0], "strech": [2, 2]}, "stretch"),
        ({"do": "brush", "at": [1, 0, 0], "radius": -1}, "radius"),
        ({"do": "brush", "at": [1e999, 0, 0]}, ""),
        ({"do": "end", "tool": 7}, "no tool 7"),
        ({"do": "end"}, "either"),
        ({"do": "undo"}, "nothing to undo"),
        ({"do": "redo"}, "nothing"),
        ({"do": "undo", "steps": 3}, "takes nothing"),
        ({"do": "play", "until": -1}, "until"),
        ({"do": "play", "pace": "fast"}, "pace"),
        ({"do": "quality", "quality": 3}, "preview"),
        ({"do": "add", "tool": {"kind": "spott"}}, "tool"),
        ({"do": "_do_undo"}, "Known"),
    ]
    for message, hint in wrong[:6] + wrong[7:]:
        said = client.ask(**message)
        assert said["say"] == "error", message
        assert hint in f"{said['problem']['detail']} {said['problem']['advice']}", said
    client.send(do="undo")  # without an id
    client.until(lambda c: c.told[-1]["say"] == "error" and c.told[-1]["id"] is None)
    assert client.state["undo"] == 0
    client.do("brush", at=[1, 0, 0])
    client.rest()
    assert not np.array_equal(client.x, before)
    client.end()


def test_more_sessions_than_may_be_are_refused_and_room_comes_back(live: Served) -> None:
    other = bearer(Store.open(live.root), "other")["Authorization"].removeprefix("Bearer ")
    third = bearer(Store.open(live.root), "third")["Authorization"].removeprefix("Bearer ")
    open_ones = [live.client(), live.client()]
    assert [one.opened()["say"] for one in open_ones] == ["opened"] * 2
    problem, closed = refused(live.client())
    assert (problem["type"], closed) == ("urn:wizen:problem:too-many-sessions", 4429)
    open_ones.append(live.client(token=other))
    assert open_ones[-1].opened()["say"] == "opened"
    problem, closed = refused(live.client(token=third))
    assert (problem["type"], closed) == ("urn:wizen:problem:too-many-sessions", 4429)
    assert len(engines()) == 3
    # another process over the same store counts the same sessions
    settings = Settings(store=live.root, max_sessions=3, max_sessions_per_token=2)
    with served(create_app(settings), ws="websockets-sansio") as second:
        problem, closed = refused(Client(str(second.base_url), token=third, params=BALL, quality="preview"))
        assert (problem["type"], closed) == ("urn:wizen:problem:too-many-sessions", 4429)
    for one in open_ones:
        one.end()
    assert not engines()
    last = live.client(token=third)
    assert last.opened()["say"] == "opened"
    last.end()


def test_seconds_of_sessions_count(tmp_path: Path) -> None:
    with serving(tmp_path / "store", max_seconds_per_token=0.01) as found:
        client = found.client()
        assert client.opened()["say"] == "opened"
        client.do("brush", at=[1, 0, 0])
        client.rest()
        problem, closed = refused(found.client())
        assert closed == 4429
        assert "spent" in problem["detail"]
        client.end()
