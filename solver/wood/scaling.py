"""Selective mass scaling: what bends and stretches is heavier, what moves as a whole is not.

A slow press has no inertia to speak of, but the explicit step is bound by waves along single edges. With s times the
mass the stable step is sqrt(s) times as long; plain mass scaling would let fragments hang in the air, too. So a
fragment's rigid motion keeps its real mass (after Olovsson, Simonsson and Unosson 2005, who scale by elements):

    a = f / m + (1 - 1/g) (g F/M + alpha x r + omega x (omega x r)),    m = g times the real mass,
    alpha = g J^-1 T - J^-1 (omega x J omega)

with the fragment's force F, torque T, mass M and inertia J by the scaled m. Linear and angular momentum are those of
the real mass. The energy of motion is sum m v^2 / 2 less (1 - 1/g) of its rigid part. A rigidly turning fragment bears
its real centrifugal load. g is s, but less while bodies touch a fragment whose real mass they would throw off: the
longer step is too long for it. Then it falls and slides as if it were heavier.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from .arrays import Bodies, Bonds, Rods
from .bodies import apart

__all__ = ["Fragments", "fragments", "push", "rigid", "saved", "steady"]

#: Columns of what `rigid` finds of a fragment: middle, velocity, turning, and accelerations of both.
_MIDDLE, _SPEED, _SPIN, _PULL, _TWIST = 0, 3, 6, 9, 12
#: Of the trace of J, added to its diagonal: one straight rod does not turn about itself.
_ROUND = 1e-6
#: How near a body an edge touches it, over the edge's length.
_NEAR = 0.05


class Fragments(NamedTuple):
    """Which vertices hang together. Without scaling there are none."""

    of: np.ndarray  # (v,) int32 fragment of a vertex
    gain: np.ndarray  # (n,) g of each; 1 where something is held
    heavy: np.ndarray  # (n,) scaled masses [kg]; 0 where something is held
    law: np.ndarray  # (2,) s; real mass that an edge in contact needs to be stable [kg]
    field: np.ndarray  # (n, 15) what `rigid` finds


@njit(cache=True)
def _root(up: np.ndarray, i: int) -> int:
    while up[i] != i:
        up[i] = up[up[i]]
        i = up[i]
    return i


@njit(cache=True)
def _join(up: np.ndarray, i: int, j: int) -> None:
    p = _root(up, i)
    q = _root(up, j)
    # the lower number is the root: the same whatever the order
    if p < q:
        up[q] = p
    elif q < p:
        up[p] = q


@njit(cache=True, error_model="numpy")
def fragments(rods: Rods, bonds: Bonds, held: np.ndarray, mass: np.ndarray, scaling: float, least: float) -> Fragments:
    """Return the fragments of what is whole; none if `scaling` is 1.

    held (v,) uint8; mass (v,) scaled [kg]; least [kg]: real mass that an edge in contact needs to be stable.
    """
    count = len(mass) if scaling > 1.0 else 0
    up = np.arange(count)
    of = np.zeros(count, np.int32)
    law = np.array([scaling, least])
    if count == 0:
        return Fragments(of, np.zeros(0), np.zeros(0), law, np.zeros((0, 15)))
    for e in range(len(rods.a)):
        if rods.alive[e] == 1 and rods.k[e] > 0.0:
            _join(up, rods.a[e], rods.b[e])
    for b in range(len(bonds.i)):
        if bonds.on[b] == 1:
            _join(up, bonds.i[b], rods.a[bonds.j[b]])
    number = 0
    name = np.full(count, -1, np.int32)
    for i in range(count):
        r = _root(up, i)
        if name[r] < 0:
            name[r] = number
            number += 1
        of[i] = name[r]
    heavy = np.zeros(number)
    for i in range(count):
        heavy[of[i]] += mass[i]
    for i in range(count):
        if held[i] == 1:
            heavy[of[i]] = 0.0
    gain = np.where(heavy > 0.0, scaling, 1.0)
    return Fragments(of, gain, heavy, law, np.zeros((number, 15)))


@njit(cache=True, error_model="numpy")
def steady(x: np.ndarray, rods: Rods, bodies: Bodies, centre: np.ndarray, parts: Fragments) -> None:
    """Set every g by the edges that touch bodies at `centre` (r, 3) [m]."""
    if len(parts.gain) == 0:
        return
    touching = np.zeros(len(parts.gain))
    for e in range(len(rods.a)):
        if rods.k[e] == 0.0:
            continue
        a = rods.a[e]
        b = rods.b[e]
        near = _NEAR * rods.rest[e]
        for r in range(len(bodies.kind)):
            found = True
            for c in range(3):
                p = x[a, c] - centre[r, c]
                d = x[b, c] - x[a, c]
                found = found and not apart(p, d, bodies.box[r, c] + near)
            if found:
                touching[parts.of[a]] += 1.0
    for n in range(len(parts.gain)):
        if parts.heavy[n] > 0.0:
            most = parts.heavy[n] / max(parts.law[1] * touching[n], 1e-300)
            parts.gain[n] = min(max(most, 1.0), parts.law[0])


@njit(cache=True, error_model="numpy")
def _cross(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def _solve(j: np.ndarray, right: np.ndarray, out: np.ndarray) -> None:
    """Write J^-1 right (3,) to out; j (6,): xx, yy, zz, xy, xz, yz."""
    more = _ROUND * (j[0] + j[1] + j[2]) + 1e-300
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


@njit(cache=True, error_model="numpy")
def _sums(x: np.ndarray, v: np.ndarray, mass: np.ndarray, parts: Fragments) -> tuple[np.ndarray, np.ndarray]:
    """Write middle, velocity and turning of every fragment; return masses (n,) and inertias (n, 6)."""
    field = parts.field
    number = len(parts.gain)
    heavy = np.zeros(number)
    field[:, : _SPIN + 3] = 0.0
    for i in range(len(x)):
        n = parts.of[i]
        heavy[n] += mass[i]
        for c in range(3):
            field[n, _MIDDLE + c] += mass[i] * x[i, c]
            field[n, _SPEED + c] += mass[i] * v[i, c]
    for n in range(number):
        for c in range(3):
            field[n, _MIDDLE + c] /= heavy[n]
            field[n, _SPEED + c] /= heavy[n]
    inertia = np.zeros((number, 6))
    for i in range(len(x)):
        n = parts.of[i]
        m = mass[i]
        r0 = x[i, 0] - field[n, 0]
        r1 = x[i, 1] - field[n, 1]
        r2 = x[i, 2] - field[n, 2]
        inertia[n, 0] += m * (r1 * r1 + r2 * r2)
        inertia[n, 1] += m * (r0 * r0 + r2 * r2)
        inertia[n, 2] += m * (r0 * r0 + r1 * r1)
        inertia[n, 3] -= m * r0 * r1
        inertia[n, 4] -= m * r0 * r2
        inertia[n, 5] -= m * r1 * r2
        w0 = v[i, 0] - field[n, 3]
        w1 = v[i, 1] - field[n, 4]
        w2 = v[i, 2] - field[n, 5]
        field[n, 6] += m * (r1 * w2 - r2 * w1)
        field[n, 7] += m * (r2 * w0 - r0 * w2)
        field[n, 8] += m * (r0 * w1 - r1 * w0)
    momentum = np.zeros(3)
    for n in range(number):
        momentum[:] = field[n, _SPIN : _SPIN + 3]
        _solve(inertia[n], momentum, field[n, _SPIN : _SPIN + 3])
    return heavy, inertia


@njit(cache=True, error_model="numpy")
def _turned(inertia: np.ndarray, spin: np.ndarray, out: np.ndarray) -> None:
    """Write J omega (3,) to out."""
    a, b, c, d, e, g = inertia
    out[0] = a * spin[0] + d * spin[1] + e * spin[2]
    out[1] = d * spin[0] + b * spin[1] + g * spin[2]
    out[2] = e * spin[0] + g * spin[1] + c * spin[2]


@njit(cache=True, error_model="numpy")
def rigid(x: np.ndarray, v: np.ndarray, f: np.ndarray, mass: np.ndarray, parts: Fragments) -> None:
    """Find how every fragment moves and is accelerated as a whole by the forces f (v, 3) [N]."""
    if len(parts.gain) == 0:
        return
    heavy, inertia = _sums(x, v, mass, parts)
    field = parts.field
    field[:, _PULL:] = 0.0
    for i in range(len(x)):
        n = parts.of[i]
        r0 = x[i, 0] - field[n, 0]
        r1 = x[i, 1] - field[n, 1]
        r2 = x[i, 2] - field[n, 2]
        for c in range(3):
            field[n, _PULL + c] += f[i, c]
        field[n, 12] += r1 * f[i, 2] - r2 * f[i, 1]
        field[n, 13] += r2 * f[i, 0] - r0 * f[i, 2]
        field[n, 14] += r0 * f[i, 1] - r1 * f[i, 0]
    moment = np.zeros(3)
    torque = np.zeros(3)
    for n in range(len(parts.gain)):
        g = parts.gain[n]
        for c in range(3):
            field[n, _PULL + c] *= g / heavy[n]
        spin = field[n, _SPIN : _SPIN + 3]
        _turned(inertia[n], spin, moment)
        _cross(spin, moment, torque)
        for c in range(3):
            torque[c] = g * field[n, _TWIST + c] - torque[c]
        _solve(inertia[n], torque, field[n, _TWIST : _TWIST + 3])


@njit(cache=True, error_model="numpy")
def push(x: np.ndarray, v: np.ndarray, parts: Fragments, dt: float) -> None:
    """Add to v (v, 3) what dt [s] of the accelerations that `rigid` found add to f / m."""
    field = parts.field
    for i in range(len(parts.of)):
        n = parts.of[i]
        share = dt * (1.0 - 1.0 / parts.gain[n])
        if share == 0.0:
            continue
        r0 = x[i, 0] - field[n, 0]
        r1 = x[i, 1] - field[n, 1]
        r2 = x[i, 2] - field[n, 2]
        w0 = field[n, 6]
        w1 = field[n, 7]
        w2 = field[n, 8]
        # w x (w x r) = w (w.r) - r w.w
        along = w0 * r0 + w1 * r1 + w2 * r2
        square = w0 * w0 + w1 * w1 + w2 * w2
        a0 = field[n, 12]
        a1 = field[n, 13]
        a2 = field[n, 14]
        v[i, 0] += share * (field[n, 9] + a1 * r2 - a2 * r1 + w0 * along - r0 * square)
        v[i, 1] += share * (field[n, 10] + a2 * r0 - a0 * r2 + w1 * along - r1 * square)
        v[i, 2] += share * (field[n, 11] + a0 * r1 - a1 * r0 + w2 * along - r2 * square)


@njit(cache=True, error_model="numpy")
def saved(x: np.ndarray, v: np.ndarray, mass: np.ndarray, parts: Fragments) -> float:
    """Return the energy of motion [J] that is not there as fragments as a whole keep their real mass."""
    if len(parts.gain) == 0:
        return 0.0
    heavy, inertia = _sums(x, v, mass, parts)
    moment = np.zeros(3)
    total = 0.0
    for n in range(len(parts.gain)):
        own = 0.0
        spin = parts.field[n, _SPIN : _SPIN + 3]
        _turned(inertia[n], spin, moment)
        for c in range(3):
            own += 0.5 * heavy[n] * parts.field[n, _SPEED + c] ** 2 + 0.5 * spin[c] * moment[c]
        total += (1.0 - 1.0 / parts.gain[n]) * own
    return total
