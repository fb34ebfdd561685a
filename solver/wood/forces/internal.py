"""Forces within and between rods, part by part of a `Plan`; their energies only where they are looked at."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import Plan
from .bonds import bind, bound, gather
from .rods import ROWS, bend, bending, place, strain, stretch, stretching

__all__ = ["internal"]


@njit(cache=True, error_model="numpy")
def _add(
    f: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    vertex: np.ndarray,
    lane: np.ndarray,
    edge: np.ndarray,
    force: np.ndarray,
) -> None:
    """Add the forces of edges and bonds to f (v, 3) [N]: edges act on both ends, and bear their bonds."""
    n = 0
    for q in range(len(a)):
        sx, sy, sz = 0.0, 0.0, 0.0
        hx, hy, hz = edge[11, q], edge[12, q], edge[13, q]
        last = int(lane[q + 1])
        while n < last:
            i = vertex[n]
            px, py, pz = force[0, n], force[1, n], force[2, n]
            f[i, 0] += px
            f[i, 1] += py
            f[i, 2] += pz
            sx += px
            sy += py
            sz += pz
            hx += force[3, n]
            hy += force[4, n]
            hz += force[5, n]
            n += 1
        i = b[q]
        f[i, 0] += hx
        f[i, 1] += hy
        f[i, 2] += hz
        i = a[q]
        f[i, 0] -= hx + sx
        f[i, 1] -= hy + sy
        f[i, 2] -= hz + sz


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
    bonds and its bound of `rods.strain` are written (p, 4), and the energy of each bond (b,) [J].
    """
    wide = plan.vertex.shape[1]
    edge = np.empty((ROWS, plan.edge.shape[2]))
    bond = np.empty((11, wide + 8))
    force = np.empty((6, wide))
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
        lane = plan.lane[e + p : z + p + 1]
        bonds = int(lane[count])
        gather(x, plan.vertex[p], lane, edge, bond)
        bind(bonds, plan.law[p], bond, force)
        _add(f, a, b, plan.vertex[p], lane, edge, force)
        if look:
            found[p, 0] = stretching(count, plan.edge[p], edge)
            found[p, 1] = 0.0 if turning else bending(count, plan.edge[p], edge)
            found[p, 3] = strain(count, plan.edge[p], edge)
            row = force[0]
            bound(bonds, plan.law[p], bond, row)
            found[p, 2] = _sum(bonds, row)
            origin = plan.origin[p]
            for n in range(bonds):
                each[origin[n]] = row[n]
