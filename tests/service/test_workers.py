"""`wizen serve --workers`: several processes answer with the same bytes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from store.store import Store
from store.tokens import Tokens

from ._asking import ROOT, answers, until
from ._jobs import bearer
from .conftest import QUERY, SHAPE


@pytest.mark.slow
def test_several_processes_answer_alike(built: Path) -> None:
    command = [sys.executable, "-m", "service.cli", "serve", "--store", str(built), "--port", "0", "--workers", "2"]
    running = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    try:
        assert running.stderr is not None
        address = running.stderr.readline().split()[-1]
        with httpx.Client(base_url=address, timeout=120) as client:
            until(lambda: answers(client))
        bodies = set()
        for _ in range(40):  # each on a connection of its own, which any of them may take
            answer = httpx.get(f"{address}{SHAPE}", params={**QUERY, "format": "npz"}, timeout=120)
            assert answer.status_code == 200
            bodies.add(answer.content)
        assert len(bodies) == 1
        children = Path(f"/proc/{running.pid}/task/{running.pid}/children")
        if children.is_file():  # Linux: two that answer, and one that keeps book for them
            assert len(children.read_text().split()) >= 2
    finally:
        running.send_signal(signal.SIGTERM)
        running.communicate(timeout=120)
    assert running.returncode == 0


@pytest.mark.slow
def test_a_revoked_token_is_refused_by_all_processes(own: Store) -> None:
    """From the next request on, whichever of four processes it meets."""
    head = bearer(own, "leaked")
    command = [sys.executable, "-m", "service.cli", "serve", "--store", str(own.root), "--port", "0", "--workers", "4"]
    environment = {**os.environ, "WIZEN_JOBS_WORKERS": "0", "WIZEN_PUBLIC_READ": "0"}
    running = subprocess.Popen(command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        assert running.stderr is not None
        address = running.stderr.readline().split()[-1]
        until(lambda: _status(f"{address}/v1/tables", head) == 200)
        # connections of their own: the system hands them to all four
        assert {_status(f"{address}/v1/tables", head) for _ in range(40)} == {200}
        Tokens(own.root).revoke("leaked")
        assert [_status(f"{address}/v1/tables", head) for _ in range(40)] == [401] * 40
    finally:
        running.send_signal(signal.SIGTERM)
        running.communicate(timeout=120)


def _status(url: str, head: dict[str, str]) -> int:
    try:
        return httpx.get(url, headers={**head, "Connection": "close"}, timeout=60).status_code
    except httpx.TransportError:
        return 0
