"""Meshes of one's own over HTTP: read into parameters, asked for as jobs, and refused where they are none."""

from __future__ import annotations

import gzip
import json
import struct
from typing import Any

import httpx
import numpy as np
import pytest
import trimesh

from service.jobs import views
from solver import registry
from store.ledger.jobs import Written


def torus() -> bytes:
    return bytes(
        trimesh.creation.torus(2.0, 0.5, major_sections=24, minor_sections=12).export(file_type="obj"), "ascii"
    )


def glb_elsewhere() -> bytes:
    text = json.dumps(
        {"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": "file:///etc/hostname"}]}
    ).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<III", 0x46546C67, 2, 20 + len(text)) + struct.pack("<II", len(text), 0x4E4F534A) + text


_PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\nproperty float y\n"
_PLY += b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" + bytes(64)
#: What no reader may see, or would choke on: media type, bytes, a word of the reason.
HOSTILE = {
    "more points than bytes": ("model/ply", _PLY, "2000000000"),
    "another file": ("model/gltf-binary", glb_elsewhere(), "cannot be read"),
    "packed": ("model/obj", gzip.compress(torus()), "compressed"),
    "a billion triangles": ("model/stl", bytes(80) + struct.pack("<I", 10**9) + bytes(50), "triangles"),
    "no number": ("model/obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
    "no vertex": ("model/obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "corners"),
    "one place": ("model/obj", b"v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "no triangle"),
    "nothing": ("model/obj", b"", "triangles"),
    "a program": ("application/x-msdownload", b"MZ" + bytes(60), "is not read here"),
    "bytes of a program": ("application/octet-stream", b"MZ" + bytes(60), "none of .obj, .glb, .stl, .ply"),
    "bytes of line ends alone": ("application/octet-stream", b"\n" * 1_000_000, "none of"),
    "bytes of a picture": ("application/octet-stream", b"\x89PNG\r\n\x1a\n" + bytes(60), "none of"),
}


def test_a_mesh_becomes_a_jobs_parameter(queue_only: httpx.Client) -> None:
    sent = queue_only.post("/v1/meshes", content=torus(), headers={"Content-Type": "model/obj"})
    assert sent.status_code == 200, sent.text
    page: dict[str, Any] = sent.json()
    given = trimesh.load_mesh(trimesh.util.wrap_as_stream(torus().decode()), file_type="obj", process=False)
    points = np.array(page["mesh"]["points"])
    assert page["borders"] == 0
    assert (page["points"], page["faces"]) == (len(points), len(given.faces)) == (288, 576)
    assert page["unit"] == pytest.approx(2.5)
    # its middle is the origin, half its longest side 1, and nothing else is changed
    own = np.array(given.vertices)
    assert np.abs(points - own / 2.5).max() < 1e-6
    assert np.abs(points).max() == pytest.approx(1.0)
    need = {"stages": [0], "quality": "preview", "fields": ["rot"]}
    asked = {"solver": "decay", "preset": "apple", "params": {"mesh": page["mesh"]}, "need": need}
    job = queue_only.post("/v1/jobs", json=asked)
    assert job.status_code == 202, job.text
    assert job.json()["params"]["mesh"]["faces"] == page["mesh"]["faces"]
    [listed] = queue_only.get("/v1/jobs").json()["jobs"]
    assert listed["omitted"] == ["mesh"]
    assert "mesh" not in listed["params"]
    whole = queue_only.get(f"/v1/jobs/{job.json()['id']}").json()
    assert whole["omitted"] == []
    assert whole["params"]["mesh"]["points"] == page["mesh"]["points"]


def test_cancelling_reads_and_answers_no_mesh(queue_only: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mesh of 98,000 vertices took a second of processor in DELETE, beside the thread that has to end the run."""
    mesh = queue_only.post("/v1/meshes", content=torus(), headers={"Content-Type": "model/obj"}).json()["mesh"]
    asked = {"solver": "growth", "params": {"mesh": mesh}, "need": {"stages": [0.1], "quality": "preview"}}
    url = queue_only.post("/v1/jobs", json=asked).headers["location"]
    read: list[str] = []
    checked: list[str] = []
    reading, finding = Written._read, registry.get

    def counted(self: Written) -> dict[str, Any]:
        if self._values is None:
            read.append("once")
        return reading(self)

    def found(name: str) -> Any:
        checked.append(name)
        return finding(name)

    monkeypatch.setattr(Written, "_read", counted)
    monkeypatch.setattr(registry, "get", found)
    cancelled = queue_only.delete(url)
    assert (cancelled.status_code, cancelled.json()["state"]) == (200, "cancelled")
    assert cancelled.json()["omitted"] == ["mesh"]
    assert cancelled.json()["params"]["thickness"] > 0
    assert len(cancelled.content) < 3000
    [listed] = queue_only.get("/v1/jobs").json()["jobs"]
    assert listed["omitted"] == ["mesh"]
    assert read == checked == []
    # the job itself has it still
    assert queue_only.get(url).json()["params"]["mesh"]["faces"] == mesh["faces"]
    # as another process of the service, which did not hear the question: it looks which parameters are long, once
    queue_only.post("/v1/jobs", json=asked)
    views._KNOWN.clear()
    views._SHORT.clear()
    read.clear()
    checked.clear()
    assert queue_only.delete(url).json()["omitted"] == ["mesh"]
    assert (read, checked) == (["once"], [])


@pytest.mark.parametrize("kind", ["obj", "glb", "stl", "ply", "stl_ascii"])
def test_bytes_tell_which_kind_of_mesh_they_are(queue_only: httpx.Client, kind: str) -> None:
    """Clients that are made from the OpenAPI page send every file as bytes."""
    given = trimesh.creation.icosphere(subdivisions=1)
    data = given.export(file_type=kind)
    content = data.encode() if isinstance(data, str) else data
    sent = queue_only.post("/v1/meshes", content=content, headers={"Content-Type": "application/octet-stream"})
    assert sent.status_code == 200, sent.text
    assert (sent.json()["points"], sent.json()["faces"], sent.json()["borders"]) == (42, 80, 0)


def test_a_mesh_as_it_is_keeps_its_units(queue_only: httpx.Client) -> None:
    text = b"v 10 0 0\nv 14 0 0\nv 10 3 0\nvt 0.1 0.2\nvt 0.30000000000000004 0.4\nvt 0.5 0.6\nf 1/1 2/2 3/3\n"
    page = queue_only.post("/v1/meshes?fit=false", content=text, headers={"Content-Type": "model/obj"}).json()
    assert page["mesh"]["points"] == [[10, 0, 0], [14, 0, 0], [10, 3, 0]]
    assert page["mesh"]["uv"][1][0] == 0.30000000000000004
    assert (page["borders"], page["unit"]) == (3, 1)


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_no_mesh_is_refused_with_advice(queue_only: httpx.Client, name: str) -> None:
    media, data, word = HOSTILE[name]
    refused = queue_only.post("/v1/meshes", content=data, headers={"Content-Type": media})
    problem = refused.json()
    assert (refused.status_code, problem["type"]) == (422, "urn:wizen:problem:invalid-query")
    assert word in problem["detail"]
    assert problem["advice"]
    assert "/tmp" not in refused.text


def test_reading_takes_a_token(queue_only: httpx.Client) -> None:
    del queue_only.headers["Authorization"]
    assert queue_only.post("/v1/meshes", content=torus(), headers={"Content-Type": "model/obj"}).status_code == 401
