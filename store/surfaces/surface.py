"""Geometry on the lattice: the fresh outer surface, cheaply, and normals of any surface."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from solver.arrays import Array
from solver.fruit import Fruit, azimuths, colatitudes

from . import spectra
from .window import WHOLE, Patch

__all__ = ["add_fresh", "fresh_poles", "normals"]


def add_fresh(fruit: Fruit, displacement: Array, patch: Patch | None = None) -> Array:
    """Return X + u as (height, width, c) for displacements u (c, height, width) on a patch (None: the whole lattice);
    X is `fruit.surface` there, in u's precision.

    Only the generatrix and the azimuth's sine and cosine are evaluated, each once; the surface is their product.
    """
    patch = patch or WHOLE.on(displacement.shape[1])
    kind = displacement.dtype
    x, y = (values[patch.rows] for values in _generatrix(fruit.radii, patch.n))
    cosine, sine = (values[patch.columns] for values in _circle(patch.n))
    squash = fruit.radii[7] / fruit.radii[3]
    te = fruit.exocarp_thickness
    if fruit.is_axisymmetric:
        stretch: Array = 1 + te / np.hypot(x, y)
        across: Array = (x * stretch)[:, None].astype(kind)
        along: Array = (y * stretch)[:, None].astype(kind)
    else:
        flat = (x**2).astype(kind)[:, None] * (cosine**2 + (squash * sine) ** 2).astype(kind)
        stretch = 1 + kind.type(te) / np.sqrt(flat + (y**2).astype(kind)[:, None])
        across, along = stretch * x.astype(kind)[:, None], stretch * y.astype(kind)[:, None]
    position = np.empty((patch.height, patch.width, len(patch.components)), kind)
    for i, component in enumerate(patch.components):
        fresh = along if component == 1 else across * (squash * sine if component else cosine).astype(kind)
        np.add(displacement[i], fresh, out=position[..., i])
    return position


def fresh_poles(fruit: Fruit) -> Array:
    """Return the fresh surface's two poles (2, 3)."""
    inner, distance = _ends(fruit.radii)
    return inner * (1 + fruit.exocarp_thickness / distance)


@lru_cache(maxsize=64)
def _generatrix(radii: tuple[float, ...], n: int) -> tuple[Array, Array]:
    # the fruit that these radii come from has been validated
    fruit: Any = Fruit.model_construct
    return fruit(radii=radii).generatrix(colatitudes(n))


@lru_cache(maxsize=64)
def _ends(radii: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the sarcocarp's poles (2, 3) and their distances (2, 1) from the centre."""
    fruit: Any = Fruit.model_construct
    inner = fruit(radii=radii).sarcocarp(np.array([0.0, np.pi]), np.zeros(2))
    return inner, np.linalg.norm(inner, axis=-1, keepdims=True)


@lru_cache(maxsize=16)
def _circle(n: int) -> tuple[Array, Array]:
    phi = azimuths(n)
    return np.cos(phi), np.sin(phi)


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
