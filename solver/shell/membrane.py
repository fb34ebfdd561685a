"""Membrane of constant-strain triangles, St. Venant-Kirchhoff against a rest metric of each triangle.

A rest metric is three numbers (g11, g12, g22): products of the rest edges corner 0 -> 1 and corner 0 -> 2. It needs
neither a rest shape in space nor a parametrisation; neighbours may disagree on their common edge (incompatible growth).
Strain e = (a - g) / 2 with a the current metric; energy A (lame tr(e)^2 / 2 + tr(e^2)), indices raised by g
(Ciarlet 2005, chapter on Koiter's membrane; mu = 1).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats, Ints
from ..contract import InvalidGeometry

__all__ = ["areas", "membrane", "membrane_tangent", "metric", "metric_of_lengths", "squares"]


def metric(x: Floats, triangles: Ints) -> Floats:
    """Return the metrics (f, 3) of triangles in space, x (n, 3)."""
    a, b = x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]]
    return np.stack([(a * a).sum(-1), (a * b).sum(-1), (b * b).sum(-1)], -1)


def metric_of_lengths(lengths: Floats) -> Floats:
    """Return the metrics (f, 3) of triangles with edges `lengths` (f, 3), edge k opposite to corner k.

    Raises:
        InvalidGeometry: lengths that no triangle has.

    """
    a, b, c = (np.asarray(lengths, float) ** 2).T
    found = np.stack([c, (c + b - a) / 2, b], -1)
    bad = ~(found[:, 0] * found[:, 2] - found[:, 1] ** 2 > 1e-14 * found[:, 0] * found[:, 2])
    if bad.any():
        raise InvalidGeometry(
            f"{int(bad.sum())} triangles have a rest edge as long as the other two or longer.",
            advice="Grow neighbouring edges together, or give tensors instead of lengths.",
        )
    return found


def squares(g: Floats) -> Floats:
    """Return the squared edges (f, 3) of metrics g (f, 3), edge k opposite to corner k."""
    return np.stack([g[:, 0] + g[:, 2] - 2 * g[:, 1], g[:, 2], g[:, 0]], -1)


def areas(g: Floats) -> Floats:
    """Return the areas (f,) of metrics g (f, 3); a triangle that has collapsed may be less than flat by rounding."""
    return 0.5 * np.sqrt(np.maximum(g[:, 0] * g[:, 2] - g[:, 1] ** 2, 0.0))


@njit(cache=True, nogil=True, error_model="numpy")
def membrane(
    x: Floats, triangles: Ints, g: Floats, lame: float, gradient: Floats, thick: Floats | None = None
) -> float:
    """Return the membrane's energy and add its gradient (n, 3); thick (f,): thickness over the sheet's, None for 1."""
    energy = 0.0
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        bx, by, bz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        g11, g12, g22 = g[t, 0], g[t, 1], g[t, 2]
        determinant = g11 * g22 - g12 * g12
        area = 0.5 * np.sqrt(determinant)
        if thick is not None:
            area *= thick[t]
        p, q, r = g22 / determinant, -g12 / determinant, g11 / determinant
        e11 = 0.5 * (ax * ax + ay * ay + az * az - g11)
        e12 = 0.5 * (ax * bx + ay * by + az * bz - g12)
        e22 = 0.5 * (bx * bx + by * by + bz * bz - g22)
        # mixed strain g^-1 e, and stress with both indices up
        m11, m12 = p * e11 + q * e12, p * e12 + q * e22
        m21, m22 = q * e11 + r * e12, q * e12 + r * e22
        trace = m11 + m22
        energy += area * (0.5 * lame * trace * trace + m11 * m11 + m22 * m22 + 2 * m12 * m21)
        s11 = area * (lame * trace * p + 2 * (m11 * p + m12 * q))
        s12 = area * (lame * trace * q + 2 * (m11 * q + m12 * r))
        s22 = area * (lame * trace * r + 2 * (m21 * q + m22 * r))
        fx, fy, fz = s11 * ax + s12 * bx, s11 * ay + s12 * by, s11 * az + s12 * bz
        hx, hy, hz = s12 * ax + s22 * bx, s12 * ay + s22 * by, s12 * az + s22 * bz
        gradient[j, 0] += fx
        gradient[j, 1] += fy
        gradient[j, 2] += fz
        gradient[k, 0] += hx
        gradient[k, 1] += hy
        gradient[k, 2] += hz
        gradient[i, 0] -= fx + hx
        gradient[i, 1] -= fy + hy
        gradient[i, 2] -= fz + hz
    return energy


@njit(cache=True, error_model="numpy")
def _positive(s11: float, s12: float, s22: float) -> tuple[float, float, float]:
    """Return the part of a symmetric 2x2 matrix with eigenvalues above 0."""
    mean, half = 0.5 * (s11 + s22), np.hypot(0.5 * (s11 - s22), s12)
    if mean - half >= 0:
        return s11, s12, s22
    if mean + half <= 0:
        return 0.0, 0.0, 0.0
    # (s - low) / (high - low) is the projector on the larger eigenvalue's direction
    scale, low = (mean + half) / (2 * half), mean - half
    return scale * (s11 - low), scale * s12, scale * (s22 - low)


@njit(cache=True, error_model="numpy")
def membrane_tangent(
    x: Floats, triangles: Ints, g: Floats, lame: float, places: Ints, blocks: Floats, thick: Floats | None = None
) -> None:
    """Add the tangent to `blocks` (nnz, 3, 3): exact where stress is tensile, without its compressive part elsewhere.

    Leaving compression out keeps the matrix positive semidefinite where the sheet is about to buckle.
    places: (f, 9) block of corner pair (row, column). thick: (f,) as `membrane` has it.
    """
    local = np.empty((2, 2, 3, 3))
    c, b = np.empty((3, 3)), np.empty((3, 2, 3))
    whole = np.empty((3, 3, 3, 3))
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        g11, g12, g22 = g[t, 0], g[t, 1], g[t, 2]
        determinant = g11 * g22 - g12 * g12
        area = 0.5 * np.sqrt(determinant)
        if thick is not None:
            area *= thick[t]
        p, q, r = g22 / determinant, -g12 / determinant, g11 / determinant
        e11, e12, e22 = -g11, -g12, -g22
        for d in range(3):
            u, v = x[j, d] - x[i, d], x[k, d] - x[i, d]
            e11 += u * u
            e12 += u * v
            e22 += v * v
            # derivatives of (e11, e22, 2 e12) by both edges
            b[0, 0, d], b[0, 1, d] = u, 0.0
            b[1, 0, d], b[1, 1, d] = 0.0, v
            b[2, 0, d], b[2, 1, d] = v, u
        e11, e12, e22 = 0.5 * e11, 0.5 * e12, 0.5 * e22
        c[0, 0], c[1, 1] = (lame + 2) * p * p, (lame + 2) * r * r
        c[0, 1] = lame * p * r + 2 * q * q
        c[0, 2], c[1, 2] = (lame + 2) * p * q, (lame + 2) * r * q
        c[2, 2] = lame * q * q + p * r + q * q
        c[1, 0], c[2, 0], c[2, 1] = c[0, 1], c[0, 2], c[1, 2]
        s11 = c[0, 0] * e11 + c[0, 1] * e22 + 2 * c[0, 2] * e12
        s22 = c[1, 0] * e11 + c[1, 1] * e22 + 2 * c[1, 2] * e12
        s12 = c[2, 0] * e11 + c[2, 1] * e22 + 2 * c[2, 2] * e12
        s11, s12, s22 = _positive(s11, s12, s22)
        for m in range(2):
            for n in range(2):
                stress = s12 if m != n else (s11 if m == 0 else s22)
                for d in range(3):
                    for h in range(3):
                        total = stress if d == h else 0.0
                        for u in range(3):
                            for v in range(3):
                                total += b[u, m, d] * c[u, v] * b[v, n, h]
                        local[m, n, d, h] = area * total
        whole[1:, 1:] = local
        for n in range(2):
            whole[0, n + 1] = -(local[0, n] + local[1, n])
            whole[n + 1, 0] = -(local[n, 0] + local[n, 1])
        whole[0, 0] = -(whole[0, 1] + whole[0, 2])
        for m in range(3):
            for n in range(3):
                at = places[t, 3 * m + n]
                for d in range(3):
                    for h in range(3):
                        blocks[at, d, h] += whole[m, n, d, h]
