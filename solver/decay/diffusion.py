"""Spreading, Eq. 4 in Eq. 2 and the diffusion in Eq. 9, by Kirchhoff's transform and super-time-stepping.

    du/dt = div(c grad Phi(u)),   Phi(u) = integral of max(D, 0),   D = m u (1 - u/d2)   (Eq. 4 with its parentheses)

Above d2 the printed D is negative: anti-diffusion, which blows up. Phi stays flat there. The coefficient c = n times
noise times gate sits on edges as the harmonic mean of their ends, so nothing enters where it is 0 (the paper: no fungus
where no rot is). Symmetric weights conserve the total to round-off. RKL2 (Meyer, Balsara and Aslam 2014): second order,
stable for dt <= (s^2 + s - 2)/2 over the spectral radius, with s stages.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["listed_around", "rkl2", "stages_for"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def stages_for(dt: float, radius: float) -> int:
    """Return the odd number of RKL2 stages that is stable for a step dt and a spectral radius [1/dt's unit]."""
    # 5 % of room: the radius bounds the start of the step, and densities move within it
    stages = int(np.ceil((np.sqrt(9 + 8 * 1.05 * dt * radius) - 1) / 2))
    return max(3, stages + 1 - stages % 2)


@njit(cache=True)
def listed_around(u: Array, cut: float, rings: int, start: Index, near: Index) -> Index:
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
def _flow(
    y: Array,
    c: Array,
    scale: float,
    cap: float,
    listed: Index,
    on: NDArray[np.bool_],
    start: Index,
    near: Index,
    weight: Array,
    area: Array,
    phi: Array,
    out: Array,
) -> None:
    """Write div(c grad Phi(y)) of the listed vertices to `out`; cap <= 0 stands for the linear Phi = scale y."""
    for i in listed:
        if cap > 0:
            x = min(max(y[i], 0.0), cap)
            phi[i] = scale * x * x * (0.5 - x / (3 * cap))
        else:
            phi[i] = scale * y[i]
    for i in listed:
        total = 0.0
        if c[i] > 0:
            for k in range(start[i], start[i + 1]):
                j = near[k]
                if on[j] and c[j] > 0:
                    total += weight[k] * 2 * c[i] * c[j] / (c[i] + c[j]) * (phi[j] - phi[i])
        out[i] = total / area[i]


@njit(cache=True)
def rkl2(
    y: Array,
    c: Array,
    scale: float,
    cap: float,
    dt: float,
    stages: int,
    listed: Index,
    start: Index,
    near: Index,
    weight: Array,
    area: Array,
) -> None:
    """Advance y by dt in place on the listed vertices; others neither change nor take part.

    What undershoots zero is taken from the rest in proportion, so the total stays.
    """
    count = len(y)
    on = np.zeros(count, np.bool_)
    for i in listed:
        on[i] = True
    phi, flow, first = np.empty(count), np.empty(count), np.empty(count)
    before, last, following = np.empty(count), np.empty(count), np.empty(count)
    w = 4.0 / (stages * stages + stages - 2.0)
    b0 = b1 = 1 / 3
    _flow(y, c, scale, cap, listed, on, start, near, weight, area, phi, first)
    for i in listed:
        before[i] = y[i]
        last[i] = y[i] + b1 * w * dt * first[i]
    for j in range(2, stages + 1):
        b = 1 / 3 if j == 2 else (j * j + j - 2.0) / (2.0 * j * (j + 1))
        mu = (2.0 * j - 1) / j * b / b1
        nu = -(j - 1.0) / j * b / b0
        step = mu * w * dt
        lean = -(1 - b1) * step
        _flow(last, c, scale, cap, listed, on, start, near, weight, area, phi, flow)
        for i in listed:
            following[i] = mu * last[i] + nu * before[i] + (1 - mu - nu) * y[i] + step * flow[i] + lean * first[i]
        before, last, following = last, following, before
        b0, b1 = b1, b
    missing = 0.0
    held = 0.0
    for i in listed:
        y[i] = last[i]
        if y[i] < 0:
            missing -= area[i] * y[i]
            y[i] = 0.0
        else:
            held += area[i] * y[i]
    if missing > 0 and held > missing:
        share = 1 - missing / held
        for i in listed:
            y[i] *= share
