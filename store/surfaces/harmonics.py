"""Degrees of a surface field: from its double-Fourier-sphere spectrum to spherical harmonics.

A double-Fourier mode (m, k) has no degree of its own: cos k theta is a different wave at the equator and at the pole.
Power by degree therefore comes from the true harmonics, one small matrix per azimuthal wavenumber m from k to the
degree l. The integrals over colatitude are Fejer's first rule, exact for all products that occur. Harmonics are
normalised to mean square 1 over the unit sphere, so that powers add up to the field's mean square.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from solver.arrays import Array
from solver.lattice import colatitudes

from . import alone

__all__ = ["LOWEST", "area", "degrees", "legendre", "low", "low_series", "power", "shares", "without_low"]


#: Degrees below this are the shape of the fruit (size, shift, ellipticity), not wrinkles.
LOWEST = 3


@lru_cache(maxsize=16)
def area(n: int) -> Array:
    """Return the share (n, 1) that each cell of the lattice of `n` has in the unit sphere; all cells sum to 1."""
    shares = _fejer(n)[:, None] / (4 * n)
    shares.flags.writeable = False
    return shares


def degrees(spectrum: Array) -> Array:
    """Return the harmonics (..., m, l) of spectra (..., m, k), for 0 <= m, l <= B; zero where l < m.

    Of a spectrum that is not smooth at the poles only the part that harmonics can hold is returned.
    """
    band = spectrum.shape[-1] - 1
    lead = spectrum.shape[:-2]
    lines = np.moveaxis(spectrum.reshape(-1, band + 1, band + 1), 0, -1)
    parts = np.ascontiguousarray(lines).astype(complex).view(float)
    found = np.empty_like(parts)
    for parity, matrices in enumerate(_matrices(band)):
        np.matmul(matrices, parts[:, parity::2], out=found[:, parity::2])
    found = found.view(complex)
    return np.moveaxis(found, -1, 0).reshape(*lead, band + 1, band + 1)


def power(harmonics: Array) -> Array:
    """Return the mean square by degree (..., l) of a field's harmonics (..., m, l)."""
    squares = harmonics.real**2 + harmonics.imag**2
    found: Array = 2 * squares.sum(axis=-2) - squares[..., 0, :]
    return found


def low(spectrum: Array) -> Array:
    """Return the harmonics (..., m, l) below `LOWEST` of spectra (..., m, k)."""
    found: Array = np.einsum("mlk,...mk->...ml", _low_matrices(spectrum.shape[-1] - 1), spectrum[..., :LOWEST, :])
    return found


def without_low(spectrum: Array, own: Array | None = None) -> Array:
    """Return spectra (..., m, k) without their harmonics below `LOWEST`: what is left are the wrinkles.

    `own` are these harmonics, where they are known.
    """
    rest = spectrum.copy()
    series = low_series(spectrum.shape[-1] - 1)
    found = low(spectrum) if own is None else own
    rest[..., :LOWEST, :] -= np.einsum("...ml,mlk->...mk", found, series).astype(rest.dtype)
    return rest


def shares(band: int) -> Array:
    """Return what part (l, m, k) of the mean square of degree l a mode (m, k) carries: each degree sums to 1.

    Degrees are taken with random phases. Modes are not orthogonal over the sphere, so small parts are negative.
    """
    n = 2 * band + 2
    series = _sums(band, band, np.full(n, 2 / n))
    series[0::2, :, 0] /= 2
    both = np.where(np.arange(band + 1) == 0, 1.0, 2.0)
    found = np.einsum("m,mlk->lmk", both, series * _to_degrees(band, band))
    value: Array = found / (2 * np.arange(band + 1) + 1)[:, None, None]
    return value


@lru_cache(maxsize=64)
def legendre(highest: int, n: int) -> Array:
    """Return the normalised associated Legendre functions (m, l, n) at the lattice's colatitudes, m, l <= `highest`.

    They are kept: ask for low degrees.
    """
    return _functions(highest, colatitudes(n))


def _functions(highest: int, colatitude: Array) -> Array:
    x, y = np.cos(colatitude), np.sin(colatitude)
    found = np.zeros((highest + 1, highest + 1, len(colatitude)))
    found[0, 0] = 1
    for m in range(1, highest + 1):
        found[m, m] = np.sqrt((2 * m + 1) / (2 * m)) * y * found[m - 1, m - 1]
    for j in range(1, highest + 1):
        orders = np.arange(j)
        a = np.sqrt((4 * j**2 - 1) / (j**2 - orders**2))
        found[:j, j] = a[:, None] * x * found[:j, j - 1]
        if j > 1:  # for m = j - 1 the second term is nothing
            b = np.sqrt((2 * j + 1) * (j - 1 + orders) * (j - 1 - orders) / ((2 * j - 3) * (j**2 - orders**2)))
            found[:j, j] -= b[:, None] * found[:j, j - 2]
    return found


def _fejer(n: int) -> Array:
    """Return Fejer's weights (n,), which sum to 2."""
    k = np.arange(1, n // 2 + 1)
    # at k = n/2 the cosine vanishes on every node
    found: Array = (2 / n) * (1 - 2 * (np.cos(2 * np.outer(colatitudes(n), k)) / (4 * k**2 - 1)).sum(axis=1))
    return found


@lru_cache(maxsize=4)
def _matrices(band: int) -> tuple[Array, Array]:
    """Return the matrices (m, l, k) from amplitudes of the spectrum to harmonics: of even l and k, then of odd ones, as
    others do not meet.
    """
    found = _to_degrees(band, band)
    even, odd = (np.ascontiguousarray(found[:, parity::2, parity::2]) for parity in (0, 1))
    return even, odd


@lru_cache(maxsize=8)
def _low_matrices(band: int) -> Array:
    """Return the matrices (m, l, k) from amplitudes to harmonics below `LOWEST`."""
    return _to_degrees(LOWEST - 1, band)


def _to_degrees(highest: int, band: int) -> Array:
    """Return the matrices (m, l, k) from amplitudes of the spectrum to harmonics m, l <= `highest`."""
    return _sums(highest, band, _fejer(2 * band + 2) / 2)


def _sums(highest: int, band: int, weight: Array) -> Array:
    """Return the sums (m, l, k) over colatitudes of harmonics times waves k, cosines for even m and sines for odd m, by
    a `weight` (2 band + 2,) that is the same on both hemispheres.
    """
    north = colatitudes(len(weight))[: band + 1]
    functions = _functions(highest, north) * (2 * weight[: band + 1])
    angles = np.outer(north, np.arange(band + 1))
    waves = np.cos(angles), np.sin(angles)
    found = np.zeros((highest + 1, highest + 1, band + 1))
    for m in range(highest + 1):
        for first in (m, m + 1):
            # what changes its sign across the equator does not meet what does not: l and k are both even or both odd
            degrees, k = slice(first, None, 2), slice(first % 2, None, 2)
            found[m, degrees, k] = alone.product(functions[m, degrees], waves[m % 2][:, k])
    return found


@lru_cache(maxsize=8)
def low_series(band: int) -> Array:
    """Return the amplitudes (m, l, k) of the harmonics below `LOWEST`."""
    n = 2 * band + 2
    series = _sums(LOWEST - 1, band, np.full(n, 2 / n))
    series[0::2, :, 0] /= 2
    return series
