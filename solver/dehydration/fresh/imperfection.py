"""The bumps that break the fresh fruit's symmetry: seeded random waves, or the first buckling mode.

Random bumps are a sum of plane waves restricted to the parametric unit sphere. It depends on the seed alone, not on
thickness or moduli, so that neighbours in parameter space start from the same bumps and their patterns can be compared.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...contract import Cancelled, Context, InvalidInput
from ..params import DehydrationParams

__all__ = ["bumps", "heights"]


WAVES = 400
#: Wavenumbers on the unit sphere: from the coarsest buckles in use to those of a skin of 0.005.
LOWEST, HIGHEST = 5.0, 130.0


def heights(params: DehydrationParams, directions: Floats, context: Context, highest: float = HIGHEST) -> Floats:
    """Return the heights (n,) of `params.imperfection_kind` at unit `directions` (n, 3), magnitude about one at most.

    "waves": see `bumps`. "mode": the first buckling mode (Liu et al. 2014, Eq. 11), as it is, or the first that has the
    mirrors' symmetry; no seed enters.

    Raises:
        InvalidInput: the mode was asked for and the fruit does not buckle, or its drying is not homogeneous.
        NotConverged: the mode was not found.
        Cancelled: the observer asked to stop.

    """
    if params.imperfection_kind == "waves":
        return bumps(directions, context.generator(params.seed), highest)
    if not params.dries_evenly:
        raise InvalidInput(
            "buckling modes are known for homogeneous, isotropic drying only.",
            advice='Leave out wetness, anisotropy and light, or set imperfection_kind to "waves".',
        )
    # eigenproblems: nothing that waves should pay for
    from ..bifurcation import onset
    from ..bifurcation.mirrored import mirrored_mode

    def stop() -> bool:
        try:
            context.check_cancelled()
        except Cancelled:
            return True
        return False

    # its progress is not the run's
    quiet = Context(cancelled=stop)
    if params.mirrors:
        return mirrored_mode(params, context=quiet)(directions)
    found = onset(params, quality="preview", context=quiet)
    if found.mode is None:
        raise InvalidInput(
            f"there is no buckling mode to start from: {found.reason or 'the smooth shape stays stable'}.",
            advice='Set imperfection_kind to "waves".',
        )
    return found.mode(directions)


def bumps(directions: Floats, generator: np.random.Generator, highest: float = HIGHEST) -> Floats:
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
    found: Floats = total / (4 * np.sqrt(WAVES / 2))
    return found
