"""The onset of any fruit, elliptic equators too: triquadratic elements between the symmetry planes, all parities.

Cost: three-dimensional. The part of the fruit between its planes is solved twice per look (two smooth states), then
each parity costs two factorisations and some eighty solves; unknowns grow with 1 / thickness^2.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from scipy.special import sph_harm_y

from ...arrays import Floats
from ...contract import Context, NotConverged
from ...fem import HEX27
from ..fresh.closed_form import flat_film_wavelength, onset_estimate
from ..fresh.mesh import layer_fractions
from ..implicit import Equilibrium, Model, build_model, build_quadratic_mesh, equilibrium, natural_symmetry
from ..implicit.buckling import Crossing, first_crossing, fresh_metric, parities, stress_stiffness, tangent_at
from ..implicit.location import fold, locate
from ..params import DehydrationParams
from .result import FieldMode, Method, Onset, Tie

__all__ = ["crossings", "onset_full"]


#: Quadratic elements per wrinkle of the flat film on a unit sphere: s_cr of the sphere with te = 0.04 and gamma = 10
#: comes out 3.4, 2.1 and 1.3 % high with 1.5, 2 and 2.5 of them, incompressible.
PER_WAVELENGTH = {"preview": 1.5, "default": 2.5, "fine": 3.5}
#: The linear method's first modes are shorter (degree 23 instead of 14 on that sphere): it needs this many times more.
LINEAR_FINER = 2.0
#: Core layer at the interface in wavelengths, and how fast layers grow inwards.
FIRST_LAYER, LAYER_GROWTH = 0.17, 1.8
#: Bulk over shear modulus that stands for incompressible; s_cr is off by about 2e-5, relative.
PENALTY = 1e5
#: Largest shrinkage that is looked at.
SEARCHED = 0.6
#: Fractions of the expected onset through whose lowest stiffnesses a line is drawn: a first look, then a close one.
LOOKS = ((0.80, 0.86), (0.96, 0.985))
#: Parities whose first look is this close to the best are looked at closely.
RIVALS = 1.03
#: Shrinkage of the small state whose stress the linear method scales.
SMALL = 1e-4


def onset_full(
    params: DehydrationParams,
    *,
    method: Method,
    kappa_ratio: float | None,
    quality: str = "default",
    context: Context | None = None,
) -> Onset:
    """Return the onset of any fruit.

    method: "exact" is the first singular tangent on the shrunk state, "linear" Liu et al. 2014, Eq. 11. quality:
    preview, default or fine (elements per wrinkle).

    Raises:
        NotConverged: no smooth state could be reached below the onset.
        Cancelled: by the context.

    """
    begin = time.perf_counter()
    model, found = crossings(params, method=method, kappa_ratio=kappa_ratio, quality=quality, context=context)
    settings = {"n": len(model.mesh.quad_of[0]), "layers": model.mesh.layers, "unknowns": int(model.free.sum())}
    if not found:
        return Onset(
            None, None, None, "full", method, kappa_ratio, None, seconds=time.perf_counter() - begin, settings=settings,
            searched=SEARCHED, reason=f"the smooth shape stays stable up to s = {SEARCHED:g}",
        )  # fmt: skip
    modes = []
    for crossing in found:
        heights = _heights(params, model, crossing)
        degree, wavenumber = _dominant(heights, 2 * len(model.mesh.quad_of[0]) * 2)
        modes.append((crossing.shrinkage, degree, wavenumber, heights))
    s_cr, degree, wavenumber, heights = modes[0]
    return Onset(
        s_cr, degree, wavenumber, "full", method, kappa_ratio, FieldMode(heights),
        ties=tuple(Tie(s, d, m) for s, d, m, _ in modes[1:]), seconds=time.perf_counter() - begin,
        searched=SEARCHED, settings=settings,
    )  # fmt: skip


def crossings(
    params: DehydrationParams, *, method: Method = "exact", kappa_ratio: float | None = None,
    quality: str = "default", context: Context | None = None,
) -> tuple[Model, list[Crossing]]:  # fmt: skip
    """Return the mesh's model and each parity's first singular tangent up to `SEARCHED`, sorted; none where smooth.

    The part of `onset_full` that costs no search for the modes' degrees. Raises what it raises.
    """
    context = context or Context()
    model = _model(params, kappa_ratio, PER_WAVELENGTH[quality] * (LINEAR_FINER if method == "linear" else 1.0))
    return model, _exact(params, model, context) if method == "exact" else _linear(model, context)


def _model(params: DehydrationParams, kappa_ratio: float | None, per_wavelength: float) -> Model:
    wavelength = flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio)
    n = 2 * math.ceil(np.pi / 4 * per_wavelength / wavelength)
    flesh = max(float(np.mean(params.radii[:7])) - max(params.stone), 0.05)
    core = layer_fractions(flesh, FIRST_LAYER * min(wavelength, 0.4), LAYER_GROWTH)
    mesh = build_quadratic_mesh(params, max(n, 4), core, natural_symmetry(params))
    return build_model(params, mesh, kappa_ratio or PENALTY)


def _linear(model: Model, context: Context) -> list[Crossing]:
    """All parities' first singular K0 + s K_sigma, sorted."""
    fresh = equilibrium(model, 0.0, context=context)
    small = equilibrium(model, SMALL, tolerance=1e-7, context=context)
    base, slope = tangent_at(model, fresh), stress_stiffness(model, small) / SMALL
    return _sorted(_all(model, base, slope, 0.0, context))


def _exact(params: DehydrationParams, model: Model, context: Context) -> list[Crossing]:
    expected = min(onset_estimate(params.modulus_ratio, min(params.stone)), SEARCHED)
    at: Equilibrium | None = None
    metric = fresh_metric(model)
    wanted: dict[tuple[int, ...], Floats | None] = {parity: None for parity, _ in parities(model)}
    known: list[Crossing] = []
    for _ in range(8):
        low, high = (expected * fraction for fraction in (LOOKS[-1] if known else LOOKS[0]))
        ahead = at is not None and at.shrinkage <= low
        first = equilibrium(model, low, start=at if ahead else None, context=context)
        at = equilibrium(model, high, start=first, context=context)
        try:
            found = _softened(model, first, at, metric, context, wanted)
        except _AlreadyUnstable:
            expected, at, known = 0.8 * low, None, []
            wanted = {parity: None for parity, _ in parities(model)}
            continue
        best = min((crossing.shrinkage for crossing in found), default=np.inf)
        if best > SEARCHED:
            return []
        if known and abs(best / expected - 1) < 0.03:
            return _sorted(found)
        expected, known = best, found
        wanted = {c.parity: c.mode for c in found if c.shrinkage < RIVALS * best}
    raise NotConverged(
        "the onset was not bracketed.", advice="Ask for a finer quality.", last_stage=at.shrinkage if at else None
    )


class _AlreadyUnstable(Exception):
    """The smooth state below the expected onset has a falling direction."""


def _softened(
    model: Model, first: Equilibrium, second: Equilibrium, metric: Floats, context: Context,
    wanted: dict[tuple[int, ...], Floats | None],
) -> list[Crossing]:  # fmt: skip
    """Where each wanted parity's lowest stiffness, known at two states, falls to zero.

    A line through the two stiffnesses, not through the two tangents: those hold kappa B^T B with B linear in s, and a
    line through that is too low by kappa (s - low) (s - high) |B' v|^2 beyond both, which ends in false crossings.
    """
    lows = _all(model, tangent_at(model, first), -metric, 0.0, context, wanted)
    begun: dict[tuple[int, ...], Floats | None] = {c.parity: c.mode for c in lows}
    highs = {c.parity: c for c in _all(model, tangent_at(model, second), -metric, 0.0, context, begun)}
    found = []
    for low in lows:
        high = highs.get(low.parity)
        if high is None or high.shrinkage >= low.shrinkage:
            continue
        slope = (low.shrinkage - high.shrinkage) / (second.shrinkage - first.shrinkage)
        found.append(Crossing(second.shrinkage + high.shrinkage / slope, high.mode, high.parity))
    return found


def _all(
    model: Model, base: Floats, slope: Floats, start: float, context: Context,
    wanted: dict[tuple[int, ...], Floats | None] | None = None,
) -> list[Crossing]:  # fmt: skip
    found = []
    for number, (parity, free) in enumerate(parities(model)):
        if wanted is not None and parity not in wanted:
            continue
        context.check_cancelled()
        context.report(number / 2 ** len(parity), f"parity {parity}")
        factor = model.factor(base, free, context.check_cancelled)
        if factor.negative:
            raise _AlreadyUnstable
        guess = (wanted or {}).get(parity)
        crossing = first_crossing(model, base, slope, start, parity, free, factor, guess, context.check_cancelled)
        if crossing is not None:
            found.append(crossing)
    return found


def _sorted(found: list[Crossing]) -> list[Crossing]:
    return sorted((c for c in found if c.shrinkage <= SEARCHED), key=lambda c: c.shrinkage)


def _heights(params: DehydrationParams, model: Model, crossing: Crossing) -> Callable[[Floats], Floats]:
    """The mode's height along the outward normal as a function of parametric directions, largest magnitude 1."""
    mesh = model.mesh
    nodal = np.zeros_like(mesh.positions)
    nodal[model.pattern.free >= 0] = crossing.mode

    def raw(towards: Floats) -> Floats:
        colatitude, azimuth = np.arccos(np.clip(towards[:, 1], -1, 1)), np.arctan2(towards[:, 2], towards[:, 0])
        points = params.surface(colatitude, azimuth)
        folded, signs = fold(mesh, points)
        element, local = locate(params, mesh, folded)
        moved = signs * np.einsum("pa,pai->pi", HEX27.shape(local), nodal[mesh.connectivity[element]])
        for axis, parity in zip(mesh.planes, crossing.parity, strict=True):
            if parity < 0:
                moved *= signs[:, axis : axis + 1]
        step = 1e-5
        # one-sided where the pole is nearer than the step; the azimuthal tangent vanishes there, so go a little off it
        inner = np.clip(colatitude, 1e-3, np.pi - 1e-3)
        along = params.surface(inner + step, azimuth) - params.surface(inner - step, azimuth)
        around = params.surface(inner, azimuth + step) - params.surface(inner, azimuth - step)
        normal = np.cross(around, along)
        normal *= np.sign(np.einsum("pi,pi->p", normal, points) / np.linalg.norm(normal, axis=1))[:, None]
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        found: Floats = np.einsum("pi,pi->p", moved, normal)
        return found

    theta, phi = np.meshgrid(np.linspace(0.01, np.pi - 0.01, 181), np.linspace(0, np.pi, 181), indexing="ij")
    sample = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    values = raw(sample.reshape(-1, 3))
    scale = values[np.argmax(np.abs(values))]
    return lambda towards: raw(np.asarray(towards, dtype=float)) / scale


def _dominant(heights: Callable[[Floats], Floats], highest: int) -> tuple[int, int]:
    """Spherical-harmonic degree and azimuthal wavenumber that carry most of the mode's mean square."""
    nodes, weights = np.polynomial.legendre.leggauss(highest + 8)
    colatitude = np.arccos(nodes)
    azimuth = np.arange(2 * highest + 2) * np.pi / (highest + 1)
    theta, phi = np.meshgrid(colatitude, azimuth, indexing="ij")
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)
    waves = np.fft.rfft(heights(points.reshape(-1, 3)).reshape(theta.shape), axis=1)[:, : highest + 1]
    power = np.zeros((highest + 1, highest + 1))
    for m in range(highest + 1):
        degrees = np.arange(m, highest + 1)
        harmonics = sph_harm_y(degrees[:, None], m, colatitude[None, :], 0.0).real
        power[m:, m] = np.abs((harmonics * weights) @ waves[:, m]) ** 2 * (1 if m == 0 else 2)
    return int(power.sum(axis=1).argmax()), int(power.sum(axis=0).argmax())
