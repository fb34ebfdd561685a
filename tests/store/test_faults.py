"""A fault at every change that an operation makes to its store: nothing lost, nothing half, a sentence, and no litter.

`_faults` tries the points, in a process whose calls to the system go through `_shim.c`.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from .conftest import ROOT

pytestmark = [
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="LD_PRELOAD is Linux's"),
    pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc to make the shim"),
]


@pytest.fixture(scope="module")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the library that fails on demand."""
    made = tmp_path_factory.mktemp("shim") / "shim.so"
    source = Path(__file__).with_name("_shim.c")
    subprocess.run(["gcc", "-O1", "-Wall", "-Werror", "-shared", "-fPIC", "-o", made, source, "-ldl"], check=True)
    return made


OPERATIONS = ["put", "build", "token", "claim"]
#: Every so many of an operation's changes are tried where time is short; together they still meet all kinds of calls.
EVERY = {"put": 3, "build": 17, "token": 2, "claim": 25}


def tried(shim: Path, at: Path, asked: dict[str, int]) -> dict[str, Any]:
    """Try every so many of the operations' changes; return what was found and what was wrong."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.store._faults", at, shim, *(f"{name}={every}" for name, every in asked.items())],
        cwd=ROOT,
        env={**os.environ, "LD_PRELOAD": str(shim)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def points(said: dict[str, Any]) -> int:
    """Hold what was said of an operation against what may be; return how many points there were."""
    found = said["found"]
    print(found)
    assert not said["wrong"], "\n".join(said["wrong"])[-6000:]
    assert set(found["killed amid"]) == set(found["killed before"]) == {"killed"}
    # what comes after the last change that counts may fail unheard: the ledger's log stays, and is read by the next
    assert "storage-full" in found["no space"]
    assert set(found["no space"]) <= {"storage-full", "ok"}
    assert "storage-failed" in found["broken"]
    assert set(found["broken"]) <= {"storage-failed", "ok"}
    return sum(sum(times.values()) for times in found.values())


@pytest.fixture(scope="module")
def some(shim: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What was found at some changes, by operation: one process tries them all."""
    return tried(shim, tmp_path_factory.mktemp("some"), EVERY)


@pytest.mark.parametrize("operation", OPERATIONS)
def test_faults_at_some_changes(operation: str, some: dict[str, Any]) -> None:
    assert points(some[operation]) >= 8, "the shim saw nothing"


@pytest.mark.slow
@pytest.mark.parametrize("operation", OPERATIONS)
def test_a_fault_at_every_change(operation: str, shim: Path, tmp_path: Path) -> None:
    assert points(tried(shim, tmp_path, {operation: 1})[operation]) >= 20, "the shim saw nothing"
