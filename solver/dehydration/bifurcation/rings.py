"""The onset where waves run round the axis of a slender fruit whose equator is nearly, but not quite, a circle.

Crests follow meridians and are several times as long as waves are, and the mode goes on from wave to wave far round the
fruit. A band of latitudes holds it: short elements round the axis, long ones along meridians, down to where waves no
longer reach. The smooth state knows nothing of the waves: it is found on few, long elements round the axis, and only
the tangent is taken on the short ones, so that a look costs one factor of these.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...arrays import Bools, Floats
from ...contract import Context, NotConverged
from ..fresh.closed_form import flat_film_wavelength
from ..implicit import Band, BaseState, Equilibrium, Model, carried, natural_symmetry
from ..implicit.buckling import (
    STEP,
    Crossing,
    Path,
    Velocity,
    crossing,
    fresh_metric,
    parities,
    tangent_at,
)
from ..params import DehydrationParams
from .looks import elsewhere, nodal
from .places import Places
from .states import States

__all__ = ["Rings"]


#: Waves round the axis from which on they are looked for in bands. Each parity about the planes has every other of
#: these numbers; the best of all comes earlier than the best of the even ones by .4 / number^2 (wolfberry), relative.
MANY = 20
#: Largest cosine between crests and the circle round the axis.
ACROSS = 0.35
#: Quadratic elements to a wrinkle of the flat film, of the look at each place and of the two whose limit is taken. On
#: the wolfberry with r8 = .38, whose waves are 1.25 times as long, s_cr falls by 1.2 and .4 % from 2.9 to 4.2 to 6.2.
PER_WAVELENGTH = {"preview": (2.0, 2.9, 4.2), "default": (2.0, 4.2, 6.2), "fine": (2.0, 6.0, 8.5)}
#: Half of the first band's width, in wavelengths of its skin, and places this near the first are taken along.
REACH, CLOSE = 6.0, 1.005
#: Half of a band's width, in standard deviations of the mode's square along meridians, as it is made, and the least
#: with which a look is believed: on finer meshes a mode moves by up to four, and an edge at three makes it .3 % late.
#: And the share of the mode's height that counts as none, round the axis.
FITTED, LEAST, NONE = 6.5, 4.0, 0.06
#: Elements along meridians of the first bands and of fitted ones: 14 and 24 in place of 6 change s_cr by 2e-4.
ROWS, FITTED_ROWS = 8, 7
#: Layers of the flesh that waves reach: 1.75 wavelengths.
DEEP = 3
#: Azimuth [radian] of an element of the smooth state, at first and later.
ROUGH, SMOOTH = math.pi / 8, math.pi / 20
#: Order of s_cr in the size of elements: 2.7 on the wolfberry with r8 = .38, from 2.9 over 4.2 to 6.2 to a wrinkle.
ORDER = 2.7
#: Largest shrinkage that is looked at, and shares of an onset as in `full`.
SEARCHED = 0.6
NEXT, FINER, BACK, FAR = 0.97, 0.975, 0.96, 0.93
_TRIES, _MOVES = 14, 5


class _Look(NamedTuple):
    band: Band
    model: Model
    first: Crossing
    state: tuple[BaseState, Velocity]

    def fitted(self) -> tuple[Band, bool]:
        """Return the band that holds the mode, without its elements, and whether this one does."""
        mesh, band = self.model.mesh, self.band
        top = np.linalg.norm(nodal(self.model, self.first.mode), axis=1)[mesh.levels - 1 :: mesh.levels]
        height = top.reshape(2 * band.cells + 1, 2 * band.rows + 1) / top.max()
        colatitude = np.linspace(band.high, band.low, 2 * band.rows + 1)
        azimuth = np.linspace(band.first, band.last, 2 * band.cells + 1)
        weight = (height**2).sum(axis=0) / (height**2).sum()
        middle = float(weight @ colatitude)
        spread = math.sqrt(float(weight @ (colatitude - middle) ** 2))
        mirrored = 1 in mesh.planes and band.low == math.pi / 2
        held = middle - LEAST * spread >= band.high and (mirrored or middle + LEAST * spread <= band.low)
        low = middle + FITTED * spread
        round_it = np.flatnonzero(height.max(axis=1) > NONE)
        first, last = float(azimuth[round_it[0]]), float(azimuth[round_it[-1]])
        return Band(
            max(middle - FITTED * spread, band.high / 2),
            min(low, math.pi / 2) if 1 in mesh.planes else min(low, (math.pi + band.low) / 2),
            0.0 if round_it[0] < 4 else first, math.pi / 2 if round_it[-1] > len(azimuth) - 5 else last, 1, 1,
        ), held  # fmt: skip


class Rings:
    """One fruit whose first waves run round the axis."""

    def __init__(self, params: DehydrationParams, states: States, places: Places, context: Context) -> None:
        self.params, self.states, self.places, self.context = params, states, places, context
        self.wavelength = flat_film_wavelength(params.exocarp_thickness, params.modulus_ratio)
        self.below = min(NEXT * float(places.onsets.min()), SEARCHED)

    def bands(self, rivals: float) -> list[Band]:
        """Return the bands that may come first, the first of all first; none where waves do not run round the axis.

        rivals: over the first onset that is expected, how late others may be.
        """
        middles, onsets, _, _, crests = self.places
        order = np.argsort(onsets)
        order = order[onsets[order] <= rivals * onsets[order[0]]]
        squash = self.params.radii[7] / self.params.radii[3]
        found = list[Band]()
        for at in order:
            x, _, z = middles[at]
            circle = np.array([-z / squash, 0.0, x * squash])
            if abs(crests[at] @ circle) > ACROSS * np.linalg.norm(circle):
                return []
            band = self._around(middles[at])
            if band is None:
                return []
            if all(band.low < other.high or band.high > other.low for other in found):
                found.append(band)
        return found

    def _around(self, place: Floats) -> Band | None:
        """Return the band about a place; None where it would reach the pole, or few waves go round."""
        squash = self.params.radii[7] / self.params.radii[3]
        table = np.linspace(0.0, np.pi, 2001)
        x, y = self.params.generatrix(table)
        polar = np.arctan2(np.maximum(x, 0.0), y)
        middle = float(np.interp(math.atan2(math.hypot(place[0], place[2] / squash), place[1]), polar, table))
        wave = self._wave(middle)
        if 2 * np.pi * math.hypot(place[0], place[2]) < MANY * wave:
            return None
        speed = float(np.interp(middle, table, np.hypot(np.gradient(x, table), np.gradient(y, table))))
        half = REACH * wave / speed
        if not half < middle < np.pi - half:
            return None
        low = middle + half if natural_symmetry(self.params) == "quarter" else min(middle + half, np.pi / 2)
        return Band(middle - half, low, 0.0, np.pi / 2, 1, 1)

    def _wave(self, colatitude: float) -> float:
        """Return the flat film's wavelength where the skin is thinnest across, at a colatitude."""
        step, azimuth = 1e-5, np.array([1e-3, np.pi / 4, np.pi / 2 - 1e-3])
        at = np.full(3, colatitude)
        point = self.params.surface(at, azimuth)
        along = self.params.surface(at + step, azimuth) - self.params.surface(at - step, azimuth)
        around = self.params.surface(at, azimuth + step) - self.params.surface(at, azimuth - step)
        normal = np.cross(around, along)
        cosine = np.einsum("ki,ki->k", normal, point) / np.linalg.norm(normal, axis=1) / np.linalg.norm(point, axis=1)
        return self.wavelength * float(np.abs(cosine).min())

    def _divided(self, band: Band, per_wavelength: float, rows: int) -> Band:
        """Return the band with `per_wavelength` elements to a wave, where it is widest."""
        size = self._wave((band.high + band.low) / 2) / per_wavelength
        wide = self.params.generatrix(np.linspace(band.high, band.low, 9))[0].max()
        arc = float(wide) * max(1.0, self.params.radii[7] / self.params.radii[3]) * (band.last - band.first)
        return band._replace(cells=max(math.ceil(arc / size), 2), rows=rows)

    def run(self, bands: list[Band], quality: str) -> tuple[Model, list[Crossing]]:
        """Return the finer mesh's model and the first crossing up to where one looks."""
        rough, coarse, fine = PER_WAVELENGTH[quality]
        share = 0.4 / len(bands)
        seen = [self._look(self._divided(band, rough, ROWS), 0.05 + i * share) for i, band in enumerate(bands)]
        seen.sort(key=lambda each: each.first.shrinkage)
        best = seen[0].first.shrinkage
        if best > SEARCHED:
            return seen[0].model, []
        near = [self._held(each, coarse) for each in seen if each.first.shrinkage <= CLOSE * best]
        look = min(near, key=lambda each: each.first.shrinkage)
        self.below = FINER * look.first.shrinkage
        last = self._look(self._divided(look.band, fine, FITTED_ROWS), 0.75, look)
        ratio = last.band.cells / look.band.cells
        limit = last.first.shrinkage - (look.first.shrinkage - last.first.shrinkage) / (ratio**ORDER - 1)
        return last.model, [last.first._replace(shrinkage=limit)]

    def _held(self, look: _Look, per_wavelength: float) -> _Look:
        """Return a look at the same mode in a band that holds it.

        Raises NotConverged: it moves on from band to band.
        """
        self.below = NEXT * look.first.shrinkage
        for number in range(_MOVES):
            band = look.fitted()[0]
            # round the axis once only: sides that are cut again and again would press the mode together
            band = band._replace(first=look.band.first, last=look.band.last) if number else band
            look = self._look(self._divided(band, per_wavelength, FITTED_ROWS), 0.5 + 0.04 * number, look)
            if look.fitted()[1]:
                return look
        raise NotConverged("the first mode was not held by a band of latitudes.", advice="Ask for a finer quality.")

    def _look(self, band: Band, done: float, known: _Look | None = None) -> _Look:
        """Return the first crossing in a band, seen from near. known: a look at the same place, from which to start."""
        wide = ROUGH if known is None else SMOOTH
        smooth = self.states.in_band(
            band._replace(
                rows=max(3, math.ceil(0.6 * band.rows)), cells=max(2, math.ceil((band.last - band.first) / wide))
            )
        )
        model, unstable = self.states.in_band(band, DEEP), np.inf
        guess = None if known is None else elsewhere(self.params, known.model, known.first.mode, model)
        state = None if known is None else known.state
        for _ in range(_TRIES):
            self.context.report(done, f"{len(model.mesh.stacks)} columns of elements at s = {self.below:.4f}")
            state = self.states.moving(smooth, self.below, state)
            parity, free = next(parities(model))
            path = self._path(model, state, free)
            if path.velocity.factor.negative:
                unstable = min(unstable, self.below)
                self.below = BACK * unstable
                continue
            found = crossing(model, path, parity, free, path.velocity.factor, guess, self.context.check_cancelled)
            if found is None or self.below >= min(FAR * found.shrinkage, BACK * BACK * unstable, SEARCHED):
                none = Crossing(np.inf, np.zeros_like(model.free, dtype=float), parity)
                return _Look(band, model, found or none, state)
            self.below, guess = min(NEXT * found.shrinkage, 1.6 * self.below, BACK * unstable, SEARCHED), found.mode
        raise NotConverged("the onset was not bracketed.", advice="Ask for a finer quality.", last_stage=self.below)

    def _path(self, model: Model, known: tuple[BaseState, Velocity], free: Bools) -> Path:
        """Return the tangent of a smooth state on a mesh for waves, factored, and how it changes."""
        state, rate = known
        fresh, s = model.mesh.positions, state.state.shrinkage
        at = carried(state, model)
        going = Equilibrium(s, state.mesh.positions + rate.moved, rate.pressure)
        way = carried(BaseState(self.params, state.model, going), model)
        moved = way.deformed - fresh
        low, high = (
            tangent_at(model, Equilibrium(s + step, at.deformed + step * moved, at.pressure + step * way.pressure))
            for step in (-STEP, STEP)
        )
        tangent = tangent_at(model, at)
        factor = model.factor(tangent, free, self.context.check_cancelled)
        return Path(s, (high - low) / (2 * STEP), fresh_metric(model), Velocity(tangent, moved, way.pressure, factor))
