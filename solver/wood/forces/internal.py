"""Forces within and between rods, part by part of a `Plan`; their energies only where they are looked at."""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.plan import REST, Plan
from .bonds import FORCES, READS, bind, bound, gather, parts
from .curves import ON_CURVE, curve, uncurve
from .rods import bend, bending, place, strain, stretch, stretching

__all__ = ["internal"]


@njit(cache=True, error_model="numpy")
def _gathered(
    pull: np.ndarray, seat: np.ndarray, lane: np.ndarray, rest: np.ndarray, force: np.ndarray, edge: np.ndarray
) -> None:
    """Add forces of bonds to those on their seats, pull (s, 8) [N], [N m], and to the rows of edges `rest` [m] long."""
    n = 0
    for q in range(len(lane) - 1):
        sx, sy, sz = 0.0, 0.0, 0.0
        ex, ey, ez = 0.0, 0.0, 0.0
        px, py, pz = 0.0, 0.0, 0.0
        qx, qy, qz = 0.0, 0.0, 0.0
        last = int(lane[q + 1])
        h = rest[q]
        while n < last:
            i = seat[n]
            gx, gy, gz = force[0, n], force[1, n], force[2, n]
            pull[i, 0] += gx
            pull[i, 1] += gy
            pull[i, 2] += gz
            pull[i, 3] += h * force[3, n]
            pull[i, 4] += h * force[4, n]
            pull[i, 5] += h * force[5, n]
            sx += gx
            sy += gy
            sz += gz
            ex += force[12, n]
            ey += force[13, n]
            ez += force[14, n]
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
def _seat(u: float, rest: float, row: np.ndarray, q: int, out: np.ndarray) -> None:
    """Write place [m] and slope at the share u of an edge, column q of its part's rows, to out (8,)."""
    a, b, a1, b1 = parts(u)
    for c in range(3):
        e, p, z = row[20 + c, q], row[23 + c, q], row[26 + c, q]
        out[c] = row[c, q] + u * e + a * p + b * z
        out[3 + c] = (e + a1 * p + b1 * z) / rest


@njit(cache=True, error_model="numpy")
def _unseat(u: float, rest: float, pull: np.ndarray, row: np.ndarray, q: int) -> None:
    """Add what pulls on such a seat (8,) to the forces in the edge's rows."""
    a, b, a1, b1 = parts(u)
    for c in range(3):
        f, t = pull[c], pull[3 + c] / rest
        row[c, q] -= f
        row[11 + c, q] += u * f + t
        row[ON_CURVE + c, q] += a * f + a1 * t
        row[ON_CURVE + 3 + c, q] += b * f + b1 * t


@njit(cache=True, error_model="numpy")
def _seated(rest: np.ndarray, row: np.ndarray, out: np.ndarray) -> None:
    """Do what `_seat` does in the middles of edges, out (m, 8): their number makes the loops worth it."""
    a, b, a1, b1 = parts(0.5)
    for q in range(len(out)):
        h = 1.0 / rest[q]
        for c in range(3):
            e, p, z = row[20 + c, q], row[23 + c, q], row[26 + c, q]
            out[q, c] = row[c, q] + 0.5 * e + a * p + b * z
            out[q, 3 + c] = (e + a1 * p + b1 * z) * h


@njit(cache=True, error_model="numpy")
def _unseated(rest: np.ndarray, pull: np.ndarray, row: np.ndarray) -> None:
    """Do what `_unseat` does for seats (m, 8) in the middles of edges."""
    a, b, a1, b1 = parts(0.5)
    for c in range(3):
        for q in range(len(pull)):
            f, t = pull[q, c], pull[q, 3 + c] / rest[q]
            row[c, q] -= f
            row[11 + c, q] += 0.5 * f + t
            row[ON_CURVE + c, q] += a * f + a1 * t
            row[ON_CURVE + 3 + c, q] += b * f + b1 * t


@njit(cache=True, error_model="numpy")
def _part_of(plan: Plan, e: int) -> int:
    p = 0
    while plan.part[p + 1] <= e:
        p += 1
    return p


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
    seats: np.ndarray,
    rows: np.ndarray,
    plan: Plan,
    turning: bool,
    look: bool,
    t: np.ndarray,
    inverse: np.ndarray,
    each: np.ndarray,
    found: np.ndarray,
) -> None:
    """Add the forces of all parts to f (v, 3) [N]; fill tangents t (e, 3) and 1/|e| (e,), `rows` and `seats`.

    With `turning`, bending is left to `twist.turn`. With `look`, each part's energies [J] of stretching, bending and
    bonds and its bound of `rods.strain` are written (p, 4), and what each bond would have by opening and by shear if it
    were whole, each (2, b) [J].
    """
    bonded = False
    for p in range(len(plan.part) - 1):
        # a part's last lane is the end of its bonds
        bonded = bonded or plan.lane[plan.part[p + 1] + p] > 0
    for p in range(len(plan.part) - 1):
        e = int(plan.part[p])
        z = int(plan.part[p + 1])
        edge = rows[p]
        count = z - e
        place(x, plan.a[e:z], plan.b[e:z], edge)
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
        if bonded:
            curve(count, plan.edge[p], edge)
            _seated(plan.edge[p, REST], edge, seats[0, e:z])
        else:
            edge[0:3] = 0.0
            _add(f, plan.a[e:z], plan.b[e:z], edge)
    if bonded:
        _joints(f, seats, rows, plan, look, each, found)


@njit(cache=True, error_model="numpy")
def _joints(
    f: np.ndarray, seats: np.ndarray, rows: np.ndarray, plan: Plan, look: bool, each: np.ndarray, found: np.ndarray
) -> None:
    """Add the forces of bonds to those in `rows`, and all to f; the rest as in `internal`."""
    edges = len(plan.a)
    for s in range(len(plan.stub)):
        p = _part_of(plan, plan.stub[s])
        q = plan.stub[s] - plan.part[p]
        _seat(plan.at[s], plan.edge[p, REST, q], rows[p], q, seats[0, edges + s])
    seats[1] = 0.0
    wide = plan.seat.shape[1]
    bond = np.empty((READS, wide + 4))
    force = np.empty((FORCES, wide))
    for p in range(len(plan.part) - 1):
        lane = plan.lane[plan.part[p] + p : plan.part[p + 1] + p + 1]
        bonds = int(lane[len(lane) - 1])
        gather(seats[0], plan.seat[p], lane, rows[p], bond)
        bind(bonds, plan.law[p], bond, force)
        _gathered(seats[1], plan.seat[p], lane, plan.edge[p, REST], force, rows[p])
        if look:
            bound(bonds, plan.law[p], bond, force)
            found[p, 2] = _sum(bonds, force[0])
            origin = plan.origin[p]
            for n in range(bonds):
                each[0, origin[n]] = force[1, n]
                each[1, origin[n]] = force[2, n]
    for s in range(len(plan.stub)):
        p = _part_of(plan, plan.stub[s])
        q = plan.stub[s] - plan.part[p]
        _unseat(plan.at[s], plan.edge[p, REST, q], seats[1, edges + s], rows[p], q)
    for p in range(len(plan.part) - 1):
        e = int(plan.part[p])
        z = int(plan.part[p + 1])
        _unseated(plan.edge[p, REST], seats[1, e:z], rows[p])
        uncurve(z - e, plan.edge[p], rows[p])
        _add(f, plan.a[e:z], plan.b[e:z], rows[p])
