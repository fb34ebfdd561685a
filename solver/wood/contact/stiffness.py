"""The stiffness of contacts for the implicit scheme; those with rigid bodies summed edge by edge."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..forces.hessian import Stiffness
from ..model.arrays import Bodies, Rods
from ..stepping.moment import State
from .bodies import apart, eased, points, touch
from .crossing import Crossing, crossings

__all__ = ["RUBBING", "Contacts", "Touching", "contacts", "lag"]

#: Slip at which friction has its full size [m/s].
RUBBING = 1e-3


@njit(cache=True, error_model="numpy")
def _contacts(
    x: np.ndarray,
    v: np.ndarray,
    rods: Rods,
    bodies: Bodies,
    centre: np.ndarray,
    speed: np.ndarray,
    lagged: np.ndarray,
    dt: float,
    positive: bool,
    edge: np.ndarray,
    out: np.ndarray,
) -> int:
    """Write edges that touch and their stiffness (n, 3, 3, 3); return their number."""
    n = np.zeros(3)
    s = np.zeros(3)
    number = 0
    for e in range(len(rods.a)):
        if rods.k[e] == 0.0:
            continue
        a = rods.a[e]
        b = rods.b[e]
        whole = rods.alive[e] == 1
        count = bodies.first[e + 1] - bodies.first[e] if whole else 2
        length = rods.rest[e] / count
        d0 = x[b, 0] - x[a, 0]
        d1 = x[b, 1] - x[a, 1]
        d2 = x[b, 2] - x[a, 2]
        touched = False
        for r in range(len(bodies.kind)):
            o0 = x[a, 0] - centre[r, 0]
            o1 = x[a, 1] - centre[r, 1]
            o2 = x[a, 2] - centre[r, 2]
            if apart(o0, d0, bodies.box[r, 0]) or apart(o1, d1, bodies.box[r, 1]) or apart(o2, d2, bodies.box[r, 2]):
                continue
            begin, end = 0, 2
            if whole:
                begin, end = points(bodies.kind[r], bodies.axis[r], bodies.box[r], count, o0, o1, o2, d0, d1, d2)
            for j in range(begin, end):
                u = (j + 0.5) / count if whole else float(j)
                m = 1.0 - u
                gap, bow, n[0], n[1], n[2] = touch(
                    bodies.kind[r], bodies.axis[r], bodies.half[r], o0 + u * d0, o1 + u * d1, o2 + u * d2
                )
                if gap <= 0.0:
                    continue
                if not touched:
                    touched = True
                    out[number] = 0.0
                    edge[number] = e
                _, normal, stiff = eased(gap, bodies.k[r] * length, bodies.ease[r])
                sn = 0.0
                for c in range(3):
                    s[c] = m * v[a, c] + u * v[b, c] - speed[r, c]
                    sn += s[c] * n[c]
                slip = 0.0
                for c in range(3):
                    s[c] -= sn * n[c]
                    slip += s[c] * s[c]
                slip = np.sqrt(slip)
                soft = min(slip / RUBBING, 1.0)
                drag = bodies.friction[r] * lagged[r, bodies.first[e] + j] / dt
                secant = drag * (2.0 - soft) / max(slip, RUBBING)
                slope = drag * 2.0 * (1.0 - soft) / RUBBING
                if positive:
                    # what only slides would be free to
                    secant = drag / max(slip, 0.5 * RUBBING)
                    slope = secant
                turn = 0.0 if positive or bow == 0.0 else normal / bow
                for p in range(3):
                    for q in range(3):
                        one = 1.0 if p == q else 0.0
                        flat = one - n[p] * n[q]
                        value = stiff * n[p] * n[q] + secant * flat
                        if slip > 0.0:
                            value += (slope - secant) * s[p] * s[q] / (slip * slip)
                        if turn > 0.0 and p != bodies.axis[r] and q != bodies.axis[r]:
                            value -= turn * flat
                        out[number, 0, p, q] += m * m * value
                        out[number, 1, p, q] += m * u * value
                        out[number, 2, p, q] += u * u * value
        if touched:
            number += 1
    return number


@njit(cache=True, error_model="numpy")
def _normals(x: np.ndarray, rods: Rods, bodies: Bodies, centre: np.ndarray, out: np.ndarray) -> None:
    """Write the normal forces (r, points) [N]."""
    out[:] = 0.0
    for e in range(len(rods.a)):
        if rods.k[e] == 0.0:
            continue
        a = rods.a[e]
        b = rods.b[e]
        whole = rods.alive[e] == 1
        count = bodies.first[e + 1] - bodies.first[e] if whole else 2
        length = rods.rest[e] / count
        d0 = x[b, 0] - x[a, 0]
        d1 = x[b, 1] - x[a, 1]
        d2 = x[b, 2] - x[a, 2]
        for r in range(len(bodies.kind)):
            o0 = x[a, 0] - centre[r, 0]
            o1 = x[a, 1] - centre[r, 1]
            o2 = x[a, 2] - centre[r, 2]
            if apart(o0, d0, bodies.box[r, 0]) or apart(o1, d1, bodies.box[r, 1]) or apart(o2, d2, bodies.box[r, 2]):
                continue
            begin, end = 0, 2
            if whole:
                begin, end = points(bodies.kind[r], bodies.axis[r], bodies.box[r], count, o0, o1, o2, d0, d1, d2)
            for j in range(begin, end):
                u = (j + 0.5) / count if whole else float(j)
                gap, _, _, _, _ = touch(
                    bodies.kind[r], bodies.axis[r], bodies.half[r], o0 + u * d0, o1 + u * d1, o2 + u * d2
                )
                if gap > 0.0:
                    out[r, bodies.first[e] + j] = eased(gap, bodies.k[r] * length, bodies.ease[r])[1]


@njit(cache=True)
def _times(a: np.ndarray, b: np.ndarray, h: np.ndarray, way: np.ndarray, out: np.ndarray) -> None:
    for n in range(len(h)):
        i = a[n]
        j = b[n]
        for p in range(3):
            for q in range(3):
                out[i, p] += h[n, 0, p, q] * way[i, q] + h[n, 1, p, q] * way[j, q]
                out[j, p] += h[n, 1, p, q] * way[i, q] + h[n, 2, p, q] * way[j, q]


class Touching(NamedTuple):
    """The stiffness of contacts [N/m]: of each edge that touches (n,), blocks of its ends aa, ab (also ba) and bb."""

    edge: np.ndarray  # (n,) int32
    a: np.ndarray  # (n,) int32 first vertex
    b: np.ndarray  # (n,) int32 second vertex
    h: np.ndarray  # (n, 3, 3, 3)

    def add(self, way: np.ndarray, out: np.ndarray) -> None:
        """Add the product with `way` to out, both (v, 3)."""
        _times(self.a, self.b, self.h, way, out)

    def spread(self, pattern: Stiffness, out: np.ndarray) -> None:
        """Add to the pattern's blocks out (nnz, 3, 3)."""
        for p, q, n in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
            to = pattern.place[self.edge, p, q]
            np.add.at(out, to[to >= 0], self.h[to >= 0, n])


class Contacts(NamedTuple):
    """The stiffness of all contacts, those of bodies and those between rods."""

    parts: tuple[Touching | Crossing, ...]

    def add(self, way: np.ndarray, out: np.ndarray) -> None:
        """Add the product with `way` to out, both (v, 3)."""
        for part in self.parts:
            part.add(way, out)

    def spread(self, pattern: Stiffness, out: np.ndarray) -> None:
        """Add to the pattern's blocks out (nnz, 3, 3) what has a place there."""
        for part in self.parts:
            part.spread(pattern, out)

    def couples(self) -> np.ndarray:
        """Return the vertices (m, 2) that contacts couple and no edge does."""
        return np.concatenate(
            [np.zeros((0, 2), np.int64), *(p.couples() for p in self.parts if isinstance(p, Crossing))]
        )


def contacts(state: State, dt: float, positive: bool) -> Contacts:
    """Return the stiffness of the contacts at the state's x and v.

    positive: as the factor needs it, without curvature and the slope of friction.
    """
    m, rubbing = state.wood.motion, state.scratch.rubbing
    parts: list[Touching | Crossing] = []
    if len(state.wood.bodies.kind):
        parts.append(_touching(state, dt, positive))
    if len(rubbing.pair):
        parts.append(crossings(m.x, m.v, state.wood.rods, rubbing, dt, RUBBING, positive))
    return Contacts(tuple(parts))


def _touching(state: State, dt: float, positive: bool) -> Touching:
    w, s = state.wood, state.scratch
    count = len(w.rods.a)
    edge, h = np.empty(count, np.int32), np.empty((count, 3, 3, 3))
    m = w.motion
    number = _contacts(m.x, m.v, w.rods, w.bodies, s.centre, s.speed, s.lagged, dt, positive, edge, h)
    edge = edge[:number]
    return Touching(edge, w.rods.a[edge], w.rods.b[edge], h[:number])


def lag(state: State) -> None:
    """Take the normal forces of the bodies where the state is as those that friction follows."""
    w = state.wood
    if len(w.bodies.kind):
        _normals(w.motion.x, w.rods, w.bodies, state.scratch.centre, state.scratch.lagged)
