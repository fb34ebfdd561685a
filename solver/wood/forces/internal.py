"""Forces within and between rods, part by part of a `Plan`; their energies only where they are looked at."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import Plan
from .bonds import FORCES, READS, bind, bound, gather
from .curves import ON_CURVE, curve, uncurve
from .rods import ROWS, bend, bending, place, strain, stretch, stretching

__all__ = ["internal"]


@njit(cache=True, error_model="numpy")
def _gathered(
    f: np.ndarray, lean: np.ndarray, vertex: np.ndarray, lane: np.ndarray, force: np.ndarray, edge: np.ndarray
) -> None:
    """Add forces of bonds to their vertices in f (v, 3) [N], slopes in lean (v, 3) [N m], and the rows of edges."""
    n = 0
    for q in range(len(lane) - 1):
        sx, sy, sz = 0.0, 0.0, 0.0
        ex, ey, ez = 0.0, 0.0, 0.0
        px, py, pz = 0.0, 0.0, 0.0
        qx, qy, qz = 0.0, 0.0, 0.0
        last = int(lane[q + 1])
        while n < last:
            i = vertex[n]
            gx, gy, gz = force[0, n], force[1, n], force[2, n]
            f[i, 0] += gx
            f[i, 1] += gy
            f[i, 2] += gz
            lean[i, 0] += force[12, n]
            lean[i, 1] += force[13, n]
            lean[i, 2] += force[14, n]
            sx += gx
            sy += gy
            sz += gz
            ex += force[3, n]
            ey += force[4, n]
            ez += force[5, n]
            px += force[6, n]
            py += force[7, n]
            pz += force[8, n]
            qx += force[9, n]
            qy += force[10, n]
            qz += force[11, n]
            n += 1
        edge[0, q] = sx
        edge[1, q] = sy
        edge[2, q] = sz
        edge[11, q] += ex
        edge[12, q] += ey
        edge[13, q] += ez
        edge[ON_CURVE, q] = px
        edge[ON_CURVE + 1, q] = py
        edge[ON_CURVE + 2, q] = pz
        edge[ON_CURVE + 3, q] = qx
        edge[ON_CURVE + 4, q] = qy
        edge[ON_CURVE + 5, q] = qz


@njit(cache=True, error_model="numpy")
def _add(f: np.ndarray, a: np.ndarray, b: np.ndarray, edge: np.ndarray) -> None:
    """Add the forces of edges to f (v, 3) [N]: they act on both ends; first ends bear the bonds."""
    for q in range(len(a)):
        i = b[q]
        for c in range(3):
            f[i, c] += edge[11 + c, q]
        i = a[q]
        for c in range(3):
            f[i, c] -= edge[11 + c, q] + edge[c, q]


@njit(cache=True, error_model="numpy")
def _slopes(x: np.ndarray, plan: Plan, lean: np.ndarray) -> None:
    """Fill lean[0] with slopes, and lean[1] with nothing."""
    for i in range(len(x)):
        e = plan.leans[i, 0]
        g = plan.leans[i, 1]
        p = plan.factor[i, 0]
        q = plan.factor[i, 1]
        for c in range(3):
            lean[0, i, c] = p * (x[plan.b[e], c] - x[plan.a[e], c]) + q * (x[plan.b[g], c] - x[plan.a[g], c])
            lean[1, i, c] = 0.0


@njit(cache=True, error_model="numpy")
def _unslope(f: np.ndarray, plan: Plan, lean: np.ndarray) -> None:
    """Add what pulls on slopes, lean[1] [N m], to the vertices f (v, 3) [N] that make them up."""
    for i in range(len(f)):
        for n in range(2):
            e = plan.leans[i, n]
            for c in range(3):
                pull = plan.factor[i, n] * lean[1, i, c]
                f[plan.b[e], c] += pull
                f[plan.a[e], c] -= pull


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _sum(count: int, row: np.ndarray) -> float:
    # in lanes: one after the other costs half of a look
    total = 0.0
    for n in range(count):
        total += row[n]
    return total


@njit(cache=True, error_model="numpy")
def internal(
    x: np.ndarray,
    f: np.ndarray,
    lean: np.ndarray,
    plan: Plan,
    first: int,
    last: int,
    turning: bool,
    look: bool,
    t: np.ndarray,
    inverse: np.ndarray,
    each: np.ndarray,
    found: np.ndarray,
) -> None:
    """Add the forces of the parts from `first` to `last` to f (v, 3) [N]; fill tangents t (e, 3) and 1/|e| (e,).

    With `turning`, bending is left to `twist.turn`. With `look`, each part's energies [J] of stretching, bending and
    bonds and its bound of `rods.strain` are written (p, 4), and what each bond would have by opening and by shear if it
    were whole, each (2, b) [J].
    """
    wide = plan.vertex.shape[1]
    bonded = False
    for p in range(first, last):
        # a part's last lane is the end of its bonds
        bonded = bonded or plan.lane[plan.part[p + 1] + p] > 0
    if bonded:
        _slopes(x, plan, lean)
    edge = np.empty((ROWS, plan.edge.shape[2]))
    bond = np.empty((READS, wide + 8))
    force = np.empty((FORCES, wide))
    for p in range(first, last):
        e = int(plan.part[p])
        z = int(plan.part[p + 1])
        a = plan.a[e:z]
        b = plan.b[e:z]
        count = z - e
        place(x, a, b, edge)
        stretch(count, plan.edge[p], edge)
        own = t[e:z]
        other = inverse[e:z]
        for q in range(count):
            own[q, 0] = edge[6, q]
            own[q, 1] = edge[7, q]
            own[q, 2] = edge[8, q]
            other[q] = edge[10, q]
        if not turning:
            bend(count, plan.edge[p], edge)
        if look:
            found[p, 0] = stretching(count, plan.edge[p], edge)
            found[p, 1] = 0.0 if turning else bending(count, plan.edge[p], edge)
            found[p, 2] = 0.0
            found[p, 3] = strain(count, plan.edge[p], edge)
        lane = plan.lane[e + p : z + p + 1]
        bonds = int(lane[count])
        if bonds == 0:
            edge[0:3] = 0.0
            _add(f, a, b, edge)
            continue
        curve(count, plan.edge[p], edge)
        gather(x, lean[0], plan.vertex[p], lane, edge, bond)
        bind(bonds, plan.law[p], bond, force)
        _gathered(f, lean[1], plan.vertex[p], lane, force, edge)
        uncurve(count, plan.edge[p], edge)
        _add(f, a, b, edge)
        if look:
            bound(bonds, plan.law[p], bond, force)
            found[p, 2] = _sum(bonds, force[0])
            origin = plan.origin[p]
            for n in range(bonds):
                each[0, origin[n]] = force[1, n]
                each[1, origin[n]] = force[2, n]
    if bonded:
        _unslope(f, plan, lean)
