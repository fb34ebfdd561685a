"""Wavefront OBJ: text that every modeller reads, with texture coordinates and normals.

Positions and normals need no second copies at the seam: faces index v, vt and vn separately, so the mesh is closed as
it stands. Texture v runs upwards here, as modellers expect.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import orjson

from solver.arrays import Array

from . import mesh
from .about import LENGTH_UNIT, About, extras

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["encode"]


def encode(shape: Shape, about: About) -> bytes:
    """Return the shape as an OBJ file; the query, the stage and the units are in its comments."""
    position, ends = mesh.surface(shape)
    n = position.shape[0]
    return b"".join(
        [
            _head(shape, about),
            _lines(b"v", mesh.vertices(position, ends)),
            _texture(n),
            _lines(b"vn", mesh.vertices(shape.normals, shape.pole_normals)),
            _faces(n),
        ]
    )


def _head(shape: Shape, about: About) -> bytes:
    facts = extras(shape, about)
    lines = [f"# {facts.pop('generator')}", f"# lengths in units of {LENGTH_UNIT}"]
    lines += [f"# {key}: {orjson.dumps(value).decode()}" for key, value in facts.items()]
    return "\n".join([*lines, f"o {about.solver or 'shape'}", ""]).encode()


def _lines(word: bytes, array: Array) -> bytes:
    """Return one line per row: the word and the row's numbers.

    orjson writes the shortest digits that read back as the same float32, a third of the time that %-formatting takes
    and a ninth of numpy.savetxt's; its brackets and commas become line starts and blanks.
    """
    rows = orjson.dumps(array, option=orjson.OPT_SERIALIZE_NUMPY)[2:-2]
    return word + b" " + rows.replace(b"],[", b"\n" + word + b" ").replace(b",", b" ") + b"\n"


@lru_cache(maxsize=4)
def _texture(n: int) -> bytes:
    uv = mesh.texture(n)
    return _lines(b"vt", np.column_stack([uv[:, 0], 1 - uv[:, 1]]))


@lru_cache(maxsize=4)
def _faces(n: int) -> bytes:
    """Return the face lines, which depend on the resolution alone."""
    v = mesh.triangles(n).astype(np.int64).ravel() + 1
    vt = mesh.seam_triangles(n).astype(np.int64).ravel() + 1
    corners = np.stack([v, vt, v], axis=-1).ravel().tolist()
    return (("f %d/%d/%d %d/%d/%d %d/%d/%d\n" * (len(v) // 3)) % tuple(corners)).encode()
