"""The shape a body settles to under its weight on a floor: Newton's method with conjugate gradients.

The floor is the plane y = `floor`, without friction: a one-sided quadratic penalty. A fruit alone on such a plane would
slide and roll away at a touch, so its core is held by weak springs, sideways only: the floor carries all the weight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...contract import NotConverged
from .material import Blocks, energy, forces, hessian, inverse_edges
from .sparse import solve, times

__all__ = ["Balance", "Loads", "Rest", "rested", "settle"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: Newton steps and halvings of a step before giving up; iterations of the linear solver in one step.
_STEPS, _HALVINGS, _ITERATIONS = 200, 40, 400
#: Changes of which points touch the floor, in one direction.
_CONTACTS = 20
#: Strains below this count as none: a body at rest has no forces to measure its residual by.
_NOTHING = 1e-6
#: Round-off of the energy, over the energy of a strain of 1.
_ROUND_OFF = 1e-14


class Rest(NamedTuple):
    """A rest shape: inverse edges (t, 3, 3) [1/r1], volumes (t) [r1^3] and Lame constants (t) [Pa]."""

    tets: Index
    inverse: Array
    volume: Array
    mu: Array
    lam: Array


class Loads(NamedTuple):
    """What acts on the points: weight (p) [Pa r1^2]; a floor at a height with the contact's stiffness (p) [Pa r1].

    tether (p) [Pa r1]: springs that hold points sideways to the places `held` (p, 3). Without a floor: None.
    """

    weight: Array
    floor: float | None
    contact: Array
    tether: Array
    held: Array


class Balance(NamedTuple):
    """A settled shape: points, out-of-balance force over the forces in it, Newton steps, least J, floor's force.

    even: length of a cube as large as the rest shape, over the fresh one.
    """

    points: Array
    residual: float
    steps: int
    least_jacobian: float
    reaction: float
    even: float = 1.0


def rested(points: Array, tets: Index, shrinkage: Array, young: Array, poisson: float) -> Rest:
    """Return the rest shape of tetrahedra whose lengths have shrunk to a share (t), with Young's moduli (t) [Pa]."""
    inverse = inverse_edges(points, tets)
    volume = shrinkage**3 / (6 * np.linalg.det(inverse))
    mu = young / (2 * (1 + poisson))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    return Rest(tets, inverse / shrinkage[:, None, None], volume, mu, lam)


def settle(
    start: Array,
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
    x = start.copy()
    x[:, 1] += _drop(x, loads)
    nothing = _NOTHING * float(np.mean(rest.mu)) * float(np.mean(rest.volume)) ** (2 / 3) * len(x) ** 0.5
    slack = _ROUND_OFF * float(np.sum(rest.mu * rest.volume))
    now = _potential(x, rest, loads)
    if not np.isfinite(now):
        raise NotConverged("the shape to start from is inverted.", advice="Ask for stages closer together.")
    residual = np.inf
    for step in range(_STEPS):
        watch()
        g, scale, least, reaction = _slope(x, rest, loads)
        before, residual = residual, float(np.linalg.norm(g) / (np.linalg.norm(scale) + nothing))
        if loads.floor is not None:
            # stresses within a body can dwarf its weight, which must be carried all the same
            weight = float(np.sum(loads.weight))
            residual = max(residual, abs(weight - reaction) / weight)
        if residual <= tolerance:
            return Balance(x, residual, step, least, reaction)
        # a rough direction is enough far from the end (Eisenstat and Walker)
        asked = min(0.1, max(0.5 * residual / max(before, residual), 0.3 * tolerance / residual, 1e-6))
        d = _direction(x, rest, loads, pattern, asked)
        down = float(np.sum(g * d))
        share = 1.0
        for _ in range(_HALVINGS):
            then = _potential(x + share * d, rest, loads)
            # the last digits of the energy decide nothing: there the step is taken as it is
            if then <= now + 1e-4 * share * down + slack:
                break
            share /= 2
        else:
            break
        x += share * d
        # the best height is known, and a body that has left the floor knows no other way back
        x[:, 1] += _drop(x, loads)
        now = _potential(x, rest, loads)
    raise NotConverged(
        f"the body stopped at a residual of {residual:.1e}.",
        residual=residual,
        advice="Make the flesh firmer, let the rot take less length (rot_collapse), or ask for stages closer together.",
    )


def _direction(x: Array, rest: Rest, loads: Loads, pattern: Blocks, asked: float) -> Array:
    """Return Newton's direction (p, 3); that of the cut Hessian where the exact one does not curve upwards.

    The floor is no part of the quadratic model but kept as it is: which points it carries is found in each direction
    by solves that start from the last one. A model of today's contacts alone would take a new one in each step.
    """
    g, *_ = _slope(x, rest, loads._replace(contact=np.zeros_like(loads.contact)))
    for cut in (False, True):
        a = np.zeros((len(pattern.near), 3, 3))
        hessian(x, *rest, pattern.slot, a, cut)
        own = a[pattern.own]
        own[:, 0, 0] += loads.tether
        own[:, 2, 2] += loads.tether
        d, upwards = _carried(x, g, a, own, loads, pattern, asked)
        if upwards:
            break
    return d


def _carried(
    x: Array, g: Array, a: Array, own: Array, loads: Loads, pattern: Blocks, asked: float
) -> tuple[Array, bool]:
    """Return the least of the model g.d + d.a d / 2 and the floor's potential, and whether `a` curved upwards.

    own: the diagonal blocks of `a`, which are written to it with the contacts' stiffness.
    """
    d = np.zeros_like(x)
    touching = _below(x, loads) > 0
    first = 0.0
    for _ in range(_CONTACTS):
        stiff = np.where(touching, loads.contact, 0.0)
        a[pattern.own] = own
        a[pattern.own, 1, 1] += stiff
        right = -g
        right[:, 1] += stiff * ((0.0 if loads.floor is None else loads.floor) - x[:, 1])
        right -= times(pattern.start, pattern.near, a, d)
        size = float(np.linalg.norm(right))
        first = first or size
        if size <= asked * first:
            break
        more, _, upwards = solve(
            pattern.start, pattern.near, pattern.own, a, right, min(asked * first / size, 0.3), _ITERATIONS
        )
        d += more
        if not upwards:
            return d, False
        before, touching = touching, _below(x + d, loads) > 0
        if loads.floor is None or not touching.any() or bool((touching == before).all()):
            break
    return d, True


def _drop(x: Array, loads: Loads) -> float:
    """Return how far to lift points so that the floor carries a rigid body of their shape: then some always touch."""
    if loads.floor is None:
        return 0.0
    weight = float(loads.weight.sum())
    high = loads.floor - float(x[loads.contact > 0, 1].min())
    low = high - weight / float(loads.contact[loads.contact > 0].min())
    for _ in range(60):
        middle = (low + high) / 2
        depth = np.maximum(loads.floor - x[:, 1] - middle, 0.0)
        low, high = (middle, high) if float(np.sum(loads.contact * depth)) > weight else (low, middle)
    return (low + high) / 2


def _below(x: Array, loads: Loads) -> Array:
    return np.zeros(len(x)) if loads.floor is None else np.maximum(loads.floor - x[:, 1], 0.0)


def _potential(x: Array, rest: Rest, loads: Loads) -> float:
    aside = (x - loads.held)[:, ::2]
    return (
        energy(x, *rest)
        + float(np.sum(loads.weight * x[:, 1]))
        + float(np.sum(loads.contact * _below(x, loads) ** 2)) / 2
        + float(np.sum(loads.tether[:, None] * aside**2)) / 2
    )


def _slope(x: Array, rest: Rest, loads: Loads) -> tuple[Array, Array, float, float]:
    """Return gradient (p, 3), sizes of the forces in it (p), least J and the floor's force."""
    g, scale = np.zeros_like(x), np.zeros(len(x))
    least = forces(x, *rest, g, scale)
    up = loads.contact * _below(x, loads)
    g[:, 1] += loads.weight - up
    g[:, ::2] += loads.tether[:, None] * (x - loads.held)[:, ::2]
    return g, scale + loads.weight + up, float(least), float(np.sum(up))
