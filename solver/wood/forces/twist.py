"""Twist and curved rest shapes: material frames on edges, carried by time-parallel transport (Bergou et al. 2010).

Every edge has a reference director d (across its tangent) and an angle theta from it to the material frame. A step
carries d without spinning; what the frames of neighbours have turned against each other meanwhile is the reference
twist, kept continuous through whole turns. E = alpha |kappa - kappa0|^2 / span + beta (theta1 - theta0 + ref - tau0)^2
/ span; gradients as in sec. 4.2.2 and 7.1 of that paper.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.arrays import Rods, Turns

__all__ = ["carry", "turn", "twists"]

_FLAT = 1e-9


_Vector = tuple[float, float, float]


@njit(cache=True, error_model="numpy", inline="always")
def _row(a: np.ndarray, n: int) -> _Vector:
    return a[n, 0], a[n, 1], a[n, 2]


@njit(cache=True, error_model="numpy", inline="always")
def _dot(a: _Vector, b: _Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy", inline="always")
def _cross(a: _Vector, b: _Vector) -> _Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy", inline="always")
def _sum(p: float, a: _Vector, q: float, b: _Vector) -> _Vector:
    """Return p a + q b."""
    return p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2]


@njit(cache=True, error_model="numpy")
def _moved(d: _Vector, old: _Vector, new: _Vector) -> _Vector:
    """Return d turned by the least rotation that takes the unit vector old to new."""
    axis = _cross(old, new)
    c = _dot(old, new)
    return _sum(1.0, _sum(c, d, 1.0, _cross(axis, d)), _dot(axis, d) / max(1.0 + c, _FLAT), axis)


@njit(cache=True, error_model="numpy")
def carry(d: np.ndarray, old: np.ndarray, t: np.ndarray, rods: Rods) -> None:
    """Carry the directors d (e, 3) from the tangents `old` (e, 3) to `t` (e, 3), which becomes the new `old`."""
    for e in range(len(rods.a)):
        if rods.alive[e] == 0:
            continue
        now = _row(t, e)
        moved = _moved(_row(d, e), _row(old, e), now)
        # round-off must not tilt it over millions of steps
        moved = _sum(1.0, moved, -_dot(moved, now), now)
        scale = 1.0 / np.sqrt(_dot(moved, moved))
        for c in range(3):
            d[e, c] = moved[c] * scale
            old[e, c] = now[c]


@njit(cache=True, error_model="numpy")
def twists(d: np.ndarray, t: np.ndarray, rods: Rods, reference: np.ndarray) -> None:
    """Update the reference twist (h,) [radian]: the angle between neighbouring directors, nearest to its last value."""
    for h in range(len(rods.before)):
        if rods.whole[h] == 0:
            continue
        p = rods.before[h]
        q = rods.after[h]
        w = _row(t, q)
        u = _moved(_row(d, p), _row(t, p), w)
        own = _row(d, q)
        angle = np.arctan2(_dot(w, _cross(u, own)), _dot(u, own))
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
    bent: np.ndarray,
) -> float:
    """Add forces of bending and twist to f (v, 3) [N] and torque (e,) [N m]; return their energy [J].

    Writes the curvature beyond that at rest to bent (h,) [1/m].
    """
    energy = 0.0
    for h in range(len(rods.before)):
        if rods.whole[h] == 0:
            continue
        p = rods.before[h]
        q = rods.after[h]
        u = _row(t, p)
        w = _row(t, q)
        dp = _row(d, p)
        dq = _row(d, q)
        up = _cross(u, dp)
        wq = _cross(w, dq)
        cp = np.cos(theta[p])
        sp = np.sin(theta[p])
        cq = np.cos(theta[q])
        sq = np.sin(theta[q])
        p1 = _sum(cp, dp, sp, up)
        p2 = _sum(cp, up, -sp, dp)
        q1 = _sum(cq, dq, sq, wq)
        q2 = _sum(cq, wq, -sq, dq)
        less = 1.0 / max(1.0 + _dot(u, w), _FLAT)
        kb = _sum(2.0 * less, _cross(u, w), 0.0, u)
        k1 = 0.5 * (_dot(p2, kb) + _dot(q2, kb))
        k2 = -0.5 * (_dot(p1, kb) + _dot(q1, kb))
        o1 = k1 - turns.kappa[h, 0]
        o2 = k2 - turns.kappa[h, 1]
        bent[h] = 2.0 * np.sqrt(o1 * o1 + o2 * o2) / rods.span[h]
        stiff = rods.alpha[h] / rods.span[h]
        tight = turns.beta[h] / rods.span[h]
        tau = theta[q] - theta[p] + reference[h] - turns.tau[h]
        energy += stiff * (o1 * o1 + o2 * o2) + tight * tau * tau
        w1 = 2.0 * stiff * o1
        w2 = 2.0 * stiff * o2
        wt = 2.0 * tight * tau
        along = -(w1 * k1 + w2 * k2) * less
        common = _sum(1.0, _sum(along, u, along, w), 0.5 * wt, kb)
        across = _sum(w1 * less, _sum(1.0, p2, 1.0, q2), -w2 * less, _sum(1.0, p1, 1.0, q1))
        gp = _sum(inverse[p], common, inverse[p], _cross(w, across))
        gq = _sum(inverse[q], common, -inverse[q], _cross(u, across))
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
