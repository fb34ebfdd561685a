"""Mesh files of others: looked at before any reader allocates, follows or unpacks what they say.

A file may name a billion triangles in a hundred bytes, point at other files, hang its nodes in a ring or be compressed.
Readers believe it. Here its own size is the measure: what it promises must fit into it.
"""

from __future__ import annotations

import io
import json
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np

from solver.arrays import Array

from .errors import SweepError, installing

__all__ = ["KINDS", "ForeignMesh", "NoReader", "checked", "read", "sound"]

KINDS = (".obj", ".ply", ".glb", ".stl")
#: Largest file [bytes], most points and most triangles; a line of text, a header and a glTF's JSON are short [bytes].
_LARGEST, _MOST = 512 << 20, 8_000_000
_LINE, _HEADER, _JSON = 1 << 16, 1 << 16, 32 << 20
_PACKED = {b"\x1f\x8b": "gzip", b"PK\x03\x04": "zip", b"BZh": "bzip2", b"\xfd7zXZ": "xz", b"(\xb5/\xfd": "zstd"}
_TYPES = {"char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2, "int": 4}
_TYPES |= {"uint": 4, "int32": 4, "uint32": 4, "float": 4, "float32": 4, "double": 8, "float64": 8}
#: glTF 2.0: bytes of a component, components of an element.
_COMPONENTS = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_ELEMENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


class ForeignMesh(SweepError):
    """A mesh file that is not what it says, or asks for more than it holds."""

    code = "foreign-mesh"

    def __init__(self, path: Path, why: str, advice: str = "Write it anew as OBJ, PLY, GLB or STL.") -> None:
        super().__init__(f"{path.name[:80]} cannot be read ({why}).", advice)
        self.why = why


class NoReader(SweepError):
    """There is nothing here that reads meshes."""

    code = "unavailable"


def checked(path: Path) -> bytes:
    """Return the content of a mesh file once nothing in it can lead a reader astray.

    Raises:
        ForeignMesh: it is none, too large, compressed, points elsewhere, or promises more than it holds.

    """
    if path.suffix.lower() not in KINDS:
        raise ForeignMesh(path, "it is no mesh", f"Known: {', '.join(KINDS)}.")
    try:
        if not path.is_file():
            raise ForeignMesh(path, "there is no such file", "Name a mesh file.")
        size = path.stat().st_size
        if size > _LARGEST:
            raise ForeignMesh(path, f"{size} bytes are more than {_LARGEST}", "Thin it out first.")
        data = path.read_bytes()
    except OSError as error:
        raise ForeignMesh(path, error.strerror or str(error), "Name a file that you may read.") from None
    for mark, name in _PACKED.items():
        if data.startswith(mark):
            raise ForeignMesh(path, f"it is compressed by {name}", "Unpack it first.")
    try:
        {".obj": _obj, ".ply": _ply, ".glb": _glb, ".stl": _stl}[path.suffix.lower()](data)
    except _Wrong as error:
        raise ForeignMesh(path, str(error)) from None
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError, struct.error) as error:
        raise ForeignMesh(path, f"{type(error).__name__}: {error}"[:200]) from None
    return data


def read(path: Path) -> Any:
    """Return a mesh file as trimesh has it, points in the file's own order; nothing else is opened on the way.

    Raises:
        ForeignMesh: it cannot be read.
        NoReader: trimesh is not installed.

    """
    data = checked(path)
    try:
        import trimesh
    except ImportError:
        raise NoReader("meshes need the package trimesh.", installing("formats")) from None
    try:
        return trimesh.load(
            io.BytesIO(data), file_type=path.suffix.lower()[1:], resolver=None, force="mesh", process=False
        )
    except Exception as error:  # readers of foreign files stumble in as many ways as there are files
        raise ForeignMesh(path, f"{type(error).__name__}: {error}"[:200]) from None


def sound(path: Path, points: Array, faces: Array) -> None:
    """Refuse numbers that no mesh has.

    Raises:
        ForeignMesh: no triangles, too many, numbers that are not finite, or corners that are no vertices.

    """
    if points.ndim != 2 or points.shape[1:] != (3,) or faces.ndim != 2 or faces.shape[1:] != (3,) or not len(faces):
        raise ForeignMesh(path, "no triangles", "Name a mesh of triangles.")
    if not len(points):
        raise ForeignMesh(path, "corners that are no vertices")
    if len(points) > _MOST or len(faces) > _MOST:
        raise ForeignMesh(path, f"more than {_MOST} points or triangles", "Thin it out first.")
    if not np.isfinite(points).all() or np.abs(points).max() > 1e15:
        raise ForeignMesh(path, "numbers that are not finite, or beyond all measure")
    if faces.min() < 0 or faces.max() >= len(points):
        raise ForeignMesh(path, "corners that are no vertices")


class _Wrong(Exception):
    pass


def _at_most(count: int, what: str) -> int:
    if not 0 <= count <= _MOST:
        raise _Wrong(f"{count} {what} are more than {_MOST}, or none")
    return count


def _obj(data: bytes) -> None:
    if b"\0" in data[:4096]:
        raise _Wrong("it is no text")
    if max(map(len, data.splitlines()), default=0) > _LINE:
        raise _Wrong(f"a line is longer than {_LINE} bytes")
    _at_most(len(re.findall(rb"^\s*[vf]\s", data, re.M)), "vertices and faces")


def _stl(data: bytes) -> None:
    if data[:5].lower() == b"solid" and b"facet" in data[:_HEADER]:
        _at_most(data.count(b"endfacet"), "triangles")
        return
    (count,) = struct.unpack_from("<I", data, 80)
    if 84 + 50 * _at_most(count, "triangles") != len(data):
        raise _Wrong(f"{count} triangles take {84 + 50 * count} bytes, and it has {len(data)}")


def _ply(data: bytes) -> None:
    end = data.find(b"end_header", 0, _HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise _Wrong("it has no PLY header")
    text = b"format ascii" in data[:end]
    least = 0
    count = row = 0
    for line in data[:end].decode("ascii", "replace").splitlines():
        words = line.split()
        if words[:1] == ["element"]:
            least += count * row
            count, row = _at_most(int(words[2]), words[1]), 0
        elif words[:2] == ["property", "list"]:
            row += 2 if text else _TYPES[words[2]]
        elif words[:1] == ["property"]:
            row += 2 if text else _TYPES[words[1]]
    least += count * row
    if least > len(data) - end:
        raise _Wrong(f"its elements take at least {least} bytes, and it has {len(data) - end}")


def _glb(data: bytes) -> None:
    magic, version, length = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2 or length != len(data):
        raise _Wrong("it is no binary glTF 2.0 of its own length")
    size, kind = struct.unpack_from("<I4s", data, 12)
    if kind != b"JSON" or size > min(_JSON, len(data) - 20):
        raise _Wrong("its JSON is missing or does not fit")
    page = json.loads(data[20 : 20 + size])
    binary = 0
    if len(data) >= 28 + size:
        binary, kind = struct.unpack_from("<I4s", data, 20 + size)
        if kind != b"BIN\0" or binary > len(data) - 28 - size:
            raise _Wrong("its binary part does not fit")
    for part in ("buffers", "images"):
        if any("uri" in entry for entry in page.get(part, ())):
            raise _Wrong(f"its {part} point elsewhere")
    packed = set(page.get("extensionsRequired", ())) & {"KHR_draco_mesh_compression", "EXT_meshopt_compression"}
    if packed:
        raise _Wrong(f"it needs {packed.pop()}")
    _glb_sizes(page, binary)
    _glb_tree(page)


def _glb_sizes(page: Any, binary: int) -> None:
    """Refuse views that lie outside of the file, and accessors that are larger than their views."""
    views = page.get("bufferViews", [])
    for view in views:
        begin, size = int(view.get("byteOffset", 0)), int(view["byteLength"])
        if begin < 0 or size < 0 or view.get("buffer") != 0 or begin + size > binary:
            raise _Wrong("a buffer view lies outside of it")
    for accessor in page.get("accessors", []):
        count = _at_most(int(accessor["count"]), "elements")
        if "sparse" in accessor or "bufferView" not in accessor:
            raise _Wrong("an accessor has no bytes of its own")
        element = _COMPONENTS[accessor["componentType"]] * _ELEMENTS[accessor["type"]]
        view = views[_index(accessor["bufferView"], views)]
        stride = max(int(view.get("byteStride", element)), 1)
        begin = int(accessor.get("byteOffset", 0))
        if begin < 0 or begin + (count - 1) * stride + element > int(view["byteLength"]):
            raise _Wrong("an accessor is larger than its view")


def _index(value: Any, among: Any) -> int:
    """Return an index that is one: Python's would count from the end."""
    if not isinstance(value, int) or not 0 <= value < len(among):
        raise _Wrong(f"{value!r} is no index")
    return value


def _glb_tree(page: Any) -> None:
    """Refuse nodes that are not a tree: rings, and meshes hung up a billion times."""
    nodes = page.get("nodes", [])
    children = [_index(child, nodes) for node in nodes for child in node.get("children", ())]
    if len(children) != len(set(children)):
        raise _Wrong("a node has two parents")
    roots = [i for i in range(len(nodes)) if i not in set(children)]
    reached, level = 0, roots
    while level:
        reached += len(level)
        level = [child for i in level for child in nodes[i].get("children", ())]
    if reached != len(nodes):
        raise _Wrong("its nodes hang in a ring")
