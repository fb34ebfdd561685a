"""Live sessions over a real server: shapes that are painted, taken back, and replayed to the same bytes."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner
from websockets.exceptions import ConnectionClosed

from service.cli import app
from solver.meshes import frame

from .._live import BALL, Served, live, one_service

__all__ = ["live", "one_service"]

STEM = {"shape": "stem", "aspect": 3.0, "thickness": 0.08, "tools": [], "step": 0.02}


def mesh(saved: dict[str, Any], folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Run the command that a session was saved with, and read its file."""
    (folder / "session.toml").write_text(saved["toml"])
    words = saved["command"].split()
    assert words[0] == "wizen"
    here = Path.cwd()
    os.chdir(folder)
    try:
        done = CliRunner().invoke(app, words[1:])
    finally:
        os.chdir(here)
    assert done.exit_code == 0, done.output
    with xr.open_dataset(folder / words[-1], engine="h5netcdf") as run:
        found = frame(run.load(), -1)
    return found.vertices, found.triangles


@pytest.mark.slow
def test_a_mushroom_is_painted_and_replayed_to_the_same_bytes(live: Served, tmp_path: Path) -> None:
    """Strokes about the tip of a stem, one of them taken back, a curve that makes the cap, a box; then the file."""
    client = live.client(STEM, fields=["elastic_strain"])
    said = client.opened()
    assert said["say"] == "opened"
    assert said["fields"] == ["elastic_strain"]
    around = [(float(np.cos(a)), float(np.sin(a))) for a in np.linspace(0, 2 * np.pi, 9)]
    brush = {"radius": 0.7, "stretch": [6.0, 3.0], "hold": 0.06}
    for c, s in around:
        client.do("brush", at=[c, s, 3.0], way=[-s, c, 0.0], **brush)
    client.ask("lift")
    client.rest()
    kept, time_then = client.x.copy(), client.frames[-1]["stage"]
    client.do("brush", at=[0.0, 0.0, 4.0], radius=0.5, stretch=[9.0, 9.0])
    client.rest()
    assert not np.array_equal(client.x, kept)
    client.do("undo")
    client.rest()
    assert client.frames[-1]["stage"] == time_then
    assert client.x.tobytes() == kept.tobytes()
    client.do("redo")
    client.rest()
    assert client.x.tobytes() != kept.tobytes()
    client.do("undo")
    ring = [[c, s, 3.0] for c, s in around[:-1]]
    curve = {"kind": "curve", "points": ring, "closed": True, "radius": 1.5, "stretch": [3.0, 1.6]}
    assert client.do("add", tool=curve)["tool"] == 1
    assert client.do("solid", solid={"kind": "ball", "centre": [0, 0, 5.5], "radius": 1.0})["solid"] == 0
    client.do("play", until=time_then + 0.2)
    client.rest()
    assert client.frames[-1]["stage"] == pytest.approx(time_then + 0.2)
    assert any(f["base"] for f in client.frames)
    assert np.ptp(client.frames[-1]["fields"][0]) > 0
    client.do("settle")
    client.rest()
    assert client.frames[-1]["flags"] == 1
    assert client.frames[-1]["residual"] <= 1e-3
    vertices, triangles = mesh(client.ask("save"), tmp_path)
    assert vertices.dtype == np.float32
    assert client.x.tobytes() == vertices.tobytes()
    assert np.array_equal(client.triangles, triangles)
    client.send(do="close")
    with pytest.raises(ConnectionClosed) as closed:
        client.until(lambda c: False)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1000


def test_thickness_is_painted_taken_back_and_replayed_to_the_same_bytes(live: Served, tmp_path: Path) -> None:
    """As pace is: the brush of docs/sessions.md, which grows nothing here but the sheet's thickness."""
    client = live.client({"shape": "disc", "thickness": 0.04, "tools": [], "step": 0.05}, fields=["sheet_thickness"])
    assert client.opened()["fields"] == ["sheet_thickness"]
    client.until(lambda c: c.frames)
    assert set(client.frames[-1]["fields"][0]) == {np.float32(0.04)}
    brush = {"radius": 0.6, "stretch": [1, 1], "kernel": "flat", "thickening": 8.0, "hold": 0.1}
    for x in (0.3, 0.4):
        client.do("brush", at=[x, 0, 0], **brush)
        client.rest()  # as docs/sessions.md asks a painter: two dabs within one step hold as long as one
    client.ask("lift")
    client.do("play", until=0.2)
    client.rest()
    painted = client.x.copy(), client.frames[-1]["fields"][0].copy()
    assert painted[1].max() == pytest.approx(0.04 * 8**0.15, rel=0.05)
    assert painted[1].min() == pytest.approx(0.04, rel=1e-6)
    client.do("undo")
    client.do("undo")
    client.rest()
    assert client.state["undo"] == 0
    assert set(client.frames[-1]["fields"][0]) == {np.float32(0.04)}
    client.do("redo")
    client.do("redo")
    client.rest()
    assert client.x.tobytes() == painted[0].tobytes()
    assert np.array_equal(client.frames[-1]["fields"][0], painted[1])
    client.do("settle")
    client.rest()
    saved = client.ask("save")
    assert "thickening = 8.0" in saved["toml"]
    vertices, triangles = mesh(saved, tmp_path)
    assert client.x.tobytes() == vertices.tobytes()
    assert np.array_equal(client.triangles, triangles)
    client.end()


def test_a_solid_around_the_whole_sheet_is_refused_and_the_session_goes_on(live: Served) -> None:
    client = live.client({"shape": "disc", "thickness": 0.05, "tools": [], "step": 0.05})
    client.opened()
    client.until(lambda c: c.frames)
    said = client.ask("solid", solid={"kind": "ball", "radius": 3})
    assert said["say"] == "error"
    assert said["problem"]["type"] == "urn:wizen:problem:invalid-geometry"
    assert said["problem"]["status"] == 422
    assert "wholly inside it, a ball" in said["problem"]["detail"]
    assert said["problem"]["advice"]
    # it lies beside, and it is painted on
    assert client.do("solid", solid={"kind": "ball", "centre": [0, 0, -3], "radius": 1})["solid"] == 0
    client.do("brush", at=[0.5, 0, 0])
    client.rest()
    assert client.frames[-1]["stage"] > 0
    assert client.state["undo"] == 2
    client.end()


def test_a_step_without_an_equilibrium_is_an_error_and_the_session_goes_on(live: Served) -> None:
    """Lengths that grow a thousandfold against all reason: whatever comes of it, it can be taken back."""
    client = live.client({**BALL, "thickness": 0.5, "step": 1.0, "imperfection": 1.0, "shape": "disc"})
    client.opened()
    client.do("add", tool={"kind": "surface", "where": {"kind": "rim", "width": 0.3}, "stretch": [10, 0.1]})
    client.until(lambda c: c.state.get("working") is False and c.told[-1]["say"] != "done")
    client.do("undo")
    client.rest()
    assert client.frames[-1]["stage"] == 0
    client.end()


def _pierced(x: np.ndarray, triangles: np.ndarray) -> int:
    """Pairs of triangles without a common corner of which an edge of one passes through the other, by volumes."""

    def side(*corners: np.ndarray) -> float:
        a, b, c, d = corners
        return float(np.sign(np.dot(np.cross(b - a, c - a), d - a)))

    def through(edge: np.ndarray, face: np.ndarray) -> bool:
        p, q = edge
        turns = {side(p, q, face[k], face[(k + 1) % 3]) for k in range(3)}
        return side(*face, p) * side(*face, q) < 0 and len(turns) == 1

    corners = x.astype(float)[triangles]
    pairs = [(a, b) for b in range(len(triangles)) for a in range(b) if not {*triangles[a]} & {*triangles[b]}]
    return sum(
        any(
            through(one[[k, (k + 1) % 3]], other) for k in range(3) for one, other in (corners[[a, b]], corners[[b, a]])
        )
        for a, b in pairs
    )


@pytest.mark.slow
def test_a_session_says_where_its_sheet_passes_through_itself(live: Served) -> None:
    """Two squares that cross, as they may without contact, and the ball, which crosses nothing."""
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    points = square + [[x + 0.1, 0.45, y - 0.4] for x, y, _ in square]
    mesh = {"points": points, "faces": [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]}
    for params in ({"mesh": mesh, "tools": [], "contact": 0.0, "step": 0.05}, BALL):
        client = live.client(params)
        client.opened()
        assert client.do("add", tool={"kind": "surface", "where": {"kind": "everywhere"}, "stretch": [1.2, 1.2]})
        client.rest()
        client.until(lambda c: c.state.get("crossings") is not None)
        found = _pierced(client.x, client.triangles) if "mesh" in params else 0
        assert client.state["crossings"] == found
        assert (found > 0) == ("mesh" in params)
        assert any(said.get("crossings", 0) is None for said in client.told), "nothing is said of a shape on its way"
        client.send(do="close")
        client.close()


def test_quality_grows_the_same_script_on_another_mesh(live: Served) -> None:
    client = live.client()
    client.opened()
    client.do("brush", at=[0, 0, 1], radius=0.8, stretch=[3, 3])
    client.rest()
    coarse = client.frames[-1]
    assert client.do("quality", quality="default")["say"] == "done"
    client.rest()
    assert client.frames[-1]["vertices"] > 2 * coarse["vertices"]
    assert client.frames[-1]["stage"] == coarse["stage"]
    saved = client.ask("save")
    assert saved["say"] == "saved"
    assert saved["quality"] == "default"
    client.end()


def test_a_solver_s_page_says_what_its_sessions_understand(client: Any) -> None:
    page = client.get("/v1/solvers/growth").json()["session"]
    assert page["address"] == "/v1/sessions/growth"
    assert set(page["actions"]) == {"brush", "lift", "add", "solid", "end"}
    assert "stretch" in page["actions"]["brush"]["properties"]
    assert client.get("/v1/solvers/wood").json()["session"] is None
    json.dumps(page)
