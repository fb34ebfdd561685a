"""Bodies with a mass: what forces do to them, and how they fly between, with the wood's own steps.

The same velocity Verlet: half a kick, a drift, half a kick. A kick changes momentum and angular momentum, by exactly
what the rods receive of the opposite sign. In the drift a body turns freely, by turns about its principal axes one
after the other and back (Dullweber, Leimkuhler and McLachlan 1997): symplectic, of second order and reversible; its
angular momentum, kept in the world's frame, is not touched at all. Attitudes are unit quaternions.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..contact.posing import framed, joined, spun
from ..model.arrays import Bodies, Poses

__all__ = ["fly", "moving", "softest", "strike"]


@njit(cache=True, error_model="numpy")
def strike(bodies: Bodies, poses: Poses, push: np.ndarray, dt: float) -> None:
    """Change momenta by dt [s] of loads and of push (r, 6): force [N] and moment about the pivots [N m]."""
    flight, force = bodies.flight, np.empty(3)
    for r in range(len(bodies.kind)):
        mass = bodies.free.mass[r]
        if mass == 0.0:
            continue
        guide = bodies.free.guide[r]
        along = 0.0
        guided = False
        for c in range(3):
            force[c] = push[r, c] + bodies.free.load[r, c]
            along += guide[c] * force[c]
            guided = guided or guide[c] != 0.0
        for c in range(3):
            flight.v[r, c] += dt / mass * (along * guide[c] if guided else force[c])
        if guided:
            continue
        a0 = flight.place[r, 0] - poses.pivot[r, 0]
        a1 = flight.place[r, 1] - poses.pivot[r, 1]
        a2 = flight.place[r, 2] - poses.pivot[r, 2]
        flight.momentum[r, 0] += dt * (push[r, 3] - (a1 * push[r, 2] - a2 * push[r, 1]))
        flight.momentum[r, 1] += dt * (push[r, 4] - (a2 * push[r, 0] - a0 * push[r, 2]))
        flight.momentum[r, 2] += dt * (push[r, 5] - (a0 * push[r, 1] - a1 * push[r, 0]))


@njit(cache=True, error_model="numpy")
def _turn(bodies: Bodies, r: int, dt: float) -> None:
    """Turn body r freely for dt [s]."""
    inertia, flight = bodies.free.inertia[r], bodies.flight
    whole, about, axes = np.empty(4), np.empty(4), np.empty((3, 3))
    joined(flight.turn[r], bodies.free.axes[r], whole)
    for n in range(5):
        k = min(n, 4 - n)
        framed(whole, axes)
        own = 0.0
        for c in range(3):
            own += axes[c, k] * flight.momentum[r, c]
        half = 0.5 * dt * own / inertia[k] * (1.0 if n == 2 else 0.5)
        about[0] = np.cos(half)
        about[1], about[2], about[3] = 0.0, 0.0, 0.0
        about[1 + k] = np.sin(half)
        joined(whole, about, whole)
    # back from the principal axes; what rounding took of the length is given again
    about[0] = bodies.free.axes[r, 0]
    for c in range(1, 4):
        about[c] = -bodies.free.axes[r, c]
    joined(whole, about, whole)
    long = np.sqrt((whole * whole).sum())
    flight.turn[r] = whole / long


@njit(cache=True, error_model="numpy")
def fly(bodies: Bodies, dt: float) -> float:
    """Move bodies freely for dt [s]; return the work [J] of their loads, without error."""
    work, flight = 0.0, bodies.flight
    for r in range(len(bodies.kind)):
        if bodies.free.mass[r] == 0.0:
            continue
        guided = False
        for c in range(3):
            way = dt * flight.v[r, c]
            work += bodies.free.load[r, c] * way
            flight.place[r, c] += way
            guided = guided or bodies.free.guide[r, c] != 0.0
        if not guided:
            _turn(bodies, r, dt)
    return work


def moving(bodies: Bodies) -> float:
    """Return the energy of motion [J] of bodies with a mass."""
    total, spin = 0.0, np.zeros(3)
    for r in np.flatnonzero(bodies.free.mass > 0):
        total += 0.5 * float(bodies.free.mass[r] * (bodies.flight.v[r] ** 2).sum()) + spun(bodies, int(r), spin)
    return total


def softest(bodies: Bodies, rods: int) -> float:
    """Return the square of the highest frequency [1/s2] that contacts may give a body with a mass: a bound.

    As many rods as there are, through all of it: each point's stiffness over the mass that it meets, by Weyl's
    inequality beside what the wood's ends of these contacts add.
    """
    free, highest = bodies.free, 0.0
    for r in np.flatnonzero(free.mass > 0):
        light = 1.0 / free.mass[r]
        if not free.guide[r].any():
            axes = np.empty((3, 3))
            framed(free.axes[r], axes)
            half = np.abs(axes.T) @ (bodies.box[r] + np.abs(free.middle[r]))
            light += float((((half**2).sum() - half**2) / free.inertia[r]).sum())
        length = rods * 2 * float(np.linalg.norm(bodies.box[r]))
        highest = max(highest, float(bodies.k[r]) * length * float(light))
    return highest
