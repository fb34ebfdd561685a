"""What a quality means: mesh, compressibility, pace and residual, chosen from the parameters."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..contract import Cost, Need
from .closed_form import flat_film_wavelength, onset_estimate
from .mesh import layer_fractions
from .params import DehydrationParams

__all__ = ["Settings", "choose", "expected_cost"]


@dataclass(frozen=True)
class Settings:
    """Everything numerical about a run; follows from parameters and quality alone, so that results are repeatable.

    n: elements per edge of the cubed sphere. core: fractions of the core's layer breakpoints. kappa_ratio: bulk over
    shear modulus. pace: shrinkage per step of the march. damping: per step, while marching, while
    settling, and while settling skin that touches (less lets contacts chatter).
    residual, drift: at which a stage counts as settled (see `path.State`). settle_steps: after which it does not.
    clearance: gap that self-contact keeps, in exocarp thicknesses.
    start: shrinkage below which the fruit is still smooth, where the march begins.
    """

    n: int
    core: NDArray[np.float64]
    kappa_ratio: float
    pace: float
    damping: float
    settle_damping: float
    touching_damping: float
    residual: float
    drift: float
    settle_steps: int
    start: float
    clearance: float = 0.1

    @property
    def elements(self) -> int:
        """Number of hexahedra."""
        return 6 * self.n**2 * (len(self.core) + 1)


@dataclass(frozen=True)
class _Quality:
    per_wavelength: float
    fewest: int
    most: int
    kappa_ratio: float
    residual: float
    drift: float


_QUALITIES = {
    "preview": _Quality(4.2, 18, 48, 30.0, 5e-3, 2e-2),
    "default": _Quality(6.0, 24, 96, 100.0, 2e-3, 1e-2),
    "fine": _Quality(9.0, 36, 160, 100.0, 1e-3, 5e-3),
}

#: Steps from s = 0 to 0.3 that follow the quasi-static path at n = 24, kappa / mu = 30 (twice as many change the
#: roughness by 1 % up to s = 0.17). More elements and a stiffer
#: volume shorten the critical step, so their product with the step must be kept.
_STEPS, _STEPS_N, _STEPS_KAPPA, _STEPS_SPAN = 16000.0, 24, 30.0, 0.3
#: Damping per step at the same reference: low enough not to delay the onset.
_DAMPING = 0.004
#: Thickness of the core layer at the interface, in wavelengths, and how fast layers grow inwards.
_FIRST_LAYER, _GROWTH = 0.08, 1.3
#: Wall seconds per element and step on one core, for estimates only.
_SECONDS_PER_ELEMENT_STEP = 5e-8


def choose(params: DehydrationParams, quality: str) -> Settings:
    """Return the settings of `quality` (preview, default, fine) for `params`.

    The mesh resolves the expected wrinkle wavelength by a fixed number of elements, within the quality's bounds.
    """
    q = _QUALITIES[quality]
    wavelength = flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio)
    n = math.ceil(np.pi / 2 * q.per_wavelength / wavelength)
    n = min(max(n, q.fewest), q.most)
    flesh = float(np.mean(params.radii[:7])) - max(params.stone)
    core = layer_fractions(max(flesh, 0.05), _FIRST_LAYER * min(wavelength, 0.4), _GROWTH)
    scale = (n / _STEPS_N) * math.sqrt(q.kappa_ratio / _STEPS_KAPPA)
    margin = 0.75 if params.is_sphere else 0.5
    onset = onset_estimate(params.modulus_ratio, min(params.stone))
    return Settings(
        n=n,
        core=core,
        kappa_ratio=q.kappa_ratio,
        pace=_STEPS_SPAN / (_STEPS * scale),
        damping=_DAMPING / scale,
        settle_damping=0.02,
        touching_damping=0.1,
        residual=q.residual,
        drift=q.drift,
        settle_steps=4000,
        start=margin * onset,
    )


def expected_cost(params: DehydrationParams, need: Need) -> Cost:
    """Return expected wall seconds on this machine's cores and bytes of memory."""
    settings = choose(params, need.quality)
    last = max(need.stages, default=0.0)
    steps = max(last - settings.start, 0.0) / settings.pace + 1500 * len(need.stages)
    seconds = steps * settings.elements * _SECONDS_PER_ELEMENT_STEP / (os.cpu_count() or 1)
    return Cost(seconds, settings.elements * 1200 + 150_000_000)
