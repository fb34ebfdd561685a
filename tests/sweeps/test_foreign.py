"""Mesh files by people who mean harm: each ends in a sentence, at once, with nothing else opened on the way."""

from __future__ import annotations

import gzip
import io
import json
import math
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


def many(primitives: int = 1, attributes: int = 1, listed: int = 1, floats: int = 20_000) -> bytes:
    """A mesh that names one accessor over and over: few numbers in the file, and many once it is read."""

    def change(page: Any) -> None:
        named = {"POSITION": 0, **{f"_{i}": 0 for i in range(1, attributes)}}
        page["meshes"] = [{"primitives": [{"attributes": named}] * primitives}]
        page["scenes"] = [{"nodes": [0] * listed}]
        page["accessors"] = [{"bufferView": 0, "componentType": 5126, "count": floats // 3, "type": "VEC3"}]
        page["bufferViews"] = [{"buffer": 0, "byteLength": 4 * floats}]

    return glb(change, binary=bytes(4 * floats))


def aliased(n: int) -> bytes:
    """Accessors that all are of the same bytes."""

    def change(page: Any) -> None:
        page["bufferViews"].append({"buffer": 0, "byteLength": 300_000})
        page["accessors"] += [{"bufferView": 2, "componentType": 5126, "count": 25_000, "type": "VEC3"}] * n

    return glb(change, binary=bytes(300_000))


def chain(n: int) -> Any:
    """n nodes below each other, each with a mesh."""
    return lambda page: page.update(nodes=[*({"mesh": 0, "children": [i + 1]} for i in range(n)), {"mesh": 0}])


def grouped(groups: int, faces: int) -> bytes:
    """Faces that all are in all of many groups."""
    return OBJ.encode() + b"g " + b" ".join(b"%x" % i for i in range(groups)) + b"\n" + b"f 1 2 3\n" * faces


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
    "lines without anything": ("a.obj", b"\n" * 60_000),
    "as many groups as faces": ("a.obj", grouped(8000, 8000)),
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
    "an endless count": ("a.glb", glb(update("accessors", 0, count=math.inf))),
    "elements in each other": ("a.glb", glb(update("bufferViews", 0, byteStride=4))),
    "elements in one place": ("a.glb", glb(update("bufferViews", 0, byteStride=0))),
    "one accessor in many primitives": ("a.glb", many(2000)),
    "one accessor as many attributes": ("a.glb", many(30, attributes=500)),
    "one node in a scene many times": ("a.glb", many(listed=2000)),
    "one view in many accessors": ("a.glb", aliased(3000)),
    "nodes that hang deep": ("a.glb", glb(chain(3000))),
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


def test_pictures_within_are_not_opened(tmp_path: Path) -> None:
    """Readers make one picture of those of several materials: of few bytes, and of as many pixels as they say."""
    from PIL import Image

    file = io.BytesIO()
    Image.new("L", (5000, 5000)).save(file, "PNG", compress_level=1)
    picture = file.getvalue() + bytes(-len(file.getvalue()) % 4)
    corners = np.array([[0, 0], [1, 0], [0, 1]], "<f4").tobytes()
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()

    def change(page: Any) -> None:
        named = {"POSITION": 0, "TEXCOORD_0": 1}
        page["meshes"] = [{"primitives": [{"attributes": named, "material": i} for i in range(3)]}]
        colours = [{"baseColorFactor": [1, 1, i / 3, 1], "baseColorTexture": {"index": 0}} for i in range(3)]
        page["materials"] = [{"pbrMetallicRoughness": one} for one in colours]
        page |= {"textures": [{"source": 0}], "images": [{"bufferView": 2, "mimeType": "image/png"}]}
        page["accessors"][1] = {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}
        page["bufferViews"][1]["byteLength"] = 24
        page["bufferViews"].append({"buffer": 0, "byteOffset": 60, "byteLength": len(picture)})

    (tmp_path / "a.glb").write_bytes(glb(change, binary=points + corners + picture))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert len(load(tmp_path / "a.glb")[1]) == 3
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000, "kilobytes"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a billion elements of nothing", "no bytes of its own"),
        ("a billion copies", "two parents"),
        ("nodes in a ring", "in a ring"),
        ("nodes that hang deep", "too deep"),
        ("elements in each other", "in each other"),
        ("one node in a scene many times", "points or triangles are more than"),
    ],
)
def test_what_is_wrong_with_it_is_called_so(name: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(HOSTILE[name][1])
    with pytest.raises(InvalidQuery, match=said):
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
