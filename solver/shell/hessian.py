"""Second derivatives of a shell's energy, exact: what Newton's method needs where a sheet is thin.

Membrane: area (B^T C B + stress), compressive stress included. Hinges: 2 k (grad theta grad theta^T + gap hess theta),
with hess theta by differentiating the closed form of grad theta in `bending` along each of the hinge's 12 coordinates
(the same matrix as Tamstorf and Grinspun 2013, table 1). Neither is definite: see `growth.settling.newton`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..arrays import Floats, Ints

__all__ = ["bending_hessian", "hinge_hessian", "membrane_hessian", "volume_hessian"]


@njit(cache=True, error_model="numpy")
def _cross(a: Floats, b: Floats, found: Floats) -> None:
    found[0] = a[1] * b[2] - a[2] * b[1]
    found[1] = a[2] * b[0] - a[0] * b[2]
    found[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def _dot(a: Floats, b: Floats) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@njit(cache=True, error_model="numpy")
def hinge_hessian(points: Floats, slopes: Floats, second: Floats) -> None:
    """Write gradient (4, 3) and second derivative (12, 12) of a hinge's angle; points (4, 3) as in `Topology.hinges`.

    A triangle without area has no normal: its part is 0, as in `bending`.
    """
    e, u, w = points[1] - points[0], points[2] - points[0], points[3] - points[0]
    n, o = np.empty(3), np.empty(3)
    _cross(e, u, n)
    _cross(w, e, o)
    square = _dot(e, e)
    length = np.sqrt(square)
    nn, oo = _dot(n, n), _dot(o, o)
    p = -length / nn if nn > 0 else 0.0
    q = -length / oo if oo > 0 else 0.0
    s, r = _dot(u, e) / square, _dot(w, e) / square
    for c in range(3):
        slopes[2, c], slopes[3, c] = p * n[c], q * o[c]
        slopes[1, c] = -(s * slopes[2, c] + r * slopes[3, c])
        slopes[0, c] = -((1 - s) * slopes[2, c] + (1 - r) * slopes[3, c])
    de, du, dw = np.empty(3), np.empty(3), np.empty(3)
    one, two, dn, do = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for v in range(4):
        for axis in range(3):
            de[:], du[:], dw[:] = 0.0, 0.0, 0.0
            if v == 0:
                de[axis], du[axis], dw[axis] = -1.0, -1.0, -1.0
            elif v == 1:
                de[axis] = 1.0
            elif v == 2:
                du[axis] = 1.0
            else:
                dw[axis] = 1.0
            _cross(de, u, one)
            _cross(e, du, two)
            for c in range(3):
                dn[c] = one[c] + two[c]
            _cross(dw, e, one)
            _cross(w, de, two)
            for c in range(3):
                do[c] = one[c] + two[c]
            dsquare = 2 * _dot(e, de)
            dlength = dsquare / (2 * length)
            dp = -dlength / nn + length * 2 * _dot(n, dn) / (nn * nn) if nn > 0 else 0.0
            dq = -dlength / oo + length * 2 * _dot(o, do) / (oo * oo) if oo > 0 else 0.0
            ds = (_dot(du, e) + _dot(u, de) - s * dsquare) / square
            dr = (_dot(dw, e) + _dot(w, de) - r * dsquare) / square
            row = 3 * v + axis
            for c in range(3):
                third, fourth = dp * n[c] + p * dn[c], dq * o[c] + q * do[c]
                second[row, 6 + c], second[row, 9 + c] = third, fourth
                second[row, 3 + c] = -(ds * slopes[2, c] + s * third + dr * slopes[3, c] + r * fourth)
                second[row, c] = -(-ds * slopes[2, c] + (1 - s) * third - dr * slopes[3, c] + (1 - r) * fourth)


@njit(cache=True, nogil=True, error_model="numpy")
def bending_hessian(
    x: Floats, hinges: Ints, angles: Floats, rest: Floats, stiffness: Floats, places: Ints, blocks: Floats
) -> None:
    """Add the bending energy's second derivative to `blocks` (nnz, 3, 3).

    angles, rest, stiffness (h,); places (h, 16): block of each pair of points.
    """
    points, slopes, second = np.empty((4, 3)), np.empty((4, 3)), np.empty((12, 12))
    for t in range(len(hinges)):
        for v in range(4):
            for c in range(3):
                points[v, c] = x[hinges[t, v], c]
        hinge_hessian(points, slopes, second)
        gap = angles[t] - rest[t]
        for u in range(4):
            for v in range(4):
                at = places[t, 4 * u + v]
                for c in range(3):
                    for d in range(3):
                        blocks[at, c, d] += (
                            2 * stiffness[t] * (slopes[u, c] * slopes[v, d] + gap * second[3 * u + c, 3 * v + d])
                        )


@njit(cache=True, nogil=True, error_model="numpy")
def membrane_hessian(
    x: Floats, triangles: Ints, g: Floats, lame: float, places: Ints, blocks: Floats, thick: Floats | None = None
) -> None:
    """Add the membrane energy's second derivative to `blocks` (nnz, 3, 3); places (f, 9), thick (f,) or None for 1."""
    edge = np.empty((2, 3))
    up, stress = np.empty((2, 2)), np.empty((2, 2))
    strain, mixed = np.empty((2, 2)), np.empty((2, 2))
    weight = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        g11, g12, g22 = g[t, 0], g[t, 1], g[t, 2]
        determinant = g11 * g22 - g12 * g12
        area = 0.5 * np.sqrt(determinant)
        if thick is not None:
            area *= thick[t]
        up[0, 0], up[0, 1], up[1, 0], up[1, 1] = (
            g22 / determinant,
            -g12 / determinant,
            -g12 / determinant,
            g11 / determinant,
        )
        for d in range(3):
            edge[0, d], edge[1, d] = x[j, d] - x[i, d], x[k, d] - x[i, d]
        strain[0, 0] = 0.5 * (_dot(edge[0], edge[0]) - g11)
        strain[0, 1] = 0.5 * (_dot(edge[0], edge[1]) - g12)
        strain[1, 0] = strain[0, 1]
        strain[1, 1] = 0.5 * (_dot(edge[1], edge[1]) - g22)
        for a in range(2):
            for b in range(2):
                mixed[a, b] = up[a, 0] * strain[0, b] + up[a, 1] * strain[1, b]
        trace = mixed[0, 0] + mixed[1, 1]
        for a in range(2):
            for b in range(2):
                stress[a, b] = lame * trace * up[a, b] + 2 * (mixed[a, 0] * up[0, b] + mixed[a, 1] * up[1, b])
        for m in range(3):
            for n in range(3):
                at = places[t, 3 * m + n]
                geometric = 0.0
                for a in range(2):
                    for b in range(2):
                        geometric += weight[m, a] * stress[a, b] * weight[n, b]
                for c in range(3):
                    for d in range(3):
                        # C^abcd = lame up^ab up^cd + up^ac up^bd + up^ad up^bc on edges and weights
                        total = geometric if c == d else 0.0
                        for a in range(2):
                            for b in range(2):
                                for h in range(2):
                                    for k2 in range(2):
                                        tensor = (
                                            lame * up[a, b] * up[h, k2] + up[a, h] * up[b, k2] + up[a, k2] * up[b, h]
                                        )
                                        total += tensor * weight[m, a] * edge[b, c] * weight[n, h] * edge[k2, d]
                        blocks[at, c, d] += area * total


@njit(cache=True, nogil=True, error_model="numpy")
def volume_hessian(x: Floats, triangles: Ints, factor: float, places: Ints, blocks: Floats) -> None:
    """Add factor times the second derivative of the volume inside, sum of x_i . (x_j x x_k) / 6, to `blocks`.

    The derivative of x_j x x_k by x_j is -[x_k], by x_k it is [x_j], [a] b = a x b. x (n, 3), triangles (f, 3) closed,
    places (f, 9) as in `Pattern`.
    """
    for t in range(len(triangles)):
        for corner in range(3):
            a, b = (corner + 1) % 3, (corner + 2) % 3
            for row, column, vertex, sign in ((corner, a, b, -1.0), (corner, b, a, 1.0)):
                block, v = blocks[places[t, 3 * row + column]], x[triangles[t, vertex]]
                part = sign * factor / 6
                block[0, 1] -= part * v[2]
                block[0, 2] += part * v[1]
                block[1, 0] += part * v[2]
                block[1, 2] -= part * v[0]
                block[2, 0] -= part * v[1]
                block[2, 1] += part * v[0]
