"""Geometry on the lattice: fresh surfaces with displacements, and normals of any surface."""

from __future__ import annotations

import numpy as np

from solver.arrays import Array
from solver.contract import Fresh

from . import spectra, steps
from .window import WHOLE, Patch

__all__ = ["add_fresh", "lift", "normals"]


def add_fresh(fresh: Fresh, displacement: Array, patch: Patch | None = None) -> Array:
    """Return X + u as (height, width, c) for displacements u (c, height, width) on a patch (None: the whole lattice),
    in u's precision.
    """
    patch = patch or WHOLE.on(displacement.shape[1])
    position = np.empty((patch.height, patch.width, len(patch.components)), displacement.dtype)
    planes = fresh.planes(patch.n, patch.rows, patch.columns, patch.components, displacement.dtype)
    for i, plane in enumerate(planes):
        np.add(displacement[i], plane, out=position[..., i])
    return position


def lift(fresh: Fresh, displacement: Array, ratio: Array, low: Array) -> Array:
    """Return X + u ratio + low as (n, 2n, 3) for displacements u and `low` (3, n, 2n) and a `ratio` (n, 2n)."""
    size, kind = ratio.shape, displacement.dtype
    position = np.empty((*size, 3), kind)
    x, y, z = planes = tuple(fresh.planes(size[0], slice(None), slice(None), (0, 1, 2), kind))
    # compiled code is made for whole arrays alone
    arrays = (displacement, ratio, low, *planes)
    is_plain = all(plane.shape in (size, (size[0], 1)) for plane in planes) and all(
        one.dtype == kind and one.flags.c_contiguous for one in arrays
    )
    way = steps.now() if is_plain else steps.PLAIN
    way.lift(displacement, ratio, low, x, y, z, position)
    return position


def normals(position: Array) -> Array:
    """Return outward unit normals (n, 2n, 3) of a surface on the lattice.

    Derivatives are those of the surface's double Fourier series: exact for every wave that the lattice holds. Where
    the surface has no tangent plane, the normal is zero.
    """
    southward, eastward = spectra.gradient(spectra.spectrum(position), position.shape[0])
    return _unit(_cross(eastward, southward))


def _cross(a: Array, b: Array) -> Array:
    """Return a x b of vectors (..., 3), several times faster than numpy's for many."""
    result = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[..., j], b[..., k], out=result[..., i])
        result[..., i] -= a[..., k] * b[..., j]
    return result


def _unit(vectors: Array) -> Array:
    length = np.sqrt(np.einsum("...i,...i", vectors, vectors))[..., None]
    return vectors / np.where(length > 0, length, 1)
