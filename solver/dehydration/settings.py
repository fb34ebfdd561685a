"""What a quality means: mesh, compressibility, pace and residual, chosen from the parameters."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..contract import Cost, InvalidInput, Need
from .fresh.closed_form import flat_film_wavelength, onset_estimate
from .fresh.loading import Loading
from .fresh.mesh import flesh_span, layer_fractions
from .params import DehydrationParams

__all__ = ["Settings", "choose", "expected_cost"]


@dataclass(frozen=True)
class Settings:
    """Everything numerical about a run; follows from parameters and quality alone, so that results are repeatable.

    n: elements per edge of the cubed sphere. core: fractions of the core's layer breakpoints. full_levels: outermost
    core layers that are integrated fully, the others take one point.
    kappa_ratio: bulk over shear modulus; march_kappa_ratio, skin_march_kappa_ratio: those that flesh and skin are
    marched with (see `kernel.bulk`).
    start: shrinkage below which the fruit is still smooth, where the march begins. pace: shrinkage per step of the
    march. copies: mirror images that make up the whole fruit. damping: per step, while marching; swing_damping,
    easing_damping and calm_damping: while a stage settles (see `settle.settle`). residual, drift: at which a stage
    counts as settled (see `settle.State`); near: residual below which it is eased and does not swing. swing_steps,
    calm_steps: longest turn of each way of settling. settle_steps: after which a stage does not settle. clearance: gap
    that self-contact keeps, in exocarp thicknesses. rungs: shrinkages of the settled states on the way.
    """

    n: int
    core: Floats
    kappa_ratio: float
    march_kappa_ratio: float
    skin_march_kappa_ratio: float
    pace: float
    damping: float
    swing_damping: float
    easing_damping: float
    calm_damping: float
    residual: float
    near: float
    drift: float
    swing_steps: int
    calm_steps: int
    settle_steps: int
    start: float
    rungs: tuple[float, ...]
    clearance: float = 0.1
    full_levels: int = 1000
    copies: int = 1

    @property
    def elements(self) -> int:
        """Number of hexahedra that are solved for."""
        return 6 * self.n**2 * (len(self.core) + 1) // self.copies


@dataclass(frozen=True)
class _Quality:
    """per_wavelength: elements of an edge; fewest, most of them. first_layer: thickness of the core layer at the
    interface, in wavelengths; growth: how fast layers grow inwards.
    """

    per_wavelength: float
    fewest: int
    most: int
    residual: float
    drift: float
    first_layer: float
    growth: float
    full_levels: int


#: Shrinkages at which a path settles on its way. Where buckles come up the first decides their number (without the one
#: at 0.05 stiff skins had a fifth more roughness at 0.1 and fewer buckles); later they may stand farther apart, which
#: saves up to a third of the steps. They are the same at every quality, as they decide what fruit it is: close ones
#: that each settle to their end leave more and shallower buckles, of a higher energy, in deep stages.
_RUNGS = tuple(round(0.05 * k, 2) for k in range(1, 13))
_WIDE = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
#: Skins and moduli for which rungs stand apart: others were not tried so.
_WIDE_SKINS, _WIDE_MODULI = (0.0075, 0.04), (5.0, 50.0)

#: Under deep folds core layers with one point each turn inside out: those within half a wavelength of the skin at
#: gamma = 10 (s = 0.25), within two thirds at gamma = 50 (s = 0.3). Below, J stays above 0.6; one point there changes
#: the roughness by less than another seed does, and so do layers that grow faster than fine's.
_QUALITIES = {
    "preview": _Quality(4.2, 18, 48, 2e-3, 2e-2, 0.12, 1.7, 3),
    "default": _Quality(6.0, 24, 96, 1e-3, 1e-2, 0.08, 1.6, 4),
    "fine": _Quality(9.0, 36, 160, 1e-3, 5e-3, 0.08, 1.3, 1000),
}

#: Elements a wavelength below which a mesh makes up a pattern of its own.
_FEWEST_PER_WAVELENGTH = 4.0
#: Elements of the largest run: 3 GB, and an hour or more to s = 0.3 on two cores.
_MOST_ELEMENTS = 2_500_000

#: Steps from s = 0 to 0.3 at n = 24: three times as many lead to states of the same energy. More elements shorten the
#: critical step, so their product with the step must be kept.
_STEPS, _STEPS_N, _STEPS_SPAN = 2000.0, 24, 0.3
#: Damping per step at the same reference: low enough not to delay the onset; and while a stage settles. The slowest
#: modes keep their shape on every mesh, so per step they slow down as the step shrinks, and damping with them.
_DAMPING, _SWING_DAMPING = 0.004, 0.0005
#: Damping of a turn of easing over a swing's, and the residual over the one that counts as settled within which a state
#: gets new rest volumes after a swing, or when it swings no more. A swing goes past the end of ways so soft that a
#: calmed state creeps along them: thin skins at default swung to and fro until their steps were spent.
_EASING, _NEAR = 20.0, 3.0
#: Edge over thickness of the skin's elements from which its waves are the faster for it, as its columns share their
#: masses (see `kernel.coupled`; 1.5 to 2.1 times at te = 0.02 and 0.04), and by how much at most. Swings of full length
#: took such skins past where they were going: te = 0.02 at default took 53,000 steps in place of 4,000 to s = 0.2.
_SLENDER, _FASTEST = 1.5, 2.0
#: Longest turns of swinging (at the same reference) and calming, and most steps that a stage may settle for.
_SWING_STEPS, _CALM_STEPS, _SETTLE_STEPS = 750, 400, 40_000
#: Bulk over shear modulus that all qualities stand for, off by 1e-4 from incompressible in radius; and that steps are
#: taken with. By 15 they are 1.4 times as long, but what balances at 1000 may be unstable at 15 while rest volumes
#: stay: te = 0.02, gamma = 10 at default took four times the steps and did not settle (record dehydration-settling).
_KAPPA, _MARCH_KAPPA = 1000.0, 30.0
#: Exocarp thickness below which the kappa/mu that is marched with, damping of easing and what is near grow as it falls,
#: and by how much at most: thinner skins than a quarter of it are hardly ever run. Volumes that give way are as soft as
#: the longest ways of a net of wrinkles, which are more wrinkles long on thinner skins: at te = 0.01, under rest
#: volumes that were held, stages at default crept on for ever by 30, by more than the drift that counts; by 60 they
#: come to rest. Eased no more than other skins they would, too, in more steps.
_THIN, _THINNER = 0.02, 4.0
#: Bulk modulus of flesh that is marched with over that of its skin, 4 gamma te: softer flesh would take most of what
#: the skin gives way by, and its rest volumes would follow for ever.
_STIFFER = 2.0
#: Wall seconds per element and step on one core, for estimates only.
_SECONDS_PER_ELEMENT_STEP = 6e-8
#: Steps that a stage settles for, by and large (at the same reference), for estimates only. Those of fine go on until
#: they drift half as fast.
_SETTLING_STEPS = {"preview": 3000, "default": 3000, "fine": 8000}
#: Steps after which most looked-up shapes are in balance, for estimates only.
_RELAXING_STEPS = 1500
#: Seconds until compiled kernels are loaded and the mesh is made, and until the first buckling mode is found where runs
#: start from it: without and with an elliptic equator, or between mirrors.
_LOADING, _MODE, _MODE_ANY = 2.0, 5.0, 20.0


def choose(params: DehydrationParams, quality: str, last: float = np.inf) -> Settings:
    """Return the settings of `quality` (preview, default, fine) for `params`, for stages up to `last`.

    The mesh resolves the expected wrinkle wavelength by a fixed number of elements, within the quality's bounds, but
    never by fewer than four.

    Raises:
        InvalidInput: four elements a wavelength are more than a run may have.

    """
    q = _QUALITIES[quality]
    wavelength = flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio)
    n = math.ceil(np.pi / 2 * q.per_wavelength / wavelength)
    # the bound is on the cost: an eighth may be eight times as fine in area
    most = int(q.most * math.sqrt(2 ** len(params.mirrors)))
    n = min(max(n, q.fewest), most)
    loading = Loading(params)
    margin = 0.75 if params.stays_spherical else 0.5
    start = margin * onset_estimate(params.modulus_ratio, min(params.stone)) / loading.peak
    # where flesh is more than twice as thick as on average, layers are counted on it
    flesh = max(float(np.mean(params.radii[:7])) - max(params.stone), flesh_span(params)[1] / 2)
    core = layer_fractions(max(flesh, 0.05), q.first_layer * min(wavelength, 0.4), q.growth)
    n = _wrinkled(params, n, len(core) + 1, wavelength, last > start)
    scale = n / _STEPS_N
    slender = np.pi / 2 / n / (params.exocarp_thickness / 2)
    faster = min(max(slender / _SLENDER, 1.0), _FASTEST)
    stiffness = 4 * params.modulus_ratio * params.exocarp_thickness
    thinner = min(max(_THIN / params.exocarp_thickness, 1.0), _THINNER)
    march_kappa = _MARCH_KAPPA * thinner
    return Settings(
        n=n,
        core=core,
        kappa_ratio=_KAPPA,
        march_kappa_ratio=min(max(march_kappa, _STIFFER * stiffness), _KAPPA),
        skin_march_kappa_ratio=march_kappa,
        pace=_STEPS_SPAN / (_STEPS * scale) / loading.peak,
        damping=_DAMPING / scale,
        swing_damping=_SWING_DAMPING / scale,
        easing_damping=_EASING * thinner * (_SWING_DAMPING / scale),
        calm_damping=0.06,
        residual=q.residual,
        near=_NEAR * thinner * q.residual,
        drift=q.drift,
        swing_steps=round(_SWING_STEPS * scale / faster),
        calm_steps=_CALM_STEPS,
        settle_steps=round(_SETTLE_STEPS * scale / faster),
        start=start,
        rungs=_WIDE if _is_easy(params) else _RUNGS,
        full_levels=q.full_levels,
        copies=2 ** len(params.mirrors),
    )


def _wrinkled(params: DehydrationParams, n: int, layers: int, wavelength: float, wrinkles: bool) -> int:
    """Return how many elements an edge has, `n` or what wrinkles take; whether they are asked for changes nothing, but
    that what stays smooth has `n` where wrinkles would be refused.
    """
    least = max(n, math.ceil(np.pi / 2 * _FEWEST_PER_WAVELENGTH / wavelength))
    # a mirror plane is a line of nodes
    few, many = ((count + count % 2) if params.mirrors else count for count in (n, least))
    elements = 6 * many**2 * layers // 2 ** len(params.mirrors)
    if many == few or elements <= _MOST_ELEMENTS:
        return many
    if wrinkles:
        raise InvalidInput(
            f"wrinkles of te = {params.exocarp_thickness:g} and gamma = {params.modulus_ratio:g} are {wavelength:.3g} "
            f"long and take {elements:,} elements, more than {_MOST_ELEMENTS:,}.",
            advice=f"{_mirrored_more(params)}ake a thicker or stiffer exocarp.",
        )
    return few


def _mirrored_more(params: DehydrationParams) -> str:
    """Return the beginning of an advice: the mirrors that the fruit can have and has not, and a T to go on with."""
    mirrors = "" if params.light_map is not None else "xyz"
    if params.radii[:7] != params.radii[6::-1]:
        mirrors = mirrors.replace("y", "")
    for own in (params.wetness, params.light):
        mirrors = "".join(name for name in mirrors if not own["xyz".index(name)])
    if set(mirrors) == set(params.mirrors):
        return "T"
    return f"Set mirrors to {mirrors} (each halves the elements), or t"


def _is_easy(params: DehydrationParams) -> bool:
    (thin, thick), (soft, stiff) = _WIDE_SKINS, _WIDE_MODULI
    return thin <= params.exocarp_thickness <= thick and soft <= params.modulus_ratio <= stiff


def expected_cost(params: DehydrationParams, need: Need) -> Cost:
    """Return expected wall seconds on this machine's cores and bytes of memory."""
    last = max(need.stages, default=0.0)
    settings = choose(params, need.quality, last)
    if need.start is not None:
        return _whole_cost(params, settings, _RELAXING_STEPS)
    rungs = [rung for rung in settings.rungs if settings.start < rung < last + 1e-9]
    states = len(rungs) + sum(all(abs(stage - rung) > 1e-9 for rung in rungs) for stage in need.stages)
    settling = _SETTLING_STEPS[need.quality] * settings.n / _STEPS_N * states
    steps = max(last - settings.start, 0.0) / settings.pace + settling
    return _whole_cost(params, settings, steps)


def _whole_cost(params: DehydrationParams, settings: Settings, steps: float) -> Cost:
    started = _LOADING
    if params.imperfection_kind == "mode" and not (params.is_sphere and not params.mirrors):
        started += _MODE if params.is_axisymmetric and not params.mirrors else _MODE_ANY
    seconds = steps * settings.elements * _SECONDS_PER_ELEMENT_STEP / (os.cpu_count() or 1)
    return Cost(started + seconds, settings.elements * 1200 + 150_000_000)
