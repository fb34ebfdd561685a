"""How much of its real mass a fragment keeps while something touches it: the longer step must bear the contact."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..contact.shapes import apart
from ..model.arrays import Bodies, Poses, Rods
from ..model.fragments import Fragments

__all__ = ["steady"]

#: How near a body an edge touches it, over the edge's length.
_NEAR = 0.05
#: A fragment that is pushed off its middle turns, too: it is up to so many times as light there.
_LIGHTER = 8.0


@njit(cache=True, error_model="numpy")
def steady(
    x: np.ndarray,
    v: np.ndarray,
    rods: Rods,
    bodies: Bodies,
    poses: Poses,
    mass: np.ndarray,
    pair: np.ndarray,
    parts: Fragments,
    span: float,
    light: np.ndarray,
) -> None:
    """Set every g by the edges that may touch within `span` [s]: bodies or, if listed in pair (p, 2), other fragments'.

    light (v,) gets the mass [kg] that friction may stop at once: each touching edge has its share of a fragment's.
    """
    if len(parts.gain) == 0:
        return
    fast = 0.0
    for i in range(len(v)):
        fast = max(fast, v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1] + v[i, 2] * v[i, 2])
    way = np.sqrt(fast)
    for r in range(len(bodies.kind)):
        speed, swept = poses.speed[r], 0.0
        if bodies.turned[r] == 1:
            arm = 2.0 * np.sqrt((poses.box[r] ** 2).sum()) + np.sqrt((bodies.ways.pivot[r] ** 2).sum())
            swept = arm * np.sqrt((poses.spin[r] ** 2).sum())
        way = max(way, np.sqrt(fast) + np.sqrt(speed[0] ** 2 + speed[1] ** 2 + speed[2] ** 2) + swept)
    touching = np.zeros(len(parts.gain))
    for e in range(len(rods.a)):
        if rods.k[e] == 0.0:
            continue
        a = rods.a[e]
        b = rods.b[e]
        near = _NEAR * rods.rest[e] + way * span
        for r in range(len(bodies.kind)):
            found = True
            for c in range(3):
                p = x[a, c] - poses.centre[r, c]
                found = found and not apart(p, x[b, c] - x[a, c], poses.box[r, c] + near)
            if found:
                touching[parts.of[a]] += 1.0
                # the feet of a cut edge's stubs may be of two fragments
                if parts.of[b] != parts.of[a]:
                    touching[parts.of[b]] += 1.0
    for q in range(len(pair)):
        n = parts.of[rods.a[pair[q, 0]]]
        m = parts.of[rods.a[pair[q, 1]]]
        if n != m:
            touching[n] += 1.0
            touching[m] += 1.0
    for n in range(len(parts.gain)):
        if parts.heavy[n] > 0.0:
            most = parts.heavy[n] / max(parts.law[1] * touching[n], 1e-300)
            parts.gain[n] = min(max(most, 1.0), parts.law[0])
    for i in range(len(x)):
        n = parts.of[i]
        whole = parts.heavy[n] / (parts.gain[n] * _LIGHTER * max(touching[n], 1.0))
        light[i] = min(mass[i], whole) if parts.heavy[n] > 0.0 else mass[i]
