"""`wizen serve --workers`: several processes answer with the same bytes."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from ._asking import ROOT, answers, until
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
