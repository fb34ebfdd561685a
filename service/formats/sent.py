"""Kinds of files that are sent to the service: by the media type, or by their bytes where the type says no more.

Clients that are made from the OpenAPI page send files as `application/octet-stream`, and know no type of a mesh.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import InvalidQuery, Wrong

__all__ = ["MESHES", "contents", "suffix_of"]

#: Suffix -> media types of meshes.
MESHES: Mapping[str, tuple[str, ...]] = {
    ".obj": ("model/obj", "text/plain"),
    ".glb": ("model/gltf-binary",),
    ".stl": ("model/stl",),
    ".ply": ("model/ply", "application/ply"),
}
_BYTES = "application/octet-stream"
_BEGIN = {".glb": b"glTF", ".ply": b"ply", ".png": b"\x89PNG\r\n\x1a\n", ".json": b"{"}
#: Header and length of a triangle of a binary STL [bytes].
_STL, _TRIANGLE = 84, 50
#: A vertex of an OBJ, which may follow comments of some length, and a triangle of an STL in words. Blanks go no further
#: than their line: a body of line ends is read in one pass.
_VERTEX, _FACET = (
    re.compile(rb"^[ \t]*v[ \t]+[-+.\d]", re.MULTILINE),
    re.compile(rb"\A\s*solid\b.*?\bfacet\s", re.DOTALL),
)


def contents(types: Sequence[str]) -> dict[str, Any]:
    """Return what an operation's page says of a body that is a file of one of some types, or bytes."""
    binary = {"schema": {"type": "string", "format": "binary"}}
    return dict.fromkeys((*types, _BYTES), binary)


def suffix_of(media: str, data: bytes, kinds: Mapping[str, Sequence[str]], field: str) -> str:
    """Return the suffix of a body's kind among `kinds` (suffix -> media types).

    Raises:
        InvalidQuery: it is none of them; or bytes that begin like none of them, said of `field`.

    """
    found = next((suffix for suffix, types in kinds.items() if media in types), None)
    if found is not None:
        return found
    known = ", ".join(types[0] for types in kinds.values())
    if media != _BYTES:
        wrong = Wrong("Content-Type", f"{media[:60] or 'nothing'!r} is not read here", f"Send {known}, or {_BYTES}.")
        raise InvalidQuery.of([wrong])
    found = _told(data)
    if found not in kinds:
        raise InvalidQuery.of([Wrong(field, f"its bytes are none of {', '.join(kinds)}", f"Say which: {known}.")])
    return found


def _told(data: bytes) -> str:
    """Return the suffix that a file's bytes tell, "" where they tell none."""
    for suffix, begin in _BEGIN.items():
        if data.lstrip().startswith(begin) if suffix == ".json" else data.startswith(begin):
            return suffix
    if len(data) >= _STL and len(data) == _STL + _TRIANGLE * int.from_bytes(data[80:_STL], "little"):
        return ".stl"
    if _FACET.search(data):
        return ".stl"
    return ".obj" if _VERTEX.search(data) else ""
