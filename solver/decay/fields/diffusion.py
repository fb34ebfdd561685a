"""Spreading, Eq. 4 in Eq. 2 and the diffusion in Eq. 9, by Kirchhoff's transform and super-time-stepping.

    du/dt = div(c grad Phi(u)),   Phi(u) = integral of max(D, 0),   D = m u (1 - u/d2)   (Eq. 4 with its parentheses)

Above d2 the printed D is negative: anti-diffusion, which blows up. Phi stays flat there. The coefficient c = n times
noise sits on edges as the harmonic mean of their ends, times the gate at their middle, and nothing enters an end where
the gate is 0 (the paper: no fungus where no rot is). Symmetric weights conserve the total to round-off. RKL2 (Meyer,
Balsara and Aslam 2014): second order, stable for dt <= (s^2 + s - 2)/2 over the spectral radius, with s stages.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...arrays import Floats, Ints
from .gate import gate

__all__ = ["Links", "linked", "listed_around", "rkl2", "stages_for"]

Link = NDArray[np.int32]


class Links(NamedTuple):
    """Edges among listed vertices, numbered as in the list: compressed rows, and what each passes to its row.

    share: weight times mean coefficient over the row's area [1/r1^2 times c].
    """

    first: Ints
    to: Link
    share: Floats


def stages_for(dt: float, radius: float) -> int:
    """Return the number of RKL2 stages, odd or 2, that is stable for a step dt and a spectral radius [1/dt's unit]."""
    # 5 % of room: the radius bounds the start of the step, and densities move within it
    load = 1.05 * dt * radius
    if load <= 1:
        return 2  # signs are kept as long
    stages = int(np.ceil((np.sqrt(9 + 8 * load) - 1) / 2))
    return max(3, stages + 1 - stages % 2)


@njit(cache=True)
def listed_around(u: Floats, cut: float, rings: int, start: Ints, near: Ints) -> Ints:
    """Return, in order, the vertices with u > cut and all within so many rings about them."""
    count = len(u)
    ring = np.full(count, -1, np.int64)
    queue = np.empty(count, np.int64)
    tail = 0
    for i in range(count):
        if u[i] > cut:
            ring[i] = 0
            queue[tail] = i
            tail += 1
    head = 0
    while head < tail:
        i = queue[head]
        head += 1
        if ring[i] == rings:
            continue
        for k in range(start[i], start[i + 1]):
            j = near[k]
            if ring[j] < 0:
                ring[j] = ring[i] + 1
                queue[tail] = j
                tail += 1
    return np.flatnonzero(ring >= 0)


@njit(cache=True)
def linked(c: Floats, rot: Floats, listed: Ints, start: Ints, near: Ints, weight: Floats, area: Floats) -> Links:
    """Return the edges among the listed vertices that have a coefficient c > 0 at both ends: its harmonic mean.

    rot (v): map that opens the gate, at both ends and in the middle; without one (empty) there is no gate.
    """
    gated = len(rot) > 0
    place = np.full(len(c), -1, np.int32)
    most = 0
    for here, i in enumerate(listed):
        if c[i] > 0 and not (gated and gate(rot[i]) == 0):
            place[i] = here
            most += start[i + 1] - start[i]
    first, to, share = np.empty(len(listed) + 1, np.int64), np.empty(most, np.int32), np.empty(most)
    count = 0
    for here, i in enumerate(listed):
        first[here] = count
        if place[i] < 0:
            continue
        whole = 2 * c[i] / area[i]
        for k in range(start[i], start[i + 1]):
            j = near[k]
            if place[j] >= 0:
                to[count] = place[j]
                share[count] = whole * weight[k] * c[j] / (c[i] + c[j])
                if gated:
                    share[count] *= gate(0.5 * (rot[i] + rot[j]))
                count += 1
    first[len(listed)] = count
    return Links(first, to, share)


@njit(cache=True, inline="always")
def _potential(y: float, cap: float) -> float:
    """Return Phi(y) / m of one density; cap <= 0 stands for the linear Phi = y."""
    if cap <= 0:
        return y
    x = min(max(y, 0.0), cap)
    return x * x * (0.5 - x / (3 * cap))


@njit(cache=True)
def rkl2(y: Floats, links: Links, scale: float, cap: float, dt: float, stages: int, listed: Ints, area: Floats) -> None:
    """Advance y by dt in place on the listed vertices; others neither change nor take part.

    Phi(y) = scale y^2 (1/2 - y / (3 cap)) up to cap, or scale y if cap <= 0. What undershoots zero is taken from the
    rest in proportion, so the total stays.
    """
    count = len(listed)
    first, to, share = links
    dt *= scale
    y0 = y[listed]
    flow0, before, last = np.empty(count), y0.copy(), np.empty(count)
    phi, following = np.empty(count), np.empty(count)
    for i in range(count):
        phi[i] = _potential(y0[i], cap)
    w = 4.0 / (stages * stages + stages - 2.0)
    b0 = b1 = 1 / 3
    for i in range(count):
        total = 0.0
        for k in range(first[i], first[i + 1]):
            total += share[k] * (phi[to[k]] - phi[i])
        flow0[i] = total
        last[i] = y0[i] + b1 * w * dt * total
        following[i] = _potential(last[i], cap)
    phi, following = following, phi
    for j in range(2, stages + 1):
        b = 1 / 3 if j == 2 else (j * j + j - 2.0) / (2.0 * j * (j + 1))
        mu = (2.0 * j - 1) / j * b / b1
        nu = -(j - 1.0) / j * b / b0
        step = mu * w * dt
        lean = -(1 - b1) * step
        rest = 1 - mu - nu
        for i in range(count):
            total = 0.0
            for k in range(first[i], first[i + 1]):
                total += share[k] * (phi[to[k]] - phi[i])
            # the stage before last is not needed any more
            before[i] = mu * last[i] + nu * before[i] + rest * y0[i] + step * total + lean * flow0[i]
            following[i] = _potential(before[i], cap)
        before, last = last, before
        phi, following = following, phi
        b0, b1 = b1, b
    missing = 0.0
    held = 0.0
    for i in range(count):
        if last[i] < 0:
            missing -= area[listed[i]] * last[i]
            last[i] = 0.0
        else:
            held += area[listed[i]] * last[i]
    left = 1 - missing / held if missing > 0 and held > missing else 1.0
    for i in range(count):
        y[listed[i]] = last[i] * left
