"""A scene as binary glTF: every distinct level of a shape once, its instances by `EXT_mesh_gpu_instancing`, quantised
(`KHR_mesh_quantization`) and, where the encoder is installed, compressed (`EXT_meshopt_compression`).

A mirror image is the same mesh below a node that mirrors; its instances are turned to suit.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Collection, Hashable, Mapping, Sequence
from typing import Any

import numpy as np

from solver.arrays import Array

from ..formats import gltf
from ..formats.about import GENERATOR
from . import moving, props
from .kinds import Kind
from .meshes import VERTEX, Packed
from .placing import Instances

__all__ = ["compressor", "encode"]

_INSTANCING, _QUANTIZED, _MESHOPT = "EXT_mesh_gpu_instancing", "KHR_mesh_quantization", "EXT_meshopt_compression"
_BYTE, _UBYTE, _SHORT, _USHORT, _UINT, _FLOAT = 5120, 5121, 5122, 5123, 5125, 5126
_VERTICES, _INDICES = 34962, 34963

Json = dict[str, Any]


def compressor() -> Any | None:
    """Return the meshopt encoder, set to the versions that glTF readers know, or None where it is not installed."""
    try:
        from meshoptimizer import encoder
    except ImportError:
        return None
    encoder.encode_vertex_version(0)
    encoder.encode_index_version(1)
    return encoder


class _File:
    """The growing document: views, which are compressed one by one, accessors, and the binary part."""

    def __init__(self, encoder: Any | None) -> None:
        self._encoder = encoder
        self.views: list[Json] = []
        self.accessors: list[Json] = []
        self.parts: list[bytes] = []
        self.length = self.plain = 0

    def view(self, array: Array, mode: str, target: int | None) -> int:
        """Append an array of elements of 4 n bytes, or indices, and return the number of its view."""
        raw = array.tobytes()
        stride = len(raw) // len(array)
        more: Json = {} if target is None else {"target": target}
        if mode == "ATTRIBUTES" and target is not None:
            more["byteStride"] = stride
        if self._encoder is None:
            self.views.append({"buffer": 0, "byteOffset": self._put(raw), "byteLength": len(raw), **more})
            return len(self.views) - 1
        if mode == "ATTRIBUTES":
            data = self._encoder.encode_vertex_buffer(np.frombuffer(raw, np.uint8), len(array), stride)
        else:
            data = self._encoder.encode_index_buffer(array.astype(np.uint32), len(array), int(array.max()) + 1)
        said = {"buffer": 0, "byteOffset": self._put(data), "byteLength": len(data), "byteStride": stride}
        extension = {_MESHOPT: {**said, "count": len(array), "mode": mode}}
        self.views.append(
            {"buffer": 1, "byteOffset": self.plain, "byteLength": len(raw), **more, "extensions": extension}
        )
        self.plain += len(raw) + -len(raw) % 4
        return len(self.views) - 1

    def accessor(self, view: int, component: int, kind: str, count: int, offset: int = 0, **more: Any) -> int:
        """Append an accessor and return its number."""
        said = {"bufferView": view, "componentType": component, "count": count, "type": kind, **more}
        self.accessors.append(said | ({"byteOffset": offset} if offset else {}))
        return len(self.accessors) - 1

    def _put(self, data: bytes) -> int:
        at = self.length
        data += b"\0" * (-len(data) % 4)
        self.parts.append(data)
        self.length += len(data)
        return at

    def pack(self, document: Json) -> bytes:
        """Return the file; where nothing is in the picture it has no binary part, which glTF wants left out."""
        buffers: list[Json] = [{"byteLength": self.length}]
        if self._encoder is not None:
            buffers.append({"byteLength": self.plain, "extensions": {_MESHOPT: {"fallback": True}}})
        if self.length:
            document = {**document, "accessors": self.accessors, "bufferViews": self.views, "buffers": buffers}
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        binary = [struct.pack("<II", self.length, 0x004E4942), *self.parts] if self.length else []
        head = struct.pack("<III", 0x46546C67, 2, 20 + len(text) + sum(map(len, binary)))
        return b"".join([head, struct.pack("<II", len(text), 0x4E4F534A), text, *binary])


def encode(
    kinds: Sequence[Kind],
    seen: Instances,
    n: Array,
    held: Sequence[props.Prop],
    unit: float,
    compress: bool,
    known: Collection[str] = (),
) -> bytes:
    """Return the file of the seen instances with their levels; `held` is what stands there besides.

    unit: length of the scene's unit [m]. Each mesh says in its extras which shape it is, by an `etag` of what it is
    made of; of those that are `known` no more is there. They say too how long r1 is in their positions.
    """
    file = _File(compressor() if compress else None)
    nodes: list[Json] = []
    groups: Sequence[Array] = list(np.unique(np.stack([seen.kind, n, seen.mirrored.astype(int)]), axis=1).T)
    order = [np.flatnonzero((seen.kind == k) & (n == size) & (seen.mirrored == m)) for k, size, m in groups]
    meshes, materials, made = _meshes(file, kinds, groups, known)
    still = [at for at, (k, _, _) in enumerate(groups) if not kinds[k].curve]
    if still:
        nodes = _instances(file, kinds, seen, [groups[at] for at in still], [order[at] for at in still], made)
    changing: list[tuple[int, Kind]] = []
    for (k, size, _), rows in zip(groups, order, strict=True):
        if kinds[k].curve:
            changing += [(len(nodes) + i, kinds[k]) for i in range(len(rows))]
            nodes += _one_by_one(kinds[k].label, seen.only(rows), *made[k, size])
    animations = moving.weights(file, changing)
    nodes += [props.node(file, meshes, materials, prop) for prop in held]
    used = {_INSTANCING} if still else set()
    used |= {_QUANTIZED} if len(n) else set()
    required = sorted(used | ({_MESHOPT} if file.length and compress and compressor() is not None else set()))
    more = {name for material in materials for name in material.get("extensions", {})}
    document: Json = {
        "asset": {"version": "2.0", "generator": GENERATOR},
        "scene": 0,
        "scenes": [{"nodes": [len(nodes)]}],
        "nodes": [
            *nodes,
            {"name": "scene", "scale": [unit] * 3, **({"children": [*range(len(nodes))]} if nodes else {})},
        ],
        "extensionsUsed": sorted({*required, *more}),
        "extensionsRequired": required,
        "meshes": meshes,
        "materials": materials,
        "animations": animations,
    }
    return file.pack({key: value for key, value in document.items() if value != []})


def _meshes(
    file: _File, kinds: Sequence[Kind], groups: Sequence[Array], known: Collection[str]
) -> tuple[list[Json], list[Json], dict[tuple[int, int], tuple[int, float]]]:
    """Append the distinct meshes; return them, materials, and each mesh's number and step [its unit]."""
    meshes: list[Json] = []
    materials: list[Json] = []
    worn: dict[Hashable, int] = {}
    indices: dict[Hashable, int] = {}  # of the levels that are sent
    made: dict[tuple[int, int], tuple[int, float]] = {}
    for k, size in ((int(k), int(size)) for k, size, _ in groups):
        if (k, size) in made:
            continue
        kind = kinds[k]
        if kind.look not in worn:
            worn[kind.look] = len(materials)
            materials.append(gltf.material(kind.look[0], kind.skin.base, kind.skin))
        material = worn[kind.look]
        made[k, size] = len(meshes), kind.step
        tag = moving.etag(kind, size)
        # with these, whoever has the file can put other stages of the kind in the place of this one
        extras: Json = {"etag": tag, "kind": kind.label, **kind.extras(size)}
        meshes.append({"name": f"{kind.label} {size}", "extras": extras})
        fading = kind.curve[1:]
        if fading:
            extras["targetNames"] = [f"{stage:g}" for _, stage in fading]
            meshes[-1]["weights"] = [0.0] * len(fading)
        if tag in known:
            extras["known"] = True
            meshes[-1]["primitives"] = [_stub(file, material, len(fading))]
            continue
        first, *later = kind.packed(size)
        if (kind.topology, size) not in indices:
            indices[kind.topology, size] = _indices(file, kind.triangles(size))
        primitive = _primitive(file, first, indices[kind.topology, size], material)
        meshes[-1]["primitives"] = [primitive]
        if later:
            primitive["targets"] = moving.target_views(file, first, later, kind.fades)
    return meshes, materials, made


def _indices(file: _File, triangles: Array) -> int:
    flat = triangles.ravel()
    small = int(flat.max()) < 0xFFFF
    view = file.view(flat.astype("<u2" if small else "<u4"), "TRIANGLES", _INDICES)
    return file.accessor(view, _USHORT if small else _UINT, "SCALAR", len(flat))


def _primitive(file: _File, packed: Packed, indices: int, material: int) -> Json:
    vertices, count = packed.vertices, len(packed.vertices)
    view = file.view(vertices, "ATTRIBUTES", _VERTICES)
    at = VERTEX.fields
    assert at is not None
    attributes = {
        "POSITION": file.accessor(view, _SHORT, "VEC3", count, at["position"][1], min=packed.low, max=packed.high),
        "NORMAL": file.accessor(view, _BYTE, "VEC3", count, at["normal"][1], normalized=True),
        "COLOR_0": file.accessor(view, _UBYTE, "VEC4", count, at["colour"][1], normalized=True),
    }
    return {"attributes": attributes, "indices": indices, "material": material}


def _stub(file: _File, material: int, later: int) -> Json:
    """Return what stands for a mesh that the asker has: a triangle without extent, with targets for its weights."""
    empty = moving.known_vertices(VERTEX)
    at = VERTEX.fields
    assert at is not None
    empty["normal"][:, 1] = 127
    view = file.view(empty, "ATTRIBUTES", _VERTICES)
    attributes = {
        "POSITION": file.accessor(view, _SHORT, "VEC3", 3, at["position"][1], min=[0] * 3, max=[0] * 3),
        "NORMAL": file.accessor(view, _BYTE, "VEC3", 3, at["normal"][1], normalized=True),
    }
    fading = {"targets": [{"POSITION": attributes["POSITION"]}] * later} if later else {}
    return {"attributes": attributes, "material": material, **fading}


def _instances(
    file: _File,
    kinds: Sequence[Kind],
    seen: Instances,
    groups: Sequence[Array],
    order: Sequence[Array],
    made: Mapping[tuple[int, int], tuple[int, float]],
) -> list[Json]:
    """Append translations, rotations and scales of all instances, and return the nodes that draw them."""
    row = np.concatenate(order)
    mirrored = seen.mirrored[row][:, None]
    move = seen.centre[row] * np.where(mirrored, [-1, 1, 1], 1)
    turn = seen.turn[row] * np.where(mirrored, [1, -1, -1, 1], 1)
    scales = np.repeat([made[k, size][1] for k, size, _ in groups], [len(one) for one in order])
    grow = np.repeat((seen.scale[row] * scales)[:, None], 3, axis=1)
    views: tuple[tuple[int, int, str, int, Json], ...] = (
        (file.view(move.astype("<f4"), "ATTRIBUTES", None), _FLOAT, "VEC3", 12, {}),
        (file.view(np.round(turn * 32767).astype("<i2"), "ATTRIBUTES", None), _SHORT, "VEC4", 8, {"normalized": True}),
        (file.view(grow.astype("<f4"), "ATTRIBUTES", None), _FLOAT, "VEC3", 12, {}),
    )
    nodes, first = [], 0
    for (k, size, mirror), rows in zip(groups, order, strict=True):
        attributes = {
            name: file.accessor(view, component, kind, len(rows), first * stride, **more)
            for name, (view, component, kind, stride, more) in zip(
                ("TRANSLATION", "ROTATION", "SCALE"), views, strict=True
            )
        }
        node: Json = {
            "mesh": made[k, size][0],
            "name": kinds[k].label,
            "extensions": {_INSTANCING: {"attributes": attributes}},
        }
        nodes.append(node | ({"scale": [-1, 1, 1]} if mirror else {}))
        first += len(rows)
    return nodes


def _one_by_one(name: str, seen: Instances, mesh: int, step: float) -> list[Json]:
    """Return a node for each of the instances of a mesh with morph targets, which readers do not draw as instances."""
    found: list[Json] = []
    turns = seen.turn / np.linalg.norm(seen.turn, axis=1)[:, None]
    for centre, turn, scale, mirrored in zip(seen.centre, turns, seen.scale * step, seen.mirrored, strict=True):
        wide = float(scale)
        place = {
            "translation": centre.tolist(),
            "rotation": turn.tolist(),
            "scale": [-wide if mirrored else wide, wide, wide],
        }
        found.append({"mesh": mesh, "name": name, **place})
    return found
