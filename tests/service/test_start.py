"""What a start costs: nothing that the first answer does not need."""

from __future__ import annotations

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from service.commands.hints import hints
from service.limits import memory
from store import starter

#: Each takes a tenth of a second to a second to import.
HEAVY = {
    "dask", "distributed", "matplotlib", "numba", "pandas", "scipy", "skfem", "starlette_compress",
    "sweeps.running.runner", "xarray",
}  # fmt: skip

CODE = """
import sys
from fastapi.testclient import TestClient
from service.app import create_app
from service.settings import Settings
from store.starter import ROOT
client = TestClient(create_app(Settings(store=ROOT)))
answer = client.get("/v1/shapes/dehydration?te=0.035&gamma=20&s=0.1&format=points")
assert answer.status_code == 200, answer.text
print(" ".join(sys.modules))
"""


def test_the_first_answer_needs_no_heavy_library() -> None:
    # of a shape that does not fold: what folds is looked at for crossings by compiled code
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert HEAVY.isdisjoint(done.stdout.split())


def test_the_garbage_collector_walks_again_once_the_service_is_loaded() -> None:
    """Also where a second service of this process begins, and where loading ends with an error."""
    for _ in range(2):
        with memory.loading():
            assert not gc.isenabled()
            memory.keep("tests")
            assert gc.isenabled()
    with pytest.raises(OSError, match="no port"), memory.loading():
        raise OSError("no port")
    assert gc.isenabled()


def test_what_is_said_at_the_start_can_be_opened(tmp_path: Path) -> None:
    """The page that explains parameters is built with the other one; without, it says that it is not."""
    address = "http://127.0.0.1:1"
    assert hints(starter.ROOT, address, tmp_path)[-1].startswith(f"and {address}/openapi.json explains")
    (tmp_path / "index.html").touch()
    assert hints(starter.ROOT, address, tmp_path)[-1].startswith(f"and {address}/docs explains")
