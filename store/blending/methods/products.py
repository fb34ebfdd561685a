"""Products of the wrinkles of a table's samples, by band of degrees, summed over components.

The power of a weighted mean is quadratic in its terms: their products are all that it takes, and they say how much a
sample is like others. Harmonics take milliseconds a sample and stage, so a table of not too many samples holds the
products of all; those of others are made when they are asked for.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from solver.arrays import Array

from ...surfaces import harmonics
from ...surfaces.packed import Stored
from .bands import Bands

__all__ = ["MOST", "Products", "all_of"]

#: Samples of a table up to which it holds the products of all: 3 MB at six stages.
MOST = 64
#: Power [r1^2] below which there is no pattern to be like.
_NOTHING = 1e-12


class Products:
    """Products of spectra (sample, stage, component, m, k, part); `known` are those that `all_of` gives."""

    def __init__(self, stored: Stored, bands: Bands, known: Array | None = None) -> None:
        self._stored, self._bands, self._known = stored, bands, known

    def of(self, samples: tuple[int, ...], stages: tuple[int, ...]) -> Array:
        """Return the products (T, T, bands) of all samples at all stages, samples first."""
        known = self._known
        if known is None or any(after != before + 1 for before, after in pairwise(stages)):
            terms = _terms(self._stored, [(i, j) for i in samples for j in stages], self._bands)
            return _between(terms, terms)
        pairs, size = np.ix_(samples, samples), (len(samples), len(stages))
        found = np.empty((*size, *size, known.shape[-1]), known.dtype)
        for a, j in enumerate(stages):
            found[:, a, :, a] = known[0, j][pairs]
            for b in range(a + 1, len(stages)):
                found[:, a, :, b] = known[b - a, j][pairs]
                found[:, b, :, a] = found[:, a, :, b].swapaxes(0, 1)
        count = len(samples) * len(stages)
        return found.reshape(count, count, -1)

    def likeness(self, i: int, others: tuple[int, ...], j: int) -> float | None:
        """Return the mean correlation of the wrinkles of sample `i` at stage `j` with those of others: 0 where there
        are no others, and None where it has no wrinkles.
        """
        found = self.of((i, *others), (j,)).sum(axis=-1, dtype=float)
        if found[0, 0] < _NOTHING:
            return None
        norms = np.sqrt(found[0, 0] * np.maximum(np.diagonal(found)[1:], 0))
        return float(np.mean(found[0, 1:] / np.maximum(norms, _NOTHING))) if others else 0.0


def all_of(stored: Stored, bands: Bands) -> Array:
    """Return the products (2, stage, sample, sample, band) of all samples at each stage; and of those at each stage, by
    the first samples, with those at the next one, which are zero at the last.
    """
    count, stages = stored.shape[:2]
    found = np.zeros((2, stages, count, count, len(bands.first)))
    before: list[Array] = []
    for j in range(stages):
        terms = _terms(stored, [(i, j) for i in range(count)], bands)
        found[0, j] = _between(terms, terms)
        if before:
            found[1, j - 1] = _between(before, terms)
        before = terms
    return found


def _terms(stored: Stored, places: list[tuple[int, int]], bands: Bands) -> list[Array]:
    """Return the harmonics (T, n) of samples at stages, by band, so that products are mean squares over the sphere."""
    blocks = [stored[i, j] for i, j in places]
    waves = np.stack([block.view(np.result_type(block.dtype, np.complex64))[..., 0] for block in blocks])
    found = harmonics.degrees(waves)
    weight = np.where(np.arange(found.shape[-2]) == 0, 1.0, np.sqrt(2.0))[:, None]
    # degree first: every band is then a block of columns
    flat = np.moveaxis(found * weight, -1, 1)
    ends = [*bands.first.tolist(), flat.shape[1]]
    return [np.ascontiguousarray(flat[:, first:last]).reshape(len(flat), -1) for first, last in pairwise(ends)]


def _between(a: list[Array], b: list[Array]) -> Array:
    """Return the products (T, U, bands) of terms (T, n) and (U, n) by band."""
    return np.stack([(one @ other.conj().T).real for one, other in zip(a, b, strict=True)], axis=-1)
