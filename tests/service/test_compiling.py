"""What folds needs compiled code: the first who asks waits for it, gets his shape, and holds up nobody."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.app import create_app
from service.limits.requests import Limits
from service.settings import Settings
from service.shapes.compiling import Compiling, NotAtOnce
from store import starter

from ._asking import ROOT, answers, until
from .conftest import SHAPE, served

#: A shape of the table in the package that touches itself.
FOLDED: dict[str, Any] = {"te": 0.035, "gamma": 30, "s": 0.3, "resolution": 32}


def test_the_event_loop_computes_no_folded_shape() -> None:
    compiling = Compiling()

    async def ask() -> None:
        compiling()

    with pytest.raises(NotAtOnce):
        asyncio.run(ask())
    compiling()
    with pytest.raises(NotAtOnce):  # nor later on: putting it apart may take a second
        asyncio.run(ask())


def test_a_small_folded_shape_is_answered_by_a_thread() -> None:
    app = create_app(Settings(store=starter.ROOT))
    with served(app) as client:
        for _ in range(2):  # the second time, the table is open and the event loop tries it first
            answer = client.get(SHAPE, params={**FOLDED, "format": "points"})
            assert answer.status_code == 200
            app.state.answers = type(app.state.answers)(0)
        assert app.state.compiling._is_done


@pytest.mark.parametrize(("patient", "status"), [(True, 200), (False, 503)])
def test_an_answer_may_be_late_while_code_is_compiled(patient: bool, status: int) -> None:
    async def slow(scope: Any, receive: Any, send: Any) -> None:
        await asyncio.sleep(0.6)
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    async def ask() -> int:
        app = Limits(slow, Settings(timeout=0.2), lambda: patient)
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://x") as client:
            return (await client.get("/")).status_code

    assert asyncio.run(ask()) == status


@contextmanager
def cold(tmp_path: Path, *command: str, **settings: str) -> Iterator[httpx.Client]:
    """A service on a machine where nothing has been compiled yet."""
    environment = os.environ | settings | {"WIZEN_STORE": str(starter.ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    run = [sys.executable, *command]
    with subprocess.Popen(run, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            address = next(line for line in process.stderr if "http://" in line)
            port = int(address.rpartition(":")[2].split()[0])
            with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=600) as client:
                until(lambda: answers(client))
                yield client
        finally:
            process.terminate()


@pytest.mark.slow
def test_the_first_folded_shape_on_a_new_machine(tmp_path: Path) -> None:
    """Compiling takes some fifteen seconds: longer than the time limit here. Others are answered meanwhile."""
    bare = ("-m", "uvicorn", "service.app:app", "--port", "0")
    with cold(tmp_path, *bare, WIZEN_TIMEOUT="2") as client:
        found: list[httpx.Response] = []
        first = threading.Thread(target=lambda: found.append(client.get(SHAPE, params={**FOLDED, "format": "glb"})))
        first.start()
        meanwhile = 0
        while first.is_alive():
            other = client.get(SHAPE, params={**FOLDED, "s": 0.05 + 1e-4 * meanwhile, "format": "points"})
            assert other.status_code == 200, other.text
            meanwhile += 1
        first.join()
        assert found[0].status_code == 200, found[0].text
        assert found[0].content[:4] == b"glTF"
        assert meanwhile > 20


@pytest.mark.slow
def test_serve_has_it_compiled_before_anybody_asks(tmp_path: Path) -> None:
    with cold(tmp_path, "-m", "service.cli", "serve", "--port", "0"):
        until(lambda: any((tmp_path / "cache").rglob("*_put_apart*.nbc")), 1800)
