"""What a start costs: nothing that the first answer does not need."""

from __future__ import annotations

import subprocess
import sys

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
