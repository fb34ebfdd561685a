"""What the corrections must know about a weighted mean, without transforming it: products of the samples behind it.

Power by degree and local amplitude of a sum are quadratic in its terms. Their products are computed once for all that
take part (the corners of a cell, at one or two stages) and kept; a query between them is then one quadratic form.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from ...kept import Kept, Part
from ...surfaces import alone, harmonics, spectra
from ...surfaces.packed import Stored
from .products import Products

__all__ = ["COARSE", "Cell", "Cells"]


#: Lattice of the envelope: it is smooth, see `_WIDTH`.
COARSE = 12
#: Degree up to which the envelope is resolved, and the width [radian] of the window in which amplitude is averaged.
_SMOOTH, _WIDTH = 9, 0.35
#: Bytes of cells that all tables keep. One takes .1 to 1 MB and milliseconds to make, which is several look-ups, of
#: tables of twenty samples and more 2 MB and 10 ms: a small table is to find all of its cells again, a large one fifty.
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

    def __init__(self, stored: Stored, products: Products) -> None:
        self._stored = stored
        self._products = products
        self._kept = Part(_kept, self)

    def of(self, samples: tuple[int, ...], stages: tuple[int, ...]) -> Cell:
        """Return the products of all samples at all stages, samples first."""
        return self._kept.get((samples, stages), lambda: self._make(samples, stages))

    def _make(self, samples: tuple[int, ...], stages: tuple[int, ...]) -> Cell:
        blocks = [self._stored[i, j] for i in samples for j in stages]
        waves = [block.view(np.result_type(block.dtype, np.complex64))[..., 0] for block in blocks]
        low = harmonics.low(np.stack([one[:, : harmonics.LOWEST] for one in waves]))
        local = _local(np.stack([spectra.truncate(one, _SQUARES) for one in waves]), low)
        own = np.sqrt(np.maximum(local[np.diag_indices(len(local))], 0))
        # single precision is enough for a smooth factor and for bands, and half to read at every query
        power = self._products.of(samples, stages)
        return Cell(power.astype(np.float32, copy=False), local.astype(np.float32, copy=False), own, low)


def _local(waves: Array, low: Array) -> Array:
    """Return smoothed local products (T, T, 12 * 24), in the spectra's precision, of the wrinkles in spectra
    (T, 3, m, k), whose harmonics below `LOWEST` are `low`.
    """
    fields = spectra.synthesize(harmonics.without_low(waves, low), _SQUARES)
    count, kind = len(fields), fields.dtype
    around, project, spread = (matrix.astype(kind) for matrix in _window())
    found = np.empty((count, count, 2 * COARSE * COARSE), kind)
    for a in range(count):
        products = np.einsum("ctp,bctp->tbp", fields[a], fields[a:])
        # colatitude by colatitude: so small that BLAS does not divide them among threads
        lines = (products @ around).reshape(_SQUARES, count - a, 2, _SMOOTH + 1)
        degrees = np.matmul(lines.transpose(3, 1, 2, 0).reshape(_SMOOTH + 1, -1, _SQUARES), project)
        flat = degrees.reshape(_SMOOTH + 1, count - a, 2, _SMOOTH + 1).transpose(1, 0, 3, 2).reshape(count - a, -1)
        found[a, a:] = found[a:, a] = alone.product(flat, spread)
    return found


@lru_cache(maxsize=1)
def _window() -> tuple[Array, Array, Array]:
    """Return the matrices from azimuths to lines (azimuth, 2 m), from those to windowed harmonics (m, colatitude, l),
    and from those to the coarse lattice (2 m l, places).
    """
    degree = np.arange(_SMOOTH + 1)
    angle = np.outer(np.arange(2 * _SQUARES) * np.pi / _SQUARES, degree)
    around = np.concatenate([np.cos(angle), -np.sin(angle)], axis=1) / (2 * _SQUARES)
    window = np.exp(-degree * (degree + 1) * _WIDTH**2 / 2)[:, None]
    project = harmonics.legendre(_SMOOTH, _SQUARES) * harmonics.area(_SQUARES)[:, 0] * 2 * _SQUARES * window
    shapes = harmonics.legendre(_SMOOTH, COARSE)
    angle = np.outer(degree, np.arange(2 * COARSE) * np.pi / COARSE)
    both = np.where(degree == 0, 1.0, 2.0)[:, None] * np.stack([np.cos(angle), -np.sin(angle)], axis=1).transpose(
        1, 0, 2
    )
    spread = np.einsum("mlt,zmp->mlztp", shapes, both).reshape(2 * (_SMOOTH + 1) ** 2, -1)
    return around, project.swapaxes(1, 2), spread
