"""Spectra as small integers: each wave in steps of its shell, and none where symmetry makes all of them zero.

A shell is the waves of one max(m, k); its step is the same in a whole table, so the largest wave of the shell takes the
whole range of 16 bits, and no step is below `FINEST`. Blocks are unpacked when they are first asked for and kept, so
that a look-up costs what it costs with floats.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple, overload

import numpy as np

from solver.arrays import Array

from ..kept import Kept, Part
from . import harmonics, spectra

__all__ = ["FINEST", "MOST", "Codes", "Packed", "Stored", "encode", "loss", "within"]

#: Least step [r1]: waves of less than half of it are nothing. At degree 128 it costs some 1e-5 r1 of the surface.
FINEST = 2e-7
#: Most that a point of a surface may lose [r1]: small waves that meet in one point can lose more, and get finer steps.
MOST = 1e-4
_LARGEST = 32767
#: Bytes of unpacked blocks that all tables keep.
_ROOM = 64 << 20


class Codes(NamedTuple):
    """Spectra as codes (sample, stage, wave), the `place` (wave,) of each among the flat (component, m, k, part), and
    the `step` (m or k,) by shell [r1].
    """

    codes: Array
    place: Array
    step: Array


def within(blocks: Sequence[Array]) -> tuple[Codes, tuple[float, float]]:
    """Pack spectra so that no point loses more than `MOST`, where 16 bits can; and return what they lose (`loss`)."""
    finest = FINEST
    codes = encode(blocks, finest)
    lost = loss(blocks, codes)
    while lost[1] > MOST:
        finest, before = finest / 2, codes
        codes = encode(blocks, finest)
        if (codes.step == before.step).all():
            break
        lost = loss(blocks, codes)
    return codes, lost


def encode(blocks: Sequence[Array], finest: float = FINEST) -> Codes:
    """Pack the spectra (stage, component, m, k, part) of all samples, in steps of at least `finest` [r1]."""
    waves = blocks[0].shape[-2]
    most = np.max([np.abs(block).max(axis=(0, 1, 4)) for block in blocks], axis=0)
    shells = _shells(waves)
    largest = np.zeros(waves)
    np.maximum.at(largest, shells.ravel(), most.ravel())
    step = np.maximum(largest / _LARGEST, finest).astype(np.float32)
    by_wave = step[shells][:, :, None]
    whole = [np.rint(block / by_wave).astype(np.int16) for block in blocks]
    place = np.flatnonzero(np.any([np.any(block, axis=0) for block in whole], axis=0).ravel()).astype(np.int32)
    codes = np.ascontiguousarray(np.stack([block.reshape(len(block), -1)[:, place] for block in whole]))
    return Codes(codes, place, step)


def loss(blocks: Sequence[Array], codes: Codes) -> tuple[float, float]:
    """Return the root mean square and the largest distance [r1] between surfaces of spectra and of their codes."""
    read = Packed(codes)
    band = len(codes.step) - 1
    squares = []
    for block, own in zip(blocks, read, strict=True):
        gone = np.ascontiguousarray(np.asarray(block, np.float64) - own).view(complex)[..., 0]
        square = (spectra.synthesize(gone, band) ** 2).sum(axis=1)
        squares.append(((harmonics.area(band) * square).sum(axis=(1, 2)).max(), square.max()))
    rms, most = np.sqrt(np.max(squares, axis=0)).tolist()
    return rms, most


#: By sample and stage of each table.
_kept: Kept[tuple[int, tuple[int, int]], Array] = Kept(_ROOM, lambda block: block.nbytes)


class Packed:
    """Packed spectra that read like an array (sample, stage, component, m, k, part) of float32."""

    dtype = np.dtype(np.float32)

    def __init__(self, codes: Codes) -> None:
        self.codes, self._place, step = codes
        waves = len(step)
        self.shape: tuple[int, ...] = (*self.codes.shape[:2], 3, waves, waves, 2)
        self._steps = np.repeat(np.tile(step[_shells(waves)].ravel(), 3), 2)[self._place]
        self._kept = Part(_kept, self)

    def __len__(self) -> int:
        return self.shape[0]

    def __iter__(self) -> Iterator[Array]:
        return (self[i] for i in range(len(self)))

    @overload
    def __getitem__(self, place: int) -> Array: ...
    @overload
    def __getitem__(self, place: tuple[int, int]) -> Array: ...
    def __getitem__(self, place: int | tuple[int, int]) -> Array:
        """Return a sample (stage, component, m, k, part), or one of its stages, which is kept and read-only."""
        if isinstance(place, tuple):
            i, j = int(place[0]), int(place[1])
            return self._kept.get((i, j), lambda: self._unpack(i, j))
        return np.stack([self._unpack(int(place), j) for j in range(self.shape[1])])

    def _unpack(self, i: int, j: int) -> Array:
        found = np.zeros(int(np.prod(self.shape[2:])), np.float32)
        found[self._place] = self.codes[i, j] * self._steps
        found.flags.writeable = False
        return found.reshape(self.shape[2:])


#: Spectra (sample, stage, component, m, k, part), mapped or packed.
Stored = Array | Packed


@lru_cache(maxsize=8)
def _shells(waves: int) -> Array:
    order = np.arange(waves)
    return np.maximum.outer(order, order)
