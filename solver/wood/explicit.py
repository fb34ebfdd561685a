"""The explicit scheme: symplectic, with velocities synchronised to the positions, and every joule booked.

Half a kick, a drift, half a kick (velocity Verlet): the same path as the thesis' symplectic Euler, but its energy is
taken where positions and velocities are of the same time, so that it is exact to second order in the step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from .arrays import Bodies, Bonds, Rods, Turns
from .bodies import pose, press
from .bonds import bind
from .rods import bend, stretch
from .rubbing import Rubbing, rub
from .twist import carry, turn, twists

__all__ = ["BENDING", "BONDS", "CONTACT", "LOST", "STRETCH", "WORK", "Motion", "Scratch", "forces", "march"]

#: Entries of the books [J]: energies of the present, then sums over time.
STRETCH, BENDING, BONDS, CONTACT, WORK, LOST = range(6)


class Motion(NamedTuple):
    """The state of all vertices and edges."""

    x: np.ndarray  # (v, 3) [m]
    v: np.ndarray  # (v, 3) [m/s]
    mass: np.ndarray  # (v,) [kg]
    held: np.ndarray  # (v,) uint8: keeps its velocity whatever the force
    load: np.ndarray  # (v, 3) dead load and weight [N]
    d: np.ndarray  # (e, 3) reference director
    old: np.ndarray  # (e, 3) tangent that d belongs to
    theta: np.ndarray  # (e,) angle of the material frame [radian]
    spin: np.ndarray  # (e,) [radian/s]
    reference: np.ndarray  # (h,) reference twist [radian]


class Scratch(NamedTuple):
    """What a step writes before it reads it; shapes as in `Motion`, bodies (r, 3), contacts (r, n); pairs of edges."""

    f: np.ndarray
    t: np.ndarray
    inverse: np.ndarray
    torque: np.ndarray
    each: np.ndarray
    centre: np.ndarray
    speed: np.ndarray
    push: np.ndarray
    power: np.ndarray
    lagged: np.ndarray
    rubbing: Rubbing


@njit(cache=True, error_model="numpy")
def forces(
    motion: Motion,
    rods: Rods,
    bonds: Bonds,
    turns: Turns,
    bodies: Bodies,
    scratch: Scratch,
    turning: bool,
    time: float,
    dt: float,
    rubbing: float,
    books: np.ndarray,
) -> None:
    """Fill scratch.f with all forces [N], loads and contacts included, and the first four books with energies [J]."""
    f = scratch.f
    f[:] = motion.load
    scratch.push[:] = 0.0
    scratch.power[:] = 0.0
    books[STRETCH] = stretch(motion.x, f, rods, scratch.t, scratch.inverse)
    if turning:
        scratch.torque[:] = 0.0
        carry(motion.d, motion.old, scratch.t, rods)
        twists(motion.d, scratch.t, rods, motion.reference)
        books[BENDING] = turn(
            f,
            scratch.torque,
            rods,
            turns,
            scratch.t,
            scratch.inverse,
            motion.d,
            motion.theta,
            motion.reference,
        )
    else:
        books[BENDING] = bend(f, rods, scratch.t, scratch.inverse)
    books[BONDS] = bind(motion.x, f, rods, bonds, scratch.t, scratch.inverse, scratch.each)
    books[CONTACT] = 0.0
    if len(bodies.kind) > 0:
        pose(bodies, time, scratch.centre, scratch.speed)
        books[CONTACT] = press(
            motion.x,
            motion.v,
            f,
            motion.mass,
            rods,
            bodies,
            scratch.centre,
            scratch.speed,
            dt,
            rubbing,
            scratch.push,
            scratch.power,
            scratch.lagged,
        )
    if len(scratch.rubbing.pair) > 0:
        books[CONTACT] += rub(motion.x, motion.v, f, motion.mass, rods, scratch.rubbing, dt, rubbing, scratch.power)


@njit(cache=True, error_model="numpy")
def _grip(motion: Motion, f: np.ndarray) -> float:
    """Return the power [W] that the holders of held vertices put in."""
    power = 0.0
    for i in range(len(f)):
        if motion.held[i] == 1:
            for c in range(3):
                power -= f[i, c] * motion.v[i, c]
    return power


@njit(cache=True, error_model="numpy")
def _dead(motion: Motion) -> float:
    """Return the power [W] of dead loads and weights."""
    power = 0.0
    for i in range(len(motion.x)):
        for c in range(3):
            power += motion.load[i, c] * motion.v[i, c]
    return power


@njit(cache=True, error_model="numpy")
def march(
    motion: Motion,
    rods: Rods,
    bonds: Bonds,
    turns: Turns,
    bodies: Bodies,
    scratch: Scratch,
    turning: bool,
    time: float,
    dt: float,
    steps: int,
    damping: float,
    books: np.ndarray,
    impulse: np.ndarray,
) -> bool:
    """Advance `steps` steps of `dt` [s] in place; scratch must hold the forces of the start. False: no longer finite.

    `damping` [1/s] slows every velocity by exp(-damping t). impulse (r, 3) [N s] gathers what each body received.
    """
    x = motion.x
    v = motion.v
    f = scratch.f
    slow = np.exp(-damping * dt)
    half = 0.5 * dt
    for n in range(steps):
        power = _grip(motion, f) + scratch.power[0]
        rubbed = scratch.power[1]
        work = 0.0
        for i in range(len(x)):
            if motion.held[i] == 0:
                w = half / motion.mass[i]
                v[i, 0] += w * f[i, 0]
                v[i, 1] += w * f[i, 1]
                v[i, 2] += w * f[i, 2]
            x[i, 0] += dt * v[i, 0]
            x[i, 1] += dt * v[i, 1]
            x[i, 2] += dt * v[i, 2]
        # dead loads: their work is load times way, without error
        work += dt * _dead(motion)
        if turning:
            for e in range(len(motion.theta)):
                if turns.inertia[e] > 0.0:
                    motion.spin[e] += half * scratch.torque[e] / turns.inertia[e]
                    motion.theta[e] += dt * motion.spin[e]
        for r in range(len(bodies.kind)):
            for c in range(3):
                impulse[r, c] += half * scratch.push[r, c]
        forces(motion, rods, bonds, turns, bodies, scratch, turning, time + (n + 1) * dt, dt, 0.0, books)
        for i in range(len(x)):
            if motion.held[i] == 0:
                w = half / motion.mass[i]
                v[i, 0] += w * f[i, 0]
                v[i, 1] += w * f[i, 1]
                v[i, 2] += w * f[i, 2]
        if turning:
            for e in range(len(motion.theta)):
                if turns.inertia[e] > 0.0:
                    motion.spin[e] += half * scratch.torque[e] / turns.inertia[e]
        for r in range(len(bodies.kind)):
            for c in range(3):
                impulse[r, c] += half * scratch.push[r, c]
        books[WORK] += work + half * (power + _grip(motion, f) + scratch.power[0])
        books[LOST] += half * (rubbed + scratch.power[1])
        if damping > 0.0:
            for i in range(len(x)):
                if motion.held[i] == 0:
                    was = v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1] + v[i, 2] * v[i, 2]
                    books[LOST] += 0.5 * motion.mass[i] * was * (1.0 - slow * slow)
                    v[i, 0] *= slow
                    v[i, 1] *= slow
                    v[i, 2] *= slow
            for e in range(len(motion.spin)):
                books[LOST] += 0.5 * turns.inertia[e] * motion.spin[e] ** 2 * (1.0 - slow * slow)
                motion.spin[e] *= slow
    total = books[STRETCH] + books[BENDING] + books[BONDS]
    return np.isfinite(total) and np.isfinite(v).all()
