"""The seeded bumps that break the fresh fruit's symmetry.

A sum of plane waves restricted to the parametric unit sphere. It depends on the seed alone, not on thickness or
moduli, so that neighbours in parameter space start from the same bumps and their patterns can be compared.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["bumps"]

Array = NDArray[np.float64]

WAVES = 400
#: Wavenumbers on the unit sphere: from the coarsest buckles in use to those of a skin of 0.005.
LOWEST, HIGHEST = 5.0, 130.0


def bumps(directions: Array, generator: np.random.Generator, highest: float = HIGHEST) -> Array:
    """Return heights (n,) with magnitude at most about one at unit `directions` (n, 3).

    Waves shorter than wavenumber `highest` (what the mesh can carry) are left out; the rest do not depend on it.
    The draw is complete before anything is left out, so that every mesh sees the same long waves.
    """
    axes = generator.normal(size=(WAVES, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    wavenumber = np.exp(generator.uniform(np.log(LOWEST), np.log(HIGHEST), WAVES))
    phase = generator.uniform(0, 2 * np.pi, WAVES)
    keep = wavenumber <= highest
    vectors = (axes * wavenumber[:, None])[keep]
    total = np.zeros(len(directions))
    for start in range(0, len(directions), 4096):
        part = directions[start : start + 4096]
        # not `@`: BLAS rounds differently with another number of threads, and then every bit of the run would
        heights = np.einsum("ni,wi->nw", part, vectors)
        total[start : start + 4096] = np.cos(heights + phase[keep]).sum(axis=1)
    # a sum of many waves is Gaussian with variance WAVES / 2; its largest value over the sphere is about 4 sigma
    return total / (4 * np.sqrt(WAVES / 2))
