"""What the corrections must know about a weighted mean, without transforming it: products of the samples behind it.

Power by degree and local amplitude of a sum are quadratic in its terms. Their products are computed once for all that
take part (the corners of a cell, at one or two stages) and kept; a query between them is then one quadratic form.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from ...kept import Kept, Part
from ...surfaces import harmonics, spectra
from ...surfaces.packed import Stored
from .bands import Bands

__all__ = ["COARSE", "Cell", "Cells"]


#: Lattice of the envelope: it is smooth, see `_WIDTH`.
COARSE = 12
#: Degree up to which the envelope is resolved, and the width [radian] of the window in which amplitude is averaged.
_SMOOTH, _WIDTH = 9, 0.35
#: Bytes of cells that all tables keep. One takes .1 to 1 MB and some 10 ms to make, which is ten look-ups, of tables of
#: twenty samples and more 2 MB and 60 ms: a small table is to find all of its cells again, a large one fifty of them.
_ROOM = 96 << 20
#: Lattice on which squares are taken; wrinkles beyond degree 48 are folded there, which moves no energy far.
_SQUARES = 48


class Cell(NamedTuple):
    """Products of T terms: `power` (T, T, bands) by degree, `local` (T, T, 12 * 24) around each place of the coarse
    lattice, the terms' own local `amplitude` (T, 12 * 24) and their harmonics below `LOWEST`, `low` (T, 3, m, l).
    """

    power: Array
    local: Array
    amplitude: Array
    low: Array


def _size(cell: Cell) -> int:
    return sum(part.nbytes for part in cell)


#: By samples and stages of each table.
_kept: Kept[tuple[int, tuple[tuple[int, ...], tuple[int, ...]]], Cell] = Kept(_ROOM, _size)


class Cells:
    """Products of the spectra (sample, stage, component, m, k, part) of a table, kept for the cells last visited."""

    def __init__(self, stored: Stored, bands: Bands) -> None:
        self._stored = stored
        self._bands = bands
        self._kept = Part(_kept, self)

    def of(self, samples: tuple[int, ...], stages: tuple[int, ...]) -> Cell:
        """Return the products of all samples at all stages, samples first."""
        return self._kept.get((samples, stages), lambda: self._make(samples, stages))

    def _make(self, samples: tuple[int, ...], stages: tuple[int, ...]) -> Cell:
        blocks = [self._stored[i, j] for i in samples for j in stages]
        waves = np.stack([b.view(np.result_type(b.dtype, np.complex64))[..., 0] for b in blocks])
        found = harmonics.degrees(waves)
        local = _local(waves, found)
        own = np.sqrt(np.maximum(local[np.diag_indices(len(local))], 0))
        low = found[..., : harmonics.LOWEST, : harmonics.LOWEST].copy()  # a view would keep all harmonics of the cell
        # single precision is enough for a smooth factor, and half to read at every query
        return Cell(_power(found, self._bands), local.astype(np.float32), own, low)


def _power(found: Array, bands: Bands) -> Array:
    """Return products by band (T, T, bands), summed over components, of harmonics (T, 3, m, l)."""
    weight = np.where(np.arange(found.shape[-2]) == 0, 1.0, np.sqrt(2.0))[:, None]
    # degree first: every band is then a block of columns
    flat = np.moveaxis(found * weight, -1, 1)
    ends = [*bands.first.tolist(), flat.shape[1]]
    products = []
    for first, last in pairwise(ends):
        block = np.ascontiguousarray(flat[:, first:last]).reshape(len(flat), -1)
        products.append((block @ block.conj().T).real)
    return np.stack(products, axis=-1)


def _local(waves: Array, found: Array | None = None) -> Array:
    """Return smoothed local products (T, T, 12 * 24) of the wrinkles in spectra (T, 3, m, k), of which the harmonics
    may be `found` already.
    """
    fields = spectra.synthesize(harmonics.without_low(waves, found), _SQUARES)
    count = len(fields)
    project, spread = _window()
    found = np.empty((count, count, 2 * COARSE * COARSE))
    for a in range(count):
        products = np.einsum("ctp,bctp->btp", fields[a], fields[a:])
        lines = np.fft.rfft(products, axis=-1)[..., : _SMOOTH + 1] / products.shape[-1]
        found[a, a:] = found[a:, a] = (
            np.einsum("mlt,btm->bml", project, lines).reshape(count - a, -1).view(float) @ spread
        )
    return found


@lru_cache(maxsize=1)
def _window() -> tuple[Array, Array]:
    """Return the matrices from lines (colatitude, m) to windowed harmonics (m, l, colatitude), and from those to the
    coarse lattice (2 m l, places).
    """
    degree = np.arange(_SMOOTH + 1)
    window = np.exp(-degree * (degree + 1) * _WIDTH**2 / 2)[:, None]
    project = harmonics.legendre(_SMOOTH, _SQUARES) * harmonics.area(_SQUARES)[:, 0] * 2 * _SQUARES * window
    shapes = harmonics.legendre(_SMOOTH, COARSE)
    angle = np.outer(degree, np.arange(2 * COARSE) * np.pi / COARSE)
    both = np.where(degree == 0, 1.0, 2.0)[:, None] * np.stack([np.cos(angle), -np.sin(angle)], axis=1).transpose(
        1, 0, 2
    )
    spread = np.einsum("mlt,zmp->mlztp", shapes, both).reshape(2 * (_SMOOTH + 1) ** 2, -1)
    return project, spread
