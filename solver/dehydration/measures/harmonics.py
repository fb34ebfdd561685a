"""Spherical-harmonic analysis of fields on the cell-centred lattice of `solver.fruit`."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.special import sph_legendre_p_all

from ...arrays import Complexes, Floats
from ...fruit import colatitudes

__all__ = ["analyse", "power", "quadrature", "remove_low"]


@lru_cache(maxsize=8)
def quadrature(resolution: int) -> Floats:
    """Return Fejer weights (resolution,) for the integral over cos(colatitude), summing to 2; exact to degree n - 1."""
    theta = colatitudes(resolution)
    k = np.arange(1, resolution // 2 + 1)
    series = (np.cos(2 * np.outer(theta, k)) / (4 * k**2 - 1)).sum(axis=1)
    weights: Floats = 2 / resolution * (1 - 2 * series)
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=4)
def _legendre(resolution: int, degree: int) -> Floats:
    """Return orthonormal Y_lm(colatitude, 0) as (m, l, resolution); zero where l < m."""
    # one recurrence for all, to the bit what `sph_harm_y` gives one by one; -m and a derivative's axis are left out
    every = sph_legendre_p_all(degree, degree, colatitudes(resolution))[0][:, : degree + 1]
    table = np.ascontiguousarray(every.transpose(1, 0, 2))
    table.flags.writeable = False
    return table


def analyse(field: Floats, degree: int) -> Complexes:
    """Return coefficients (m, l) of a real field (n, 2n) on the unit sphere, l up to `degree` (at most n - 1).

    Exact where l plus the field's own degree is below n; beyond that the finest degrees alias, as in any quadrature.
    """
    n = len(field)
    rings = np.fft.rfft(field, axis=1)[:, : degree + 1] * (np.pi / n)
    # without BLAS (no optimize): its rounding depends on the number of threads, and results must not
    found: Complexes = np.einsum("mlt,tm->ml", _legendre(n, degree), rings * quadrature(n)[:, None])
    return found


def power(coefficients: Complexes) -> Floats:
    """Return the mean square of the field carried by each degree l (Parseval over the sphere's area 4 pi)."""
    twice = np.full(len(coefficients), 2.0)
    twice[0] = 1.0
    found: Floats = (twice[:, None] * np.abs(coefficients) ** 2).sum(axis=0) / (4 * np.pi)
    return found


def remove_low(field: Floats, lowest: int) -> Floats:
    """Return the field (n, 2n) without its degrees l < `lowest`."""
    n = len(field)
    coefficients = analyse(field, lowest - 1)
    table = _legendre(n, lowest - 1)
    rings = np.einsum("mlt,ml->tm", table, coefficients)
    spectrum = np.zeros((n, n + 1), dtype=complex)
    spectrum[:, : rings.shape[1]] = rings
    return field - np.fft.irfft(spectrum, n=2 * n, axis=1) * (2 * n)
