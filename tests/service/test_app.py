"""Importing the service is light, and its app is made when asked for."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
#: Of a shape that does not fold: what folds is looked at for crossings by compiled code.
PAGES = ("/v1/shapes/dehydration?te=0.03&gamma=7&s=0.02&format=glb", "/v1/solvers/dehydration", "/openapi.json")
HEAVY = {
    "numba",
    "matplotlib",
    "distributed",
    "typer",
    "sweeps.commands.cli",
    "sweeps.running.executors",
    "sweeps.planning.plan",
    "sweeps.running.runner",
}


#: Makes an app and asks it for PAGES in its own process; prints the modules there are before and after.
SCRIPT = """
import sys, json, asyncio, httpx
def modules():
    return sorted({name if name.startswith("sweeps") else name.partition(".")[0] for name in sys.modules})
import service.app
from service.settings import Settings
app = service.app.create_app(Settings(store=sys.argv[1]))
made = modules()
async def ask():
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://x") as client:
        for path in sys.argv[2:]:
            assert (await client.get(path)).status_code == 200, path
asyncio.run(ask())
print(json.dumps([made, modules()]))
"""


def test_making_the_app_and_serving_shapes_is_light(built: Path) -> None:
    command = [sys.executable, "-c", SCRIPT, str(built), *PAGES]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    made, served = map(set, json.loads(done.stdout.splitlines()[-1]))
    assert not made & HEAVY
    assert not served & HEAVY


def test_the_app_is_made_once_when_asked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import service.app

    monkeypatch.setenv("WIZEN_STORE", str(tmp_path))
    assert "app" not in vars(service.app)
    app = service.app.app
    try:
        assert app.state.settings.store == tmp_path
        assert service.app.app is app
    finally:
        del service.app.app
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        service.app.nothing  # noqa: B018
