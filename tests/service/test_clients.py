"""Clients that others' generators make of the OpenAPI page fetch JSON, a GLB, a batch and a job's numbers.

The generators come from package registries into environments of their own; where there is none, the tests say so.
Slow for what they fetch: `make test-clients` runs them, and CI does.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import venv
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import httpx
import numpy as np
import pytest

from store.store import Store

from ._asking import ROOT
from ._gltf import accessor, parsed
from ._jobs import bearer
from .conftest import QUERY, SHAPE, client_of

pytestmark = pytest.mark.slow

CLIENTS = Path(__file__).parent / "clients"
WANTED = {"value": 0.25, "state": "done", "dims": ["stage"], "refused": "Outside table"}
#: What only the Python client asks for: a mesh's borders, and what the shape in a file is matched with.
SENT = {"borders": 0, "matched": "dehydration"}


def run(*words: str | Path, cwd: Path, may_skip: str = "", warnings: bool = False) -> str:
    """Run a command that must work, or whose failure means that this machine lacks something; returns what it says,
    and what it warns of where that is asked for.
    """
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [*map(str, words)], cwd=cwd, capture_output=True, text=True, check=False, timeout=600, env=kept
    )
    if done.returncode and may_skip:
        pytest.skip(f"{may_skip}: {(done.stderr or done.stdout)[-300:]}")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout + done.stderr if warnings else done.stdout


@pytest.fixture
def service(own: Store) -> Iterator[tuple[httpx.Client, str]]:
    """A service that runs jobs, and a token for it."""
    token = bearer(own)["Authorization"].removeprefix("Bearer ")
    with client_of(own.root, jobs_workers=1) as client:
        yield client, token


def look(folder: Path, client: httpx.Client) -> None:
    """Look at the files that a client fetched: a mesh that glTF's own numbers describe, and the batch's shapes."""
    document, binary = parsed((folder / "shape.glb").read_bytes())
    assert document["asset"]["version"] == "2.0"
    primitive = document["meshes"][0]["primitives"][0]
    corners = accessor(document, binary, primitive["attributes"]["POSITION"])
    faces = accessor(document, binary, primitive["indices"])
    assert len(faces) == 12 * 16 * 16
    assert faces.max() == len(corners) - 1
    one = client.get(SHAPE, params={**QUERY, "format": "npz"})
    with np.load(BytesIO(one.content)) as shape:
        lattice = shape["position"].reshape(-1, 3)
    # the seam and the poles stand there more than once
    assert {tuple(row) for row in lattice.tolist()} <= {tuple(row) for row in corners.tolist()}
    with np.load(folder / "batch.npz") as batch:
        assert batch["position"].shape == (1, 16, 32, 3)
        assert np.isfinite(batch["position"]).all()


@pytest.fixture
def npm(tmp_path: Path) -> Path:
    """A directory with the packages that read OpenAPI pages."""
    if shutil.which("npm") is None:
        pytest.skip("there is no npm here")
    (tmp_path / "package.json").write_text((CLIENTS / "package.json").read_text())
    run("npm", "install", "--no-audit", "--no-fund", "--loglevel=error", cwd=tmp_path, may_skip="npm fetches nothing")
    return tmp_path


def test_a_python_client(service: tuple[httpx.Client, str], tmp_path: Path) -> None:
    client, token = service
    venv.create(tmp_path / "venv", with_pip=True, symlinks=True)
    bins = tmp_path / "venv" / "bin"
    pip = (bins / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    run(*pip, "openapi-python-client>=0.29", cwd=tmp_path, may_skip="pip fetches nothing")
    (tmp_path / "openapi.json").write_text(client.get("/openapi.json").text)
    made = run(
        bins / "openapi-python-client",
        "generate",
        "--path",
        "openapi.json",
        "--output-path",
        "generated",
        "--meta",
        "none",
        cwd=tmp_path,
        warnings=True,
    )
    assert not re.search("Unable to process schema|Endpoint will not be generated", made)
    shutil.copy(CLIENTS / "try_python.py", tmp_path)  # beside what it imports
    assert json.loads(run(bins / "python", "try_python.py", str(client.base_url), token, cwd=tmp_path)) == WANTED | SENT
    look(tmp_path, client)


def test_a_typescript_client(service: tuple[httpx.Client, str], npm: Path) -> None:
    client, token = service
    (npm / "openapi.json").write_text(client.get("/openapi.json").text)
    shutil.copy(CLIENTS / "try.ts", npm / "try.ts")
    run("npx", "openapi-typescript", "openapi.json", "-o", "api.d.ts", "--default-non-nullable=false", cwd=npm)
    options = ["--target", "es2022", "--module", "nodenext", "--strict", "--skipLibCheck", "--types", "node"]
    run("npx", "tsc", *options, "try.ts", cwd=npm)
    assert json.loads(run("node", "try.js", str(client.base_url), token, cwd=npm)) == WANTED
    look(npm, client)


def test_a_linter_finds_no_error(npm: Path, tmp_path: Path) -> None:
    page = "import json; from service.app import create_app; print(json.dumps(create_app().openapi()))"
    made = subprocess.run([sys.executable, "-c", page], cwd=ROOT, capture_output=True, text=True, check=True)
    (npm / "openapi.json").write_text(made.stdout)
    found = subprocess.run(
        ["npx", "redocly", "lint", "openapi.json", "--format=json"],
        cwd=npm,
        capture_output=True,
        text=True,
        check=False,
    )
    assert json.loads(found.stdout)["totals"]["errors"] == 0, found.stdout[:3000]
