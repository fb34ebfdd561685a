"""Smooth random fields that belong to the place, not to the mesh: nutrients (uneven) and motility (Eq. 5).

A sum of plane waves in space, as many as make it nearly Gaussian, evaluated where a mesh has its points and mapped to
an even distribution. Two meshes of one fruit see the same field; noise per vertex would depend on the mesh.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from ...arrays import Floats

__all__ = ["patches"]


_WAVES = 64


def patches(points: Floats, size: float, generator: np.random.Generator) -> Floats:
    """Return values in (-1, 1), evenly distributed, at points (v, 3), correlated over `size` (same unit)."""
    waves = generator.normal(size=(_WAVES, 3)) / size
    phases = generator.uniform(0, 2 * np.pi, _WAVES)
    total = np.zeros(len(points))
    for wave, phase in zip(waves, phases, strict=True):
        # no matrix product: BLAS sums by threads, and the field must not depend on their number
        total += np.cos(points[:, 0] * wave[0] + points[:, 1] * wave[1] + points[:, 2] * wave[2] + phase)
    found: Floats = 2 * ndtr(total * np.sqrt(2 / _WAVES)) - 1
    return found
