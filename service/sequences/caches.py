"""Vertex caches: positions by frame for a mesh that the reader has already, in its order of vertices.

PC2 (3ds Max's Point Cache 2): little-endian; `POINTCACHE2` and a zero byte, version 1, the number of points, the first
frame, the frames between samples, the number of samples; then float32 x, y, z, sample after sample.
MDD (LightWave's): big-endian; the numbers of frames and of points, a float32 time [s] for every frame; then float32
x, y, z, frame after frame.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .options import Options

if TYPE_CHECKING:
    from . import view

__all__ = ["mdd", "mdd_of", "pc2", "pc2_of"]


def pc2(sequence: view.Sequence, options: Options) -> bytes:
    """Return a sequence whose vertices stay as a PC2 file."""
    return pc2_of([s.vertices for s in sequence], options)


def mdd(sequence: view.Sequence, options: Options) -> bytes:
    """Return a sequence whose vertices stay as an MDD file."""
    return mdd_of([s.vertices for s in sequence], options)


def pc2_of(samples: Sequence[np.ndarray], options: Options) -> bytes:
    """Return positions (v, 3) of every stage as a PC2 file; frames count from 1."""
    head = struct.pack("<12siiffi", b"POINTCACHE2", 1, len(samples[0]), 1.0, options.step, len(samples))
    return head + _joined(samples, "<f4")


def mdd_of(samples: Sequence[np.ndarray], options: Options) -> bytes:
    """Return positions (v, 3) of every stage as an MDD file; the first is at 0 s."""
    times = np.arange(len(samples)) * options.step / options.fps
    head = struct.pack(">ii", len(samples), len(samples[0]))
    return head + times.astype(">f4").tobytes() + _joined(samples, ">f4")


def _joined(samples: Iterable[np.ndarray], dtype: str) -> bytes:
    return b"".join(np.asarray(sample).astype(dtype).tobytes() for sample in samples)
