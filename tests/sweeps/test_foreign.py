"""Mesh files by people who mean harm: each ends in a sentence, at once, with nothing else opened on the way."""

from __future__ import annotations

import gzip
import io
import json
import os
import resource
import struct
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.errors import InvalidQuery
from service.sequences.imported import load
from solver.decay.surfaces.surface import geodesic
from sweeps.commands.terminal.options import assignments
from sweeps.errors import InvalidOption

trimesh = pytest.importorskip("trimesh")

BILLION = 2**30
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def ply(elements: str, body: bytes = b"", kind: str = "binary_little_endian") -> bytes:
    return f"ply\nformat {kind} 1.0\n{elements}\nend_header\n".encode() + body


def glb(change: Callable[[Any], Any] = lambda page: None, cut: int = 0, binary: bytes | None = None) -> bytes:
    """Return a sound triangle with something done to its JSON."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    held = points + np.array([0, 1, 2, 0], "<u2").tobytes() if binary is None else binary
    page: Any = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
        ],
        "buffers": [{"byteLength": len(held)}],
    }
    change(page)
    text = json.dumps(page).encode()
    text += b" " * (-len(text) % 4)
    whole = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(held), b"BIN\0") + held
    return (struct.pack("<4sII", b"glTF", 2, 12 + len(whole)) + whole)[: len(whole) + 12 - cut]


def zipped(data: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.obj", data)
    return file.getvalue()


def update(part: str, i: int, **values: Any) -> Callable[[Any], Any]:
    return lambda page: page[part][i].update(values)


def lines(n: int) -> Any:
    """n nodes, each hanging twice below the one before: 2^n meshes."""
    return lambda page: page.update(nodes=[*({"children": [i + 1, i + 1]} for i in range(n)), {"mesh": 0}])


def ring(page: Any) -> None:
    page.update(nodes=[{"mesh": 0, "children": [1]}, {"children": [0]}])


def deep(n: int) -> bytes:
    return struct.pack("<4sII", b"glTF", 2, 20 + n) + struct.pack("<I4s", n, b"JSON") + b"[" * n


HOSTILE: dict[str, tuple[str, bytes]] = {
    "a gzip bomb": ("a.obj", gzip.compress(b"v 0 0 0\n" * 10**6)),
    "a zip bomb": ("a.obj", zipped(b"v 0 0 0\n" * 10**6)),
    "no vertices": ("a.obj", b"f 1 2 3\n"),
    "NaN": ("a.obj", OBJ.replace("1 0 0", "nan 0 0").encode() + b"f 1 2 3\n"),
    "infinity": ("a.obj", OBJ.replace("1 0 0", "1e999 0 0").encode() + b"f 1 2 3\n"),
    "beyond all measure": ("a.obj", OBJ.replace("1 0 0", "1e300 0 0").encode() + b"f 1 2 3\n"),
    "a corner that is none": ("a.obj", OBJ.encode() + b"f 1 2 99999999999999999999\n"),
    "a corner before the first": ("a.obj", OBJ.encode() + b"f 1 2 -9\n"),
    "two numbers for a point": ("a.obj", b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n"),
    "a line without end": ("a.obj", b"f" + b" 1" * 10**6),
    "bytes for text": ("a.obj", np.random.default_rng(0).bytes(2000) + b"\0"),
    "a billion triangles in 84 bytes": ("a.stl", bytes(80) + struct.pack("<I", BILLION)),
    "a triangle too few": ("a.stl", bytes(80) + struct.pack("<I", 2) + bytes(50)),
    "NaN in an STL": ("a.stl", bytes(80) + struct.pack("<I", 1) + struct.pack("<12f", *[np.nan] * 12) + bytes(2)),
    "an empty STL": ("a.stl", b""),
    "a billion points in a line": (
        "a.ply",
        ply(f"element vertex {BILLION}\nproperty float x\nproperty float y\nproperty float z"),
    ),
    "a negative count": ("a.ply", ply("element vertex -1\nproperty float x")),
    "a count that is no number": ("a.ply", ply("element vertex many\nproperty float x")),
    "more points than bytes": (
        "a.ply",
        ply("element vertex 100000\nproperty float x\nproperty float y\nproperty float z", bytes(120)),
    ),
    "a type that is none": ("a.ply", ply("element vertex 1\nproperty quad x", bytes(16))),
    "a header without end": ("a.ply", b"ply\nformat ascii 1.0\n" + b"comment x\n" * 10**5),
    "a file elsewhere": ("a.glb", glb(update("buffers", 0, uri="../../../../etc/passwd"))),
    "an address elsewhere": ("a.glb", glb(update("buffers", 0, uri="http://127.0.0.1:9/a.bin"))),
    "an image elsewhere": ("a.glb", glb(lambda page: page.update(images=[{"uri": "/etc/passwd"}]))),
    "more elements than bytes": ("a.glb", glb(update("accessors", 0, count=7_000_000))),
    "a billion elements of nothing": ("a.glb", glb(lambda page: page["accessors"][0].pop("bufferView"))),
    "a view outside": ("a.glb", glb(update("bufferViews", 0, byteOffset=-36))),
    "a view beyond the end": ("a.glb", glb(update("bufferViews", 0, byteLength=BILLION))),
    "an index from the end": ("a.glb", glb(update("accessors", 0, bufferView=-1))),
    "nodes in a ring": ("a.glb", glb(ring)),
    "a billion copies": ("a.glb", glb(lines(30))),
    "a length that is not its own": ("a.glb", glb(cut=3)),
    "JSON without end": ("a.glb", deep(10**5)),
    "not a mesh at all": ("a.exe", b"MZ"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_each_is_refused_in_a_sentence(name: str, tmp_path: Path) -> None:
    file, data = HOSTILE[name]
    path = tmp_path / file
    path.write_bytes(data)
    begin, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InvalidQuery) as said:
        load(path)
    with pytest.raises(InvalidOption) as typed:
        assignments([f"mesh=@{path}"])
    for error in (said.value, typed.value):
        assert error.advice
        assert len(str(error)) < 500
    assert time.process_time() - begin < 5
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000, "kilobytes"


def test_an_accessor_without_bytes_is_called_so(tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(HOSTILE["a billion elements of nothing"][1])
    with pytest.raises(InvalidQuery, match="no bytes of its own"):
        load(path)


def test_nothing_else_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Materials of an OBJ lie elsewhere; the mesh is read without them."""
    (tmp_path / "secret.mtl").write_text("newmtl secret\n")
    (tmp_path / "a.obj").write_text("mtllib secret.mtl\nmtllib /etc/passwd\n" + OBJ + "usemtl secret\nf 1 2 3\n")
    opened: list[str] = []
    real = os.open

    def watched(path: Any, *values: Any, **named: Any) -> int:
        opened.append(str(path))
        return real(path, *values, **named)

    monkeypatch.setattr(os, "open", watched)
    import builtins

    plain = builtins.open

    def noted(path: Any, *values: Any, **named: Any) -> Any:
        opened.append(str(path))
        return plain(path, *values, **named)

    monkeypatch.setattr(builtins, "open", noted)
    assert len(load(tmp_path / "a.obj")[1]) == 1
    assert len(assignments([f"mesh=@{tmp_path}/a.obj"])["mesh"]["faces"]) == 1
    assert not [path for path in opened if "secret" in path or "passwd" in path]


def test_a_directory_and_a_pipe_are_no_meshes(tmp_path: Path) -> None:
    (tmp_path / "a.obj").mkdir()
    os.mkfifo(tmp_path / "b.obj")
    for name in ("a.obj", "b.obj", "none.obj"):
        with pytest.raises(InvalidQuery, match="no such file"):
            load(tmp_path / name)


@pytest.mark.parametrize("kind", ["obj", "ply", "glb", "stl"])
def test_sound_ones_pass(kind: str, tmp_path: Path) -> None:
    points, faces = geodesic(4)
    trimesh.Trimesh(points, faces, process=False).export(tmp_path / f"a.{kind}")
    found, triangles = load(tmp_path / f"a.{kind}")
    assert np.isclose(np.linalg.norm(found, axis=1), 1, atol=1e-6).all()
    assert len(triangles) == len(faces)
    (tmp_path / "b.glb").write_bytes(glb())
    assert len(load(tmp_path / "b.glb")[1]) == 1
    if kind in ("ply", "stl"):
        text = trimesh.Trimesh(points, faces, process=False).export(
            file_type=kind, **({"encoding": "ascii"} if kind == "ply" else {})
        )
        data = text if isinstance(text, bytes) else text.encode()
        (tmp_path / f"c.{kind}").write_bytes(data)
        assert len(load(tmp_path / f"c.{kind}")[1]) == len(faces)
