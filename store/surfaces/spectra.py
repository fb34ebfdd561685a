"""A surface field and its spectrum on the double Fourier sphere.

A field on the lattice of `solver.lattice` continues over the pole to the opposite meridian, f(-theta, phi) =
f(theta, phi + pi), which makes it smooth and doubly periodic. In the Fourier series over both angles

    f(theta, phi) = sum_{m = -B..B} exp(i m phi) sum_{k = 0..B} S[m, k] * (cos k theta for even m, sin k theta for odd)

the symmetry leaves only cosines for even m (a shift by pi is a factor (-1)^m) and only sines for odd m, and a real
field has S[-m, k] = conj S[m, k]. What is stored, S[m, k] for 0 <= m, k <= B, is therefore half of the 2-D real FFT of
the doubled field: at n = 96 and three components in float32, 226 kB instead of 447 kB, as much as the field itself
(221 kB). Coefficients are amplitudes, independent of any resolution, so another resolution is padding or truncation;
the half-cell offset of the colatitudes is in the half-cell transforms (DCT and DST of type II and III).
"""

from __future__ import annotations

import numpy as np

from solver.arrays import Array

from . import transforms

__all__ = ["band_of", "gradient", "poles", "spectrum", "synthesize", "truncate"]


def spectrum(field: Array) -> Array:
    """Return the spectrum of real fields (..., n, 2n) as (..., m, k), or of (..., n, 2n, c) as (..., m, k, c).

    m and k run from 0 to n; complex64 for float32 fields, else complex128.

    Raises:
        ValueError: the shape is no lattice.

    """
    lead, planes, vector = _planes(np.asarray(field))
    n = planes.shape[-2]
    raw = transforms.analyse(planes.reshape(-1, n, 2 * n))
    # a mean over the 2n azimuths, and twice the mean over the n colatitudes (the sums come doubled)
    scale = np.asarray(1 / (2 * n * n), planes.dtype)
    full = np.zeros((len(raw), n + 1, n + 1), raw.dtype)
    full[:, 0::2, :n] = raw[:, 0::2] * scale
    full[:, 1::2, 1:] = raw[:, 1::2] * scale
    full[:, 0::2, 0] /= 2  # the constant and the wave of the lattice's own period have twice the others' norm
    full[:, 1::2, n] /= 2
    full[:, n] /= 2  # exp(i n phi) and exp(-i n phi) look the same on the lattice: half for each
    full = full.reshape(*lead, n + 1, n + 1)
    return np.moveaxis(full, -3, -1) if vector else full


def synthesize(spectrum: Array, resolution: int) -> Array:
    """Return the field of a spectrum (..., m, k[, c]) on the lattice of `resolution`: (..., n, 2n[, c]).

    Waves that the lattice cannot hold are left out, never folded back.

    Raises:
        ValueError: the shape is no spectrum, or the resolution is not positive.

    """
    return _synthesize(spectrum, resolution)


def _synthesize(spectrum: Array, resolution: int, swapped: bool = False) -> Array:
    if resolution < 1:
        raise ValueError(f"a lattice has at least one colatitude, not {resolution}")
    band, vector = band_of(spectrum), _is_vector(spectrum)
    planes = np.moveaxis(spectrum, -1, -3) if vector else spectrum
    lead = planes.shape[:-2]
    planes = planes.reshape(-1, band + 1, band + 1)
    dtype = np.dtype(np.float32 if planes.dtype == np.complex64 else np.float64)
    with transforms.borrow(resolution, min(band, resolution), len(planes), dtype, swapped) as plan:
        plan.put(planes)
        field = plan.run().reshape(*lead, resolution, 2 * resolution)
        return np.ascontiguousarray(np.moveaxis(field, -3, -1)) if vector else field.copy()


def gradient(spectrum: Array, resolution: int) -> tuple[Array, Array]:
    """Return the derivatives by colatitude and by azimuth of a spectrum's field, each as `synthesize` returns it.

    Raises:
        ValueError: the shape is no spectrum, or the resolution is not positive.

    """
    band = band_of(spectrum)
    waves = np.arange(band + 1, dtype=spectrum.real.dtype)
    signs = np.where(waves % 2 == 0, -waves.dtype.type(1), waves.dtype.type(1))  # cos' = -sin, sin' = cos
    by_k, by_m = np.multiply.outer(signs, waves), (1j * waves).astype(spectrum.dtype)[:, None]
    if _is_vector(spectrum):
        by_k, by_m = by_k[..., None], by_m[..., None]
    return _synthesize(spectrum * by_k, resolution, swapped=True), _synthesize(spectrum * by_m, resolution)


def truncate(spectrum: Array, band: int) -> Array:
    """Return the waves m, k <= `band` of a spectrum (..., m, k[, c]), a view; all of it where the band is wider.

    Raises:
        ValueError: the shape is no spectrum, or what is left could not be told from a scalar's spectrum.

    """
    cut = slice(min(band, band_of(spectrum)) + 1)
    if not _is_vector(spectrum):
        return spectrum[..., cut, cut]
    if cut.stop == spectrum.shape[-1]:
        raise ValueError(f"a band of {band} with {cut.stop} components is ambiguous: keep one wave more or fewer")
    return spectrum[..., cut, cut, :]


def poles(spectrum: Array) -> Array:
    """Return the field's values (..., 2[, c]) at the poles theta = 0 and pi, averaged over the azimuth."""
    vector = _is_vector(spectrum)
    axial = (spectrum[..., 0, :, :] if vector else spectrum[..., 0, :]).real
    k_axis = -2 if vector else -1
    signs = 1 - 2 * (np.arange(band_of(spectrum) + 1) % 2)
    south = axial * (signs[:, None] if vector else signs).astype(axial.dtype)
    return np.stack([axial.sum(k_axis), south.sum(k_axis)], axis=k_axis)


def band_of(spectrum: Array) -> int:
    """Return the largest wavenumber B of a spectrum (..., B + 1, B + 1[, c]).

    Raises:
        ValueError: the shape is no spectrum.

    """
    shape = spectrum.shape
    if len(shape) >= 2 and shape[-1] == shape[-2]:
        return int(shape[-1] - 1)
    if len(shape) >= 3 and shape[-2] == shape[-3]:
        return int(shape[-2] - 1)
    raise ValueError(f"{shape} is not the shape of a spectrum (..., B + 1, B + 1[, c])")


def _is_vector(spectrum: Array) -> bool:
    return bool(spectrum.shape[-1] != spectrum.shape[-2])


def _planes(field: Array) -> tuple[tuple[int, ...], Array, bool]:
    """Return (leading shape, contiguous floating planes (..., n, 2n), whether components were moved to the front)."""
    dtype = np.float32 if field.dtype == np.float32 else np.float64
    shape = field.shape
    if len(shape) >= 2 and shape[-1] == 2 * shape[-2]:
        return shape[:-2], np.ascontiguousarray(field, dtype), False
    if len(shape) >= 3 and shape[-2] == 2 * shape[-3]:
        planes = np.ascontiguousarray(np.moveaxis(field, -1, -3), dtype)
        return planes.shape[:-2], planes, True
    raise ValueError(f"{shape} is not the shape of a lattice field (..., n, 2n[, c])")
