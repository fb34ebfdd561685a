"""A mode of a mesh as heights over the whole fruit, and the waves in it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.special import sph_harm_y, sph_legendre_p_all

from ...arrays import Bools, Floats
from ..implicit import Band, Model
from ..implicit.buckling import Crossing
from ..implicit.location import fold, interpolate
from ..params import DehydrationParams
from .looks import nodal

__all__ = ["dominant", "mode_heights", "round_it"]


#: Angle [radian] by which a point over a band may lie beside the directions of its columns, which lean.
ASIDE = 0.05


def mode_heights(params: DehydrationParams, model: Model, crossing: Crossing) -> Callable[[Floats], Floats]:
    """Return a mode's height along the outward normal over parametric directions, largest magnitude 1."""
    mesh = model.mesh
    at_nodes = nodal(model, crossing.mode)

    def raw(towards: Floats) -> Floats:
        if mesh.band is None:
            return at(towards)
        # most of the fruit is far from a band
        found, near = np.zeros(len(towards)), np.flatnonzero(_about(mesh.band, fold(mesh, towards)[0]))
        found[near] = at(towards[near])
        return found

    def at(towards: Floats) -> Floats:
        colatitude, azimuth = np.arccos(np.clip(towards[:, 1], -1, 1)), np.arctan2(towards[:, 2], towards[:, 0])
        points = params.surface(colatitude, azimuth)
        folded, signs = fold(mesh, points)
        moved = signs * interpolate(params, mesh, at_nodes, folded)
        for axis, parity in zip(mesh.planes, crossing.parity, strict=True):
            if parity < 0:
                moved *= signs[:, axis : axis + 1]
        found, there = np.zeros(len(towards)), np.flatnonzero(moved.any(axis=1))
        step, azimuth = 1e-5, azimuth[there]
        # one-sided where the pole is nearer than the step; the azimuthal tangent vanishes there, so go a little off it
        inner = np.clip(colatitude[there], 1e-3, np.pi - 1e-3)
        along = params.surface(inner + step, azimuth) - params.surface(inner - step, azimuth)
        around = params.surface(inner, azimuth + step) - params.surface(inner, azimuth - step)
        normal = np.cross(around, along)
        normal *= np.sign(np.einsum("pi,pi->p", normal, points[there]))[:, None]
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        found[there] = np.einsum("pi,pi->p", moved[there], normal)
        return found

    many = min(12 * len(mesh.quad_of[0]), 361)
    theta, phi = np.meshgrid(np.linspace(0.01, np.pi - 0.01, many), np.linspace(0, np.pi, many), indexing="ij")
    sample = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    values = raw(sample.reshape(-1, 3))
    scale = values[np.argmax(np.abs(values))]
    return lambda towards: raw(np.asarray(towards, dtype=float)) / scale


def _about(band: Band, towards: Floats) -> Bools:
    """Return which directions (k, 3) lie in a band or beside it."""
    colatitude, azimuth = np.arccos(np.clip(towards[:, 1], -1, 1)), np.arctan2(towards[:, 2], towards[:, 0])
    between = (colatitude > band.high - ASIDE) & (colatitude < band.low + ASIDE)
    found: Bools = between & (azimuth > band.first - ASIDE) & (azimuth < band.last + ASIDE)
    return found


def round_it(heights: Callable[[Floats], Floats], band: Band, highest: int) -> tuple[int, int]:
    """Return what `dominant` returns, the degree being that of the wavenumber, for a mode in a band."""
    nodes, weights = np.polynomial.legendre.leggauss(highest + 8)
    colatitude, count = np.arccos(nodes), 4 * math.ceil(band.cells * np.pi / 2 / (band.last - band.first))
    azimuth = np.arange(count) * 2 * np.pi / count
    theta, phi = np.meshgrid(colatitude, azimuth, indexing="ij")
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    waves = np.fft.rfft(heights(points.reshape(-1, 3)).reshape(theta.shape), axis=1)
    m = int((weights @ np.abs(waves) ** 2).argmax())
    degrees = np.arange(m, max(highest, m) + 1)
    harmonics = sph_harm_y(degrees[:, None], m, colatitude[None, :], 0.0).real
    return int(degrees[np.abs(harmonics @ (weights * waves[:, m])).argmax()]), m


def dominant(heights: Callable[[Floats], Floats], highest: int) -> tuple[int, int]:
    """Return the spherical-harmonic degree and azimuthal wavenumber that carry most of a mode's mean square."""
    nodes, weights = np.polynomial.legendre.leggauss(highest + 8)
    colatitude = np.arccos(nodes)
    azimuth = np.arange(2 * highest + 2) * np.pi / (highest + 1)
    theta, phi = np.meshgrid(colatitude, azimuth, indexing="ij")
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    waves = np.fft.rfft(heights(points.reshape(-1, 3)).reshape(theta.shape), axis=1)[:, : highest + 1]
    power = np.zeros((highest + 1, highest + 1))
    harmonics = sph_legendre_p_all(highest, highest, colatitude)[0]
    for m in range(highest + 1):
        power[m:, m] = np.abs((harmonics[m:, m] * weights) @ waves[:, m]) ** 2 * (1 if m == 0 else 2)
    return int(power.sum(axis=1).argmax()), int(power.sum(axis=0).argmax())
