"""The shape a body settles to under its loads: Newton's method with conjugate gradients."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ...linalg.krylov import conjugate_gradients, times
from .flesh import Booked
from .loads import Loads, Touch, below, drop, pushes, touches
from .material import Blocks, energy, forces, hessian, inverse_edges
from .newton import Ways, descended, scales, shortened

__all__ = ["Balance", "Rest", "rested", "settle"]


#: Newton steps before giving up; iterations of the linear solver in one step.
_STEPS, _ITERATIONS = 200, 400
#: Changes of which points touch, in one direction.
_CONTACTS = 20
#: Points this near a neighbour may come to touch it in one step [r1].
_NEAR = 0.3
_ADVICE = "Make the flesh firmer, let the rot take less length (rot_collapse), or ask for stages closer together."
#: Round-off of the energy, over the energy of a strain of 1.
_ROUND_OFF = 1e-14


class Rest(NamedTuple):
    """A rest shape: inverse edges (t, 3, 3) [1/r1], volumes (t) [r1^3] and Lame constants (t) [Pa]."""

    tets: Ints
    inverse: Floats
    volume: Floats
    mu: Floats
    lam: Floats


class Balance(NamedTuple):
    """A settled shape: points, out-of-balance force over the forces in it, Newton steps, least J, what carries it.

    reaction: upward force of floor and neighbours [Pa r1^2]; pushes (b, 3): force of each neighbour.
    even: length of a cube as large as the rest shape, over the fresh one. booked: where the fresh weight is.
    dried: lengths over fresh ones where nothing rots.
    """

    points: Floats
    residual: float
    steps: int
    least_jacobian: float
    reaction: float
    even: float = 1.0
    pushes: Floats = np.empty((0, 3))
    booked: Booked | None = None
    dried: float = 1.0


def rested(points: Floats, tets: Ints, shrinkage: Floats, young: Floats, poisson: float) -> Rest:
    """Return the rest shape of tetrahedra whose lengths have shrunk to a share (t), with Young's moduli (t) [Pa]."""
    inverse = inverse_edges(points, tets)
    volume = shrinkage**3 / (6 * np.linalg.det(inverse))
    mu = young / (2 * (1 + poisson))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    return Rest(tets, inverse / shrinkage[:, None, None], volume, mu, lam)


def settle(
    start: Floats,
    rest: Rest,
    loads: Loads,
    pattern: Blocks,
    tolerance: float,
    watch: Callable[[], None] = lambda: None,
) -> Balance:
    """Return the equilibrium that is reached from points `start` (p, 3), none of whose tetrahedra may be inverted.

    watch: called before each step; may raise to stop.

    Raises:
        NotConverged: no step lowers the energy any more, or there were too many.

    """
    nothing, slack = scales(rest.mu, rest.volume, len(start), _ROUND_OFF)

    def slope(x: Floats) -> tuple[Floats, float, Any]:
        g, scale, least, reaction = _slope(x, rest, loads)
        residual = float(np.linalg.norm(g) / (np.linalg.norm(scale) + nothing))
        if loads.carries:
            # stresses within a body can dwarf its weight, which must be carried all the same
            weight = float(np.sum(loads.weight))
            residual = max(residual, abs(weight - reaction) / weight)
        return g, residual, (least, reaction)

    def placed(x: Floats) -> None:
        x[:, 1] += drop(x, loads)

    ways = Ways(
        lambda x: _potential(x, rest, loads),
        slope,
        lambda x, _g, _said, asked: _direction(x, rest, loads, pattern, asked),
        placed,
    )
    found = descended(start, ways, tolerance, _STEPS, slack, ("body", "shape"), _ADVICE, watch)
    least, reaction = found.said
    return Balance(found.points, found.residual, found.steps, least, reaction, pushes=pushes(found.points, loads))


def _direction(x: Floats, rest: Rest, loads: Loads, pattern: Blocks, asked: float) -> Floats:
    """Return Newton's direction (p, 3); that of the cut Hessian where the exact one does not curve upwards.

    The floor is no part of the quadratic model but kept as it is, and neighbours as the planes that they are near a
    point: which points they carry is found in each direction by solves that start from the last one. A model of today's
    contacts alone would take a new one in each step.
    """
    near = touches(x, loads, _NEAR)
    g, *_ = _slope(x, rest, loads._replace(contact=np.zeros_like(loads.contact)))
    for cut in (False, True):
        a = np.zeros((len(pattern.indices), 3, 3))
        hessian(x, *rest, pattern.slot, a, cut)
        own = a[pattern.diagonal]
        own[:, 0, 0] += loads.tether
        own[:, 2, 2] += loads.tether
        d, upwards = _carried(x, g, a, own, loads, near, pattern, asked)
        if upwards:
            break
    return d


def _carried(
    x: Floats, g: Floats, a: Floats, own: Floats, loads: Loads, near: Touch, pattern: Blocks, asked: float
) -> tuple[Floats, bool]:
    """Return the least of the model g.d + d.a d / 2 and the contacts' potential, and whether `a` curved upwards.

    own: the diagonal blocks of `a`, which are written to it with the contacts' stiffness.
    """
    d, bent = np.zeros_like(x), np.zeros_like(x)
    touching, leaning = below(x, loads) > 0, near.depth > 0
    first = 0.0
    for _ in range(_CONTACTS):
        stiff = np.where(touching, loads.contact, 0.0)
        a[pattern.diagonal] = own
        a[pattern.diagonal, 1, 1] += stiff
        right = -g
        right[:, 1] += stiff * ((0.0 if loads.floor is None else loads.floor) - x[:, 1])
        point, out = near.point[leaning], near.out[leaning]
        hard = loads.contact[point][:, None] * out
        np.add.at(a, pattern.diagonal[point], hard[:, :, None] * out[:, None, :])
        np.add.at(right, point, near.depth[leaning][:, None] * hard)
        right -= times(pattern.indptr, pattern.indices, a, d)
        size = float(np.linalg.norm(right))
        first = first or size
        if size <= asked * first:
            break
        more, _, upwards = conjugate_gradients(
            pattern.indptr, pattern.indices, pattern.diagonal, a, right, min(asked * first / size, 0.3), _ITERATIONS
        )
        if not upwards:
            return d + more, False
        straight = times(pattern.indptr, pattern.indices, a, more)
        straight[:, 1] -= stiff * more[:, 1]
        np.subtract.at(straight, point, np.einsum("ki,ki->k", out, more[point])[:, None] * hard)
        gain, bend = float(np.sum((g + bent) * more)), float(np.sum(more * straight)) / 2
        part = shortened(partial(_along, x, d, more, loads, near), gain, bend)
        d += part * more
        bent += part * straight
        before = np.concatenate([touching, leaning])
        touching = below(x + d, loads) > 0
        leaning = near.depth > np.einsum("ki,ki->k", near.out, d[near.point])
        now = np.concatenate([touching, leaning])
        if not now.any() or bool((now == before).all()):
            break
    return d, True


def _pressed(x: Floats, d: Floats, loads: Loads, near: Touch) -> float:
    """Return the model's potential of floor and neighbours after a move d (p, 3)."""
    deep = np.maximum(near.depth - np.einsum("ki,ki->k", near.out, d[near.point]), 0.0)
    floor = np.sum(loads.contact * below(x + d, loads) ** 2)
    return float(floor + np.sum(loads.contact[near.point] * deep**2)) / 2


def _along(x: Floats, d: Floats, more: Floats, loads: Loads, near: Touch, part: float) -> float:
    return _pressed(x, d + part * more, loads, near)


def _potential(x: Floats, rest: Rest, loads: Loads) -> float:
    aside, near = (x - loads.held)[:, ::2], touches(x, loads)
    return (
        energy(x, *rest)
        + float(np.sum(loads.weight * x[:, 1]))
        + float(np.sum(loads.contact * below(x, loads) ** 2)) / 2
        + float(np.sum(loads.contact[near.point] * near.depth**2)) / 2
        + float(np.sum(loads.tether[:, None] * aside**2)) / 2
    )


def _slope(x: Floats, rest: Rest, loads: Loads) -> tuple[Floats, Floats, float, float]:
    """Return gradient (p, 3), sizes of the forces in it (p), least J and the upward force of what carries it."""
    g, scale = np.zeros_like(x), np.zeros(len(x))
    least = forces(x, *rest, g, scale)
    up = loads.contact * below(x, loads)
    g[:, 1] += loads.weight - up
    g[:, ::2] += loads.tether[:, None] * (x - loads.held)[:, ::2]
    scale += loads.weight + up
    near = touches(x, loads)
    push = loads.contact[near.point] * near.depth
    np.subtract.at(g, near.point, push[:, None] * near.out)
    np.add.at(scale, near.point, push)
    return g, scale, float(least), float(np.sum(up) + np.sum(push * near.out[:, 1]))
