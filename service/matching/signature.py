"""What is alike in two wrinkled shapes whose wrinkles are not the same: numbers that no turn, shift or mirror changes.

A closed surface is read along rays from the centre of its volume, over the radius of a ball of the same volume. Its
outline is in the axes of its inertia, its wrinkles in their amplitude by band of spherical-harmonic degree, in how
deep, sharp and patchy they are, and in the slopes of the surface. Where the length of r1 is known, so is its size.

Each number has a scatter: by how much it differs between fruits of the same parameters that wrinkled from other seeds
(benchmarks/results/service-match.json), no less than what a random field of so many waves must have.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from solver.arrays import Array, Floats
from store.surfaces import harmonics, spectra

__all__ = ["COARSE", "FINE", "Signature", "Unreadable", "signature"]

#: Colatitudes of the rays: when the best is sought, and for the first look at a whole table.
FINE, COARSE = 96, 64
#: First degrees of the bands; each holds odd and even ones, as fruits with planes of symmetry lack some. What lies
#: above 3/4 of the lattice's colatitudes is not told apart.
_BANDS = np.array([3, 5, 7, 9, 12, 15, 19, 24, 30, 38, 48, 60, 72])
#: Amplitude of a band below which a surface is smooth there, over the ball's radius: what files round away.
_SMOOTH = 2e-4
#: Share of rays that may meet nothing, as through small holes.
_HOLES = 0.01
#: Quantiles of the slope.
_QUANTILES = (0.25, 0.5, 0.75, 0.95)

#: Scatter of what no count of waves foretells: logarithms of the inertia's axes, of the size; of amplitudes besides
#: the waves' own scatter, which is larger than a random field's; of skewness, excess and patchiness; relative and
#: absolute [degree] of slopes.
_AXES, _SIZE, _AMPLITUDE, _WAVES, _SKEW, _EXCESS, _PATCH = 0.01, 0.002, 0.1, 1.5, 0.1, 0.25, 0.06
_SLOPE, _DEGREES = 0.06, 0.3

#: Every mesh is turned before it is read, by angles of no meaning: rays that meet the vertices of a lattice alone would
#: not see that triangles between them lie deeper than what they stand for.
_TURN = Rotation.from_euler("xyz", [0.7, 1.3, 0.4]).as_matrix()


class Unreadable(ValueError):
    """A surface that has no radius in every direction; the text says why."""


class Signature(NamedTuple):
    """Numbers (k,) of a shape, with the name of the part that each belongs to, and the scatter (k,) of each.

    `radius` is that of the ball of the same volume, in the unit of the points.
    """

    values: Floats
    parts: tuple[str, ...]
    scatter: Floats
    radius: float


def signature(points: Array, triangles: Array, unit: float | None, lattice: int = FINE) -> Signature:
    """Return the signature of a closed mesh (v, 3), (f, 3); `unit` is the length of r1 in its unit, None: unknown.

    `lattice`: colatitudes of the rays.

    Raises:
        Unreadable: it encloses no volume, or is open, or does not lie around its middle.

    """
    from solver.geometry.reach import reach  # compiled: not before it is needed

    x = np.asarray(points, float)
    volume, centre, inertia = _moments(x, triangles)
    radius = (3 * volume / (4 * np.pi)) ** (1 / 3)
    r = _filled(reach((x - centre) @ _TURN / radius, triangles, lattice))
    parts: list[tuple[str, Floats, Floats]] = []
    if unit is not None:
        parts.append(("size", np.array([np.log(radius / unit)]), np.array([_SIZE])))
    axes = 0.5 * np.log(inertia[::-1])  # from the longest on
    parts.append(("outline", -np.diff(axes), np.full(2, _AXES)))
    parts += _wrinkles(r)
    values, scatter = (np.concatenate([part[k] for part in parts]) for k in (1, 2))
    names = tuple(name for name, found, _ in parts for _ in found)
    return Signature(values, names, scatter, float(radius))


def _moments(points: Floats, triangles: Array) -> tuple[float, Floats, Floats]:
    """Return volume, its centre (3,) and the principal second moments (3,) about it, ascending."""
    middle = points.mean(axis=0)
    a, b, c = (points[triangles[:, k]] - middle for k in range(3))
    six = np.einsum("fi,fi->f", a, np.cross(b, c))
    volume = six.sum() / 6
    extent = np.ptp(points, axis=0).max()
    if not abs(volume) > 1e-4 * extent**3:
        raise Unreadable("it encloses no volume")
    total = a + b + c
    centre = six @ total / (24 * volume)
    second = sum((six[:, None] * one).T @ one for one in (a, b, c, total)) / (120 * volume)
    moments = np.linalg.eigvalsh(second - np.outer(centre, centre))
    if not moments[0] > 0:
        raise Unreadable("its parts are turned inside out")
    return abs(float(volume)), middle + centre, moments


def _filled(r: Floats) -> Floats:
    """Return radii with small holes bridged along their row.

    Raises:
        Unreadable: there is more that meets nothing.

    """
    empty = r <= 0
    if not empty.any():
        return r
    if (empty * harmonics.area(len(r))).sum() > _HOLES or empty.all(axis=1).any():
        raise Unreadable("it is open, or does not lie around the middle of its volume")
    for row, gaps in zip(r, empty, strict=True):
        if gaps.any():
            known = np.flatnonzero(~gaps)
            row[gaps] = np.interp(np.flatnonzero(gaps), known, row[known], period=len(row))
    return r


def _wrinkles(r: Floats) -> list[tuple[str, Floats, Floats]]:
    area = np.broadcast_to(harmonics.area(len(r)), r.shape)
    waves = spectra.spectrum(r)
    power = harmonics.power(harmonics.degrees(waves))
    first, count = _bands(len(r))
    band = np.add.reduceat(power[: first[-1]], first[:-1])
    amplitude = 0.5 * np.log(np.maximum(band, 0) + _SMOOTH**2)
    field = spectra.synthesize(harmonics.without_low(waves), len(r))
    variance = (area * field**2).sum() + _SMOOTH**2
    skew = (area * field**3).sum() / variance**1.5
    excess = np.log((area * field**4).sum() / variance**2 + 1.0)
    slope = _slopes(r)
    order = np.argsort(slope.ravel())
    below = np.cumsum(area.ravel()[order])
    quantiles = np.interp(_QUANTILES, below, slope.ravel()[order])
    return [
        ("spectrum", amplitude, np.hypot(_WAVES * np.sqrt(0.5 / count), _AMPLITUDE)),
        ("form", np.array([skew, excess, _patchiness(field, area)]), np.array([_SKEW, _EXCESS, _PATCH])),
        ("slopes", np.log(quantiles + 1.0), _SLOPE + _DEGREES / (quantiles + 1.0)),
    ]


@lru_cache(maxsize=4)
def _bands(n: int) -> tuple[Array, Floats]:
    """Return the first degrees of the bands and one beyond the last, and how many waves each band has."""
    first = _BANDS[: np.searchsorted(_BANDS, 0.75 * n, "right")]
    return first, (first[1:] ** 2 - first[:-1] ** 2).astype(float)


def _slopes(r: Floats) -> Floats:
    """Return the angle [degree] between ray and normal (n, 2n)."""
    south, east = spectra.gradient(spectra.spectrum(np.log(r)), len(r))
    sine = np.sin((np.arange(len(r)) + 0.5) * np.pi / len(r))[:, None]
    found: Floats = np.degrees(np.arctan(np.hypot(south, east / sine)))
    return found


def _patchiness(field: Floats, area: Array) -> float:
    """Return by how much the wrinkles' strength varies over the surface: its low degrees over its mean."""
    energy = field**2
    middle = (area * energy).sum() + _SMOOTH**2
    low = harmonics.power(harmonics.degrees(spectra.spectrum(energy)))[1:7].sum()
    return float(np.log1p(np.sqrt(low) / middle))
