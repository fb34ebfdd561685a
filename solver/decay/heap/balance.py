"""The shape that a whole heap settles to: all bodies and all contacts in one equilibrium, by Newton's method.

The planes between bodies are no unknowns: for any shape they lie where both sides push alike, so that the energy's
slope is that of planes held where they are, and its curvature less by a term of rank one for each pair. Conjugate
gradients with each point's own block and the rigid motions of each body as a coarse space: a fruit that lies loosely
on others moves as a whole more easily than it bends. A small inertia, from step to step and downwards alone, keeps a
body that nothing carries from falling without end in one step; it is gone where the steps end.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Bools, Floats, Ints
from ...linalg.krylov import times
from ..body.equilibrium import Rest
from ..body.material import Blocks, energy, forces, hessian
from ..body.newton import Ways, descended, scales, shortened
from .linear import Ahead, Ranks, coarse, solved
from .lying import Ground
from .touching import Pairs, planes

__all__ = ["Loaded", "Met", "Settled", "settled"]

#: Newton steps, changes of contacts within one, halvings of a step, iterations of the linear solver.
_STEPS, _CHANGES, _HALVINGS, _ITERATIONS = 120, 20, 30, 250
#: How far a body falls in one step at most, about [r1].
_FALL = 0.15
#: Round-off of the energy, over the energy of a strain of 1.
_ROUND_OFF = 1e-13


_ADVICE = "Make the flesh firmer, let the rot take less length (rot_collapse), or ask for earlier stages."


class Loaded(NamedTuple):
    """What acts on the points of all bodies, one body after the other (b * p).

    weight [Pa r1^2]; contact: stiffness of floor and neighbours [Pa r1]; tether [Pa r1]: springs that hold points
    sideways to the places `held` (b * p, 3). skin (s): numbers of a body's points on its surface. ground: the bowl.
    """

    weight: Floats
    contact: Floats
    tether: Floats
    held: Floats
    skin: Ints
    bodies: int
    pairs: Pairs
    ground: Ground | None


class Met(NamedTuple):
    """Contacts of a shape: places of the planes (c) and pushes (c); depth below the ground (b * p) and way out."""

    place: Floats
    push: Floats
    depth: Floats
    out: Floats


class Settled(NamedTuple):
    """A settled heap: points (b * p, 3), out-of-balance force over the forces in it, steps, least J, its contacts."""

    points: Floats
    residual: float
    steps: int
    least_jacobian: float
    met: Met


def met(x: Floats, loads: Loaded) -> Met:
    """Return the contacts of points (b * p, 3)."""
    skins = _skins(x, loads)
    body, way = loads.pairs
    ahead = np.einsum("csk,ck->cs", skins[body[:, 0]], way)
    behind = np.einsum("csk,ck->cs", skins[body[:, 1]], way)
    place, push = np.empty(len(way)), np.empty(len(way))
    planes(ahead, behind, _stiff(loads), body[:, 0].copy(), body[:, 1].copy(), place, push)
    return Met(place, push, *_grounded(x, loads.ground))


def _grounded(x: Floats, ground: Ground | None) -> tuple[Floats, Floats]:
    """Return how deep points are in floor or bowl (n), and unit ways out (n, 3)."""
    if ground is None:
        out = np.zeros_like(x)
        out[:, 1] = 1.0
        return np.maximum(-x[:, 1], 0.0), out
    away = np.array([0.0, ground.height, 0.0]) - x
    far = np.linalg.norm(away, axis=1)
    return np.maximum(far - ground.radius, 0.0), away / np.maximum(far, 1e-300)[:, None]


def _skins(x: Floats, loads: Loaded) -> Floats:
    return x.reshape(loads.bodies, -1, 3)[:, loads.skin]


def _stiff(loads: Loaded) -> Floats:
    return np.ascontiguousarray(loads.contact.reshape(loads.bodies, -1)[:, loads.skin])


class _Linear(NamedTuple):
    """Contacts as they are linearly: which points (m) lean on which pair (m), on which side (m: 1 or -1)."""

    point: Ints
    pair: Ints
    side: Floats


def _leaning(x: Floats, loads: Loaded, found: Met) -> _Linear:
    skins, (body, way) = _skins(x, loads), loads.pairs
    size = x.shape[0] // loads.bodies
    parts = []
    for column, side in ((0, 1.0), (1, -1.0)):
        above = np.einsum("csk,ck->cs", skins[body[:, column]], way) - found.place[:, None]
        pair, at = np.nonzero((side * above > 0) & (found.push > 0)[:, None])
        parts.append((body[pair, column] * size + loads.skin[at], pair, np.full(len(pair), side)))
    return _Linear(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _potential(x: Floats, rest: Rest, loads: Loaded) -> float:
    found = met(x, loads)
    lean = _leaning(x, loads, found)
    deep = _depth(x, loads, found, lean)
    aside = (x - loads.held)[:, ::2]
    return (
        energy(x, *rest)
        + float(np.sum(loads.weight * x[:, 1]))
        + float(np.sum(loads.contact * found.depth**2)) / 2
        + float(np.sum(loads.contact[lean.point] * deep**2)) / 2
        + float(np.sum(loads.tether[:, None] * aside**2)) / 2
    )


def _depth(x: Floats, loads: Loaded, found: Met, lean: _Linear) -> Floats:
    way = loads.pairs.way[lean.pair]
    deep: Floats = lean.side * (np.einsum("mk,mk->m", x[lean.point], way) - found.place[lean.pair])
    return deep


def _slope(x: Floats, rest: Rest, loads: Loaded) -> tuple[Floats, Floats, float, Met, _Linear]:
    """Return gradient (n, 3), sizes of the forces in it (n), least J and the contacts."""
    g, scale = np.zeros_like(x), np.zeros(len(x))
    least = float(forces(x, *rest, g, scale))
    g[:, 1] += loads.weight
    g[:, ::2] += loads.tether[:, None] * (x - loads.held)[:, ::2]
    found = met(x, loads)
    up = loads.contact * found.depth
    g -= up[:, None] * found.out
    scale += loads.weight + up
    lean = _leaning(x, loads, found)
    push = loads.contact[lean.point] * _depth(x, loads, found, lean)
    np.add.at(g, lean.point, (push * lean.side)[:, None] * loads.pairs.way[lean.pair])
    np.add.at(scale, lean.point, push)
    return g, scale, least, found, lean


def settled(
    start: Floats,
    rest: Rest,
    loads: Loaded,
    pattern: Blocks,
    tolerance: float,
    watch: Callable[[], None] = lambda: None,
) -> Settled:
    """Return the equilibrium that is reached from points `start` (n, 3), none of whose tetrahedra may be inverted.

    Raises:
        NotConverged: no step lowers the energy any more, or there were too many.

    """
    nothing, slack = scales(rest.mu, rest.volume, len(start), _ROUND_OFF)
    inertia = loads.weight / _FALL

    def slope(x: Floats) -> tuple[Floats, float, Any]:
        g, scale, least, found, lean = _slope(x, rest, loads)
        residual = float(np.linalg.norm(g) / (np.linalg.norm(scale) + nothing))
        return g, max(residual, _uncarried(g, loads)), (least, found, lean)

    def direction(x: Floats, g: Floats, said: Any, asked: float) -> Floats:
        _, found, lean = said
        return _direction(x, g, rest, loads, pattern, found, lean, inertia, asked)

    ways = Ways(lambda x: _potential(x, rest, loads), slope, direction)
    rested = descended(start, ways, tolerance, _STEPS, slack, ("heap", "heap"), _ADVICE, watch, _HALVINGS)
    least, found, _ = rested.said
    return Settled(rested.points, rested.residual, rested.steps, least, found)


def _uncarried(g: Floats, loads: Loaded) -> float:
    """Return the largest share of a body's weight that nothing carries."""
    left = np.abs(g[:, 1].reshape(loads.bodies, -1).sum(axis=1))
    return float((left / loads.weight.reshape(loads.bodies, -1).sum(axis=1)).max())


def _direction(
    x: Floats,
    g: Floats,
    rest: Rest,
    loads: Loaded,
    pattern: Blocks,
    found: Met,
    lean: _Linear,
    inertia: Floats,
    asked: float,
) -> Floats:
    """Return Newton's direction (n, 3): contacts that a step would make or break are made or broken in it."""
    for cut in (False, True):
        a = np.zeros((len(pattern.indices), 3, 3))
        hessian(x, *rest, pattern.slot, a, cut)
        own = a[pattern.diagonal]
        own[:, 0, 0] += loads.tether
        own[:, 2, 2] += loads.tether
        own[:, 1, 1] += inertia
        # the slope without contacts; those of the step are added as they are in it
        plain = g + (loads.contact * found.depth)[:, None] * found.out
        push = loads.contact[lean.point] * _depth(x, loads, found, lean)
        np.subtract.at(plain, lean.point, (push * lean.side)[:, None] * loads.pairs.way[lean.pair])
        d, bent, upwards = np.zeros_like(x), np.zeros_like(x), True
        now, touching = lean, found.depth > 0
        for _ in range(_CHANGES):
            system = _System(x, a, own, loads, pattern, found, now, touching)
            more, upwards = system.solve(-plain + system.right, d, asked)
            if not upwards:
                break
            more -= d
            straight = system.without(more)
            gain, bend = float(np.sum((plain + bent) * more)), float(np.sum(more * straight)) / 2
            # the model is convex: with its own contacts at d this leads down, if only a part of the way
            part = shortened(partial(_along, x, d, more, found, loads), gain, bend)
            d += part * more
            bent += part * straight
            then = met(x + d, loads)
            sided, deep = _leaning(x + d, loads, then), _linear_depth(x, loads.ground) > _way_out(d, found)
            if part == 1.0 and _alike(now, sided) and bool((deep == touching).all()):
                break
            now, touching = sided, deep
        if upwards:
            return d
    return d if float(np.sum(d * g)) < 0 else -g / np.maximum(own[:, [0, 1, 2], [0, 1, 2]], 1e-300)


def _way_out(d: Floats, found: Met) -> Floats:
    out: Floats = np.einsum("nk,nk->n", found.out, d)
    return out


def _pressed(y: Floats, x: Floats, found: Met, loads: Loaded) -> float:
    """Return the contacts' potential of points y (n, 3) about x, where the ground is flat as it was seen from there."""
    there = met(y, loads)
    lean = _leaning(y, loads, there)
    deep = _depth(y, loads, there, lean)
    below = np.maximum(_linear_depth(x, loads.ground) - _way_out(y - x, found), 0.0)
    return float(np.sum(loads.contact * below**2) + np.sum(loads.contact[lean.point] * deep**2)) / 2


def _along(x: Floats, d: Floats, more: Floats, found: Met, loads: Loaded, part: float) -> float:
    return _pressed(x + d + part * more, x, found, loads)


def _alike(one: _Linear, other: _Linear) -> bool:
    return len(one.point) == len(other.point) and bool(
        (one.point == other.point).all() and (one.pair == other.pair).all()
    )


class _System:
    """Newton's equations with given contacts: blocks, one term of rank one for each pair, and how to solve them."""

    def __init__(
        self,
        x: Floats,
        a: Floats,
        own: Floats,
        loads: Loaded,
        pattern: Blocks,
        found: Met,
        lean: _Linear,
        touching: Bools,
    ) -> None:
        self._a, self._pattern = a, pattern
        way = loads.pairs.way[lean.pair] * lean.side[:, None]
        stiff = loads.contact[lean.point]
        ground = np.where(touching, loads.contact, 0.0)
        blocks = own + ground[:, None, None] * found.out[:, :, None] * found.out[:, None, :]
        np.add.at(blocks, lean.point, stiff[:, None, None] * way[:, :, None] * way[:, None, :])
        a[pattern.diagonal] = blocks
        # linear contacts: a plane goes where its own points push it alike
        count = len(loads.pairs.way)
        total: Floats = np.bincount(lean.pair, stiff, count).astype(float)
        heights = np.einsum("mk,mk->m", x[lean.point], loads.pairs.way[lean.pair])
        place = np.bincount(lean.pair, stiff * heights, count) / np.maximum(total, 1e-300)
        deep = lean.side * (heights - place[lean.pair])
        # depth below the ground as it is linearly, negative above it
        below = _linear_depth(x, loads.ground)
        self.right = (ground * below)[:, None] * found.out
        np.subtract.at(self.right, lean.point, (stiff * deep)[:, None] * way)
        self._ranks = Ranks(lean.point, lean.pair, stiff, loads.pairs.way[lean.pair], total)
        self._touched = blocks - own
        per = x.reshape(loads.bodies, -1, 3)
        about: Floats = (per - per.mean(axis=1, keepdims=True)).reshape(-1, 3)
        springs = ground[:, None, None] * found.out[:, :, None] * found.out[:, None, :]
        springs[:, 0, 0] += loads.tether
        springs[:, 2, 2] += loads.tether
        springs[:, 1, 1] += loads.weight / _FALL
        square = coarse(springs, about, loads.bodies, *self._ranks, loads.pairs.body)
        square[np.diag_indices(len(square))] *= 1 + 1e-9
        inverse, rigid = (np.asarray(np.linalg.inv(m), np.float64) for m in (blocks, square))
        self._ahead = Ahead(inverse, rigid, about, loads.bodies)

    def solve(self, b: Floats, start: Floats, tolerance: float) -> tuple[Floats, bool]:
        """Return x (n, 3) with A x = b from a start, and whether A curved upwards in all directions met."""
        rows = self._pattern.indptr, self._pattern.indices, self._a
        return solved(*rows, self._ranks, self._ahead, b, start, tolerance, _ITERATIONS)

    def without(self, p: Floats) -> Floats:
        """Return A p (n, 3) without the contacts in it."""
        y = times(self._pattern.indptr, self._pattern.indices, self._a, p)
        found: Floats = y - (self._touched @ p[:, :, None])[:, :, 0]
        return found


def _linear_depth(x: Floats, ground: Ground | None) -> Floats:
    if ground is None:
        return -x[:, 1]
    away: Floats = np.linalg.norm(x - np.array([0.0, ground.height, 0.0]), axis=1) - ground.radius
    return away
