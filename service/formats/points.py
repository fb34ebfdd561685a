"""Points alone, for a client that builds the triangles itself: what a slider moves, a quarter of a GLB's size.

Little-endian: `WIZP`, the version 1, the colatitude samples n and the length of the JSON that follows (three uint32);
the JSON that `format=json` sends, padded with blanks to four bytes; then 2n^2 + 2 positions (float32 x, y, z) in units
of r1: n rows of 2n lattice points, the pole at colatitude 0, the pole at pi. `lattice.triangles` of the JSON says which
of them make a triangle, as `service.formats.mesh.triangles(n)` does.
"""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from . import mesh, metadata
from .about import About

if TYPE_CHECKING:
    from store.shape import Shape

__all__ = ["MAGIC", "encode"]

MAGIC = b"WIZP"
_VERSION = 1


def encode(shape: Shape, about: About) -> bytes:
    """Return header, JSON and positions; equal shapes give equal bytes: timings and links are left out."""
    position, ends = mesh.surface(shape)
    text = metadata.encode(shape, replace(about, timings={}, links={}) if about.timings or about.links else about)
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIII", MAGIC, _VERSION, position.shape[0], len(text))
    # joined at once: no copy of all points before
    return b"".join([head, text, *(np.ascontiguousarray(points, "<f4").data for points in (position, ends))])
