"""The onset of any fruit, elliptic equators too: triquadratic elements between the symmetry planes, all parities.

Thin skins buckle first in one place, and only the patch that holds the mode is meshed finely; its edge follows a coarse
smooth state. s_cr is the limit of two meshes by the order measured for each; all modes that may come first by what
their waves' lengths say go to the finer mesh, for coarse ones make short waves come late.
Cost: some six factors of each mesh; of whole parts, unknowns grow with 1 / thickness^2, of patches with 1 / thickness.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...arrays import Floats
from ...contract import Context, NotConverged
from ..fresh.closed_form import flat_film_wavelength, onset_estimate
from ..implicit import BaseState, Model, Patch
from ..implicit.buckling import Crossing, Path, crossing, parities
from ..params import DehydrationParams
from .field import dominant, mode_heights, round_it
from .looks import SAME, Look, Pair, elsewhere, even
from .places import expected_onsets
from .radial import stable_reason
from .result import FieldMode, Method, Onset, Tie
from .rings import Rings
from .states import States

__all__ = ["crossings", "onset_full"]


#: Quadratic elements per wrinkle of the flat film, of the mesh that looks at all parities and of the one that decides.
PER_WAVELENGTH = {"preview": (1.5, 2.1), "default": (2.0, 2.9), "fine": (2.9, 4.0)}
#: The linear method's first modes are shorter (degree 23 instead of 14 on the sphere with te .04): it needs more.
LINEAR_FINER = 1.6
#: Elements per edge of the two meshes of a whole part, at least: on 4 and 6, degree 5 is .4 % off.
LEAST = 6, 10
#: Order of s_cr in element size of the whole part, measured on spheres, whose degrees are given: 3.0 to 3.5 between 1.9
#: and 4.8 elements a wrinkle. Waves of a patch grow longer where short ones are too stiff: on plum 1 2.2 from 2.0 to 4
#: elements a wrinkle and 2.7 from 2.9 to 5, on flat films (one column, phases at its sides) 2.3 to 2.9.
ORDER, PATCH_ORDER = 3.2, 2.5
#: Shear modulus of the skin over the core's past which elements stay as short as at it: 3.4 to a wrinkle are off by
#: 1.9 % at 30, as 2.4 are at 10.
STIFF = 10.0
#: Bulk over shear modulus that stands for incompressible; s_cr is off by about 2e-5, relative.
PENALTY = 1e5
#: Largest shrinkage that is looked at.
SEARCHED = 0.6
#: Share of the expected onset at which one looks first, from a look that saw it, and on the finer mesh (whose onset is
#: lower); and where the look that is nearest saw none.
FIRST_LOOK, NEXT_LOOK, FINE_LOOK, EARLY_LOOK = 0.85, 0.97, 0.975, 0.7
#: A look that found the smooth state unstable, or not at all, is taken again from this much of it.
BACK = 0.96
#: A look from farther below the onset than this is repeated from nearer.
FAR = 0.93
#: Radius of the first patch in wavelengths of its skin, its growth, and what a mode may have left beyond 3/4 of it.
#: On plum 1, around the mode, radii of 2.6, 3.2, 4.3 and 5.6 gave .08696, .08680, .08676 and .08676; .60, .43, .25 and
#: .02 were left.
REACH, WIDER, LEFT = 3.3, 1.4, 0.45
#: Stacks up to which the whole part is as good as a patch, and places within this of the first that are looked at.
FEW, RIVALS, PLACES = 360, 1.05, 3
#: Modes of other parities within this fraction above the first one are called ties.
TIED = 0.05
#: How much coarser a patch may be along the crests than across.
CRESTS = 1.2
_TRIES = 14


class _AlreadyUnstable(Exception):
    """The smooth state below the expected onset has a falling direction."""


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
    context = context or Context()
    model, found = crossings(params, method=method, kappa_ratio=kappa_ratio, quality=quality, context=context)
    n = len(model.mesh.quad_of[0])
    settings = {
        "n": n,
        "layers": model.mesh.layers,
        "stacks": len(model.mesh.stacks),
        "unknowns": int(model.free.sum()),
    }
    if not found:
        return Onset(
            None, None, None, "full", method, kappa_ratio, None, seconds=time.perf_counter() - begin, settings=settings,
            searched=SEARCHED, reason=stable_reason(SEARCHED),
        )  # fmt: skip
    modes = []
    for number, each in enumerate(found):
        context.check_cancelled()
        context.report(0.9 + 0.1 * number / len(found), "waves of the modes")
        heights = mode_heights(params, model, each)
        band = model.mesh.band
        waves = dominant(heights, _highest(params, n)) if band is None else round_it(heights, band, _highest(params))
        modes.append((each.shrinkage, *waves, heights))
    s_cr, degree, wavenumber, heights = modes[0]
    return Onset(
        s_cr, degree, wavenumber, "full", method, kappa_ratio, FieldMode(heights),
        ties=tuple(Tie(s, d, m) for s, d, m, _ in modes[1:]), seconds=time.perf_counter() - begin,
        searched=SEARCHED, settings=settings,
    )  # fmt: skip


def _highest(params: DehydrationParams, n: int | None = None) -> int:
    """Return the highest degree that a mode may have, on a mesh of `n` elements an edge or any."""
    wave = flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio)
    highest = math.ceil(2.5 * 2 * np.pi * max(params.radii) / wave) + 8
    return highest if n is None else min(4 * n, highest)


def crossings(
    params: DehydrationParams, *, method: Method = "exact", kappa_ratio: float | None = None,
    quality: str = "default", context: Context | None = None,
) -> tuple[Model, list[Crossing]]:  # fmt: skip
    """Return the mesh's model and each parity's first singular tangent up to `SEARCHED`, sorted; none where smooth.

    The part of `onset_full` that costs no search for the modes' degrees. Waves that run round the axis of a large mesh
    are looked for in bands of latitudes (see `rings`), and only there. Raises what it raises.
    """
    # runs start from modes of quality preview: whose bytes change, that is another version of the solver
    search = _Search(params, method, kappa_ratio or PENALTY, context or Context(), quality != "preview")
    if method == "exact" and not search.few(PER_WAVELENGTH[quality][0]):
        rings = Rings(params, search.states, search.places, search.context)
        if places := rings.bands(RIVALS):
            return rings.run(places, quality)
    coarse, fine = (each * (LINEAR_FINER if method == "linear" else 1) for each in PER_WAVELENGTH[quality])
    return search.run(coarse, fine)


class _Search:
    """One fruit and what is expected of its onset. thorough: whether more than the coarse mesh's first goes on."""

    def __init__(
        self, params: DehydrationParams, method: Method, kappa_ratio: float, context: Context, thorough: bool
    ) -> None:
        self.params, self.method, self.context, self.thorough = params, method, context, thorough
        self.states = States(params, kappa_ratio, context)
        self.wavelength = flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio)
        # under stiffer skins waves are longer, but elements must not be longer than the skin is thick by more
        self.resolved = flat_film_wavelength(params.exocarp_thickness, min(params.modulus_ratio, STIFF))
        rough = FIRST_LOOK * min(onset_estimate(params.modulus_ratio, min(params.stone)), SEARCHED)
        self.places = expected_onsets(self.states.smooth(rough)[0])
        # shrinkage from which the next look is taken; the linear method looks from the fresh shape
        self.below = min(NEXT_LOOK * float(self.places.onsets.min()), SEARCHED)
        # shrinkage at which a smooth state was found unstable, or not at all
        self.unstable = np.inf

    def run(self, coarse: float, fine: float) -> tuple[Model, list[Crossing]]:
        """Return the finer mesh's model and the crossings, sorted; coarse, fine: elements per wrinkle."""
        look = self._place(coarse)
        parity = look.first.parity
        if look.first.shrinkage <= SEARCHED:
            look = self._all(look)
        if look.first.shrinkage > SEARCHED:
            look = self._early(look)
        if look.first.shrinkage > SEARCHED:
            return look.model, []
        first = next((each for each in look.found if each.parity == parity), look.first)
        # where it does not matter, the parity whose factor is at hand
        best = first if first.shrinkage < (1 + SAME) * look.first.shrinkage else look.first
        n = max(self._elements(look.patch, fine, 1), len(look.model.mesh.quad_of[0]) + 2)
        model = self.states.model(n, look.patch)
        guesses = {best.parity: elsewhere(self.params, look.model, best.mode, model)}
        self.below, self.unstable = FINE_LOOK * best.shrinkage, np.inf
        last = self._repeated(model, guesses, 0.6, look.patch, look)
        pair = Pair(look, last, ORDER if look.patch is None else PATCH_ORDER)
        return model, [each for each in self._limits(pair) if each.shrinkage <= SEARCHED]

    def _limits(self, pair: Pair) -> list[Crossing]:
        """Return the limits of both meshes, sorted. Where thorough, all modes that may come first go to the finer."""
        if self.thorough:
            while (rival := pair.rival()) is not None:
                guess = elsewhere(self.params, pair.coarse.model, rival.mode, pair.fine.model)
                fine = self._all(pair.fine, {rival.parity: guess})
                pair = pair._replace(fine=fine, asked=(*pair.asked, rival.parity))
            modes, others = pair.limits(), pair.later(TIED)
        else:
            modes = pair.limits()
            limit, best = modes[0].shrinkage, pair.coarse.of(modes[0].parity).shrinkage
            others = [
                each._replace(shrinkage=max(each.shrinkage * limit / best, limit))
                for each in pair.coarse.found
                if (1 + SAME) * best < each.shrinkage < (1 + TIED) * best
            ]
        moved = [
            each._replace(mode=elsewhere(self.params, pair.coarse.model, each.mode, pair.fine.model)) for each in others
        ]
        return sorted([*modes, *moved], key=lambda each: each.shrinkage)

    def _all(self, look: Look, wanted: Mapping[tuple[int, ...], Floats | None] | None = None) -> Look:
        """Return what other parities show beside those seen: all that could differ, or those `wanted` by guesses."""
        for _ in range(_TRIES):
            more = dict.fromkeys(look.others()) if wanted is None else wanted
            try:
                found = self._seen(look.model, look.path, more, 0.3 if wanted is None else 0.7)
            except _AlreadyUnstable:
                # one of them comes that much earlier
                self._back(look.path.shrinkage)
                seen = {each.parity: each.mode for each in look.found}
                look = self._repeated(look.model, seen, 0.3 if wanted is None else 0.7, look.patch)
            else:
                return replace(look, found=sorted([*look.found, *found], key=lambda each: each.shrinkage))
        raise self._lost()

    def _early(self, look: Look) -> Look:
        """Return what all parities show from well before the expected onset.

        Thick skins have few waves, and those of even parity grow on the smooth state itself, which then goes by the
        onset with no even tangent turning singular.
        """
        self.below, self.unstable = EARLY_LOOK * float(self.places.onsets.min()), np.inf
        self.states.forget()
        return self._repeated(look.model, {parity: None for parity, _ in parities(look.model)}, 0.3, look.patch)

    # ------------------------------------------------------------------------------------------------------ where

    def _place(self, per_wavelength: float) -> Look:
        """Return the even parity's first mode on the whole part, or on the patch that holds it."""
        if self.few(per_wavelength):
            model = self.states.model(self._elements(None, per_wavelength), None)
            return self._repeated(model, {even(model): None}, 0.1)
        seen = [self._grown(patch, per_wavelength, 0) for patch in self._patches()]
        look = min(seen, key=lambda each: each.first.shrinkage)
        for number in range(_TRIES):
            if look.patch is None:
                return look
            centre, beyond = look.extent()
            if beyond <= LEFT:
                return look
            # the estimate may have been a patch's radius off: move there before growing
            radius = look.patch.radius * (WIDER if number else 1.0)
            look = self._grown(Patch(centre, radius), per_wavelength, number + 1)
        return look

    def few(self, per_wavelength: float) -> bool:
        """Return whether the whole part has so few columns that nothing smaller is looked at."""
        quads = 6 * self._elements(None, per_wavelength) ** 2
        return bool(quads // 2 ** len(self.states.whole.mesh.planes) <= FEW)

    def _patches(self) -> list[Patch]:
        """Return the places that may come first, the first of all first."""
        middles, expected, _, thinned, _ = self.places
        order, places = np.argsort(expected), list[Patch]()
        for at in order[expected[order] <= RIVALS * expected[order[0]]]:
            radius = REACH * self.wavelength * float(thinned[at])
            if all(np.linalg.norm(middles[at] - other.centre) > 2 * radius for other in places):
                places.append(Patch(middles[at], radius))
        return places[:PLACES]

    def _grown(self, patch: Patch, per_wavelength: float, number: int) -> Look:
        n = self._elements(patch, per_wavelength)
        model = self.states.model(n, patch)
        if len(model.mesh.stacks) > 0.7 * 6 * n**2 / 2 ** len(model.mesh.planes):
            model, patch = self.states.model(self._elements(None, per_wavelength), None), None  # type: ignore[assignment]
        return self._repeated(model, {even(model): None}, 0.05 + 0.02 * number, patch)

    def _elements(self, patch: Patch | None, per_wavelength: float, mesh: int = 0) -> int:
        """Return the even number of elements per edge that has `per_wavelength` to a wrinkle where it counts.

        mesh: 0 for the coarse one, 1 for the finer.
        """
        middles, onsets, widths, thinned, _ = self.places
        if patch is None:
            there = onsets <= RIVALS * onsets.min()
        else:
            near = np.linalg.norm(middles - patch.centre, axis=1)
            there = near <= max(patch.radius / 2, near.min())
        # waves are as short as the skin is thin across
        across, along = (widths / thinned[:, None])[there].max(axis=0)
        size = len(self.states.whole.mesh.quad_of[0]) * float(max(across, along / CRESTS))
        if patch is None:
            size = max(size, np.pi / 2)
        least = LEAST[mesh] if self.thorough and patch is None else 4
        return max(2 * math.ceil(size * per_wavelength / self.resolved / 2), least)

    def _repeated(
        self, model: Model, wanted: Mapping[tuple[int, ...], Floats | None], done: float, patch: Patch | None = None,
        coarser: Look | None = None,
    ) -> Look:  # fmt: skip
        """Return crossings seen from near: a look from too far below, or from beyond, is taken again."""
        for _ in range(_TRIES):
            self.context.report(done, f"{len(model.mesh.stacks)} columns of elements at s = {self.below:.4f}")
            try:
                path, state = self._path(model, coarser)
                found = self._seen(model, path, wanted, done)
            except (NotConverged, _AlreadyUnstable):
                if self.method == "linear":
                    raise
                self._back(self.below)
                continue
            if not found and coarser is not None and self.method == "exact":
                # the coarser mesh saw one: on this one the smooth state is past it
                self._back(self.below)
                continue
            near = found[0].shrinkage if found else np.inf
            if self.method == "linear" or near > SEARCHED or self.below >= min(FAR * near, BACK * BACK * self.unstable):
                none = Crossing(np.inf, np.zeros_like(model.free, dtype=float), next(iter(wanted)))
                return Look(model, patch, path, state, found or [none])
            self.below = min(NEXT_LOOK * near, 1.6 * self.below, BACK * self.unstable)
            wanted = {each.parity: each.mode for each in found}
        raise self._lost()

    def _back(self, unstable: float) -> None:
        """Look from below what turned out unstable."""
        self.unstable = min(self.unstable, unstable)
        self.below = BACK * self.unstable
        if self.thorough:
            # moved on from .0466, the sphere with te .08, gamma 50 seemed to buckle at .0448, 2.8 % too early
            self.states.forget()

    def _lost(self) -> NotConverged:
        return NotConverged("the onset was not bracketed.", advice="Ask for a finer quality.", last_stage=self.below)

    def _path(self, model: Model, coarser: Look | None) -> tuple[Path, BaseState]:
        if self.method == "linear":
            return self.states.fresh_path(model)
        known = None if coarser is None else (coarser.state, coarser.path.velocity)
        return self.states.path(model, self.below, known)

    def _seen(
        self, model: Model, path: Path, wanted: Mapping[tuple[int, ...], Floats | None], done: float
    ) -> list[Crossing]:
        """Return the crossings of the parities wanted, sorted; with a guess at their modes where there is one."""
        watch, found = self.context.check_cancelled, []
        asked = [(parity, free) for parity, free in parities(model) if parity in wanted]
        for number, (parity, free) in enumerate(asked):
            self.context.report(done + 0.3 * number / len(asked), f"parity {parity}")
            own = bool((free == model.free).all())
            factor = path.velocity.factor if own else model.factor(path.velocity.tangent, free, watch)
            if factor.negative:
                raise _AlreadyUnstable
            each = crossing(model, path, parity, free, factor, wanted[parity], watch)
            if each is not None:
                found.append(each)
        return sorted(found, key=lambda each: each.shrinkage)
