"""Which triangles a shape is made of: said in every format without them, and what `crossings` and `volume` count on.

The triangles are built here from what an answer says, and from nothing else; crossings are counted by a check that
shares no code with the service's: an edge of one triangle passes through another (Moeller and Trumbore).
"""

from __future__ import annotations

import io
import json
import shutil
import subprocess
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from numpy.typing import NDArray

from service import page
from service.formats import mesh
from store import starter

from ._shapes import points
from .conftest import client_of

Floats, Ints = NDArray[np.float64], NDArray[np.intp]
SHAPE = "/v1/shapes/dehydration"
#: Folded shapes: a table, its parameters and a stage, on which the other diagonal crosses.
FOLDED = {"table": "raisin", "s": 0.3, "resolution": 48}
VIEWER = Path(page.__file__).parent / "viewer"


def joined(lattice: Mapping[str, Any], turned: bool = False) -> Ints:
    """Return the triangles (4 n^2, 3) that `lattice` of an answer says; `turned`: along the other diagonal."""
    n, wide = lattice["colatitude"], lattice["azimuth"]
    here = np.arange(n * wide).reshape(n, wide)
    poles = {"north": n * wide, "south": n * wide + 1}

    def corner(step: Any, rows: Ints) -> Ints:
        if isinstance(step, str):
            return np.full(rows.size, poles[step])
        return np.roll(here, -step[1], axis=1)[rows[:, 0] // wide + step[0]].ravel()

    quads = lattice["triangles"]["quads"]
    if turned:
        quads = [[[0, 0], [0, 1], [1, 1]], [[0, 0], [1, 1], [1, 0]]]
    found = [np.stack([corner(step, here[:-1]) for step in one], axis=1) for one in quads]
    for row, one in zip((here[:1], here[-1:]), lattice["triangles"]["fans"], strict=True):
        found.append(np.stack([corner(step, row) for step in one], axis=1))
    return np.concatenate(found)


def crossing_pairs(positions: Floats, triangles: Ints) -> int:
    """Return how many pairs of triangles without a common corner pass through each other."""
    boxes = positions[triangles]
    low, high = boxes.min(axis=1), boxes.max(axis=1)
    order = np.argsort(low[:, 0])
    ends = np.searchsorted(low[order, 0], high[order, 0], side="right")
    first = np.repeat(np.arange(len(order)), ends - np.arange(len(order)) - 1)
    second = np.concatenate([np.arange(i + 1, end) for i, end in enumerate(ends)])
    i, j = order[first], order[second]
    near = (low[i] <= high[j]).all(axis=1) & (low[j] <= high[i]).all(axis=1)
    i, j = i[near], j[near]
    apart = ~(triangles[i][:, :, None] == triangles[j][:, None, :]).any(axis=(1, 2))
    i, j = i[apart], j[apart]
    return int((pierced(positions, triangles[i], triangles[j]) | pierced(positions, triangles[j], triangles[i])).sum())


def pierced(positions: Floats, edges: Ints, faces: Ints) -> NDArray[np.bool_]:
    a, b, c = (positions[faces[:, k]] for k in range(3))
    found = np.zeros(len(faces), bool)
    for k, m in ((0, 1), (1, 2), (2, 0)):
        start = positions[edges[:, k]]
        way = positions[edges[:, m]] - start
        across = np.cross(way, c - a)
        volume = np.einsum("ij,ij->i", b - a, across)
        volume[volume == 0] = np.inf
        u = np.einsum("ij,ij->i", start - a, across) / volume
        over = np.cross(start - a, b - a)
        v = np.einsum("ij,ij->i", way, over) / volume
        t = np.einsum("ij,ij->i", c - a, over) / volume
        found |= (u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < 1)
    return found


def enclosed(positions: Floats, triangles: Ints) -> float:
    a, b, c = positions[triangles].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.fixture(scope="module")
def packed() -> Any:
    with client_of(starter.ROOT) as client:
        yield client


def _npz(data: bytes) -> tuple[dict[str, Any], Floats]:
    with np.load(io.BytesIO(data)) as archive:
        return json.loads(str(archive["about"])), np.concatenate([archive["position"].reshape(-1, 3), archive["poles"]])


@pytest.mark.parametrize("read", [points, _npz], ids=["points", "npz"])
def test_triangles_follow_from_the_answer_alone(packed: httpx.Client, read: Any) -> None:
    kind = "points" if read is points else "npz"
    turned = 0
    for point in ({"te": 0.0102, "gamma": 13.2}, {"te": 0.0124, "gamma": 9.5}, {"te": 0.0124, "gamma": 11.0}):
        answer = packed.get(SHAPE, params={**FOLDED, **point, "format": kind})
        assert answer.status_code == 200, answer.text
        about, found = read(answer.content)
        positions, triangles = found.astype(float), joined(about["lattice"])
        assert np.array_equal(np.sort(triangles, axis=0), np.sort(mesh.triangles(48).astype(np.intp), axis=0))
        edges = {tuple(edge) for one in triangles.tolist() for edge in pairwise([*one, one[0]])}
        assert len(edges) == 3 * len(triangles)  # each once in each sense: closed, wound one way
        assert {(b, a) for a, b in edges} == edges
        assert crossing_pairs(positions, triangles) == about["crossings"]
        assert about["volume"] == pytest.approx(enclosed(positions, triangles), rel=1e-6)
        turned += crossing_pairs(positions, joined(about["lattice"], turned=True))
    assert turned > 0  # so it matters which, and the count can fail


def test_a_batch_says_it_too(packed: httpx.Client) -> None:
    asked = {"solver": "dehydration", "table": "sphere-01", "resolution": 24}
    asked |= {"points": {"gamma": [11, 18], "s": 0.3}}
    with np.load(io.BytesIO(packed.post("/v1/shapes:batch", json={**asked, "format": "npz"}).content)) as archive:
        triangles = joined(json.loads(str(archive["about"]))["lattice"])
        for k in range(2):
            positions = np.concatenate([archive["position"][k].reshape(-1, 3), archive["poles"][k]]).astype(float)
            assert archive["crossings"][k] == crossing_pairs(positions, triangles)
            assert archive["volume"][k] == pytest.approx(enclosed(positions, triangles), rel=1e-6)
    lines = packed.post("/v1/shapes:batch", json={**asked, "format": "json"}).text.splitlines()
    for line in map(json.loads, lines):
        assert np.array_equal(joined(line["lattice"]), triangles)
        assert line["volume"] is None  # nothing was computed to measure it on


def test_json_measures_the_mesh_where_its_positions_are_asked_for(packed: httpx.Client) -> None:
    asked = {"table": "sphere-01", "gamma": 12, "s": 0.25, "resolution": 32}
    about = points(packed.get(SHAPE, params={**asked, "format": "points"}).content)[0]
    plain = packed.get(f"{SHAPE}/info", params=asked).json()
    assert plain["volume"] is plain["crossings"] is None
    for path in (SHAPE, f"{SHAPE}/info"):
        measured = packed.get(path, params={**asked, "fields": "position"}).json()
        assert measured["crossings"] == about["crossings"]
        assert measured["volume"] == about["volume"]
        assert measured["lattice"] == about["lattice"]
    # what the runs had is called theirs
    assert measured["descriptors"]["volume"]["long_name"].endswith("(of the runs)")


def test_a_part_has_quads_and_no_poles(packed: httpx.Client) -> None:
    asked = {"table": "sphere-01", "gamma": 12, "s": 0.2, "resolution": 32, "region": "45:90,350:20"}
    with np.load(io.BytesIO(packed.get(SHAPE, params={**asked, "format": "npz"}).content)) as archive:
        about, shape = json.loads(str(archive["about"])), archive["position"].shape
    assert (about["lattice"]["colatitude"], about["lattice"]["azimuth"]) == shape[:2]
    assert about["lattice"]["triangles"]["fans"] == []
    assert about["volume"] is None


def test_the_page_draws_the_same_triangles(tmp_path: Path) -> None:
    """As the page's own code builds them, with the normals that it draws."""
    compiler = VIEWER / "node_modules" / "typescript" / "lib" / "typescript.js"
    if shutil.which("node") is None or not compiler.exists():
        pytest.skip("no node, or the page was not built: make page")
    script = tmp_path / "surface.mjs"
    script.write_text(
        f"import ts from {json.dumps(str(compiler))}; import fs from 'node:fs';"
        f"const text = fs.readFileSync({json.dumps(str(VIEWER / 'src/view/surface.ts'))}, 'utf8');"
        "const code = ts.transpileModule(text, {compilerOptions: {module: 'ES2022', target: 'ES2022'}}).outputText;"
        f"fs.writeFileSync({json.dumps(str(tmp_path / 'made.mjs'))}, code);"
        f"const made = await import({json.dumps(str(tmp_path / 'made.mjs'))});"
        "const n = 6, corners = made.triangles(n), p = Float32Array.from({length: 3 * made.vertexCount(n)}, "
        "(_, k) => Math.sin(k * k)), out = new Float32Array(p.length); made.normals(p, corners, out);"
        "console.log(JSON.stringify({corners: [...corners], p: [...p], out: [...out]}));"
    )
    done = subprocess.run(["node", str(script)], capture_output=True, text=True, check=True)
    found = {name: np.array(values) for name, values in json.loads(done.stdout).items()}
    triangles = found["corners"].reshape(-1, 3)
    assert {tuple(one) for one in triangles.tolist()} == {tuple(one) for one in mesh.triangles(6).tolist()}
    positions = found["p"].reshape(-1, 3)
    normals, poles = mesh.normals(positions[:-2].reshape(6, 12, 3).astype(np.float32), positions[-2:].astype("f4"))
    assert np.allclose(found["out"].reshape(-1, 3), mesh.vertices(normals, poles), atol=1e-5)
