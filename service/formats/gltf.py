"""The container of binary glTF: one buffer with its views and accessors, and the two chunks of a GLB file."""

from __future__ import annotations

import json
import struct
from typing import Any

from solver.arrays import Array

__all__ = ["FLOAT", "INDICES", "UINT", "USHORT", "VERTICES", "Buffer", "bounds", "pack"]

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
FLOAT, USHORT, UINT = 5126, 5123, 5125
VERTICES, INDICES = 34962, 34963


def bounds(points: Array) -> dict[str, list[float]]:
    """Return the least and the largest of each column, as accessors of positions must say them."""
    # column by column: numpy's reduction along the short last axis takes twenty times as long
    columns = [points[:, i] for i in range(points.shape[1])]
    return {"min": [float(c.min()) for c in columns], "max": [float(c.max()) for c in columns]}


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
    document = {
        **document,
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
