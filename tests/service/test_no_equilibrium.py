"""A growing sheet that nothing holds any more, by the command line and over HTTP: advice, and how far it was good."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from service.cli import app
from solver.meshes import frame
from store import shards
from store.store import Store

from ._asking import checked
from ._jobs import drain

#: A ball stands too far aside to catch a heavy disc, and what it lies on at first is taken away.
TABLE = -0.1
FALLING: dict[str, Any] = {
    "shape": "disc",
    "thickness": 0.05,
    "tools": [],
    "step": 0.1,
    "gravity": [0, 0, -0.05],
    "solids": [
        {"kind": "ball", "centre": [5, 0, -3], "radius": 1},
        {"kind": "plane", "point": [0, 0, TABLE], "duration": 0.2},
    ],
}
STAGES = (0.1, 0.2, 0.4)


def told(problem: dict[str, Any], said: str) -> None:
    assert "falls" in problem[said]
    assert "growth time 0.3" in problem[said]
    assert "Attach a part of it, or let it lie on a solid" in problem["advice"]
    assert problem["last_stage"] == 0.2


def lying_flat(path: Path) -> xr.Dataset:
    """Return the stages that were kept: those before it fell."""
    kept = shards.read(path)
    assert kept["stage"].values.tolist() == [0.1, 0.2]
    assert kept["converged"].values.all()
    last = frame(kept, -1).vertices
    assert np.abs(last[:, 2] - TABLE).max() < 0.01
    return kept


@pytest.mark.parametrize("as_json", [True, False])
def test_the_command_line_says_what_to_change_and_keeps_its_good_stages(as_json: bool, tmp_path: Path) -> None:
    (tmp_path / "falling.json").write_text(json.dumps(FALLING))
    out = tmp_path / "falling.h5"
    words = ["solve", "growth", "--params", str(tmp_path / "falling.json"), "--quality", "preview", "--out", str(out)]
    found = CliRunner().invoke(app, [*words, "--stages", "0.1,0.2,0.4", *(["--json"] if as_json else [])])
    # 2 is for what could have been known before any work
    assert found.exit_code == 1
    assert "Traceback" not in found.output
    lying_flat(out)
    assert f"0.1, 0.2 settled before, and {out} holds them" in found.stderr
    if as_json:
        error = json.loads(found.stdout)["error"]
        assert error["code"] == "not-converged"
        told(error, "message")
    else:
        line = " ".join(found.stderr.split())
        assert line.count("error:") == 1
        assert "Attach a part of it, or let it lie on a solid that is wide enough." in line


def test_a_job_over_http_says_it_and_keeps_its_good_stages(store: Store, queue_only: httpx.Client) -> None:
    need = {"stages": STAGES, "quality": "preview", "fields": ["mesh_position"]}
    job = queue_only.post("/v1/jobs", json={"solver": "growth", "params": FALLING, "need": need}).json()
    drain(store)
    failed = queue_only.get(job["links"]["self"]).json()
    assert failed["state"] == "failed"
    assert failed["problem"]["type"] == "urn:wizen:problem:not-converged"
    told(failed["problem"], "detail")
    problem = checked(queue_only.get(f"{job['links']['self']}/result"), 409, "job-failed")
    assert "falls" in problem["detail"]
    kept = lying_flat(store.root / "quarantine" / f"{job['id']}.h5")
    assert "falls" in kept.attrs["reason"]
