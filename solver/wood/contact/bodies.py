"""Contact of edges with rigid bodies: a penalty with Coulomb friction, impulse and work accounted.

The thesis (3.2.5) reflects vertices as in elastic collisions. A penalty in the depth g has an energy of its own, so
that what a body puts in can be balanced: E = integral of k g^2 / 2 along the rods, by the midpoint rule at points fixed
on every edge. A point c = (1 - u) a + u b gives its force to both ends by the same shares, and what is opposite to it
acts on the body at c: momentum is kept, angular momentum too. The stiffness grows from nothing over the first part of
the depth, so that the force has no kink. Of a severed edge only the feet of its stubs touch. Depths are those of the
body's own frame; what slides, slides past the surface v + omega x r.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.arrays import MESH, Bodies, Poses, Rods
from .shapes import apart, depth, eased, points, sampled, touch

__all__ = ["deepest", "press"]

#: By how much the square of a normal's length may differ from 1, from rounding alone.
_UNIT = 1e-12
#: Points' whole edges that may stop a free body at once by friction.
_AMONG = 64.0


@njit(cache=True, error_model="numpy")
def _local(frame: np.ndarray, o0: float, o1: float, o2: float) -> tuple[float, float, float]:
    """Return o in a body's own frame (3, 3)."""
    return (
        frame[0, 0] * o0 + frame[1, 0] * o1 + frame[2, 0] * o2,
        frame[0, 1] * o0 + frame[1, 1] * o1 + frame[2, 1] * o2,
        frame[0, 2] * o0 + frame[1, 2] * o1 + frame[2, 2] * o2,
    )


@njit(cache=True, error_model="numpy")
def _world(frame: np.ndarray, o0: float, o1: float, o2: float) -> tuple[float, float, float]:
    """Return o, which is in a body's own frame (3, 3), in the world's."""
    return (
        frame[0, 0] * o0 + frame[0, 1] * o1 + frame[0, 2] * o2,
        frame[1, 0] * o0 + frame[1, 1] * o1 + frame[1, 2] * o2,
        frame[2, 0] * o0 + frame[2, 1] * o1 + frame[2, 2] * o2,
    )


@njit(cache=True, error_model="numpy")
def _bear(
    a: int,
    b: int,
    u: float,
    r: int,
    gap: float,
    n: tuple[float, float, float],
    arm: tuple[float, float, float],
    slide: tuple[float, float, float],
    law: tuple[float, float, float, float, float],
    v: np.ndarray,
    f: np.ndarray,
    push: np.ndarray,
) -> tuple[float, float, float]:
    """Add the force of one point (1 - u) a + u b at the depth gap [m] to f and push.

    n: outward normal, not of unit length if of a mesh; arm: the point from the body's pivot [m]; slide: velocity of the
    body there [m/s]; law: stiffness [N/m], depth over which it is gained [m], friction, and the mass [kg] that this may
    stop in half a step [s]. Returns its energy [J], the power that the body puts in and what friction loses [W].
    """
    n0, n1, n2 = n
    a0, a1, a2 = arm
    c0, c1, c2 = slide
    m = 1.0 - u
    own, normal = eased(gap, law[0], law[1])
    square = n0 * n0 + n1 * n1 + n2 * n2
    if abs(square - 1.0) > _UNIT:
        long = np.sqrt(square)
        if long == 0.0:
            return own, 0.0, 0.0
        n0, n1, n2, normal = n0 / long, n1 / long, n2 / long, normal * long
    s0 = m * v[a, 0] + u * v[b, 0] - c0
    s1 = m * v[a, 1] + u * v[b, 1] - c1
    s2 = m * v[a, 2] + u * v[b, 2] - c2
    sn = s0 * n0 + s1 * n1 + s2 * n2
    s0 -= sn * n0
    s1 -= sn * n1
    s2 -= sn * n2
    slip = np.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
    drag = 0.0
    if law[2] > 0.0 and slip > 0.0:
        drag = min(law[2] * normal, 0.5 * law[3] * slip / law[4]) / slip
    p0 = normal * n0 - drag * s0
    p1 = normal * n1 - drag * s1
    p2 = normal * n2 - drag * s2
    f[a, 0] += m * p0
    f[a, 1] += m * p1
    f[a, 2] += m * p2
    f[b, 0] += u * p0
    f[b, 1] += u * p1
    f[b, 2] += u * p2
    push[r, 0] -= p0
    push[r, 1] -= p1
    push[r, 2] -= p2
    push[r, 3] -= a1 * p2 - a2 * p1
    push[r, 4] -= a2 * p0 - a0 * p2
    push[r, 5] -= a0 * p1 - a1 * p0
    return own, p0 * c0 + p1 * c1 + p2 * c2, drag * slip * slip


@njit(cache=True, error_model="numpy")
def press(
    x: np.ndarray,
    v: np.ndarray,
    f: np.ndarray,
    mass: np.ndarray,
    rods: Rods,
    bodies: Bodies,
    poses: Poses,
    dt: float,
    push: np.ndarray,
    power: np.ndarray,
) -> float:
    """Add contact forces to f (v, 3) [N]; return the energy of the contacts [J].

    push (r, 6) gets the force [N] on each body and its moment about the pivot [N m]; power[0] the power of the
    bodies on ways, power[1] that lost by friction [W]. Friction is limited to what stops a point's share of the edge
    in half a step `dt` [s].
    """
    energy = 0.0
    for e in range(len(rods.a)):
        if rods.k[e] == 0.0:
            continue
        a = rods.a[e]
        b = rods.b[e]
        # of a severed edge the feet of its stubs
        whole = rods.alive[e] == 1
        count = bodies.first[e + 1] - bodies.first[e] if whole else 2
        share = 1.0 / count
        length = rods.rest[e] * share
        d0 = x[b, 0] - x[a, 0]
        d1 = x[b, 1] - x[a, 1]
        d2 = x[b, 2] - x[a, 2]
        for r in range(len(bodies.kind)):
            o0 = x[a, 0] - poses.centre[r, 0]
            o1 = x[a, 1] - poses.centre[r, 1]
            o2 = x[a, 2] - poses.centre[r, 2]
            # most are apart; all that calls for arrays costs more
            if apart(o0, d0, poses.box[r, 0]) or apart(o1, d1, poses.box[r, 1]) or apart(o2, d2, poses.box[r, 2]):
                continue
            kind, axis, turned, flies = bodies.kind[r], bodies.axis[r], bodies.turned[r] == 1, bodies.free.mass[r] > 0.0
            h0, h1, h2 = bodies.half[r, 0], bodies.half[r, 1], bodies.half[r, 2]
            g0, g1, g2 = bodies.edge[r, 0], bodies.edge[r, 1], bodies.edge[r, 2]
            q0, q1, q2, e0, e1, e2 = o0, o1, o2, d0, d1, d2
            if turned:
                q0, q1, q2 = _local(poses.frame[r], o0, o1, o2)
                e0, e1, e2 = _local(poses.frame[r], d0, d1, d2)
            begin, end = 0, 2
            if whole:
                begin, end = points(kind, axis, bodies.box[r], count, q0, q1, q2, e0, e1, e2)
            light = share * min(mass[a], mass[b])
            if flies:
                light = min(light, share * bodies.free.mass[r] / _AMONG)
            for q in range(begin, end):
                u = (q + 0.5) * share if whole else float(q)
                if kind == MESH:
                    gap, n0, n1, n2 = sampled(bodies.depths, r, q0 + u * e0, q1 + u * e1, q2 + u * e2)
                else:
                    gap, n0, n1, n2 = depth(kind, axis, h0, h1, h2, g0, g1, g2, q0 + u * e0, q1 + u * e1, q2 + u * e2)
                if gap <= 0.0:
                    continue
                if turned:
                    n0, n1, n2 = _world(poses.frame[r], n0, n1, n2)
                a0 = o0 + u * d0 + (poses.centre[r, 0] - poses.pivot[r, 0])
                a1 = o1 + u * d1 + (poses.centre[r, 1] - poses.pivot[r, 1])
                a2 = o2 + u * d2 + (poses.centre[r, 2] - poses.pivot[r, 2])
                w0, w1, w2 = poses.spin[r, 0], poses.spin[r, 1], poses.spin[r, 2]
                slide = (
                    poses.speed[r, 0] + (w1 * a2 - w2 * a1),
                    poses.speed[r, 1] + (w2 * a0 - w0 * a2),
                    poses.speed[r, 2] + (w0 * a1 - w1 * a0),
                )
                law = (bodies.k[r] * length, bodies.ease[r], bodies.friction[r], light, dt)
                own, put, lost = _bear(a, b, u, r, gap, (n0, n1, n2), (a0, a1, a2), slide, law, v, f, push)
                energy += own
                power[1] += lost
                if not flies:
                    power[0] += put
    return energy


@njit(cache=True, error_model="numpy")
def deepest(x: np.ndarray, rods: Rods, bodies: Bodies, poses: Poses, most: np.ndarray) -> None:
    """Write how deep a rod's axis is in each body to most (r,) [m], at the points that contact looks at."""
    most[:] = 0.0
    for e in range(len(rods.a)):
        if rods.k[e] == 0.0:
            continue
        count = bodies.first[e + 1] - bodies.first[e]
        for r in range(len(most)):
            for q in range(count):
                u = (q + 0.5) / count
                o = x[rods.a[e]] + u * (x[rods.b[e]] - x[rods.a[e]]) - poses.centre[r]
                q0, q1, q2 = _local(poses.frame[r], o[0], o[1], o[2])
                most[r] = max(most[r], touch(bodies, r, q0, q1, q2)[0])
