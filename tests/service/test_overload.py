"""More requests than time, heads without end, connections without requests: each is told so, and others are served."""

from __future__ import annotations

import heapq
import random
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn

from service.app import create_app
from service.limits import connections, waiting
from service.limits.admission import Admission, Load
from service.limits.clients import address, client_of
from service.limits.connections import GuardedProtocol
from service.settings import Settings, page
from service.shapes.turns import Turns
from store.tokens import Tokens

from ._asking import ROOT, checked, until
from .conftest import client_of as service_over


class Station:
    """One server, first come first served, in time of its own; `cost(client)` [s] is what a request takes."""

    def __init__(self, load: Load, clock: list[float], cost: Callable[[str], float]) -> None:
        self.load, self.clock, self.cost = load, clock, cost
        self.free_at = 0.0
        self.leaving: list[tuple[float, str]] = []
        self.waited: list[tuple[str, float]] = []
        self.refused: Counter[str] = Counter()

    def pass_until(self, moment: float) -> None:
        while self.leaving and self.leaving[0][0] <= moment:
            self.clock[0], client = heapq.heappop(self.leaving)
            self.load.leave(client)
        self.clock[0] = moment

    def ask(self, moment: float, client: str) -> None:
        self.pass_until(moment)
        if self.load.refused(client) is not None:
            self.refused[client] += 1
            return
        self.load.enter()
        self.free_at = max(self.free_at, moment) + self.cost(client)
        heapq.heappush(self.leaving, (self.free_at, client))
        self.waited.append((client, self.free_at - moment))


def station(cost: Callable[[str], float], longest: float = 1.0) -> Station:
    clock = [0.0]
    return Station(Load(8, longest, lambda: clock[0]), clock, cost)


def flood(at: Station, rates: dict[str, float], seconds: float) -> None:
    """Let clients ask at their mean rates [1/s], at random moments."""
    chance = random.Random(1)
    moments = []
    for client, rate in rates.items():
        moment = 0.0
        while (moment := moment + chance.expovariate(rate)) < seconds:
            moments.append((moment, client))
    for moment, client in sorted(moments):
        at.ask(moment, client)


@pytest.mark.parametrize("mean", [0.002, 0.01, 0.04])
def test_twice_the_peak_is_served_at_the_peak_s_rate_and_nobody_waits(mean: float) -> None:
    chance = random.Random(2)
    at = station(lambda client: chance.expovariate(1 / mean))
    flood(at, {"all": 2 / mean}, 60.0)
    waits = sorted(wait for _, wait in at.waited)
    assert len(waits) >= 0.9 * 60 / mean
    assert waits[int(0.99 * len(waits))] < 2.0


def test_below_the_peak_nobody_is_refused() -> None:
    at = station(lambda client: 0.01)
    flood(at, {"all": 70.0}, 60.0)
    assert not at.refused


def test_a_flood_leaves_room_for_the_others() -> None:
    at = station(lambda client: 0.02)
    flood(at, {"flood": 500.0, "honest": 5.0, "other": 5.0}, 60.0)
    assert at.refused["flood"] > 20000
    honest = [wait for client, wait in at.waited if client == "honest"]
    assert at.refused["honest"] <= 0.02 * (len(honest) + at.refused["honest"])
    assert len(honest) > 250
    # what is left over is the flood's: it may have all that nobody else wants
    assert sum(client == "flood" for client, _ in at.waited) > 0.8 * 60 / 0.02


def test_shares_count_work_not_requests() -> None:
    """A client of few dear requests has no more of the time than one of many cheap ones."""
    at = station(lambda client: 0.2 if client == "dear" else 0.01)
    flood(at, {"dear": 50.0, "cheap": 200.0}, 120.0)
    work = {name: sum(c == name for c, _ in at.waited) * at.cost(name) for name in ("dear", "cheap")}
    assert 0.15 < work["cheap"] / sum(work.values()) < 0.85


def test_one_slow_request_stops_nobody() -> None:
    """A table that took ten seconds to open says nothing of the shapes that follow."""
    first = [10.0]
    at = station(lambda client: first.pop() if first else 0.01)
    flood(at, {"all": 20.0}, 60.0)
    assert sum(at.refused.values()) < 0.2 * len(at.waited)


def test_what_is_refused_after_all_is_no_work_done() -> None:
    """Counted, it said that the service was fast: the more was refused further in, the more was let in."""
    clock = [0.0]
    load = Load(1, 1.0, lambda: clock[0])
    for _ in range(100):
        for _ in range(5):
            load.enter()
        for _ in range(4):
            load.leave("all", is_done=False)
        clock[0] += 0.01
        load.leave("all")
    assert load.under_way == 0
    assert load.delay == pytest.approx(0.01)


@pytest.mark.parametrize(("status", "is_work"), [(200, True), (422, True), (503, False)])
def test_an_answer_that_says_no_is_no_work_done(tmp_path: Path, status: int, is_work: bool) -> None:
    async def says(scope: Any, receive: Any, send: Any) -> None:
        time.sleep(0.01)
        await send({"type": "http.response.start", "status": status, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    load = Load(8, 1.0)
    with listening(Admission(says, load, Tokens(tmp_path))) as port:
        talk(port, b"GET /v1/shapes/x HTTP/1.0\r\n\r\n")
    assert load.under_way == 0
    assert (load.delay > 0.005) == is_work


def test_clients_have_names(tmp_path: Path) -> None:
    tokens = Tokens(tmp_path)

    def named(host: str, *headers: tuple[bytes, bytes]) -> str:
        return client_of({"client": (host, 1), "headers": headers}, tokens)

    assert named("10.0.0.1") == "10.0.0.1" != named("10.0.0.2")
    assert named("2001:db8::1") == named("2001:db8::ffff") != named("2001:db8:0:1::1")
    assert address("::ffff:10.0.0.1") == "10.0.0.1"
    secrets = [tokens.create(name, ["read"])[1] for name in ("one", "two")]
    one, two = ((b"authorization", f"Bearer {secret}".encode()) for secret in secrets)
    assert named("10.0.0.1", one) == named("10.0.0.2", one) != named("10.0.0.1", two)
    assert secrets[0] not in named("10.0.0.1", one)
    # whoever makes tokens up is one client
    for made_up in (b"Bearer x", b"Bearer y", b"Basic abc", b"", b"Bearer \xff", f"Basic {secrets[0]}".encode()):
        assert named("10.0.0.1", (b"authorization", made_up)) == "10.0.0.1"
    tokens.revoke("one")
    assert named("10.0.0.1", one) == "10.0.0.1"
    tokens.path.write_text("[{}]")
    assert Tokens(tmp_path).path.is_file()
    assert named("10.0.0.1", two) == "10.0.0.1"


def test_an_overloaded_service_says_so_at_once(built: Any) -> None:
    with service_over(built, threads=1, max_delay=1e-6) as client:
        query = "/v1/shapes/dehydration?te=0.03&gamma=7&resolution=256&format=glb"
        found: list[httpx.Response] = []

        def ask(i: int) -> None:
            with httpx.Client(base_url=client.base_url, timeout=60) as own:
                found.append(own.get(f"{query}&s=0.2{i}"))

        assert client.get(f"{query}&s=0.3").status_code == 200
        threads = [threading.Thread(target=ask, args=(i,)) for i in range(12)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        refused = [answer for answer in found if answer.status_code == 503]
        assert refused
        for answer in refused:
            checked(answer, 503, "overloaded")
            assert int(answer.headers["retry-after"]) >= 1
        # it does not count against those who only look
        assert client.get("/v1/tables").status_code == 200


def test_at_the_door_is_said_what_would_be_said_inside(built: Any) -> None:
    """Refused at the door: what has no body and lies not ready. It is counted, and the connection stays."""
    app = create_app(Settings(store=built, threads=1))
    query = "/v1/shapes/dehydration?te=0.03&gamma=7&resolution=16&format=points"
    turned_away = app.state.door.refused
    seen = []

    def refused(scope: Any) -> Any:
        seen.append((scope["method"], (found := turned_away(scope)) is not None))
        return found

    app.state.door.refused = refused
    with listening(app, lifespan="on") as port, httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
        kept = client.get(f"{query}&s=0.3")
        assert kept.status_code == 200
        load = app.state.door._load
        load._interval, load.under_way = 1.0, 100
        for headers in ({}, {"X-Forwarded-For": "10.0.0.1"}):
            answer = client.get(f"{query}&s=0.2", headers=headers)
            assert checked(answer, 503, "overloaded")["instance"] == f"{query}&s=0.2"
            assert int(answer.headers["retry-after"]) >= 100
        assert answer.headers["server"] == kept.headers["server"]
        assert client.head(f"{query}&s=0.2").headers["content-length"] != "0"
        assert seen == [("GET", False), ("GET", True), ("GET", True), ("HEAD", True)]
        assert client.get(f"{query}&s=0.3").content == kept.content
        checked(client.post("/v1/shapes:batch", json={}), 503, "overloaded")
        assert [is_refused for _, is_refused in seen[4:]] == [False, False]
        assert client.get("/v1/tables").status_code == 200
        counted = 'wizen_requests_total{method="GET",route="none",status="503"} 2.0'
        assert counted in client.get("/metrics").text
        line = b"GET " + f"{query}&s=0.2".encode() + b" HTTP/1.0\r\n\r\n"
        assert b"connection: close" in talk(port, line)


def test_a_body_that_dribbles_in(built: Any) -> None:
    """What is missing never comes: nothing here hangs on who is faster."""
    head = b"POST /v1/shapes:batch HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n"
    with service_over(built, body_timeout=0.3) as client:
        answer = talk(client.base_url.port, head, b"{")
    assert answer.split()[1] == b"408"
    assert b"application/problem+json" in answer
    assert b"slow-body" in answer


LIMITS: dict[str, Any] = {
    "max_connections": 6, "max_connections_per_client": 4, "head_timeout": 0.5, "max_head": 2048, "max_headers": 20,
}  # fmt: skip


async def hello(scope: Any, receive: Any, send: Any) -> None:
    if scope["type"] == "http":
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
        await send({"type": "http.response.body", "body": b"hi"})


@contextmanager
def listening(app: Any, **more: Any) -> Iterator[int]:
    options: dict[str, Any] = {"http": GuardedProtocol, "ws": "none", "lifespan": "off", "log_config": None}
    server = uvicorn.Server(uvicorn.Config(app, port=0, **(options | more)))
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    try:
        yield server.servers[0].sockets[0].getsockname()[1]
    finally:
        server.should_exit = True
        thread.join()


@contextmanager
def limited(monkeypatch: pytest.MonkeyPatch, **more: Any) -> Iterator[int]:
    monkeypatch.setattr(connections, "_settings", lambda: Settings(**{**LIMITS, **more}))
    with listening(hello) as port:
        yield port


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    with limited(monkeypatch) as port:
        yield port


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """With so much time for heads that no machine is too busy: what ends is ended by something else."""
    monkeypatch.setattr(connections, "_LINGER", 60.0)
    with limited(monkeypatch, head_timeout=60) as port:
        yield port


def is_served(port: int) -> bool:
    return talk(port, HEAD + b"\r\n").endswith(b"hi")


def talk(port: int, *pieces: bytes, pause: float = 0.0) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=60) as line:
        for piece in pieces:
            line.sendall(piece)
            time.sleep(pause)
        answer = b""
        while more := line.recv(65536):
            answer += more
            if answer.endswith((b"hi", b"}")):
                break
        return answer


HEAD = b"GET / HTTP/1.1\r\nHost: x\r\n"


def test_honest_requests_pass(patient: int) -> None:
    assert talk(patient, HEAD + b"\r\n").startswith(b"HTTP/1.1 200")
    with httpx.Client(base_url=f"http://127.0.0.1:{patient}", timeout=60) as client:  # one connection, kept
        assert [client.get("/").text for _ in range(10)] == ["hi"] * 10


@pytest.mark.parametrize(
    ("pieces", "code"),
    [
        ([HEAD + b"X: " + b"a" * 3000 + b"\r\n\r\n"], b"431"),
        ([HEAD + b"X: ", *[b"a" * 1000] * 3], b"431"),
        ([b"GET /" + b"a" * 3000], b"431"),
        ([HEAD + b"".join(b"X%d: 1\r\n" % i for i in range(30)) + b"\r\n"], b"431"),
    ],
)
def test_heads_without_end(patient: int, pieces: list[bytes], code: bytes) -> None:
    answer = talk(patient, *pieces, pause=0.02)
    assert answer.split()[1] == code
    assert b"application/problem+json" in answer
    assert is_served(patient)


def test_a_head_that_stops_halfway(port: int) -> None:
    answer = talk(port, HEAD)
    assert answer.split()[1] == b"408"
    assert b"application/problem+json" in answer
    until(lambda: is_served(port))  # at the first try, unless this thread stood still for half a second


def test_a_silent_connection_is_closed(port: int) -> None:
    assert talk(port) == b""


def test_connections_of_one_client_are_counted(patient: int) -> None:
    # who connects first is taken first: there are four when the fifth one is looked at
    held = [socket.create_connection(("127.0.0.1", patient), timeout=60) for _ in range(4)]
    answer = talk(patient, HEAD + b"\r\n")
    assert answer.split()[1] == b"503"
    assert b"retry-after" in answer
    assert b"of this client" in answer
    # another address still has room, until all is taken
    with socket.create_connection(("127.0.0.1", patient), timeout=60, source_address=("127.0.0.2", 0)) as other:
        other.sendall(HEAD + b"\r\n")
        assert other.recv(4096).startswith(b"HTTP/1.1 200")
    for line in held:
        line.close()
    until(lambda: is_served(patient))


def test_a_newcomer_displaces_the_slowest(patient: int) -> None:
    """All connections are taken by many who dribble: whoever comes with a whole request is served all the same."""
    held = []
    for i in range(6):
        line = socket.create_connection(("127.0.0.1", patient), timeout=60, source_address=(f"127.0.1.{i + 1}", 0))
        line.sendall(HEAD)
        held.append(line)
    for i in range(3):
        with socket.create_connection(("127.0.0.1", patient), timeout=60) as other:
            other.sendall(HEAD + b"\r\n")
            assert other.recv(4096).startswith(b"HTTP/1.1 200"), i
    assert held[0].recv(4096).split()[1] == b"503"
    for line in held:
        line.close()


def test_a_crowd_of_late_ones_is_held_and_not_turned_round(monkeypatch: pytest.MonkeyPatch) -> None:
    """A few are told and let go. A crowd would come back at once: it stays, unread, until its room is needed."""
    monkeypatch.setattr(waiting, "_CROWD", 3)
    monkeypatch.setattr(waiting, "_LOOK", 0.05)

    def kept() -> int:
        return sum(each.held for each in list(connections._waiting.values()))

    # five have connected before the first is late, unless the machine stands still for these seconds
    with limited(monkeypatch, head_timeout=5) as port:
        held = []
        for i in range(5):
            line = socket.create_connection(("127.0.0.1", port), timeout=0.02, source_address=(f"127.0.1.{i + 1}", 0))
            line.sendall(HEAD)
            held.append(line)
        until(lambda: kept() == 5)
        told = 0
        for line in held:
            line.sendall(b"X: y\r\n")
            with suppress(TimeoutError):
                told += line.recv(4096).startswith(b"HTTP/1.1 408")
        assert told == 0
        for _ in range(2):  # there is room for one more; the second one takes that of the first who came
            other = socket.create_connection(("127.0.0.1", port), timeout=60)
            other.sendall(HEAD + b"\r\n")
            assert other.recv(4096).startswith(b"HTTP/1.1 200")
            held.append(other)
        held[0].settimeout(60)
        with suppress(ConnectionResetError):  # what it had sent was never read
            assert held[0].recv(4096).split()[1] == b"503"
        # who leaves is missed: those that are left are no crowd, and what comes now late is told so
        for line in held:
            line.close()
        until(lambda: kept() == 0)
        assert talk(port, HEAD).split()[1] == b"408"


def test_a_crowd_of_newcomers_is_taken_in_while_shapes_are_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    """uvloop takes one connection in a pass of its loop: those who queue before the door are told nothing."""
    pytest.importorskip("uvloop")
    monkeypatch.setattr(connections, "_settings", Settings)
    turns, before, seen = Turns(1000), connections.taken(), list[int]()

    async def shape(scope: Any, receive: Any, send: Any) -> None:
        async with turns:
            seen.append(connections.taken() - before)
            time.sleep(0.01)
        await hello(scope, receive, send)

    with listening(shape, loop="uvloop") as port:
        crowd = [socket.create_connection(("127.0.0.1", port), timeout=10) for _ in range(40)]
        for line in crowd:
            line.sendall(HEAD + b"\r\n")
        for line in crowd:
            assert line.recv(4096).startswith(b"HTTP/1.1 200")
            line.close()
    # the door was open for all of them long before the last one had his turn
    assert len(seen) == seen[-1] == 40
    assert seen[len(seen) // 2] == 40


def test_every_setting_is_documented() -> None:
    assert (ROOT / "docs" / "settings.md").read_text() == page(), "python -m service.settings > docs/settings.md"


def test_there_are_no_more_connections_than_files() -> None:
    code = (
        "import resource; from service.limits import connections as c\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (300, {hard}))\n"
        "print(c._most(600), resource.getrlimit(resource.RLIMIT_NOFILE)[0])"
    )
    for hard, said in ((1000, ["600", "856"]), (400, ["144", "400"])):
        done = subprocess.run(
            [sys.executable, "-c", code.format(hard=hard)], cwd=ROOT, capture_output=True, text=True, check=True
        )
        assert done.stdout.split() == said
