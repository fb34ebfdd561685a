"""What a step of velocity Verlet does to every vertex, and the energy that it takes or gives.

Sums are added in lanes, as adding one number after the other would cost more than all the rest.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..model.arrays import Pins

__all__ = ["drift", "grip", "kick", "pin", "pinned", "slowed"]


@njit(cache=True, error_model="numpy")
def grip(held: np.ndarray, v: np.ndarray, f: np.ndarray) -> float:
    """Return the power [W] that the holders of the vertices `held` put in."""
    power = 0.0
    for n in range(len(held)):
        i = held[n]
        for c in range(3):
            power -= f[i, c] * v[i, c]
    return power


@njit(cache=True, error_model="numpy")
def pin(v: np.ndarray, mass: np.ndarray, pins: Pins) -> float:
    """Give what grips move its speed again; return the energy [J] that this takes."""
    put = 0.0
    for n in range(len(pins.vertex)):
        i = pins.vertex[n]
        c = pins.component[n]
        put += 0.5 * mass[i] * (pins.pace[n] ** 2 - v[i, c] ** 2)
        v[i, c] = pins.pace[n]
    return put


@njit(cache=True, error_model="numpy")
def pinned(f: np.ndarray, pins: Pins, dt: float) -> float:
    """Book the grips' impulse in dt [s]; return the power [W] that they put in."""
    power = 0.0
    for n in range(len(pins.vertex)):
        pull = f[pins.vertex[n], pins.component[n]]
        pins.taken[n] -= dt * pull
        power -= pull * pins.pace[n]
    return power


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def kick(v: np.ndarray, f: np.ndarray, weight: np.ndarray) -> None:
    """Add weight (v,) times f (v, 3) to v (v, 3)."""
    for i in range(len(v)):
        w = weight[i]
        v[i, 0] += w * f[i, 0]
        v[i, 1] += w * f[i, 1]
        v[i, 2] += w * f[i, 2]


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def drift(x: np.ndarray, v: np.ndarray, load: np.ndarray, dt: float) -> float:
    """Move x by v for dt [s]; return the work [J] of dead loads and weights: load times way, without error."""
    power = 0.0
    for i in range(len(x)):
        power += load[i, 0] * v[i, 0] + load[i, 1] * v[i, 1] + load[i, 2] * v[i, 2]
        x[i, 0] += dt * v[i, 0]
        x[i, 1] += dt * v[i, 1]
        x[i, 2] += dt * v[i, 2]
    return dt * power


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def slowed(v: np.ndarray, keep: np.ndarray, mass: np.ndarray) -> float:
    """Leave `keep` (v,) of every velocity; return the energy [J] that this takes."""
    lost = 0.0
    for i in range(len(v)):
        k = keep[i]
        was = v[i, 0] * v[i, 0] + v[i, 1] * v[i, 1] + v[i, 2] * v[i, 2]
        lost += 0.5 * mass[i] * was * (1.0 - k * k)
        v[i, 0] *= k
        v[i, 1] *= k
        v[i, 2] *= k
    return lost
