"""The onset of an axisymmetric fruit: one azimuthal wavenumber at a time on the meridional mesh.

A coarse mesh scans the wavenumbers and finds the shrinkage roughly; the mesh of the asked quality then decides between
the wavenumbers that are left, close to the onset.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...contract import Context, NotConverged
from ..fresh.closed_form import flat_film_wavelength, onset_estimate
from ..params import DehydrationParams
from .base import BaseState, Meridian
from .meridional_mesh import PER_WAVELENGTH
from .pencil import Critical, Pencil, Perturbations, UnstableStart
from .radial import SEARCHED, stable_reason
from .result import AxisymmetricMode, Method, Onset, Tie, dominant_degree
from .search import Valley

__all__ = ["onset_meridional"]


#: Elements per flat-film wavelength of the scanning mesh.
_SCAN = 3.0
#: The scan's window is wide enough already where its end lies less than this beyond the onset it finds.
_REACH = 1.12
_TRIES = 25
#: Valleys of the scan within this fraction above its lowest are looked at on the finer mesh.
_CLOSE = 0.02
#: Modes within this fraction above the first one are called ties.
_TIED = 0.05


def onset_meridional(
    params: DehydrationParams,
    *,
    method: Method,
    kappa_ratio: float | None,
    quality: str = "default",
    per_wavelength: float | None = None,
    context: Context | None = None,
) -> Onset:
    """Return the onset of an axisymmetric fruit. `per_wavelength` overrides the elements that `quality` stands for.

    Raises:
        NotConverged: the smooth state or the modes were not found.

    """
    begin, context = time.perf_counter(), context or Context()
    fine = per_wavelength or PER_WAVELENGTH[quality]
    wave = 2 * math.pi / min(flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio), 1.0)
    widest = float(params.generatrix(np.linspace(0, np.pi, 181))[0].max())
    highest = math.ceil(1.3 * wave * widest) + 4
    # runs start from modes of quality preview: whose bytes change, that is another version of the solver
    turns = quality == "preview"
    scan = Perturbations(Meridian(params, min(_SCAN, fine), kappa_ratio), turns)
    coarse = sorted({0, 1, 2, 3, *np.linspace(3, highest, 10).round().astype(int).tolist()})
    rough = _rough(scan, coarse, method, onset_estimate(params.modulus_ratio, min(params.stone)), context)
    settings: dict[str, Any] = {"per_wavelength": fine, "kappa_ratio_used": scan.meridian.bulk}
    common: dict[str, Any] = {"path": "meridional", "method": method, "kappa_ratio": kappa_ratio}
    least = min(rough.values(), default=math.inf)
    if least > SEARCHED:
        seconds = time.perf_counter() - begin
        return Onset(None, None, None, mode=None, seconds=seconds, reason=stable_reason(SEARCHED), **common)
    space = Perturbations(Meridian(params, fine, kappa_ratio), turns)
    valleys = [m for i, m in enumerate(coarse) if rough[m] <= min(rough[n] for n in coarse[max(i - 1, 0) : i + 2])]
    starts = sorted((m for m in valleys if rough[m] < (1 + _CLOSE) * least), key=rough.__getitem__)[:3]
    modes = _decide(space, starts, (coarse[-1] - coarse[-2]) // 2, least, highest, method, context)
    ranked = sorted(((mode.s, m, mode) for m, found in modes.items() for mode in found), key=lambda item: item[:2])
    top = math.ceil(1.6 * wave * max(params.radii)) + 20
    s_cr = float(ranked[0][0])
    near = [item for item in ranked if item[0] < (1 + _TIED) * s_cr][:7]
    shapes = [AxisymmetricMode(space.meridian.mesh.colatitude, mode.profile, m) for _, m, mode in near]
    degrees = [dominant_degree(shape, top) for shape in shapes]
    ties = tuple(Tie(float(s), d, m) for (s, m, _), d in zip(near[1:], degrees[1:], strict=True))
    mesh = space.meridian.mesh
    settings |= {"columns": len(mesh.colatitude), "elements": len(mesh.nodes), "unknowns": space.size}
    first = near[0][1]
    short = f"m = {first} is the largest wavenumber that was looked at: shorter waves may come first"
    turned = "this is a turn of the whole about its centre and no buckling: quality default finds the onset"
    reason = short if first >= highest else "" if near[0][2].vanishes or first > 1 else turned
    seconds = time.perf_counter() - begin
    common |= {"ties": ties, "seconds": seconds, "settings": settings, "reason": reason}
    return Onset(s_cr, degrees[0], first, mode=shapes[0], **common)


def _window(space: Perturbations, lower: float, upper: float, start: BaseState | None, context: Context) -> Pencil:
    first = space.meridian.at(lower, start if start is not None and start.s < lower else None, context)
    middle = space.meridian.at((lower + upper) / 2, first, context)
    return Pencil.exact(space, [first, middle, space.meridian.at(upper, middle, context)])


def _rough(
    space: Perturbations, wavenumbers: Sequence[int], method: Method, estimate: float, context: Context
) -> dict[int, float]:
    """Return roughly where each wavenumber starts; infinite for what does not start below the searched shrinkage."""
    if method == "linear":
        pencil = Pencil.linear(space)
        return {m: _first(pencil, m, context) for m in wavenumbers}
    lower, upper, known = 0.75 * estimate, 1.1 * estimate, 0.0
    for _ in range(_TRIES):
        upper = min(upper, SEARCHED)
        lower = min(lower, 0.97 * upper)
        context.report(0.05, f"s = {lower:.3f} to {upper:.3f}")
        try:
            pencil = _window(space, lower, upper, None, context)
        except NotConverged as error:
            if error.last_stage is None or error.last_stage < 1.02 * lower:
                raise
            upper = error.last_stage
            continue
        try:
            found = {m: _first(pencil, m, context) for m in wavenumbers}
        except UnstableStart:
            lower, upper = max(0.8 * lower, (lower + known) / 2), lower
            continue
        known = lower
        least = min(found.values())
        if least <= _REACH * upper:
            return found
        if upper >= SEARCHED:
            return dict.fromkeys(wavenumbers, math.inf)
        lower, upper = upper, min(1.4 * upper, max(1.05 * least, 1.1 * upper))
    raise NotConverged("the start of buckling was not bracketed.", advice="Try quality fine.", last_stage=known)


def _first(pencil: Pencil, m: int, context: Context) -> float:
    context.check_cancelled()
    return pencil.critical(m, 1)[0].s


def _decide(
    space: Perturbations,
    starts: Sequence[int],
    stride: int,
    near: float,
    highest: int,
    method: Method,
    context: Context,
) -> dict[int, list[Critical]]:
    """Return the modes of every wavenumber that was tried around `starts`, on a window that ends at the onset."""
    lower, upper = 0.955 * near, 1.015 * near
    below = space.meridian.fresh()
    for _ in range(_TRIES):
        modes: dict[int, list[Critical]] = {}
        if method == "linear":
            pencil = Pencil.linear(space, lower)
        else:
            context.report(0.4, f"s = {lower:.4f} to {upper:.4f}")
            pencil = _window(space, lower, upper, below, context)

        def value(m: int, pencil: Pencil = pencil, modes: dict[int, list[Critical]] = modes) -> float:
            context.check_cancelled()
            context.report(0.4 + 0.05 * len(modes), f"wavenumber {m}")
            modes[m] = pencil.critical(m)
            return modes[m][0].s

        valley = Valley(value, 0, highest)
        try:
            best = min((valley.descend(m, max(stride, 1)) for m in starts), key=valley.known.__getitem__)
            valley.fill(range(best - 2, best + 3))
        except UnstableStart:
            lower, upper = 0.97 * lower, lower
            continue
        s_cr = min(valley.known.values())
        if method == "linear" or s_cr <= 1.02 * upper:
            return modes
        lower, upper = 0.97 * s_cr, 1.01 * s_cr
    raise NotConverged("the start of buckling was not bracketed.", advice="Try quality fine.", last_stage=lower)
