"""Twist and curved rest shapes: material frames on edges, carried by time-parallel transport (Bergou et al. 2010).

Every edge has a reference director d (across its tangent) and an angle theta from it to the material frame. A step
carries d without spinning; what the frames of neighbours have turned against each other meanwhile is the reference
twist, kept continuous through whole turns. E = alpha |kappa - kappa0|^2 / span + beta (theta1 - theta0 + ref - tau0)^2
/ span; gradients as in sec. 4.2.2 and 7.1 of that paper.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Rods, Turns

__all__ = ["carry", "turn", "twists"]

_FLAT = 1e-9


@njit(cache=True, error_model="numpy")
def _dot(a: np.ndarray, b: np.ndarray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy")
def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@njit(cache=True, error_model="numpy")
def _moved(d: np.ndarray, old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return d (3,) turned by the least rotation that takes the unit vector old to new."""
    axis = _cross(old, new)
    more = max(1.0 + _dot(old, new), _FLAT)
    return d * _dot(old, new) + _cross(axis, d) + axis * (_dot(axis, d) / more)


@njit(cache=True, error_model="numpy")
def carry(d: np.ndarray, old: np.ndarray, t: np.ndarray, rods: Rods) -> None:
    """Carry the directors d (e, 3) from the tangents `old` (e, 3) to `t` (e, 3), which becomes the new `old`."""
    for e in range(len(rods.a)):
        if rods.alive[e] == 0:
            continue
        moved = _moved(d[e], old[e], t[e])
        moved -= t[e] * _dot(moved, t[e])
        d[e] = moved / np.sqrt(_dot(moved, moved))
        old[e] = t[e]


@njit(cache=True, error_model="numpy")
def twists(d: np.ndarray, t: np.ndarray, rods: Rods, reference: np.ndarray) -> None:
    """Update the reference twist (h,) [radian]: the angle between neighbouring directors, nearest to its last value."""
    for h in range(len(rods.before)):
        if rods.whole[h] == 0:
            continue
        p = rods.before[h]
        q = rods.after[h]
        u = _moved(d[p], t[p], t[q])
        angle = np.arctan2(_dot(t[q], _cross(u, d[q])), _dot(u, d[q]))
        reference[h] = angle + 2.0 * np.pi * np.round((reference[h] - angle) / (2.0 * np.pi))


@njit(cache=True, error_model="numpy")
def turn(
    f: np.ndarray,
    torque: np.ndarray,
    rods: Rods,
    turns: Turns,
    t: np.ndarray,
    inverse: np.ndarray,
    d: np.ndarray,
    theta: np.ndarray,
    reference: np.ndarray,
) -> float:
    """Add forces of bending and twist to f (v, 3) [N] and torque (e,) [N m]; return their energy [J]."""
    energy = 0.0
    for h in range(len(rods.before)):
        if rods.whole[h] == 0:
            continue
        p = rods.before[h]
        q = rods.after[h]
        u = t[p]
        w = t[q]
        up = _cross(u, d[p])
        wq = _cross(w, d[q])
        cp = np.cos(theta[p])
        sp = np.sin(theta[p])
        cq = np.cos(theta[q])
        sq = np.sin(theta[q])
        p1 = cp * d[p] + sp * up
        p2 = cp * up - sp * d[p]
        q1 = cq * d[q] + sq * wq
        q2 = cq * wq - sq * d[q]
        more = max(1.0 + _dot(u, w), _FLAT)
        kb = _cross(u, w) * (2.0 / more)
        k1 = 0.5 * (_dot(p2, kb) + _dot(q2, kb))
        k2 = -0.5 * (_dot(p1, kb) + _dot(q1, kb))
        o1 = k1 - turns.kappa[h, 0]
        o2 = k2 - turns.kappa[h, 1]
        stiff = rods.alpha[h] / rods.span[h]
        tight = turns.beta[h] / rods.span[h]
        tau = theta[q] - theta[p] + reference[h] - turns.tau[h]
        energy += stiff * (o1 * o1 + o2 * o2) + tight * tau * tau
        w1 = 2.0 * stiff * o1
        w2 = 2.0 * stiff * o2
        wt = 2.0 * tight * tau
        mean = (u + w) / more
        m1 = (p1 + q1) / more
        m2 = (p2 + q2) / more
        common = mean * (-w1 * k1 - w2 * k2)
        half = kb * (0.5 * wt)
        gp = (common + _cross(w, m2 * w1 - m1 * w2) + half) * inverse[p]
        gq = (common - _cross(u, m2 * w1 - m1 * w2) + half) * inverse[q]
        torque[p] += 0.5 * (w1 * _dot(kb, p1) + w2 * _dot(kb, p2)) + wt
        torque[q] += 0.5 * (w1 * _dot(kb, q1) + w2 * _dot(kb, q2)) - wt
        a = rods.a[p]
        m = rods.a[q]
        b = rods.b[q]
        for c in range(3):
            f[a, c] += gp[c]
            f[m, c] += gq[c] - gp[c]
            f[b, c] -= gq[c]
    return energy
