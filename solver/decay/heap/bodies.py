"""The bodies of a heap: one fruit's tetrahedra laid, turned and scaled for each, settled together, and their surfaces.

What is handed over is laid apart: of two surfaces each stays on its side of the plane between them, and none is below
the floor or outside of the bowl. Facets lie inside of round fruits, so that this moves points by as much as a facet is
flat, and by what the penalties give way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ..body.body import CONTACT, DENSITY, Body
from ..body.equilibrium import rested
from ..body.flesh import Booked, Softened
from ..body.material import blocks
from ..body.newton import skin_areas
from ..body.solid import Solid
from ..params import DecayParams
from ..settings import Settings
from .balance import Loaded, Settled, settled
from .kinds import Lot
from .lying import Lying
from .touching import paired

__all__ = ["Bodies", "Shaped", "apart", "headroom", "overlap", "stiff"]

#: Gap at which two fruits touch [r1]; rounds in which surfaces are laid apart.
TOUCHING, _ROUNDS = 0.05, 24
#: Share of its weight that friction bears sideways before a fruit slides. A choice, as of solver.resting.
_FRICTION = 0.5
#: Springs that bear it until then: the weight at so many to the r1. They give way by 0.02 r1 before they slide.
_HOLD = 25.0
#: How far beyond a plane a point is laid [r1]: more than single precision takes away.
_CLEAR = 2e-6


class Shaped(NamedTuple):
    """A heap's stage: surfaces (b, v, 3), what was solved for them if anything, and each fruit's weight and length.

    anchor (b, 3): where springs hold each fruit's core, sideways.
    """

    points: Floats
    found: Settled | None
    booked: Sequence[Booked]
    even: Floats
    anchor: Floats | None = None


class Bodies:
    """Fruits that lie as given, of the kinds of a lot."""

    def __init__(self, params: DecayParams, lying: Lying, lot: Lot, settings: Settings) -> None:
        self._params, self._lying, self._lot = params, lying, lot
        kinds = [
            Body(one, surface, settings.cells, settings.layers, settings.balance)
            for one, surface in zip(lot.params, lot.surfaces, strict=True)
        ]
        # of all fruits: all bodies are cut alike, whatever their shape
        self._bodies: list[Body] = [kinds[k] for k in lot.kind]
        self._onto = kinds[0].onto(settings.cells)
        self._tolerance = settings.balance
        solids, count = [body.solid for body in self._bodies], len(lying.size)
        size = len(solids[0].points)
        tets = (solids[0].tets[None] + size * np.arange(count)[:, None, None]).reshape(-1, 4)
        self._tets, self._pattern = tets, blocks(tets, size * count)
        self._skin = solids[0].skin
        self._fresh = _placed(lying, lot.kind, [body.solid.points for body in kinds]).reshape(-1, 3)
        cubed = np.repeat(lying.size**3, len(solids[0].tets))
        self._volume = np.concatenate([solid.volume for solid in solids]) * cubed
        self._contact = np.concatenate(
            [
                _stiffness(body.solid, s, lot.params[k])
                for s, body, k in zip(lying.size, self._bodies, lot.kind, strict=True)
            ]
        )
        shared = np.repeat(self._volume / 4, 4)
        points = np.bincount(tets.ravel(), shared, size * count)
        self._pressure = DENSITY * params.flesh.gravity * lot.unit
        core = np.where(np.concatenate([body.core for body in self._bodies]), points, 0.0).reshape(count, -1)
        whole = self._pressure * points.reshape(count, -1).sum(axis=1)
        self._tether = (_HOLD * whole[:, None] * core / core.sum(axis=1, keepdims=True)).ravel()

    def state(self, fruit: int, water: float, rot: Floats) -> Softened:
        """Return the flesh of a fruit that lost a share of its weight as water, with rot (v) on its surface."""
        return self._bodies[fruit].state(water, rot)

    def settled(
        self, states: Sequence[Softened], before: Shaped | None, watch: Callable[[], None] = lambda: None
    ) -> Shaped:
        """Return the heap of fruits of such flesh (b), from how it lay before or from how it was thrown.

        Raises:
            NotConverged: it finds no rest.

        """
        count = len(states)
        shrinkage = np.concatenate([state.shrinkage for state in states])
        young = np.concatenate([state.young for state in states])
        rest = rested(self._fresh, self._tets, shrinkage, young, self._params.flesh.poisson)
        even = np.array(
            [
                np.cbrt(np.average(state.shrinkage**3, weights=body.solid.volume))
                for state, body in zip(states, self._bodies, strict=True)
            ]
        )
        last = self._fresh if before is None or before.found is None else before.found.points
        ratio = even if before is None else even / before.even
        per = last.reshape(count, -1, 3)
        middle = per.mean(axis=1, keepdims=True)
        start = (middle + ratio[:, None, None] * (per - middle)).reshape(-1, 3)
        anchor = None if before is None else before.anchor
        loads = self._loads(states, start, anchor)
        found = settled(start, rest, loads, self._pattern, self._tolerance, watch)
        booked = [state.booked for state in states]
        return Shaped(self.surfaces(found.points), found, booked, even, self._slid(found.points, loads, anchor))

    def _cores(self, points: Floats) -> Floats:
        """Return the middles (b, 3) of what the springs hold."""
        count = len(self._lying.size)
        tether = self._tether.reshape(count, -1, 1)
        found: Floats = (points.reshape(count, -1, 3) * tether).sum(axis=1) / tether.sum(axis=1)
        return found

    def _slid(self, points: Floats, loads: Loaded, anchor: Floats | None) -> Floats:
        """Return where the cores are held next: where they were, or nearer, where friction bears no more."""
        cores = self._cores(points)
        if anchor is None:
            return cores
        count = len(cores)
        most = _FRICTION * loads.weight.reshape(count, -1).sum(axis=1) / self._tether.reshape(count, -1).sum(axis=1)
        away = cores - anchor
        far = np.linalg.norm(away[:, ::2], axis=1)
        held: Floats = cores - away * np.minimum(1.0, most / np.maximum(far, 1e-300))[:, None]
        return held

    def _loads(self, states: Sequence[Softened], start: Floats, anchor: Floats | None) -> Loaded:
        mass = np.concatenate([state.mass for state in states])
        shared = np.repeat(self._volume / 4, 4)
        weight: Floats = np.bincount(self._tets.ravel(), shared * np.repeat(mass, 4), len(start)).astype(float)
        skin, count = self._skin, len(states)
        pairs = paired(start.reshape(count, -1, 3)[:, skin])
        held = start
        if anchor is not None:
            # what is held is where the fruit stands, and not how it shrinks or turns
            held = start + np.repeat(anchor - self._cores(start), len(start) // count, axis=0)
        ground = self._lying.ground
        return Loaded(self._pressure * weight, self._contact, self._tether, held, skin, count, pairs, ground)

    def surfaces(self, points: Floats) -> Floats:
        """Return the surfaces (b, v, 3) of bodies with points (b * p, 3), as smooth as the fruit is, laid apart."""
        lying = self._lying
        count = len(lying.size)
        fresh = [self._lot.surfaces[k].points for k in self._lot.kind]
        found = np.empty((count, len(fresh[0]), 3))
        for b, own in enumerate(points.reshape(count, -1, 3)):
            middle = own.mean(axis=0)
            home = (own - middle) @ lying.turn[b] / lying.size[b]
            even, left = self._bodies[b].parted_of(home)
            there = (1 + even) * fresh[b] + self._onto @ left
            found[b] = lying.size[b] * there @ lying.turn[b].T + middle
        return apart(found, lying)


def _stiffness(solid: Solid, size: float, params: DecayParams) -> Floats:
    """Return the stiffness of contacts at the points (p) of a fruit's body, so large [Pa r1]."""
    fresh = params.flesh.unit * params.firmness
    return skin_areas(solid) * size**2 * CONTACT * fresh / float(np.cbrt(solid.volume.mean()))


def stiff(lying: Lying, lot: Lot) -> Floats:
    """Return the surfaces (b, v, 3) of fruits that keep their shape."""
    return apart(_placed(lying, lot.kind, [surface.points for surface in lot.surfaces]), lying)


def _placed(lying: Lying, kind: Ints, points: Sequence[Floats]) -> Floats:
    """Return points (b, p, 3) of fruits where they lie, of those of each kind (k of (p, 3)) in its own frame."""
    found = np.empty((len(kind), *points[0].shape))
    for k, own in enumerate(points):
        found[kind == k] = np.einsum("bij,pj->bpi", lying.turn, own)[kind == k]
    placed: Floats = found * lying.size[:, None, None] + lying.centre[:, None]
    return placed


def apart(points: Floats, lying: Lying) -> Floats:
    """Return surfaces (b, v, 3), each moved to its side of the planes between them, and onto floor or bowl."""
    found = points.copy()
    for _ in range(_ROUNDS):
        moved = False
        pairs = paired(found)
        for (i, j), way in zip(pairs.body, pairs.way, strict=True):
            ahead, behind = found[i] @ way, found[j] @ way
            over = float(ahead.max() - behind.min())
            if over <= 0:
                continue
            moved = True
            middle = _evenly(ahead, behind)
            for k, above in ((i, ahead - middle + _CLEAR), (j, behind - middle - _CLEAR)):
                beyond = np.maximum(above, 0.0) if k == i else np.minimum(above, 0.0)
                found[k] -= beyond[:, None] * way
        moved |= _grounded(found, lying)
        if not moved:
            break
    return found


def _evenly(ahead: Floats, behind: Floats) -> float:
    """Return the height at which both surfaces lose alike: where as much of the one is above it as of the other below.

    Points stand for the areas about them, which are alike.
    """
    low, high = float(behind.min()), float(ahead.max())
    for _ in range(50):
        middle = (low + high) / 2
        above = float(np.maximum(ahead - middle, 0).sum())
        below = float(np.maximum(middle - behind, 0).sum())
        low, high = (middle, high) if above > below else (low, middle)
    return (low + high) / 2


def _grounded(points: Floats, lying: Lying) -> bool:
    """Lay points (b, v, 3) on floor or bowl, in place; return whether any was below it."""
    if lying.ground is None:
        below = points[..., 1] < 0
        points[..., 1] = np.maximum(points[..., 1], 0.0)
        return bool(below.any())
    middle = np.array([0.0, lying.ground.height, 0.0])
    away = points - middle
    far = np.linalg.norm(away, axis=2)
    out = far > lying.ground.radius
    points[out] = middle + away[out] * ((lying.ground.radius - _CLEAR) / far[out])[:, None]
    return bool(out.any())


def headroom(points: Floats, lying: Lying, pole: int) -> Floats:
    """Return how far one may go straight up from a pole (b) before the next fruit, or what carries them [r1].

    points: surfaces (b, v, 3). Each fruit is known by the planes that part it from others, so there may be more room.
    """
    foot = points[:, pole]
    way = foot - points.mean(axis=1)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    room = np.full(len(points), np.inf)
    pairs = paired(points)
    for (i, j), across in zip(pairs.body, pairs.way, strict=True):
        for one, other, out in ((i, j, across), (j, i, -across)):
            rise = float(way[one] @ out)
            if rise > 0:
                gap = float((points[other] @ out).min() - foot[one] @ out)
                room[one] = min(room[one], max(gap, 0.0) / rise)
    if lying.ground is None:
        sinks = way[:, 1] < 0
        room[sinks] = np.minimum(room[sinks], foot[sinks, 1] / -way[sinks, 1])
        return room
    about = foot - np.array([0.0, lying.ground.height, 0.0])
    along = np.einsum("bk,bk->b", about, way)
    inside = np.maximum(lying.ground.radius**2 - np.einsum("bk,bk->b", about, about), 0.0)
    # above the rim there is no bowl
    out = -along + np.sqrt(along**2 + inside)
    hits = foot[:, 1] + out * way[:, 1] < lying.ground.height
    room[hits] = np.minimum(room[hits], out[hits])
    return room


def overlap(points: Floats, lying: Lying) -> float:
    """Return a bound of how deep surfaces (b, v, 3) are in each other, in the floor or the bowl [r1]; 0 if apart.

    Two bodies overlap by no more than along any way between them.
    """
    pairs = paired(points)
    deepest = 0.0
    for (i, j), way in zip(pairs.body, pairs.way, strict=True):
        deepest = max(deepest, float((points[i] @ way).max() - (points[j] @ way).min()))
    if lying.ground is None:
        return max(deepest, float(-points[..., 1].min()))
    far = np.linalg.norm(points - np.array([0.0, lying.ground.height, 0.0]), axis=2)
    return max(deepest, float(far.max()) - lying.ground.radius)
