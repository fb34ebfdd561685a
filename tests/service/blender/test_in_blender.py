"""The extension in Blender itself (bpy), and what Blender makes of our files: one environment of its own for both.

bpy wants another numpy than we do. WIZEN_BPY names a Python that has it; else it is fetched from a package registry,
half a gigabyte, and where that does not work the tests say so.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import venv
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from benchmarks.service.__main__ import running
from solver.registry import surface
from store import starter
from store.lookup import ShapeTable
from store.store import Store
from store.tokens import Tokens

from .._asking import ROOT
from .._shapes import RAISIN_AT
from ..test_clients import run

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
#: The oldest line that is promised would be 4.2; 4.5 is the newest that runs on Python 3.11 with long support.
BPY = "bpy>=4.2,<5"


@pytest.fixture(scope="session")
def blender(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python with bpy."""
    if "WIZEN_BPY" in os.environ:
        return Path(os.environ["WIZEN_BPY"])
    folder = tmp_path_factory.mktemp("bpy")
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    run(python, "-m", "pip", "install", "--quiet", BPY, cwd=folder, may_skip="bpy cannot be fetched")
    return python


def inside(blender: Path, tmp_path: Path, script: str, *words: str | Path) -> None:
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    kept |= {"BLENDER_USER_RESOURCES": str(tmp_path / "blender"), "HOME": str(tmp_path)}
    done = subprocess.run(
        [str(blender), str(HERE / script), *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
        env=kept,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]


def zipped(folder: Path) -> Path:
    """The zip as `make blender` makes it."""
    found = folder / "wizen-blender.zip"
    with zipfile.ZipFile(found, "w") as file:
        for path in sorted((ROOT / "service" / "blender").glob("*.*")):
            if path.suffix in (".py", ".toml"):
                file.write(path, path.name)
    return found


@pytest.fixture(scope="session")
def seen(blender: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the extension did in Blender."""
    folder = tmp_path_factory.mktemp("extension")
    shutil.copytree(starter.ROOT, folder / "store")
    store = Store.open(folder / "store", create=True)
    secret = Tokens(store.root).create("blender", ("run",))[1]
    command = ["-m", "service.cli", "serve", "--port", "{port}"]
    import sys

    with running([sys.executable, *command], "/healthz", WIZEN_STORE=str(store.root)) as (_, port, _):
        address = f"http://127.0.0.1:{port}"
        inside(blender, folder, "inside.py", zipped(folder), address, secret, folder / "seen.json")
    found: dict[str, Any] = json.loads((folder / "seen.json").read_text())
    return found


def table(name: str, asked: dict[str, float], s: float, n: int) -> np.ndarray:
    shape = ShapeTable.open(starter.ROOT, name, surfaces=surface).at(asked, s, resolution=n)
    assert shape.position is not None
    assert shape.poles is not None
    found = np.concatenate([shape.position.reshape(-1, 3), shape.poles])
    return found[:, [0, 2, 1]] * [1, -1, 1]


def test_families_are_browsed_and_nothing_waits(seen: dict[str, Any]) -> None:
    assert {"default", "raisin", "plum1"} <= set(seen["families"])
    assert seen["mute_s"] < 1  # twenty looks and a question at a service that does not answer
    assert seen["tick_s"] < 0.1


def test_an_inserted_raisin_is_the_tables_and_as_large_as_raisins(seen: dict[str, Any]) -> None:
    raisin = seen["raisin"]
    truth = table("raisin", RAISIN_AT, raisin["s"], 48)
    assert np.abs(np.array(raisin["positions"]).reshape(-1, 3) - truth).max() < 1e-5
    assert max(raisin["metres"]) == pytest.approx(0.0085 * np.ptp(truth, axis=0).max(), rel=1e-4)
    assert 0.012 < max(raisin["metres"]) < 0.018


def test_sliders_move_the_mesh_to_what_they_say_last(seen: dict[str, Any]) -> None:
    truth = table("default", {"te": 0.034, "gamma": 22.0}, 0.25, 32)
    assert np.abs(np.array(seen["moved"]).reshape(-1, 3) - truth).max() < 1e-5
    assert "between runs" in seen["trust"]


def test_a_job_runs_and_comes_as_shape_keys_that_move_as_its_cache(seen: dict[str, Any]) -> None:
    assert [job["state"] for job in seen["jobs"]] == ["done"]
    assert seen["run"]["scale"] == [0.5, 0.5, 0.5]
    assert seen["run"]["skins"] == seen["run"]["fruits"] != []
    assert seen["keys"] == ["Basis", "frame 1", "frame 13"]
    assert seen["frames"] == 2
    assert seen["keys_moved"] > 1e-3
    assert seen["keys_against_cache"] < 1e-5
    assert "take the run's mesh" in seen["refused"]
    assert seen["gone"]


def test_an_orange_looks_the_same_from_glb_and_from_usd(blender: Path, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    files = [tmp_path / "orange.glb", tmp_path / "orange.usdc"]
    import sys

    wizen = [sys.executable, "-m", "service.cli"]
    kept = {**os.environ, "PYTHONPATH": str(ROOT)}
    made = ["solve", "decay", "--preset", "orange", "--quality", "preview", "--stages", "6", "--out", "orange.h5"]
    subprocess.run([*wizen, *made], cwd=tmp_path, check=True, env=kept, capture_output=True)
    for file in files:
        words = ["export", "orange.h5", "--stage", "6", "--out", file.name]
        subprocess.run([*wizen, *words], cwd=tmp_path, check=True, env=kept, capture_output=True)
    inside(blender, tmp_path, "render.py", tmp_path, *files)
    one, other = (np.asarray(Image.open(f"{file}.png").convert("RGB"), float) / 255 for file in files)
    fruit = one.std(axis=-1) > 0.02
    assert 0.2 < fruit.mean() < 0.7
    assert np.abs(one - other)[fruit].sum() / one[fruit].sum() < 0.03
