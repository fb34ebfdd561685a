"""Selective mass scaling: what bends and stretches is heavier, what moves as a whole is not.

A slow press has no inertia to speak of, but the explicit step is bound by waves along single edges. With s times the
mass the stable step is sqrt(s) times as long; plain mass scaling would let fragments hang in the air, too. So a
fragment's rigid motion keeps its real mass (after Olovsson, Simonsson and Unosson 2005, who scale by elements):

    a = f / m + (1 - 1/g) (g F/M + alpha x r + omega x (omega x r)),    m = g times the real mass,
    alpha = g J^-1 T - J^-1 (omega x J omega)

with the fragment's force F, torque T, mass M and inertia J by the scaled m. Linear and angular momentum are those of
the real mass. The energy of motion is sum m v^2 / 2 less (1 - 1/g) of its rigid part. A rigidly turning fragment bears
its real centrifugal load. g is s, but less while something touches a fragment whose real mass it would throw off: the
longer step is too long for it. Then it falls and slides as if it were heavier.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.fragments import Fragments

__all__ = ["push", "rigid", "saved"]

#: Columns of what `rigid` finds of a fragment: middle, velocity, turning, and accelerations of both.
_MIDDLE, _SPEED, _SPIN, _PULL, _TWIST = 0, 3, 6, 9, 12
#: Of the trace of J, added to its diagonal: one straight rod does not turn about itself.
_ROUND = 1e-6
#: Inertia over that about the origin below which a fragment is one vertex, and its J round-off.
_POINT = 1e-12


@njit(cache=True, error_model="numpy")
def _cross(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def _solve(j: np.ndarray, right: np.ndarray, out: np.ndarray) -> None:
    """Write J^-1 right (3,) to out; j (6,): xx, yy, zz, xy, xz, yz. A single vertex, whose J is 0, does not turn."""
    trace = j[0] + j[1] + j[2]
    if trace == 0.0:
        out[:] = 0.0
        return
    more = _ROUND * trace + 1e-300
    a = j[0] + more
    b = j[1] + more
    c = j[2] + more
    d = j[3]
    e = j[4]
    g = j[5]
    p = b * c - g * g
    q = e * g - d * c
    r = d * g - b * e
    det = a * p + d * q + e * r
    s = a * c - e * e
    t = d * e - a * g
    u = a * b - d * d
    out[0] = (p * right[0] + q * right[1] + r * right[2]) / det
    out[1] = (q * right[0] + s * right[1] + t * right[2]) / det
    out[2] = (r * right[0] + t * right[1] + u * right[2]) / det


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _sums(x: np.ndarray, v: np.ndarray, f: np.ndarray, mass: np.ndarray, parts: Fragments) -> tuple[np.ndarray, ...]:
    """Write middle, velocity, force and torque of every fragment; return masses (n,), inertias (n, 6) and spins (n, 3).

    One pass about the origin, moved to the middle afterwards. Neighbours in the arrays are mostly of one fragment, so
    sums stay in registers: 4 ns a vertex, where three passes with sums in memory took 24.
    """
    number = len(parts.gain)
    total = np.zeros((number, 22))
    for r in range(len(parts.run) - 1):
        m0, s0, s1, s2 = 0.0, 0.0, 0.0, 0.0
        p0, p1, p2, l0, l1, l2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        f0, f1, f2, t0, t1, t2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        j0, j1, j2, j3, j4, j5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(parts.run[r], parts.run[r + 1]):
            m = mass[i]
            a = x[i, 0]
            b = x[i, 1]
            c = x[i, 2]
            u = m * v[i, 0]
            w = m * v[i, 1]
            z = m * v[i, 2]
            g = f[i, 0]
            h = f[i, 1]
            k = f[i, 2]
            m0 += m
            s0 += m * a
            s1 += m * b
            s2 += m * c
            p0 += u
            p1 += w
            p2 += z
            l0 += b * z - c * w
            l1 += c * u - a * z
            l2 += a * w - b * u
            f0 += g
            f1 += h
            f2 += k
            t0 += b * k - c * h
            t1 += c * g - a * k
            t2 += a * h - b * g
            j0 += m * a * a
            j1 += m * b * b
            j2 += m * c * c
            j3 += m * a * b
            j4 += m * a * c
            j5 += m * b * c
        n = parts.of[parts.run[r]]
        found = (m0, s0, s1, s2, p0, p1, p2, l0, l1, l2, f0, f1, f2, t0, t1, t2, j0, j1, j2, j3, j4, j5)
        for q in range(22):
            total[n, q] += found[q]
    heavy = total[:, 0].copy()
    inertia = np.zeros((number, 6))
    spin = np.zeros((number, 3))
    field = parts.field
    for n in range(number):
        one = total[n]
        m = one[0]
        a = one[1] / m
        b = one[2] / m
        c = one[3] / m
        for q in range(3):
            field[n, _MIDDLE + q] = one[1 + q] / m
            field[n, _SPEED + q] = one[4 + q] / m
            field[n, _PULL + q] = one[10 + q]
        spin[n, 0] = one[7] - (b * one[6] - c * one[5])
        spin[n, 1] = one[8] - (c * one[4] - a * one[6])
        spin[n, 2] = one[9] - (a * one[5] - b * one[4])
        field[n, _TWIST] = one[13] - (b * one[12] - c * one[11])
        field[n, _TWIST + 1] = one[14] - (c * one[10] - a * one[12])
        field[n, _TWIST + 2] = one[15] - (a * one[11] - b * one[10])
        xx = max(one[16] - m * a * a, 0.0)
        yy = max(one[17] - m * b * b, 0.0)
        zz = max(one[18] - m * c * c, 0.0)
        if xx + yy + zz <= _POINT * (one[16] + one[17] + one[18]):
            continue
        inertia[n, 0] = yy + zz
        inertia[n, 1] = xx + zz
        inertia[n, 2] = xx + yy
        inertia[n, 3] = m * a * b - one[19]
        inertia[n, 4] = m * a * c - one[20]
        inertia[n, 5] = m * b * c - one[21]
    return heavy, inertia, spin


@njit(cache=True, error_model="numpy")
def _turned(inertia: np.ndarray, spin: np.ndarray, out: np.ndarray) -> None:
    """Write J omega (3,) to out."""
    a, b, c, d, e, g = inertia
    out[0] = a * spin[0] + d * spin[1] + e * spin[2]
    out[1] = d * spin[0] + b * spin[1] + g * spin[2]
    out[2] = e * spin[0] + g * spin[1] + c * spin[2]


@njit(cache=True, error_model="numpy")
def rigid(x: np.ndarray, v: np.ndarray, f: np.ndarray, mass: np.ndarray, parts: Fragments, dt: float) -> float:
    """Find how every fragment moves and is accelerated as a whole by the forces f (v, 3) [N].

    Returns the energy of motion [J] that is not there dt [s] of these forces later, as fragments keep their real mass.
    """
    if len(parts.gain) == 0:
        return 0.0
    heavy, inertia, momentum = _sums(x, v, f, mass, parts)
    field = parts.field
    moment = np.zeros(3)
    torque = np.zeros(3)
    total = 0.0
    for n in range(len(parts.gain)):
        g = parts.gain[n]
        own = 0.0
        for c in range(3):
            field[n, _PULL + c] *= g / heavy[n]
            own += 0.5 * heavy[n] * (field[n, _SPEED + c] + dt * field[n, _PULL + c]) ** 2
            torque[c] = momentum[n, c] + dt * g * field[n, _TWIST + c]
        _solve(inertia[n], torque, moment)
        for c in range(3):
            own += 0.5 * torque[c] * moment[c]
        total += (1.0 - 1.0 / g) * own
        spin = field[n, _SPIN : _SPIN + 3]
        _solve(inertia[n], momentum[n], spin)
        _turned(inertia[n], spin, moment)
        _cross(spin, moment, torque)
        for c in range(3):
            torque[c] = g * field[n, _TWIST + c] - torque[c]
        _solve(inertia[n], torque, field[n, _TWIST : _TWIST + 3])
    return total


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def push(x: np.ndarray, v: np.ndarray, parts: Fragments, dt: float) -> None:
    """Add to v (v, 3) what dt [s] of the accelerations that `rigid` found add to f / m."""
    for r in range(len(parts.run) - 1):
        n = parts.of[parts.run[r]]
        share = dt * (1.0 - 1.0 / parts.gain[n])
        if share == 0.0:
            continue
        c0, c1, c2, _, _, _, w0, w1, w2, p0, p1, p2, a0, a1, a2 = parts.field[n]
        square = w0 * w0 + w1 * w1 + w2 * w2
        for i in range(parts.run[r], parts.run[r + 1]):
            r0 = x[i, 0] - c0
            r1 = x[i, 1] - c1
            r2 = x[i, 2] - c2
            # w x (w x r) = w (w.r) - r w.w
            along = w0 * r0 + w1 * r1 + w2 * r2
            v[i, 0] += share * (p0 + a1 * r2 - a2 * r1 + w0 * along - r0 * square)
            v[i, 1] += share * (p1 + a2 * r0 - a0 * r2 + w1 * along - r1 * square)
            v[i, 2] += share * (p2 + a0 * r1 - a1 * r0 + w2 * along - r2 * square)


def saved(x: np.ndarray, v: np.ndarray, mass: np.ndarray, parts: Fragments) -> float:
    """Return the energy of motion [J] that is not there as fragments as a whole keep their real mass."""
    return float(rigid(x, v, np.zeros_like(x), mass, parts, 0.0))
