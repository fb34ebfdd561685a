"""States as binary frames (docs/sessions.md): whole ones, and differences from what the client holds.

What the client holds is kept here, number by number as it computes it, so that roundings do not add up.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from solver.meshes import Frame

__all__ = ["EXACT", "MORE", "UNDERWAY", "Encoder", "Told"]

#: Flags: settled as by a batch run; more is to come; on the way to an equilibrium.
EXACT, MORE, UNDERWAY = 1, 2, 4
_HEAD = struct.Struct("<4s7IfIdfIfI")
_MAGIC = b"wzn1"
#: Quanta that a move has at most, and quanta in a mean edge.
_FURTHEST, _FINE = 32767, 1000.0
#: Share of vertices that move, or triangles that change, beyond which all are sent and their numbers are left out.
_MANY = 0.6


class Told(NamedTuple):
    """What a frame says of itself."""

    stage: float
    residual: float
    input: int
    milliseconds: float
    flags: int


class Encoder:
    """Frames for one client, one after the other."""

    def __init__(self) -> None:
        self.number = 0
        self.forget()

    def forget(self) -> None:
        """Take it that the client holds nothing: the next frame is a whole one."""
        self._held: np.ndarray | None = None
        self._triangles = np.empty((0, 3), np.uint32)

    def off(self, frame: Frame) -> bool:
        """Whether the client holds something else than the frame's positions in single precision."""
        x = frame.vertices.astype(np.float32)
        return self._held is None or self._held.shape != x.shape or bool(_other(self._held, x).any())

    def frame(self, frame: Frame, told: Told, exact: bool = False) -> bytes:
        """Return the next frame; `exact`: every position in single precision, else to half a quantum."""
        x, triangles = frame.vertices.astype(np.float32), frame.triangles.astype(np.uint32)
        n, m, whole = len(x), len(triangles), self._held is None
        base = 0 if self._held is None else self.number
        self.number += 1
        held = np.zeros_like(x)
        known = 0 if self._held is None else min(n, len(self._held))
        if self._held is not None:
            held[:known] = self._held[:known]
        rows = np.arange(m) if whole else self._rows(triangles)
        quantum = np.float32(_mean_edge(x, triangles) / _FINE)
        placed, moved, steps = _differences(held, x, known, float(quantum), exact)
        held[placed] = x[placed]
        held[moved] = (held[moved].astype(np.float64) + float(quantum) * steps).astype(np.float32)
        self._held, self._triangles = held, triangles
        counts = (n, m, len(rows), len(placed), len(moved))
        parts = [_HEAD.pack(_MAGIC, self.number, base, *counts, quantum, len(frame.fields), *told)]
        for chosen, values, all_of in ((rows, triangles[rows], m), (placed, x[placed], n), (moved, steps, n)):
            if len(chosen) < all_of:
                parts.append(chosen.astype(np.uint32).tobytes())
            parts.append(_filled(values.tobytes()))
        return b"".join([*parts, *_levels(frame.fields.values())])

    def _rows(self, triangles: np.ndarray) -> np.ndarray:
        """Return which triangles are others than before."""
        known = min(len(triangles), len(self._triangles))
        other = np.ones(len(triangles), bool)
        other[:known] = (triangles[:known] != self._triangles[:known]).any(axis=1)
        return np.arange(len(triangles)) if other.mean() > _MANY else np.flatnonzero(other)


def _differences(
    held: np.ndarray, x: np.ndarray, known: int, quantum: float, exact: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which vertices are placed, which are moved, and by how many quanta (q, 3) int16."""
    n, nothing = len(x), np.empty(0, np.int64)
    if exact or not known:
        other = _other(held, x)
        other[known:] = True
        placed = np.arange(n) if other.mean() > _MANY else np.flatnonzero(other)
        return placed, nothing, np.empty((0, 3), np.int16)
    steps = np.rint((x.astype(np.float64) - held) / quantum)
    far = (np.abs(steps) > _FURTHEST).any(axis=1)
    far[known:] = True
    steps[far] = 0
    some = steps.any(axis=1)
    moved = np.arange(n) if some.mean() > _MANY else np.flatnonzero(some)
    return np.flatnonzero(far), moved, steps[moved].astype(np.int16)


def _other(held: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return which rows differ, in any bit."""
    found: np.ndarray = (held.view(np.uint32) != x.view(np.uint32)).any(axis=1)
    return found


def _mean_edge(x: np.ndarray, triangles: np.ndarray) -> float:
    sides = x[triangles] - x[np.roll(triangles, 1, axis=1)]
    return max(float(np.linalg.norm(sides, axis=2).mean()), 1e-30)


def _filled(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _levels(fields: Iterable[np.ndarray]) -> Iterable[bytes]:
    """Yield values as bytes between their least and their largest."""
    for values in fields:
        low, high = (np.float32(f(values)) for f in (np.min, np.max))
        span = float(high) - float(low)
        scaled = np.clip((values - float(low)) * (255.0 / span), 0, 255) if span > 0 else np.zeros(len(values))
        yield struct.pack("<ff", low, high) + _filled(np.rint(scaled).astype(np.uint8).tobytes())
