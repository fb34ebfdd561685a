"""Mesh files of others: looked at before any reader allocates, follows or unpacks what they say.

A file may name a billion triangles in a hundred bytes, point at other files, hang its nodes in a ring or be compressed.
Readers believe it. Here its own size is the measure: what it promises must fit into it.
"""

from __future__ import annotations

import io
import json
import re
import struct
from collections.abc import Sequence
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
#: A line that adds a point or a face. Blanks go no further than their line: a file of line ends is read in one pass.
_COUNTED = re.compile(rb"^[ \t]*[vf][ \t]", re.MULTILINE)
#: glTF 2.0: bytes of a component, components of an element.
_COMPONENTS = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_ELEMENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
#: Accessors may share bytes: how often all of them on average, besides those of small files. Attributes that points
#: have as a rule, at most: more of them count as more points.
_SHARED, _FREE, _ATTRIBUTES = 8, 1 << 20, 8
#: Readers go all the way up from every node: so many steps at most.
_STEPS = 200_000


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
    except (ArithmeticError, LookupError, ValueError, TypeError, AttributeError, RecursionError, struct.error) as error:
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
    kind = path.suffix.lower()[1:]
    # pictures within the file are as large as they say: nobody here looks at them
    options = {"skip_materials": True} if kind == "glb" else {}
    try:
        return trimesh.load(io.BytesIO(data), file_type=kind, resolver=None, force="mesh", process=False, **options)
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
    _at_most(sum(1 for _ in _COUNTED.finditer(data)), "vertices and faces")


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
    _glb_drawn(page, _glb_tree(page))


def _glb_sizes(page: Any, binary: int) -> None:
    """Refuse views that lie outside of the file, and accessors that are larger than their views."""
    views = page.get("bufferViews", [])
    for view in views:
        begin, size = int(view.get("byteOffset", 0)), int(view["byteLength"])
        if begin < 0 or size < 0 or view.get("buffer") != 0 or begin + size > binary:
            raise _Wrong("a buffer view lies outside of it")
    total = 0
    for accessor in page.get("accessors", []):
        count = _at_most(int(accessor["count"]), "elements")
        if "sparse" in accessor or "bufferView" not in accessor:
            raise _Wrong("an accessor has no bytes of its own")
        element = _COMPONENTS[accessor["componentType"]] * _ELEMENTS[accessor["type"]]
        view = views[_index(accessor["bufferView"], views)]
        stride = int(view.get("byteStride", element))
        if stride < element:
            raise _Wrong("elements of an accessor lie in each other")
        begin = int(accessor.get("byteOffset", 0))
        if begin < 0 or begin + (count - 1) * stride + element > int(view["byteLength"]):
            raise _Wrong("an accessor is larger than its view")
        total += count * element
    if total > _SHARED * binary + _FREE:
        raise _Wrong(f"its accessors hold {total} bytes, and it has {binary}")


def _glb_drawn(page: Any, nodes: Sequence[int]) -> None:
    """Refuse numbers that are few in the file and many once it is read: primitives and nodes may name them any number
    of times. `nodes` come after those that they hang below.
    """
    accessors, tree = page.get("accessors", []), page.get("nodes", [])
    held = [sum(_glb_size(part, accessors) for part in mesh["primitives"]) for mesh in page.get("meshes", [])]
    own = [1 + (held[_index(node["mesh"], held)] if "mesh" in node else 0) for node in tree]
    below = list(own)
    for i in reversed(nodes):
        below[i] += sum(below[child] for child in tree[i].get("children", ()))
    scenes = [sum(below[_index(i, tree)] for i in scene.get("nodes", ())) for scene in page.get("scenes", [])]
    _at_most(max([sum(held), sum(own), *scenes]), "points or triangles")


def _glb_size(part: Any, accessors: Any) -> int:
    """Return how many points, triangles or eights of numbers of points a primitive has, whichever are most."""
    counts = [int(accessors[_index(one, accessors)]["count"]) for one in part["attributes"].values()]
    corners = int(accessors[_index(part["indices"], accessors)]["count"]) if "indices" in part else 0
    return 1 + max([*counts, sum(counts) // _ATTRIBUTES, corners // 3])


def _index(value: Any, among: Any) -> int:
    """Return an index that is one: Python's would count from the end."""
    if not isinstance(value, int) or not 0 <= value < len(among):
        raise _Wrong(f"{value!r} is no index")
    return value


def _glb_tree(page: Any) -> list[int]:
    """Return all nodes, each after the one that it hangs below; refuse those that are not trees: rings, and meshes hung
    up a billion times.
    """
    nodes = page.get("nodes", [])
    children = [_index(child, nodes) for node in nodes for child in node.get("children", ())]
    if len(children) != len(set(children)):
        raise _Wrong("a node has two parents")
    level = sorted(set(range(len(nodes))) - set(children))
    reached: list[int] = []
    depth = steps = 0
    while level:
        reached += level
        depth += 1
        steps += depth * len(level)
        if steps > _STEPS:
            raise _Wrong("its nodes are too many, or hang too deep")
        level = [child for i in level for child in nodes[i].get("children", ())]
    if len(reached) != len(nodes):
        raise _Wrong("its nodes hang in a ring")
    return reached
