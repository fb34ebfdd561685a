"""PC2 point caches: what moves a mesh from frame to frame, read with the standard library."""

from __future__ import annotations

import struct
import sys
from array import array
from typing import NamedTuple

from .client import Refused

__all__ = ["Cache", "read"]


class Cache(NamedTuple):
    """Frames, each with the positions x, y, z of all vertices in a row; the first frame, and from one to the next."""

    vertices: int
    start: float
    rate: float
    frames: list[array[float]]


def read(data: bytes) -> Cache:
    """Return the cache in a PC2 file.

    Raises:
        Refused: it is none, or was cut short.

    """
    if len(data) < 32 or data[:12] != b"POINTCACHE2\0":
        raise Refused("This is no PC2 file.")
    version, vertices, start, rate, samples = struct.unpack_from("<iiffi", data, 12)
    size = 12 * vertices
    if version != 1 or vertices <= 0 or samples <= 0 or len(data) != 32 + size * samples:
        raise Refused("This PC2 file was cut short, or is of another version.")
    frames = []
    for k in range(samples):
        one = array("f")
        one.frombytes(data[32 + k * size : 32 + (k + 1) * size])
        if sys.byteorder == "big":
            one.byteswap()
        frames.append(one)
    return Cache(vertices, start, rate, frames)
