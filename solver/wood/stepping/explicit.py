"""The explicit scheme: symplectic, with velocities synchronised to the positions, and every joule booked.

Half a kick, a drift, half a kick (velocity Verlet): the same path as the thesis' symplectic Euler, but its energy is
taken where positions and velocities are of the same time, so that it is exact to second order in the step.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..contact.bodies import press
from ..contact.posing import pose
from ..contact.rubbing import rub
from ..forces.internal import internal
from ..forces.twist import carry, turn, twists
from ..model.arrays import Bodies, Pins, Rods, Turns
from ..model.motion import BENDING, BONDS, CONTACT, LOST, STRETCH, WORK, Motion, Scratch
from .flying import fly, strike
from .scaling import push, rigid
from .touching import steady
from .verlet import drift, grip, kick, pin, pinned, slowed

__all__ = ["forces", "march"]


def forces(
    motion: Motion,
    rods: Rods,
    turns: Turns,
    bodies: Bodies,
    scratch: Scratch,
    turning: bool,
    time: float,
    dt: float,
    books: np.ndarray,
) -> None:
    """Fill scratch.f with all forces [N], loads and contacts included, and the first four books with energies [J].

    scratch.plan must be that of rods and bonds; see `state.scratch_for`.
    """
    # not compiled: one more function around `_fill` is as long to compile as all that it holds
    _fill(motion, rods, turns, bodies, scratch, turning, time, dt, books, True)


@njit(cache=True, error_model="numpy")
def _fill(
    motion: Motion,
    rods: Rods,
    turns: Turns,
    bodies: Bodies,
    scratch: Scratch,
    turning: bool,
    time: float,
    dt: float,
    books: np.ndarray,
    look: bool,
) -> None:
    """Do what `forces` does; energies of rods and bonds only with `look`."""
    f = scratch.f
    plan = scratch.plan
    f[:] = motion.load
    scratch.push[:] = 0.0
    scratch.power[:] = 0.0
    internal(
        motion.x,
        f,
        scratch.seats,
        scratch.rows,
        plan,
        turning,
        look,
        scratch.t,
        scratch.inverse,
        scratch.each,
        scratch.found,
    )
    if look:
        books[STRETCH] = scratch.found[:, 0].sum()
        books[BENDING] = scratch.found[:, 1].sum()
        books[BONDS] = scratch.found[:, 2].sum()
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
            scratch.bent,
        )
    books[CONTACT] = 0.0
    if len(bodies.kind) > 0:
        pose(bodies, time, scratch.poses)
        books[CONTACT] = press(
            motion.x,
            motion.v,
            f,
            scratch.light,
            rods,
            bodies,
            scratch.poses,
            dt,
            scratch.push,
            scratch.power,
        )
    if len(scratch.rubbing.pair) > 0:
        books[CONTACT] += rub(motion.x, motion.v, f, scratch.light, rods, scratch.rubbing, dt, scratch.power)


@njit(cache=True, error_model="numpy")
def march(
    motion: Motion,
    rods: Rods,
    turns: Turns,
    bodies: Bodies,
    pins: Pins,
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

    `damping` [1/s] slows every velocity by exp(-damping t). impulse (r, 6) gathers what each body received:
    impulse [N s] and moment of it about its pivot [N m s].
    """
    x = motion.x
    v = motion.v
    f = scratch.f
    slow = np.exp(-damping * dt)
    half = 0.5 * dt
    held = np.flatnonzero(motion.held)
    weight = half / motion.mass
    weight[held] = 0.0
    keep = np.full(len(x), slow)
    keep[held] = 1.0
    whole = scratch.fragments
    flying = bodies.free.mass.any()
    books[LOST] -= rigid(x, v, f, motion.mass, whole, 0.0)
    steady(
        x,
        v,
        rods,
        bodies,
        scratch.poses,
        motion.mass,
        scratch.rubbing.pair,
        whole,
        dt * steps,
        scratch.light,
    )
    books[LOST] += rigid(x, v, f, motion.mass, whole, 0.0)
    for n in range(steps):
        power = grip(held, v, f) + pinned(f, pins, half) + scratch.power[0]
        rubbed = scratch.power[1]
        kick(v, f, weight)
        push(x, v, whole, half)
        pin(v, motion.mass, pins)
        work = drift(x, v, motion.load, dt)
        if flying:
            strike(bodies, scratch.poses, scratch.push, half)
            work += fly(bodies, dt)
        if turning:
            for e in range(len(motion.theta)):
                if turns.inertia[e] > 0.0:
                    motion.spin[e] += half * scratch.torque[e] / turns.inertia[e]
                    motion.theta[e] += dt * motion.spin[e]
        for r in range(len(bodies.kind)):
            for c in range(6):
                impulse[r, c] += half * scratch.push[r, c]
        look = n == steps - 1
        _fill(motion, rods, turns, bodies, scratch, turning, time + (n + 1) * dt, dt, books, look)
        less = rigid(x, v, f, motion.mass, whole, half)
        kick(v, f, weight)
        push(x, v, whole, half)
        pin(v, motion.mass, pins)
        if flying:
            strike(bodies, scratch.poses, scratch.push, half)
        if turning:
            for e in range(len(motion.theta)):
                if turns.inertia[e] > 0.0:
                    motion.spin[e] += half * scratch.torque[e] / turns.inertia[e]
        for r in range(len(bodies.kind)):
            for c in range(6):
                impulse[r, c] += half * scratch.push[r, c]
        books[WORK] += work + half * (power + grip(held, v, f) + pinned(f, pins, half) + scratch.power[0])
        books[LOST] += half * (rubbed + scratch.power[1])
        if damping > 0.0:
            books[LOST] -= less * (1.0 - slow * slow)
            books[LOST] += slowed(v, keep, motion.mass)
            books[WORK] += pin(v, motion.mass, pins)
            if turning:
                for e in range(len(motion.spin)):
                    books[LOST] += 0.5 * turns.inertia[e] * motion.spin[e] ** 2 * (1.0 - slow * slow)
                    motion.spin[e] *= slow
    # with the velocities of the end
    pose(bodies, time + steps * dt, scratch.poses)
    total = books[STRETCH] + books[BENDING] + books[BONDS]
    found: bool = np.isfinite(total) and np.isfinite(v).all() and np.isfinite(bodies.flight.v).all()
    return found
