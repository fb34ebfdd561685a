"""What a mesh file holds besides its shape: texture coordinates by corner, materials of triangles, groups of vertices.

OBJ and GLB are read here as they are written. Libraries split an OBJ's vertices along its seams, lay several textures
into one, and round what is stored; here each corner keeps its own pair of numbers, and each triangle its material.
"""

from __future__ import annotations

import json
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from solver.arrays import Array, Floats, Ints
from solver.contract.mesh import MOST_GROUPS

from .errors import InvalidOption

__all__ = ["Parts", "check_count", "glb", "obj"]


class Parts(NamedTuple):
    """Points (p, 3); triangles (f, 3); uv (w, 2), v upwards, and its numbers by corner (f, 3), or None of both.

    materials: names; material (f): the number of each triangle's. groups: weights (p,) of points by name.
    """

    points: Floats
    faces: Ints
    uv: Floats | None
    corners: Ints | None
    materials: tuple[str, ...]
    material: Ints
    groups: dict[str, Floats]


def obj(text: str) -> Parts:
    """Return what an OBJ file's text holds; polygons are cut into fans.

    Raises:
        ValueError, IndexError: it cannot be read.

    """
    points: list[list[float]] = []
    uv: list[list[float]] = []
    faces: list[list[int]] = []
    corners: list[list[int]] = []
    names: dict[str, int] = {}
    material: list[int] = []
    current = -1
    groups: dict[str, list[slice]] = {}
    entered, since = list[str](), 0
    for line in text.splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(words[k]) for k in (1, 2, 3)])
        elif words[:1] == ["vt"]:
            uv.append([float(word) for word in [*words[1:3], "0"][:2]])
        elif words[:1] == ["usemtl"]:
            current = names.setdefault(" ".join(words[1:]) or "material", len(names))
        elif words[:1] == ["g"]:
            _leave(groups, entered, since, len(faces))
            # so Blender calls what is in none, and OBJ itself
            entered, since = [word for word in dict.fromkeys(words[1:]) if word not in ("off", "default")], len(faces)
        elif words[:1] == ["f"]:
            ends = [[_number(word, k, (len(points), len(uv))) for k in (0, 1)] for word in words[1:]]
            for b, c in pairwise(ends[1:]):
                faces.append([ends[0][0], b[0], c[0]])
                corners.append([ends[0][1], b[1], c[1]])
                material.append(current)
    _leave(groups, entered, since, len(faces))
    of_corner = np.array(corners, np.int64).reshape(-1, 3)
    textured = bool(uv) and len(of_corner) > 0 and bool((of_corner >= 0).all()) and int(of_corner.max()) < len(uv)
    owned = np.array(material, np.int64)
    plain = bool((owned < 0).any())
    triangles = np.array(faces, np.int64).reshape(-1, 3)
    return Parts(
        np.array(points, float).reshape(-1, 3),
        triangles,
        np.array(uv, float) if textured else None,
        of_corner if textured else None,
        (*names, *(["skin"] if plain and names else [])),
        np.where(owned < 0, len(names), owned),
        _weights(groups, triangles, len(points)),
    )


def check_count(groups: int) -> None:
    """Refuse more groups than a mesh may have: none of them is left out without a word.

    Raises:
        InvalidOption: so many are parts of a scene, or measurements.

    """
    if groups > MOST_GROUPS:
        raise InvalidOption(
            f"the mesh has {groups} vertex groups, more than {MOST_GROUPS}.",
            f"Write the file without groups, or with the {MOST_GROUPS} that you need at most.",
        )


def _leave(groups: dict[str, list[slice]], entered: list[str], since: int, now: int) -> None:
    """Add the triangles since some groups were entered to each of these; groups that nothing is in are none."""
    if now > since:
        check_count(len(entered))
        for name in entered:
            groups.setdefault(name, []).append(slice(since, now))
        check_count(len(groups))


def _weights(groups: dict[str, list[slice]], faces: Ints, points: int) -> dict[str, Floats]:
    """Return 1 for the points of the triangles in each group, and 0."""
    found: dict[str, Floats] = {name: np.zeros(points) for name in groups}
    for name, parts in groups.items():
        for part in parts:
            found[name][faces[part]] = 1.0
    return found


def _number(word: str, place: int, counts: tuple[int, int]) -> int:
    """Return a corner's vertex or texture vertex from 0; -1 if it names none."""
    parts = word.split("/")
    if place >= len(parts) or not parts[place]:
        return -1
    found = int(parts[place])
    if abs(found) > _LARGEST:
        raise ValueError(f"a corner that no file can hold: {parts[place][:20]}")
    return found - 1 if found > 0 else counts[place] + found


#: Largest number of a vertex; what is larger fits into no array of corners.
_LARGEST = 2**62
_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def glb(data: bytes) -> Parts:
    """Return what a binary glTF's default scene holds: triangles of all its meshes, moved as its nodes say.

    Raises:
        ValueError: it is none, or holds what only libraries unpack (compressed or sparse accessors).

    """
    if data[:4] != b"glTF" or len(data) < 20:
        raise ValueError("not a binary glTF")
    size = int.from_bytes(data[12:16], "little")
    document, binary = json.loads(data[20 : 20 + size]), data[28 + size :]
    if set(document.get("extensionsRequired", [])) - {"KHR_mesh_quantization", "KHR_texture_transform"}:
        raise ValueError("it needs extensions")
    found: list[_Primitive] = []
    scene = document["scenes"][document.get("scene", 0)]
    for node in scene["nodes"]:
        _walk(document, binary, node, np.eye(4), found)
    if not found:
        raise ValueError("no triangles")
    # primitives of several materials may share their vertices
    starts: dict[tuple[int, ...], int] = {}
    owners, total = [], 0
    for part in found:
        if part.key not in starts:
            starts[part.key] = total
            total += len(part.points)
            owners.append(part)
    faces = np.concatenate([part.faces + starts[part.key] for part in found])
    uvs = [np.asarray(part.uv, float) for part in owners if part.uv is not None]
    # glTF's v runs down; of doubles the difference is exact
    uv = np.concatenate(uvs) * [1, -1] + [0, 1] if len(uvs) == len(owners) else None
    names = list(dict.fromkeys(part.material for part in found))
    owned = np.concatenate([np.full(len(part.faces), names.index(part.material)) for part in found])
    points = np.concatenate([part.points for part in owners])
    if names == [""]:
        names = []
    groups = {
        name: np.concatenate([part.groups.get(name, np.zeros(len(part.points))) for part in owners])
        for name in dict.fromkeys(name for part in owners for name in part.groups)
    }
    named = tuple(name or "skin" for name in names)
    return Parts(points, faces, uv, None if uv is None else faces, named, owned, groups)


class _Primitive(NamedTuple):
    """Points (p, 3), faces (f, 3) and uv (p, 2), v downwards; key: which node and accessors the points are of.

    groups: numbers (p,) of the application's own, attributes `_NAME`.
    """

    points: Floats
    faces: Ints
    uv: Array | None
    material: str
    key: tuple[int, ...]
    groups: dict[str, Floats]


def _walk(document: dict[str, Any], binary: bytes, number: int, above: Floats, found: list[_Primitive]) -> None:
    node = document["nodes"][number]
    here = above @ _transform(node)
    if "mesh" in node:
        for part in document["meshes"][node["mesh"]]["primitives"]:
            if part.get("mode", 4) != 4:
                continue
            points = _accessor(document, binary, part["attributes"]["POSITION"]).astype(float)
            points = points @ here[:3, :3].T + here[:3, 3]
            index = part.get("indices")
            faces = np.arange(len(points)) if index is None else _accessor(document, binary, index)
            faces = faces.astype(np.int64).reshape(-1, 3)
            if np.linalg.det(here[:3, :3]) < 0:
                faces = faces[:, ::-1]
            at = part["attributes"].get("TEXCOORD_0")
            uv = None if at is None else _accessor(document, binary, at)
            name = ""
            if "material" in part:
                name = document["materials"][part["material"]].get("name") or f"material {part['material']}"
            own = {n[1:]: k for n, k in part["attributes"].items() if n.startswith("_")}
            scalars = {n: k for n, k in own.items() if document["accessors"][k]["type"] == "SCALAR"}
            groups = {n: _accessor(document, binary, k).astype(float).ravel() for n, k in scalars.items()}
            key = (number, part["attributes"]["POSITION"], -1 if at is None else at, *scalars.values())
            found.append(_Primitive(points, faces, uv, name, key, groups))
    for child in node.get("children", []):
        _walk(document, binary, child, here, found)


def _transform(node: dict[str, Any]) -> Floats:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    found = np.eye(4)
    found[:3, :3] = turned * np.array(node.get("scale", (1, 1, 1)), float)
    found[:3, 3] = node.get("translation", (0, 0, 0))
    return found


def _accessor(document: dict[str, Any], binary: bytes, number: int) -> Array:
    """Return an accessor's values (n, k), normalised integers as shares."""
    accessor = document["accessors"][number]
    if "sparse" in accessor or "bufferView" not in accessor:
        raise ValueError("sparse accessors")
    view = document["bufferViews"][accessor["bufferView"]]
    kind, width, count = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]], accessor["count"]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride", kind.itemsize * width)
    rows = np.ndarray((count, width), kind, binary, start, (stride, kind.itemsize)).copy()
    if accessor.get("normalized"):
        return np.asarray(np.maximum(rows / np.iinfo(kind).max, -1))
    return rows
