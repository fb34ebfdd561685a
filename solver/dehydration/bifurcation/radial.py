"""The onset of a sphere with a concentric stone: degree by degree, each a small one-dimensional problem."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigh, eigvalsh
from scipy.optimize import brentq
from scipy.special import eval_legendre

from ...contract import Context
from ..fresh.closed_form import flat_film_wavelength, onset_estimate
from ..params import DehydrationParams
from .radial_elements import RadialMesh, linear_tangents, radial_mesh, smooth, tangent
from .result import AxisymmetricMode, Method, Onset, Tie
from .search import Valley

__all__ = ["SEARCHED", "onset_radial", "short_wave_reason", "stable_reason"]


#: Largest shrinkage that is looked at, the end of the stage axis.
SEARCHED = 0.6
#: Shortest waves that are looked at, as (degree + 1/2) * thickness: shorter ones do not feel the skin's thickness.
_SHORTEST = 8.0
#: Between the degrees at which the first one found is checked against all others; s_cr(degree) is smooth on this scale.
_STRIDE = 1.3
_ORDERS = {"preview": 6, "default": 8, "fine": 10}


def stable_reason(searched: float) -> str:
    """Return the sentence that goes with an onset that was not found."""
    return f"does not buckle up to s = {searched:g}: the smooth shape stays stable (the skin is too soft or too thick)"


def short_wave_reason(thickness: float) -> str:
    """Return the sentence that goes with an onset at the shortest wave that was looked at."""
    return (
        "the shortest waves come first (Biot's surface instability, which creases): no degree is preferred, and the "
        f"one given is the finest that was looked at, about {_SHORTEST:g} / {thickness:g}"
    )


def _looked_at(highest: int) -> list[int]:
    """Return the degrees at which the first valley is checked, rising."""
    count = math.ceil(math.log(highest) / math.log(_STRIDE))
    return sorted({*range(1, 6), *np.geomspace(5, highest, count).round().astype(int).tolist()})


@dataclass(frozen=True, eq=False)
class _Sphere:
    """Degrees of one sphere, each of its own."""

    mesh: RadialMesh
    kappa_ratio: float | None
    check: Callable[[], None]

    def lowest(self, s: float, degree: int) -> float:
        """Return the lowest eigenvalue of the tangent at shrinkage s: 0 where the degree becomes unstable."""
        self.check()
        matrix = tangent(self.mesh, smooth(self.mesh, s, self.kappa_ratio), degree, self.kappa_ratio)
        return float(eigvalsh(matrix, subset_by_index=[0, 0])[0])

    def exact(self, degree: int, guess: float) -> float:
        """Return where the smooth state becomes unstable, infinite if nowhere."""
        below, above = 0.0, guess
        while self.lowest(above, degree) > 0:
            if above >= SEARCHED:
                return math.inf
            below, above = above, min(1.25 * above, SEARCHED)
        return float(brentq(self.lowest, below, above, args=(degree,), xtol=1e-13, rtol=1e-11))

    def linear(self, degree: int) -> float:
        """Return where it would do so if stress grew with shrinkage and nothing else changed."""
        self.check()
        stiff, stress = linear_tangents(self.mesh, degree, self.kappa_ratio)
        last = len(stiff) - 1
        largest = float(eigh(-stress, stiff, eigvals_only=True, subset_by_index=[last, last])[0])
        return 1 / largest if largest > 1e-6 else math.inf


def onset_radial(
    params: DehydrationParams,
    *,
    method: Method,
    kappa_ratio: float | None,
    quality: str = "default",
    context: Context | None = None,
) -> Onset:
    """Return the onset of concentric spheres, exact to about 1e-9 (incompressible or finite `kappa_ratio`)."""
    begin, context = time.perf_counter(), context or Context()
    thickness, gamma = params.exocarp_thickness, params.modulus_ratio
    mesh = radial_mesh(params.stone[0], thickness, gamma, _ORDERS[quality])
    highest = max(math.ceil(_SHORTEST / thickness), 8)

    sphere = _Sphere(mesh, kappa_ratio, context.check_cancelled)
    guess = min(1.05 * onset_estimate(gamma, params.stone[0]), SEARCHED)

    def value(degree: int) -> float:
        near = min(found.known.values(), default=math.inf)
        return sphere.exact(degree, near if math.isfinite(near) else guess) if exact else sphere.linear(degree)

    exact = method == "exact"
    found = Valley(value, 1, highest)
    wave = 2 * math.pi / flat_film_wavelength(thickness, gamma)
    best = found.descend(min(max(round(wave), 1), highest))
    # another valley of s_cr(degree) would show as a degree that is already unstable here
    degrees = _looked_at(highest)
    for degree in degrees:
        context.report(degrees.index(degree) / len(degrees), f"degree {degree}")
        at = found.known[best]
        limit = SEARCHED if math.isinf(at) else at * (1 - 1e-7)
        if (sphere.lowest(limit, degree) < 0) if exact else (sphere.linear(degree) < at):
            best = min(best, found.descend(degree), key=found.known.__getitem__)
    s_cr = found.known[best]
    settings = {"elements": len(mesh.core), "order": mesh.at.shape[1] - 1, "unknowns": 2 * len(mesh.position) - 2}
    common: dict[str, Any] = {"path": "radial", "method": method, "kappa_ratio": kappa_ratio, "settings": settings}
    if math.isinf(s_cr) or s_cr > SEARCHED:
        seconds = time.perf_counter() - begin
        return Onset(None, None, None, mode=None, seconds=seconds, reason=stable_reason(SEARCHED), **common)
    found.fill(range(best - 3, best + 4))
    ties = [Tie(s, degree, 0) for degree, s in found.known.items() if degree != best and s < 1.05 * s_cr]
    reason = short_wave_reason(thickness) if best >= highest - 1 else ""
    colatitude = np.linspace(0, np.pi, max(181, 8 * best + 1))
    mode = AxisymmetricMode(colatitude, eval_legendre(best, np.cos(colatitude)), 0)
    ordered = tuple(sorted(ties, key=lambda tie: tie.s_cr)[:6])
    seconds = time.perf_counter() - begin
    return Onset(s_cr, best, 0, mode=mode, ties=ordered, seconds=seconds, reason=reason, **common)
