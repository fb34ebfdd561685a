"""Binary glTF 2.0: one mesh with normals and latitude-longitude texture coordinates, ready for a browser or Blender."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from . import mesh
from .about import GENERATOR, About, extras

if TYPE_CHECKING:
    from store.lookup import Shape

__all__ = ["encode"]

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_FLOAT, _USHORT, _UINT = 5126, 5123, 5125
_VERTICES, _INDICES = 34962, 34963
#: The largest 16-bit index is reserved by WebGL as a restart mark.
_SHORT = 0xFFFF


def encode(shape: Shape, about: About) -> bytes:
    """Return the shape as a GLB file; the query, the stage and the units are the node's `extras`."""
    position, ends = mesh.surface(shape)
    n = position.shape[0]
    copies = mesh.seam(n)
    lattice, poles = mesh.normals(position)
    indices = mesh.seam_triangles(n)
    index_type = _UINT
    if len(copies) < _SHORT:
        indices, index_type = indices.astype("<u2"), _USHORT

    points = mesh.vertices(position, ends).take(copies, axis=0)
    buffer = _Buffer()
    attributes = {
        "POSITION": buffer.add(points, _FLOAT, "VEC3", _VERTICES, _bounds(points)),
        "NORMAL": buffer.add(mesh.vertices(lattice, poles).take(copies, axis=0), _FLOAT, "VEC3", _VERTICES),
        "TEXCOORD_0": buffer.add(mesh.texture(n), _FLOAT, "VEC2", _VERTICES),
    }
    primitive = {"attributes": attributes, "indices": buffer.add(indices.ravel(), index_type, "SCALAR", _INDICES)}
    name = about.solver or "shape"
    document = {
        "asset": {"version": "2.0", "generator": GENERATOR},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name, "extras": extras(shape, about)}],
        "meshes": [{"name": name, "primitives": [{**primitive, "material": 0}]}],
        # without one, viewers fall back to polished metal
        "materials": [
            {
                "name": "skin",
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.45, 0.09, 0.06, 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.6,
                },
            }
        ],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": buffer.length}],
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    return _pack(text + b" " * (-len(text) % 4), b"".join(buffer.parts))


def _bounds(points: NDArray[Any]) -> dict[str, list[float]]:
    # column by column: numpy's reduction along the short last axis takes twenty times as long
    columns = [points[:, i] for i in range(3)]
    return {"min": [float(c.min()) for c in columns], "max": [float(c.max()) for c in columns]}


class _Buffer:
    """The one binary buffer: every view starts on a multiple of four bytes."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.length = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(
        self,
        array: NDArray[Any],
        component: int,
        kind: str,
        target: int,
        bounds: dict[str, list[float]] | None = None,
    ) -> int:
        """Append an array and return the number of its accessor."""
        data = array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes()
        self.views.append({"buffer": 0, "byteOffset": self.length, "byteLength": len(data), "target": target})
        data += b"\0" * (-len(data) % 4)
        self.parts.append(data)
        self.length += len(data)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": component,
                "count": len(array),
                "type": kind,
                **(bounds or {}),
            }
        )
        return len(self.accessors) - 1


def _pack(text: bytes, binary: bytes) -> bytes:
    """Return header, JSON chunk and binary chunk; both chunks are multiples of four bytes already."""
    total = 12 + 8 + len(text) + 8 + len(binary)
    return b"".join(
        [
            struct.pack("<III", _MAGIC, 2, total),
            struct.pack("<II", len(text), _JSON),
            text,
            struct.pack("<II", len(binary), _BIN),
            binary,
        ]
    )
