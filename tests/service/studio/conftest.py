"""A `wizen serve --studio` in whose store there is a small run of each solver, for all tests of the page's rooms."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from .._browser import serving

#: Small runs, so that rooms of jobs have something to show.
RUNS: tuple[dict[str, Any], ...] = (
    {
        "solver": "decay",
        "preset": "apple",
        "need": {"stages": [0, 2, 4], "quality": "preview", "fields": ["position", "rot", "mould", "rotten_share"]},
    },
    {"solver": "growth", "preset": "mushroom", "need": {"stages": [0.25, 0.5], "quality": "preview"}},
    {
        "solver": "wood",
        "preset": "twig",
        "params": {"rods": 7, "vertices": 10},
        "need": {
            "stages": [0.005, 0.01, 0.02],
            "quality": "preview",
            "fields": ["mesh_position", "inside", "body", "body_impulse", "broken_bonds"],
        },
    },
)


@pytest.fixture(scope="package")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The studio's address, with its token, over a store in which `RUNS` are done."""
    data = tmp_path_factory.mktemp("data")
    with serving(data, "--studio", "--store", str(data / "store")) as address:
        root, secret = address.split("/#token=")
        allowed = {"Authorization": f"Bearer {secret}"}
        for run in RUNS:
            job = httpx.post(f"{root}/v1/jobs", json=run, headers=allowed, timeout=60).raise_for_status().json()
            with httpx.stream("GET", f"{root}{job['links']['events']}", timeout=300) as events:
                last = [line for line in events.iter_lines() if line.startswith("data: ")][-1]
            assert json.loads(last.removeprefix("data: "))["state"] == "done"
        yield address
