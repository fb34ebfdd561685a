"""What a wrinkled surface is like, in a handful of numbers that converge where the pattern itself is chaotic."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...arrays import Floats
from ...fruit import Fruit, lattice
from ..fresh.mesh import FruitMesh, Sampler
from .harmonics import analyse, power, quadrature, remove_low

__all__ = ["Descriptors", "Surface"]


#: Degrees below this are the shape of the fruit (size, shift, ellipticity), not wrinkles.
LOWEST_DEGREE = 3
#: Lattice and degree of the analysis; buckles of a skin of 0.005 have degree 100.
RESOLUTION, DEGREE = 128, 120
#: Amplitude below which a surface counts as smooth: no degree, wavelength or buckle is read from noise.
SMOOTH = 1e-5
#: Share of the rms below which a place lies in a buckle, and the least depth of one [te]: bumps of a fruit that has not
#: buckled are a hundredth of its skin.
LOW, _SHALLOW = -0.5, 0.1


class Descriptors(NamedTuple):
    """One stage's numbers; units as in `solver.quantities`."""

    mean_radius: float
    volume: float
    roughness: float
    dominant_degree: float
    wavelength: float
    buckle_count: int
    ridge_anisotropy: float


class Surface:
    """Reads descriptors and lattice fields from the nodes of a mesh's outer surface."""

    def __init__(self, fruit: Fruit, mesh: FruitMesh) -> None:
        self._mesh = mesh
        self._sampler = Sampler(mesh.sphere, RESOLUTION)
        theta, phi = lattice(RESOLUTION)
        self._fresh = fruit.surface(theta, phi)
        self._ray = self._fresh / np.linalg.norm(self._fresh, axis=-1, keepdims=True)
        self._shallow = -_SHALLOW * fruit.exocarp_thickness
        self._fresh_nodes = mesh.positions[mesh.surface_nodes]
        self._weight = np.repeat(quadrature(RESOLUTION)[:, None], 2 * RESOLUTION, axis=1)
        along = np.linalg.norm(np.gradient(self._fresh, np.pi / RESOLUTION, axis=0), axis=-1)
        around = np.linalg.norm(_around(self._fresh), axis=-1)
        self._metric = along, around
        self._area = along * around

    def describe(self, nodes: Floats) -> Descriptors:
        """Return the descriptors of the deformed surface nodes (nc, 3), units of r1."""
        shift = self._sampler(nodes - self._fresh_nodes)
        position = self._fresh + shift
        area = self._area / self._area.sum()
        mean_radius = float((area * np.linalg.norm(position, axis=-1)).sum())
        radial = self._along_rays(shift)
        wrinkles = remove_low(radial, LOWEST_DEGREE)
        spectrum = _spectrum(radial)
        roughness = float(np.sqrt(spectrum.sum()))
        volume = self._volume(nodes)
        if roughness < SMOOTH:
            return Descriptors(mean_radius, volume, roughness, 0.0, 0.0, 0, 0.0)
        degrees = np.arange(LOWEST_DEGREE, DEGREE + 1)
        degree = float((degrees * spectrum).sum() / spectrum.sum())
        wavelength = 2 * np.pi * mean_radius / np.sqrt(degree * (degree + 1))
        return Descriptors(
            mean_radius,
            volume,
            roughness,
            degree,
            float(wavelength),
            _valleys(wrinkles, min(LOW * roughness, self._shallow)),
            self._anisotropy(wrinkles),
        )

    def roughness(self, nodes: Floats) -> float:
        """Return the roughness of the deformed surface nodes (nc, 3) alone, units of r1."""
        radial = self._along_rays(self._sampler(nodes - self._fresh_nodes))
        return float(np.sqrt(_spectrum(radial).sum()))

    def _along_rays(self, shift: Floats) -> Floats:
        radial: Floats = np.einsum("tpi,tpi->tp", shift, self._ray)
        return radial

    def _volume(self, nodes: Floats) -> float:
        corners = nodes[self._mesh.sphere.quads]
        # a bilinear quad's flux is that of the mean of its two triangulations
        a, b, c, d = np.moveaxis(corners, 1, 0)
        flux = sum(np.einsum("qi,qi->q", p, np.cross(q, r)) for p, q, r in ((a, b, c), (a, c, d), (a, b, d), (b, c, d)))
        return float(np.sum(flux) / 12)

    def _anisotropy(self, wrinkles: Floats) -> float:
        along, around = self._metric
        slope_along = np.gradient(wrinkles, np.pi / RESOLUTION, axis=0) / along
        slope_around = _around(wrinkles) / around
        weight = self._area.copy()
        weight[: RESOLUTION // 16] = weight[-RESOLUTION // 16 :] = 0  # directions lose their meaning at the poles
        a = float((weight * slope_along**2).sum())
        b = float((weight * slope_around**2).sum())
        return (b - a) / (b + a)


def _spectrum(radial: Floats) -> Floats:
    """Return the power of a field on the lattice by degree, from that of wrinkles on."""
    return power(analyse(radial, DEGREE))[LOWEST_DEGREE:]


def _valleys(wrinkles: Floats, level: float) -> int:
    """Count the connected regions of a field on the lattice (n, 2n) that lie below `level`.

    Lattice points hang together along meridians and circles, and across a pole with the point opposite.
    """
    n = len(wrinkles)
    place = np.arange(wrinkles.size).reshape(wrinkles.shape)
    opposite = np.roll(place, n, axis=1)
    tails = np.concatenate([place.ravel(), place[:-1].ravel(), place[0], place[-1]])
    heads = np.concatenate([np.roll(place, -1, axis=1).ravel(), place[1:].ravel(), opposite[0], opposite[-1]])
    low = wrinkles.ravel() < level
    kept = low[tails] & low[heads]
    graph = coo_array((np.ones(kept.sum()), (tails[kept], heads[kept])), (wrinkles.size, wrinkles.size))
    alone = int(np.count_nonzero(~low))
    return int(connected_components(graph, directed=False)[0]) - alone


def _around(field: Floats) -> Floats:
    """Return the derivative along the periodic azimuth (axis 1)."""
    step = np.pi / RESOLUTION
    return (np.roll(field, -1, axis=1) - np.roll(field, 1, axis=1)) / (2 * step)
