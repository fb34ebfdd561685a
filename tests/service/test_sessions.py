"""Live sessions over a real server: a mushroom that is painted, replayed to the same bytes; and bad company."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import xarray as xr
from typer.testing import CliRunner
from websockets.exceptions import ConnectionClosed

from service.app import create_app
from service.cli import app
from service.sessions.keeping import Sessions
from service.settings import Settings
from solver.meshes import frame
from store.store import Store

from ._jobs import bearer
from ._session import Client
from .conftest import served

STEM = {"shape": "stem", "aspect": 3.0, "thickness": 0.08, "tools": [], "step": 0.02}
BALL = {"shape": "sphere", "thickness": 0.1, "tools": [], "step": 0.05}


class Served:
    """A service with a token."""

    def __init__(self, url: str, root: Path) -> None:
        self.url, self.root = url, root
        self.clients: list[Client] = []
        self.token = bearer(Store.open(root))["Authorization"].removeprefix("Bearer ")

    def client(self, params: dict[str, Any] | None = None, **more: Any) -> Client:
        opening = {"token": self.token, "params": BALL if params is None else params, "quality": "preview", **more}
        self.clients.append(Client(self.url, **opening))
        return self.clients[-1]

    def end(self) -> None:
        """End what a test that failed left open: its sessions would count in the next ones."""
        for client in self.clients:
            with suppress(ConnectionClosed, OSError, AssertionError):
                client.end()
        self.clients.clear()


@contextmanager
def serving(root: Path, **settings: Any) -> Iterator[Served]:
    store = Store.open(root, create=True)
    with served(create_app(Settings(store=store.root, **settings)), ws="websockets-sansio") as client:
        yield Served(str(client.base_url), root)


@pytest.fixture(scope="module")
def one_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serving(tmp_path_factory.mktemp("live") / "store", max_sessions=3, max_sessions_per_token=2) as found:
        yield found


@pytest.fixture
def live(one_service: Served) -> Iterator[Served]:
    yield one_service
    one_service.end()


def engines() -> set[int]:
    found = set()
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):  # gone, or about to
            if "sweeps.live.worker" in " ".join(child.cmdline()):
                found.add(child.pid)
    return found


def mesh(saved: dict[str, Any], folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Run the command that a session was saved with, and read its file."""
    (folder / "session.toml").write_text(saved["toml"])
    words = saved["command"].split()
    assert words[0] == "wizen"
    here = Path.cwd()
    os.chdir(folder)
    try:
        done = CliRunner().invoke(app, words[1:])
    finally:
        os.chdir(here)
    assert done.exit_code == 0, done.output
    with xr.open_dataset(folder / words[-1], engine="h5netcdf") as run:
        found = frame(run.load(), -1)
    return found.vertices, found.triangles


@pytest.mark.slow
def test_a_mushroom_is_painted_and_replayed_to_the_same_bytes(live: Served, tmp_path: Path) -> None:
    """Strokes about the tip of a stem, one of them taken back, a curve that makes the cap, a box; then the file."""
    client = live.client(STEM, fields=["elastic_strain"])
    said = client.opened()
    assert said["say"] == "opened"
    assert said["fields"] == ["elastic_strain"]
    around = [(float(np.cos(a)), float(np.sin(a))) for a in np.linspace(0, 2 * np.pi, 9)]
    brush = {"radius": 0.7, "stretch": [6.0, 3.0], "hold": 0.06}
    for c, s in around:
        client.do("brush", at=[c, s, 3.0], way=[-s, c, 0.0], **brush)
    client.ask("lift")
    client.rest()
    kept, time_then = client.x.copy(), client.frames[-1]["stage"]
    client.do("brush", at=[0.0, 0.0, 4.0], radius=0.5, stretch=[9.0, 9.0])
    client.rest()
    assert not np.array_equal(client.x, kept)
    client.do("undo")
    client.rest()
    assert client.frames[-1]["stage"] == time_then
    assert client.x.tobytes() == kept.tobytes()
    client.do("redo")
    client.rest()
    assert client.x.tobytes() != kept.tobytes()
    client.do("undo")
    ring = [[c, s, 3.0] for c, s in around[:-1]]
    curve = {"kind": "curve", "points": ring, "closed": True, "radius": 1.5, "stretch": [3.0, 1.6]}
    assert client.do("add", tool=curve)["tool"] == 1
    assert client.do("solid", solid={"kind": "ball", "centre": [0, 0, 5.5], "radius": 1.0})["solid"] == 0
    client.do("play", until=time_then + 0.2)
    client.rest()
    assert client.frames[-1]["stage"] == pytest.approx(time_then + 0.2)
    assert any(f["base"] for f in client.frames)
    assert np.ptp(client.frames[-1]["fields"][0]) > 0
    client.do("settle")
    client.rest()
    assert client.frames[-1]["flags"] == 1
    assert client.frames[-1]["residual"] <= 1e-3
    vertices, triangles = mesh(client.ask("save"), tmp_path)
    assert vertices.dtype == np.float32
    assert client.x.tobytes() == vertices.tobytes()
    assert np.array_equal(client.triangles, triangles)
    client.send(do="close")
    with pytest.raises(ConnectionClosed) as closed:
        client.until(lambda c: False)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1000


def test_thickness_is_painted_taken_back_and_replayed_to_the_same_bytes(live: Served, tmp_path: Path) -> None:
    """As pace is: the brush of docs/sessions.md, which grows nothing here but the sheet's thickness."""
    client = live.client({"shape": "disc", "thickness": 0.04, "tools": [], "step": 0.05}, fields=["sheet_thickness"])
    assert client.opened()["fields"] == ["sheet_thickness"]
    client.until(lambda c: c.frames)
    assert set(client.frames[-1]["fields"][0]) == {np.float32(0.04)}
    brush = {"radius": 0.6, "stretch": [1, 1], "kernel": "flat", "thickening": 8.0, "hold": 0.1}
    for x in (0.3, 0.4):
        client.do("brush", at=[x, 0, 0], **brush)
        client.rest()  # as docs/sessions.md asks a painter: two dabs within one step hold as long as one
    client.ask("lift")
    client.do("play", until=0.2)
    client.rest()
    painted = client.x.copy(), client.frames[-1]["fields"][0].copy()
    assert painted[1].max() == pytest.approx(0.04 * 8**0.15, rel=0.05)
    assert painted[1].min() == pytest.approx(0.04, rel=1e-6)
    client.do("undo")
    client.do("undo")
    client.rest()
    assert client.state["undo"] == 0
    assert set(client.frames[-1]["fields"][0]) == {np.float32(0.04)}
    client.do("redo")
    client.do("redo")
    client.rest()
    assert client.x.tobytes() == painted[0].tobytes()
    assert np.array_equal(client.frames[-1]["fields"][0], painted[1])
    client.do("settle")
    client.rest()
    saved = client.ask("save")
    assert "thickening = 8.0" in saved["toml"]
    vertices, triangles = mesh(saved, tmp_path)
    assert client.x.tobytes() == vertices.tobytes()
    assert np.array_equal(client.triangles, triangles)
    client.end()


def test_a_solid_around_the_whole_sheet_is_refused_and_the_session_goes_on(live: Served) -> None:
    client = live.client({"shape": "disc", "thickness": 0.05, "tools": [], "step": 0.05})
    client.opened()
    client.until(lambda c: c.frames)
    said = client.ask("solid", solid={"kind": "ball", "radius": 3})
    assert said["say"] == "error"
    assert said["problem"]["type"] == "urn:wizen:problem:invalid-geometry"
    assert said["problem"]["status"] == 422
    assert "wholly inside it, a ball" in said["problem"]["detail"]
    assert said["problem"]["advice"]
    # it lies beside, and it is painted on
    assert client.do("solid", solid={"kind": "ball", "centre": [0, 0, -3], "radius": 1})["solid"] == 0
    client.do("brush", at=[0.5, 0, 0])
    client.rest()
    assert client.frames[-1]["stage"] > 0
    assert client.state["undo"] == 2
    client.end()


def refused(client: Client) -> tuple[dict[str, Any], int]:
    """Return the problem that a client is sent away with, and the code."""
    said = client.opened()
    assert said["say"] == "error", said
    with pytest.raises(ConnectionClosed) as closed:
        client.until(lambda c: False)
    client.close()
    assert closed.value.rcvd is not None
    return said["problem"], closed.value.rcvd.code


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


def test_a_step_without_an_equilibrium_is_an_error_and_the_session_goes_on(live: Served) -> None:
    """Lengths that grow a thousandfold against all reason: whatever comes of it, it can be taken back."""
    client = live.client({**BALL, "thickness": 0.5, "step": 1.0, "imperfection": 1.0, "shape": "disc"})
    client.opened()
    client.do("add", tool={"kind": "surface", "where": {"kind": "rim", "width": 0.3}, "stretch": [10, 0.1]})
    client.until(lambda c: c.state.get("working") is False and c.told[-1]["say"] != "done")
    client.do("undo")
    client.rest()
    assert client.frames[-1]["stage"] == 0
    client.end()


def _pierced(x: np.ndarray, triangles: np.ndarray) -> int:
    """Pairs of triangles without a common corner of which an edge of one passes through the other, by volumes."""

    def side(*corners: np.ndarray) -> float:
        a, b, c, d = corners
        return float(np.sign(np.dot(np.cross(b - a, c - a), d - a)))

    def through(edge: np.ndarray, face: np.ndarray) -> bool:
        p, q = edge
        turns = {side(p, q, face[k], face[(k + 1) % 3]) for k in range(3)}
        return side(*face, p) * side(*face, q) < 0 and len(turns) == 1

    corners = x.astype(float)[triangles]
    pairs = [(a, b) for b in range(len(triangles)) for a in range(b) if not {*triangles[a]} & {*triangles[b]}]
    return sum(
        any(
            through(one[[k, (k + 1) % 3]], other) for k in range(3) for one, other in (corners[[a, b]], corners[[b, a]])
        )
        for a, b in pairs
    )


@pytest.mark.slow
def test_a_session_says_where_its_sheet_passes_through_itself(live: Served) -> None:
    """Two squares that cross, as they may without contact, and the ball, which crosses nothing."""
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    points = square + [[x + 0.1, 0.45, y - 0.4] for x, y, _ in square]
    mesh = {"points": points, "faces": [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]}
    for params in ({"mesh": mesh, "tools": [], "contact": 0.0, "step": 0.05}, BALL):
        client = live.client(params)
        client.opened()
        assert client.do("add", tool={"kind": "surface", "where": {"kind": "everywhere"}, "stretch": [1.2, 1.2]})
        client.rest()
        client.until(lambda c: c.state.get("crossings") is not None)
        found = _pierced(client.x, client.triangles) if "mesh" in params else 0
        assert client.state["crossings"] == found
        assert (found > 0) == ("mesh" in params)
        assert any(said.get("crossings", 0) is None for said in client.told), "nothing is said of a shape on its way"
        client.send(do="close")
        client.close()


def test_quality_grows_the_same_script_on_another_mesh(live: Served) -> None:
    client = live.client()
    client.opened()
    client.do("brush", at=[0, 0, 1], radius=0.8, stretch=[3, 3])
    client.rest()
    coarse = client.frames[-1]
    assert client.do("quality", quality="default")["say"] == "done"
    client.rest()
    assert client.frames[-1]["vertices"] > 2 * coarse["vertices"]
    assert client.frames[-1]["stage"] == coarse["stage"]
    saved = client.ask("save")
    assert saved["say"] == "saved"
    assert saved["quality"] == "default"
    client.end()


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
        finally:
            os.kill(engine, signal.SIGCONT)
        with pytest.raises(ConnectionClosed):
            still.until(lambda c: False)
        assert still.told[-1]["say"] == "closing"
        assert "thickness = 0.1" in still.told[-1]["toml"]


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


def test_a_solver_s_page_says_what_its_sessions_understand(client: Any) -> None:
    page = client.get("/v1/solvers/growth").json()["session"]
    assert page["address"] == "/v1/sessions/growth"
    assert set(page["actions"]) == {"brush", "lift", "add", "solid", "end"}
    assert "stretch" in page["actions"]["brush"]["properties"]
    assert client.get("/v1/solvers/wood").json()["session"] is None
    json.dumps(page)
