"""The paper's body: masses on springs along the tetrahedra's edges, swung by Runge and Kutta's fourth-order rule.

Kider et al. 2011, 4.1: stiffness is firmness, rest lengths lose what Eq. 1 takes, steps are of 6 ms. A network that
fills a volume V with springs k of length L is as stiff as a solid of Young's modulus E (and Poisson's ratio 1/4) where
the sum of k L^2 / V is 6 E: each tetrahedron gives E V / L^2 to its six edges. Swings of frequency w are stable for
steps below sqrt(8) / w; the stiffest one is known before the first step. Nothing keeps a tetrahedron from inverting.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numba import njit
from scipy import sparse
from scipy.sparse.linalg import eigsh

from ...arrays import Floats, Ints
from ...contract import Unstable
from .equilibrium import Balance
from .flesh import SHORTEST, Softened, Swing
from .loads import Loads, pushes
from .solid import Solid, volumes

__all__ = ["Network", "knit", "longest_step", "slower", "swing", "swung"]


#: RK4 is stable on the imaginary axis up to this.
_LIMIT = 8**0.5
#: Steps between two looks at whether it is still wanted, and finite.
_BATCH = 200


@dataclass(frozen=True, eq=False)
class Network:
    """Springs between points `ends` (e, 2) of rest length (e) [r1] and stiffness (e) [Pa r1].

    mass (p) [Pa s2 r1]: force over it is r1 per second squared.
    """

    ends: Ints
    length: Floats
    stiffness: Floats
    mass: Floats


def knit(solid: Solid, state: Softened, inertia: float) -> Network:
    """Return the network of a softened body; inertia: density times r1^2 [Pa s2]."""
    pairs = np.concatenate([solid.tets[:, pair] for pair in combinations(range(4), 2)])
    ends, back = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    back = back.ravel()
    fresh = np.linalg.norm(solid.points[ends[:, 0]] - solid.points[ends[:, 1]], axis=1)
    share = np.tile(solid.volume, 6)
    length = fresh * np.bincount(back, share * np.tile(state.shrinkage, 6)) / np.bincount(back, share)
    stiffness = np.bincount(back, share * np.tile(state.young, 6)) / fresh**2
    mass = np.bincount(solid.tets.ravel(), np.repeat(solid.volume * state.mass / 4, 4), len(solid.points))
    return Network(ends, length, stiffness, np.asarray(inertia * mass, dtype=np.float64))


def longest_step(x: Floats, network: Network, loads: Loads) -> float:
    """Return the longest stable step [s] about points x (p, 3), every contact and tether counted."""
    i, j = network.ends.T
    along = x[j] - x[i]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    block = network.stiffness[:, None, None] * along[:, :, None] * along[:, None, :]
    own = np.zeros((len(x), 3, 3))
    np.add.at(own, i, block)
    np.add.at(own, j, block)
    own[:, 1, 1] += loads.contact
    own[:, 0, 0] += loads.tether
    own[:, 2, 2] += loads.tether
    if len(loads.balls):
        own += loads.contact[:, None, None] * np.eye(3)  # from any side
    every = np.arange(len(x))
    rows, columns = np.concatenate([every, i, j]), np.concatenate([every, j, i])
    values = np.concatenate([own, -block, -block])
    root = 1 / np.sqrt(network.mass)
    values *= (root[rows] * root[columns])[:, None, None]
    at = 3 * rows[:, None, None] + np.arange(3)[:, None], 3 * columns[:, None, None] + np.arange(3)
    index = tuple(np.broadcast_to(a, values.shape).ravel() for a in at)
    matrix = sparse.csr_array((values.ravel(), index), shape=(3 * len(x),) * 2)
    largest = eigsh(matrix, 1, which="LA", tol=1e-4, v0=np.ones(3 * len(x)), return_eigenvectors=False)
    return float(_LIMIT / np.sqrt(largest[0]))


def slower(rule: Swing, limit: float) -> str:
    """Return what to set where steps are too long, as it can be typed; limit: the longest step [s]."""
    # two digits: one might be rounded up to beyond the limit
    step, softer = float(f"{0.9 * limit:.2g}"), math.ceil(1.2 * (rule.step / limit) ** 2)
    ways = [f'swing={{"step":{step:g}}}'] if step >= SHORTEST else []
    return f"Set {' or '.join([*ways, 'body=quasi-static'])}, or give flesh a unit {softer} times as small."


def swung(
    solid: Solid,
    start: Floats,
    network: Network,
    loads: Loads,
    rule: Swing,
    watch: Callable[[], None] = lambda: None,
) -> Balance:
    """Return the body after `rule.seconds` of swinging from rest at points `start` (p, 3).

    Raises:
        Unstable: the step is longer than the longest stable one, or the body blew up.

    """
    limit = longest_step(start, network, loads)
    if rule.step > limit:
        raise Unstable(
            f"steps of {rule.step:.2g} s are longer than {limit:.2g} s, the longest that are stable for this body.",
            advice=slower(rule, limit),
        )
    x, v = start.copy(), np.zeros_like(start)
    left = steps = max(1, round(rule.seconds / rule.step))
    while left > 0:
        watch()
        batch = min(left, _BATCH)
        swing(x, v, network, loads, rule.step, rule.damping, batch)
        left -= batch
        if not np.isfinite(x).all():
            raise Unstable("the springs blew up.", advice=slower(rule, rule.step / 2))
    pull, size = np.zeros_like(x), np.zeros(len(x))
    up = _pull(x, *_arrays(network, loads), pull, size)
    residual = float(np.linalg.norm(pull)) / max(float(np.linalg.norm(size)), 1e-300)
    least = float((volumes(x, solid.tets) / solid.volume).min())
    return Balance(x, residual, steps, least, up, pushes=pushes(x, loads))


def swing(x: Floats, v: Floats, network: Network, loads: Loads, step: float, damping: float, count: int) -> None:
    """Move points x and velocities v (p, 3) on by `count` steps [s]; damping of all motion [1/s]."""
    _march(x, v, *_arrays(network, loads), network.mass, step, damping, count)


def _arrays(
    network: Network, loads: Loads
) -> tuple[Ints, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats]:
    floor = np.full(len(loads.weight), -np.inf) if loads.floor is None else loads.floor
    return (
        *(network.ends, network.length, network.stiffness),
        *(loads.weight, floor, loads.contact, loads.tether, loads.held, loads.balls),
    )


@njit(cache=True)
def _pull(
    x: Floats,
    ends: Ints,
    length: Floats,
    stiffness: Floats,
    weight: Floats,
    floor: Floats,
    contact: Floats,
    tether: Floats,
    held: Floats,
    balls: Floats,
    pull: Floats,
    size: Floats,
) -> float:
    """Write the forces on points x to pull (p, 3), add the sizes of their shares to size (p); return what carries."""
    total = 0.0
    for i in range(len(x)):
        up = contact[i] * (floor[i] - x[i, 1]) if x[i, 1] < floor[i] else 0.0
        pull[i, 0] = -tether[i] * (x[i, 0] - held[i, 0])
        pull[i, 1] = up - weight[i]
        pull[i, 2] = -tether[i] * (x[i, 2] - held[i, 2])
        size[i] += up + weight[i]
        total += up
        if contact[i] == 0:
            continue
        for b in range(len(balls)):
            ox, oy, oz = x[i, 0] - balls[b, 0], x[i, 1] - balls[b, 1], x[i, 2] - balls[b, 2]
            far = np.sqrt(ox * ox + oy * oy + oz * oz)
            if far >= balls[b, 3] or far == 0:
                continue
            push = contact[i] * (balls[b, 3] - far)
            pull[i, 0] += push / far * ox
            pull[i, 1] += push / far * oy
            pull[i, 2] += push / far * oz
            size[i] += push
            total += push / far * oy
    for e in range(len(ends)):
        i, j = ends[e, 0], ends[e, 1]
        a, b, c = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        now = np.sqrt(a * a + b * b + c * c)
        force = stiffness[e] * (now - length[e])
        size[i] += abs(force)
        size[j] += abs(force)
        force /= now
        pull[i, 0] += force * a
        pull[i, 1] += force * b
        pull[i, 2] += force * c
        pull[j, 0] -= force * a
        pull[j, 1] -= force * b
        pull[j, 2] -= force * c
    return total


@njit(cache=True)
def _march(
    x: Floats,
    v: Floats,
    ends: Ints,
    length: Floats,
    stiffness: Floats,
    weight: Floats,
    floor: Floats,
    contact: Floats,
    tether: Floats,
    held: Floats,
    balls: Floats,
    mass: Floats,
    step: float,
    damping: float,
    count: int,
) -> None:
    many = len(x)
    pull, size = np.zeros((many, 3)), np.zeros(many)
    at, fast = np.empty((many, 3)), np.empty((many, 3))
    way, gain = np.empty((many, 3)), np.empty((many, 3))
    for _ in range(count):
        at[:] = x
        fast[:] = v
        way[:] = 0.0
        gain[:] = 0.0
        for stage in range(4):
            _pull(at, ends, length, stiffness, weight, floor, contact, tether, held, balls, pull, size)
            weighs = 1.0 if stage == 0 or stage == 3 else 2.0
            ahead = step if stage == 2 else step / 2
            for i in range(many):
                for c in range(3):
                    rush = pull[i, c] / mass[i] - damping * fast[i, c]
                    way[i, c] += weighs * fast[i, c]
                    gain[i, c] += weighs * rush
                    at[i, c] = x[i, c] + ahead * fast[i, c]
                    fast[i, c] = v[i, c] + ahead * rush
        for i in range(many):
            for c in range(3):
                x[i, c] += step / 6 * way[i, c]
                v[i, c] += step / 6 * gain[i, c]
