"""Contact of vertices with rigid bodies on given paths: a penalty with Coulomb friction, impulse and work accounted.

The thesis (3.2.5) reflects vertices as in elastic collisions. A penalty E = k g^2 / 2 in the depth g has an energy of
its own, so that what a body puts in can be balanced, and the same force serves the implicit scheme. Its stiffness
grows from nothing over the first part of the depth, so that Newton's method does not meet a kink at every vertex.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .arrays import Bodies

__all__ = ["pose", "press", "touch"]


@njit(cache=True, error_model="numpy")
def pose(bodies: Bodies, time: float, centre: np.ndarray, speed: np.ndarray) -> None:
    """Write centres (r, 3) [m] and velocities (r, 3) [m/s] at `time` [s]; bodies rest before and after their path."""
    for r in range(len(bodies.kind)):
        n = bodies.times.shape[1]
        last = 0
        while last + 1 < n and bodies.times[r, last + 1] <= time:
            last += 1
        for c in range(3):
            centre[r, c] = bodies.points[r, last, c]
            speed[r, c] = 0.0
        if last + 1 < n and time >= bodies.times[r, last]:
            width = bodies.times[r, last + 1] - bodies.times[r, last]
            if width > 0.0:
                for c in range(3):
                    speed[r, c] = (bodies.points[r, last + 1, c] - bodies.points[r, last, c]) / width
                    centre[r, c] += speed[r, c] * (time - bodies.times[r, last])


@njit(cache=True, error_model="numpy")
def touch(
    kind: int, axis: int, reach: np.ndarray, o0: float, o1: float, o2: float
) -> tuple[float, float, float, float, float]:
    """Return depth [m] (0: apart), radius of curvature [m] (0: flat) and outward normal at o from the centre [m]."""
    if kind == 0:
        g0 = reach[0] - abs(o0)
        g1 = reach[1] - abs(o1)
        g2 = reach[2] - abs(o2)
        gap = min(g0, min(g1, g2))
        if gap <= 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0
        if gap == g2:
            return gap, 0.0, 0.0, 0.0, 1.0 if o2 > 0 else -1.0
        if gap == g1:
            return gap, 0.0, 0.0, 1.0 if o1 > 0 else -1.0, 0.0
        return gap, 0.0, 1.0 if o0 > 0 else -1.0, 0.0, 0.0
    along = o0 if axis == 0 else (o1 if axis == 1 else o2)
    cap = reach[1] - abs(along)
    c0 = 0.0 if axis == 0 else o0
    c1 = 0.0 if axis == 1 else o1
    c2 = 0.0 if axis == 2 else o2
    away = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    gap = reach[0] - away
    if cap <= 0.0 or gap <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    if gap > cap and away > 0.0:
        side = 1.0 if along > 0 else -1.0
        return cap, 0.0, side if axis == 0 else 0.0, side if axis == 1 else 0.0, side if axis == 2 else 0.0
    if away == 0.0:
        return gap, reach[0], 0.0, 0.0 if axis != 2 else 1.0, 1.0 if axis != 2 else 0.0
    return gap, away, c0 / away, c1 / away, c2 / away


@njit(cache=True, error_model="numpy")
def press(
    x: np.ndarray,
    v: np.ndarray,
    f: np.ndarray,
    mass: np.ndarray,
    held: np.ndarray,
    bodies: Bodies,
    centre: np.ndarray,
    speed: np.ndarray,
    dt: float,
    rubbing: float,
    push: np.ndarray,
    power: np.ndarray,
    normals: np.ndarray,
    lagged: np.ndarray,
) -> float:
    """Add contact forces to f (v, 3) [N]; return the energy of the contacts [J].

    push (r, 3) [N] gets the force on each body; power[0] the power of the bodies, power[1] the power lost by friction
    [W]; normals (r, v) [N] the normal forces. With `rubbing` 0 friction is limited to what stops a vertex in half a
    step `dt` [s]. Above 0, for the implicit scheme, it follows the normal forces `lagged` (r, v) [N] and has its full
    size beyond this slip [m/s]: then it is the slope of a potential (Li et al. 2020, sec. 5.4).
    """
    energy = 0.0
    normals[:] = 0.0
    for r in range(len(bodies.kind)):
        reach = bodies.half[r]
        axis = bodies.axis[r]
        for i in range(len(x)):
            if held[i] == 1:
                continue
            gap, _, n0, n1, n2 = touch(
                bodies.kind[r],
                axis,
                reach,
                x[i, 0] - centre[r, 0],
                x[i, 1] - centre[r, 1],
                x[i, 2] - centre[r, 2],
            )
            if gap <= 0.0:
                continue
            if gap < bodies.ease[r]:
                normal = 0.5 * bodies.k[r] * gap * gap / bodies.ease[r]
                energy += normal * gap / 3.0
            else:
                normal = bodies.k[r] * (gap - 0.5 * bodies.ease[r])
                energy += bodies.k[r] * (0.5 * gap * (gap - bodies.ease[r]) + bodies.ease[r] ** 2 / 6.0)
            normals[r, i] = normal
            s0 = v[i, 0] - speed[r, 0]
            s1 = v[i, 1] - speed[r, 1]
            s2 = v[i, 2] - speed[r, 2]
            sn = s0 * n0 + s1 * n1 + s2 * n2
            s0 -= sn * n0
            s1 -= sn * n1
            s2 -= sn * n2
            slip = np.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
            drag = 0.0
            if bodies.friction[r] > 0.0 and slip > 0.0:
                if rubbing > 0.0:
                    soft = min(slip / rubbing, 1.0)
                    drag = bodies.friction[r] * lagged[r, i] * soft * (2.0 - soft) / slip
                else:
                    drag = min(bodies.friction[r] * normal, 0.5 * mass[i] * slip / dt) / slip
            p0 = normal * n0 - drag * s0
            p1 = normal * n1 - drag * s1
            p2 = normal * n2 - drag * s2
            f[i, 0] += p0
            f[i, 1] += p1
            f[i, 2] += p2
            push[r, 0] -= p0
            push[r, 1] -= p1
            push[r, 2] -= p2
            power[0] += p0 * speed[r, 0] + p1 * speed[r, 1] + p2 * speed[r, 2]
            power[1] += drag * slip * slip
    return energy
