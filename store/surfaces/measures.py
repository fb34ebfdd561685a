"""How alike two wrinkled surfaces are, in numbers that mean something where the pattern itself is chaotic.

Pointwise error alone rewards flatness: a smooth sphere beats another true sample. So the first four measures ask
whether a surface looks like the truth, and the last three whether it is the truth, point by point.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from solver.arrays import Array

from . import harmonics, spectra, surface

__all__ = ["OF", "UNITS", "Measures", "Surface", "compare", "lattice_for", "mean"]


#: Coarsest lattice on which shapes are compared.
_LATTICE = 64
#: Bands per doubling of the degree, for the error of band powers.
_PER_OCTAVE = 3
#: Bands with less than this share of the truth's power are noise to both.
_LEAST = 1e-3
#: Width [radian] of the window in which local slope energy is averaged.
_WINDOW = 0.35
#: Amplitude [r1] below which a surface counts as smooth: ratios of nothing to nothing are 1.
_SMOOTH = 1e-4


def lattice_for(band: int) -> int:
    """Return the lattice on which shapes with waves up to `band` are compared: one that holds them all.

    On a coarser one what is finest is no more there to be wrong, and slopes are those of a wave with a few points.
    """
    return max(_LATTICE, band)


class Measures(NamedTuple):
    """An approximation against the truth; a perfect one has 1, 0, 0, 0, 0, 0, 1.

    `rgh` is rms radial roughness (degrees 3 and above), approximate over true; `dB` the rms log-ratio of its band
    powers; `W1` [degree] the distance between the distributions of the surface's slope against the ray; `patch` the
    distance between the variation of local slope energy over the surface (standard deviation over mean); `L2nr` the
    relative L2 error of the displacement without its mean radial part; `ang` [degree] the mean angle between normals;
    `corr` the correlation of the radial wrinkles.
    """

    rgh: float
    dB: float
    W1: float
    patch: float
    L2nr: float
    ang: float
    corr: float


#: What the measures are of, for people.
OF = dict(
    zip(
        Measures._fields,
        ("roughness", "band powers", "slopes", "patchiness", "displacement", "normals", "correlation"),
        strict=True,
    )
)
UNITS = {"rgh": "1", "dB": "dB", "W1": "degree", "patch": "1", "L2nr": "1", "ang": "degree", "corr": "1"}


class Surface:
    """What the measures need of one surface, read once from fresh positions and displacement (n, 2n, 3) [r1]."""

    def __init__(self, fresh: Array, displacement: Array) -> None:
        n = len(fresh)
        self.area = np.broadcast_to(harmonics.area(n), (n, 2 * n))
        rays = fresh / np.linalg.norm(fresh, axis=-1, keepdims=True)
        u = np.asarray(displacement, float)
        radial = np.einsum("tpi,tpi->tp", u, rays)
        waves = spectra.spectrum(radial)
        self.rest = u - (self.area * radial).sum() * rays
        self.wrinkles = spectra.synthesize(harmonics.without_low(waves), n)
        self.power = harmonics.power(harmonics.degrees(waves))[: n + 1]
        self.power[: harmonics.LOWEST] = 0
        self.normals = surface.normals(np.asarray(fresh, float) + u)
        cosine = np.clip(np.einsum("tpi,tpi->tp", self.normals, rays), -1, 1)
        self.slope = np.degrees(np.arccos(cosine))
        self.patchiness = _patchiness(np.radians(self.slope) ** 2, self.area)


def compare(found: Surface, truth: Surface) -> Measures:
    """Measure one surface against the truth on the same lattice."""
    area = truth.area
    power, right = found.power.sum(), truth.power.sum()
    least = _SMOOTH**2
    dot = (area * found.wrinkles * truth.wrinkles).sum()
    cosine = np.clip(np.einsum("tpi,tpi->tp", found.normals, truth.normals), -1, 1)
    off = (area[..., None] * (found.rest - truth.rest) ** 2).sum()
    return Measures(
        rgh=float(np.sqrt((power + least) / (right + least))),
        dB=_bands(found.power, truth.power),
        W1=_transport(found.slope, truth.slope, area),
        patch=abs(found.patchiness - truth.patchiness),
        L2nr=float(np.sqrt(off / ((area[..., None] * truth.rest**2).sum() + least))),
        ang=float(np.degrees((area * np.arccos(cosine)).sum())),
        corr=float((dot + least) / (np.sqrt(power * right) + least)),
    )


def mean(rows: Iterable[Measures]) -> Measures:
    """Return the mean of several comparisons."""
    return Measures(*(float(value) for value in np.mean(list(rows), axis=0)))


def _bands(found: Array, truth: Array) -> float:
    edges = harmonics.LOWEST * 2 ** (np.arange(20) / _PER_OCTAVE)
    first = np.unique(np.ceil(edges[edges < len(truth)]).astype(int))
    a, b = np.add.reduceat(found, first), np.add.reduceat(truth, first)
    total = b.sum()
    if total < _SMOOTH**2:
        return 0.0
    kept = b > _LEAST * total
    # a band that is missing altogether counts as 30 dB, not as infinitely many
    ratio = 10 * np.log10(np.maximum(a[kept], 1e-3 * b[kept]) / b[kept])
    return float(np.sqrt((ratio**2).mean()))


def _transport(found: Array, truth: Array, area: Array) -> float:
    """Return the mean horizontal distance between the two distribution functions."""
    shares = (np.arange(512) + 0.5) / 512
    return float(np.abs(_quantiles(found, area, shares) - _quantiles(truth, area, shares)).mean())


def _quantiles(field: Array, area: Array, shares: Array) -> Array:
    values, weights = field.ravel(), area.ravel()
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weights[order])
    return np.interp(shares, (below - weights[order] / 2) / below[-1], values[order])


def _patchiness(energy: Array, area: Array) -> float:
    """Return the area-weighted variation coefficient of the locally averaged slope energy."""
    local = _smooth(energy * area) / _smooth(area.copy())
    middle = (area * local).sum()
    if middle < 1e-10:
        return 0.0
    return float(np.sqrt((area * (local - middle) ** 2).sum()) / middle)


def _smooth(field: Array) -> Array:
    """Average over a window of one width on the sphere: fixed in colatitude, widening in azimuth towards the poles."""
    from scipy import ndimage  # no look-up needs it

    n = len(field)
    doubled = np.concatenate([field, np.roll(field[::-1], n, axis=1)])
    cells = _WINDOW * n / np.pi
    along = ndimage.gaussian_filter1d(doubled, cells, axis=0, mode="wrap")[:n]
    waves = np.arange(n + 1)
    widths = _WINDOW / np.sin((np.arange(n) + 0.5) * np.pi / n)[:, None]
    return np.fft.irfft(np.fft.rfft(along, axis=1) * np.exp(-((waves * widths) ** 2) / 2), 2 * n, axis=1)
