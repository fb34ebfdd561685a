"""The container of binary glTF: one buffer with its views and accessors, and the two chunks of a GLB file."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from solver.arrays import Array
from solver.contract import Worn

__all__ = ["CLAY", "FLOAT", "INDICES", "UINT", "USHORT", "VERTICES", "Buffer", "bounds", "material", "pack", "skin"]

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
FLOAT, USHORT, UINT = 5126, 5123, 5125
VERTICES, INDICES = 34962, 34963

#: What is no fruit and wears no skin.
CLAY = Worn(np.array([0.479, 0.423, 0.361]), np.array([0.479, 0.423, 0.361]), 0.6, 0.0, np.zeros(3))
_JUJUBE = Worn(np.array([0.45, 0.09, 0.06]), np.array([0.45, 0.09, 0.06]), 0.6, 0.0, np.zeros(3))


def bounds(points: Array) -> dict[str, list[float]]:
    """Return the least and the largest of each column, as accessors of positions must say them."""
    # column by column: numpy's reduction along the short last axis takes twenty times as long
    columns = [points[:, i] for i in range(points.shape[1])]
    return {"min": [float(c.min()) for c in columns], "max": [float(c.max()) for c in columns]}


def material(name: str, base: Array, worn: Worn) -> dict[str, Any]:
    """Return the material of a skin; `base` (3,) is the factor over colours of vertices, or its one colour. What its
    `extensions` are the document has to name as used.
    """
    extensions: dict[str, Any] = {}
    if worn.coat:
        extensions["KHR_materials_clearcoat"] = {"clearcoatFactor": worn.coat, "clearcoatRoughnessFactor": 0.3}
    if worn.bloom.any():
        extensions["KHR_materials_sheen"] = {"sheenColorFactor": _rounded(worn.bloom), "sheenRoughnessFactor": 0.6}
    return {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*_rounded(base), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": round(worn.roughness, 4),
        },
        **({"doubleSided": True} if worn.thin else {}),
        **({"extensions": extensions} if extensions else {}),
    }


def skin(name: str, worn: Worn | None) -> dict[str, Any]:
    """Return the material of a surface without colours of its own; a dried jujube's where nobody says its skin."""
    return material(name, _JUJUBE.ridge, _JUJUBE) if worn is None else material(name, worn.smooth, worn)


def _rounded(values: Array) -> list[float]:
    return [round(float(value), 5) for value in values]


class Buffer:
    """The one binary buffer: every view starts on a multiple of four bytes."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.length = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(
        self,
        array: Array,
        component: int,
        kind: str,
        target: int | None = None,
        limits: dict[str, list[float]] | None = None,
    ) -> int:
        """Append an array and return the number of its accessor."""
        data = array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes()
        self.accessors.append(
            {
                "bufferView": self.raw(data, target),
                "componentType": component,
                "count": len(array),
                "type": kind,
                **(limits or {}),
            }
        )
        return len(self.accessors) - 1

    def raw(self, data: bytes, target: int | None = None) -> int:
        """Append bytes, an image's for example, and return the number of their view."""
        view = {"buffer": 0, "byteOffset": self.length, "byteLength": len(data)}
        self.views.append(view if target is None else {**view, "target": target})
        data += b"\0" * (-len(data) % 4)
        self.parts.append(data)
        self.length += len(data)
        return len(self.views) - 1


def pack(document: dict[str, Any], buffer: Buffer) -> bytes:
    """Return the file: header, JSON chunk and binary chunk, both multiples of four bytes."""
    own = (name for one in document.get("materials", ()) for name in one.get("extensions", ()))
    used = sorted({*document.get("extensionsUsed", ()), *own})
    document = {
        **document,
        **({"extensionsUsed": used} if used else {}),
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": buffer.length}],
    }
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    binary = b"".join(buffer.parts)
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
