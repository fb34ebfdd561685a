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

import pytest

from .conftest import ROOT

pytestmark = [
    pytest.mark.slow,
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


@pytest.mark.parametrize("operation", ["put", "build", "token", "claim"])
def test_a_fault_at_every_change(operation: str, shim: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.store._faults", operation, tmp_path, shim],
        cwd=ROOT,
        env={**os.environ, "LD_PRELOAD": str(shim)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    print(operation, found)
    assert sum(found["killed before"].values()) >= 5, "the shim saw nothing"
    assert set(found["killed amid"]) == set(found["killed before"]) == {"killed"}
    assert set(found["no space"]) == {"storage-full"}
    assert set(found["broken"]) == {"storage-failed"}
